"""What does the agent see? The speed, the progress of the job, and what a force sensor reports of a step."""

from collections.abc import Sequence

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

Array = NDArray[np.float64]
Observation = NDArray[np.float32]

IMPACT_RANGE = 200.0
"""Impacts a cycle at which the counter saturates."""

SPEED, LAST_ACTION, REMAINING, IMPACTS, BOUNCING, FIRST_PEAK = 0, 1, 2, 6, 7, 8
"""Places in an observation of the speed, of the action behind it, of the remaining share of the job, of the impacts a
cycle, of the share spent bouncing, and of the first measured peak."""


def observation_names(cycles_per_step: int, wears: bool) -> tuple[str, ...]:
    """Name every entry of the observation; the last one is the damage if the machine wears."""
    peaks = tuple(f"peak_force_{i + 1}" for i in range(cycles_per_step))
    return (
        "speed",
        "last_action",
        "remaining_share",
        "max_peak_force",
        "mean_peak_force",
        "std_peak_force",
        "impacts_per_cycle",
        "bouncing_share",
        *peaks,
        *(("damage",) if wears else ()),
    )


def observation_space(
    lowest_speed: float, highest_speed: float, force_range: float, cycles_per_step: int, wears: bool
) -> Box:
    """Return the space of observations; forces end at ``force_range`` [N], the range of the sensor."""
    low = [lowest_speed, -1.0] + [0.0] * (6 + cycles_per_step + wears)
    high = [highest_speed, 1.0, 1.0] + [force_range] * 3 + [IMPACT_RANGE, 1.0] + [force_range] * cycles_per_step
    high += [1.0] * wears
    return Box(np.array(low, np.float32), np.array(high, np.float32))


def sensor_readings(peaks: Array, sensor_error: float, generators: Sequence[np.random.Generator]) -> Array:
    """Peak forces (k, cycles) [N] as sensors with uniform error read them, each machine's by a generator of its own."""
    share = np.empty_like(peaks)
    for row, generator in zip(share, generators, strict=True):
        generator.random(out=row)
    return np.maximum(peaks + (2.0 * sensor_error * share - sensor_error), 0.0)


def observe(
    space: Box,
    speed: Array,
    action: Array,
    remaining: Array,
    impacts: Array,
    bouncing: Array,
    peaks: Array,
    damage: Array | None = None,
) -> Observation:
    """Compose the observations of k machines, clipped to their space.

    Parameters
    ----------
    space
        From ``observation_space``.
    speed, action, remaining : (k,)
        Speed of the step, the action behind it, and the share of the job still to do.
    impacts, bouncing : (k,)
        Contacts begun in a cycle, and the share of the half cycle spent bouncing on one side.
    peaks : (k, cycles_per_step)
        Measured peak forces [N].
    damage : (k,)
        Share of its life that the worse surface has used up, on machines that wear.

    Returns
    -------
    (k, 8 + cycles_per_step), or one entry more with the damage.
    """
    cycles = peaks.shape[-1]
    mean = peaks.sum(axis=-1) / cycles
    deviation = np.sqrt(((peaks - mean[:, None]) ** 2).sum(axis=-1) / cycles)
    values = np.empty((len(peaks), len(space.low)), np.float32)
    for column, entry in enumerate((speed, action, remaining, peaks.max(axis=-1), mean, deviation, impacts, bouncing)):
        values[:, column] = entry
    values[:, FIRST_PEAK : FIRST_PEAK + cycles] = peaks
    if damage is not None:
        values[:, -1] = damage
    return np.clip(values, space.low, space.high, out=values)
