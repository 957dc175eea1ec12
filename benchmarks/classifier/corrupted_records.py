"""What does a record look like that is none? Faults of measurement that a classifier should refuse."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Fault = Callable[[Array, np.random.Generator], Array]


def _white_noise(peaks: Array, generator: np.random.Generator) -> Array:
    return np.asarray(np.abs(peaks.mean(axis=1, keepdims=True) * generator.standard_normal(peaks.shape)))


def _spikes(peaks: Array, generator: np.random.Generator) -> Array:
    return np.where(generator.random(peaks.shape) < 0.1, 20.0 * peaks, peaks)


def _dropouts(peaks: Array, generator: np.random.Generator) -> Array:
    return np.where(generator.random(peaks.shape) < 0.4, 0.0, peaks)


def _ramp(peaks: Array, generator: np.random.Generator) -> Array:
    growth = generator.uniform(5.0, 20.0, (len(peaks), 1))
    return np.asarray(peaks * (1.0 + growth * np.linspace(0.0, 1.0, peaks.shape[1])))


def _raw_signal(peaks: Array, generator: np.random.Generator) -> Array:
    """The modulus of a sine sampled many times a cycle in place of one peak a cycle."""
    phase = generator.uniform(0.0, 2.0 * np.pi, (len(peaks), 1)) + 0.37 * np.arange(peaks.shape[1])
    return np.asarray(peaks.mean(axis=1, keepdims=True) * np.abs(np.sin(phase)))


def _millinewton(peaks: Array, generator: np.random.Generator) -> Array:
    return 1e3 * peaks


def _kilonewton(peaks: Array, generator: np.random.Generator) -> Array:
    return 1e-3 * peaks


def _heavy_tails(peaks: Array, generator: np.random.Generator) -> Array:
    return np.asarray(peaks.mean(axis=1, keepdims=True) * generator.lognormal(0.0, 1.5, peaks.shape))


FAULTS: Mapping[str, Fault] = {
    "millinewton": _millinewton,
    "kilonewton": _kilonewton,
    "white noise": _white_noise,
    "heavy-tailed noise": _heavy_tails,
    "spikes": _spikes,
    "drop-outs": _dropouts,
    "growing": _ramp,
    "raw signal": _raw_signal,
}
"""By name: what turns peaks (n, cycles) into records that are no peaks of such a machine."""
