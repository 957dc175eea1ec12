"""What N jobs felt since they last changed their speed, and how likely the motion there is irregular."""

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.classifier.features import MAX_CYCLES, MIN_CYCLES
from chaosgym.classifier.shipped import default_classifier, has_classifier
from chaosgym.envs.sense import LAGS, RECENT, has_sense, shipped_sense
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine

UNKNOWN = 0.5
"""Probability where fewer cycles were measured at a speed than are needed to judge them."""


class RecordsAtSpeed:
    """The readings of N jobs since they last changed their speed, of at most the 64 latest cycles, and what they mean.

    The machine's shipped sense judges them; where none is shipped, the classifier of records judges the peaks.

    Parameters
    ----------
    machine
        Whose sense or classifier judges.
    sensor_error
        Half width of the error of a peak [N].
    count
        N.

    Raises
    ------
    ParameterError
        If neither is shipped for the machine.
    """

    def __init__(self, machine: Machine, sensor_error: float, count: int) -> None:
        if not has_classifier(machine.name):
            raise ParameterError(
                f"classifier = 'on' needs a classifier that chaosgym ships, and for {machine.name} it ships none; "
                "allowed: 'off', or monitor = 'on'"
            )
        self._machine, self._error = machine.name, sensor_error
        self._peaks, self._length = np.full((count, MAX_CYCLES), np.nan), np.zeros(count, np.int64)
        self._speed = np.full(count, np.nan)
        # impacts a cycle and share of bouncing: of the last step, and sums over the steps at this speed
        self._last, self._sum, self._steps = np.zeros((count, 2)), np.zeros((count, 2)), np.zeros(count)

    def forget(self, which: Indices) -> None:
        """Begin anew for the jobs ``which`` (k,)."""
        self._speed[which] = np.nan
        self._begin(which)

    def _begin(self, which: Indices) -> None:
        self._peaks[which], self._length[which], self._sum[which], self._steps[which] = np.nan, 0, 0.0, 0.0

    def add(self, which: Indices, speeds: Array, peaks: Array, impacts: Array, bouncing: Array) -> None:
        """Take in a step at ``speeds`` (k,): measured ``peaks`` (k, cycles) [N], ``impacts`` a cycle (k,) and the share
        of ``bouncing`` (k,); another speed begins anew."""
        self._begin(which[self._speed[which] != speeds])
        self._speed[which] = speeds
        self._last[which] = np.column_stack([impacts, bouncing])
        self._sum[which] += self._last[which]
        self._steps[which] += 1.0
        latest = peaks[:, -MAX_CYCLES:]
        size = latest.shape[1]
        full = which[self._length[which] + size > MAX_CYCLES]
        over = self._length[full] + size - MAX_CYCLES
        places = np.minimum(np.arange(MAX_CYCLES) + over[:, None], MAX_CYCLES - 1)
        self._peaks[full] = np.take_along_axis(self._peaks[full], places, axis=1)
        self._length[full] -= over
        self._peaks[which[:, None], self._length[which][:, None] + np.arange(size)] = latest
        self._length[which] += size

    def statistics(self, which: Indices) -> Array:
        """What a sense sees of the jobs ``which`` (k,), in the order of ``sense.STATISTICS``, (k, entries).

        NaN where fewer than ``sense.RECENT`` cycles were measured at the speed.
        """
        peaks, length = self._peaks[which], self._length[which]
        ends = (length[:, None] + np.arange(-RECENT, 0)).clip(0)
        recent = np.where((length >= RECENT)[:, None], np.take_along_axis(peaks, ends, axis=1), np.nan)
        known = [self._speed[which], np.where(length >= RECENT, length, np.nan), np.full(len(which), self._error)]
        columns = [*known, *_of(peaks, length), *_of(recent, np.full(len(which), RECENT))]
        columns += [*(self._sum[which] / np.maximum(self._steps[which], 1.0)[:, None]).T, *self._last[which].T]
        return np.column_stack(columns)

    def irregular_probability(self, which: Indices) -> Array:
        """How likely a cycle of the jobs ``which`` (k,) is irregular, (k,) from 0 to 1."""
        told = np.full(len(which), UNKNOWN)
        if has_sense(self._machine):
            known = self._length[which] >= RECENT
            told[known] = shipped_sense(self._machine)(self.statistics(which[known]))
            return told
        known = self._length[which] >= MIN_CYCLES
        if known.any():
            classifier = default_classifier(self._machine)
            told[known] = classifier.irregular_probability(self._peaks[which[known]], self._error)
        return told


def _of(peaks: Array, length: Indices) -> list[Array]:
    """Mean, deviation, least and largest of peaks (k, cycles) that end in NaN, and how far they miss those before."""
    inside = np.arange(peaks.shape[1]) < length[:, None]
    filled = np.where(inside, peaks, 0.0)
    mean = filled.sum(axis=1) / np.maximum(length, 1)
    spread = np.sqrt((np.where(inside, peaks - mean[:, None], 0.0) ** 2).sum(axis=1) / np.maximum(length, 1))
    columns = [mean, spread, np.where(inside, peaks, np.inf).min(axis=1), np.where(inside, peaks, -np.inf).max(axis=1)]
    for lag in LAGS:
        missed = np.abs(filled[:, lag:] - filled[:, :-lag]) * inside[:, lag:]
        columns.append(missed.sum(axis=1) / np.maximum(length - lag, 1))
    return columns
