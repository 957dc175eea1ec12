"""Records as recorders, sensors and machines make them: long patterns, wear, hum, beats, impacts, lost cycles, hopping.

Every other kind is in ``FROZEN``: no threshold was set on these. A record has 150, 400 or 1,200 cycles around 100 N,
read with an error of 0.4 N at most. The nature is "periodic", "quasiperiodic" or "chaotic" by construction; "line" is
one line from outside (hum, modulation, sampling) on a pattern, right as quasiperiodic or as that pattern under a
condition that names the line; "random" has no nature but "periodic, if its scatter is random".

``python -m tests.recordings.recorder_records 3`` prints the table of the first three seeds.
"""

import sys
from typing import NamedTuple

import numpy as np

from tests.recordings.held_out import FACTORS, STATEMENTS, garch
from tests.recordings.process_records import pink, recursion
from tests.series.maps import GOLDEN, circle, henon

ERROR = 0.4
"""Largest error of a reading [N]."""


class Made(NamedTuple):
    """A series without the sensor's error, and the truth."""

    series: np.ndarray
    nature: str
    periods: tuple = ()


def iterate(step, start, cycles, skip=500):
    """Readings of a map after a transient."""
    state, found = start, np.empty(cycles)
    for cycle in range(cycles + skip):
        state = step(state)
        if cycle >= skip:
            found[cycle - skip] = state
    return found


def on_level(series, swing):
    """100 N with a standard deviation of ``swing``."""
    return 100.0 + swing * (series - np.mean(series)) / np.std(series)


def repeated(pattern, cycles):
    """A pattern at a random place of it, once a cycle."""
    return np.resize(pattern, cycles)


def pattern_of(rng, period, swing):
    """A random pattern in which neighbours differ by much."""
    return on_level(rng.permutation(np.linspace(-1.0, 1.0, period)) if period > 1 else np.zeros(1), swing)


def index_table(rng, n):
    """A table with 20 to 60 places, seen 3 to 12 times."""
    period = int(rng.integers(20, 61))
    drawn = rng.normal(size=period)
    return Made(repeated(on_level(drawn, 4.0), period * int(rng.integers(3, 13))), "periodic", (period,))


def drum(rng, n):
    """A cam drum: a few harmonics over 24 to 80 cycles, seen 3 to 10 times."""
    period, turns = int(rng.integers(24, 81)), np.arange(1, 6)
    angle = 2.0 * np.pi * np.outer(np.arange(period), turns) / period + rng.uniform(0.0, 6.0, 5)
    return Made(
        repeated(on_level(np.cos(angle).sum(axis=1), 6.0), period * int(rng.integers(3, 11))), "periodic", (period,)
    )


def wear(rng, n):
    """A pattern of 2 to 4 cycles that grows by 5 to 30 %."""
    period = int(rng.integers(2, 5))
    pattern = repeated(pattern_of(rng, period, 10.0), n) - 100.0
    return Made(100.0 + pattern * (1.0 + rng.uniform(0.05, 0.3) * np.arange(n) / n), "periodic", (period,))


def warming(rng, n):
    """A pattern of 2 to 6 cycles that sinks by a fifth towards its end value while the level rises by 3 %."""
    period, late = int(rng.integers(2, 7)), 1.0 - np.exp(-3.0 * np.arange(n) / n)
    pattern = repeated(pattern_of(rng, period, 8.0), n) - 100.0
    return Made(100.0 + 3.0 * late + pattern * (1.0 - 0.2 * late), "periodic", (period,))


def line(rng, n, low=0.01):
    """A line at any frequency below half a cycle, standard deviation 1."""
    return np.sqrt(2.0) * np.cos(2.0 * np.pi * (rng.uniform(low, 0.49) * np.arange(n) + rng.random()))


def modulation(rng, n):
    """A slow modulation of one level: 6 to 20 turns in the record."""
    turns = rng.uniform(6.0, 20.0) * np.arange(n) / n
    return Made(100.0 + rng.uniform(1.0, 6.0) * np.sin(2.0 * np.pi * turns), "line", (1,))


def modulated_pattern(rng, n):
    """A pattern of 2 to 4 cycles and a slow line."""
    period = int(rng.integers(2, 5))
    slow = np.sin(2.0 * np.pi * rng.uniform(6.0, 20.0) * np.arange(n) / n)
    return Made(repeated(pattern_of(rng, period, 10.0), n) + rng.uniform(1.0, 4.0) * slow, "line", (period,))


def hum_on_three(rng, n):
    """Period three and a hum of 1 to 4 %."""
    return Made(repeated(pattern_of(rng, 3, 12.0), n) + rng.uniform(1.0, 4.0) * line(rng, n), "line", (3,))


def hum_on_level(rng, n):
    """One level and the alias of 50 Hz at a speed of 3 to 40 Hz."""
    turns = 50.0 / rng.uniform(3.0, 40.0)
    return Made(100.0 + rng.uniform(1.0, 4.0) * np.cos(2.0 * np.pi * turns * np.arange(n)), "line", (1,))


def sampled_peaks(rng, n, shape):
    """Largest samples of a cycle's pulse that is sampled a few times a cycle."""
    each = rng.uniform(6.0, 14.0)
    first = rng.random()
    found = np.empty(n)
    for cycle in range(n):
        samples = np.arange(np.ceil(cycle * each - first), np.ceil((cycle + 1) * each - first))
        found[cycle] = np.max(shape((samples + first) / each - cycle))
    return Made(100.0 * found, "line", (1,))


def half_sine(rng, n):
    """Half sines, sampled 6 to 14 times a cycle."""
    return sampled_peaks(rng, n, lambda phase: np.sin(np.pi * phase))


def narrow_pulse(rng, n):
    """Pulses of a quarter of the cycle, sampled 6 to 14 times a cycle."""
    return sampled_peaks(rng, n, lambda phase: np.exp(-0.5 * ((phase - 0.5) / 0.12) ** 2))


def tooth(rng, n):
    """One damaged tooth: an impact of 10 to 30 % every 25 to 120 cycles, at least three in the record."""
    every = int(rng.integers(25, min(121, n // 3)))
    places = np.arange(int(rng.integers(every)), n, every)
    series = np.full(n, 100.0)
    series[places] += rng.uniform(10.0, 30.0)
    return Made(series, "periodic", (1, every))


def odd_ratio(rng, n):
    """Impacts of a wheel whose ratio is no whole number, of 10 to 30 % and of random height."""
    every = rng.uniform(25.0, min(120.0, n / 4.0))
    places = np.arange(rng.random() * every, n - 1, every).astype(int)
    series = np.full(n, 100.0)
    series[places] += rng.uniform(10.0, 20.0) * rng.uniform(1.0, 1.5, len(places))
    return Made(series, "periodic", (1,))


def interference(rng, n):
    """Spikes of interference in 1 to 4 % of the cycles."""
    hit = rng.random(n) < rng.uniform(0.01, 0.04)
    return Made(100.0 + hit * rng.uniform(10.0, 40.0, n), "periodic", (1,))


def dropouts(rng, n):
    """A loose plug: zero in 1 to 4 % of the cycles of a pattern."""
    period = int(rng.integers(1, 4))
    whole = repeated(pattern_of(rng, period, 8.0) if period > 1 else np.full(1, 100.0), n)
    return Made(np.where(rng.random(n) < rng.uniform(0.01, 0.04), 0.0, whole), "periodic", (period,))


def driven_two(rng, n):
    """The logistic map at 3.3, period two, with noise of 0.02 to 0.06 in x."""
    noise = rng.uniform(0.02, 0.06)
    return Made(
        on_level(iterate(lambda x: np.clip(3.3 * x * (1.0 - x) + noise * rng.normal(), 0.0, 1.0), 0.4, n), 15.0),
        "periodic",
        (2,),
    )


def driven_ricker(rng, n):
    """The Ricker map at 2.3, period two, with noise of 3 to 10 % on its growth."""
    noise = rng.uniform(0.03, 0.1)
    return Made(
        on_level(iterate(lambda x: x * np.exp(2.3 * (1.0 - x) + noise * rng.normal()), 0.4, n), 15.0), "periodic", (2,)
    )


def stick_slip(rng, n):
    """Regular stick-slip: a sawtooth that slips at a constant rate, no fraction of a cycle."""
    turns = rng.uniform(0.05, 0.45) + GOLDEN / 100.0
    return Made(80.0 + 40.0 * ((rng.random() + turns * np.arange(n)) % 1.0), "line", (1,))


def whirl(rng, n):
    """A whirl of any shape: four harmonics of a rate that is no fraction of a cycle."""
    turns = (rng.uniform(0.05, 0.45) + GOLDEN / 100.0) * np.arange(n)
    shape = sum(np.cos(2.0 * np.pi * k * turns + rng.uniform(0.0, 6.0)) / k for k in range(1, 5))
    return Made(on_level(shape, 10.0), "line", (1,))


def range_switch(rng, n):
    """Correlated noise of 4 %, and a tenth of it after the amplifier's range was switched."""
    noise = recursion(rng, n, lambda x, e: 0.5 * x + e)
    place = int(rng.uniform(0.3, 0.7) * n)
    return Made((100.0 + 3.5 * noise) * np.where(np.arange(n) < place, 1.0, 0.1), "random")


def pattern_switch(rng, n):
    """Period three, twice as large after a switch of the range."""
    place = int(rng.uniform(0.3, 0.7) * n)
    return Made(repeated(pattern_of(rng, 3, 12.0), n) * np.where(np.arange(n) < place, 1.0, 2.0), "periodic", (3,))


def lost(rng, n):
    """Period three with 1 to 6 % of the cycles missing."""
    share = rng.uniform(0.01, 0.06)
    whole = repeated(pattern_of(rng, 3, 15.0), int(n / (1.0 - share)) + 1)
    return Made(whole[np.sort(rng.choice(len(whole), n, False))], "periodic", (3,))


def doubled(rng, n):
    """Period two or four with 1 to 3 % of the readings written twice."""
    period = int(rng.choice([2, 4]))
    whole = repeated(pattern_of(rng, period, 12.0), n)
    return Made(np.repeat(whole, 1 + (rng.random(n) < rng.uniform(0.01, 0.03)))[:n], "periodic", (period,))


def type_one(rng, n):
    """Type-I intermittency of the logistic map."""
    r = rng.uniform(3.8275, 3.8284)
    return Made(
        50.0 + 80.0 * iterate(lambda x: r * x * (1.0 - x), rng.uniform(0.2, 0.8), n, 400 + int(rng.integers(500))),
        "chaotic",
    )


def manneville(rng, n):
    """The map of Pomeau and Manneville, x + x^1.8 modulo 1: laminar phases and chaos."""
    return Made(on_level(iterate(lambda x: (x + x**1.8) % 1.0, rng.uniform(0.2, 0.8), n), 12.0), "chaotic")


def hopping(rng, n):
    """Two levels, hopped between at random."""
    state = np.cumsum(rng.random(n) < rng.uniform(0.03, 0.3)) % 2
    return Made(100.0 + rng.uniform(5.0, 20.0) * state, "random")


def three_levels(rng, n):
    """Three levels, at random."""
    return Made(np.array([90.0, 100.0, 115.0])[np.cumsum(rng.integers(1, 3, n) * (rng.random(n) < 0.2)) % 3], "random")


def henon_chaos(rng, n):
    """The Henon map, 5 to 20 % of the level."""
    return Made(on_level(henon(n, skip=500 + int(rng.integers(200)))[:, 0], rng.uniform(5.0, 20.0)), "chaotic")


def lozi_chaos(rng, n):
    """The Lozi map at 1.7, 0.5."""
    x, y, found = 0.1 * rng.random(), 0.0, []
    for _ in range(n + 500):
        x, y = 1.0 - 1.7 * abs(x) + y, 0.5 * x
        found.append(x)
    return Made(on_level(np.array(found[500:]), rng.uniform(5.0, 20.0)), "chaotic")


def belt(rng, n):
    """Period five on a random walk of the level, 0.5 N a cycle."""
    return Made(repeated(pattern_of(rng, 5, 10.0), n) + 0.3 * np.cumsum(rng.normal(size=n)), "periodic", (5,))


def pink_on_two(rng, n):
    """Period two and pink noise of 1 to 3 %."""
    noise = pink(rng, n)
    return Made(repeated([85.0, 115.0], n) + rng.uniform(1.0, 3.0) * noise / noise.std(), "periodic", (2,))


def batches(rng, n):
    """Two loads in turn, 5 to 15 cycles each."""
    first, second = rng.integers(5, 16, 2)
    pattern = np.concatenate([np.full(first, 90.0), np.full(second, 110.0)])
    return Made(repeated(pattern, n), "periodic", (len(pattern),))


def step_of_level(rng, n):
    """One level, and another 3 to 20 % higher from some cycle on."""
    return Made(
        np.where(np.arange(n) < rng.uniform(0.3, 0.7) * n, 100.0, 100.0 + rng.uniform(3.0, 20.0)), "periodic", (1,)
    )


def volatile(rng, n):
    """GARCH of 4 %."""
    return Made(on_level(garch(rng, n), 4.0), "random")


def poisson(rng, n):
    """Impacts at random, in a fifth of the cycles."""
    return Made(100.0 + (rng.random(n) < 0.2) * rng.exponential(8.0, n), "random")


def few_bits(rng, n):
    """Period two through a converter of 2 N."""
    return Made(2.0 * np.round(repeated(pattern_of(rng, 2, 12.0), n) / 2.0), "periodic", (2,))


def clipped(rng, n):
    """Period three with noise of 1 %, the largest readings clipped."""
    made = repeated(pattern_of(rng, 3, 12.0), n) + rng.normal(size=n)
    return Made(np.minimum(made, np.max(made) - 2.5), "periodic", (3,))


def two_lines(rng, n):
    """A torus: a line and its second harmonic, at the golden mean or near the third of the root of two."""
    turns = np.arange(n) * (GOLDEN if rng.random() < 0.5 else np.sqrt(2.0) / 3.0)
    return Made(
        on_level(np.cos(2.0 * np.pi * turns) + 0.3 * np.cos(4.0 * np.pi * turns), rng.uniform(5.0, 20.0)),
        "quasiperiodic",
    )


def circle_torus(rng, n):
    """A circle map below its critical coupling."""
    return Made(on_level(circle(rng.uniform(0.1, 0.5), GOLDEN, n), rng.uniform(5.0, 20.0)), "quasiperiodic")


def sine_chaos(rng, n):
    """The sine map at 0.95 to 1."""
    r = rng.uniform(0.97, 1.0)
    return Made(
        on_level(iterate(lambda x: r * np.sin(np.pi * x), rng.uniform(0.2, 0.8), n), rng.uniform(5.0, 20.0)), "chaotic"
    )


def cubic_chaos(rng, n):
    """The cubic map at 2.9 to 3: r x - x^3."""
    r = rng.uniform(2.9, 3.0)
    return Made(on_level(iterate(lambda x: r * x - x**3, rng.uniform(0.2, 0.8), n), rng.uniform(5.0, 20.0)), "chaotic")


def two_close_lines(rng, n):
    """A beat of two lines that lie together, on one level."""
    first = rng.uniform(0.05, 0.4)
    turns = np.outer(np.arange(n), [first, first + 8.0 / n])
    return Made(100.0 + rng.uniform(2.0, 6.0) * np.cos(2.0 * np.pi * turns).sum(axis=1), "quasiperiodic")


def swelling_line(rng, n):
    """A line whose size swells by half, a few times in the record."""
    swell = 1.0 + 0.5 * np.cos(2.0 * np.pi * rng.uniform(3.0, 9.0) * np.arange(n) / n)
    return Made(100.0 + rng.uniform(2.0, 5.0) * swell * line(rng, n, 0.05), "quasiperiodic")


def white(rng, n):
    """White noise of 1 %."""
    return Made(100.0 + rng.normal(size=n), "random")


def slow_noise(rng, n):
    """AR(0.9) of 2 %."""
    return Made(100.0 + 0.9 * recursion(rng, n, lambda x, e: 0.9 * x + e), "random")


TUNED = (
    index_table,
    wear,
    modulation,
    hum_on_three,
    half_sine,
    tooth,
    interference,
    driven_two,
    stick_slip,
    range_switch,
    lost,
    type_one,
    hopping,
    henon_chaos,
    belt,
    batches,
    volatile,
    few_bits,
    two_lines,
    sine_chaos,
    two_close_lines,
    white,
)
FROZEN = (
    drum,
    warming,
    modulated_pattern,
    hum_on_level,
    narrow_pulse,
    odd_ratio,
    dropouts,
    driven_ricker,
    whirl,
    pattern_switch,
    doubled,
    manneville,
    three_levels,
    lozi_chaos,
    pink_on_two,
    step_of_level,
    poisson,
    clipped,
    circle_torus,
    cubic_chaos,
    swelling_line,
    slow_noise,
)
KINDS = (*TUNED, *FROZEN)


def make(kind, seed, draw=99, kinds=KINDS):
    """(readings, what is stated, the truth) of a kind; cycles and statement go through all pairs with the seeds."""
    rng = np.random.default_rng([seed, draw, kinds.index(kind)])
    made = kind(rng, (150, 400, 1200)[seed % 3])
    statement = STATEMENTS[seed // 3 % 4]
    stated = {} if statement == "not" else {"sensor_error": FACTORS[statement] * ERROR}
    return made.series + rng.uniform(-ERROR, ERROR, len(made.series)), stated, made


def answer(made, verdict):
    """Judge an answer: "right", "right, if", "wrong", "wrong, if" or "undetermined"; "if" has a condition."""
    found = verdict.diagnosis
    condition = ", if" if found.condition else ""
    if found.nature == "undetermined":
        return "undetermined"
    if made.nature == "line":
        named = found.nature == "periodic" and found.period in made.periods and "line" in found.condition
        right = found.nature == "quasiperiodic" or named
    elif made.nature == "random":
        right = found.nature == "periodic" and bool(condition)
    else:
        right = found.nature == made.nature and (found.nature != "periodic" or found.period in made.periods)
    return f"{'right' if right else 'wrong'}{condition}"


ANSWERS = ("right", "right, if", "undetermined", "wrong", "wrong, if")


def table(kinds, seeds, made=make):
    """Counts of answers by kind, and those that are wrong."""
    from chaosgym.recordings.judge import judge_peaks

    counts, wrong = {}, []
    for kind in kinds:
        for seed in seeds:
            peaks, stated, truth = made(kind, seed)
            verdict = judge_peaks(peaks, **stated)
            told = answer(truth, verdict)
            counts[kind.__name__, told] = counts.get((kind.__name__, told), 0) + 1
            if told.startswith("wrong"):
                wrong.append((kind.__name__, seed, truth.nature, verdict.diagnosis.words, verdict.diagnosis.reason))
    return counts, wrong


def show(counts):
    """Print the table."""
    print("| kind |", " | ".join(ANSWERS), "|")
    for kind in dict.fromkeys(kind for kind, _ in counts):
        print("|", " | ".join([kind, *(str(counts.get((kind, told), 0)) for told in ANSWERS)]), "|", flush=True)
    print("| all |", " | ".join(str(sum(n for (_, a), n in counts.items() if a == told)) for told in ANSWERS), "|")


if __name__ == "__main__":
    for name, kinds in (("tuned", TUNED), ("frozen", FROZEN)):
        print(name)
        found, missed = table(kinds, range(int(sys.argv[1])))
        show(found)
        print(*missed, sep="\n")
