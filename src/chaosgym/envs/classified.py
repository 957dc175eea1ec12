"""What the trained classifier of records tells of N jobs: how likely the motion at the present speed is irregular."""

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.classifier.features import MAX_CYCLES, MIN_CYCLES
from chaosgym.classifier.shipped import default_classifier, has_classifier
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine

UNKNOWN = 0.5
"""Probability where fewer cycles were measured at a speed than the classifier reads."""


class RecordsAtSpeed:
    """The peaks of N jobs since they last changed their speed, at most the 64 latest, and what they mean.

    Parameters
    ----------
    machine
        Whose shipped classifier judges.
    sensor_error
        Half width of the error of a peak [N].
    count
        N.

    Raises
    ------
    ParameterError
        If no classifier is shipped for the machine.
    """

    def __init__(self, machine: Machine, sensor_error: float, count: int) -> None:
        if not has_classifier(machine.name):
            raise ParameterError(
                f"classifier = 'on' needs a classifier that chaosgym ships, and for {machine.name} it ships none; "
                "allowed: 'off', or monitor = 'on'"
            )
        self._classifier = default_classifier(machine.name)
        self._error = sensor_error
        self._peaks, self._length = np.full((count, MAX_CYCLES), np.nan), np.zeros(count, np.int64)
        self._speed = np.full(count, np.nan)

    def forget(self, which: Indices) -> None:
        """Begin anew for the jobs ``which`` (k,)."""
        self._peaks[which], self._length[which], self._speed[which] = np.nan, 0, np.nan

    def add(self, which: Indices, speeds: Array, peaks: Array) -> None:
        """Take in measured ``peaks`` (k, cycles) [N] of a step at ``speeds`` (k,); another speed begins anew."""
        moved = which[self._speed[which] != speeds]
        self._peaks[moved], self._length[moved] = np.nan, 0
        self._speed[which] = speeds
        latest = peaks[:, -MAX_CYCLES:]
        size = latest.shape[1]
        full = which[self._length[which] + size > MAX_CYCLES]
        over = self._length[full] + size - MAX_CYCLES
        places = np.minimum(np.arange(MAX_CYCLES) + over[:, None], MAX_CYCLES - 1)
        self._peaks[full] = np.take_along_axis(self._peaks[full], places, axis=1)
        self._length[full] -= over
        self._peaks[which[:, None], self._length[which][:, None] + np.arange(size)] = latest
        self._length[which] += size

    def irregular_probability(self, which: Indices) -> Array:
        """How likely the records of the jobs ``which`` (k,) are irregular to the sensor, (k,) from 0 to 1."""
        told = np.full(len(which), UNKNOWN)
        known = self._length[which] >= MIN_CYCLES
        if known.any():
            told[known] = self._classifier.irregular_probability(self._peaks[which[known]], self._error)
        return told
