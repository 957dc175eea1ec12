"""Which printed statements of the beam no candidate hits, and which pairs none hits together.

From the journal of the search without walls (``candidates_journal.jsonl``), the verdicts of the candidates that were
kept (``candidates.json``), and journals of further searches. A pair is told if each of its statements is hit by some,
no candidate hits both, and chance would have let one or more do so.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from itertools import combinations
from pathlib import Path
from typing import Any, NamedTuple

from chaosgym.errors import DatasetError
from thesis.scorecard.candidates import KEPT, candidates
from thesis.scorecard.walls import HIT

JOURNAL = KEPT.with_name("candidates_journal.jsonl")

BY_CHANCE = 1.0
"""Candidates that would hit both of two statements if neither mattered for the other; below it no pair is told."""

FEWEST = 10
"""Candidates judged on both below which nothing is told."""

LARGEST_JOURNAL = 1_000_000_000
"""Bytes beyond which a file is no journal."""


class Exclusion(NamedTuple):
    """Two statements that none of ``judged`` candidates hits together, and by how many each is hit."""

    one: str
    other: str
    hits: int
    hits_of_other: int
    judged: int


class Exclusions(NamedTuple):
    """What a number of candidates hit: by statement (hits, judged), statements never hit, and exclusive pairs."""

    candidates: int
    hits: Mapping[str, tuple[int, int]]
    pairs: tuple[Exclusion, ...]

    @property
    def never(self) -> tuple[str, ...]:
        """Statements that none of ten or more candidates hits."""
        return tuple(name for name, (hit, judged) in self.hits.items() if not hit and judged >= FEWEST)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "candidates": self.candidates,
            "hits": {name: list(count) for name, count in self.hits.items()},
            "never": list(self.never),
            "pairs": [pair._asdict() for pair in self.pairs],
        }

    @property
    def lines(self) -> list[str]:
        """Say it, one pair a line."""
        never = f"none hits {', '.join(self.never)}" if self.never else "every statement is hit by some"
        rows = [f"{self.candidates} beams: {never}"]
        rows += [f"no beam hits both {one} ({a} of {n}) and {other} ({b} of {n})" for one, other, a, b, n in self.pairs]
        return rows


def exclusions(found: Sequence[Mapping[str, bool]]) -> Exclusions:
    """Exclusions among candidates, each a mapping of the statements it was judged on to whether it hits them.

    Examples
    --------
    >>> pairs = exclusions([{"X": True, "Y": False}, {"X": False, "Y": True}] * 5).pairs
    >>> [(pair.one, pair.other) for pair in pairs]
    [('X', 'Y')]
    """
    names = sorted({name for one in found for name in one})
    hits = {name: (sum(one.get(name, False) for one in found), sum(name in one for one in found)) for name in names}
    pairs = []
    for one, other in combinations(names, 2):
        both = [(each[one], each[other]) for each in found if one in each and other in each]
        first, second = sum(a for a, _ in both), sum(b for _, b in both)
        if len(both) >= FEWEST and first * second >= BY_CHANCE * len(both) and not any(a and b for a, b in both):
            pairs.append(Exclusion(one, other, first, second, len(both)))
    return Exclusions(
        len(found), hits, tuple(sorted(pairs, key=lambda pair: -pair.hits * pair.hits_of_other / pair.judged))
    )


def known_exclusions(journals: Iterable[Path] = ()) -> Exclusions:
    """Exclusions among all candidates that are kept, and those of further journals.

    Raises
    ------
    DatasetError
        If a file is no journal of a search.
    """
    found = [one for path in (JOURNAL, *journals) for one in _read(path)]
    for one in candidates().values():
        if "machine" in one:  # not a beam
            continue
        told = {name: verdict for name, (verdict, _) in one["found_here"].items()}
        found.append({name: verdict == "hit" for name, verdict in told.items() if name in _fitted()})
    return exclusions(found)


def _fitted() -> frozenset[str]:
    """Statements that the scorecard counts."""
    from thesis.statements import read_comparisons

    known = read_comparisons()
    return frozenset(one.id for one in known.compared if not one.contradictory and not one.not_computed)


def _read(path: Path) -> list[dict[str, bool]]:
    """Which statements each candidate of a journal hits."""
    try:
        if path.stat().st_size > LARGEST_JOURNAL:
            raise ValueError("it is too large")
        lines = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines() if line]
        return [{str(name): float(cost) < HIT for name, cost in line[4].items()} for line in lines]
    except (OSError, ValueError, TypeError, KeyError, IndexError, AttributeError, RecursionError) as error:
        raise DatasetError(
            f"{path} is no journal of a search: {error}; needed: journal.jsonl of a calibration"
        ) from error
