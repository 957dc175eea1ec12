"""Evaluation of measured peak forces without a machine model: nature, life and reliability."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.design.bearing import STRENGTH, BearingEvaluation, Criteria, evaluate
from chaosgym.design.reliability import time_blocks
from chaosgym.design.statistics import Convergence, Histogram, as_forces, convergence, histogram, require_enough
from chaosgym.errors import DesignError
from chaosgym.machines.parameters import quantity_of
from chaosgym.plain import Result
from chaosgym.recordings.judge import judge_peaks
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.recordings.runs import Run

FOLLOWS = {
    "periodic": "every cycle loads the surface alike, so that the life follows from one period",
    "quasiperiodic": "forces never repeat but follow a pattern, so that the life follows from their statistics",
    "chaotic": "single forces can't be foretold, so that only statistics of many cycles give a life",
    "undetermined": "what the response is has to be settled before the life may be relied on",
}

RANDOM_FOLLOWS = "the pattern repeats but for its scatter, so that the life follows from the statistics of all cycles"


@dataclass(frozen=True)
class MeasuredPeaks(Result):
    """Nature, statistics, life and reliability of measured peak forces.

    Attributes
    ----------
    peaks : (cycles,)
        [N].
    criteria
        Bearing data.
    verdict
        Nature of the response.
    convergence
        Cycles that the statistics take.
    histogram
        Distribution and its modes.
    evaluation
        Life and reliability.
    source
        Where the peaks come from: "file", "sha256", "date" and the like.
    """

    shows = (
        "nature=verdict.diagnosis.nature period=verdict.diagnosis.period verdict stated_by=criteria.stated "
        "cycles=convergence evaluation source"
    )

    peaks: Array
    criteria: Criteria
    verdict: MeasuredVerdict
    convergence: Convergence
    histogram: Histogram
    evaluation: BearingEvaluation
    source: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))

    @property
    def headline(self) -> str:
        """Nature of the response, and what follows for its life."""
        verdict = self.verdict.diagnosis
        follows = RANDOM_FOLLOWS if self.verdict.random else FOLLOWS[verdict.nature]
        return f"{verdict.words}: {follows}"

    @property
    def doubt(self) -> str:
        """Why the statistics are an estimate; empty if they are not."""
        found = self.convergence
        if found.recorded >= found.needed:
            return ""
        return f"estimate: {found.recorded} cycles recorded, {found.needed} needed for statistics to rely on"

    @property
    def life_line(self) -> str:
        """Life by the load rating, and who stated that, for people."""
        found, rating = self.evaluation, self.criteria.load_rating
        if rating is None:
            return "life              not asked; state load_rating"
        return (
            f"life              {found.life:.4g} million cycles, {found.life_interval.low:.4g} to "
            f"{found.life_interval.high:.4g}; conservative {found.conservative_life:.4g}; by a load rating of "
            f"{rating:g} N ({self.criteria.origin('load_rating')})"
        )

    def lines(self) -> list[str]:
        """Return lines for people."""
        found, asked = self.evaluation, self.criteria
        lines = [
            self.headline,
            *(f"  {line}" for line in self.verdict.diagnosis.statement._replace(meaning="").lines()[1:]),
            *(f"  {note}" for note in self.verdict.notes),
            *([self.doubt] if self.doubt else []),
            self.life_line,
            f"equivalent force  {found.force:.2f} N with exponent {asked.life_exponent:.3g}",
            f"{len(self.peaks)} cycles, mean {np.mean(self.peaks):.2f} N, standard deviation "
            f"{np.std(self.peaks):.2f} N, largest {found.largest_force:.2f} N",
        ]
        if asked.tells_reliability:
            lines += [
                f"reliability       {found.reliability:.6f}, {found.reliability_interval.low:.6f} to "
                f"{found.reliability_interval.high:.6f}; normal approximation {found.normal_reliability:.6f}",
                "                  "
                + ", ".join(f"{name.replace('_', ' ')} {quantity_of(asked, name)}" for name in STRENGTH),
            ]
        else:
            lines.append(f"no reliability: it needs {', '.join(STRENGTH)} in a brief")
        return lines

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; None stands for what was not asked for."""
        return {
            **super().as_dict(),
            "criteria": {name: getattr(self.criteria, name) for name in self.criteria.asked},
            "estimate": self.doubt or None,
            "mean_N": float(np.mean(self.peaks)),
            "standard_deviation_N": float(np.std(self.peaks)),
            "largest_N": float(np.max(self.peaks)),
            "modes_N": self.histogram.modes.tolist(),
        }


def evaluate_peaks(
    peaks: ArrayLike,
    criteria: Criteria,
    *,
    verdict: MeasuredVerdict | None = None,
    source: Mapping[str, str] = MappingProxyType({}),
) -> MeasuredPeaks:
    """Evaluate measured peak forces, one a cycle.

    Parameters
    ----------
    peaks : (cycles,)
        [N].
    criteria
        Bearing data.
    verdict
        Nature of the response; judged without a stated sensor error if None.
    source
        Where the peaks come from, for the report.

    Raises
    ------
    DesignError
        If a force is negative or not finite, all are zero, or there are too few cycles; says how many are needed.

    Examples
    --------
    >>> from chaosgym.design import Criteria
    >>> from chaosgym.design.measured import evaluate_peaks
    >>> peaks = np.random.default_rng(0).normal(50.0, 2.0, 400)
    >>> found = evaluate_peaks(peaks, Criteria(load_rating=500.0))
    >>> round(found.evaluation.force, 1)
    50.0
    """
    forces = as_forces(peaks)
    if not np.any(forces):
        raise DesignError("all peak forces are zero: no contact, so that there is no life to tell")
    try:
        values = require_enough(forces)
    except DesignError as error:
        if verdict is None:
            raise
        raise DesignError(f"{verdict.diagnosis.words}, but no life is told: {error}") from error
    return MeasuredPeaks(
        values,
        criteria,
        verdict or judge_peaks(values),
        convergence(values),
        histogram(values),
        evaluate(time_blocks(values), criteria, "statistics of the measured peak forces"),
        source,
    )


def evaluate_run(run: Run, criteria: Criteria, *, date: str = "") -> MeasuredPeaks:
    """Evaluate a recording of forces, with its file as the source.

    Parameters
    ----------
    run
        Of a column of forces.
    criteria
        What is asked of the bearing.
    date
        Of the evaluation, for the report.
    """
    source = {
        "file": run.source,
        "sha256": run.sha256,
        "column": run.name,
        "date": date,
        "read as": "; ".join(run.notes).removeprefix("read "),
    }
    return evaluate_peaks(run.peaks, criteria, verdict=run.verdict, source=source)
