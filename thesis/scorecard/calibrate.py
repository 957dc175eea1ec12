"""The calibration: values of the parameters that are not in print which bring a machine closest to the thesis.

The covariance matrix adaptation evolution strategy (CMA-ES) searches several basins, structures of the machine, each
from its own start or the best of many draws (``search``). The best candidates of its quick runs are judged by thorough
ones, and the one with the most hits wins.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.errors import ParameterError
from chaosgym.files import write_atomically
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.version import __version__
from thesis.cache import default_folder
from thesis.scorecard.evaluation import evaluate
from thesis.scorecard.objective import Objective, searched_statements, statements_of
from thesis.scorecard.observation import THOROUGH
from thesis.scorecard.scorecard import Scorecard
from thesis.scorecard.search import JOURNAL_FILE, WIDE, WIDTH, Budget, Candidate, open_journal, search
from thesis.scorecard.search_space import SEARCH_SPACES, Basin, SearchSpace
from thesis.scorecard.walls import Walls, walls_of

RESULT_FILE = "result.json"

FINALISTS = 5
"""Candidates of the quick search that are judged by thorough runs."""

APART = 0.02
"""Distance of two finalists, as a share of the ranges: closer ones are one."""

NEAR_BEST = 0.03
"""Objective above the best one up to which a candidate counts as near-best."""


@dataclass(frozen=True)
class Calibration:
    """What a search found.

    Attributes
    ----------
    space : SearchSpace
        What was searched.
    best : Candidate
        The finalist with the most hits.
    card, present_card
        Every statement about the joint that was searched, judged on it and on the present constants.
    candidates
        All of the journal.
    left_out
        Names of statements that the search did not see.
    """

    space: SearchSpace
    best: Candidate
    card: Scorecard
    present_card: Scorecard
    candidates: Sequence[Candidate]
    left_out: frozenset[str] = frozenset()

    @property
    def machine(self) -> Machine:
        """Machine of the best candidate."""
        return self.space.machine(self.basin, self.best.shares)

    @property
    def walls(self) -> tuple[Walls, ...]:
        """What each basin did not reach."""
        return walls_of(self.space.basins, self.candidates)

    @property
    def basin(self) -> Basin:
        """Basin of the best candidate."""
        return self.space.basins[self.best.basin]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        name = self.machine.name
        cards = {"best": self.card, "present": self.present_card}
        return {
            "version": __version__,
            "machine": name,
            "candidates": len(self.candidates),
            "basin": self.basin.name,
            "objective": self.best.value,
            "objective_of_basins": {
                basin.name: min((one.value for one in self.candidates if one.basin == k), default=None)
                for k, basin in enumerate(self.space.basins)
            },
            "walls": [one.as_dict() for one in self.walls],
            "searched": self.basin.values(self.best.shares),
            "parameters": {field: getattr(self.machine, field) for field in parameters_of(self.machine)},
            "unprinted": self.space.conditions(self.basin, self.best.shares),
            "hits_of": {which: list(card.hit_rate(name)) for which, card in cards.items()},
            "left_out": sorted(self.left_out),
            "near_best": _near_best(self),
            "residuals": [
                {**one.as_dict(), "error_in_tolerances": one.error if np.isfinite(one.error) else None}
                for one in self.card.judged
            ],
        }


def _near_best(found: Calibration) -> dict[str, list[float]]:
    """Smallest and largest value of each searched number among near-best candidates of the same basin."""
    limit = found.best.value + NEAR_BEST
    near = [one for one in found.candidates if one.basin == found.best.basin and one.value <= limit]
    values = [found.basin.values(one.shares) for one in (*near, found.best)]
    return {name: [min(one[name] for one in values), max(one[name] for one in values)] for name in values[0]}


def calibrate(
    name: str,
    budget: Budget,
    folder: Path,
    *,
    seed: int = 0,
    left_out: frozenset[str] = frozenset(),
    basin: str | None = None,
    draws: int = 0,
    neighbours: int = 0,
    workers: int | None = None,
    cache: Path | None = None,
    progress: bool = False,
) -> Calibration:
    """Search the parameters of a machine that are not in print.

    Parameters
    ----------
    name
        Machine.
    budget
        Candidates in all, or minutes of this call.
    folder
        New, empty, or holding a search of the same machine, seed and version, which goes on.
    seed
        Of the search.
    left_out
        Figures whose statements the search does not see; it then begins in the middle of the ranges, since the starts
        come from fits to all statements.
    basin
        Beginning of the names of the structures that are searched; all by default.
    draws
        Beams or cranks drawn over the whole ranges of each structure, of which the best is where its search begins.
    neighbours
        Follow the hits that are to be expected of so many neighbours of a candidate; 0 follows the candidate itself.
    workers
        Number of threads; all processors by default.
    cache
        Where thorough runs are kept; the user's cache by default.
    progress
        Show progress bars on standard error.

    Raises
    ------
    DatasetError
        If the folder holds anything else. Nothing in it is touched.
    ParameterError
        If no structure has such a name, or no statement is about a figure that is left out.
    ChaosgymError
        If the optimiser is not installed.
    """
    space = SEARCH_SPACES[name].only(basin) if basin else SEARCH_SPACES[name]
    space = space.from_the_middle() if left_out else space
    stages = searched_statements(name, space.joint)
    figures = {one.statement.figure for stage in stages for one in stage}
    if unknown := left_out - figures:
        known = ", ".join(sorted(filter(None, figures)))
        raise ParameterError(f"no statement that is searched on is about figure {min(unknown)}; known: {known}")
    stages = stages.without(frozenset(one.id for stage in stages for one in stage if one.statement.figure in left_out))
    plan = {"machine": name, "seed": seed, "version": __version__, "statements": list(stages.ids), "draws": draws}
    plan["neighbours"] = neighbours
    found = open_journal(folder, {**plan, "basins": [one.name for one in space.basins]})
    width = WIDE if left_out else WIDTH
    aim = Objective(stages, neighbours)
    search(found, space, aim, budget, seed, folder / JOURNAL_FILE, workers, progress, width=width, draws=draws)
    result = _judged(space, found, left_out, cache or default_folder(), workers, progress)
    text = json.dumps(result.as_dict(), indent=2, allow_nan=False) + "\n"
    write_atomically(folder / RESULT_FILE, lambda temporary: temporary.write_text(text))
    return result


def _judged(
    space: SearchSpace,
    found: Sequence[Candidate],
    left_out: frozenset[str],
    cache: Path,
    workers: int | None,
    progress: bool,
) -> Calibration:
    """Judge the finalists by thorough runs; what is left out has no say in which of them wins."""
    finalists: list[Candidate] = []
    for one in sorted(found, key=lambda one: one.value):
        close = [
            o for o in finalists if o.basin == one.basin and np.max(np.abs(np.subtract(o.shares, one.shares))) < APART
        ]
        if not close and len(finalists) < FINALISTS:
            finalists.append(one)
    name = space.base.name
    asked = statements_of(name, space.joint)
    unseen = frozenset(one.id for one in asked if one.statement.figure in left_out)

    def card(machine: Machine, unprinted: Mapping[str, float]) -> Scorecard:
        return Scorecard(
            evaluate(asked, {name: machine}, efforts=THOROUGH, folder=cache, workers=workers, unprinted=unprinted)
        )

    def hits(found: Scorecard) -> int:
        return sum(one.verdict == "hit" and one.comparison.id not in unseen for one in found.judged)

    cards = []
    for one in tqdm(finalists, desc="finalists", disable=not progress, unit="candidate"):
        basin = space.basins[one.basin]
        cards.append(card(space.machine(basin, one.shares), space.conditions(basin, one.shares)))
    best = max(range(len(finalists)), key=lambda k: (hits(cards[k]), -finalists[k].value))
    return Calibration(space, finalists[best], cards[best], card(space.base, {}), found, unseen)
