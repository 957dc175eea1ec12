"""The model within a stated tolerance: the estimate of its error, what it leaves out, and that the ladder is one."""

import pickle
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import chaosgym
from benchmarks.performance.mechanisms import flexible_compressor
from chaosgym.errors import ParameterError
from chaosgym.machines import ImpactBeam, SliderCrank, accuracy
from chaosgym.machines.accuracy import ModelAccuracy, accuracy_of, model_within, tolerance_of
from chaosgym.machines.beam_element import bending_matrices
from chaosgym.machines.machine_file import read_machine
from chaosgym.machines.modal_machine import Drive, ModalMachine, Structure
from chaosgym.machines.parameters import with_settings
from chaosgym.series.two_step import two_step_test
from chaosgym.simulation import simulate
from tests.third_machine import ImpactOscillator as ThirdMachine

LENGTH, HEIGHT = ImpactBeam.length, ImpactBeam.height
VARIED = (
    {},
    {"contact_stiffness": 3.75e6},
    {"contact_stiffness": 6e7},
    {"height": 0.75 * HEIGHT},
    {"length": 1.25 * LENGTH},
    {"contact_damping": 5.0},
)
"""Beams beside the default one, as a designer may vary it."""

POINTS = ((7.0, 6e-5), (10.0, 1.27e-4), (12.0, 1e-4), (16.0, 4e-5))
"""Frequencies [Hz] and clearances [m]."""


def varied_beams():
    """Each varied beam at each point."""
    return [
        ImpactBeam(excitation_frequency=speed, clearance=gap, **fields) for fields in VARIED for speed, gap in POINTS
    ]


def first_peaks(beam, modes, fitted=2):
    """Peak forces of two cycles from rest, before chaos parts any two runs."""
    return simulate(replace(beam, n_modes=modes, fitted_modes=fitted), 2).peak_force.max(axis=1)


def test_each_model_of_the_ladder_beats_the_one_below_on_varied_beams():
    """Peak forces come nearer to those of 40 modes from model to model, on the average of 24 varied beams.

    Between two neighbours a single beam may do otherwise: fitted modes swing about the truth (below).
    """
    beams = varied_beams()
    truth = [first_peaks(beam, 40) for beam in beams]
    errors = []
    for model in beams[0].models:
        found = [simulate(replace(beam, **_model(model)), 2).peak_force.max(axis=1) for beam in beams]
        errors.append(np.mean([np.abs(one / true - 1.0).mean() for one, true in zip(found, truth, strict=True)]))
    assert [model.n_modes for model in beams[0].models] == [4, 7, 10, 14, 20, 30]
    assert all(finer < 0.7 * coarser for coarser, finer in pairwise(errors))


def _model(beam):
    return {name: getattr(beam, name) for name in beam.model_fields}


def test_fitted_modes_swing_about_the_truth_while_they_ring_within_an_impact():
    """Against a stiff stop plain modes come from above, fitted ones from either side until they are fast.

    A fitted mode answers slow forces as all that it stands for does. An impact that is as short as a few of its
    periods makes it ring at a frequency of its own, so its error changes sign from one number of modes to the next.
    """
    beam = ImpactBeam(contact_stiffness=6e7, excitation_frequency=10.0)
    truth = first_peaks(beam, 40)[0]
    plain = [first_peaks(beam, modes, 0)[0] / truth - 1.0 for modes in (4, 6, 8, 10, 12, 16)]
    fitted = [first_peaks(beam, modes)[0] / truth - 1.0 for modes in (4, 5, 6, 8)]
    assert all(coarser > finer > 0.0 for coarser, finer in pairwise(plain))
    assert min(fitted) < -0.05
    assert max(fitted) > 0.05
    run = simulate(replace(beam, n_modes=40), 1, samples_per_cycle=100_000)
    pressed = np.flatnonzero(np.diff((run.history[0, :, 2] != 0.0).astype(int)))
    shortest = np.median(pressed[1::2] - pressed[: len(pressed) // 2 * 2 : 2]) * run.machine.cycle_period / 100_000
    for modes, slow, error in ((6, True, 0.05), (14, False, 0.002)):
        rate = replace(beam, n_modes=modes).natural_frequencies[modes]
        assert (rate * shortest < 2.0) == slow
        assert (abs(first_peaks(beam, modes)[0] / truth - 1.0) > error) == slow


def test_the_estimate_bounds_the_steady_error():
    """Twice the difference from a finer model over cycles from rest is above the error of settled peak forces.

    The reference has 30 modes, more than the estimates have seen; only where both repeat is there a steady error.
    """
    compared = 0
    for beam in varied_beams()[::2]:
        accuracy = accuracy_of(beam)
        settled = [simulate(one, 20, transient=150) for one in (beam, replace(beam, n_modes=30))]
        natures = [two_step_test(record) for record in settled]
        if {verdict.nature for verdict in natures} == {"periodic"} and natures[0].period == natures[1].period:
            own, true = (record.peak_force.max(axis=1).mean() for record in settled)
            assert abs(own / true - 1.0) <= max(accuracy.error, 1e-4)
            compared += 1
    assert compared >= 6


@pytest.mark.parametrize(
    "machine", [ImpactBeam(excitation_frequency=12.0), SliderCrank(crank_speed=60.0, slider_clearance=3.2e-5)]
)
def test_the_cheapest_model_within_the_tolerance_is_taken(machine):
    """By the constructor, with_settings and model_within alike; a coarser model of the ladder is not within it."""
    chosen = model_within(machine, "0.1 %")
    assert chosen.error <= 0.001
    assert with_settings(machine, {"fidelity": "0.1 %"}) == chosen.machine
    point = {name: getattr(machine, name) for name in (machine.speed_field, machine.clearance_field)}
    assert type(machine)(fidelity="0.1 %", **point) == chosen.machine
    coarser = chosen.machine.models[: chosen.machine.models.index(chosen.machine)]
    assert coarser
    assert all(accuracy_of(model).error > 0.001 for model in coarser)
    assert "asked 0.1 %" in chosen.line
    assert not chosen.warning


def test_one_model_serves_a_range():
    """Of several points the worst decides; the answer counts them."""
    beam = ImpactBeam(contact_stiffness=6e7)
    points = [beam.at(speed) for speed in (8.0, 10.0, 12.0)]
    chosen = model_within(beam, 0.01, points)
    single = [model_within(point, 0.01).machine.n_modes for point in points]
    assert chosen.machine.n_modes >= max(single)
    assert chosen.points == 3
    assert max(accuracy_of(with_settings(point, _model(chosen.machine))).error for point in points) == chosen.error


def test_chaos_does_not_hide_the_error_of_a_model():
    """At 30 Hz two runs part within four cycles, whatever their models; the estimate counts those before alone."""
    beam = ImpactBeam(n_modes=10)
    finer = simulate(beam.finer, 4).peak_force.max(axis=1)
    parted = np.abs(simulate(beam, 4).peak_force.max(axis=1) - finer).sum() / finer.sum()
    assert accuracy_of(beam).error < 0.1 * parted


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("0 %", "fidelity = '0 %' is out of range; allowed: 0.001 % to 50 %, or a rung"),
        ("nan%", "fidelity = 'nan%' is out of range"),
        ("one %", "fidelity = 'one %' is out of range"),
        ("1e-9 %", "fidelity = '1e-9 %' is out of range"),
        ("fast", "'fast' is not one of standard, fine, reference, nor a tolerance such as '1 %'"),
    ],
)
def test_what_is_no_tolerance_is_refused(given, message):
    """In one line that says what is allowed."""
    with pytest.raises(ParameterError, match=message):
        ImpactBeam(fidelity=given)


def test_a_tolerance_and_a_field_that_it_chooses_contradict_each_other():
    """As a rung and a field that it sets do."""
    both = {"fidelity": "1 %", "n_modes": 5}
    for make in (lambda: ImpactBeam(**both), lambda: with_settings(ImpactBeam(), both)):
        with pytest.raises(ParameterError, match="fidelity = '1 %' chooses n_modes, and n_modes = 5 is given too"):
            make()
    assert tolerance_of("1%") == tolerance_of("1 %") == tolerance_of(0.01)


def test_without_contact_or_a_finer_model_nothing_is_estimated():
    """The answer says why, and the model is the cheapest, or the only one."""
    far = model_within(ImpactBeam(clearance=1.0), "1 %")
    assert far.error is None
    assert "no contact" in far.line
    assert far.machine.n_modes == 4
    assert "no finer model" in accuracy_of(ThirdMachine()).line


def test_where_no_model_is_within_the_tolerance_the_nearest_is_taken_and_said():
    """A thousandth of a per cent against a stiff stop: no model of the ladder is so near."""
    beam = ImpactBeam(contact_stiffness=1e9, excitation_frequency=10.0)
    chosen = model_within(beam, 1e-5)
    assert chosen.error > 1e-5
    assert "no model within 0.001 %" in chosen.warning
    assert chosen.as_dict()["warning"] == chosen.warning


def test_the_finest_model_is_not_silently_taken_for_one_within_the_tolerance():
    """It has no finer one to compare with: where all below it are beyond the tolerance, the answer says so."""
    crank = read_machine("docs/machines/slider-crank-thesis.toml")
    chosen = model_within(crank, "0.001 %")
    assert chosen.error is None
    assert chosen.machine.finer is None
    assert "no model is estimated to be within 0.001 %: this is the finest, and the one below it" in chosen.warning
    assert not model_within(crank, "1 %").warning


def test_a_model_whose_run_fails_is_passed_over(monkeypatch):
    """A finer one that runs is taken; where all fail, the cheapest, and the answer says that it fails."""
    whole = accuracy._Runs.estimate

    def failing(below):
        def estimate(runs, beam):
            return ModelAccuracy(beam, None, accuracy.FAILS) if beam.n_modes < below else whole(runs, beam)

        return estimate

    beam = ImpactBeam(excitation_frequency=12.0)
    for below, modes in ((10, 10), (99, 4)):
        monkeypatch.setattr(accuracy._Runs, "estimate", failing(below))
        chosen = model_within(beam, "1 %")
        assert (chosen.machine.n_modes, chosen.error is None) == (modes, below == 99)
    assert accuracy.FAILS in chosen.line


def test_a_rung_that_is_off_by_more_than_is_documented_warns():
    """The beam's rung standard is within 4 % where its stop is soft, and not where it is stiff."""
    assert not accuracy_of(ImpactBeam(excitation_frequency=10.0)).warning
    stiff = accuracy_of(ImpactBeam(excitation_frequency=10.0, contact_stiffness=2.4e8))
    assert "the rung standard is documented to be within" in stiff.warning


def strip(modes, **more):
    """A clamped strip of steel, 40 elements, whose end rattles."""
    lengths = np.full(40, 0.25 / 40)
    mass, stiffness = bending_matrices(lengths, 2e11 * 0.02 * 0.004**3 / 12.0, 7850.0 * 0.02 * 0.004)
    places = {"end": 78, "middle": 38}
    return Structure.of_matrices(mass[2:, 2:], stiffness[2:, 2:], 0.01, places, modes=modes, **more)


def machine_of(structure):
    """The strip driven in its middle, its end between stops."""
    drive = (Drive.sine("force", "middle", 5.0),)
    return ModalMachine(modes=structure, joint="end", drives=drive, speed=40.0, clearance=2e-5, contact_stiffness=3e6)


def test_matrices_offer_more_modes():
    """The chosen model is the structure of the same matrices with more modes, and near that of many."""
    rough = machine_of(strip(2))
    chosen = model_within(rough, "1 %")
    count = chosen.machine.modes.spare.kept
    assert count > 2
    assert chosen.machine.modes == strip(count)
    full = machine_of(strip(40, highest=np.inf))
    own, true = (simulate(one, 2).peak_force.max(axis=1) for one in (chosen.machine, full))
    assert np.abs(own - true).sum() < 0.01 * true.sum()
    ratios = Structure.of_matrices(np.eye(4), np.diag([1.0, 2.0, 3.0, 4.0]), [0.01, 0.02], {"a": 0}, modes=2)
    damping = 2.0 * np.array([0.01, 0.02, 0.02, 0.02]) * np.sqrt([1.0, 2.0, 3.0, 4.0])
    assert np.diag(ratios.finer.damping) == pytest.approx(damping)
    assert ratios.finer.finer is None


def test_a_structure_is_pickled_without_its_matrices():
    """The modes are what it is; a copy offers no others."""
    structure = strip(3)
    copy = pickle.loads(pickle.dumps(structure))
    assert copy == structure
    assert copy.finer is None


def test_modes_of_a_file_are_all_that_is_known():
    """Few are kept as they are; of many those that suffice. Both say what can't be estimated."""
    few = chaosgym.read_machine("docs/machines/moon-shaw-1983.toml")
    chosen = model_within(few, "1 %")
    assert chosen.machine is few
    assert chosen.error is None
    assert "the error of leaving others out can't be estimated" in chosen.line
    whole = strip(24, highest=np.inf)
    hertz = np.minimum(whole.angular_frequency / (2.0 * np.pi), 1e5)
    many = machine_of(Structure.of_modes(hertz, 0.01, whole.shapes))
    chosen = model_within(many, "2 %")
    assert len(chosen.machine.modes.angular_frequency) < 25
    assert chosen.error <= 0.02
    assert "can't be estimated" in chosen.line


def test_links_that_bend_get_more_modes(tmp_path):
    """The finer mechanism has twice as many modes of the rod and bins of half the angle, and the same gap moves."""
    path = tmp_path / "compressor.toml"
    path.write_text(flexible_compressor(), encoding="utf-8")
    machine = read_machine(path)
    assert machine.model_numbers == {"rod_modes": 2, "matrix_update_interval": 2.0}
    assert machine.finer.model_numbers == {"rod_modes": 4, "matrix_update_interval": 1.0}
    twice = tmp_path / "twice.toml"
    twice.write_text(flexible_compressor().replace("modes = 2", "modes = 4"), encoding="utf-8")
    by_file = replace(read_machine(twice), matrix_update_interval=1.0)
    assert np.array_equal(simulate(machine.finer, 2).peak_force, simulate(by_file, 2).peak_force)
    assert 0.0 < accuracy_of(machine).error < 0.05


def test_a_rigid_rod_has_finer_bins_alone():
    """No modes are added to a rod that does not bend."""
    crank = SliderCrank(rod="rigid")
    assert crank.finer == replace(crank, matrix_update_interval=1.0)


def test_a_state_keeps_the_model_that_it_belongs_to():
    """A machine that starts from a state of its own has no other model."""
    beam = ImpactBeam(excitation_frequency=12.0)
    stated = beam.from_state(simulate(beam, 3).final_state.coordinates)
    assert model_within(stated, "1 %").machine is stated
