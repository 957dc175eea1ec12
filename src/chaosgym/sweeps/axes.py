"""Axes of a sweep: ranges of parameters, and patches of a lattice with a fixed step."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from chaosgym.diagnosis import Tolerance
from chaosgym.errors import ParameterError
from chaosgym.machines.units import parse_option

Array = NDArray[np.float64]
Scale = Literal["lin", "log"]

NO_UNITS: Mapping[str, str] = MappingProxyType({})

AXIS_FORM = "FIELD=LOW:HIGH[:COUNT][:lin|log]"
PATCH_FORM = "FIELD=LOW:HIGH:COUNT[:STEP][:lin|log]"


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
        return _written(self, "")

    def at(self, share: Array) -> Array:
        """Values at shares 0 to 1 of the range."""
        return _between(self.low, self.high, self.scale, share)


@dataclass(frozen=True)
class Patch:
    """One dimension of a small lattice of neighbours that is put at a random place of a range.

    Attributes
    ----------
    field
        The parameter.
    low, high
        Range in which the whole patch lies.
    count
        Number of points.
    step
        From each point to the next: a ratio if ``relative``, as all relative tolerances. None until the plan puts the
        default tolerance of the field there.
    scale
        Whether the places are uniform in the value or in its logarithm.
    """

    field: str
    low: float
    high: float
    count: int
    step: Tolerance | None = None
    scale: Scale = "lin"

    def __post_init__(self) -> None:
        shown = f"patch {self.field} = {self.low:g}:{self.high:g}"
        _check_range(shown, self.low, self.high, self.scale)
        if not 1 <= self.count <= 10**4:
            raise ParameterError(f"{shown} has {self.count} points; allowed: 1 to 10000")
        if self.step is not None:
            if not (np.isfinite(self.step.value) and self.step.value > 0.0):
                raise ParameterError(f"{shown} has the step {self.step.value:g}; allowed: above 0")
            if not self.low <= self.highest_start:
                raise ParameterError(f"{shown} is too narrow for {self.count} points {self.shown_step} apart")

    @classmethod
    def parse(cls, text: str, units: Mapping[str, str] = NO_UNITS) -> "Patch":
        """Read ``FIELD=LOW:HIGH:COUNT[:STEP][:lin|log]``; a STEP such as 2% is a ratio, a plain number a difference."""
        try:
            field, parts, scale = _split(text, (3, 4))
            step = None
            if len(parts) == 4:
                relative = parts[3].endswith("%")
                amount = float(parts[3][:-1]) / 100.0 if relative else _value(field, parts[3], units)
                step = Tolerance(amount, relative)
            return cls(field, *_ends(field, parts, units), int(parts[2]), step, scale)
        except ParameterError:
            raise
        except ValueError:
            raise ParameterError(f"patch {text!r} is not of the form {PATCH_FORM}") from None

    def __str__(self) -> str:
        return _written(self, f":{self.shown_step}" if self.step else "")

    @property
    def shown_step(self) -> str:
        """The step as it is written on the command line."""
        step = self._known_step
        return f"{100.0 * step.value:.10g}%" if step.relative else f"{step.value:.10g}"

    @property
    def highest_start(self) -> float:
        """Largest value at which a patch can begin."""
        step = self._known_step
        return step.at(self.high, 1.0 - self.count) if step.relative else self.high - (self.count - 1) * step.value

    @property
    def _known_step(self) -> Tolerance:
        if self.step is None:
            raise ParameterError(f"patch {self.field} has no step yet; allowed: a plan gives it one")
        return self.step

    def at(self, place: Array, index: Array) -> Array:
        """Values of points ``index`` of patches at places 0 to 1 of the range."""
        start, step = _between(self.low, self.highest_start, self.scale, place), self._known_step
        return start * (1.0 + step.value) ** index if step.relative else start + index * step.value


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


def _written(span: Any, step: str) -> str:
    count = "" if span.count is None else f":{span.count}"
    scale = "" if span.scale == "lin" else f":{span.scale}"
    return f"{span.field}={span.low:.12g}:{span.high:.12g}{count}{step}{scale}"


def _between(low: float, high: float, scale: Scale, share: Array) -> Array:
    if scale == "log":
        return np.asarray(low * (high / low) ** share)
    return np.asarray(low + (high - low) * share)
