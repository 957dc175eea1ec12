"""A search says which statements it never hit, and on which bounds its best candidates lie."""

import pytest

from thesis.scorecard.search import Candidate
from thesis.scorecard.search_space import Basin, Real
from thesis.scorecard.walls import walls_of

BASIN = Basin(
    "soft", {}, (Real("stiffness", 1.0, 2.0), Real("shaker_mass", 0.0, 1.0)), {"stiffness": 1.5, "shaker_mass": 0.5}
)


def tried(stiffness, mass, costs, basin=0):
    """Twelve candidates at one place, all with the same costs."""
    return [Candidate(basin, 0, (stiffness, mass), 0.1 * k, costs) for k in range(12)]


def test_a_statement_never_hit_with_a_bound_active_is_unfinished():
    """Twelve candidates miss X, and the best lie on the lower end of the stiffness: the search names both."""
    (found,) = walls_of([BASIN], tried(0.01, 0.5, {"X": 0.9, "Y": 0.2}))
    assert found.unfinished
    assert found.line.startswith("UNFINISHED: soft, 12 candidates: 0 % hit X; bound stiffness low active")
    assert (found.as_dict()["never"], found.as_dict()["unfinished"]) == (("X",), True)


@pytest.mark.parametrize(
    ("stiffness", "mass", "costs", "words"),
    [
        (0.5, 0.5, {"X": 0.9}, "0 % hit X; no bound is active"),
        (0.01, 0.5, {"X": 0.2}, "every statement is hit by some; bound stiffness low active"),
        (0.5, 0.0, {"X": 0.9}, "no bound is active; shaker_mass low active: there is no mass below zero"),
        (0.99, 0.5, {}, "bound stiffness high active"),
    ],
)
def test_either_alone_or_an_explained_bound_is_finished(stiffness, mass, costs, words):
    """A miss without a bound is the structure's; a bound without a miss costs nothing; no mass is below zero."""
    (found,) = walls_of([BASIN], tried(stiffness, mass, costs))
    assert not found.unfinished
    assert words in found.line


def test_few_candidates_say_nothing_and_basins_without_any_are_left_out():
    """Nine candidates that miss are no evidence; a basin that was never tried has no line."""
    found = walls_of([BASIN, BASIN], tried(0.0, 0.0, {"X": 0.9}, basin=1)[:9])
    assert [one.candidates for one in found] == [9]
    assert found[0].never == ()
