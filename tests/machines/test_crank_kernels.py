"""The kernel of the slider crank: twins by other integrators, conservation of energy, convergence, repeatability."""

import math
from dataclasses import replace

import numpy as np
import pytest
from numba import njit

from chaosgym import SliderCrank
from chaosgym.core.binned.cycle import advance
from chaosgym.core.binned.model import FORCING_TERMS
from chaosgym.core.binned.series import series_order
from chaosgym.core.binned.tables import table_places, tables
from chaosgym.core.cycle import cycle_arrays
from chaosgym.core.events import KEEPS, UNSURE, cubic, judge
from chaosgym.core.lanes import LANES, padded
from chaosgym.core.tangent import Tangents
from chaosgym.errors import SimulationError
from chaosgym.machines.binned.model import side_by_side
from chaosgym.machines.slider_crank.equations import equations
from chaosgym.simulation import ExactEvents, simulate, simulate_with_deviations
from tests.machines.crank_twin import continuous_twin, rigid_twin
from tests.plain_modes import PLAIN_CRANK

CRANK = PLAIN_CRANK
SMALL_GAP = replace(CRANK, crank_speed=250.0, slider_clearance=0.032e-3)


def test_half_a_turn_agrees_with_runge_kutta_and_continuous_matrices():
    """From rest through several impacts, displacement follows the twin to 0.2 %, velocity to 2 %, its own error."""
    machine = replace(SMALL_GAP, matrix_update_interval=0.5)
    steps, samples = 60_000, 60
    twin, _ = continuous_twin(machine, 180.0, steps, samples)
    history = simulate(machine, 1, samples_per_cycle=2 * steps // samples).history[0, : len(twin)]
    touching = (np.abs(twin[:, 0]) > machine.slider_clearance).astype(int)
    assert np.count_nonzero(np.diff(touching) == 1) >= 5
    np.testing.assert_allclose(history[:, 0], twin[:, 0], atol=2e-3 * machine.slider_clearance)
    np.testing.assert_allclose(history[:, 1], twin[:, 1], atol=2e-2 * np.abs(twin[:, 1]).max())


def test_the_peak_force_of_a_turn_agrees_with_runge_kutta():
    """The largest force of the first revolution at 250 rpm and +-0.032 mm agrees within 0.3 %."""
    machine = replace(SMALL_GAP, matrix_update_interval=0.5)
    _, peak = continuous_twin(machine, 360.0, 80_000, 80_000)
    assert simulate(machine, 1).peak_force.max() == pytest.approx(peak, rel=3e-3)


@pytest.mark.parametrize("gravity", [0.0, 9.81])
def test_a_rigid_rod_swings_like_the_exact_pendulum(gravity):
    """The nonlinear equation of the rigid mechanism, with the same contact, gives the same motion to 1 %."""
    machine = replace(CRANK, rod="rigid", geometric_stiffness="on", gravity=gravity, matrix_update_interval=0.5)
    samples = 360
    instants = np.arange(1, samples // 3) * (machine.cycle_period / samples)
    history = simulate(machine, 1, samples_per_cycle=samples).history[0, 1 : samples // 3, 0]
    np.testing.assert_allclose(history, rigid_twin(machine, instants), atol=0.01 * machine.slider_clearance)


def test_a_very_stiff_rod_moves_like_a_rigid_one():
    """The flexible code with a fiftyfold modulus and damped bending follows the rigid code."""
    stiff = replace(CRANK, youngs_modulus=1e13, n_modes=1, damping_ratio=0.5, matrix_update_interval=1.0)
    rigid = replace(stiff, rod="rigid")
    first, other = (simulate(machine, 1, samples_per_cycle=360).history[0] for machine in (stiff, rigid))
    np.testing.assert_allclose(first[:90, 0], other[:90, 0], atol=0.05 * CRANK.slider_clearance)


def frozen_model(machine, duration):
    """The model of an undamped machine that stands still at 40 deg: one bin's matrices for ever, no forcing.

    Without damping every term with a velocity is one of the crank's rate, so those go too.
    """
    model = machine.reduce()
    place = round(40.0 / machine.matrix_update_interval)
    m, n = model.row.shape
    at = table_places(n, m)
    row = model.table.reshape(2, model.bins, at.length)[:, place, at.acceleration : at.now]
    acceleration = row.reshape(2, 2 * n + FORCING_TERMS + m, padded(n + m))[:, :, :n]
    free, forcing, push = np.zeros((3, 2, 2 * n, n)), np.zeros((2, 2, FORCING_TERMS, n)), np.zeros((2, 2, 2 * n + m, n))
    free[0, :, :n] = acceleration[0, :n]
    push[1, :, :n] = acceleration[1, :n] - acceleration[0, :n]
    push[1, :, 2 * n :] = acceleration[1, 2 * n + FORCING_TERMS :]
    spectrum = 2.0 * model.contact_rate
    steps = math.ceil(duration / 2 * spectrum / LANES)
    order = series_order(duration / 2 * spectrum / (LANES * steps))
    undamped = np.zeros((2, 1))
    accelerations = map(side_by_side, (free, forcing, push))
    table = tables(*accelerations, 2, 0.0, model.row, undamped, model.anchor, duration / 2, steps, order)
    return model._replace(bin_duration=duration / 2, bins=2, steps=steps, order=order, spectrum=spectrum, table=table)


def test_energy_is_conserved_without_damping():
    """A standing mechanism that bounces between two springs keeps its energy to 1e-5 over hundreds of impacts."""
    machine = replace(CRANK, crank_speed=1.0, contact_damping_ratio=0.0, damping_ratio=0.0, damping_family="uniform")
    cycles, duration = 250, 0.05
    model = frozen_model(machine, duration)
    place = math.radians(round(40.0 / machine.matrix_update_interval) + 0.5) * machine.matrix_update_interval
    system = equations(machine, np.array([place]))
    mass, stiffness = system.mass[0], system.stiffness[0, 0]
    n = len(mass)
    state = np.zeros(2 * n)
    state[n : 2 * n] = [0.02, 0.1, 0.01, 0.0, 0.0]
    arrays = cycle_arrays(cycles, 2 * n, travels=True)
    none = Tangents(np.empty((0, 2 * n)), np.empty((cycles, 0)))
    outcome, _ = advance(model, state, np.zeros(3), arrays, 1e-13, 10_000, none)
    assert outcome == 0
    assert arrays.impacts.sum() > 500
    p, v = arrays.section[:, :n], arrays.section[:, n:]
    depth = np.maximum(np.abs(p[:, 1]) - machine.slider_clearance, 0.0)
    energy = 0.5 * np.einsum("ci,ij,cj->c", v, mass, v) + 0.5 * np.einsum("ci,ij,cj->c", p, stiffness, p)
    energy += 0.5 * machine.contact_stiffness * depth**2
    # the crank's own rate enters the held matrices with its square, here (0.1 rad/s)^2
    np.testing.assert_allclose(energy, energy[0], rtol=1e-5)


@pytest.mark.parametrize(
    ("change", "integrator", "tolerance"),
    [
        ({"n_modes": 5}, None, 0.02),
        ({"matrix_update_interval": 0.5}, None, 2e-4),
        ({}, ExactEvents().refined(), 1e-3),
    ],
)
def test_a_periodic_peak_force_converges(change, integrator, tolerance):
    """More modes, shorter bins or shorter steps change the periodic peak at 250 rpm, +-0.032 mm, only a little."""
    peak = simulate(SMALL_GAP, 1, transient=30).peak_force.max()
    refined = simulate(replace(SMALL_GAP, **change), 1, transient=30, integrator=integrator).peak_force.max()
    assert refined == pytest.approx(peak, rel=tolerance)


@pytest.mark.parametrize("speed", [200.0, 230.0, 250.0, 280.0])
def test_matrices_held_over_5_degrees_are_enough(speed):
    """At +-0.032 mm peaks recur at 5 deg as they do at 0.5 deg, and lie within 0.3 % of those."""
    machine = replace(CRANK, crank_speed=speed, slider_clearance=0.032e-3)
    coarse, fine = (
        simulate(replace(machine, matrix_update_interval=w), 10, transient=60).peak_force.max(axis=1)
        for w in (5.0, 0.5)
    )
    assert np.ptp(coarse) < 1e-3 * coarse.mean()
    assert coarse.mean() == pytest.approx(fine.mean(), rel=3e-3)


def test_a_run_can_be_continued_to_the_bit():
    """Two runs of 20 revolutions, the second from the first one's final state, equal one run of 40."""
    whole = simulate(CRANK, 40)
    first = simulate(CRANK, 20)
    second = simulate(CRANK, 20, first.final_state)
    assert np.array_equal(whole.section[20:], second.section)
    assert np.array_equal(whole.peak_force[20:], second.peak_force)
    assert np.array_equal(whole.bounce_duration[20:], second.bounce_duration)


@pytest.mark.parametrize(
    "change",
    [
        {},
        {"slider_clearance": 0.032e-3},
        {"slider_joint": "instrumented"},
        {"slider_joint": "ideal", "ball_joint": "spherical", "rod": "rigid", "gravity": 9.81},
    ],
)
def test_sampling_only_reads(change):
    """A time history of any density changes nothing else by a bit: states, peaks, impacts, times in contact."""
    machine = replace(CRANK, **change)
    plain = simulate(machine, 4)
    for samples in (1, 77, 3600):
        sampled = simulate(machine, 4, samples_per_cycle=samples)
        for field in ("section", "peak_force", "impacts", "contact_fraction", "bounce_duration"):
            assert np.array_equal(getattr(plain, field), getattr(sampled, field)), (field, samples)
        np.testing.assert_array_equal(sampled.history[:, 0, 0], plain.displacement)


def test_times_in_contact_are_those_of_the_history():
    """The share of a revolution in contact with each side is that of the samples with force on it."""
    record = simulate(SMALL_GAP, 1, transient=60, samples_per_cycle=20_000)
    force = record.history[0, :, 2]
    assert record.contact_fraction[0] == pytest.approx([np.mean(force > 0.0), np.mean(force < 0.0)], abs=5e-3)


def test_an_exhausted_event_budget_is_an_error():
    """A revolution with more contact events than allowed names the machine instead of returning numbers."""
    with pytest.raises(SimulationError, match="slider_clearance"):
        simulate(CRANK, 1, integrator=ExactEvents(event_budget=2))


def test_contacts_that_change_together_do_not_change_each_other_without_end():
    """The sliders' two ends touch and part at one instant, forces zero by rounding: no revolution has 400 changes."""
    for speed in np.linspace(60.0, 290.0, 24):
        machine = SliderCrank(slider_joint="instrumented", crank_speed=speed)
        simulate(machine, 3, integrator=ExactEvents(event_budget=400))


@njit
def judged(h, e0, d0, e1, d1, fourth):
    """What ``judge`` says, which kernels alone call."""
    return judge(h, e0, d0, e1, d1, fourth)


def test_a_cubic_that_dips_between_slopes_of_one_sign_is_not_taken_for_quiet():
    """A reading that is positive and falls at both ends of a step, but negative in between, is never said to keep."""
    ends = (1.0, 0.01, -1.0, 0.05, -1.0)
    e0, d0, e1, d1 = ends[1:]
    assert min(cubic(e0, d0, e1, d1, 1.0, t)[0] for t in np.linspace(0.0, 1.0, 11)) < 0.0
    assert judged(*ends, 0.0) == UNSURE
    # nor is one that is positive all along, if its fourth derivative may bend it below zero
    assert judged(1.0, 0.01, 0.0, 0.01, 0.0, 0.0) == KEEPS
    assert judged(1.0, 0.01, 0.0, 0.01, 0.0, 0.01 * 385.0) == UNSURE


@pytest.mark.parametrize(
    "change",
    [
        {"crank_speed": 250.0, "slider_clearance": 0.032e-3},
        {"friction_coefficient": 0.1},
        {"motor_angle": 15.0, "gravity": 9.81},
    ],
)
def test_deviations_are_the_derivative_of_a_revolution(change):
    """Deviations carried through every contact equal central differences to 1e-5, and leave the motion as it is."""
    machine = replace(CRANK, **change)
    assert machine.moving.deviations
    integrator = ExactEvents(event_tolerance=1e-13)
    state = simulate(machine, 1, transient=5).final_state.coordinates
    n = len(state)
    record, vectors, _ = simulate_with_deviations(
        machine, 1, state, deviations=np.eye(n), orthonormal=False, integrator=integrator
    )
    assert record.impacts.sum() > 5
    alone = simulate(machine, 1, state, integrator=integrator)
    assert np.array_equal(record.final_state.coordinates, alone.final_state.coordinates)
    differences = np.empty((n, n))
    for i, step in enumerate([1e-10] * (n // 2) + [1e-8] * (n // 2)):
        ends = [
            simulate(machine, 1, state + sign * step * np.eye(n)[i], integrator=integrator).final_state.coordinates
            for sign in (1.0, -1.0)
        ]
        differences[:, i] = (ends[0] - ends[1]) / (2.0 * step)
    # places in metres, velocities over the contact's frequency
    scale = np.r_[np.full(n // 2, machine.reduce().contact_rate), np.ones(n // 2)]
    found, expected = (scale[:, None] * matrix / scale for matrix in (vectors.T, differences))
    assert np.linalg.norm(found - expected) < 1e-5 * np.linalg.norm(expected)


def test_a_revolution_of_too_many_steps_is_refused_at_once():
    """Fast structural damping that asks for 1e7 steps ends in an error that says what to change."""
    machine = replace(CRANK, slider_joint="ideal", ball_joint="spherical", n_modes=6, damping_ratio=100.0)
    with pytest.raises(SimulationError, match="more steps than its budget allows"):
        simulate(machine, 1)
