"""How firm each verdict is: the share of neighbours that hit, statements that exclude each other, and figures left out.

A statement that at least half of the ``neighbours`` hit is a firm hit; one that few hit is luck. The numbers are kept
in ``firmness.json``, which names the machine they hold for: ``python -m thesis firmness`` writes it anew.
"""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import t as student
from tqdm import tqdm

from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from thesis.scorecard.neighbours import neighbour_of
from thesis.scorecard.objective import statements_of

KEPT = Path(__file__).with_name("firmness.json")

FIRM = 0.5
"""Share of the neighbours that hit a firm hit, at least."""

RARE, EXPECTED = 0.25, 8.0
"""Statements exclude each other if less than this share of the expected number of candidates, at least so many, hit
both."""


@dataclass(frozen=True)
class Firmness:
    """How firm the verdicts on one machine are.

    Attributes
    ----------
    neighbours
        Share of the neighbours that hit, by statement; of those statements that were asked.
    hits
        Number of these statements that each neighbour hits.
    exclusive
        Pairs of statements that no candidate of the search hit together, or hardly any.
    left_out
        Hits and number of those statements whose figure a search of its own did not see; 0 of 0 without such searches.
    """

    neighbours: Mapping[str, float]
    hits: tuple[int, ...]
    exclusive: tuple[tuple[str, str], ...] = ()
    left_out: tuple[int, int] = (0, 0)

    @property
    def firm(self) -> tuple[str, ...]:
        """Statements that at least half of the neighbours hit."""
        return tuple(name for name, share in self.neighbours.items() if share >= FIRM)

    @property
    def expected(self) -> tuple[float, float, float]:
        """Hits to expect of a neighbour, and the ends of the 95 % interval of that mean (Student's t)."""
        count, mean = len(self.hits), float(np.mean(self.hits))
        error = float(np.std(self.hits, ddof=1)) / count**0.5
        half = float(student.ppf(0.975, count - 1)) * error
        return mean, mean - half, mean + half


def fingerprint(machine: Machine) -> str:
    """Hash of the constants of a machine."""
    fields = {name: getattr(machine, name) for name in parameters_of(machine)}
    return hashlib.sha256(json.dumps(fields, sort_keys=True).encode()).hexdigest()[:16]


@cache
def _kept() -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(KEPT.read_text()) if KEPT.is_file() else {}
    return found


def firmness_of(machine: Machine) -> Firmness | None:
    """What is known of a machine; None if it was never asked, or for other constants."""
    entry = _kept().get(machine.name)
    if entry is None or entry["machine"] != fingerprint(machine):
        return None
    pairs = tuple((one, other) for one, other in entry["exclusive"])
    return Firmness(entry["neighbours"], tuple(entry["hits"]), pairs, tuple(entry["left_out"]))


def keep(machine: Machine, found: Firmness) -> None:
    """Write what was found into ``firmness.json``."""
    entry = {
        "machine": fingerprint(machine),
        "hits": list(found.hits),
        "neighbours": {name: round(share, 3) for name, share in found.neighbours.items()},
        "exclusive": [list(pair) for pair in found.exclusive],
        "left_out": list(found.left_out),
    }
    text = json.dumps({**_kept(), machine.name: entry}, indent=1, sort_keys=True) + "\n"
    write_atomically(KEPT, lambda temporary: temporary.write_text(text))
    _kept.cache_clear()


def judge_neighbours(
    machine: Machine,
    count: int,
    *,
    joint: str | None = None,
    seed: int = 0,
    folder: Path | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> Firmness:
    """Judge the neighbours of a machine on each statement; contradictory ones are left out.

    Parameters
    ----------
    machine
        The machine whose neighbours are judged.
    count
        Number of neighbours, at least two.
    joint
        "slider" or "ball": only statements with clearance in that joint.
    seed
        Of the neighbours' constants, speeds and initial states.
    folder
        Where results of runs are kept, so that an interrupted call resumes; None keeps none.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.
    """
    asked = statements_of(machine.name, joint)
    hit = np.zeros((count, len(asked)), dtype=bool)
    for k in tqdm(range(count), desc="neighbours", disable=not progress, unit="machine"):
        judged = neighbour_of(machine, k, seed).judge(asked, folder=folder, workers=workers)
        hit[k] = [one.verdict == "hit" for one in judged]
    shares = dict(zip((one.id for one in asked), hit.mean(axis=0).tolist(), strict=True))
    return Firmness(shares, tuple(hit.sum(axis=1).tolist()))


def exclusive_pairs(costs: Sequence[Mapping[str, float]]) -> tuple[tuple[str, str], ...]:
    """Pairs of statements that candidates of a search hit together much less often than by chance.

    Parameters
    ----------
    costs
        Of candidates that were judged on every statement; below a half it is hit.
    """
    if not costs:
        return ()
    names = sorted(set.intersection(*(set(one) for one in costs)))
    hit = np.array([[one[name] < 0.5 for name in names] for one in costs], dtype=float)
    together, share = hit.T @ hit, hit.mean(axis=0)
    expected = len(costs) * np.outer(share, share)
    return tuple(
        (names[i], names[j])
        for i in range(len(names))
        for j in range(i + 1, len(names))
        if expected[i, j] >= EXPECTED and together[i, j] <= RARE * expected[i, j]
    )


def left_out_hits(results: Sequence[Path]) -> tuple[int, int]:
    """Hits and number of the statements of figures that searches were not shown, from those searches' results.

    Raises
    ------
    DatasetError
        If a folder holds no finished search, or one that saw everything.
    """
    hits, total = 0, 0
    for folder in results:
        try:
            found = json.loads((folder / "result.json").read_text())
        except (OSError, ValueError) as error:
            raise DatasetError(f"{folder} holds no finished search with figures left out") from error
        unseen = [one for one in found["residuals"] if one["id"] in found["left_out"]]
        hits += sum(one["verdict"] == "hit" for one in unseen)
        total += len(unseen)
    return hits, total
