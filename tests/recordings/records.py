"""Measured records whose nature is known: an attractor, a sensor's error, and what goes wrong in recorders.

A record is away from boundaries if its question has an answer: an irregular motion whose scatter is three times that of
the sensor; without a stated error, a sensor of 1 % or better and 256 cycles of what is irregular; a torus of 1,000
cycles. Records beyond are made as well, and must not be answered wrongly either.
"""

from typing import NamedTuple

import numpy as np

from chaosgym.diagnosis import diagnose
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.simulation import simulate
from tests.series.maps import GOLDEN, circle, henon, logistic

KINDS = (
    "periodic",
    "quasiperiodic",
    "strong chaos",
    "weak chaos",
    "intermittent",
    "spikes",
    "drift",
    "quantised",
    "missing cycles",
    "change of regime",
    "simulated beam",
    "simulated crank",
)


class Record(NamedTuple):
    """Readings, what is stated of the sensor, and the truth."""

    kind: str
    peaks: np.ndarray
    stated: dict
    nature: str
    periods: tuple
    clear: bool
    hidden: bool
    change: int | None = None
    outliers: int = 0


def scaled(series, rng, spread):
    """A force of 20 to 120 N whose standard deviation is a share ``spread`` of it."""
    level = rng.uniform(20.0, 120.0)
    return level * (1.0 + spread * (series - series.mean()) / series.std())


def periodic(rng, cycles, period=None):
    """A random pattern of 1 to 8 cycles, repeated."""
    period = period or int(rng.integers(1, 9))
    pattern = rng.uniform(20.0, 120.0) * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, period))
    return np.tile(pattern, cycles // period + 1)[:cycles], period


def chaotic_logistic(rng, low, high, cycles):
    """The logistic map at a random parameter outside its periodic windows: exponent above 0.05."""
    while True:
        r, start = rng.uniform(low, high), rng.uniform(0.2, 0.4)
        long = logistic(r, 4000, start=start)
        if np.mean(np.log(np.abs(r * (1.0 - 2.0 * long)) + 1e-300)) > 0.05:
            return logistic(r, cycles, start=start)


def strong(rng, cycles):
    """Chaos that fills its range: logistic or Henon map, 5 to 20 % of the force."""
    if rng.random() < 0.5:
        return scaled(chaotic_logistic(rng, 3.86, 4.0, cycles), rng, rng.uniform(0.05, 0.2))
    return scaled(henon(cycles, skip=500 + int(rng.integers(100)))[:, 0], rng, rng.uniform(0.05, 0.2))


def weak(rng, cycles):
    """Chaos in a narrow band, 1 to 4 % of the force, or in two bands."""
    if rng.random() < 0.5:
        return scaled(chaotic_logistic(rng, 3.86, 4.0, cycles), rng, rng.uniform(0.01, 0.04))
    return scaled(chaotic_logistic(rng, 3.595, 3.67, cycles), rng, rng.uniform(0.05, 0.2))


def torus(rng, cycles):
    """Two incommensurate frequencies: a circle map below its critical coupling, or a sum of two lines."""
    if rng.random() < 0.5:
        return scaled(circle(rng.uniform(0.1, 0.5), GOLDEN, cycles), rng, rng.uniform(0.03, 0.2))
    turns = np.arange(cycles) * (GOLDEN if rng.random() < 0.5 else np.sqrt(2.0) / 3.0)
    return scaled(np.cos(2.0 * np.pi * turns) + 0.2 * np.cos(4.0 * np.pi * turns), rng, rng.uniform(0.03, 0.2))


def intermittent(rng, cycles):
    """Long laminar stretches of period three, broken by bursts: the logistic map below its tangent bifurcation."""
    critical = 1.0 + np.sqrt(8.0)
    return scaled(
        logistic(critical - 10.0 ** rng.uniform(-4.0, -3.0), cycles, start=rng.uniform(0.2, 0.4)),
        rng,
        rng.uniform(0.05, 0.2),
    )


def scatter(series, period=24):
    """Standard deviation around the mean of bands, the smallest over 1 to 24 of them."""
    found = []
    for k in range(1, min(period, len(series) // 8) + 1):
        phase = np.arange(len(series)) % k
        means = np.bincount(phase, weights=series) / np.bincount(phase)
        found.append(np.std(series - means[phase]) * np.sqrt(len(series) / (len(series) - k)))
    return min(found)


def resolved_periods(series, period, error):
    """The period, and its divisors that repeat within the error: a coarse sensor can't tell them apart."""
    divisors = [k for k in range(1, period) if period % k == 0]
    whole = series[: len(series) // period * period]
    hidden = [k for k in divisors if np.max(np.ptp(whole.reshape(-1, k), axis=0)) <= 2.0 * error]
    return (*hidden, period)


def noisy(rng, series):
    """(readings, what is stated of the sensor, its standard deviation)."""
    mean = float(np.mean(np.abs(series)))
    share = float(rng.choice([0.0, 2e-4, 1e-3, 3e-3, 1e-2, 3e-2]))
    sigma, uniform = share * mean, rng.random() < 0.4
    error = rng.uniform(-1.0, 1.0, len(series)) * np.sqrt(3.0) if uniform else rng.normal(size=len(series))
    stated = {}
    if rng.random() < 0.6:
        stated = {"sensor_error": np.sqrt(3.0) * sigma} if uniform else {"sensor_sigma": sigma}
    return series + sigma * error, stated, sigma


def machines(kind, rng):
    """A random beam or crank, its nature and period by the diagnosis of its whole state; None if it is in doubt."""
    if kind == "simulated beam":
        machine = ImpactBeam(excitation_frequency=rng.uniform(8.0, 32.0), clearance=rng.uniform(5e-5, 1.5e-4))
    else:
        machine = SliderCrank(crank_speed=rng.uniform(120.0, 270.0), slider_clearance=rng.uniform(3e-5, 2.5e-4))
    verdict = diagnose(machine, budget=800)
    if verdict.nature not in ("periodic", "chaotic") or verdict.status not in ("certified", "agreed"):
        return None
    return machine, verdict


def make(kind, seed):
    """One record of a kind; the same seed gives the same record."""
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    cycles = int(rng.choice([64, 128, 256, 512]))
    period, change, outliers, smallest = None, None, 0, None
    nature = "chaotic"
    if kind.startswith("simulated"):
        found = None
        while found is None:
            found = machines(kind, rng)
        machine, verdict = found
        nature, period = verdict.nature, verdict.period
        series = simulate(machine, cycles, transient=400).peak_force[:, 0]
    elif kind == "quasiperiodic":
        cycles = int(rng.choice([256, 1200, 1200, 1200]))
        series, nature = torus(rng, cycles), "quasiperiodic"
    elif kind in ("strong chaos", "weak chaos", "intermittent"):
        cycles = max(cycles, 256) if kind == "intermittent" else cycles
        series = {"strong chaos": strong, "weak chaos": weak, "intermittent": intermittent}[kind](rng, cycles)
    elif kind == "change of regime":
        first, period = periodic(rng, cycles)
        second = strong(rng, cycles) if rng.random() < 0.7 else periodic(rng, cycles, period)[0]
        nature = "periodic" if len(np.unique(second)) <= 8 else "chaotic"
        period = period if nature == "periodic" else None
        smallest = scatter(second) if nature == "chaotic" else None
        change = cycles + 1
        series = np.concatenate([first, second])
    elif kind in ("spikes", "quantised") and rng.random() < 0.4:
        series = strong(rng, cycles)
    else:
        series, period = periodic(rng, cycles)
        nature = "periodic"
    if nature == "chaotic" and smallest is None:
        smallest = scatter(series)
    if nature == "quasiperiodic":
        smallest = float(np.std(series))
    mean = float(np.mean(np.abs(series)))
    readings, stated, sigma = noisy(rng, series)
    step = 0.0
    if kind == "drift":
        readings = readings + mean * rng.uniform(0.002, 0.05) * np.linspace(-0.5, 0.5, len(readings))
    if kind == "quantised":
        step = mean * float(rng.choice([1e-3, 5e-3, 2e-2]))
        readings = step * np.round(readings / step)
    if kind == "spikes":
        outliers = max(1, len(readings) // 100)
        places = 8 + 16 * rng.choice((len(readings) - 16) // 16 + 1, outliers, replace=False)
        readings[places] *= 1.0 + rng.uniform(0.5, 1.0, outliers)
    if kind == "missing cycles":
        place = int(rng.integers(20, len(readings) - 20))
        readings = np.delete(readings, slice(place, place + int(rng.integers(1, 4))))
    error = np.hypot(sigma, step / np.sqrt(12.0))
    periods = () if period is None else resolved_periods(series, period, 3.0 * error)
    hidden = smallest is not None and smallest < 3.0 * error
    clear = not hidden
    if not stated and sigma > 0.0:
        clear = clear and sigma <= 0.011 * mean and (smallest is None or len(readings) >= 256)
        clear = clear and (nature != "periodic" or sigma <= 0.0011 * mean or cycles >= 128)
    if not stated and sigma == 0.0:
        clear = clear and (smallest is None or len(readings) >= 256)
    clear = clear and (nature != "quasiperiodic" or cycles >= 1000)
    return Record(kind, readings, stated, nature, periods, bool(clear), bool(hidden), change, outliers)


def score(record, verdict):
    """Judge an answer: "right", "wrong", "undetermined", or "within" the error if the motion truly hides in it."""
    found = verdict.diagnosis
    if found.nature == "undetermined":
        return "undetermined"
    if found.nature == record.nature and (found.period in record.periods or record.nature != "periodic"):
        return "right"
    return "within" if record.hidden and found.nature == "periodic" else "wrong"


def table(seeds, kinds=KINDS, judge=None):
    """Counts by kind, clear or at a boundary, and answer; and the records that were answered wrongly."""
    from chaosgym.recordings.judge import judge_peaks

    counts, wrong = {}, []
    for kind in kinds:
        for seed in seeds:
            record = make(kind, seed)
            verdict = (judge or judge_peaks)(record.peaks, **record.stated)
            answer = score(record, verdict)
            key = (kind, record.clear, answer)
            counts[key] = counts.get(key, 0) + 1
            if answer == "wrong":
                wrong.append((seed, record, verdict))
    return counts, wrong
