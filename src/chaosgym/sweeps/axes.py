"""Axes of a sweep: ranges of parameters."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import USUAL, suggestion
from chaosgym.numbers import number, whole
from chaosgym.units import as_float, parse_option

Scale = Literal["lin", "log"]
SCALES: tuple[Scale, ...] = ("lin", "log")

NO_UNITS: Mapping[str, str] = MappingProxyType({})

AXIS_FORM = "FIELD=LOW:HIGH[:COUNT][:lin|log]"


@dataclass(frozen=True)
class Axis:
    """One parameter of a sweep: its range, the number of grid points, and whether they are spaced by ratio.

    ``count`` is None unless on a grid.

    Examples
    --------
    >>> chaosgym.Axis.parse("clearance=0.03mm:0.3mm:5:log", {"clearance": "m"})
    Axis(field='clearance', low=3e-05, high=0.0003, count=5, scale='log')
    """

    field: str
    low: float
    high: float
    count: int | None = None
    scale: Scale = "lin"

    def __post_init__(self) -> None:
        for name in ("low", "high"):
            number(f"{name} end of axis {self.field}", getattr(self, name), -np.inf)
        shown = f"axis {self.field} = {self.low:g}:{self.high:g}"
        if self.low >= self.high:
            raise ParameterError(f"{shown} is empty or reversed; allowed: LOW below HIGH")
        if self.scale not in SCALES:
            raise ParameterError(f"{shown} has scale {self.scale!r}; allowed: lin, log")
        if self.scale == "log" and self.low <= 0.0:
            raise ParameterError(f"{shown} can't be logarithmic; allowed: LOW above 0")
        if self.count is not None:
            whole(f"count of axis {self.field}", self.count, 2, 10**6)

    @classmethod
    def parse(cls, text: str, units: Mapping[str, str] = NO_UNITS) -> "Axis":
        """Read ``FIELD=LOW:HIGH[:COUNT][:lin|log]``; ends may have units, whose fields' own ``units`` names."""
        try:
            field, span = text.split("=")
            if units and field not in units:
                raise ParameterError(f"axis {field!r} is no field{suggestion(field, [*USUAL, *units])}")
            parts = span.split(":")
            scale: Scale = "log" if parts[-1] == "log" else "lin"
            low, high, *more = parts[:-1] if parts[-1] in SCALES else parts
            counts: list[int | None] = [int(one) for one in more]
            [count] = counts or [None]
            return cls(field, _value(field, low, units), _value(field, high, units), count, scale)
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
        if self.scale == "log":
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + (self.high - self.low) * share)


def _value(field: str, text: str, units: Mapping[str, str]) -> float:
    """Number in the unit of its field, with or without a unit of its own."""
    return parse_option(field, text, units[field], "") if field in units else as_float(text)
