"""Irregular cycles, judged on the running motion by its exponent or its recurrence.

A machine whose kernel carries small deviations along is judged by their growth: the mean over some ten cycles of the
logarithm of the growth in a cycle, an exponent of the running motion. A cycle with a positive one is irregular.
Decaying transients do not count; transient chaos counts until it has decayed.

Other machines, and those with free bodies, are judged by recurrence with an amplitude: a step is irregular if, over
its last cycles, peak forces miss those of the cycles before, at every period up to eight, by more than 2 % of their
mean. The first eight cycles after a change of speed are compared with nothing. A step of less than 20 cycles is judged
with those before it, so that a speed which changes in every cycle is judged too.

Type III of thesis 5.5 is a property of a region of tolerances, and holds its periodic windows too; these do not cost.
The key ``type_iii`` of the environments is the share of irregular cycles.

On the beam recurrence takes weak chaos for calm, which is why the beam is not judged by it: ``python -m benchmarks
judges`` measures both.
"""

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.core.compilation import call
from chaosgym.envs.kernels.steps import recurrence_misses, running_exponents
from chaosgym.series.verdict import Statement

MEMORY = 10.0
"""Cycles over which the growth is averaged."""

LARGEST_GROWTH = 3.0
"""Growth of a cycle beyond which it counts no more, either way."""

MISS = 0.02
"""Share of the mean peak force by which a motion that repeats may miss itself."""


WINDOW = 20
"""Cycles that recurrence needs at least."""


IRREGULAR = 0.5
"""Share of irregular cycles above which a step is told as irregular."""


class Judge(Protocol):
    """Judge of irregular motion of N machines; ``figure`` names what its verdicts rest on."""

    figure: str

    def start(self, which: Indices) -> None:
        """Begin anew for the machines ``which`` (k,)."""
        ...

    def verdict(self, which: Indices, growth: Array, peaks: Array) -> tuple[Array, Array]:
        """Judge a step of the machines ``which`` (k,) by growth and peaks (k, cycles).

        Returns
        -------
        (share, irregularity)
            (k,) share of the irregular cycles, and the number behind the last verdict.
        """
        ...


class ExponentJudge:
    """Judges by the growth of small deviations; ``irregularity`` is the exponent [1/cycle]."""

    figure = "exponent a cycle of the running motion"

    def __init__(self, count: int) -> None:
        self._exponent = np.zeros(count)

    def start(self, which: Indices) -> None:
        """Begin anew for the machines ``which`` (k,)."""
        self._exponent[which] = 0.0

    def verdict(self, which: Indices, growth: Array, peaks: Array) -> tuple[Array, Array]:
        """Share of the cycles with a positive exponent, and the exponent, (k,) each."""
        shares = np.empty(len(which))
        call(running_exponents, growth, which, MEMORY, LARGEST_GROWTH, self._exponent, shares)
        return shares, self._exponent[which]


class RecurrenceJudge:
    """Judges by peaks that do not repeat; ``irregularity`` is the smallest miss as a share of the mean peak."""

    figure = "smallest miss of a repetition, as a share of the mean peak"

    def __init__(self, count: int) -> None:
        self._recent = np.full((count, WINDOW), np.nan)

    def start(self, which: Indices) -> None:
        """Begin anew for the machines ``which`` (k,)."""
        self._recent[which] = np.nan

    def verdict(self, which: Indices, growth: Array, peaks: Array) -> tuple[Array, Array]:
        """1 where the step does not repeat, otherwise 0, and the miss, (k,) each."""
        if peaks.shape[1] < WINDOW:
            peaks = np.concatenate([self._recent[which], peaks], axis=1)[:, -WINDOW:]
        self._recent[which] = peaks[:, -WINDOW:]
        miss = recurrence_miss(peaks)
        return (miss > MISS).astype(float), miss


def nature_of(share: float) -> str:
    """A step with a share of irregular cycles in a word: "irregular" or "calm"."""
    return "irregular" if share > IRREGULAR else "calm"


def statement_of(judge: Judge, info: Mapping[str, Any], cycles: int) -> Statement:
    """What the ``info`` of a step of so many cycles tells of the running motion, in the form of every verdict.

    It has no proof and may not have settled: ``chaosgym.diagnose`` tells that of the machine.
    """
    share = float(info["type_iii"])
    return Statement(
        nature=nature_of(share),
        certainty=f"{share:.0%} of the cycles are irregular",
        reason=f"{judge.figure}: {float(info['irregularity']):.3g}",
        transient="the motion may not have settled",
        horizon=f"seen over {cycles} cycles",
        other_motions="",
        condition="",
        tells_more="chaosgym.diagnose(env.unwrapped.machine)",
        meaning="",
    )


def recurrence_miss(peaks: Array) -> Array:
    """Mean miss at the period that fits best, as a share of the mean peak, (k,), of peak forces (k, cycles).

    The first eight cycles, at most half, are only compared with. Cycles that are not known, nan, come first.
    """
    misses = np.empty(len(peaks))
    call(recurrence_misses, peaks, misses)
    return misses
