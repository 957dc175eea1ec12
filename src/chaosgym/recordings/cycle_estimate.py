r"""The cycle of a series that states none: from the lines of its spectrum, or from the envelope where impacts ring.

The spectrum of a driven response has its lines at multiples of the driving frequency. A subharmonic response has lines
between them, so that an estimate says that it is one. Where impacts excite a structure, the strongest multiple is the
one next to its natural frequency. The envelope of such ringing rises at once and decays slowly, and repeats with the
impacts (Randall and Antoni 2011, https://doi.org/10.1016/j.ymssp.2010.07.017).
"""

import math
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError

FEWEST_SAMPLES = 8
"""Samples that a cycle must have."""

LONG, PER_CYCLE = 2**20, 16
"""Samples from which a spectrum is that of means, and as many of them a cycle."""

STANDS_OUT, NARROW, BESIDE = 30.0, 50.0, 128
"""Power of a line in mean powers of the spectrum, and in the median of as many places around it, from which it is one:
what a resonance makes of noise is large and not narrow. A quarter of the places are independent."""

RINGS, DEEP, STRUCK = 4, 0.1, 0.5
"""Turns of ringing between impacts at the least, the standard deviation of its envelope as a share of the mean, and the
skewness of the envelope's slopes, which is 0 of a beat."""

ONE_SIDED, SLOWER, SHARP = 0.6, 1.2, 0.3
"""Share of the cubes that lie on one side where pulses do not ring; by what factor impacts must come slower than the
spectrum's cycle; and the power of a line of the envelope as a share of that of its multiples."""

OCTAVES, FEWEST_PLACES, BURSTS = 6, 1000, 0.54
"""Octaves below half the sampling rate in which impacts are looked for, places of the spectrum that one must have, and
the standard deviation of its envelope as a share of the mean, which is 0.52 of noise."""

ALIKE, AGREE, FAINT = 0.005, 3, 0.1
"""Relative deviation of octaves that agree on the time between impacts, how many must, and the share of the variance
that the strongest line then holds at the most: a stronger one is the machine's own, and impacts may be rarer."""

ALTERNATES = 0.1
"""Correlation of ringing with that of two impacts before, and less its sign with that of one, where signs alternate."""


def estimated_cycle(value: Array, step: float) -> tuple[float, str]:
    """(cycle [s] of a series (n,), what it is estimated from: "the spectrum", or "the envelope of its ringing").

    The spectrum gives the lowest line that most of the strong lines are multiples of; the envelope counts where it
    shows impacts that come several times slower.

    Parameters
    ----------
    value : (n,)
        The signal, finite.
    step
        Between its samples [s].

    Raises
    ------
    DiagnosisError
        If neither shows a line that stands out.

    Examples
    --------
    >>> time = np.arange(8192) / 1000.0
    >>> cycle, origin = estimated_cycle(np.sin(2.0 * np.pi * 20.0 * time), 0.001)
    >>> round(cycle, 6), origin
    (0.05, 'the spectrum')
    """
    start, size = value[:LONG], min(LONG, len(value))
    power = _power(start, 4 * size)
    power[: 4 * 3] = 0.0
    carrier = 4 * size * step / max(1, int(np.argmax(power)))
    peak = int(np.argmax(np.where(_is_narrow(power), power, 0.0)))
    clear = peak > 0 and power[peak] >= STANDS_OUT * float(np.mean(power))
    cycle = _cycle_of(power, _lowest(power, peak), step) if clear else carrier
    held = float(power[max(0, peak - 8) : peak + 9].sum()) / max(float(power.sum()), 1e-300)
    impacts = _impacts(start, step, carrier, cycle, faint=held < FAINT)
    if impacts is not None:
        period, turns = impacts
        return turns * _refined(np.abs(value), step, period), "the envelope of its ringing"
    if not clear:
        raise DiagnosisError(
            "no line of the spectrum stands out, so the cycle can't be estimated; state it: --read cycle='30 Hz'"
        )
    return _refined(value, step, cycle), "the spectrum"


def _is_narrow(power: Array) -> NDArray[np.bool_]:
    """Where a spectrum stands out of what is beside it."""
    several = max(1, len(power) // BESIDE)
    blocks = np.pad(power, (0, -len(power) % several), mode="edge").reshape(several, -1)
    usual = np.median(blocks, axis=1, keepdims=True)
    return np.asarray((blocks >= NARROW * usual).ravel()[: len(power)])


def _refined(value: Array, step: float, cycle: float) -> float:
    """Cycle [s] by all of a series, of which the first samples gave it."""
    if len(value) <= LONG or cycle < FEWEST_SAMPLES * step:
        return cycle
    several = max(1, int(cycle / step / PER_CYCLE))
    return strongest_line(_averaged(value, several), several * step, cycle, 4.0 * cycle / (LONG * step))


def _lowest(power: Array, peak: int, least: float = 0.05) -> int:
    """Place of the strongest line, or of a half to a fifth of it where there is a line of this share of its power."""
    best = peak
    for divisor in (2, 3, 4, 5):
        place = round(peak / divisor)
        near = slice(max(12, place - 4), place + 5)
        if place > 16 and power[near].max() > least * power[peak]:
            best = near.start + int(np.argmax(power[near]))
    return best


def _cycle_of(power: Array, place: int, step: float) -> float:
    """Cycle [s] of a line of a spectrum that is padded fourfold."""
    if place == len(power) - 1:  # the reading alternates with every sample
        return 2.0 * step
    return 2.0 * (len(power) - 1) * step / (place + _between(power, place))


def _impacts(value: Array, step: float, carrier: float, cycle: float, *, faint: bool) -> tuple[float, int] | None:
    """(time [s] between impacts that excite ringing, impacts of a cycle: 2 where their signs alternate), or None.

    They are looked for around the strongest line, whose period is ``carrier``, then in octaves, of which three at least
    must agree: a bearing rings at all frequencies, beside ``faint`` lines. ``cycle`` is that of the lowest line.
    """
    away = value - np.median(value)
    if abs(float(np.sum(away**3))) > ONE_SIDED * float(np.sum(np.abs(away) ** 3)):
        return None  # pulses, which do not ring
    lasts, spectrum = len(value) * step, np.fft.rfft(value - np.mean(value))
    found = _ringing(spectrum, int(0.5 * lasts / carrier), int(1.5 * lasts / carrier) + 1, lasts, DEEP, STRUCK)
    if found is not None and found[0] >= max(RINGS * carrier, SLOWER * cycle):
        return found
    if not faint:
        return None
    edges = [len(spectrum) >> octave for octave in range(OCTAVES + 1)]
    octaves = [
        _ringing(spectrum, low, high, lasts, BURSTS, -np.inf)
        for high, low in pairwise(edges)
        if high - low >= FEWEST_PLACES
    ]
    told = [one for one in octaves if one is not None and one[0] >= SLOWER * cycle]
    alike = [[other for other in told if abs(other[0] / one[0] - 1.0) < ALIKE] for one in told]
    most = max(alike, key=len, default=[])
    return most[0] if len(most) >= AGREE else None


def _ringing(
    spectrum: NDArray[np.complex128], low: int, high: int, lasts: float, deep: float, struck: float
) -> tuple[float, int] | None:
    """(time [s] between impacts, impacts of a cycle) by the envelope of a band, from one place to another; or None.

    The envelope must have ``deep`` times its mean as standard deviation, and ``struck`` as skewness of its slopes.
    """
    band = spectrum[low:high]
    envelope = np.abs(np.fft.ifft(band, 4 * len(band)))
    slopes = np.diff(envelope)
    spread = float(np.std(slopes))
    if len(envelope) < 64 or spread <= 0.0 or np.std(envelope) < deep * np.mean(envelope):
        return None
    if float(np.mean((slopes - slopes.mean()) ** 3)) < struck * spread**3:
        return None
    power = _power(envelope, 4 * len(envelope))
    power[: 4 * 3] = 0.0
    peak = int(np.argmax(power))
    period = _cycle_of(power, _lowest(power, peak, SHARP), lasts / len(envelope))
    if power[peak] < STANDS_OUT * float(np.mean(power)):
        return None
    rates, weights = np.arange(low, low + len(band)) / lasts, np.abs(band) ** 2
    once, twice = (float(np.sum(weights * np.cos(2.0 * np.pi * rates * k * period)) / np.sum(weights)) for k in (1, 2))
    return period, 2 if once < -ALTERNATES and twice > ALTERNATES else 1


def strongest_line(value: Array, step: float, period: float, width: float) -> float:
    """Cycle [s] of the largest line of the spectrum, within a share of the frequency of a cycle."""
    padded = 4 * len(value)
    power = _power(value, padded)
    place = padded * step / period
    low = max(1, int((1.0 - width) * place))
    best = low + int(np.argmax(power[low : int((1.0 + width) * place) + 2]))
    return padded * step / (best + _between(power, best))


def _between(power: Array, best: int) -> float:
    """Where a line lies between its place and the next one, by a parabola through the logarithms."""
    left, middle, right = (math.log(max(float(power[best + k]), 1e-300)) for k in (-1, 0, 1))
    return 0.5 * (left - right) / (left - 2.0 * middle + right) if left - 2.0 * middle + right else 0.0


def _power(value: Array, padded: int) -> Array:
    """Power of the spectrum of a signal without its mean, under a Hann window."""
    signal = np.array(value, dtype=float)
    signal -= signal.mean()
    signal *= np.hanning(len(signal))
    power = np.abs(np.fft.rfft(signal, padded))
    power *= power
    return power


def _averaged(value: Array, several: int) -> Array:
    """Means of several samples in turn, without a short end."""
    size = len(value) // several
    size -= size % (1 << max(0, size.bit_length() - 7))  # of small factors, as transforms of others take much memory
    return np.asarray(value[: size * several].reshape(-1, several).mean(axis=1, dtype=float))


def strongest_line_nearby(value: Array, step: float, period: float) -> float | None:
    """Cycle [s] of a line of the spectrum that lies beside the stated cycle, within 5 %; None if the statement fits."""
    if len(value) > LONG:
        several = max(1, int(period / step / PER_CYCLE))
        value, step = _averaged(value, several), several * step
    padded = 4 * len(value)
    power = _power(value, padded)
    place = padded * step / period
    low, high = int(0.95 * place), int(1.05 * place) + 2
    if low < 8 or high >= len(power):
        return None
    peak = low + int(np.argmax(power[low:high]))
    stands_out = power[peak] > 1e-3 * power[4:].max() and low < peak < high - 1
    line = peak + _between(power, peak) if stands_out else place
    return padded * step / line if abs(line - place) > 1.0 else None
