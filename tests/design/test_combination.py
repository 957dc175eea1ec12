"""Tolerances in combination: indices of a function with known ones, probabilities of a published interval."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from chaosgym import read_machine
from chaosgym.design import Criteria, assess
from chaosgym.design.checks import Check
from chaosgym.design.combination import (
    Combination,
    Influence,
    Probability,
    combination,
    influences,
    own_type,
    probability,
    total_indices,
)
from chaosgym.design.guidelines import _next, case_of, guidelines
from chaosgym.diagnosis import Neighbour, Tolerance
from chaosgym.diagnosis.precursors import measured_rates
from chaosgym.errors import SimulationError
from chaosgym.machines import ImpactBeam

CALM = ImpactBeam(excitation_frequency=8.0)
REGION = {"force_amplitude": Tolerance(0.05), "clearance": Tolerance(0.05), "damping_ratio": Tolerance(0.1)}


@pytest.fixture(scope="module")
def calm():
    """A beam that repeats and follows a trend."""
    return assess(CALM, REGION, Criteria(load_rating=300.0, life=10.0), series_size=16)


def test_total_indices_of_the_function_of_ishigami_and_homma():
    """a = 7, b = 0.1: 0.5576, 0.4424 and 0.2437 in closed form (Saltelli et al. 2010); a constant has none."""

    def model(points):
        x = np.pi * points.T
        return np.array([np.sin(x[0]) + 7.0 * np.sin(x[1]) ** 2 + 0.1 * x[2] ** 4 * np.sin(x[0]), np.ones(len(points))])

    found, none = total_indices(model, 3, 1024)
    assert [one.share for one in found] == pytest.approx([0.5576, 0.4424, 0.2437], abs=0.02)
    assert all(one.low < exact < one.high for one, exact in zip(found, (0.5576, 0.4424, 0.2437), strict=True))
    assert none == []
    assert total_indices(model, 3, 64, seed=1) == total_indices(model, 3, 64, seed=1)


def test_a_single_touch_among_all_machines_gives_finite_numbers():
    """Most resamples have no variance at all then; JSON has no number that is none."""

    def model(points):
        rare = np.zeros(len(points))
        rare[3] = 1.0
        return np.array([rare, np.where(np.arange(len(points)) == len(points) - 1, 1.0, 0.0)])

    assert np.all(np.isfinite(total_indices(model, 2, 16)))


def test_a_run_that_fails_leaves_the_indices_out(monkeypatch):
    """Probabilities and the rest of a report do not rest on them."""

    def failing(*_arguments, **_options):
        raise SimulationError("no cycle")

    monkeypatch.setattr("chaosgym.design.combination.simulate", failing)
    assert influences(CALM, REGION, 3.0, base=4) == ()


def test_a_single_parameter_takes_part_in_all_of_the_variance():
    """With one input every output's total index is 1, however many outputs there are."""
    found = total_indices(lambda points: np.array([points[:, 0], points[:, 0] ** 3]), 1, 64)
    assert [one.share for each in found for one in each] == pytest.approx([1.0, 1.0], abs=0.3)
    assert [one.parameter for one in influences(CALM, {"clearance": Tolerance(0.05)}, 3.0, base=8)] == ["clearance"]


def test_a_share_has_the_interval_of_clopper_and_pearson():
    """No event in 10 trials: up to 1 - 0.025^(1/10); 3 of 10: 0.0667 to 0.6525, as in tables."""
    assert probability(0, 10)[1:] == pytest.approx((0.0, 1.0 - 0.025**0.1))
    assert probability(3, 10)[1:] == pytest.approx((0.0667, 0.6525), abs=1e-4)
    assert probability(10, 10).high == 1.0


def test_what_is_told_agrees_with_the_counts_above_it():
    """Periodic machines among others are of Type III, and an index above 1 is called an error."""
    sure, most = probability(32, 32), probability(22, 32)
    none = probability(0, 32)
    types = {"I": none, "II": none, "III": sure, "undetermined": none}
    natures = {"periodic": most, "chaotic": probability(10, 32)}
    influence = Influence("clearance", Probability(1.1, 0.6, 1.7), Probability(0.7, 0.5, 1.0))
    first, second, third = Combination(types, natures, None, (influence,), 64).told
    assert first.endswith("Type III 100% (89% to 100%); the periodic ones too, since they lie among others")
    assert second.endswith("(total index 1.10, 0.60 to 1.70; above 1 is the error of a small sample)")
    assert third.endswith("(total index 0.70, 0.50 to 1.00)")
    apart = {**types, "I": probability(1, 32), "III": probability(31, 32)}
    assert (
        Combination(apart, natures, None, (), 64).told[0].endswith("Type III 97% (84% to 100%), Type I 3% (0% to 16%)")
    )


def test_total_indices_of_a_trend_are_the_shares_of_its_slopes(calm):
    """log F = sum b d is additive: the index of each parameter is b^2 / sum b^2, of another sample and method."""
    found = combination(calm, base=32)
    slopes = dict(zip(calm.trend.parameters, calm.trend.slopes, strict=True))
    expected = np.array([slopes[one.parameter] ** 2 for one in found.influences])
    assert [one.life.share for one in found.influences] == pytest.approx(expected / expected.sum(), abs=0.1)
    most = found.most("life")
    assert most is not None
    assert most.parameter == max(slopes, key=lambda name: abs(slopes[name]))
    assert found.types["I"].share == found.natures["periodic"].share == 1.0
    assert found.sampled == 32 * 5


def test_without_contact_no_parameter_matters():
    """Forces that are zero throughout have no variance to share."""
    rigid = replace(CALM, force_amplitude=0.01)
    found = combination(assess(rigid, REGION, Criteria(load_rating=500.0, life=1.0), series_size=8), base=8)
    assert found.influences == ()
    assert found.most("peak") is None
    assert found.meeting.share == 1.0


def test_a_machine_of_the_region_has_a_type_of_its_own(calm):
    """III if it does not repeat, II with 10 % more force than the nominal one, I otherwise."""
    run = calm.series.runs[0]
    peak = run.largest_peak
    assert [own_type(run, peak), own_type(run, peak / 1.11)] == ["I", "II"]
    assert own_type(replace(run, nature="quasiperiodic"), peak) == "III"
    assert own_type(replace(run, nature="undetermined"), peak) == "undetermined"


def test_where_chaos_is_mixed_in_every_machine_is_of_type_three(calm):
    """Case III of 5.5.1 leaves no machine of Type I, and the guideline and the probabilities agree."""
    around = [Neighbour({"clearance": side}, "chaotic", 60.0) for side in (-0.5, 0.5)]
    assert combination(calm, around, base=8).types["III"].share == 1.0
    assert any("all are of Type III" in one.sentence for one in guidelines(calm, around))


def test_motions_that_coexist_leave_no_other_type_and_are_judged_by_the_worst():
    """The gear pair of Kahraman and Singh has two motions at 0.72 of its mesh frequency (their jump, from both sides).

    Started at rest it runs one of them; the life may rest on neither's statistics, since no share of them is known.
    """
    gear = read_machine("docs/machines/kahraman-singh-1990.toml").at(720.0)
    found = assess(gear, {"clearance": Tolerance(0.01)}, Criteria(load_rating=500.0, life=1000.0), series_size=8)
    peaks = [found.response.largest_peak, *found.response.coexisting_peaks]
    assert max(peaks) > 2.0 * min(peaks)
    assert {run.nature for run in found.series.runs} == {"periodic"}
    assert found.type == "III"
    assert found.evaluation.force == pytest.approx(max(run.largest_peak for run in found.series.runs), rel=0.02)
    assert found.evaluation.force >= max(peaks)
    assert found.evaluation.life == pytest.approx((500.0 / found.evaluation.force) ** (10.0 / 3.0))
    assert combination(found, base=8).types["III"].share == 1.0
    told = " ".join(one.sentence for one in guidelines(found))
    assert "so that all are of Type III" in told
    assert "of the machines in the tolerances" not in told
    assert "worst case found in the tolerances" in told


@pytest.mark.parametrize(
    ("shares", "case"),
    [
        ([], "I"),
        ([{"clearance": 1.1}], "II"),
        ([{"clearance": 1.1}, {"clearance": 1.2, "damping_ratio": 0.1}], "II"),
        ([{"clearance": 0.45}], "III"),
        ([{"clearance": 0.5}, {"clearance": -0.4}], "III"),
    ],
)
def test_the_case_is_told_by_where_chaos_lies(calm, shares, case):
    """None: case I. At one end of the tolerances: II. Between periodic machines, or at both ends: III."""
    wild = [Neighbour(share, "chaotic", 60.0) for share in shares]
    assert case_of(calm, wild) == case


def test_where_no_machine_is_periodic_no_part_of_the_tolerances_is_spoken_of(calm):
    """Case II holds throughout if all machines are chaotic; the sentence claims no periodic rest."""
    runs = tuple(replace(run, nature="chaotic") for run in calm.series.runs)
    beside = [replace_nature(one, "chaotic") for one in calm.response.neighbours]
    wild = replace(
        calm,
        nominal=replace(calm.nominal, nature="chaotic"),
        series=replace(calm.series, runs=runs),
        response=replace(calm.response, neighbours=tuple(beside)),
    )
    assert case_of(wild) == "II throughout"
    (said,) = [one.sentence for one in guidelines(wild) if one.section == "5.5.1"][:1]
    assert said.startswith("no response in the tolerances is periodic")
    assert "part" not in said
    assert "16 chaotic of 16 machines" in said


def replace_nature(one, nature):
    """The same neighbour with another nature."""
    return one._replace(nature=nature)


def test_each_case_says_how_often_it_was_right(calm):
    """The rate stands in the sentence of 5.5.1, and is that of the file that the datasets were counted into."""
    rate = measured_rates()["impact-beam"]["case I"]
    assert rate.precision is not None
    assert rate.precision > 0.95
    (said,) = [one.sentence for one in guidelines(calm) if one.section == "5.5.1"][:1]
    assert f"{rate.precision:.1%} of the dataset's points" in said
    assert {f"case {case}" for case in ("I", "II", "II throughout", "III")} <= measured_rates()["slider-crank"].keys()


def test_guidelines_say_what_the_assessment_says(calm):
    """Signs with rates, the case with its counts, the evaluation of the type and the next phase."""
    said = guidelines(calm)
    sentences = [one.sentence for one in said]
    assert sum("of the dataset's points with" in sentence for sentence in sentences) == 4
    assert any(
        sentence.startswith("every response") and "16 periodic of 16 machines" in sentence for sentence in sentences
    )
    assert any("all are Type I" in sentence for sentence in sentences)
    assert ("prototype" in sentences[-1]) == (calm.verdict == "meets")
    alone = assess(CALM, {}, Criteria(), series_size=8)
    assert any("all are Type I" in one.sentence and "II" not in one.sentence for one in guidelines(alone))
    chaotic = replace(calm, nominal=replace(calm.nominal, nature="chaotic"))
    assert case_of(chaotic, []) == "III", "periodic machines on all sides of a chaotic one"
    open_ = replace(calm, nominal=replace(calm.nominal, nature="undetermined"), verdict="undetermined")
    assert case_of(open_) == "undetermined"
    assert "settle it" in guidelines(open_)[-1].sentence


def test_the_next_step_names_the_criteria_that_are_missed():
    """And no other."""
    checks = [Check("life", 1.0, 2.0, "-"), Check("reliability", 0.99, 0.9, "-")]
    assert [check.met for check in checks] == [False, True]
    said = _next(SimpleNamespace(verdict="misses", checks=checks))
    assert said == "life missed: change the machine, and assess it again"
