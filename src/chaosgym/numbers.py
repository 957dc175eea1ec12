"""Numbers from files, archives and programs: validation of kind, shape, finiteness and range; a summary of many."""

import reprlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError

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


def number(name: str, given: Any, low: float, high: float, unit: str = "") -> float:
    """Return a finite number in its range.

    Raises
    ------
    ParameterError
        Otherwise; names it, the value and what is allowed.
    """
    allowed = f"allowed: {low:g} to {high:g}{unit and ' '}{unit}"
    try:
        value = float(given)
    except (TypeError, ValueError, OverflowError):
        raise ParameterError(f"{name} = {shown(given)} is out of range; {allowed}") from None
    if not low <= value <= high:
        raise ParameterError(f"{name} = {value:g}{unit and ' '}{unit} is out of range; {allowed}")
    return value


def whole(name: str, given: Any, low: int, high: int) -> int:
    """Return a whole number in its range; raises as ``number``, and for fractions."""
    value = number(name, given, low, high)
    if value != int(value):
        raise ParameterError(f"{name} = {value:g} is out of range; allowed: whole numbers from {low} to {high:,}")
    return int(value)


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
