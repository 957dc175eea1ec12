"""The search behind a calibration: candidates of several basins, tried in generations, and their journal.

A search is a funnel. If it is asked to, it draws machines over the whole ranges of every basin and judges them by their
cheapest statements; those among the best of the draws go on to all statements. The evolution begins from the best of
them, or from the basin's own start. Every basin gets some generations; then the worse half of them gets no more, until
two are left. Candidates that the first statements rule out are given up before the rest. The journal has a line for
every candidate, and every basin draws from its own seed, so that a stopped search goes on as if it had not been
stopped.

References
----------
N. Hansen, A. Ostermeier, Completely derandomized self-adaptation in evolution strategies, Evol. Comput. 9 (2001).
"""

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from chaosgym.errors import ChaosgymError, DatasetError, ParameterError
from chaosgym.files import is_empty, write_atomically
from thesis.scorecard.objective import Objective
from thesis.scorecard.search_space import Basin, SearchSpace

PLAN_FILE, JOURNAL_FILE = "plan.json", "journal.jsonl"

WIDTH = 0.03
"""Standard deviation of the first generation, as a share of the searched ranges."""

WIDE = 0.25
"""The same for a search that begins in the middle of the ranges."""

DRAWN = -1
"""Generation of the candidates that are drawn."""

GO_ON, HALF = 0.02, 0.5
"""Shares of the draws that go on after the statements that screen, and of all candidates after further ones."""

COMPARED = 1000
"""Draws to which a new one is compared."""

TRIED = 4
"""Generations that every basin gets before some get no more."""


@dataclass(frozen=True)
class Budget:
    """How long a search goes on: candidates in all, or minutes of this call."""

    candidates: int | None = None
    minutes: float | None = None

    @classmethod
    def parse(cls, text: str) -> "Budget":
        """Read ``20min`` or ``400`` (candidates).

        Raises
        ------
        ParameterError
            If it is neither.
        """
        try:
            if text.endswith("min"):
                minutes = float(text.removesuffix("min"))
                if 0.0 < minutes <= 1e5:
                    return cls(minutes=minutes)
            elif 1 <= int(text) <= 10**6:
                return cls(candidates=int(text))
        except ValueError:
            pass
        raise ParameterError(
            f"budget = {text!r} is out of range; allowed: 1 to 1000000 candidates, or minutes as in 20min"
        )


class Candidate(NamedTuple):
    """One line of the journal.

    ``basin`` and ``generation`` it belongs to, ``shares`` of the searched ranges, objective ``value``, and ``costs`` of
    the statements that it was run for.
    """

    basin: int
    generation: int
    shares: tuple[float, ...]
    value: float
    costs: Mapping[str, float]


def open_journal(folder: Path, plan: dict[str, Any]) -> list[Candidate]:
    """Candidates of a search in a folder, which is begun if it is new."""
    plan_file = folder / PLAN_FILE
    if plan_file.is_file():
        try:
            held = dict(json.loads(plan_file.read_text()))
        except (OSError, RecursionError, TypeError, ValueError) as error:
            raise DatasetError(f"{plan_file} is damaged: {error}; choose another folder") from error
        differing = sorted(key for key in plan.keys() | held.keys() if plan.get(key) != held.get(key))
        if differing:
            raise DatasetError(f"{folder} holds another calibration (it differs in {', '.join(differing)})")
    elif folder.exists() and (not folder.is_dir() or not is_empty(folder)):
        raise DatasetError(f"{folder} exists and is no calibration; choose another folder")
    folder.mkdir(parents=True, exist_ok=True)
    if not plan_file.is_file():
        write_atomically(plan_file, lambda temporary: temporary.write_text(json.dumps(plan, indent=2) + "\n"))
    journal = folder / JOURNAL_FILE
    lines = journal.read_text().splitlines() if journal.is_file() else []
    found = []
    for line in lines:
        try:
            basin, generation, shares, value, costs = json.loads(line)
        except ValueError:  # the line that was being written when the search was stopped
            break
        found.append(Candidate(basin, generation, tuple(shares), value, costs))
    if len(found) < len(lines):
        text = "".join(json.dumps(one) + "\n" for one in found)
        write_atomically(journal, lambda temporary: temporary.write_text(text))
    return found


def _evolution(basin: Basin, seed: Sequence[int], width: float, shares: Sequence[float]) -> Any:
    try:
        from cmaes import CMA
    except ImportError as error:
        raise ChaosgymError("calibration needs the extra [calibrate]: pip install 'chaosgym[calibrate]'") from error
    size = len(basin.dimensions)
    first = int(np.random.SeedSequence(seed).generate_state(1)[0])
    bounds = np.tile([0.0, 1.0], (size, 1))
    return CMA(np.clip(shares, 0.02, 0.98), width, bounds=bounds, seed=first)


class _Trials:
    """Candidates tried one after the other, those of an earlier call first; kept in ``found`` and a journal."""

    def __init__(
        self, found: list[Candidate], space: SearchSpace, aim: Objective, budget: Budget, journal: Path
    ) -> None:
        self.found, self._space, self._aim, self._budget, self._journal = found, space, aim, budget, journal
        self._replayed, self._began = list(found), time.monotonic()
        found.clear()

    def minutes(self) -> float:
        """How long this call has lasted."""
        return (time.monotonic() - self._began) / 60.0

    def next(
        self, k: int, generation: int, shares: Sequence[float], go_on: float, workers: int | None
    ) -> Candidate | None:
        """Try the shares in basin k: of its generation's kind, a share ``go_on`` passes the first statements.

        None if the budget is spent.
        """
        if self._replayed:
            one = self._replayed.pop(0)
        elif self._spent():
            return None
        else:
            drawn = generation == DRAWN
            recent = [each for each in self.found if each.basin == k and (each.generation == DRAWN) == drawn]
            recent = recent[-(COMPARED if drawn else 20) :]
            value, costs = _tried(self._space, self._space.basins[k], shares, self._aim, recent, go_on, workers)
            one = Candidate(k, generation, tuple(float(share) for share in shares), value, costs)
            with self._journal.open("a") as file:
                file.write(json.dumps(one) + "\n")
        self.found.append(one)
        return one

    def _spent(self) -> bool:
        if self._budget.candidates is not None:
            return len(self.found) >= self._budget.candidates
        return self.minutes() >= (self._budget.minutes or 0.0)


def search(
    found: list[Candidate],
    space: SearchSpace,
    aim: Objective,
    budget: Budget,
    seed: int,
    journal: Path,
    workers: int | None,
    progress: bool,
    *,
    width: float = WIDTH,
    draws: int = 0,
) -> None:
    """Try candidates until the budget is spent; they are added to those found and to the journal.

    ``width`` is the standard deviation of the first generation, as a share of the ranges; so many ``draws`` over the
    ranges of every basin come before it.
    """
    trials = _Trials(found, space, aim, budget, journal)
    everyone = 1.0 if aim.stages.screen else HALF  # of an evolution, what screens the draws rules out none
    total = float(budget.candidates or budget.minutes or 0.0)
    with tqdm(
        total=total, desc="calibrate", disable=not progress, unit="candidate" if budget.candidates else "min"
    ) as bar:

        def tried(k: int, generation: int, shares: Sequence[float], go_on: float) -> Candidate | None:
            one = trials.next(k, generation, shares, go_on, workers)
            if one is not None:
                bar.update(1 if budget.candidates else round(trials.minutes() - bar.n, 3))
                bar.set_postfix_str(f"{len(found)} tried, best {_best(found, space)}")
            return one

        starts = []
        for k, basin in enumerate(space.basins):
            best = _start(k, basin, draws, seed, tried)
            if best is None:
                return
            starts.append(best)
        evolutions = [
            _evolution(basin, (seed, k), width, start)
            for k, (basin, start) in enumerate(zip(space.basins, starts, strict=True))
        ]
        while True:
            k = _next_basin(found, len(space.basins), [one.population_size for one in evolutions])
            evolution = evolutions[k]
            generation = len(_evolved(found, k)) // evolution.population_size
            told = []
            for place in range(evolution.population_size):
                shares = evolution.ask()
                one = tried(k, generation, shares if generation or place else starts[k], everyone)
                if one is None:
                    return
                told.append((np.array(one.shares), one.value))
            evolution.tell(told)


def _start(
    k: int,
    basin: Basin,
    draws: int,
    seed: int,
    tried: Callable[[int, int, Sequence[float], float], Candidate | None],
) -> Sequence[float] | None:
    """Where the evolution of basin k begins: the best of its own start and the draws; None if the budget is spent."""
    if not draws:
        return basin.shares()
    best = tried(k, DRAWN, basin.shares(), 1.0)
    for shares in np.random.default_rng((seed, k)).random((draws, len(basin.dimensions))):
        one = tried(k, DRAWN, shares, GO_ON)
        if one is None or best is None:
            return None
        best = min(best, one, key=lambda each: each.value)
    return None if best is None else best.shares


def _evolved(found: Sequence[Candidate], basin: int) -> Sequence[Candidate]:
    """Candidates of a basin that are no draws."""
    return [one for one in found if one.basin == basin and one.generation != DRAWN]


def _best(found: Sequence[Candidate], space: SearchSpace) -> str:
    best = min(found, key=lambda one: one.value)
    return f"{best.value:.4f} ({space.basins[best.basin].name})"


def _next_basin(found: Sequence[Candidate], count: int, sizes: Sequence[int]) -> int:
    """Basin of the next generation: of those still in the race, the one that has had the fewest."""
    had = [len(_evolved(found, k)) // sizes[k] for k in range(count)]
    best = [min((one.value for one in found if one.basin == k), default=0.0) for k in range(count)]
    racing, rounds = list(range(count)), TRIED
    while len(racing) > 2 and min(had[k] for k in racing) >= rounds:
        racing = sorted(racing, key=lambda k: best[k])[: max(2, (len(racing) + 1) // 2)]
        rounds += TRIED
    return min(racing, key=lambda k: (had[k], k))


def _tried(
    space: SearchSpace,
    basin: Basin,
    shares: Sequence[float],
    aim: Objective,
    recent: Sequence[Candidate],
    go_on: float,
    workers: int | None,
) -> tuple[float, dict[str, float]]:
    """Objective and costs; a candidate is given up whose statements so far are worse than those of the ``recent`` ones.

    After the first stage a share ``go_on`` is kept, after the others a half.
    """
    costs, weights = dict[str, float](), aim.weights
    try:
        machine = space.machine(basin, shares)
        for part in aim.staged_costs(machine, space.conditions(basin, shares), workers=workers):
            costs.update(part)
            others = [
                sum(weights[name] * one.costs[name] for name in costs)
                for one in recent
                if costs.keys() <= one.costs.keys()
            ]
            here = sum(weights[name] * value for name, value in costs.items())
            if len(others) >= 5 and here > float(np.quantile(others, go_on)):
                break
            go_on = HALF
    except ParameterError:
        return 1.0, {}
    return aim.value(costs), costs


def complete_costs(folder: Path) -> list[Mapping[str, float]]:
    """Costs of those candidates of a search in a folder that were judged on every statement that it saw.

    Raises
    ------
    DatasetError
        If the folder holds no search.
    """
    try:
        plan = json.loads((folder / PLAN_FILE).read_text())
    except (OSError, ValueError) as error:
        raise DatasetError(f"{folder} holds no calibration") from error
    return [one.costs for one in open_journal(folder, plan) if len(one.costs) == len(plan["statements"])]
