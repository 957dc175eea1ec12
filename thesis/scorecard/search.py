"""The search behind a calibration: candidates of several basins, tried in generations, and their journal.

Every basin gets some generations; then the worse half of them gets no more, until two are left. Candidates that the
single runs rule out are given up before the curves. The journal has a line for every candidate, and every basin draws
from its own seed, so that a stopped search goes on as if it had not been stopped.

References
----------
N. Hansen, A. Ostermeier, Completely derandomized self-adaptation in evolution strategies, Evol. Comput. 9 (2001).
"""

import json
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from tqdm import tqdm

from chaosgym.errors import ChaosgymError, DatasetError, ParameterError
from chaosgym.files import is_empty, write_atomically
from thesis.scorecard.objective import Stages, staged_costs
from thesis.scorecard.search_space import Basin, SearchSpace

PLAN_FILE, JOURNAL_FILE = "plan.json", "journal.jsonl"

WIDTH = 0.03
"""Standard deviation of the first generation, as a share of the searched ranges."""

WIDE = 0.25
"""The same for a search that begins in the middle of the ranges."""

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


def _evolution(basin: Basin, seed: Sequence[int], width: float) -> Any:
    try:
        from cmaes import CMA
    except ImportError as error:
        raise ChaosgymError("calibration needs the extra [calibrate]: pip install 'chaosgym[calibrate]'") from error
    size = len(basin.dimensions)
    first = int(np.random.SeedSequence(seed).generate_state(1)[0])
    bounds = np.tile([0.0, 1.0], (size, 1))
    return CMA(np.clip(basin.shares(), 0.02, 0.98), width, bounds=bounds, seed=first)


def search(
    found: list[Candidate],
    space: SearchSpace,
    stages: Stages,
    budget: Budget,
    seed: int,
    journal: Path,
    workers: int | None,
    progress: bool,
    *,
    width: float = WIDTH,
) -> None:
    """Try candidates until the budget is spent; they are added to those found and to the journal.

    ``width`` is the standard deviation of the first generation, as a share of the ranges.
    """
    evolutions = [_evolution(basin, (seed, k), width) for k, basin in enumerate(space.basins)]
    replayed, began = list(found), time.monotonic()
    found.clear()
    total = float(budget.candidates or budget.minutes or 0.0)
    with tqdm(
        total=total, desc="calibrate", disable=not progress, unit="candidate" if budget.candidates else "min"
    ) as bar:
        while True:
            k = _next_basin(found, len(space.basins), [one.population_size for one in evolutions])
            evolution, basin = evolutions[k], space.basins[k]
            generation = sum(one.basin == k for one in found) // evolution.population_size
            told = []
            for place in range(evolution.population_size):
                shares = evolution.ask()
                if not generation and not place:
                    shares = np.array(basin.shares())
                if replayed:
                    one = replayed.pop(0)
                elif _spent(budget, len(found), began):
                    return
                else:
                    value, costs = _tried(space, basin, shares, stages, _recent(found, k), workers)
                    one = Candidate(k, generation, tuple(float(share) for share in shares), value, costs)
                    with journal.open("a") as file:
                        file.write(json.dumps(one) + "\n")
                found.append(one)
                told.append((np.array(one.shares), one.value))
                bar.update(1 if budget.candidates else round((time.monotonic() - began) / 60.0 - bar.n, 3))
                bar.set_postfix_str(f"{len(found)} tried, best {_best(found, space)}")
            evolution.tell(told)


def _best(found: Sequence[Candidate], space: SearchSpace) -> str:
    best = min(found, key=lambda one: one.value)
    return f"{best.value:.4f} ({space.basins[best.basin].name})"


def _next_basin(found: Sequence[Candidate], count: int, sizes: Sequence[int]) -> int:
    """Basin of the next generation: of those still in the race, the one that has had the fewest."""
    had = [sum(one.basin == k for one in found) // sizes[k] for k in range(count)]
    best = [min((one.value for one in found if one.basin == k), default=0.0) for k in range(count)]
    racing, rounds = list(range(count)), TRIED
    while len(racing) > 2 and min(had[k] for k in racing) >= rounds:
        racing = sorted(racing, key=lambda k: best[k])[: max(2, (len(racing) + 1) // 2)]
        rounds += TRIED
    return min(racing, key=lambda k: (had[k], k))


def _recent(found: Sequence[Candidate], basin: int) -> Sequence[Candidate]:
    """Candidates of a basin to which a new one is compared."""
    return [one for one in found if one.basin == basin][-20:]


def _tried(
    space: SearchSpace,
    basin: Basin,
    shares: Sequence[float],
    stages: Stages,
    recent: Sequence[Candidate],
    workers: int | None,
) -> tuple[float, dict[str, float]]:
    """Objective and costs; a candidate whose first statements are worse than most recent ones' is given up."""
    count, costs = len(stages.ids), dict[str, float]()
    try:
        machine = space.machine(basin, shares)
        for part in staged_costs(machine, stages, space.conditions(basin, shares), workers=workers):
            costs.update(part)
            others = [sum(one.costs[name] for name in costs) for one in recent if costs.keys() <= one.costs.keys()]
            if len(others) >= 5 and sum(costs.values()) > float(np.median(others)):
                break
    except ParameterError:
        return 1.0, {}
    return (sum(costs.values()) + count - len(costs)) / count, costs


def _spent(budget: Budget, candidates: int, began: float) -> bool:
    if budget.candidates is not None:
        return candidates >= budget.candidates
    return time.monotonic() - began >= 60.0 * (budget.minutes or 0.0)


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
