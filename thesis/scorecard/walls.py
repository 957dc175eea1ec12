"""What a search did not reach: statements that no candidate hits, and bounds on which the best candidates lie.

A statement that no candidate of a basin hits while a bound is active says that the range is too narrow, or that the
structure lacks something. Such a search is unfinished until the bound is moved, or explained.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from thesis.scorecard.search import Candidate
from thesis.scorecard.search_space import Basin

HIT = 0.5
"""Cost below which a statement is hit: half is the edge of its tolerance."""

BEST = 5
"""Candidates of a basin that show where its optimum lies."""

ON_BOUND = 0.03
"""Distance from the end of a range, as a share of it, within which a candidate lies on the bound."""

FEWEST = 10
"""Candidates judged on a statement below which nothing is said of it."""

EXPLAINED: Mapping[tuple[str, str], str] = {
    ("shaker_mass", "low"): "there is no mass below zero",
    ("damping_exponent", "low"): "zero is the same damping ratio in every mode",
}
"""Bounds that are no choice of ours, by field and end."""


@dataclass(frozen=True)
class Walls:
    """What one basin of a search did not reach.

    Attributes
    ----------
    basin
        Its name.
    candidates
        Number tried.
    never
        Statements that none of ten or more candidates hit.
    bounds
        Ends of ranges on which most of the five best candidates lie, such as "shaker_stiffness low".
    explained
        Those of them that are no choice, and why.
    """

    basin: str
    candidates: int
    never: tuple[str, ...]
    bounds: tuple[str, ...]
    explained: Mapping[str, str]

    @property
    def unfinished(self) -> bool:
        """True if statements are out of reach while a bound is active that nothing explains."""
        return bool(self.never) and any(bound not in self.explained for bound in self.bounds)

    @property
    def line(self) -> str:
        """The finding in one line."""
        never = f"0 % hit {', '.join(self.never)}" if self.never else "every statement is hit by some"
        active = [bound for bound in self.bounds if bound not in self.explained]
        bounds = f"bound {', '.join(active)} active" if active else "no bound is active"
        excused = "".join(f"; {bound} active: {why}" for bound, why in self.explained.items())
        verdict = "UNFINISHED" if self.unfinished else "finished"
        return f"{verdict}: {self.basin}, {self.candidates} candidates: {never}; {bounds}{excused}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "unfinished": self.unfinished}


def walls_of(basins: Sequence[Basin], candidates: Sequence[Candidate]) -> tuple[Walls, ...]:
    """What each basin of a search did not reach; of those in which a candidate was tried."""
    found = []
    for k, basin in enumerate(basins):
        tried = [one for one in candidates if one.basin == k]
        if tried:
            found.append(_walls(basin, tried))
    return tuple(found)


def _walls(basin: Basin, tried: Sequence[Candidate]) -> Walls:
    names = sorted({name for one in tried for name in one.costs})
    costs = {name: [one.costs[name] for one in tried if name in one.costs] for name in names}
    never = tuple(name for name in names if len(costs[name]) >= FEWEST and min(costs[name]) > HIT)
    best = np.array([one.shares for one in sorted(tried, key=lambda one: one.value)[:BEST]])
    bounds, explained = [], {}
    for one, shares in zip(basin.dimensions, best.T, strict=True):
        for end, on in (("low", shares <= ON_BOUND), ("high", shares >= 1.0 - ON_BOUND)):
            if on.mean() > 0.5:
                bounds.append(f"{one.name} {end}")
                if (one.name, end) in EXPLAINED:
                    explained[bounds[-1]] = EXPLAINED[one.name, end]
    return Walls(basin.name, len(tried), never, tuple(bounds), explained)
