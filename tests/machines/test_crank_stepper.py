"""The stepper of the slider crank against the exact kernel, the exact rigid mechanism and smaller steps."""

from dataclasses import replace

import numpy as np
import pytest

from chaosgym.core.binned.taylor import advance
from chaosgym.core.cycle import cycle_arrays
from chaosgym.core.tangent import Tangents, no_tangents
from chaosgym.machines.binned.stepped import stepped_model
from chaosgym.simulation import ExactEvents, simulate, simulate_with_deviations
from tests.machines.crank_twin import rigid_ball_twin
from tests.plain_modes import PLAIN_CRANK

SMALL_GAP = replace(PLAIN_CRANK, crank_speed=250.0, slider_clearance=0.032e-3)
BALL = replace(
    PLAIN_CRANK,
    slider_joint="ideal",
    ball_joint="spherical",
    gravity=9.81,
    crank_speed=120.0,
    rod="rigid",
    housing_offset_along=0.0,
    yoke_offset_along=0.0,
)


def stepped(machine, cycles, step_phase, tangents=None):
    """Run a piecewise linear machine by the stepper."""
    states = 2 * len(machine.degrees_of_freedom)
    arrays = cycle_arrays(cycles, states, travels=True)
    model = stepped_model(machine, step_phase)
    outcome, _ = advance(
        model, np.zeros(states), np.zeros(3), arrays, 1e-13, 10_000, tangents or no_tangents(states, 2)
    )
    assert outcome == 0
    return arrays


@pytest.mark.parametrize(
    "machine",
    [
        SMALL_GAP,
        replace(SMALL_GAP, friction_coefficient=0.1),
        replace(SMALL_GAP, slider_joint="ideal", ball_joint="instrumented", gravity=9.81, ball_clearance=0.02e-3),
    ],
    ids=["slider", "friction", "instrumented ball"],
)
def test_stepper_and_exact_propagation_agree(machine):
    """Two kernels that share no step give the same two revolutions, impact by impact."""
    exact = simulate(machine, 2)
    other = stepped(machine, 2, 0.5)
    assert exact.impacts.sum() > 3
    np.testing.assert_allclose(other.peak_force.max(axis=1), exact.peak_force.max(axis=1), rtol=1e-6)
    np.testing.assert_allclose(other.section[1], exact.section[1], atol=1e-6 * np.abs(exact.section[1]).max())
    np.testing.assert_allclose(
        other.contact_time.sum(axis=1), exact.contact_fraction.sum(axis=1) * machine.cycle_period, rtol=1e-6
    )


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_deviations_of_stepper_and_exact_propagation_agree(friction):
    """Two revolutions of impacts with dampers: two kernels that share no step carry all deviations alike, to 1e-4."""
    machine = replace(SMALL_GAP, friction_coefficient=friction)
    states = machine.n_states
    record, exact, _ = simulate_with_deviations(machine, 2, deviations=np.eye(states), orthonormal=False)
    along = Tangents(np.eye(states), np.empty((2, 0)))
    stepped(machine, 2, 0.25, along)
    assert record.impacts.sum() > 3
    weight = machine.state_weights(record.final_state.coordinates)
    scaled = weight * exact / weight[:, None]
    np.testing.assert_allclose(weight * along.vectors / weight[:, None], scaled, atol=1e-4 * np.abs(scaled).max())


@pytest.mark.parametrize(
    ("machine", "share"),
    [(BALL, 1e-6), (replace(SMALL_GAP, ball_joint="spherical", motor_angle=10.0), 1e-8)],
    ids=["ball", "both joints"],
)
def test_deviations_of_the_stepper_are_the_derivative_of_its_motion(machine, share):
    """A revolution of round contacts: carried deviations equal central differences to 1e-4."""
    precise, states = ExactEvents(step_phase=0.125, event_tolerance=1e-13), machine.n_states
    start = simulate(machine, 1, transient=2).final_state.coordinates
    weight = machine.state_weights(start)
    record, carried, growth = simulate_with_deviations(
        machine, 1, start, deviations=np.diag(1.0 / weight), orthonormal=False, integrator=precise
    )
    assert growth.shape == (1, 0)
    step = share * np.linalg.norm(weight * start)
    moved = [start + sign * step / weight[i] * np.eye(states)[i] for sign in (1.0, -1.0) for i in range(states)]
    ends = np.array([simulate(machine, 1, each, integrator=precise).final_state.coordinates for each in moved])
    differences = weight * (ends[:states] - ends[states:]) / (2.0 * step)
    np.testing.assert_allclose(weight * carried, differences, atol=1e-4 * np.abs(differences).max())
    plain = simulate(machine, 1, start, integrator=precise)
    assert np.array_equal(plain.final_state.coordinates, record.final_state.coordinates)


@pytest.mark.parametrize(
    ("machine", "errors"),
    [
        (SMALL_GAP, (1e-5, 1e-6)),
        (replace(SMALL_GAP, contact_law="hertz"), (1e-3, 1e-4)),
        (replace(SMALL_GAP, ball_joint="spherical", motor_angle=10.0), (1e-4, 1e-5)),
        (BALL, (1e-6, 2e-7)),
    ],
    ids=["slider", "hertz", "both joints", "ball"],
)
def test_series_of_the_longest_and_the_default_spans_leave_small_errors(machine, errors):
    """The state after a revolution of impacts, against that of spans with a ten-thousandth of the default error."""
    fine = simulate(machine, 2, integrator=ExactEvents(step_phase=0.05, event_tolerance=1e-13)).section[1]
    for phase, error in zip((1.0, 0.5), errors, strict=True):
        other = stepped(machine, 2, 2.0 * phase).section[1]
        np.testing.assert_allclose(other, fine, rtol=0.0, atol=error * np.abs(fine).max())


def test_a_ball_in_its_shell_moves_like_the_exact_rigid_mechanism():
    """The nonlinear motion of rod and slider gives the same eccentricity to 2 % of the clearance."""
    machine = replace(BALL, geometric_stiffness="on", matrix_update_interval=0.5)
    samples = 720
    instants = np.arange(1, samples // 2) * (machine.cycle_period / samples)
    history = simulate(machine, 1, samples_per_cycle=samples).history[0, 1 : samples // 2, 0]
    # the rod's end moves by minus the ball's eccentricity in the housing
    twin = -rigid_ball_twin(machine, instants)[:, 1]
    np.testing.assert_allclose(history, twin, atol=0.02 * machine.ball_clearance)


def test_hertzian_contact_gives_forces_of_the_same_size():
    """With the linear law's stiffness and restitution at 50 N, mean peaks near 36 N differ by less than 15 %."""
    linear = simulate(SMALL_GAP, 20, transient=20).peak_force.max(axis=1).mean()
    hertz = simulate(replace(SMALL_GAP, contact_law="hertz"), 20, transient=20).peak_force.max(axis=1).mean()
    assert hertz == pytest.approx(linear, rel=0.15)
    assert hertz != pytest.approx(linear, rel=1e-3)


def test_a_hertzian_drop_keeps_its_restitution():
    """A rigid slider that strikes at the reference force leaves with the linear law's speed, within 2 %."""
    machine = replace(
        PLAIN_CRANK,
        crank_speed=1.0,
        rod="rigid",
        matrix_update_interval=30.0,
        contact_law="hertz",
        contact_damping_ratio=0.025,
        slider_clearance=0.1e-3,
        hertz_reference_force=50.0,
    )
    model = stepped_model(machine, 0.25)
    total = machine.slider_mass + machine.yoke_mass
    # the speed at which the reference force is reached with the law's mass, as the effective mass has it
    strike = np.sqrt(0.8 * model.stiffness[0] * (50.0 / 1.5e7) ** 2.5 / total)
    start = np.array([0.0, strike])
    samples = 200_000
    history = simulate(machine, 1, start, samples_per_cycle=samples).history[0]
    inside = np.abs(history[:, 0]) < 0.9 * machine.slider_clearance
    back = history[inside & (history[:, 1] < -1e-3), 1]
    zeta = machine.contact_damping_ratio
    assert -back[0] / strike == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), rel=0.02)


def test_a_stepped_run_can_be_continued_to_the_bit():
    """Two runs of 3 revolutions equal one run of 6."""
    whole = simulate(BALL, 6)
    second = simulate(BALL, 3, simulate(BALL, 3).final_state)
    assert np.array_equal(whole.section[3:], second.section)
    assert np.array_equal(whole.peak_force[3:], second.peak_force)
