"""Who is better, and how sure is that? Scores of contenders that ran the same jobs.

    score = (mean return - that of the safe constant) / (that of the reference - that of the safe constant)

Means over all machines come first, then the ratio, one for each training seed; the interquartile mean is over seeds.
Intervals over machines keep the scale and draw other machines, so that of the reference has a width too.
The reference is the best schedule by the machine's table of regimes, or the search with a copy of the machine where
that returns more, as on machines that wear. It is no bound on what a job returns: scores may exceed 1.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.control.controllers.ladder import CLAIRVOYANT_SEARCH, NOMINAL_SEARCH, REFERENCE, SAFE_CONSTANT
from chaosgym.control.jobs import JobRow
from chaosgym.control.statistics import (
    bootstrap_interval,
    interquartile_mean,
    performance_profile,
    probability_of_improvement,
    worst_mean,
)
from chaosgym.errors import ParameterError

Array = NDArray[np.float64]

PROFILE_THRESHOLDS = np.linspace(-3.0, 3.0, 241)
"""Scores of single jobs at which the profile is drawn."""


@dataclass(frozen=True)
class Results:
    """Jobs of one contender: ``knows`` what, and rows by training seed and machine, in the same order for everybody."""

    knows: str
    rows: Sequence[Sequence[JobRow]]

    def column(self, name: str) -> Array:
        """One field of all rows, (seeds, machines)."""
        return np.array([[getattr(row, name) for row in job] for job in self.rows], dtype=float)


@dataclass(frozen=True)
class Scale:
    """Returns (machines,) of the jobs that are worth 0 and 1."""

    safe: Array
    reference: Array

    def job_scores(self, returns: Array) -> Array:
        """Score of each job, (seeds, machines), on the common scale: their mean is the score."""
        return np.asarray((returns - self.safe) / (self.reference.mean() - self.safe.mean()))


def compare(results: Mapping[str, Results]) -> dict[str, dict[str, Any]]:
    """Return a summary of each contender, as plain values.

    Raises
    ------
    ParameterError
        If the safe constant or the reference is missing, or the reference is not worth more.
    """
    for name in (SAFE_CONSTANT, REFERENCE):
        if name not in results:
            raise ParameterError(f"there are no jobs of {name!r}, which the scores need; known: {', '.join(results)}")
    reference = reference_of(results)
    scale = Scale(*(results[name].column("job_return")[0] for name in (SAFE_CONSTANT, reference)))
    if scale.safe.mean() > scale.reference.mean() or np.isclose(scale.safe.mean(), scale.reference.mean()):
        raise ParameterError(
            f"the safe constant returns {scale.safe.mean():.4g}, as much as the reference ({reference}) or more, so "
            "there is no scale for scores"
        )
    return {name: _summary(result, results, scale, reference) for name, result in results.items()}


def reference_of(results: Mapping[str, Results]) -> str:
    """Return who is worth 1: of those who know the machine and plan, the one that returns most."""
    known = [name for name in (REFERENCE, CLAIRVOYANT_SEARCH) if name in results]
    return max(known, key=lambda name: float(results[name].column("job_return").mean()))


def _summary(result: Results, others: Mapping[str, Results], scale: Scale, reference: str) -> dict[str, Any]:
    returns, shares = result.column("job_return"), result.column("type_iii_share")
    cycles, duration = result.column("cycles"), result.column("duration")
    seeds, machines = returns.shape
    jobs = scale.job_scores(returns)
    scores = jobs.mean(axis=1)

    def over_seeds(drawn: NDArray[np.int64]) -> Array:
        return np.asarray(interquartile_mean(scores[drawn], axis=-1))

    def over_machines(drawn: NDArray[np.int64]) -> Array:
        # (seeds, ..., machines)
        return np.asarray(interquartile_mean(jobs[:, drawn].mean(axis=-1), axis=0))

    return {
        "knows": result.knows,
        "seeds": seeds,
        "machines": machines,
        "return": float(returns.mean()),
        "score": float(interquartile_mean(scores)),
        "score_by_seed": scores.tolist(),
        "score_interval_seeds": bootstrap_interval(seeds, over_seeds).tolist(),
        "score_interval_machines": bootstrap_interval(machines, over_machines).tolist(),
        "type_iii_share": float(shares.mean()),
        "type_iii_above_reference": float(shares.mean() - others[reference].column("type_iii_share").mean()),
        "cycles_per_hour": float(3600.0 * cycles.sum() / duration.sum()),
        "damage": float(result.column("damage").mean()),
        "damage_cvar": worst_mean(result.column("damage")),
        "violation_rate": float(result.column("cost_share").mean()),
        "failures": float(result.column("failed").mean()),
        "better_than": {
            name: probability_of_improvement(returns, other.column("job_return")) for name, other in others.items()
        },
        "profile": performance_profile(jobs, PROFILE_THRESHOLDS).tolist(),
    }


def model_gap(summaries: Mapping[str, Mapping[str, Any]]) -> dict[str, float] | None:
    """What a wrong model costs: return of the search with the true model less that with the nominal one.

    ``share`` is relative to the size of the safe constant's return; None if one of the searches was not run.
    """
    if NOMINAL_SEARCH not in summaries or CLAIRVOYANT_SEARCH not in summaries:
        return None
    gap = summaries[CLAIRVOYANT_SEARCH]["return"] - summaries[NOMINAL_SEARCH]["return"]
    return {"gap": gap, "share": gap / abs(summaries[SAFE_CONSTANT]["return"])}


def table_lines(summaries: Mapping[str, Mapping[str, Any]]) -> list[str]:
    """Lines of a Markdown table, best score last."""
    lines = [
        "| contender | knows | seeds | return | score | 95 % over seeds | 95 % over machines | Type III | cycles/h "
        "| damage | worst tenth | violations | failed | beats safe constant |",
        "|---|---|---|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for name, row in sorted(summaries.items(), key=lambda item: item[1]["score"]):
        seeds = _interval(row["score_interval_seeds"]) if row["seeds"] > 1 else ""
        lines.append(
            f"| {name} | {row['knows']} | {row['seeds']} | {row['return']:.3f} | {row['score']:.2f} | {seeds} "
            f"| {_interval(row['score_interval_machines'])} | {row['type_iii_share']:.1%} "
            f"| {row['cycles_per_hour']:.0f} | {row['damage']:.2f} | {row['damage_cvar']:.2f} "
            f"| {row['violation_rate']:.1%} | {row['failures']:.1%} | {row['better_than'][SAFE_CONSTANT]:.2f} |"
        )
    return lines


def _interval(ends: Sequence[float]) -> str:
    return f"{ends[0]:.2f} to {ends[1]:.2f}"
