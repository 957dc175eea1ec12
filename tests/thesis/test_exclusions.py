"""Pairs of statements that no beam of a search hits together are told with their counts, and nothing by chance."""

import json

import pytest

from chaosgym.errors import DatasetError
from thesis.scorecard.exclusions import exclusions, known_exclusions


def test_a_pair_that_is_never_hit_together_is_told():
    """Six hit X, six others Y: three would hit both by chance, none does. Z is hit by all, W by none."""
    found = exclusions([{"X": k < 6, "Y": k >= 6, "Z": True, "W": False} for k in range(12)])
    assert [tuple(pair) for pair in found.pairs] == [("X", "Y", 6, 6, 12)]
    assert found.never == ("W",)
    assert found.hits["X"] == (6, 12)
    assert found.lines == ["12 beams: none hits W", "no beam hits both X (6 of 12) and Y (6 of 12)"]


@pytest.mark.parametrize(
    "candidates",
    [
        [{"X": k < 6, "Y": k >= 5} for k in range(12)],
        [{"X": k < 1, "Y": k >= 2} for k in range(12)],
        [{"X": True, "Y": False}, {"X": False, "Y": True}] * 4,
        [{"X": True}] * 10 + [{"Y": True}] * 10,
        [],
    ],
    ids=["one hits both", "chance explains it", "too few", "never judged together", "none"],
)
def test_nothing_is_told_without_evidence(candidates):
    """One candidate that hits both, too few, or a number that chance explains tells nothing."""
    assert exclusions(candidates).pairs == ()


def test_the_valley_excludes_chaos_of_a_longer_beam():
    """Of the kept searches 12 beams or more have the valley of 15 N, 20 or more chaos up to 95 N at 284 mm, none both.

    Nor has any with the valley a force point that moves 0.2 mm; 70 N at 29 Hz and such a force point go together (E).
    """
    found = known_exclusions()
    assert found.candidates >= 314
    pairs = {(pair.one, pair.other): pair for pair in found.pairs}
    assert pairs["IBS-025", "IBS-043"].hits >= 12
    assert ("IBS-025", "IBS-060") in pairs
    assert ("IBS-028", "IBS-060") not in pairs


@pytest.mark.parametrize(
    "text", ["{", "[1, 2]", '{"a": 1}', "[0, 0, [], 0.1, 5]", '[0, 0, [], 0.1, {"X": "y"}]', "null"]
)
def test_what_is_no_journal_is_refused(tmp_path, text):
    """In one line that names the file."""
    path = tmp_path / "journal.jsonl"
    path.write_text(text + "\n")
    with pytest.raises(DatasetError, match="is no journal of a search"):
        known_exclusions([path])


def test_a_further_journal_is_added(tmp_path):
    """Each line is one more candidate."""
    path = tmp_path / "journal.jsonl"
    path.write_text(json.dumps([0, 0, [0.5], 0.4, {"IBS-013": 0.1}]) + "\n")
    before, after = known_exclusions(), known_exclusions([path])
    assert after.candidates == before.candidates + 1
    assert after.hits["IBS-013"][0] == before.hits["IBS-013"][0] + 1
