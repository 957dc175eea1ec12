"""Scores are 0 for the safe constant, 1 for the reference, and ratios of means in between and beyond."""

import numpy as np
import pytest

from chaosgym.control.comparison import PROFILE_THRESHOLDS, Results, compare, model_gap, table_lines
from chaosgym.control.jobs import JobRow
from chaosgym.errors import ParameterError


def _results(returns, **columns):
    rows = [
        [
            JobRow(
                machine=machine,
                seed=machine,
                job_return=value,
                duration=3600.0,
                **{"type_iii_share": 0.0, "cost_share": 0.0, "damage": 0.2, "cycles": 1000, "failed": False, **columns},
            )
            for machine, value in enumerate(job)
        ]
        for job in returns
    ]
    return Results("measurements", rows)


LADDER = {
    "safe constant": _results([[-3.0, -2.0, -2.0]]),
    "dynamic programming": _results([[-1.0, -2.0, -1.0]], type_iii_share=0.02),
}


def test_the_scale_ends_are_the_safe_constant_and_the_reference():
    """By definition."""
    summaries = compare(LADDER)
    assert summaries["safe constant"]["score"] == 0.0
    assert summaries["dynamic programming"]["score"] == pytest.approx(1.0)
    assert summaries["dynamic programming"]["better_than"]["safe constant"] == pytest.approx(2.5 / 3.0)


def test_the_reference_is_the_better_plan_of_those_who_know_the_machine():
    """Where the table misleads, the search with a copy of the machine is worth 1, and a constant may be worth more."""
    search = _results([[-0.5, -1.0, -0.5]])
    summaries = compare({**LADDER, "clairvoyant search": search, "clairvoyant constant": _results([[0.0] * 3])})
    assert summaries["clairvoyant search"]["score"] == pytest.approx(1.0)
    assert 0.0 < summaries["dynamic programming"]["score"] < 1.0 < summaries["clairvoyant constant"]["score"]
    assert summaries["safe constant"]["type_iii_above_reference"] == 0.0


def test_means_over_machines_come_before_the_ratio():
    """A machine on which the reference gains nothing would divide by zero; the means do not."""
    summary = compare({**LADDER, "agent": _results([[-2.0, -2.0, -1.0]])})["agent"]
    assert summary["score"] == pytest.approx((-5.0 + 7.0) / (-4.0 + 7.0))
    low, high = summary["score_interval_machines"]
    assert low < summary["score"] < high


def test_each_seed_has_a_score_and_better_than_the_reference_is_not_clipped():
    """Four seeds, one of which fails badly: the interquartile mean is that of the middle two."""
    agent = _results([[-1.0, -1.0, -1.0], [-3.0, -3.0, -3.0], [-1.0, -2.0, -1.0], [-2.0, -2.0, -2.0]], cost_share=0.1)
    summary = compare({**LADDER, "agent": agent})["agent"]
    assert summary["score_by_seed"] == pytest.approx([4.0 / 3.0, -2.0 / 3.0, 1.0, 1.0 / 3.0])
    assert summary["score"] == pytest.approx((1.0 + 1.0 / 3.0) / 2.0)
    assert summary["type_iii_above_reference"] == pytest.approx(-0.02)
    assert summary["violation_rate"] == pytest.approx(0.1)
    assert summary["cycles_per_hour"] == pytest.approx(1000.0)


def test_the_mean_of_the_job_scores_is_the_score():
    """The profile shows single jobs on the common scale, so its area is the score."""
    summary = compare({**LADDER, "agent": _results([[-2.0, -1.5, -1.0]])})["agent"]
    area = np.trapezoid(summary["profile"], PROFILE_THRESHOLDS) + PROFILE_THRESHOLDS[0]
    assert area == pytest.approx(summary["score"], abs=0.03)


def test_the_gap_of_the_models_is_relative_to_the_safe_constant():
    """The searches differ by 0.7 on average; the safe constant returns -7/3."""
    runs = {**LADDER, "nominal search": _results([[-2.0] * 3]), "clairvoyant search": _results([[-1.3] * 3])}
    gap = model_gap(compare(runs))
    assert gap["gap"] == pytest.approx(0.7)
    assert gap["share"] == pytest.approx(0.3)
    assert model_gap(compare(LADDER)) is None


def test_what_is_missing_is_named():
    """Scores need both ends of the scale, apart from each other."""
    with pytest.raises(ParameterError, match="safe constant"):
        compare({"dynamic programming": LADDER["dynamic programming"]})
    same = {name: LADDER["safe constant"] for name in LADDER}
    with pytest.raises(ParameterError, match="no scale"):
        compare(same)
    with pytest.raises(ParameterError, match=r"returns -1\.333, as much as the reference"):
        compare(dict(zip(LADDER, reversed(LADDER.values()), strict=True)))


def test_the_table_lists_the_best_last():
    """A row for each contender under a header."""
    lines = table_lines(compare(LADDER))
    assert len(lines) == 4
    assert lines[2].startswith("| safe constant |")
    assert lines[3].startswith("| dynamic programming | measurements | 1 | -1.333 | 1.00 |")
