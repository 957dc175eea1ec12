"""Records of the joints of a mechanism.

The resultant of the monitored joint is a tuple (upward part, size, rate of the size, along, sideways).
"""

import math

from chaosgym.core.cycle import LOWER, UPPER
from chaosgym.core.events import cubic, cubic_extremum
from chaosgym.core.kernel import leaf


@leaf
def resultant(fx, fy, fz, rx, ry, rz):
    """(Upward part, size, rate of the size, other two parts) of a force with components f and rates r."""
    size = math.sqrt(fx * fx + fy * fy + fz * fz)
    growth = (fx * rx + fy * ry + fz * rz) / size if size > 0.0 else 0.0
    return fy, size, growth, fx, fz


@leaf
def note_share(before, after, time, contact_time):
    """Add ``time`` to the side of the record (2,) towards which the resultant pointed, from ``before`` to ``after``.

    Either end may have no force: where a contact ends, what is left of it is rounding.
    """
    if before[1] + after[1] > 0.0:
        contact_time[UPPER if before[0] + after[0] > 0.0 else LOWER] += time


@leaf
def note_peak(peak, time, force):
    """Raise the peaks (2, 5) of a revolution to the resultant at ``time`` in it: size, when, and the three parts."""
    column = UPPER if force[0] > 0.0 else LOWER
    if force[1] > peak[column, 0]:
        peak[column, 0], peak[column, 1] = force[1], time
        peak[column, 2], peak[column, 3], peak[column, 4] = force[3], force[0], force[4]


@leaf
def write_peaks(peak, arrays, cycle):
    """Write the peaks (2, 5) of a revolution into its row."""
    for column in range(2):
        arrays.peak_force[cycle, column] = peak[column, 0]
        arrays.peak_instant[cycle, column] = peak[column, 1]
        for axis in range(3):
            arrays.peak_vector[cycle, column, axis] = peak[column, 2 + axis]


@leaf
def channel_crest(h, f0, r0, f1, r1):
    """(Instant, size) of the largest force of a step, by the cubic through both ends of it; -1 if it is at an end."""
    crest = cubic_extremum(f0, r0, f1, r1, h, -1.0) if r0 > 0.0 and r1 < 0.0 else -1.0
    if crest <= 0.0:
        return -1.0, max(f0, f1)
    return crest, cubic(f0, r0, f1, r1, h, crest)[0]


@leaf
def crest_instant(h, start, end):
    """(Instant, size) of the crest of the resultant in a step, by the cubic through both ends; (-1, 0) if none."""
    if start[1] == 0.0 or end[1] == 0.0 or start[2] <= 0.0 or end[2] >= 0.0:
        return -1.0, 0.0
    crest = cubic_extremum(start[1], start[2], end[1], end[2], h, -1.0)
    if crest <= 0.0:
        return -1.0, 0.0
    return crest, cubic(start[1], start[2], end[1], end[2], h, crest)[0]


@leaf
def begin_cycle(model, state, arrays, cycle):
    """Write the section of a revolution and clear its row."""
    n = model.display.shape[0]
    for i in range(2 * n):
        arrays.section[cycle, i] = state[i]
    arrays.tip[cycle, 0], arrays.tip[cycle, 1] = 0.0, 0.0
    for i in range(n):
        arrays.tip[cycle, 0] += model.display[i] * state[i]
        arrays.tip[cycle, 1] += model.display[i] * state[n + i]
    for column in range(2):
        arrays.impacts[cycle, column] = 0
        arrays.contact_time[cycle, column] = 0.0
        arrays.bounce_time[cycle, column] = 0.0
        for j in range(arrays.channel_peak.shape[1]):
            arrays.channel_peak[cycle, j, column] = 0.0


@leaf
def write_sample(display, z, force, sample):
    """Write displacement, velocity and signed resultant (positive where it points up) of the monitored joint."""
    n = display.shape[0]
    sample[0], sample[1] = 0.0, 0.0
    for i in range(n):
        sample[0] += display[i] * z[i]
        sample[1] += display[i] * z[n + i]
    sample[2] = math.copysign(force[1], force[0])
