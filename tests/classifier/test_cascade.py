"""The cascade: proofs that hold, budgets that are kept, types by the printed rule."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chaosgym.classifier import classifier_for, default_classifier
from chaosgym.classifier.answer import neighbours_of, type_probabilities
from chaosgym.classifier.cascade import LONGEST_PERIOD, REPEATS, RETURNED, _affordable, _as_measured
from chaosgym.diagnosis import diagnose
from chaosgym.diagnosis.periodic_orbit import returning_period
from chaosgym.diagnosis.type_rule import type_of_cross
from chaosgym.errors import ModelFileError
from chaosgym.machines import ImpactBeam
from chaosgym.machines.machine_file import read_machine
from chaosgym.simulation import simulate
from tests.classifier.made_up import settled
from tests.plain_modes import PLAIN_CRANK

PUBLISHED = Path(__file__).parents[2] / "docs" / "machines"

CALM = ImpactBeam(excitation_frequency=19.0, clearance=1.27e-4)
WILD = ImpactBeam(excitation_frequency=30.0, clearance=1.27e-4)


@pytest.fixture(scope="module")
def beam():
    """The shipped classifier of the beam."""
    return default_classifier("impact-beam")


def random_beams(count, seed):
    """Beams over the speeds and clearances of the classifier."""
    generator = np.random.default_rng(seed)
    speeds, gaps = generator.uniform(2.0, 39.0, count), np.exp(generator.uniform(np.log(2e-5), np.log(2.5e-4), count))
    return [ImpactBeam(excitation_frequency=a, clearance=b) for a, b in zip(speeds, gaps, strict=True)]


def test_printed_points_have_their_natures(beam):
    """Figures 3.6 and 3.7: at 19 Hz a proven orbit of period 1, at 30 Hz chaos, which no finite run proves."""
    calm, wild = beam.classify(CALM), beam.classify(WILD)
    assert (calm.nature, calm.centre.proven, calm.centre.stage, calm.centre.period) == (
        "periodic",
        True,
        "certificate",
        1,
    )
    assert calm.centre.probability == 1.0
    assert (wild.nature, wild.centre.proven, wild.response_type) == ("chaotic", False, "III")
    assert wild.neighbours == ()


def test_what_is_proven_is_periodic(beam):
    """Every proof of forty random beams agrees with the full diagnosis, and so does the largest peak of the orbit."""
    proven = 0
    for machine in random_beams(40, 3):
        answer = beam.classify(machine, types=False).centre
        assert sum(answer.probabilities.values()) == pytest.approx(1.0)
        if answer.proven:
            proven += 1
            verdict = diagnose(machine)
            assert verdict.nature == "periodic"
            assert answer.largest_peak == pytest.approx(verdict.evidence["largest_peak"], rel=1e-6)
    assert proven > 20


def test_a_larger_budget_follows_the_machine_further(beam):
    """Nothing is simulated for 0 us; more time never simulates less, and without a limit the answer is the surest."""
    for machine in (CALM, WILD):
        machine.reduce()
        answers = [beam.classify(machine, budget_us=budget, types=False).centre for budget in (0.0, 3e3, 1e6, None)]
        cycles = [answer.cycles for answer in answers]
        assert cycles[0] == 0
        assert answers[0].stage == "parameters"
        assert cycles == sorted(cycles)
        assert answers[-1].probability >= answers[0].probability - 1e-12


def test_a_budget_is_kept(beam):
    """Most answers take about as long as they may at the most, though one step may be dearer than expected."""
    machines = random_beams(30, 5)
    for machine in machines:
        beam.classify(machine, types=False)
    for budget in (2e3, 5e3):
        spent = [beam.classify(machine, budget_us=budget, types=False).microseconds for machine in machines]
        assert np.median(spent) < 1.5 * budget


def test_types_are_those_of_the_diagnosis(beam):
    """The cascade's types agree with the printed rule on five diagnoses, for eleven beams of twelve.

    Probabilities of types stand wherever the natures of all five points are told.
    """
    agreed = 0
    machines = random_beams(12, 7)
    for machine in machines:
        answer = beam.classify(machine)
        centre = diagnose(machine)
        alone = centre.nature != "periodic"  # then the printed rule asks no other point
        points = [centre] * 5 if alone else [centre, *map(diagnose, neighbours_of(machine))]
        peaks = [verdict.evidence["largest_peak"] for verdict in points]
        agreed += answer.response_type == type_of_cross([verdict.nature for verdict in points], peaks)[0]
        told = all(point.nature for point in (answer.centre, *answer.neighbours))
        assert sum(answer.type_probabilities.values()) == pytest.approx(1.0 if told else 0.0)
    assert agreed >= 11


def test_a_calm_neighbourhood_is_proven_to_be_type_i(beam):
    """At 10 Hz all five orbits are proven, so the type is; a budget that ends before the neighbours gives none."""
    machine = ImpactBeam(excitation_frequency=10.0, clearance=5e-5)
    answer = beam.classify(machine)
    assert answer.type_proven
    assert answer.response_type in ("I", "II")
    assert answer.type_probabilities[answer.response_type] == pytest.approx(1.0)
    assert len(answer.neighbours) == 4
    short = beam.classify(machine, budget_us=0.0)
    assert short.response_type is None
    assert short.nature == "periodic"


def test_probabilities_of_types_follow_from_those_of_natures(beam):
    """A neighbour that is chaotic with 30 % makes an otherwise calm point Type II with 30 %."""
    centre = beam.classify(CALM, types=False).centre
    points = [replace(centre, largest_peak=40.0)] * 4
    doubtful = replace(centre, proven=False, probabilities={"chaotic": 0.3, "periodic": 0.7}, largest_peak=40.0)
    told, _ = type_probabilities(CALM, [*points, doubtful])
    assert told == pytest.approx({"I": 0.7, "II": 0.3, "III": 0.0})
    both, _ = type_probabilities(CALM, [*points[:3], doubtful, doubtful])
    assert both == pytest.approx({"I": 0.49, "II": 0.42, "III": 0.09})


def test_neighbours_lie_one_tolerance_away():
    """+-2 % of a frequency, +-10 rpm of a rotation, +-5 % of a clearance."""
    around = neighbours_of(CALM)
    assert [m.excitation_frequency / 19.0 for m in around] == pytest.approx([1 / 1.02, 1.02, 1.0, 1.0])
    assert [m.clearance / 1.27e-4 for m in around] == pytest.approx([1.0, 1.0, 1 / 1.05, 1.05])
    speeds = [m.crank_speed - PLAIN_CRANK.crank_speed for m in neighbours_of(PLAIN_CRANK)]
    assert speeds == pytest.approx([-10.0, 10.0, 0.0, 0.0])


def test_an_unknown_machine_is_answered_by_proof_alone(beam):
    """Outside the trained range nothing is guessed: a proven orbit is an answer, chaos is not."""
    outside = ImpactBeam(excitation_frequency=19.0, clearance=1.27e-4, length=0.32)
    answer = beam.classify(outside, types=False).centre
    assert answer.stage in ("certificate", "nothing")
    assert answer.nature == ("periodic" if answer.proven else None)
    if not answer.proven:
        assert "length = 0.32 m is outside" in answer.reason


@pytest.mark.parametrize(("rate", "period"), [(2.8, 1), (3.2, 2), (3.5, 4)])
def test_the_returning_period_is_the_smallest(rate, period):
    """States of a period-k orbit come back after k cycles first."""
    series = settled(rate, 33)
    assert returning_period(np.column_stack([series[:-1], series[1:]]), LONGEST_PERIOD, REPEATS, RETURNED) == period


def test_a_machine_of_ones_own_is_judged_by_proofs_and_by_its_forces():
    """Periods of published machines are proven, their chaos is read from forces in any unit, parameters say nothing."""
    gears = read_machine(PUBLISHED / "kahraman-singh-1990.toml")
    calm = classifier_for(gears).classify(gears)
    assert (calm.nature, calm.centre.proven, calm.response_type) == ("periodic", True, "I")
    beam = read_machine(PUBLISHED / "moon-shaw-1983.toml")
    general = classifier_for(beam)
    near = [
        general.classify(beam.at(share * beam.speed), types=False).centre for share in (0.99, 0.995, 1.0, 1.002, 1.005)
    ]
    assert {(wild.plausible, wild.proven, wild.cycles) for wild in near} == {(("chaotic",), False, 128)}
    assert [wild.nature for wild in near].count("chaotic") >= 3
    assert general.classify(beam, budget_us=0.0, types=False).abstained
    with pytest.raises(ModelFileError, match="chaosgym judge"):
        general.classify_record(np.ones(20))
    with pytest.raises(ModelFileError, match="from parameters alone"):
        general.classify_table(np.ones((2, 0)))


def test_a_shipped_classifier_is_used_where_there_is_one():
    """The general one is for machines that have none."""
    assert classifier_for(CALM) is default_classifier("impact-beam")


def test_a_budget_that_is_spent_affords_nothing_and_one_that_is_left_does(monkeypatch):
    """Half a microsecond is left, or none is: a step of no cost may still be taken, or not."""
    monkeypatch.setattr("chaosgym.classifier.cascade.thread_time", lambda: 2.0)
    monkeypatch.setattr("chaosgym.classifier.cascade.MILLION", 1.0)
    for budget, affordable in ((2.5, True), (2.0, False), (1.5, False)):
        assert _affordable(ImpactBeam(), 0.0, budget, 0, 0) is affordable


def test_forces_are_those_of_the_side_that_is_hit_harder():
    """At the mean level of the training, whatever the level of the record."""
    record = simulate(ImpactBeam(excitation_frequency=12.0), 40, transient=20)
    for column in (0, 1):
        peaks = np.zeros((40, 2))
        peaks[:, column], peaks[:, 1 - column] = np.arange(1.0, 41.0), 0.5
        told = _as_measured(replace(record, peak_force=peaks))
        np.testing.assert_allclose(told[0] / told[0, 0], np.arange(1.0, 41.0))
