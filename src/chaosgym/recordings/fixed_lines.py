r"""What a signal of changing speed holds at fixed frequencies: hum, and resonances that noise excites.

An order passes a frequency in a few frames of a run-up; a hum or a resonance is there in all of them. So the power that
three frames in four exceed at a frequency is not an order's. What orders exceed it by tells whether they are some.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array

TURNS = 12
"""Turns at the mean speed that a frame lasts."""

QUARTILE = 0.25
"""Share of the frames whose power is smaller."""

OF_NOISE = -float(np.log(1.0 - QUARTILE))
"""That power of noise as a share of its mean: powers of noise are exponential."""

STANDS_OUT, LESS_SURE = 1.0, 6.0
"""Decades of power by which a fixed line exceeds what lies beside it, and those over the root of the frames where few
frames leave it less sure."""

PASSES, CLEAR = 3.0, 8.0
"""Lines of the spectrum within which an order is at a frequency, and those that it must move to be told from one."""

LONGER, FEWEST = 4.0, 8
"""By how much longer frames are that tell widths, and fewest frames that tell anything."""

OF_NOISE_MEDIAN, HANN_POWER = float(np.log(2.0)), 1.5
"""Median power of noise as a share of its mean, and the sum of a sinusoid's powers under the window over its own."""

SMOOTHED = (0.25, 0.5, 0.25)
"""Weights of three lines side by side, whose mean noise moves less."""

HANN, LORENTZ, BROAD = 2.4, 2.498, 1.5
"""Area above a tenth of the peak over the peak: of a sinusoid under the window in lines, and of a resonance in half its
half-power width; and by what factor a resonance must be broader than a sinusoid."""


class FixedLine(NamedTuple):
    """A fixed frequency [Hz], the amplitude of a sinusoid of as much power, and its damping; None of a sinusoid.

    Damping is a share of critical damping.
    """

    frequency: float
    amplitude: float
    damping: float | None

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON."""
        return {"frequency_hz": self.frequency, "amplitude": self.amplitude, "damping": self.damping}


class FixedPower:
    """Power at fixed frequencies.

    Parameters
    ----------
    value, speed : (n,)
        Samples of the signal, and the speed at each [turns/s].
    step
        Between samples [s].
    """

    def __init__(self, value: Array, speed: Array, step: float) -> None:
        self.lasts = TURNS / float(speed.mean())
        self.speeds = speed
        self._value, self._step = value, step
        self.frequency, powers, self._places = self._powers(self.lasts)
        self.frames = len(powers)
        self.power: Array = np.quantile(powers, QUARTILE, axis=0) / OF_NOISE

    def _powers(self, lasts: float) -> tuple[Array, Array, NDArray[np.intp]]:
        """Frequencies, squared amplitudes (frames, k), and the sample amid each frame."""
        size = min(len(self._value), max(16, int(lasts / self._step)))
        window = np.hanning(size + 1)[:-1]
        begins = np.arange(0, len(self._value) - size + 1, max(1, size // 2))
        powers = []
        for begin in begins:
            part = self._value[begin : begin + size]
            powers.append((2.0 * np.abs(np.fft.rfft((part - part.mean()) * window)) / window.sum()) ** 2)
        middles = np.asarray(begins + size // 2, dtype=np.intp)
        return np.asarray(np.fft.rfftfreq(size, self._step)), np.array(powers), middles

    def exceeded(self, order: float, speeds: Array, amplitude: Array, lasts: Array) -> tuple[float, int]:
        """(mean power of an order in that at fixed frequencies, frames in which these can be told apart).

        Parameters
        ----------
        order
            Its number.
        speeds, amplitude, lasts : (frames,)
            Speeds [turns/s], amplitudes and durations [s] of the frames of its spectrum.
        """
        at, own = order * speeds, order * self.speeds[self._places]
        passed = np.abs(own[:, None] - at[None, :]) < PASSES / self.lasts
        apart = passed.mean(axis=0) < 0.5
        if np.count_nonzero(apart) < FEWEST:
            return np.inf, 0
        shares = []
        for place in np.flatnonzero(apart):
            near = np.abs(self.frequency - at[place]) <= 2.0 / min(lasts[place], self.lasts)
            fixed = float(self.power[near].max(initial=0.0)) * max(1.0, self.lasts / lasts[place])
            shares.append(amplitude[place] ** 2 / max(fixed, 1e-300))
        return float(np.mean(shares)), len(shares)

    def lines(self) -> list[FixedLine]:
        """Fixed frequencies that stand out, upwards."""
        from scipy.signal import find_peaks

        if self.frames < FEWEST or not self.power.max() > 0.0:
            return []
        decades = np.log10(np.maximum(self.power, 1e-12 * self.power.max()))
        least = max(STANDS_OUT, LESS_SURE / np.sqrt(0.5 * self.frames))
        moves = float(np.ptp(self.speeds)) / float(self.speeds.mean())
        found = []
        for place in find_peaks(decades, prominence=least)[0]:
            if place >= 3 and self.frequency[place] * moves > CLEAR / self.lasts:
                found.append(self._line(float(self.frequency[place])))
        return found

    def _line(self, frequency: float) -> FixedLine:
        """The line near a frequency by longer frames."""
        lasts = min(LONGER * self.lasts, len(self._value) * self._step / FEWEST)
        frequencies, powers, _ = self._powers(lasts)
        power = np.convolve(np.median(powers, axis=0), SMOOTHED, "same")
        near = np.flatnonzero(np.abs(frequencies - frequency) <= 1.5 / self.lasts)
        peak = int(near[np.argmax(power[near])])
        first = last = peak
        while first > 0 and power[first - 1] > 0.1 * power[peak]:
            first -= 1
        while last < len(power) - 1 and power[last + 1] > 0.1 * power[peak]:
            last += 1
        inside = slice(first, last + 1)
        middle = float(np.sum(frequencies[inside] * power[inside]) / np.sum(power[inside]))
        width = float(np.sum(power[inside]) / power[peak])
        broad = width > BROAD * HANN
        amplitude = float(np.sqrt(np.sum(power[inside]) / HANN_POWER / (OF_NOISE_MEDIAN if broad else 1.0)))
        damping = _without_window(width) * float(frequencies[1]) / LORENTZ / middle
        return FixedLine(middle, amplitude, damping if broad else None)


def _without_window(width: float) -> float:
    """Width of a resonance of which the window made ``width``: by Olivero and Longbothum (1977)."""
    linear, square = 0.5346, 0.2166
    a, b, c = linear**2 - square, -2.0 * linear * width, width**2 - HANN**2
    return float((-b - np.sqrt(max(0.0, b**2 - 4.0 * a * c))) / (2.0 * a))
