"""The rule by which a value here agrees with a printed one."""

from typing import Any

import numpy as np

from chaosgym.arrays import Array
from thesis.figures.figure import Finding
from thesis.figures.printed import Printed, in_scorecard, printed, within


def describe_forces(peaks: Array, nature: str, period: int) -> str:
    """Peak forces of one response in words."""
    low, high = float(np.min(peaks)), float(np.max(peaks))
    force = f"{np.mean(peaks):.3g} N" if high - low < 0.05 else f"{low:.3g} to {high:.3g} N"
    return f"{force}, {nature}" + (f" of period {period}" if period > 1 else "")


def compare_response(
    where: str,
    target: str,
    response: tuple[Array, Any, Any],
    nature: str | None,
    *,
    largest_only: bool = False,
    sensitivity: str = "",
) -> Finding:
    """Compare peaks (cycles,) [N], nature and period of a response with a printed force and nature.

    Parameters
    ----------
    where
        Operating point in words.
    target
        Statement with the force.
    response
        Peaks, nature and period here.
    nature
        Printed nature; None if the text gives none.
    largest_only
        The statement is about the largest peak alone.
    sensitivity
        Parameter that the statement is about.
    """
    peaks, kind, period = np.asarray(response[0]), str(response[1]), int(response[2])
    wanted = printed(target)
    here: float | tuple[float, float]
    if largest_only:
        here = float(np.max(peaks))
    elif wanted.low == wanted.high:
        here = float(np.mean(peaks))
    else:
        here = (float(np.min(peaks)), float(np.max(peaks)))
    agrees = within(target, here) and (nature is None or nature == kind)
    text = ("at most " if largest_only else "") + words(wanted) + " N" + (f", {nature}" if nature else "")
    return Finding(
        f"{where}: {text}",
        describe_forces(peaks, kind, period),
        agrees,
        (target,),
        sensitivity,
        scored=in_scorecard(target),
    )


def compare_nature(
    where: str, target: str, response: tuple[Array, Any, Any], nature: str, sensitivity: str = ""
) -> Finding:
    """Compare the nature of a response with the printed one."""
    peaks, kind, period = np.asarray(response[0]), str(response[1]), int(response[2])
    here = describe_forces(peaks, kind, period)
    return Finding(f"{where}: {nature}", here, kind == nature, (target,), sensitivity, scored=in_scorecard(target))


def words(value: Printed) -> str:
    """A printed number or range in words."""
    return f"{value.low:g}" if value.low == value.high else f"{value.low:g} to {value.high:g}"
