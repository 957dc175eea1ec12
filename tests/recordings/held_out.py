"""Records of systems that no threshold was set on: published maps and flows, random processes, beams with noisy speed.

Truth is the nature of the system without noise, at parameters away from bifurcations. A record is in reach if a person
with the whole truth of the noise would expect an answer: a pattern three times as large as all scatter and seen sixteen
times; scatter of at most 1.5 % around one level over 128 cycles, if it is random; chaos over 256 cycles and five times
the error.
"""

import numpy as np
from numba import njit

from tests.recordings.records import Record, resolved_periods, scatter

STATEMENTS = ("rightly", "not", "half", "double")
"""What is said of the sensor's error."""

FACTORS = {"rightly": 1.0, "half": 0.5, "double": 2.0}


def stated(statement, sigma, uniform):
    """Options of ``judge_peaks`` for a sensor's error, told rightly, not at all, or wrongly by a factor of two."""
    if statement == "not":
        return {}
    told = FACTORS[statement] * sigma
    return {"sensor_error": np.sqrt(3.0) * told} if uniform else {"sensor_sigma": told}


def finished(kind, rng, series, nature, period, statement, *, process=0.0, stationary=True):
    """The record that a sensor makes of a series whose process noise has the standard deviation ``process``."""
    mean = float(np.mean(np.abs(series)))
    sigma, uniform = float(rng.choice([1e-3, 3e-3, 1e-2])) * mean, rng.random() < 0.5
    error = rng.uniform(-1.0, 1.0, len(series)) * np.sqrt(3.0) if uniform else rng.normal(size=len(series))
    total = float(np.hypot(sigma, process))
    size, periods = len(series), ()
    if nature == "periodic":
        clean = series - process_of(series, period)
        periods = resolved_periods(clean, period, 3.0 * total)
        apart = np.std(clean[:period]) >= 3.0 * total and size >= 16 * period
        in_reach = stationary and (apart if period > 1 else total <= 0.015 * mean and size >= 128)
    elif nature == "chaotic":
        in_reach = size >= 256 and scatter(series) >= 5.0 * sigma and process <= 0.05 * np.std(series)
    else:
        in_reach = False
    hidden = nature != "periodic" and min(scatter(series), np.std(series)) < 3.0 * sigma
    return Record(
        kind, series + sigma * error, stated(statement, sigma, uniform), nature, periods, bool(in_reach), bool(hidden)
    )


def process_of(series, period):
    """What is left of a series by its own pattern."""
    phase = np.arange(len(series)) % period
    return series - (np.bincount(phase, weights=series) / np.bincount(phase))[phase]


@njit(cache=True)
def _flow(which, p, q, steps, cycles, noise, seed):
    """Duffing (0): x once a drive; van der Pol (1) and Rossler (2): largest x of each turn. RK4, kicks each step."""
    np.random.seed(seed)  # noqa: NPY002 (the generator of compiled code)
    s = np.array([0.5, 0.1, 0.0]) if which < 2 else np.array([1.0, 1.0, 0.0])
    h = 2.0 * np.pi / steps if which == 0 else 6.0 / steps
    found, t, n, skip, k = np.empty(cycles), 0.0, 0, 100, 0
    best, armed = -1e9, False

    def slope(s, t):
        x, y, z = s[0], s[1], s[2]
        if which == 0:
            return np.array([y, -p * y + x - x * x * x + q * np.cos(t), 0.0])
        if which == 1:
            return np.array([y, p * (1.0 - x * x) * y - x, 0.0])
        return np.array([-y - z, x + 0.2 * y, 0.2 + z * (x - p)])

    while n < cycles + skip:
        a = slope(s, t)
        b = slope(s + 0.5 * h * a, t + 0.5 * h)
        c = slope(s + 0.5 * h * b, t + 0.5 * h)
        d = slope(s + h * c, t + h)
        s = s + h / 6.0 * (a + 2.0 * b + 2.0 * c + d)
        s[1] += noise * np.sqrt(h) * np.random.randn()  # noqa: NPY002
        t += h
        k += 1
        value, ready = s[0], False
        if which == 0:
            ready = k % steps == 0
        else:
            best = max(best, value)
            if value < 0.0:
                ready, armed = armed, False
                if ready:
                    value, best = best, -1e9
            elif value > 0.3:
                armed = True
        if ready:
            if n >= skip:
                found[n - skip] = value
            n += 1
    return found


@njit(cache=True)
def _map(which, p, q, cycles, noise, seed):
    """Henon (0), Ikeda (1), Gauss (2), bouncing ball (3), skew tent (4), quasiperiodically forced logistic (5)."""
    np.random.seed(seed)  # noqa: NPY002 (the generator of compiled code)
    x, y, u = 0.1 + 0.01 * np.random.rand(), 0.1, 0.0  # noqa: NPY002
    found = np.empty(cycles)
    for i in range(cycles + 500):
        if which == 0:
            x, y = 1.0 - p * x * x + y, 0.3 * x
        elif which == 1:
            turn = 0.4 - 6.0 / (1.0 + x * x + y * y)
            x, y = 1.0 + p * (x * np.cos(turn) - y * np.sin(turn)), p * (x * np.sin(turn) + y * np.cos(turn))
        elif which == 2:
            x = np.exp(-p * x * x) + q
        elif which == 3:
            y = q * y + p * (1.0 + np.cos(x))
            x = (x + y) % (2.0 * np.pi)
        elif which == 4:
            x = x / p if x < p else (1.0 - x) / (1.0 - p)
        else:
            u = (u + 0.6180339887498949) % 1.0
            x = p * (1.0 + q * np.cos(2.0 * np.pi * u)) * x * (1.0 - x)
        x += noise * np.random.randn()  # noqa: NPY002
        if which == 4:
            x = min(max(x, 1e-9), 1.0 - 1e-9)
        if i >= 500:
            found[i - 500] = y if which == 3 else x
    return found


def force(series, rng, spread):
    """A force of 20 to 120 N with this spread."""
    return rng.uniform(20.0, 120.0) * (1.0 + spread * (series - np.mean(series)) / np.std(series))


CHAOS = {
    "Henon chaos": lambda rng, n, s, e: _map(0, rng.uniform(1.37, 1.4), 0.0, n, 0.003 * e, s),
    "Ikeda chaos": lambda rng, n, s, e: _map(1, rng.uniform(0.87, 0.91), 0.0, n, 0.003 * e, s),
    "Gauss chaos": lambda rng, n, s, e: _map(2, 6.2, rng.uniform(-0.58, -0.54), n, 0.002 * e, s),
    "tent chaos": lambda rng, n, s, e: _map(4, rng.uniform(0.3, 0.45), 0.0, n, 0.002 * e, s),
    "Duffing chaos": lambda rng, n, s, e: _flow(0, 0.15, rng.uniform(0.295, 0.305), 120, n, 0.002 * e, s),
    "Rossler chaos": lambda rng, n, s, e: _flow(2, rng.uniform(5.6, 5.75), 0.0, 150, n, 0.01 * e, s),
    "ball chaos": lambda rng, n, s, e: _map(3, rng.uniform(6.0, 7.0), 0.5, n, 0.003 * e, s),
}

DYNAMIC = {
    "Henon periodic": (lambda rng, n, s, e: _map(0, rng.choice([0.25, 0.6, 0.97]), 0.0, n, 0.01 * e, s), None),
    "Duffing periodic": (lambda rng, n, s, e: _flow(0, 0.3, rng.choice([0.05, 0.1, 0.15]), 120, n, 0.02 * e, s), None),
    "Rossler periodic": (lambda rng, n, s, e: _flow(2, rng.choice([2.3, 3.3]), 0.0, 150, n, 0.03 * e, s), None),
    "van der Pol": (lambda rng, n, s, e: _flow(1, rng.uniform(0.5, 3.0), 0.0, 150, n, 0.1 * e, s), None),
    "Gauss periodic": (lambda rng, n, s, e: _map(2, 6.2, rng.choice([-0.9, 0.1, 0.4]), n, 0.01 * e, s), None),
}


def garch(rng, n):
    """GARCH(1, 1), Bollerslev (1986)."""
    x, v = np.empty(n), 1.0
    for i in range(n):
        x[i] = np.sqrt(v) * rng.normal()
        v = 0.05 + 0.2 * x[i] ** 2 + 0.75 * v
    return x


def setar(rng, n):
    """A threshold autoregression whose skeleton comes to rest, Tong (1983)."""
    x = np.zeros(n)
    for i in range(1, n):
        x[i] = (0.6 * x[i - 1] if x[i - 1] > 0.0 else -0.4 * x[i - 1]) + rng.normal()
    return x


def ornstein(rng, n):
    """Ornstein-Uhlenbeck with a correlation of 1 to 30 cycles."""
    a, x = np.exp(-1.0 / rng.uniform(1.0, 30.0)), np.zeros(n)
    for i in range(1, n):
        x[i] = a * x[i - 1] + rng.normal()
    return x


def arma(rng, n):
    """A resonance of the load: ARMA(2, 1)."""
    r, w, x, e = rng.uniform(0.7, 0.95), rng.uniform(0.3, 2.8), np.zeros(n), rng.normal(size=n)
    for i in range(2, n):
        x[i] = 2.0 * r * np.cos(w) * x[i - 1] - r * r * x[i - 2] + e[i] + 0.4 * e[i - 1]
    return x


def two_volatilities(rng, n):
    """Normal noise whose size is switched at random."""
    state = np.cumsum(rng.random(n) < 0.03) % 2
    return rng.normal(size=n) * np.where(state, 3.0, 1.0)


def bilinear(rng, n):
    """A bilinear process, Granger and Andersen (1978)."""
    x, e = np.zeros(n), rng.normal(size=n)
    for i in range(1, n):
        x[i] = 0.4 * x[i - 1] + 0.3 * x[i - 1] * e[i - 1] + e[i]
    return x


PROCESS = {
    "GARCH": garch,
    "SETAR": setar,
    "Ornstein-Uhlenbeck": ornstein,
    "ARMA": arma,
    "two volatilities": two_volatilities,
    "bilinear": bilinear,
    "gamma": lambda rng, n: rng.gamma(2.0, size=n),
    "Laplace": lambda rng, n: rng.laplace(size=n),
    "bursts": lambda rng, n: rng.normal(size=n) + 4.0 * (np.convolve(rng.random(n) < 0.02, np.ones(4), "same") > 0),
}


def beam(rng, cycles, seed):
    """A random beam whose speed scatters by 0 to 0.1 % from cycle to cycle; nature by diagnosis, firm over 0.3 %."""
    from chaosgym import ImpactBeam, diagnose

    while True:
        machine = ImpactBeam(excitation_frequency=rng.uniform(8.0, 32.0), clearance=rng.uniform(5e-5, 1.5e-4))
        near = [
            diagnose(machine.at(machine.excitation_frequency * (1.0 + shift)), budget=800)
            for shift in (-0.003, 0.0, 0.003)
        ]
        told = {(v.nature, v.period) for v in near}
        if len(told) == 1 and near[0].nature in ("periodic", "chaotic"):
            break
    ripple = rng.choice([0.0, 1e-4, 1e-3])
    speeds = machine.excitation_frequency * (1.0 + ripple * rng.normal(size=(1, cycles + 400)))
    batch = machine.batch(1)
    batch.start(0, machine)
    ran, _ = batch.run_varied(np.zeros(1, np.int64), speeds)
    return ran.peak_force[0, 400:, 0], near[1].nature, near[1].period, ripple


KINDS = (*CHAOS, *DYNAMIC, *PROCESS, "forced logistic", "beam")


def make(kind, seed, statement=None):
    """One record of a kind; the same seed gives the same record."""
    rng = np.random.default_rng([seed, 77, KINDS.index(kind)])
    cycles = int(rng.choice([64, 128, 256, 500, 1000, 2000]))
    statement = statement or STATEMENTS[seed % 4]
    if kind in CHAOS:
        process = float(rng.choice([0.0, 1.0, 5.0]))
        series = CHAOS[kind](rng, cycles, seed, process)
        while not np.isfinite(series).all():  # noise can throw the Henon map out of its basin
            seed += 100000
            series = CHAOS[kind](rng, cycles, seed, process)
        share = {0.0: 0.0, 1.0: 0.01, 5.0: 0.05}[process]
        made = force(series, rng, rng.uniform(0.08, 0.3))
        return finished(kind, rng, made, "chaotic", None, statement, process=share * np.std(made))
    if kind in DYNAMIC:
        noise, state = float(rng.choice([0.0, 0.3, 1.0])), rng.bit_generator.state
        clean = DYNAMIC[kind][0](rng, 400, seed, 0.0)[-128:]
        period = next(k for k in range(1, 65) if np.max(np.abs(clean[k:] - clean[:-k])) < 1e-3 * np.max(np.abs(clean)))
        rng.bit_generator.state = state
        series = DYNAMIC[kind][0](rng, cycles, seed, noise)
        left = float(np.std(process_of(series, period)))
        level = 3.0 * max(float(np.std(series)), 0.3)
        made = 30.0 * (1.0 + (series - np.mean(series)) / level)
        return finished(kind, rng, made, "periodic", period, statement, process=30.0 * left / level)
    if kind == "forced logistic":
        # Prasad, Negi and Ramaswamy (2001): strange, with a negative exponent of x
        series = _map(5, 3.0, rng.uniform(0.05, 0.15), cycles, 0.0, seed)
        return finished(kind, rng, force(series, rng, 0.2), "nonchaotic", None, statement)
    if kind == "beam":
        series, nature, period, ripple = beam(rng, cycles, seed)
        process = float(np.std(process_of(series, period))) if nature == "periodic" else 0.5 * ripple * np.std(series)
        return finished(kind, rng, series, nature, period, statement, process=process)
    noise = PROCESS[kind](rng, cycles)
    period = 1 if rng.random() < 0.5 else int(rng.integers(2, 9))
    pattern = 1.0 + (0.3 * rng.uniform(-1.0, 1.0, period) if period > 1 else np.zeros(1))
    share = float(rng.choice([0.01, 0.03, 0.06, 0.15]))
    series = 50.0 * (np.tile(pattern, cycles // period + 1)[:cycles] + share * (noise - noise.mean()) / noise.std())
    return finished(kind, rng, series, "periodic", period, statement, process=50.0 * share)


def found_chaos(kind, cycles, noise, records=24, seed=777):
    """(how many of so many records of a chaotic system, with this noise as a share of the mean, are told chaotic)."""
    from chaosgym.recordings.judge import judge_peaks

    rng, told = np.random.default_rng(seed), []
    for k in range(records):
        series = force(CHAOS[kind](rng, cycles, 1000 * seed + k, 0.0), rng, rng.uniform(0.1, 0.3))
        sigma = noise * series.mean()
        peaks = series + sigma * rng.normal(size=cycles)
        if scatter(series[cycles // 2 :]) >= 3.0 * sigma:
            told.append(judge_peaks(peaks).diagnosis.nature == "chaotic")
    return sum(told), len(told)


if __name__ == "__main__":
    for cycles, noise in ((500, 0.01), (1000, 0.01), (500, 0.003), (500, 0.001)):
        found, of = found_chaos("Ikeda chaos", cycles, noise)
        print(f"Ikeda, {cycles} cycles, noise {100.0 * noise:g} %: {found} of {of} chaotic", flush=True)
