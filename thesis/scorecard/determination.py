"""How well a calibration determines each parameter: the spread of near-best candidates, and the cost of a step."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.errors import ParameterError
from thesis.scorecard.objective import staged_objective
from thesis.scorecard.search_space import Dimension, Real, SearchSpace, Whole

NEAR_BEST = 0.05
"""Objective above the best one up to which a candidate counts as near-best: one statement of twenty."""

STEPS = (-0.05, -0.01, 0.01, 0.05)
"""Steps off the best value, as shares of the searched range."""


@dataclass(frozen=True)
class Determination:
    """How well one parameter is determined.

    Attributes
    ----------
    name, unit
        The parameter.
    best
        Its value.
    searched
        Bounds of the search, or the words that were allowed.
    near_best
        Smallest and largest value among the near-best candidates, or the words they use.
    spread
        Interdecile range of the near-best candidates, as a share of the searched range; None for words.
    sensitivity
        Objective at steps off the best value, the other parameters kept: {step as a share of the range: objective}.
    """

    name: str
    unit: str
    best: float | str
    searched: tuple[Any, ...]
    near_best: tuple[Any, ...]
    spread: float | None
    sensitivity: Mapping[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def determine(
    space: SearchSpace,
    values: Mapping[str, Any],
    trials: Sequence[Any],
    *,
    workers: int | None = None,
    progress: bool = False,
) -> tuple[Determination, ...]:
    """Judge every searched parameter.

    Parameters
    ----------
    space
        What was searched.
    values
        The best candidate.
    trials
        Completed trials with ``value`` and ``params``.
    """
    lowest = min((trial.value for trial in trials), default=np.inf)
    near = [trial.params for trial in trials if trial.value <= lowest + NEAR_BEST]
    bar = tqdm(space.dimensions, desc="determination", disable=not progress, unit="parameter")
    return tuple(_determine(space, one, values, near, workers) for one in bar)


def _determine(
    space: SearchSpace,
    dimension: Dimension,
    values: Mapping[str, Any],
    near: Sequence[Mapping[str, Any]],
    workers: int | None,
) -> Determination:
    found = [params[dimension.name] for params in near] or [values[dimension.name]]
    sensitivity = {
        label: _objective(space, {**values, dimension.name: value}, workers)
        for label, value in _neighbours(dimension, values[dimension.name])
    }
    if isinstance(dimension, Real | Whole):
        shares = [_share(dimension, value) for value in found]
        spread = float(np.quantile(shares, 0.9) - np.quantile(shares, 0.1))
        searched: tuple[Any, ...] = (dimension.low, dimension.high)
        span: tuple[Any, ...] = (min(found), max(found))
    else:
        spread_of_words, searched, span = None, dimension.choices, tuple(sorted(set(found)))
        return Determination(
            dimension.name, dimension.unit, values[dimension.name], searched, span, spread_of_words, sensitivity
        )
    return Determination(dimension.name, dimension.unit, values[dimension.name], searched, span, spread, sensitivity)


def _objective(space: SearchSpace, values: Mapping[str, Any], workers: int | None) -> float:
    try:
        return list(staged_objective(space.machine(values), workers=workers))[-1]
    except ParameterError:
        return 1.0


def _neighbours(dimension: Dimension, value: Any) -> Iterator[tuple[str, Any]]:
    """Labels and values of the steps off a value that stay inside the range."""
    if isinstance(dimension, Whole):
        yield from ((f"{step:+d}", value + step) for step in (-1, 1) if dimension.low <= value + step <= dimension.high)
    elif isinstance(dimension, Real):
        for step in STEPS:
            share = _share(dimension, value) + step
            if 0.0 <= share <= 1.0:
                yield f"{step:+g}", _at(dimension, share)
    else:
        yield from ((word, word) for word in dimension.choices if word != value)


def _share(dimension: Real | Whole, value: float) -> float:
    """Where a value lies in its range, 0 to 1."""
    low, high = float(dimension.low), float(dimension.high)
    if isinstance(dimension, Real) and dimension.log:
        return float(np.log(value / low) / np.log(high / low))
    return (value - low) / (high - low)


def _at(dimension: Real, share: float) -> float:
    if dimension.log:
        return float(dimension.low * (dimension.high / dimension.low) ** share)
    return float(dimension.low + share * (dimension.high - dimension.low))
