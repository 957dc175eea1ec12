"""Kernels that turn a machine's parameters into features, row by row."""

import math

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.kernel import njit

FREE, RINGING = 3, 2
"""Modes of a beam in flight, the rocking mode first, and modes on a sensor."""

STEPS = 4
"""Newton steps to the end of a flight."""

FAINT = 6.0
"""Ringing weaker than exp(-6) of the force's change does not count in the groups that weigh its phase."""


@njit(cache=True, nogil=True)
def flight(w: float, w1: float, damping: float, force: float, gap: float) -> tuple[float, float, float]:
    """Time of flight, phase of the force at its end, and speed there, of a mode q'' + damping q' + w1^2 q = force sin.

    It starts at rest at q = gap, where the force no longer holds it there, and ends at q = -gap.
    """
    leaves = math.pi - math.asin(min(w1 * w1 * gap / force, 0.999))
    stiff, drag = w1 * w1 - w * w, damping * w
    size = force / (stiff * stiff + drag * drag)
    in_phase, behind = size * stiff, -size * drag
    half = 0.5 * damping
    turns = math.sqrt(max(w1 * w1 - half * half, 1e-9))
    sine, cosine = math.sin(leaves), math.cos(leaves)
    first = gap - (in_phase * sine + behind * cosine)
    second = (half * first - w * (in_phase * cosine - behind * sine)) / turns
    time = (12.0 * gap / (force * w)) ** (1.0 / 3.0)
    shortest, longest = 0.2 * time, 5.0 * time
    speed = 0.0
    for _ in range(STEPS):
        sine, cosine = math.sin(leaves + w * time), math.cos(leaves + w * time)
        fade, wave, other = math.exp(-half * time), math.sin(turns * time), math.cos(turns * time)
        own = fade * (first * other + second * wave)
        place = in_phase * sine + behind * cosine + own
        speed = w * (in_phase * cosine - behind * sine) - half * own + fade * turns * (second * other - first * wave)
        step = -(place + gap) / speed if speed < 0.0 else 0.5 * time
        time = min(max(time + step, shortest), longest)
    return time, leaves + w * time, abs(speed)


@njit(cache=True, nogil=True)
def swing_groups(places: Array, fixed: Array, grid: Array, modes: Array, values: Array, out: Array) -> None:
    """Groups ``out`` (GROUPS,) of one machine's field values (n_fields,)."""
    known = np.empty(6)
    for i in range(6):
        known[i] = values[places[i]] if places[i] >= 0 else fixed[i]
    if not (known[0] > 0.0 and known[1] > 0.0 and known[5] > 0.0):
        out[:] = np.nan
        return
    w, clearance, ratio, contact, amplitude = 2.0 * math.pi * known[0], known[1], known[3], known[4], known[5]
    row = np.empty(modes.shape[1])
    left, share = 0, 0.0
    if len(grid) > 1:
        place = (known[2] - grid[0]) / (grid[-1] - grid[0]) * (len(grid) - 1)
        left = max(0, min(len(grid) - 2, int(place)))
        share = place - left
        for i in range(len(row)):
            row[i] = modes[left, i] + share * (modes[left + 1, i] - modes[left, i])
    else:
        row[:] = modes[0]
    at = FREE + RINGING
    damping, tip, lever = row[at], row[at + 1], row[at + 2]
    rates = at + 3
    time, phase, speed = flight(w, row[0], damping, lever * amplitude, clearance / tip)
    speed *= tip
    lift = tip * lever * amplitude
    press = max((-lift * math.sin(phase) - row[0] * row[0] * clearance) / lift, 1e-3)
    stays = max(math.pi / w - time, 0.0)
    out[0] = phase
    out[1] = w * time
    out[2] = math.log(speed)
    out[3] = math.log(speed / (clearance * w))
    out[4] = math.log(press)
    out[5] = math.log(speed * w / (press * lift))
    out[6] = w * stays
    at = 7
    for k in range(RINGING):
        rate = row[rates + k] + ratio * row[rates + RINGING + k] + contact * row[rates + 2 * RINGING + k]
        turns, fades = row[FREE + k] * stays, rate * stays
        left_over = math.log(speed * row[FREE + k] / (w * lift)) - fades
        sine, cosine, fade, weight = math.sin(turns), math.cos(turns), math.exp(-fades), max(left_over + FAINT, 0.0)
        out[at] = fades
        out[at + 1] = left_over
        out[at + 2], out[at + 3] = sine, cosine
        out[at + 4], out[at + 5] = fade * sine, fade * cosine
        out[at + 6], out[at + 7] = weight * sine, weight * cosine
        out[at + 8] = turns
        half = math.pi * row[FREE + k] / w
        out[at + 9], out[at + 10] = math.sin(half), math.cos(half)
        at += 11
    rates += 3 * RINGING
    for k in range(FREE - 1):
        turns = row[1 + k] * time
        out[at] = (row[rates + k] + ratio * row[rates + FREE - 1 + k]) * time
        out[at + 1], out[at + 2], out[at + 3] = math.sin(turns), math.cos(turns), turns
        at += 4


@njit(cache=True, nogil=True)
def fill_features(
    logarithm: NDArray[np.bool_],
    places: NDArray[np.int64],
    hertz: float,
    grid: Array,
    frequencies: Array,
    swing_places: NDArray[np.int64],
    swing_fixed: Array,
    swing_grid: Array,
    swing_modes: Array,
    values: Array,
    out: Array,
) -> None:
    """Features ``out`` (n, n_features) of ``values`` (n, n_fields); the rest as in ``ParameterScaling``."""
    fields = len(logarithm)
    spacing = (grid[-1] - grid[0]) / max(1, len(grid) - 1)
    for row in range(len(values)):
        for i in range(fields):
            value = values[row, i]
            if logarithm[i]:
                out[row, i] = np.log(value) if value > 0.0 else np.nan
            else:
                out[row, i] = value
        if places[0] < 0:
            continue
        speed = values[row, places[0]] * hertz
        share, left = 0.0, 0
        if places[2] >= 0:
            place = (values[row, places[2]] - grid[0]) / spacing
            left = max(0, min(len(grid) - 2, int(place)))
            share = place - left
        at = fields
        for mode in range(len(frequencies)):
            natural = frequencies[mode, left]
            if places[2] >= 0:
                natural += share * (frequencies[mode, left + 1] - natural)
            turns = 2.0 * math.pi * natural / speed if speed > 0.0 else np.nan
            out[row, at] = np.log(speed / natural) if speed > 0.0 else np.nan
            out[row, at + 1], out[row, at + 2] = math.sin(turns), math.cos(turns)
            at += 3
        clearance = values[row, places[1]] if places[1] >= 0 else 1.0
        push = clearance * speed * speed
        out[row, at] = np.log(push) if push > 0.0 else np.nan
        if len(swing_modes) > 0:
            swing_groups(swing_places, swing_fixed, swing_grid, swing_modes, values[row], out[row, at + 1 :])
