"""What does the agent see? The speed, the progress of the job, and what a force sensor reports of a step."""

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.simulation import CycleRecord

Observation = NDArray[np.float32]

IMPACT_RANGE = 200.0
"""Impacts a cycle at which the counter saturates."""


def observation_names(cycles_per_step: int) -> tuple[str, ...]:
    """Name every entry of the observation."""
    peaks = tuple(f"peak_force_{i + 1}" for i in range(cycles_per_step))
    return (
        "speed", "last_action", "remaining_share", "max_peak_force", "mean_peak_force", "std_peak_force",
        "impacts_per_cycle", "bouncing_share", *peaks,
    )  # fmt: skip


def observation_space(lowest_speed: float, highest_speed: float, force_range: float, cycles_per_step: int) -> Box:
    """Return the space of observations; forces end at ``force_range`` [N], the range of the sensor."""
    low = [lowest_speed, -1.0] + [0.0] * (6 + cycles_per_step)
    high = [highest_speed, 1.0, 1.0] + [force_range] * 3 + [IMPACT_RANGE, 1.0] + [force_range] * cycles_per_step
    return Box(np.array(low, np.float32), np.array(high, np.float32))


def measured_peaks(record: CycleRecord, sensor_error: float, generator: np.random.Generator) -> NDArray[np.float64]:
    """Peak force of each cycle [N] on the monitored surface, the first, as a sensor with uniform error reads it."""
    error = generator.uniform(-sensor_error, sensor_error, len(record))
    return np.maximum(record.peak_force[:, 0] + error, 0.0)


def observe(
    space: Box, speed: float, action: float, remaining: float, peaks: NDArray[np.float64], record: CycleRecord
) -> Observation:
    """Compose the observation of a step, clipped to its space.

    Parameters
    ----------
    space
        From ``observation_space``.
    speed, action, remaining
        Speed of the step, the action behind it, and the share of the job still to do.
    peaks : (cycles_per_step,)
        Measured peak forces [N].
    record
        The step's cycles.
    """
    mean = float(peaks.sum()) / len(peaks)
    deviation = float(np.sqrt(((peaks - mean) ** 2).sum() / len(peaks)))
    impacts = float(record.impacts.sum()) / len(peaks)
    bouncing = 2.0 * float(record.bounce_duration.mean()) / record.machine.cycle_period
    values = np.array([speed, action, remaining, peaks.max(), mean, deviation, impacts, bouncing, *peaks], np.float32)
    return np.minimum(np.maximum(values, space.low), space.high)
