"""All that the model of a machine of a few modes admits, against an independent integrator."""

import numpy as np
import pytest

from chaosgym.core import status
from chaosgym.core.cycle import cycle_arrays
from chaosgym.core.modal_impact import advance_model
from chaosgym.core.tangent import no_tangents
from chaosgym.machines.flexible_model import Modes, Stop, flexible_model
from chaosgym.machines.modal_blocks import largest_modulus, modal_blocks
from tests.core.twin import twin_trajectory

TWO_MODES = Modes(
    angular_frequency=np.array([60.0, 900.0]),
    damping=np.array([[6.0, 2.0], [2.0, 40.0]]),
    tip_shape=np.array([1.2, 0.8]),
    force_shape=np.array([1.0, 0.3]),
)
RIGID_AND_ELASTIC = TWO_MODES._replace(
    angular_frequency=np.array([0.0, 400.0]), damping=np.array([[0.0, 0.0], [0.0, 10.0]])
)
GEAR_PAIR = Modes(np.zeros(1), np.array([[12.0]]), np.ones(1), np.ones(1))
"""One motion of a rigid body with a damper: backlash under a torque."""


def _model(modes, stops, *, lower=None, static_force=None, drive=None):
    model = flexible_model(modes, 2e5, 30.0, lower=lower, static_force=static_force)
    forces = 5.0 * model.drive if drive is None else np.array(drive)
    return model._replace(excitation_frequency=12.0, stops=np.array(stops), drive=forces)


def _harmonics(modes):
    """Three harmonics with both phases, the third growing with the speed squared."""
    drive = np.zeros((2, 3, 2, len(modes.tip_shape)))
    drive[0, 0, 1], drive[0, 1, 0] = 4.0 * modes.force_shape, 2.0 * modes.force_shape
    drive[1, 2, 1] = 4e-4 * modes.tip_shape
    return drive


CASES = {
    "stops that differ": _model(TWO_MODES, (2e-4, -1e-4), lower=Stop(6e4, 5.0)),
    "one stop": _model(TWO_MODES, (1e-4, -np.inf)),
    "a lower stop only": _model(TWO_MODES, (np.inf, -1e-4)),
    "preload": _model(TWO_MODES, (3e-4, -1e-4), static_force=np.array([1.0, 0.5])),
    "harmonics": _model(TWO_MODES, (1e-4, -1e-4), drive=_harmonics(TWO_MODES)),
    "a rigid body without damper": _model(
        RIGID_AND_ELASTIC, (1e-4, -2e-4), static_force=np.array([1.5, 0.2]), drive=_harmonics(TWO_MODES)
    ),
    "a rigid body with damper": _model(GEAR_PAIR, (1e-4, -1e-4), lower=Stop(4e5, 10.0), static_force=np.array([2.0])),
}


def _run(model, cycles, samples, parts=(1,)):
    """History (cycles * samples, 3), impacts and the last state, run in parts."""
    n = len(model.tip_shape)
    state, bouncing = np.zeros(2 * n), np.zeros(3)
    arrays = cycle_arrays(cycles, 2 * n, samples)
    for rows in np.split(np.arange(cycles), np.cumsum(parts)[:-1]) if len(parts) > 1 else [np.arange(cycles)]:
        part = type(arrays)(*(array[rows[0] : rows[-1] + 1] for array in arrays))
        none = no_tangents(2 * n, len(rows))
        assert advance_model(model, 1.0, 0.5, 1e-9, state, bouncing, part, 20_000, none)[0] == status.OK
    return arrays.history.reshape(-1, 3), arrays.impacts, state


@pytest.mark.parametrize("case", CASES)
def test_agrees_with_a_general_integrator(case):
    """Displacement, velocity and force of two cycles equal DOP853's (rtol 1e-11, events) to 1e-6 of their size."""
    model = CASES[case]
    exact, impacts, _ = _run(model, 2, 200)
    twin = twin_trajectory(model, cycles=2, samples_per_cycle=200)
    assert impacts.sum() > 1
    assert np.all(np.abs(exact - twin).max(axis=0) <= 1e-6 * np.abs(twin).max(axis=0))


@pytest.mark.parametrize("case", CASES)
def test_runs_can_be_cut(case):
    """Five cycles are one and four of them, bit for bit."""
    whole, cut = _run(CASES[case], 5, 7), _run(CASES[case], 5, 7, parts=(1, 4))
    for one, other in zip(whole, cut, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("damping", [6.0, 1700.0, 1800.0, 27_000.0])
@pytest.mark.parametrize("coupling", [0.0, 2.0])
def test_intervals_are_short_for_the_fastest_eigenvalue(damping, coupling):
    """A mode of 900 rad/s decays at up to 30 times that beyond its critical damping, whose series need its own rate."""
    stiffness, damper = np.diag([60.0**2, 900.0**2]), np.array([[6.0, coupling], [coupling, damping]])
    system = np.block([[np.zeros((2, 2)), np.eye(2)], [-stiffness, -damper]])
    generator, _ = modal_blocks(stiffness, damper, rigid=False)
    assert largest_modulus(generator) == pytest.approx(np.abs(np.linalg.eigvals(system)).max(), rel=1e-8)


@pytest.mark.parametrize("damping", [0.0, 30.0])
def test_rounding_closes_no_contact(damping):
    """Each impact is a contact of its own: a joint that leaves a stop does not touch it again by rounding.

    A preload holds it a thousand gaps away from where a soft mode would rest.
    """
    soft = TWO_MODES._replace(angular_frequency=np.array([3.0, 900.0]))
    model = flexible_model(soft, 2e5, damping, static_force=np.array([1.0, 0.5]))
    model = model._replace(excitation_frequency=12.0, stops=np.array([1e-4, -1e-4]), drive=20.0 * model.drive)
    samples = 100_000
    history, impacts, _ = _run(model, 2, samples)
    pressed = history[:, 2] != 0.0
    assert impacts.sum() == np.sum(pressed[1:] & ~pressed[:-1]) > 1


@pytest.mark.parametrize("rounding", [1e-9, -1e-9])
@pytest.mark.parametrize("case", ["stops that differ", "one stop", "preload", "harmonics"])
def test_sets_that_agree_by_rounding_alone_do_not_chatter(case, rounding):
    """Where a state is a little more or less in flight than in contact, impacts are those of one that is the same.

    A joint whose pressure has just ended would otherwise close at once by the difference, and open again.
    """
    model = CASES[case]
    to_modal = model.regimes.to_modal.copy()
    to_modal[0] *= 1.0 + rounding
    _, impacts, _ = _run(model._replace(regimes=model.regimes._replace(to_modal=to_modal)), 5, 0)
    np.testing.assert_array_equal(impacts, _run(model, 5, 0)[1])
