"""Two sensors on one machine or process of known nature; no threshold was set on these.

Machines have noise on their speed and are read at both surfaces of a joint. Processes are read by a second sensor that
is a copy, a curved function, a delayed mixture or another draw of what the first one reads.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from chaosgym import ImpactBeam, SliderCrank, diagnose
from chaosgym.simulation import simulate
from tests.recordings.held_out import CHAOS, PROCESS, STATEMENTS, process_of, stated
from tests.recordings.process_records import NOISES, noisy_logistic
from tests.recordings.records import resolved_periods, scatter

RANDOM = {**{f"{kind} noise": draw for kind, draw in NOISES.items()}, **PROCESS}
MACHINES = ("chaotic beam", "chaotic crank", "periodic beam", "periodic crank")
KINDS = (*MACHINES, *CHAOS, *RANDOM, "stable map")


class Pair(NamedTuple):
    """Readings (cycles, 2), what is stated of the sensors, and the truth, as in ``records.Record``."""

    peaks: np.ndarray
    stated: dict
    nature: str
    periods: tuple
    hidden: bool


def second(rng, series, draw):
    """What another sensor reads of a series without its mean, in standard deviations."""
    way = int(rng.integers(5))
    if way == 0:
        return rng.uniform(0.5, 1.5) * series
    if way == 1:
        return np.exp(0.5 * series)
    if way == 2:
        return np.abs(series - rng.uniform(-1.0, 1.0))
    if way == 3:
        return 0.6 * series + 0.4 * np.roll(series, 1) ** 2
    return draw()


def machine(kind, rng, cycles):
    """Both surfaces of a random machine whose nature is the same over 0.3 % of its speed: (peaks, period)."""
    nature, of = kind.split()
    while True:
        found = (
            ImpactBeam(excitation_frequency=rng.uniform(8.0, 32.0), clearance=rng.uniform(5e-5, 1.5e-4))
            if of == "beam"
            else SliderCrank(crank_speed=rng.uniform(120.0, 270.0), slider_clearance=rng.uniform(3e-5, 2.5e-4))
        )
        speed = getattr(found, found.speed_field)
        near = [diagnose(found.at(speed * (1.0 + shift)), budget=800) for shift in (0.0, -0.003, 0.003)]
        if {(v.nature, v.period) for v in near} == {(near[0].nature, near[0].period)} and near[0].nature == nature:
            break
    ripple = float(rng.choice([0.0, 1e-4, 1e-3]))
    speeds = speed * (1.0 + ripple * rng.normal(size=cycles + 400))
    return simulate(found, cycles + 400, operation={found.speed_field: speeds}).peak_force[400:], near[0].period


def make(kind, seed):
    """One pair of a kind; the same seed gives the same pair."""
    rng = np.random.default_rng([seed, 91, KINDS.index(kind)])
    cycles = int(rng.choice([256, 500, 1000, 2000]))
    nature, period = "periodic", 1
    if kind in MACHINES:
        peaks, period = machine(kind, rng, cycles)
        nature = kind.split()[0]
    else:
        if kind in CHAOS:
            nature, period, draw = "chaotic", None, lambda: CHAOS[kind](rng, cycles, seed, 0.0)
        elif kind == "stable map":
            r, period, noise = ((2.7, 1, 0.04), (3.25, 2, 0.02), (3.5, 4, 0.004), (3.835, 3, 3e-4))[
                int(rng.integers(4))
            ]
            draw = partial(noisy_logistic, rng, cycles, r, noise)
        else:
            draw = partial(RANDOM[kind], rng, cycles)
        first = draw()
        first = (first - first.mean()) / first.std()
        other = second(rng, first, draw) if nature == "periodic" and kind != "stable map" else first**2 - first
        share = float(rng.choice([0.03, 0.06, 0.15]))
        peaks = 50.0 * (1.0 + share * np.column_stack([first, (other - other.mean()) / other.std()]))
    share = float(rng.choice([1e-3, 3e-3, 1e-2]))
    sigma = share * float(np.mean(peaks))
    readings = peaks + sigma * rng.normal(size=peaks.shape)
    told = stated(STATEMENTS[seed % 4], sigma, False)
    if nature != "periodic":
        hidden = min(min(scatter(one), one.std()) for one in peaks.T) < 3.0 * sigma
        return Pair(readings, told, nature, (), bool(hidden))
    noise = max(float(np.std(process_of(one, period))) for one in peaks.T)
    periods = set.intersection(
        *({*resolved_periods(one - process_of(one, period), period, 3.0 * np.hypot(sigma, noise))} for one in peaks.T)
    )
    return Pair(readings, told, nature, (*periods, period), False)
