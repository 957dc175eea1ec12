"""The exact propagation of the impact beam against an independent integrator, closed forms and conservation laws."""

import gc
import pickle
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from chaosgym.errors import SimulationError
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.machines.impact_beam.machine import _structure
from chaosgym.simulation import ExactEvents, RungeKutta4, simulate
from tests.core.twin import twin_trajectory
from tests.plain_modes import PLAIN_BEAM


def _history(beam, cycles, samples, **options):
    return simulate(beam, cycles, samples_per_cycle=samples, **options).history.reshape(-1, 3)


@pytest.mark.parametrize("clearance", [0.127e-3, 0.032e-3])
def test_agrees_with_a_general_integrator_over_three_cycles(clearance):
    """At 30 Hz displacement, velocity and contact force equal DOP853's (rtol 1e-11, events) to 1e-7."""
    beam = replace(PLAIN_BEAM, clearance=clearance)
    twin = twin_trajectory(beam.reduce(), cycles=3, samples_per_cycle=200)
    exact = _history(beam, 3, 200)
    assert np.abs(twin[:, 2]).max() > 20.0
    assert np.all(np.abs(exact - twin).max(axis=0) <= 1e-7 * np.abs(twin).max(axis=0))


def test_finds_a_release_that_lasts_less_than_a_step():
    """At 19 Hz a sensor lets go for microseconds: coarse twins pull there, the exact kernel and a fine twin do not."""
    beam = replace(PLAIN_BEAM, excitation_frequency=19.0)
    fine = twin_trajectory(beam.reduce(), cycles=1, samples_per_cycle=2000, max_phase=0.2)
    coarse = twin_trajectory(beam.reduce(), cycles=1, samples_per_cycle=2000, max_phase=0.5)
    exact = _history(beam, 1, 2000)
    scale = np.abs(fine).max(axis=0)
    assert np.any(coarse[:, 2] * coarse[:, 0] < 0.0)
    assert np.all(exact[:, 2] * exact[:, 0] >= 0.0)
    assert np.all(np.abs(exact - fine).max(axis=0) <= 1e-7 * scale)


@pytest.mark.parametrize("integrator", [ExactEvents(), RungeKutta4(8000)])
def test_contact_never_pulls(integrator):
    """The force acts outwards only, only beyond a surface, and vanishes in the detached state beyond it."""
    beam = PLAIN_BEAM
    displacement, _, force = _history(beam, 40, 2000, integrator=integrator).T
    assert np.all(force * displacement >= 0.0)
    assert np.all(force[np.abs(displacement) < beam.clearance * (1 - 1e-9)] == 0.0)
    assert np.any(force[np.abs(displacement) > beam.clearance * (1 + 1e-9)] == 0.0)


def test_accuracy_does_not_depend_on_the_step():
    """A four times longer shortest step changes three cycles by less than 1e-8: propagation has no truncation error."""
    short = _history(PLAIN_BEAM, 3, 100, integrator=ExactEvents(step_phase=0.25))
    long = _history(PLAIN_BEAM, 3, 100, integrator=ExactEvents(step_phase=1.0))
    assert np.all(np.abs(short - long).max(axis=0) <= 1e-8 * np.abs(short).max(axis=0))


def test_runge_kutta_approaches_the_exact_motion():
    """The error of the fixed-step method in the first three cycles falls steadily as the step shrinks."""
    exact = _history(PLAIN_BEAM, 3, 50)[:, 0]
    errors = [
        np.abs(_history(PLAIN_BEAM, 3, 50, integrator=RungeKutta4(steps))[:, 0] - exact).max()
        for steps in (2000, 8000, 32000)
    ]
    assert errors[0] > 2 * errors[1] > 4 * errors[2]


def test_without_contact_the_response_is_the_linear_one():
    """With a gap that is never touched the motion settles on the closed-form frequency response."""
    beam = replace(PLAIN_BEAM, clearance=1.0, shaker_damping=200.0)
    model = beam.reduce()
    omega = 2 * np.pi * beam.excitation_frequency
    dynamic = np.diag(model.stiffness - omega**2) + 1j * omega * model.damping
    amplitude = model.tip_shape @ np.linalg.solve(dynamic, beam.structure.drive[0, 0, 1] * beam.force_amplitude)
    phase = np.arange(100) / 100
    expected = (amplitude * np.exp(2j * np.pi * phase)).imag
    record = simulate(beam, 1, transient=400, samples_per_cycle=100)
    assert record.peak_force.max() == 0.0
    np.testing.assert_allclose(record.history[0, :, 0], expected, atol=1e-9 * np.abs(amplitude))


def test_energy_is_conserved_without_damping():
    """With no damper and no force, kinetic, bending and contact energy stay constant through 200 cycles of impacts."""
    beam = replace(PLAIN_BEAM, force_amplitude=0.0, damping_ratio=0.0, shaker_damping=0.0, contact_damping=0.0)
    model = beam.reduce()
    start = np.zeros(2 * beam.n_modes)
    start[beam.n_modes] = 0.02
    record = simulate(beam, 200, start)
    n = beam.n_modes
    penetration = np.maximum(np.abs(record.displacement) - beam.clearance, 0.0)
    energy = 0.5 * (record.section[:, n:] ** 2).sum(axis=1)
    energy += 0.5 * (record.section[:, :n] ** 2 * model.stiffness).sum(axis=1)
    energy += 0.5 * beam.contact_stiffness * penetration**2
    assert record.impacts.sum() > 1000
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_one_impact_of_one_mode_has_the_closed_form_restitution():
    """A single mode rebounds like a damped oscillator that lets go when spring and damper stop pushing."""
    beam = replace(
        PLAIN_BEAM,
        n_modes=1,
        force_amplitude=0.0,
        shaker_damping=0.0,
        damping_ratio=0.0,
        pivot_rotational_stiffness=1e-3,
        shaker_stiffness=0.0,
        contact_damping=200.0,
        excitation_frequency=1000.0,
    )
    model = beam.reduce()
    mass = 1.0 / model.tip_shape[0] ** 2
    omega = np.sqrt(beam.contact_stiffness / mass)
    zeta = beam.contact_damping / (2 * np.sqrt(beam.contact_stiffness * mass))
    root = np.sqrt(1 - zeta**2)
    # force k x + d v = 0 while moving out: the root of sin(root t + 2 acos(zeta)) with the phase of x = 0, v > 0
    leave = (np.pi - np.arctan2(2 * zeta * root, 1 - 2 * zeta**2)) / (root * omega)
    ratio = np.exp(-zeta * omega * leave) * abs(
        np.cos(root * omega * leave) - zeta / root * np.sin(root * omega * leave)
    )
    start = np.array([0.0, 0.05]) / model.tip_shape[0]
    record = simulate(beam, 12, start)
    assert record.impacts[:, 0].sum() == 1
    after = record.velocity[np.flatnonzero(record.impacts[:, 0])[0] + 1]
    assert -after / 0.05 == pytest.approx(ratio, rel=1e-4)


def test_bouncing_dies_out_into_sustained_contact():
    """At 4 Hz and +-0.032 mm each half cycle has finitely many bounces and then one long contact."""
    record = simulate(replace(PLAIN_BEAM, excitation_frequency=4.0, clearance=0.032e-3), 20, transient=30)
    assert np.all((record.impacts > 3) & (record.impacts < 100))
    assert np.all(record.contact_fraction > 0.3)
    assert np.all((record.bounce_duration > 0.0) & (record.bounce_duration < 0.5 * record.machine.cycle_period))


def test_runs_are_reproducible_and_can_be_continued():
    """Same input, same bytes; and 60 cycles equal 25 followed by 35 from their final state."""
    whole = simulate(PLAIN_BEAM, 60)
    first = simulate(PLAIN_BEAM, 25)
    second = simulate(PLAIN_BEAM, 35, first.final_state)
    for field in ("section", "peak_force", "impacts", "bounce_duration", "contact_fraction"):
        parts = np.concatenate([getattr(first, field), getattr(second, field)])
        np.testing.assert_array_equal(getattr(whole, field), parts)
        np.testing.assert_array_equal(getattr(whole, field), getattr(simulate(PLAIN_BEAM, 60), field))


def test_a_batch_shares_tables_and_moves_each_beam_as_alone():
    """Beams of one structure and another, changed and pickled on the way, move as alone; tables are kept only once."""
    other = replace(PLAIN_BEAM, contact_stiffness=2e6)
    beams = [PLAIN_BEAM.at(21.0, 1e-4), PLAIN_BEAM.at(18.0, 2e-4), other.at(25.0, 1e-4), PLAIN_BEAM.at(11.0, 1e-4)]
    batch, which = beams[0].batch(4), np.arange(4)
    for i, beam in enumerate([*beams[:3], other]):
        batch.start(i, beam)
    batch.change(3, beams[3])
    _structure.cache_clear()
    gc.collect()
    first = batch.run(which, 4)
    again = pickle.loads(pickle.dumps(batch))
    _structure.cache_clear()
    del batch
    gc.collect()
    second = again.run(which, 4)
    for i, beam in enumerate(beams):
        peaks = np.concatenate([first.peak_force[i], second.peak_force[i]])
        np.testing.assert_array_equal(peaks, simulate(beam, 8).peak_force)
    tables = 2 * PLAIN_BEAM.structure.tables.values.nbytes
    assert tables < len(pickle.dumps(again)) < 1.5 * tables


def test_an_exhausted_event_budget_is_an_error_that_names_the_machine():
    """A cycle with more events than allowed ends in a SimulationError with every parameter."""
    with pytest.raises(SimulationError, match=r"more contact events.*cycle 0.*clearance=0\.000127"):
        simulate(PLAIN_BEAM, 5, integrator=ExactEvents(event_budget=3))


def test_a_step_too_coarse_for_contact_is_an_error():
    """A fixed step beyond the stability limit of the fastest mode in contact is refused before it diverges."""
    with pytest.raises(SimulationError, match="too coarse"):
        simulate(PLAIN_BEAM, 1, integrator=RungeKutta4(100))


@settings(max_examples=60, deadline=None)
@given(
    frequency=st.floats(0.5, 200.0),
    clearance=st.sampled_from([0.0, 1e-9, 1e-6, 1e-4, 1e-2]),
    contact_stiffness=st.floats(3.0, 11.0).map(lambda e: 10.0**e),
    contact_damping=st.sampled_from([0.0, 1.0, 1e3, 1e6]),
    damping_ratio=st.sampled_from([0.0, 0.01, 1.0, 20.0]),
    shaker_damping=st.sampled_from([0.0, 20.0, 1e5]),
    force=st.sampled_from([0.0, 8.9, 1e5]),
    n_modes=st.sampled_from([1, 2, 5, 9]),
    family=st.sampled_from(["uniform", "stiffness"]),
)
@example(30.243093490877083, 0.0, 1000.0, 1000.0, 1.0, 20.0, 8.9, 5, "stiffness")
@example(2.0, 0.0, 1000.0, 1e6, 1.0, 0.0, 8.9, 2, "stiffness")
@example(2.0, 1e-7, 1000.0, 1e6, 1.0, 0.0, 8.9, 2, "stiffness")
def test_extreme_machines_end_in_an_answer_or_in_a_named_error(
    frequency, clearance, contact_stiffness, contact_damping, damping_ratio, shaker_damping, force, n_modes, family
):
    """Anywhere in the admissible box the result is finite and pushes only, or a SimulationError within its budget."""
    beam = ImpactBeam(
        excitation_frequency=frequency,
        clearance=clearance,
        contact_stiffness=contact_stiffness,
        contact_damping=contact_damping,
        damping_ratio=damping_ratio,
        shaker_damping=shaker_damping,
        force_amplitude=force,
        n_modes=n_modes,
        damping_family=family,
    )
    try:
        record = simulate(beam, 2, samples_per_cycle=20, integrator=ExactEvents(event_budget=5000))
    except SimulationError:
        return
    assert np.all(np.isfinite(record.section))
    assert np.all(np.isfinite(record.history))
    assert np.all(record.peak_force >= 0.0)
    pushed = record.history[..., 2] * record.history[..., 0]
    # a tip that passes the middle of no gap is there but for rounding
    assert np.all(pushed >= -1e-13 * np.abs(pushed).max())
