"""What do measured peak forces say? Life and reliability from your own signals, without a machine model."""

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.design.criteria import Criteria
from chaosgym.design.methodology import Evaluation, evaluate, plain
from chaosgym.design.reliability import time_blocks
from chaosgym.design.statistics import Convergence, Histogram, convergence, histogram, require_enough
from chaosgym.errors import DesignError
from chaosgym.machines.parameters import parameters_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MeasuredPeaks:
    """Statistics, life and reliability of measured peak forces.

    Attributes
    ----------
    peaks : (cycles,)
        [N].
    criteria
        Bearing data.
    convergence
        Cycles that the statistics take.
    histogram
        Distribution and its modes.
    evaluation
        Life and reliability.
    """

    peaks: Array
    criteria: Criteria
    convergence: Convergence
    histogram: Histogram
    evaluation: Evaluation

    def lines(self) -> list[str]:
        """Return lines for people."""
        found, asked = self.evaluation, self.criteria
        return [
            f"{len(self.peaks)} cycles ({self.convergence.needed} needed), mean {np.mean(self.peaks):.2f} N, "
            f"standard deviation {np.std(self.peaks):.2f} N, largest {found.largest_force:.2f} N",
            f"equivalent force  {found.force:.2f} N with exponent {asked.life_exponent:.3g}",
            f"life              {found.life:.4g} million cycles, {found.life_interval.low:.4g} to "
            f"{found.life_interval.high:.4g}; conservative {found.conservative_life:.4g}",
            f"reliability       {found.reliability:.6f}, {found.reliability_interval.low:.6f} to "
            f"{found.reliability_interval.high:.6f}; normal approximation {found.normal_reliability:.6f}",
            f"                  strength {1e-9 * asked.strength:g} +- {1e-9 * asked.strength_deviation:g} GPa, ball "
            f"radius {1e3 * asked.contact_radius:g} mm, contact modulus {1e-9 * asked.contact_modulus:g} GPa",
        ]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; None stands for an infinite life."""
        return {
            "criteria": {name: getattr(self.criteria, name) for name in parameters_of(self.criteria)},
            "cycles": {**vars(self.convergence), "converged": self.convergence.converged},
            "mean_N": float(np.mean(self.peaks)),
            "standard_deviation_N": float(np.std(self.peaks)),
            "largest_N": float(np.max(self.peaks)),
            "modes_N": self.histogram.modes.tolist(),
            "evaluation": plain(vars(self.evaluation)),
        }


def evaluate_peaks(peaks: ArrayLike, criteria: Criteria) -> MeasuredPeaks:
    """Evaluate measured peak forces, one a cycle.

    Parameters
    ----------
    peaks : (cycles,)
        [N].
    criteria
        Bearing data.

    Raises
    ------
    DesignError
        If a force is negative or not finite, or there are too few cycles; says how many are needed.
    """
    values = require_enough(peaks)
    return MeasuredPeaks(
        values,
        criteria,
        convergence(values),
        histogram(values),
        evaluate(time_blocks(values), criteria, "statistics of the measured peak forces"),
    )


def read_peaks(path: str | Path) -> Array:
    """Read peak forces [N], one a cycle: the first column of a CSV file, with or without a header.

    Raises
    ------
    DesignError
        If the file can't be read or a line does not begin with a number; names the line.
    """
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            rows = [
                (number, row[0].strip()) for number, row in enumerate(csv.reader(file), 1) if row and row[0].strip()
            ]
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise DesignError(f"{path} can't be read: {error}") from None
    peaks = []
    for place, (number, text) in enumerate(rows):
        try:
            peaks.append(float(text))
        except ValueError:
            if place == 0:
                continue
            raise DesignError(f"{path}, line {number}: {text!r} is not a force in newton") from None
    if not peaks:
        raise DesignError(f"{path} holds no peak forces")
    return np.array(peaks)
