"""Which machine is at work? One drawn within tolerances, without limit, or one of 256 that are kept for evaluation."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings

HELD_OUT = 256
"""Machines of an evaluation."""

HELD_OUT_SEED = 34_000_000
"""Machine k of the evaluation is drawn by the generator of (this, k), and its job is reset with this + k."""

DRAWN = -1
"""Number of a machine that was drawn for its job."""


class Variants:
    """Machines within tolerances of a nominal one.

    Parameters
    ----------
    nominal
        What they are variants of.
    tolerances
        Half width of each field that varies, as a share of its nominal value; uniform within.

    Raises
    ------
    ParameterError
        If a field is unknown or a tolerance is no number from 0 to 0.9.
    """

    def __init__(self, nominal: Machine, tolerances: Mapping[str, float]) -> None:
        for name, width in tolerances.items():
            if isinstance(width, str | bool) or not hasattr(width, "__float__") or not 0.0 <= float(width) <= 0.9:
                raise ParameterError(f"tolerances[{name!r}] = {width!r} is out of range; allowed: 0 to 0.9")
        with_settings(nominal, {name: getattr(nominal, name, None) for name in tolerances})
        self.nominal = nominal
        self.tolerances = {name: float(width) for name, width in tolerances.items()}

    def drawn(self, generator: np.random.Generator) -> Machine:
        """Draw a machine."""
        shares = generator.uniform(-1.0, 1.0, len(self.tolerances))
        items = zip(self.tolerances.items(), shares.tolist(), strict=True)
        values = {name: getattr(self.nominal, name) * (1.0 + width * share) for (name, width), share in items}
        return with_settings(self.nominal, values) if values else self.nominal

    def held_out(self, number: int) -> Machine:
        """Return machine ``number`` of the evaluation."""
        return self.drawn(np.random.default_rng([HELD_OUT_SEED, number]))


def checked_numbers(given: Any, count: int) -> np.ndarray:
    """Return numbers of held-out machines for ``count`` jobs, (count,).

    Raises
    ------
    ParameterError
        If they are not one whole number from 0 to 255, or one for each job.
    """
    numbers = np.asarray(given)
    whole = np.issubdtype(numbers.dtype, np.integer) and numbers.shape in ((), (count,))
    if not whole or numbers.min() < 0 or numbers.max() >= HELD_OUT:
        raise ParameterError(
            f"options['machine'] = {given!r} is out of range; allowed: a whole number from 0 to {HELD_OUT - 1}"
            + (f", or {count} of them" if count > 1 else "")
        )
    return np.broadcast_to(numbers, count).astype(np.int64)
