r"""Orders of a signal: its amplitude at multiples of the rotational speed, whatever the speed does meanwhile.

The Fourier transform is taken over the angle instead of the time, by the samples as they are:

.. math:: X(o) = 2 \int x\, w\, e^{-2 \pi i o \theta}\, d\theta \Big/ \int w\, d\theta

with the angle :math:`\theta` in turns and a Hann window :math:`w` of twelve turns, in which halves, thirds and quarters
of an order have lines of their own. So no sample is interpolated, and an order is one line in a run-up.

References
----------
J. Blough, D. Brown, H. Vold, The time variant discrete Fourier transform as an order tracking method, SAE paper
972006 (1997).
"""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import DiagnosisError
from chaosgym.recordings.fixed_lines import FixedPower
from chaosgym.recordings.tachometer import FEWEST_TURNS, Turns

FRAME = FEWEST_TURNS
"""Turns of one spectrum; the next begins half of that later, and lines are one over it apart."""

SAMPLED = 2.56
"""Samples that a cycle of the highest order needs at the largest speed."""

OVERSAMPLED = 4
"""Samples of it that are kept of a signal that is sampled faster."""

MOST_LINES, FAINT = 8, 0.01
"""Lines that are named, and the share of the largest below which none is."""

LOUDER = 4.0
"""Power of an order in that of what lies at the frequencies that it passes: noise may grow by less with the speed."""

BY_CHANCE = 1e-3
"""Probability that a spectrum of noise alone names a line (assumed)."""


class OrderSpectra(NamedTuple):
    """Amplitudes over speed and order.

    ``times`` (frames,) [s] of the middle of each frame, its mean ``speeds`` (frames,) [turns/s], ``orders`` (k,),
    and ``amplitude`` (frames, k) in the unit of the signal.
    """

    times: Array
    speeds: Array
    orders: Array
    amplitude: Array


class OrderLine(NamedTuple):
    """One order: its largest amplitude, the speed there [turns/s], its root mean square over all frames, and all."""

    order: float
    largest: float
    speed: float
    typical: float
    amplitude: Array

    def as_dict(self) -> dict[str, Any]:
        """Plain values for JSON, with speeds in rpm."""
        return {
            "order": self.order,
            "largest_amplitude": self.largest,
            "at_rpm": 60.0 * self.speed,
            "rms_over_speed": self.typical,
        }


class AngleSignal:
    """A signal over the angle of a shaft.

    Parameters
    ----------
    value : (n,)
        The signal; what is missing is nan.
    time : (n,)
        Instants [s].
    step
        Between samples [s].
    turns
        Of the shaft.
    highest
        Order up to which spectra are taken.

    Raises
    ------
    DiagnosisError
        If the signal is sampled too slowly for the highest order at the largest speed.
    """

    def __init__(self, value: Array, time: Array, step: float, turns: Turns, highest: float) -> None:
        from scipy.signal import resample_poly

        inside = (time >= turns.instants[0]) & (time <= turns.instants[-1])
        value, time = value[inside], time[inside]
        fastest = float(turns.speed(time).max())
        if highest * fastest * SAMPLED * step > 1.0:
            reach = 1.0 / (fastest * SAMPLED * step)
            raise DiagnosisError(
                f"order {highest:g} at {60.0 * fastest:.4g} rpm needs {highest * fastest * SAMPLED:.4g} samples a "
                f"second, and there are {1.0 / step:.4g}; allowed: up to order {reach:.3g}"
            )
        known = np.isfinite(value)
        filled = np.interp(time, time[known], value[known])
        sparse = max(1, int(1.0 / (step * OVERSAMPLED * highest * fastest)))
        mean = float(filled.mean())
        self.value: Array = mean + resample_poly(filled - mean, 1, sparse) if sparse > 1 else filled
        self.time = time[::sparse]
        self.angle, self.speed = turns.angle(self.time), turns.speed(self.time)
        self.weight = self.speed * known[::sparse] * np.gradient(self.time)
        self.highest = highest
        first, last = self.angle[0], self.angle[-1]
        count = max(1, int((last - first - FRAME) / (0.5 * FRAME) + 1e-6) + 1)
        self.begins = first + 0.5 * FRAME * np.arange(count)

    def amplitude(self, orders: Array) -> Array:
        """Amplitudes (frames, k) at given orders; multiples of the first are the quickest."""
        multiples = len(orders) > 0 and np.allclose(orders, orders[0] * np.arange(1, len(orders) + 1))
        found = np.zeros((len(self.begins), len(orders)))
        for number, begin in enumerate(self.begins):
            part = slice(*np.searchsorted(self.angle, (begin, begin + FRAME)))
            angle = self.angle[part] - begin
            weight = self.weight[part] * (1.0 - np.cos(2.0 * np.pi * angle / FRAME))
            whole = float(weight.sum())
            if whole <= 0.0:
                continue
            level = float(weight @ self.value[part]) / whole
            rest = weight * (self.value[part] - level)
            if multiples:
                once = np.exp(-2j * np.pi * orders[0] * angle)
                for place in range(len(orders)):
                    rest = rest * once
                    found[number, place] = 2.0 * abs(rest.sum()) / whole
            else:
                turning = np.exp(-2j * np.pi * np.outer(orders, angle))
                found[number] = 2.0 * np.abs(turning @ rest) / whole
        return found

    def spectra(self) -> OrderSpectra:
        """Spectra of all frames, lines a twelfth of an order apart."""
        orders = np.arange(1, int(FRAME * self.highest) + 1) / FRAME
        ends = np.interp(np.add.outer((0.0, FRAME), self.begins), self.angle, self.time)
        return OrderSpectra(ends.mean(axis=0), FRAME / np.diff(ends, axis=0)[0], orders, self.amplitude(orders))

    def lines(self, spectra: OrderSpectra) -> list[OrderLine]:
        """The strongest orders above noise, the strongest first: maxima of the root mean square over all frames."""
        typical = np.sqrt(np.mean(spectra.amplitude**2, axis=0))
        padded = np.pad(typical, 2)
        around = np.max([np.roll(padded, k) for k in (-2, -1, 1, 2)], axis=0)[2:-2]
        least = np.maximum(FAINT * typical.max(), _by_chance(typical, len(self.begins)))
        # the first two lines of a Hann window are those of a drift
        places = 2 + np.flatnonzero((typical > around)[2:] & (typical > least)[2:])
        places = places[np.argsort(-typical[places], kind="stable")]
        places = np.array([place for place in places if self._is_order(spectra, int(place))][:MOST_LINES], dtype=int)
        orders = np.array([_between(spectra.orders, typical, int(place)) for place in places])
        tracks = self.amplitude(orders).T
        found = []
        for order, track in zip(orders.tolist(), tracks, strict=True):
            top = int(np.argmax(track))
            rms = float(np.sqrt(np.mean(track**2)))
            found.append(OrderLine(order, float(track[top]), float(spectra.speeds[top]), rms, track))
        return found

    @cached_property
    def fixed(self) -> FixedPower:
        """What it holds at fixed frequencies."""
        return FixedPower(self.value, self.speed, float(np.median(np.diff(self.time))))

    def _is_order(self, spectra: OrderSpectra, place: int) -> bool:
        """Whether a line of the orders is more than what lies at the frequencies that it passes."""
        lasts = FRAME / spectra.speeds
        share, frames = self.fixed.exceeded(spectra.orders[place], spectra.speeds, spectra.amplitude[:, place], lasts)
        return frames == 0 or share > max(LOUDER, _most_by_chance(len(spectra.orders), frames))


def _most_by_chance(orders: int, frames: int) -> float:
    """Mean of as many powers of noise as there are frames, over their own mean, that none of all orders exceeds."""
    from scipy.stats import gamma

    return float(gamma.isf(BY_CHANCE / orders, frames) / frames)


def _by_chance(typical: Array, frames: int) -> Array:
    """Root mean square that noise reaches by chance at each order, by the quieter lines within half an order of it.

    Powers of noise are exponential in a frame, and their means over all frames gamma distributed.
    """
    from scipy.ndimage import percentile_filter
    from scipy.stats import gamma

    quiet = percentile_filter(typical**2, 25, size=FRAME + 1, mode="mirror")
    reach = gamma.isf(BY_CHANCE / len(typical), frames) / gamma.ppf(0.25, frames)
    return np.asarray(np.sqrt(reach * quiet))


def _between(orders: Array, typical: Array, place: int) -> float:
    """Order of a maximum between the lines: a parabola through the logarithms of three."""
    if not 0 < place < len(orders) - 1 or typical[place - 1 : place + 2].min() <= 0.0:
        return float(orders[place])
    left, middle, right = np.log(typical[place - 1 : place + 2])
    shift = 0.5 * (left - right) / (left - 2.0 * middle + right)
    return float(orders[place] + shift / FRAME)


def ringing(value: Array, step: float, above: float) -> Array | None:
    """Envelope of what a signal holds above a frequency [Hz], as impacts excite it; None if sampled too slowly."""
    from scipy.fft import next_fast_len
    from scipy.signal import butter, hilbert, sosfiltfilt

    if above * 2.0 * SAMPLED * step > 1.0:
        return None
    known = np.isfinite(value)
    places = np.arange(len(value))
    filled = np.interp(places, places[known], value[known])
    high = sosfiltfilt(butter(4, above, "highpass", fs=1.0 / step, output="sos"), filled)
    envelope = np.abs(hilbert(high, next_fast_len(len(high))))[: len(high)]
    return np.where(known, envelope, np.nan)
