"""Fixed steps on the slider crank: they converge to the exact motion, and what coarse ones do to a verdict."""

from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import SimulationError
from chaosgym.simulation import RungeKutta4, simulate
from tests.plain_modes import PLAIN_CRANK

SMALL_GAP = replace(PLAIN_CRANK, crank_speed=250.0, slider_clearance=0.032e-3, matrix_update_interval=5.0)
BALL = replace(
    SMALL_GAP,
    slider_joint="ideal",
    ball_joint="spherical",
    gravity=9.81,
    crank_speed=120.0,
    rod="rigid",
)


@pytest.mark.parametrize(
    "machine",
    [SMALL_GAP, replace(SMALL_GAP, motor_angle=10.0), replace(SMALL_GAP, contact_law="hertz"), BALL],
    ids=["slider", "motor at an angle", "hertz", "ball"],
)
def test_small_steps_converge_to_the_exact_motion(machine):
    """The peak force comes within 0.2 % of the exact one; over a third of a turn smaller steps are closer."""
    exact = simulate(machine, 1, samples_per_cycle=60)
    coarse, fine = (
        simulate(machine, 1, samples_per_cycle=60, integrator=RungeKutta4(steps)) for steps in (6_000, 60_000)
    )
    assert fine.peak_force.max() == pytest.approx(exact.peak_force.max(), rel=2e-3)
    apart = [np.abs(run.history[0, :20, 0] - exact.history[0, :20, 0]).max() for run in (coarse, fine)]
    assert apart[1] < apart[0]
    assert abs(int(fine.impacts.sum()) - int(exact.impacts.sum())) <= 2
    assert fine.contact_fraction.sum() == pytest.approx(exact.contact_fraction.sum(), rel=0.02)


def test_coarse_steps_scatter_a_periodic_response():
    """200 rpm, +-0.032 mm: period 1 exactly; steps of 15 us misplace touch and release and scatter the peaks."""
    machine = replace(SMALL_GAP, crank_speed=200.0)
    exact = simulate(machine, 10, transient=40).peak_force.max(axis=1)
    fixed = simulate(machine, 10, transient=40, integrator=RungeKutta4(20_000)).peak_force.max(axis=1)
    assert np.ptp(exact) < 1e-4 * exact.mean()
    assert np.ptp(fixed) > 100.0 * np.ptp(exact)
    assert fixed.mean() == pytest.approx(exact.mean(), rel=0.02)


def test_a_step_that_grows_oscillations_is_an_error():
    """300 steps a revolution cannot follow the closed contact, and the error says so."""
    with pytest.raises(SimulationError, match="too coarse"):
        simulate(SMALL_GAP, 1, integrator=RungeKutta4(300))
