"""A printed value is hit, near or missed by the stated tolerance, and the totals add up."""

from dataclasses import replace

import pytest

from thesis.scorecard.findings import Finding
from thesis.scorecard.scorecard import Scorecard
from thesis.scorecard.verdicts import allowed, judge
from thesis.statements import read_comparisons

COMPARED = {one.id: one for one in read_comparisons().compared}


@pytest.mark.parametrize(
    ("name", "values", "verdict"),
    [
        ("IBS-028", [70.0 * 1.15], "hit"),  # 15 % of 70 N
        ("IBS-028", [70.0 * 1.16], "near"),
        ("IBS-028", [70.0 * 0.69], "miss"),
        ("IBS-025", [18.0], "hit"),  # 3 N are more than 15 % of 15 N
        ("IBS-025", [20.9], "near"),
        ("IBS-034", [288.2 * 1.01], "hit"),
        ("IBS-034", [288.2 * 1.011], "near"),
        ("IBS-020", [9.0, 7.0], "hit"),  # one step of 1 Hz
        ("IBS-020", [9.0, 10.0], "near"),  # the worse of two curves decides
        ("IBS-030", [0.025], "hit"),  # one step of 0.005
        ("IBS-069", [700.0], "hit"),  # a factor of two
        ("IBS-069", [1401.0], "miss"),
        ("IBS-070", [4.0], "hit"),
        ("IBS-070", [2.0], "miss"),
        ("SSC-056", [(85.0, 126.0)], "hit"),
        ("SSC-056", [(72.0, 110.0)], "near"),
        ("IBS-013", ["periodic"], "hit"),
        ("IBS-029", [(30.0, 85.0)], "contradictory"),
        ("IBS-028", [None], "miss"),
        ("IBS-028", [], "not-computed"),
    ],
)
def test_verdict_follows_from_the_tolerance(name, values, verdict):
    """Hit up to the tolerance, near up to twice it; the worst condition decides."""
    assert judge(COMPARED[name], [Finding(value) for value in values]).verdict == verdict


def test_a_wrong_nature_is_a_miss_whatever_the_force():
    """70 N is printed of a periodic response: a chaotic one with that mean does not hit it."""
    assert judge(COMPARED["IBS-028"], [Finding(70.0, agrees=False)]).verdict == "miss"


def test_tolerance_is_given_in_the_printed_unit():
    """15 % of 70 N; 3 N of 15 N; one step of 0.005 of the dimensionless clearance; none for a nature."""
    shown = {name: allowed(COMPARED[name]) for name in ("IBS-028", "IBS-025", "IBS-030", "IBS-013", "SSC-056")}
    assert shown["IBS-028"] == pytest.approx(10.5)
    assert shown["IBS-025"] == 3.0
    assert shown["IBS-030"] == pytest.approx(0.005)
    assert shown["IBS-013"] is None
    assert shown["SSC-056"] == pytest.approx([12.75, 16.5])


def test_a_grid_is_finer_than_what_it_is_compared_with():
    """A boundary on a clearance is sought on a quarter of it or less, a resonance on its tolerance or less."""
    for one in COMPARED.values():
        if one.quantity == "map_clearance":
            assert one.across.step / one.across.unit <= 0.2501 * one.printed, one.id
        if one.quantity == "resonance_speed":
            assert one.along.step / one.along.unit <= allowed(one), one.id


def test_totals_count_every_statement_once():
    """Groups add up to "all"; contradictory statements count in the total and not in the rate, others without a
    result (here the forces) in both."""
    judged = [judge(one, [Finding(one.printed)] if one.group != "force" else []) for one in COMPARED.values()]
    card = Scorecard(tuple(judged))
    for machine, groups in card.totals().items():
        whole, groups = groups["all"], groups["groups"]
        assert list(whole) == ["hit", "near", "miss", "contradictory", "total"]
        for verdict in whole:
            assert whole[verdict] == sum(count[verdict] for count in groups.values())
        assert whole["total"] == sum(one.comparison.machine == machine for one in judged)
        hits, counted = card.hit_rate(machine)
        assert counted == whole["total"] - whole["contradictory"]
        assert hits == whole["hit"] < counted


def test_json_of_a_statement_is_complete():
    """The ten keys, plain values, and the reason of a contradiction first."""
    told = judge(COMPARED["IBS-029"], [Finding((36.2, 70.1), note="chaotic")]).as_dict()
    keys = "id machine group printed value unit tolerance verdict reason reading"
    assert list(told) == keys.split()
    assert told["printed"] == [30.0, 85.0]
    assert told["value"] == [36.2, 70.1]
    assert told["reason"].startswith("40 to 100 N at the same point")
    assert judge(replace(COMPARED["IBS-029"], contradictory=""), []).as_dict()["value"] is None
