"""Firmness tells a verdict that holds in the neighbourhood from a lucky one."""

from dataclasses import replace

import numpy as np
import pytest

from chaosgym.errors import DatasetError
from chaosgym.machines.parameters import parameters_of
from tests.plain_modes import PLAIN_BEAM
from thesis.scorecard import firmness
from thesis.scorecard.findings import Finding
from thesis.scorecard.firmness import Firmness, exclusive_pairs, judge_neighbours, left_out_hits
from thesis.scorecard.neighbours import nudged, shifted
from thesis.scorecard.scorecard import Scorecard
from thesis.scorecard.verdicts import judge
from thesis.statements import read_comparisons

COMPARED = {one.id: one for one in read_comparisons().compared}


def test_a_neighbour_keeps_what_is_printed():
    """Fitted and assumed constants move by 1 % at most, printed and derived ones not at all."""
    near = nudged(PLAIN_BEAM, np.random.default_rng(1))
    moved = {name for name in parameters_of(near) if getattr(near, name) != getattr(PLAIN_BEAM, name)}
    assert {"width", "shaker_damping", "youngs_modulus"} <= moved
    for name in moved:
        assert parameters_of(near)[name].provenance in ("calibrated", "assumed")
        assert getattr(near, name) == pytest.approx(getattr(PLAIN_BEAM, name), rel=0.01)


def test_a_neighbour_runs_at_a_shifted_speed():
    """Points and sweeps over the speed move together; a sweep over anything else stays."""
    point, sweep, damping = (COMPARED[name] for name in ("IBS-013", "IBS-020", "IBS-045"))
    assert shifted(point, "excitation_frequency", 0.3).at[0]["excitation_frequency"] == 19.3
    assert shifted(sweep, "excitation_frequency", 0.3).along.values[7] == pytest.approx(8.3)
    assert shifted(damping, "excitation_frequency", 0.3).along == damping.along


def test_a_scale_is_firm_and_a_wrong_nature_is_not(monkeypatch):
    """Every neighbour has the printed frequency at 284.0 mm within 2 %; none has a nature that there is not."""
    frequency = COMPARED["IBS-034"]
    loose = replace(frequency, tolerance=frequency.tolerance._replace(relative=0.02))
    asked = (loose, replace(COMPARED["IBS-013"], printed="odd"))
    monkeypatch.setattr(firmness, "statements_of", lambda name, joint: asked)
    judged = judge_neighbours(PLAIN_BEAM, 3, workers=1)
    assert judged == Firmness({"IBS-034": 1.0, "IBS-013": 0.0}, (1, 1, 1))
    assert judged.firm == ("IBS-034",)


def test_the_interval_of_the_expected_hits_is_students():
    """Of 12, 14 and 16 hits the mean is 14, and 4.303 standard errors of 2 / sqrt(3) lie on either side."""
    assert Firmness({}, (12, 14, 16)).expected == pytest.approx((14.0, 14.0 - 4.968, 14.0 + 4.968), abs=1e-3)


def test_half_of_the_neighbours_make_a_hit_firm():
    """A half is enough, less is luck."""
    assert Firmness({"a": 0.5, "b": 0.49, "c": 1.0}, (2, 1)).firm == ("a", "c")


def test_statements_that_no_candidate_hits_together_exclude_each_other():
    """Of 100 candidates half hit one and half the other, never both; a third statement goes with anything."""
    costs = [{"a": 0.1 + 0.8 * (k % 2), "b": 0.9 - 0.8 * (k % 2), "c": 0.1 + 0.8 * (k // 2 % 2)} for k in range(100)]
    assert exclusive_pairs(costs) == (("a", "b"),)
    assert exclusive_pairs(costs[:10]) == exclusive_pairs([]) == ()


def test_left_out_figures_are_counted_from_their_own_searches(tmp_path):
    """Two statements that a search did not see, one hit; what it saw does not count; an empty folder is refused."""
    (tmp_path / "result.json").write_text(
        '{"left_out": ["x", "y"], "residuals": [{"id": "x", "verdict": "hit"}, {"id": "y", "verdict": "near"},'
        ' {"id": "z", "verdict": "hit"}]}'
    )
    assert left_out_hits([tmp_path]) == (1, 2)
    with pytest.raises(DatasetError, match="holds no finished search"):
        left_out_hits([tmp_path / "none"])


def test_what_is_kept_holds_for_the_same_constants_alone(tmp_path, monkeypatch):
    """Another constant, and nothing is known; the scorecard then says so."""
    monkeypatch.setattr(firmness, "KEPT", tmp_path / "firmness.json")
    firmness._kept.cache_clear()
    found = Firmness({"IBS-013": 0.25}, (0, 0, 0, 1), (("IBS-013", "IBS-014"),), (3, 5))
    firmness.keep(PLAIN_BEAM, found)
    assert firmness.firmness_of(PLAIN_BEAM) == found
    assert firmness.firmness_of(replace(PLAIN_BEAM, width=0.02)) is None
    firmness._kept.cache_clear()


def test_the_headline_has_four_numbers():
    """Firm hits, hits left out, hits to expect of a neighbour, and pairs that exclude each other."""
    judged = tuple(judge(COMPARED[name], [Finding("periodic")]) for name in ("IBS-013", "IBS-046"))
    known = Firmness({"IBS-013": 0.25, "IBS-046": 0.5}, (1, 1, 0, 1), (("IBS-013", "IBS-046"),), (3, 5))
    told = Scorecard(judged, {"impact-beam": known}).as_dict()
    assert [one["neighbours"] for one in told["targets"]] == [0.25, 0.5]
    totals = told["totals"]["impact-beam"]
    assert totals["all"] == {"hit": 2, "near": 0, "miss": 0, "contradictory": 0, "total": 2}
    assert totals["left_out"] == {"hit": 3, "total": 5}
    assert totals["firm"] == {"hit": 1, "total": 2}
    assert totals["expected"]["mean"] == 0.75
    assert totals["exclusive"] == [["IBS-013", "IBS-046"]]
    assert Scorecard(judged).totals()["impact-beam"]["expected"] is None
