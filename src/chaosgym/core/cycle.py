"""Arrays of one operating cycle: what every kernel writes, and the bouncing that goes on from cycle to cycle."""

from typing import NamedTuple

import numpy as np

UPPER, LOWER = 0, 1


class CycleArrays(NamedTuple):
    """What the kernels write, one row a cycle; two columns are UPPER and LOWER, of each joint where there are several.

    ``section`` (cycles, 2n) state at the start of each cycle; ``tip`` (cycles, 2m) its tip displacement [m] and
    velocity [m/s]; ``peak_force`` [N], ``impacts``, ``contact_time`` [s], ``bounce_time`` [s] (cycles, 2m); ``events``
    (cycles,); ``history`` (cycles, samples, 3m) tip displacement, velocity and contact force at equal intervals.

    Of machines whose contact travels: ``peak_instant`` (cycles, 2) [s] and ``peak_vector`` (cycles, 2, 3) [N] of each
    peak force; of machines with sensors: ``channel_peak`` (cycles, channels, 2) [N], largest force of either side of
    each contact channel. Without rows or channels these are not written.
    """

    section: np.ndarray
    tip: np.ndarray
    peak_force: np.ndarray
    impacts: np.ndarray
    contact_time: np.ndarray
    bounce_time: np.ndarray
    events: np.ndarray
    history: np.ndarray
    peak_instant: np.ndarray
    peak_vector: np.ndarray
    channel_peak: np.ndarray


def cycle_arrays(
    cycles: int, states: int, samples: int = 0, *, travels: bool = False, channels: int = 0, joints: int = 1
) -> CycleArrays:
    """Make ``CycleArrays`` for a number of cycles, states, samples a cycle and joints."""
    rows = cycles if travels else 0
    return CycleArrays(
        section=np.empty((cycles, states)),
        tip=np.empty((cycles, 2 * joints)),
        peak_force=np.empty((cycles, 2 * joints)),
        impacts=np.empty((cycles, 2 * joints), dtype=np.int64),
        contact_time=np.empty((cycles, 2 * joints)),
        bounce_time=np.empty((cycles, 2 * joints)),
        events=np.empty(cycles, dtype=np.int64),
        history=np.empty((cycles, samples, 3 * joints)),
        peak_instant=np.empty((rows, 2)),
        peak_vector=np.empty((rows, 2, 3)),
        channel_peak=np.empty((cycles, channels, 2)),
    )
