"""Numbers from files, archives and programs: validation of kind, shape, finiteness and range; a summary of many.

``number`` and ``whole`` are the check of every argument of a public function that is one number: they refuse NaN,
infinity, texts and truth values, and name argument, value and range.
"""

import math
import reprlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import ChaosgymError, ParameterError

REAL = "iuf"
"""Kinds of arrays that hold numbers: no complex ones, no texts, no truth values, no objects."""

_short = reprlib.Repr()
_short.maxstring = _short.maxother = _short.maxlong = 60


def shown(given: Any) -> str:
    """A value as a message shows it, cut if it is long."""
    try:
        return _short.repr(given)
    except ValueError:  # Python writes no whole numbers of thousands of digits
        return "a whole number of thousands of digits"


MOST_SEED = 2**63 - 1
"""Largest seed that Parquet and JSON hold."""

MOST = 10**9
"""Largest whole number where nothing else bounds it: cycles of months of computing."""


def number(
    name: str,
    given: Any,
    low: float,
    high: float = math.inf,
    unit: str = "",
    *,
    inside: bool = False,
    error: type[ChaosgymError] = ParameterError,
) -> float:
    """Return a finite number in its range.

    Parameters
    ----------
    name
        For the message.
    given
        Any real number of Python or numpy.
    low, high
        Range, ends included [``unit``]; without ``high`` any finite number from ``low`` on.
    inside
        Leave the ends out.
    error
        What is raised.

    Raises
    ------
    ParameterError
        Otherwise; names it, the value and what is allowed.

    Examples
    --------
    >>> from chaosgym.numbers import number
    >>> number("share", 0.5, 0.0, 1.0), number("rate", 2000, 0.0, unit="Hz", inside=True)
    (0.5, 2000.0)
    """
    value = _real(given)
    there = not math.isnan(value) and math.isfinite(value) and low <= value <= high
    if there and not (inside and value in (low, high)):
        return value
    unit = f" {unit}" if unit else ""
    if math.isinf(low):
        allowed = "a finite number"
    elif math.isinf(high):
        allowed = f"above {low:g}{unit}" if inside else f"{low:g}{unit} or more"
    else:
        allowed = f"above {low:g}, below {high:g}{unit}" if inside else f"{low:g} to {high:g}{unit}"
    told = f"{value:g}{unit}" if math.isfinite(value) or isinstance(given, float) else shown(given)
    raise error(f"{name} = {told} is out of range; allowed: {allowed}")


def _real(given: Any) -> float:
    """A number, infinite where it is too large for one; NaN for all that is none."""
    if isinstance(given, bool | str | bytes | np.bool_) or not hasattr(given, "__float__") or np.ndim(given):
        return math.nan
    try:
        return float(given)
    except OverflowError:
        return math.inf
    except (TypeError, ValueError):
        return math.nan


def whole(name: str, given: Any, low: int, high: int = MOST, *, error: type[ChaosgymError] = ParameterError) -> int:
    """Return a whole number in its range; raises as ``number``, and for fractions.

    Examples
    --------
    >>> from chaosgym.numbers import whole
    >>> whole("cycles", 100.0, 1)
    100
    """
    value = _real(given)
    if math.isfinite(value) and value == math.floor(value) and low <= int(given) <= high:
        return int(given)
    raise error(f"{name} = {shown(given)} is out of range; allowed: whole numbers from {low} to {high:,}")


def numbers(
    name: str, given: Any, low: float, high: float, unit: str = "", *, shape: tuple[int | None, ...] = (None,)
) -> Array:
    """Return an array of finite numbers in their range, as float64.

    Parameters
    ----------
    name
        For the message.
    given
        Anything that numpy makes an array of.
    low, high
        Range of every entry, ends included [``unit``].
    shape
        Entries along each axis; None for any number of them from 1 on.

    Raises
    ------
    ParameterError
        If kind, shape or an entry is another; names it and what is allowed.
    """
    try:
        array = np.asarray(given)
    except (TypeError, ValueError, OverflowError, MemoryError):
        raise ParameterError(f"{name} holds no array of numbers") from None
    if array.dtype.kind not in REAL:
        raise ParameterError(f"{name} holds {array.dtype.name} values; allowed: real numbers")
    array = array.astype(np.float64)
    if array.ndim != len(shape) or not all(map(_fits, array.shape, shape)):
        wanted = ", ".join("1 or more" if side is None else str(side) for side in shape)
        raise ParameterError(f"{name} has {_sides(array.shape)} entries; allowed: {wanted}")
    if not np.all((array >= low) & (array <= high)):
        worst = float(array[~((array >= low) & (array <= high))][0])
        raise ParameterError(
            f"{name} = {worst:g}{unit and ' '}{unit} is out of range; allowed: {low:g} to {high:g}{unit and ' '}{unit}"
        )
    return array


def _fits(there: int, wanted: int | None) -> bool:
    return there > 0 and wanted in (None, there)


def _sides(shape: tuple[int, ...]) -> str:
    return " x ".join(map(str, shape)) or "no row of"


def summary(values: ArrayLike) -> dict[str, float]:
    """Smallest, largest, mean and standard deviation of readings, for people and JSON.

    Examples
    --------
    >>> from chaosgym.numbers import summary
    >>> summary([1.0, 2.0, 3.0])
    {'min': 1.0, 'max': 3.0, 'mean': 2.0, 'std': 0.816496580927726}
    """
    readings = np.asarray(values, dtype=float)
    return {name: float(getattr(readings, name)()) for name in ("min", "max", "mean", "std")}
