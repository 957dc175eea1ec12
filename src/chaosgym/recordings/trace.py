"""What of a series is drawn: a few of its cycles, its least and largest readings over the whole, and its spectrum."""

from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.recordings.cycles import CyclePeaks, filled

CYCLES, POINTS = 6, 1500
"""Cycles that are drawn sample by sample, and points of a curve at the most."""

LINES_APART, LONGEST = 16, 2**18
"""Cycles in a segment of which a spectrum is taken, and its samples at the most."""


class Trace(NamedTuple):
    """A series as it is drawn, in a size that does not grow with it.

    Attributes
    ----------
    time, value : (n,)
        Samples [s, unit] of a few cycles amid the series.
    starts
        Instants [s] at which cycles begin there.
    course, low, high : (m,)
        Instants [s] over the whole, and the least and the largest reading near each.
    frequency, amplitude : (k,)
        Spectrum: frequencies [Hz], and the amplitude of a sinusoid that would show as much.
    """

    time: Array
    value: Array
    starts: Array
    course: Array
    low: Array
    high: Array
    frequency: Array
    amplitude: Array


def trace_of(value: Array, cut: CyclePeaks) -> Trace:
    """What is drawn of a series (n,) and its cycles.

    Examples
    --------
    >>> from chaosgym.recordings.cycles import cycle_peaks
    >>> from chaosgym.recordings.sampling import Even, Sampling
    >>> instants = Sampling(Even(0.0, 0.001, 8000), 0.001, ())
    >>> value = 3.0 * np.sin(2.0 * np.pi * 20.0 * instants.time)
    >>> trace = trace_of(value, cycle_peaks(value, instants, 0.05))
    >>> peak = int(np.argmax(trace.amplitude))
    >>> round(trace.frequency[peak].item()), round(trace.amplitude[peak].item(), 1)
    (20, 3.0)
    """
    size, instants = len(value), cut.instants
    middle = int(np.clip(instants.places(cut.starts[len(cut.starts) // 2 :][:1])[0], 0, size - 1))
    first = max(0, min(middle, size - int(CYCLES * cut.period / instants.step)))
    last = min(size, first + max(2, int(CYCLES * cut.period / instants.step)))
    begin, end = instants.at(first), instants.at(last - 1)
    edges = np.unique(np.linspace(0, size, min(size, POINTS) + 1).astype(int))[:-1]
    whole = filled(value)
    low, high = np.minimum.reduceat(whole, edges), np.maximum.reduceat(whole, edges)
    course = np.array([instants.at(int(place)) for place in edges])
    near = cut.starts[(cut.starts >= begin) & (cut.starts <= end)]
    shown = max(1, (last - first) // (4 * POINTS))
    inside = slice(first, last, shown)
    return Trace(
        np.asarray(instants.part(first, last)[::shown]),
        np.asarray(value[inside], dtype=float),
        near,
        course,
        low.astype(float),
        high.astype(float),
        *_spectrum(whole, instants.step, cut.period),
    )


def _spectrum(value: Array, step: float, cycle: float) -> tuple[Array, Array]:
    """Frequencies [Hz] and amplitudes (Welch 1967); of many lines side by side the largest.

    The flat-top window tells the amplitude of a line at any frequency to 0.1 %; others lose up to 15 % between lines.
    """
    from scipy.signal import welch

    segment = min(len(value), LONGEST, 2 ** int(np.ceil(np.log2(max(256.0, LINES_APART * cycle / step)))))
    frequency, power = welch(np.asarray(value, dtype=float), 1.0 / step, "flattop", segment, scaling="spectrum")
    edges = np.unique(np.linspace(1, len(power), min(len(power), POINTS)).astype(int))[:-1]
    places = np.array(
        [first + int(np.argmax(power[first:last])) for first, last in zip(edges, [*edges[1:], len(power)], strict=True)]
    )
    return frequency[places], np.sqrt(2.0 * power[places])
