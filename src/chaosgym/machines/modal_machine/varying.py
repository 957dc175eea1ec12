"""Springs whose stiffness varies over the cycle: samples, and their means over equal parts of it."""

from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.numbers import numbers

FEWEST, MOST = 3, 3600
"""Samples of a stiffness over the cycle."""

STIFFEST = 1e13
"""Stiffness [N/m] that a machine may have."""


class HeldSpring(NamedTuple):
    """A spring at one point of a structure, beside those that its modes know.

    ``values`` [N/m] are samples over one cycle at equal steps, the first at its beginning, with straight lines between;
    or one number. ``damping`` [N s/m] is that of a damper beside it.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import HeldSpring
    >>> HeldSpring("mesh", (1e8, 1.5e8, 1e8)).values[1]
    150000000.0
    """

    at: str
    values: tuple[float, ...]
    damping: float = 0.0


def checked_samples(name: str, values: Any, low: float) -> Array:
    """Stiffness over a cycle: one number, or samples.

    Raises
    ------
    ParameterError
        If there are too few or too many, or one is below ``low``.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import checked_samples
    >>> checked_samples("stiffness", 2e6, 0.0)
    array([2000000.])
    """
    given = numbers(name, np.atleast_1d(values), low, STIFFEST, "N/m")
    if len(given) != 1 and not FEWEST <= len(given) <= MOST:
        raise ParameterError(f"{name} has {len(given)} samples of a cycle; allowed: 1, or {FEWEST} to {MOST}")
    return given


def means(values: Array, bins: int) -> Array:
    """Mean over each of some equal parts of a cycle of samples with straight lines between, (bins,).

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import means
    >>> means(np.array([0.0, 1.0, 2.0, 1.0]), 2)
    array([1., 1.])
    >>> means(np.array([0.0, 1.0, 2.0, 1.0]), 4)
    array([0.5, 1.5, 1.5, 0.5])
    """
    count = len(values)
    closed = np.append(values, values[0])
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (closed[:-1] + closed[1:]))])
    at = np.arange(bins + 1) * (count / bins)
    i = np.minimum(at.astype(int), count - 1)
    part = at - i
    area = whole[i] + closed[i] * part + 0.5 * (closed[i + 1] - closed[i]) * part**2
    return np.asarray(np.diff(area) * (bins / count))
