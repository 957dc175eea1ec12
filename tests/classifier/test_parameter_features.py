"""Groups of a beam's swing: the flight between the sensors is that of the equation of motion."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from chaosgym.classifier.kernels.parameters import flight
from chaosgym.classifier.parameter_features import feature_count, parameter_features, parameter_scaling
from tests.plain_modes import PLAIN_BEAM, PLAIN_CRANK


@pytest.mark.parametrize(("frequency", "gap"), [(2.0, 1e-5), (12.0, 1e-4), (38.0, 3e-4)])
def test_flight_follows_the_equation_of_motion(frequency, gap):
    """Time, phase and speed at the other sensor equal those of a numerical integration within a thousandth."""
    w, w1, damping, force = 2.0 * np.pi * frequency, 104.2, 56.3, 14.1
    leaves = (np.pi - np.arcsin(w1**2 * gap / force)) / w

    def motion(time, state):
        return state[1], force * np.sin(w * time) - damping * state[1] - w1**2 * state[0]

    def arrives(time, state):
        return state[0] + gap

    arrives.terminal = True
    run = solve_ivp(motion, (leaves, leaves + 1.0), (gap, 0.0), events=arrives, rtol=1e-10, atol=1e-14)
    time, phase, speed = flight(w, w1, damping, force, gap)
    assert time == pytest.approx(run.t[-1] - leaves, rel=1e-3)
    assert phase == pytest.approx(w * run.t[-1], rel=1e-3)
    assert speed == pytest.approx(-run.y[1, -1], rel=1e-3)


def test_only_beams_have_swing_groups():
    """A crank has the groups of its natural frequencies only; a beam's features have no gap in the known range."""
    speeds = np.array([[5.0, 2e-5], [35.0, 3e-4]])
    beam = parameter_scaling(PLAIN_BEAM, ("excitation_frequency", "clearance"), speeds)
    crank = parameter_scaling(PLAIN_CRANK, ("crank_speed", "slider_clearance"), speeds)
    assert feature_count(beam) > feature_count(crank) == 12
    assert np.isfinite(parameter_features(beam, speeds)).all()
    assert np.isnan(parameter_features(beam, np.zeros((1, 2)))).any()
