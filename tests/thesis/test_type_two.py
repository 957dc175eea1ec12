"""The mechanism of Type II: valleys of the force where the first contact mode ends a half cycle in opposite phase."""

import math
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.simulation import simulate
from thesis.figures.type_two import CLEARANCE, first_contact_mode
from thesis.scorecard.candidates import read_candidate


@pytest.mark.parametrize("name", ["A", "B", "C", "D", "E"])
def test_the_first_contact_mode_is_the_swing_about_the_sensor(name):
    """sqrt(3 (k_t + k_theta / L^2) / m) / 2 pi of a rigid beam about its tip, within 6 %: it bends a little."""
    beam = replace(read_candidate(name).machine, shaker_mass=0.0)
    mass = beam.density * beam.width * beam.height * beam.length
    spring = beam.pivot_translational_stiffness + beam.pivot_rotational_stiffness / beam.length**2
    assert first_contact_mode(beam) == pytest.approx(math.sqrt(3.0 * spring / mass) / (2.0 * math.pi), rel=0.06)


def test_a_soft_pivot_has_the_valley_at_a_third_of_the_contact_mode():
    """Candidate D: 30.5, 15 and 28 N within tolerances at 18, 19 and 20 Hz (3.5.1); a hard pivot has no valley."""
    peaks = {}
    for beam in (read_candidate("D").machine, read_candidate("former").machine):
        runs = [
            simulate(replace(beam, excitation_frequency=speed, clearance=CLEARANCE), 10, transient=100)
            for speed in (18.0, 19.0, 20.0)
        ]
        peaks[beam] = [float(one.peak_force[:, 0].mean()) for one in runs]
    soft, hard = peaks.values()
    assert np.all(np.abs(np.subtract(soft, (30.5, 15.0, 28.0))) <= (4.575, 3.0, 4.2))
    assert min(hard) > 0.8 * max(hard)
