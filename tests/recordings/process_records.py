"""Records with noise in the process, not only in the sensor: what every real machine's load, supply and speed do.

A pattern of one to eight cycles, or a map that is stable or chaotic, is disturbed by one of these kinds of noise; the
truth is the nature without it. Thresholds were set on these and on ``tests.recordings.records``.
"""

import numpy as np

from tests.recordings.held_out import STATEMENTS, finished, force, process_of
from tests.recordings.records import chaotic_logistic
from tests.series.maps import GOLDEN


def recursion(rng, n, step):
    """x' = step(x, e), with normal e."""
    x = np.zeros(n + 100)
    for i in range(1, n + 100):
        x[i] = step(x[i - 1], rng.normal())
    return x[100:]


def autoregressive(rng, n, low, high):
    """AR(1) with a random correlation."""
    a = rng.uniform(low, high)
    return recursion(rng, n, lambda x, e: a * x + e)


def pink(rng, n):
    """1/f noise."""
    frequency = np.fft.rfftfreq(n)
    spectrum = rng.normal(size=len(frequency)) + 1j * rng.normal(size=len(frequency))
    spectrum[1:] /= np.sqrt(frequency[1:])
    spectrum[0] = 0.0
    return np.fft.irfft(spectrum, n)


def resonance(rng, n):
    """A damped resonance of the load, AR(2)."""
    r, w, x = rng.uniform(0.8, 0.97), rng.uniform(0.3, 2.8), np.zeros(n)
    for i in range(2, n):
        x[i] = 2.0 * r * np.cos(w) * x[i - 1] - r * r * x[i - 2] + rng.normal()
    return x


def clustered(rng, n):
    """Volatility that clusters: its logarithm is an AR(1)."""
    return np.exp(0.7 * recursion(rng, n, lambda x, e: 0.9 * x + 0.4 * e)) * rng.normal(size=n)


def threshold(rng, n):
    """A threshold autoregression with two resting points."""
    return recursion(rng, n, lambda x, e: (1.5 if x > 0.0 else -1.5) + 0.5 * x + 1.2 * e)


def telegraph(rng, n):
    """Two levels, switched at random."""
    return np.cumsum(rng.random(n) < rng.uniform(0.02, 0.3)) % 2 + 0.1 * rng.normal(size=n)


def turn(rng, n):
    """A line at any frequency: hum of the mains, or a slow modulation."""
    return np.cos(2.0 * np.pi * rng.uniform(0.001, 0.5) * np.arange(n)) + 0.3 * rng.normal(size=n)


NOISES = {
    "white": lambda rng, n: rng.normal(size=n),
    "autoregressive": lambda rng, n: autoregressive(rng, n, -0.8, 0.95),
    "pink": pink,
    "random walk": lambda rng, n: np.cumsum(rng.normal(size=n)),
    "Student": lambda rng, n: rng.standard_t(3.0, size=n),
    "lognormal": lambda rng, n: rng.lognormal(0.0, 0.7, size=n),
    "telegraph": telegraph,
    "clustered": clustered,
    "threshold": threshold,
    "envelope": lambda rng, n: np.abs(autoregressive(rng, n, 0.3, 0.95)),
    "resonance": resonance,
    "two sensors": lambda rng, n: np.where(rng.random(n) < 0.5, 1.0, -1.0) + 0.2 * rng.normal(size=n),
    "clipped": lambda rng, n: np.minimum(rng.normal(size=n), rng.uniform(0.0, 1.0)),
    "hum": turn,
    "ripple": lambda rng, n: np.tanh(autoregressive(rng, n, 0.0, 0.9)) ** 2,
}

UNSTEADY = ("random walk", "hum", "pink")
"""Noise that no record tells from a drift, a torus or a change of the machine."""


def noisy_logistic(rng, n, r, noise):
    """The logistic map with noise on x."""
    x, series = 0.4, np.empty(n)
    for i in range(n + 300):
        x = min(max(r * x * (1.0 - x) + noise * rng.normal(), 0.0), 1.0)
        if i >= 300:
            series[i - 300] = x
    return series


def strange(rng, n):
    """Grebogi, Ott, Pelikan and Yorke (1984): strange, but not chaotic."""
    x, angle, series = 0.5, rng.random(), np.empty(n)
    for i in range(n + 300):
        x = 2.0 * 1.5 * np.tanh(x) * np.cos(2.0 * np.pi * angle)
        angle = (angle + GOLDEN) % 1.0
        if i >= 300:
            series[i - 300] = x
    return series


def fading(rng, n):
    """A decay, a growth, a ringing down, a growing period two, a single event."""
    which, time = int(rng.integers(5)), np.arange(n) / n
    if which == 0:
        return 50.0 * np.exp(-rng.uniform(2.0, 5.0) * time)
    if which == 1:
        return 5.0 * np.exp(rng.uniform(2.0, 4.0) * time)
    if which == 2:
        return np.abs(50.0 * np.exp(-rng.uniform(3.0, 6.0) * time) * np.cos(rng.uniform(0.3, 2.8) * np.arange(n)))
    if which == 3:
        return 50.0 + np.exp(rng.uniform(2.0, 3.0) * time) * (-1.0) ** np.arange(n)
    place = int(rng.integers(n // 4, n // 2))
    event = np.exp(-np.maximum(np.arange(n) - place, 0) / 4.0) * (np.arange(n) >= place)
    return 20.0 + 60.0 * event


KINDS = (*NOISES, "stable map", "noisy chaos", "strange nonchaotic", "unsteady", "lost cycles")


def make(kind, seed, statement=None):
    """One record of a kind; the same seed gives the same record."""
    rng = np.random.default_rng([seed, 55, KINDS.index(kind)])
    cycles = int(rng.choice([64, 128, 256, 500, 1000, 2000]))
    statement = statement or STATEMENTS[seed % 4]
    if kind == "stable map":
        r, period = ((2.7, 1), (3.25, 2), (3.5, 4), (3.835, 3))[int(rng.integers(4))]
        noise = float(rng.choice([0.0, 0.002, 0.005])) if period > 2 else float(rng.choice([0.005, 0.02, 0.04]))
        series = noisy_logistic(rng, cycles, r, noise if period != 3 else 0.1 * noise)
        made = 30.0 * (1.0 + 0.5 * (series - series.mean()))
        return finished(kind, rng, made, "periodic", period, statement, process=float(np.std(process_of(made, period))))
    if kind == "noisy chaos":
        noise = float(rng.choice([0.0, 0.002, 0.005]))
        clean = chaotic_logistic(rng, 3.6, 4.0, cycles)
        series = noisy_logistic(rng, cycles, 3.9, noise) if noise else clean
        made = force(series, rng, rng.uniform(0.05, 0.3))
        return finished(kind, rng, made, "chaotic", None, statement, process=noise / 0.28 * np.std(made))
    if kind == "strange nonchaotic":
        return finished(kind, rng, force(strange(rng, cycles), rng, 0.2), "nonchaotic", None, statement)
    if kind == "unsteady":
        return finished(kind, rng, fading(rng, cycles), "unsteady", None, statement)
    if kind == "lost cycles":
        cycles = max(cycles, 256)
        made = np.tile(50.0 * (1.0 + 0.3 * rng.uniform(-1.0, 1.0, 3)), cycles // 3 + 1)[:cycles]
        record = finished(kind, rng, made, "periodic", 3, statement)
        places = rng.choice(cycles // 16 - 1, min(10, cycles // 32), replace=False) * 16 + 8
        return record._replace(peaks=np.delete(record.peaks, places))
    noise = NOISES[kind](rng, cycles)
    period = 1 if rng.random() < 0.5 else int(rng.integers(2, 9))
    pattern = 1.0 + (0.3 * rng.uniform(-1.0, 1.0, period) if period > 1 else np.zeros(1))
    share = float(rng.choice([0.01, 0.03, 0.06, 0.15]))
    series = 50.0 * (np.tile(pattern, cycles // period + 1)[:cycles] + share * (noise - noise.mean()) / noise.std())
    steady = kind not in UNSTEADY
    return finished(kind, rng, series, "periodic", period, statement, process=50.0 * share, stationary=steady)


def answer(record, verdict):
    """Judge an answer: "right", "wrong", "undetermined", or "within" the error where the motion hides in it.

    "right, if" and "wrong, if" are those under the condition that the scatter is random.
    """
    found = verdict.diagnosis
    condition = ", if" if found.condition else ""
    if found.nature == "undetermined":
        return "undetermined"
    if record.nature == "nonchaotic":
        return "right" if found.nature == "quasiperiodic" else "within" if record.hidden else f"wrong{condition}"
    if found.nature == record.nature and (found.period in record.periods or record.nature != "periodic"):
        return f"right{condition}"
    return "within" if record.hidden and found.nature == "periodic" else f"wrong{condition}"
