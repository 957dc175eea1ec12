"""What pulls over a cycle, in files of gaps and of mechanisms alike: a constant and harmonics of the cycle.

Samples of a cycle mean the sum of harmonics through them, cut to some of its terms. Of an even number of samples the
last harmonic is a cosine, since its sine is 0 at all of them.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.errors import ParameterError
from chaosgym.numbers import numbers, whole

MOST_HARMONICS = 64

FEWEST_SAMPLES = 3

MOST_SAMPLED = 16
"""Harmonics of a sampled cycle by default, at most."""

LARGEST = 1e12
"""Largest amplitude, in the unit of what pulls."""

LEFT_OUT = 0.01
"""Share of the largest harmonic that samples may differ from their harmonics unsaid."""


class Cycle(NamedTuple):
    """Values over a cycle: ``mean``, and ``harmonics`` (order, cosine, sine).

    ``left_out`` is by how much samples differ from their harmonics at the most.

    Examples
    --------
    >>> from chaosgym.machines.loads import Cycle
    >>> Cycle.sine(5.0, harmonic=2).at(np.array([0.0, np.pi / 4.0])).round(6)
    array([0., 5.])
    """

    mean: float
    harmonics: tuple[tuple[int, float, float], ...] = ()
    left_out: float = 0.0

    @classmethod
    def sine(cls, amplitude: float, harmonic: int = 1, angle: float = 0.0) -> "Cycle":
        """Values amplitude sin(harmonic x + angle) at an angle x of the cycle, all in rad."""
        return cls(0.0, ((harmonic, amplitude * math.sin(angle), amplitude * math.cos(angle)),))

    @classmethod
    def sampled(cls, name: str, values: ArrayLike, harmonics: int | None = None, unit: str = "") -> "Cycle":
        """Harmonics of values at equal intervals over a cycle, the first at its beginning; 16 of them, or all.

        Raises
        ------
        ParameterError
            If there are too few values for so many harmonics.
        """
        cycle = numbers(name, values, -LARGEST, LARGEST, unit)
        if harmonics is None:
            harmonics = min(MOST_SAMPLED, len(cycle) // 2)
        else:
            whole("harmonics", harmonics, 1, MOST_HARMONICS)
        if len(cycle) < FEWEST_SAMPLES:
            raise ParameterError(f"{name} are {len(cycle)}; allowed: {FEWEST_SAMPLES} or more over a cycle")
        if len(cycle) < 2 * harmonics:
            raise ParameterError(
                f"{harmonics} harmonics need {2 * harmonics} samples of a cycle, not {cycle.size}; allowed: up to "
                f"{cycle.size // 2}"
            )
        parts = np.fft.rfft(cycle) / len(cycle)
        twice = [1.0 if 2 * k == len(cycle) else 2.0 for k in range(harmonics + 1)]
        rows = tuple(
            (k, twice[k] * float(parts[k].real), -twice[k] * float(parts[k].imag)) for k in range(1, harmonics + 1)
        )
        kept = np.fft.irfft(np.where(np.arange(len(parts)) <= harmonics, parts, 0.0) * len(cycle), len(cycle))
        return cls(float(parts[0].real), rows, float(np.max(np.abs(cycle - kept))))

    def at(self, angle: Array) -> Array:
        """Values at angles of the cycle [rad], any shape."""
        total = np.full(np.shape(angle), self.mean)
        for order, cosine, sine in self.harmonics:
            total += cosine * matrices.cos(order * angle) + sine * matrices.sin(order * angle)
        return total

    def slope(self, angle: Array) -> Array:
        """Derivatives by the angle [1/rad], as ``at``."""
        turned = tuple((order, order * sine, -order * cosine) for order, cosine, sine in self.harmonics)
        return Cycle(0.0, turned).at(angle)

    def note(self, what: str, unit: str = "in SI") -> str:
        """What is to be said of samples that their harmonics miss, by so much in a unit; empty if nothing is."""
        size = max((math.hypot(*pair) for _, *pair in self.harmonics), default=0.0)
        if not self.left_out > LEFT_OUT * size:
            return ""
        return (
            f"{len(self.harmonics)} harmonics differ from the samples of {what} by up to {self.left_out:.2g} {unit}; "
            f"more harmonics, up to half the samples and {MOST_HARMONICS}, keep more of them"
        )


def cycle_of(name: str, row: Mapping[str, Any], key: str, unit: str, *, constant: bool = False) -> Cycle:
    """Values over a cycle that a table of a file states: an amplitude or, where it may be, a constant; or samples.

    Parameters
    ----------
    name, row
        The table, with ``harmonic`` and ``angle`` [deg] of one number, or ``harmonics`` of samples.
    key, unit
        Where the numbers stand.
    constant
        Whether one number without ``harmonic`` is a constant; else it is the amplitude of a sine.

    Raises
    ------
    ParameterError
        If a key has no meaning beside the others, or a value is out of range.
    """
    values = np.atleast_1d(row[key])
    one = len(values) == 1
    still = one and constant and "harmonic" not in row
    if row.get("harmonic") == 0:
        raise ParameterError(
            f"{name}.harmonic = 0 is constant; allowed: {'leave it out' if constant else 'a [[load]]'}"
        )
    wrong = ("harmonics", "angle") if still else ("harmonics",) if one else ("harmonic", "angle")
    for other in wrong:
        if other in row:
            what = "a constant" if still else "one amplitude" if one else "samples of a cycle"
            pulls = still and (name, other) == ("force", "angle")
            told = "where it pulls stands in direction" if pulls else "leave it out"
            raise ParameterError(f"{name}.{other} has no meaning beside {what}; {told}")
    if not one:
        return Cycle.sampled(f"samples of {key}", values, row.get("harmonics"), unit)
    value = float(numbers(f"{name}.{key}", values, -LARGEST, LARGEST, unit)[0])
    if still:
        return Cycle(value)
    order = whole(f"{name}.harmonic", row.get("harmonic", 1), 1, MOST_HARMONICS)
    return Cycle.sine(value, order, math.radians(row.get("angle", 0.0)))
