"""Extremes: every run ends in a finite answer within a physical bound, or in an error with a name."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from benchmarks.fidelity.extremes import extremes_of
from benchmarks.fidelity.stability import (
    Run,
    StabilityCell,
    StabilityMap,
    runs_of,
    share_of_bound,
    stability_map,
    try_run,
)
from benchmarks.fidelity.stability_figure import stability_figure
from chaosgym.errors import ChaosgymError, ParameterError, SimulationError
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import ExactEvents, RungeKutta4, simulate
from tests.machines.crank_twin import continuous_twin
from tests.plain_modes import PLAIN_BEAM

UNDAMPED = replace(PLAIN_BEAM, force_amplitude=0.0, damping_ratio=0.0, shaker_damping=0.0, contact_damping=0.0)


def _linear_response(beam, phase):
    """Tip displacement and its amplitude without contact, from the closed-form frequency response."""
    model = beam.reduce()
    omega = 2 * np.pi * beam.excitation_frequency
    dynamic = np.diag(model.stiffness - omega**2) + 1j * omega * model.damping
    amplitude = model.tip_shape @ np.linalg.solve(dynamic, beam.structure.drive[0, 0, 1] * beam.force_amplitude)
    return (amplitude * np.exp(1j * phase)).imag, abs(amplitude)


@pytest.mark.slow
def test_every_extreme_of_the_beam_ends_well():
    """All rungs at all extremes: no value that is not finite, no energy from nowhere, no unnamed error."""
    result = stability_map(PLAIN_BEAM, workers=1)
    assert [cell.as_dict() for cell in result.cells if cell.outcome == "failure"] == []
    refused = {(cell.extreme, cell.model) for cell in result.cells if cell.outcome == "named error"}
    assert all(extreme.endswith("steps a cycle") for extreme, _ in refused)
    assert ("10 steps a cycle", "standard") in refused
    assert ("10000 steps a cycle", "standard") not in refused


@pytest.mark.slow
def test_every_extreme_of_the_crank_ends_well():
    """All rungs at all extremes: finite, bounded, or refused by name."""
    result = stability_map(SliderCrank())
    assert [cell.as_dict() for cell in result.cells if cell.outcome == "failure"] == []


def test_the_map_would_show_a_failure():
    """What is neither an answer nor an error of this package counts as a failure, and so does energy from nowhere."""

    def broken():
        raise ZeroDivisionError("no")

    assert try_run(Run("nothing", "none", broken, None)).outcome == "failure"
    record = simulate(PLAIN_BEAM, 3)
    assert 0.0 < share_of_bound(record) < 1.0
    assert share_of_bound(replace(record, section=1e6 * record.section)) > 1.0
    assert share_of_bound(replace(record, section=np.nan * record.section)) == np.inf
    assert len(runs_of(PLAIN_BEAM)) > len(extremes_of(PLAIN_BEAM)) * len(PLAIN_BEAM.fidelity_ladder)


@pytest.mark.parametrize("rung", [rung for rung in ImpactBeam.fidelity_ladder])
def test_a_gap_too_wide_to_touch_leaves_the_linear_response(rung):
    """At +-1 m and a damped shaker every rung settles on its closed-form frequency response, without any force."""
    beam = ImpactBeam(fidelity=rung, clearance=1.0, shaker_damping=200.0)
    record = simulate(beam, 1, transient=400, samples_per_cycle=50)
    expected, size = _linear_response(beam, np.arange(50) / 50 * 2 * np.pi)
    assert record.peak_force.max() == 0.0
    np.testing.assert_allclose(record.history[0, :, 0], expected, rtol=0, atol=1e-9 * size)


def test_a_guide_too_wide_to_touch_lets_the_slider_swing():
    """At +-20 mm the slider moves freely: as continuous matrices by Runge-Kutta have it, and without any force."""
    crank = SliderCrank(slider_clearance=0.02, rod="rigid", matrix_update_interval=0.25)
    twin, peak = continuous_twin(crank, 360.0, 8000, 80)
    record = simulate(crank, 1, samples_per_cycle=100)
    assert record.peak_force.max() == peak == 0.0
    assert np.abs(twin[:, 0]).max() > 0.005
    np.testing.assert_allclose(record.history[0, :, 0], twin[:100, 0], atol=1e-4 * np.abs(twin[:, 0]).max())


@pytest.mark.parametrize("clearance", [0.0, 1e-9])
def test_a_closed_gap_carries_the_quasi_static_force(clearance):
    """With no gap to speak of, at 0.1 Hz, the larger surface force is what a pinned tip needs: no impact adds to it."""
    beam = ImpactBeam(n_modes=1, fitted_modes=0, clearance=clearance, excitation_frequency=0.1, contact_damping=1e3)
    model = beam.reduce()
    held = beam.force_amplitude * beam.structure.drive[0, 0, 1][0] / model.tip_shape[0]
    pinned = held / (1 + model.stiffness[0] / model.tip_shape[0] ** 2 / beam.contact_stiffness)
    record = simulate(beam, 2)
    np.testing.assert_allclose(record.peak_force, pinned, rtol=2e-3)
    np.testing.assert_allclose(record.contact_fraction.sum(axis=1), 1.0, rtol=1e-3)


def test_overdamped_modes_have_real_eigenvalues_and_still_answer():
    """A structure far beyond critical damping creeps: every block decays, and the force bound holds."""
    for fields in ({"damping_ratio": 100.0}, {"contact_damping": 1e6}, {"shaker_damping": 1e6}):
        beam = replace(PLAIN_BEAM, **fields)
        assert np.any(beam.reduce().regimes.generator[:, 2] == 0.0)
        assert share_of_bound(simulate(beam, 3)) < 1.0


def test_energy_stays_where_nothing_takes_it():
    """No damper, no force: bending, motion and contact keep the energy to 1e-9 through 2000 cycles of impacts."""
    model, n = UNDAMPED.reduce(), UNDAMPED.n_modes
    start = np.zeros(2 * n)
    start[n] = 0.02
    record = simulate(UNDAMPED, 2000, start)
    penetration = np.maximum(np.abs(record.displacement) - UNDAMPED.clearance, 0.0)
    energy = np.sum(record.section[:, n:] ** 2 + record.section[:, :n] ** 2 * model.stiffness, axis=1)
    energy += UNDAMPED.contact_stiffness * penetration**2
    assert record.impacts.sum() > 10_000
    np.testing.assert_allclose(energy, energy[0], rtol=1e-9)


def test_ten_thousand_cycles_do_not_drift():
    """A certified period-1 response stays on its orbit: same state, same peaks, after 100 and after 10,000 cycles."""
    beam = replace(PLAIN_BEAM, excitation_frequency=8.0)
    early = simulate(beam, 1, transient=400)
    late = simulate(beam, 1, transient=10_000)
    np.testing.assert_allclose(late.section, early.section, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(late.peak_force, early.peak_force, rtol=1e-7)


@pytest.mark.slow
def test_a_million_cycles_drift_neither_in_phase_nor_in_energy():
    """One run of a million cycles: the period-1 orbit is where it was, and the linear response keeps its phase."""
    beam = ImpactBeam(n_modes=1, fitted_modes=0, excitation_frequency=8.0, contact_damping=2e3)
    early = simulate(beam, 1, transient=1000)
    late = simulate(beam, 1, transient=10**6)
    np.testing.assert_allclose(late.section, early.section, rtol=1e-6, atol=1e-12)
    wide = ImpactBeam(clearance=1.0, shaker_damping=200.0)
    record = simulate(wide, 1, transient=10**6, samples_per_cycle=20)
    expected, size = _linear_response(wide, np.arange(20) / 20 * 2 * np.pi)
    np.testing.assert_allclose(record.history[0, :, 0], expected, rtol=0, atol=1e-9 * size)


@pytest.mark.slow
def test_many_revolutions_of_the_crank_do_not_drift():
    """A period-1 response of impacts is where it was, after a thousand revolutions and after 200,000 in one run."""
    crank = SliderCrank(rod="rigid", matrix_update_interval=30.0, crank_speed=600.0, contact_damping_ratio=1.0)
    early = simulate(crank, 1, transient=1000)
    late = simulate(crank, 1, transient=200_000)
    assert early.impacts.sum() >= 2
    np.testing.assert_allclose(late.section, early.section, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(late.peak_force, early.peak_force, rtol=1e-7)


@pytest.mark.parametrize("steps", [1, 3, 10, 30, 100, 300])
def test_coarse_fixed_steps_are_refused(steps):
    """Below its stability limit Runge-Kutta's method is refused before it diverges."""
    with pytest.raises(SimulationError, match="too coarse"):
        simulate(PLAIN_BEAM, 1, integrator=RungeKutta4(steps))


def test_more_samples_than_fixed_steps_are_all_written():
    """Samples after the last step's start are those of the cycle's end, not whatever lay in the memory before."""
    beam = ImpactBeam(n_modes=1, fitted_modes=0)
    coarse = simulate(beam, 3, samples_per_cycle=1000, integrator=RungeKutta4(400)).history
    fine = simulate(beam, 3, samples_per_cycle=1000, integrator=RungeKutta4(16_000)).history
    assert np.abs(coarse[..., 0]).max() < 1.1 * np.abs(fine[..., 0]).max()
    assert np.abs(coarse[0, -2:, 0] - fine[0, -2:, 0]).max() < 0.2 * beam.clearance


@pytest.mark.parametrize("steps", [600, 1000, 10_000])
def test_the_coarsest_fixed_steps_that_run_make_no_energy(steps):
    """Just above the stability limit the motion stays within what the force can give."""
    assert share_of_bound(simulate(PLAIN_BEAM, 20, integrator=RungeKutta4(steps))) < 1.0


def test_a_cycle_within_its_budget_of_steps_or_an_error_that_says_so():
    """A budget too small for the steps of a slow cycle ends the run by name."""
    beam = replace(PLAIN_BEAM, excitation_frequency=0.5)
    with pytest.raises(SimulationError, match=r"needed more (steps|contact events) than its budget"):
        simulate(beam, 1, integrator=ExactEvents(step_phase=1e-4, event_budget=40))


def test_modes_too_far_apart_to_tell_are_refused_by_name():
    """A tiny stiff beam on a soft pivot with 40 modes: rounding would hide the slow one, and the error says so."""
    with pytest.raises(ParameterError, match=r"n_modes = 40 .* rounding hides some"):
        ImpactBeam(
            length=0.01,
            force_position=0.005,
            height=0.05,
            youngs_modulus=1e13,
            pivot_rotational_stiffness=0.0,
            shaker_stiffness=1e-9,
            n_modes=40,
        ).reduce()


def test_a_shaker_too_heavy_to_tell_its_mode_is_refused():
    """Its mode of 0.1 Hz holds a beam of 3 mg at a drive of 0.001 Hz; left out as a rigid body it would not."""
    heavy = {"width": 1e-4, "density": 10.0, "excitation_frequency": 1e-3, "clearance": 0.0}
    with pytest.raises(ParameterError, match="shaker_mass = 1000 kg differ so much"):
        ImpactBeam(**heavy, shaker_mass=1000.0).reduce()
    assert share_of_bound(simulate(ImpactBeam(**heavy, shaker_mass=100.0), 2)) <= 1.0 + 1e-6


def _field(low, high):
    """Values of a range: its ends, and between them evenly in the logarithm where it is positive."""
    if low < 0.0:
        return st.floats(low, high)
    inner = st.floats(np.log(max(low, high * 1e-9)), np.log(high)).map(lambda e: float(np.clip(np.exp(e), low, high)))
    return st.one_of(st.sampled_from([low, high]), inner)


def box(machine):
    """Any machine of the admissible box: each field as it is, or anywhere in its range."""
    box = {name: about.choices or (about.low, about.high) for name, about in parameters_of(machine).items()}
    whole = {name for name in box if isinstance(getattr(machine, name), int)}
    fields = {
        name: st.sampled_from(allowed)
        if isinstance(allowed[0], str)
        else st.integers(int(allowed[0]), int(allowed[1]))
        if name in whole
        else _field(*allowed)
        for name, allowed in box.items()
    }
    return st.fixed_dictionaries({}, optional=fields)


RIGID = {
    "density": 10.0,
    "youngs_modulus": 1e13,
    "height": 1.0,
    "width": 1.0,
    "shaker_mass": 0.0,
    "damping_family": "uniform",
}


SLACK = {
    "width": 1e-4,
    "height": 1e-4,
    "youngs_modulus": 1e8,
    "force_position": 1e-3,
    "reduction": "interfaces",
    "n_modes": 13,
    "fitted_modes": 0,
}


@settings(max_examples=80, deadline=None)
@example(fields=SLACK)
@example(fields=RIGID | {"fitted_modes": 1})
@example(fields=RIGID | {"fitted_modes": 4, "height": 0.6065306597126334})
@given(fields=box(ImpactBeam))
def test_anywhere_in_the_admissible_box_of_the_beam(fields):
    """Whatever is admissible ends in an answer within its bound, or in an error of this package."""
    try:
        record = simulate(ImpactBeam(**fields), 2, integrator=ExactEvents(event_budget=2000))
    except ChaosgymError:
        return
    assert share_of_bound(record) <= 1.0 + 1e-6


@pytest.mark.slow
@settings(max_examples=15, deadline=None)
@given(fields=box(SliderCrank))
def test_anywhere_in_the_admissible_box_of_the_crank(fields):
    """Whatever is admissible ends in an answer within its bound, or in an error of this package."""
    coarse = {"matrix_update_interval": 30.0} | {name: v for name, v in fields.items() if name != "n_modes"}
    try:
        record = simulate(SliderCrank(**coarse), 1, integrator=ExactEvents(event_budget=500))
    except ChaosgymError:
        return
    assert share_of_bound(record) <= 1.0 + 1e-6


def test_stability_figure_shows_rows_columns_and_forces():
    """Extremes are rows, models are columns, and an answer shows its largest force."""
    about = {"detail": "", "share_of_bound": 0.1, "seconds": 0.0}
    cells = (
        StabilityCell(extreme="force 0", model="draft", outcome="answer", largest_peak=12.5, **about),
        StabilityCell(extreme="force 0", model="fine", outcome="named error", largest_peak=None, **about),
    )
    axes = stability_figure(StabilityMap("impact-beam", cells)).axes[0]
    assert [text.get_text() for text in axes.texts] == ["12.5 N"]
    assert [label.get_text() for label in axes.get_xticklabels()] == ["draft", "fine"]
