"""Axes of a sweep: ranges of parameters."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ParameterError
from chaosgym.machines.units import parse_option

Array = NDArray[np.float64]
Scale = Literal["lin", "log"]

NO_UNITS: Mapping[str, str] = MappingProxyType({})

AXIS_FORM = "FIELD=LOW:HIGH[:COUNT][:lin|log]"


@dataclass(frozen=True)
class Axis:
    """One parameter of a sweep: its range, the number of grid points, and whether they are spaced by ratio.

    ``count`` is None unless on a grid.
    """

    field: str
    low: float
    high: float
    count: int | None = None
    scale: Scale = "lin"

    def __post_init__(self) -> None:
        shown = f"axis {self.field} = {self.low:g}:{self.high:g}"
        _check_range(shown, self.low, self.high, self.scale)
        if self.count is not None and not 2 <= self.count <= 10**6:
            raise ParameterError(f"{shown} has {self.count} points; allowed: 2 to 1000000")

    @classmethod
    def parse(cls, text: str, units: Mapping[str, str] = NO_UNITS) -> "Axis":
        """Read ``FIELD=LOW:HIGH[:COUNT][:lin|log]``; ends may have units, whose fields' own ``units`` names."""
        try:
            field, parts, scale = _split(text, (2, 3))
            count = int(parts[2]) if len(parts) == 3 else None
            return cls(field, *_ends(field, parts, units), count, scale)
        except ParameterError:
            raise
        except ValueError:
            raise ParameterError(f"axis {text!r} is not of the form {AXIS_FORM}") from None

    def __str__(self) -> str:
        count = "" if self.count is None else f":{self.count}"
        scale = "" if self.scale == "lin" else f":{self.scale}"
        return f"{self.field}={self.low:.12g}:{self.high:.12g}{count}{scale}"

    def at(self, share: Array) -> Array:
        """Values at shares 0 to 1 of the range."""
        return _between(self.low, self.high, self.scale, share)


def _check_range(shown: str, low: float, high: float, scale: str) -> None:
    if not np.isfinite([low, high]).all() or not low < high:
        raise ParameterError(f"{shown} is empty or reversed; allowed: LOW below HIGH")
    if scale not in ("lin", "log"):
        raise ParameterError(f"{shown} has scale {scale!r}; allowed: lin, log")
    if scale == "log" and low <= 0.0:
        raise ParameterError(f"{shown} can't be logarithmic; allowed: LOW above 0")


def _split(text: str, lengths: Sequence[int]) -> tuple[str, list[str], Scale]:
    """(field, parts of the range, scale) of a text on the command line; ValueError if it has another form."""
    field, separator, span = text.partition("=")
    parts = span.split(":")
    scale: Scale = "lin"
    if parts[-1] in ("lin", "log"):
        scale = "log" if parts.pop() == "log" else "lin"
    if not separator or len(parts) not in lengths:
        raise ValueError(text)
    return field, parts, scale


def _value(field: str, text: str, units: Mapping[str, str]) -> float:
    """Number in the unit of its field, with or without a unit of its own."""
    if field not in units:
        return float(text)
    unit = units[field]
    return parse_option(field, text, unit, "" if unit == "-" else unit)


def _ends(field: str, parts: Sequence[str], units: Mapping[str, str]) -> tuple[float, float]:
    return _value(field, parts[0], units), _value(field, parts[1], units)


def _between(low: float, high: float, scale: Scale, share: Array) -> Array:
    if scale == "log":
        return np.asarray(low * (high / low) ** share)
    return np.asarray(low + (high - low) * share)
