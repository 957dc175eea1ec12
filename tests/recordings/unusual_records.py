"""Records that nobody planned for: noise with structure, sensors that clip, hold or wrap, loggers of two rates.

Natures are known by construction, as in ``recorder_records``: around 100 N, read with an error of 0.4 N at most, over
150, 400 and 1,200 cycles. ``python -m tests.recordings.unusual_records 6`` prints the table of the first six seeds.
"""

import sys

import numpy as np

from tests.recordings import recorder_records
from tests.recordings.process_records import recursion
from tests.recordings.recorder_records import Made, iterate, line, on_level, pattern_of, repeated
from tests.series.maps import GOLDEN, circle, henon


def logistic(rng, n, low=3.85, high=4.0):
    """The logistic map, standard deviation about 0.3."""
    r = rng.uniform(low, high)
    return iterate(lambda x: r * x * (1.0 - x), rng.uniform(0.2, 0.8), n)


def slow(rng, n, share=0.7):
    """AR(1), standard deviation 1."""
    return np.sqrt(1.0 - share**2) * recursion(rng, n, lambda x, e: share * x + e)


def peak_hold(rng, n):
    """White noise behind a peak detector that falls by a tenth a cycle."""
    drive = np.abs(rng.normal(size=n + 50))
    return Made(on_level(iterate_over(drive, lambda y, x: max(x, 0.9 * y))[50:], 5.0), "random")


def iterate_over(drive, step):
    """State after each value of a drive, from its first."""
    state, states = drive[0], np.empty(len(drive))
    for place, value in enumerate(drive):
        state = states[place] = step(state, value)
    return states


def peak_held_pattern(rng, n):
    """A pattern of 3 to 7 cycles behind the same peak detector."""
    period = int(rng.integers(3, 8))
    held = iterate_over(repeated(pattern_of(rng, period, 15.0), n + 70) - 60.0, lambda y, x: max(x, 0.9 * y))[70:]
    apart = [k for k in range(1, period + 1) if period % k == 0 and np.ptp(held - np.resize(held[:k], n)) < 1e-9]
    return Made(60.0 + held, "periodic", tuple(apart[:1]))


def largest_of_four(rng, n):
    """The largest of the last four of white noise, as a maximum over a window makes it."""
    windows = np.lib.stride_tricks.sliding_window_view(rng.normal(size=n + 3), 4)
    return Made(100.0 + 5.0 * windows.max(axis=1), "random")


def shots(rng, n):
    """Shots at random that fade by a fifth a cycle: steep rises, slow falls."""
    drive = (rng.random(n + 50) < 0.2) * rng.exponential(1.0, n + 50)
    return Made(on_level(iterate_over(drive, lambda y, x: 0.8 * y + x)[50:], 6.0), "random")


def random_reset(rng, n):
    """A ramp that falls back at random thresholds: charge and fire with noise."""
    state, rise, readings = 0.0, rng.uniform(0.05, 0.3), np.empty(n)
    threshold = rng.uniform(0.8, 1.2)
    for cycle in range(n):
        state += rise
        if state > threshold:
            state, threshold = 0.0, rng.uniform(0.8, 1.2)
        readings[cycle] = state
    return Made(on_level(readings, 8.0), "random")


def overflow(rng, n):
    """A random walk beyond the range of a converter that wraps around."""
    return Made(80.0 + 40.0 * (np.cumsum(rng.uniform(0.02, 0.2) * rng.normal(size=n)) % 1.0), "random")


def wrapped_noise(rng, n):
    """Correlated noise three times as wide as the range that wraps around."""
    return Made(80.0 + 40.0 * (slow(rng, n, 0.95) % 1.0), "random")


def held_by_logger(rng, n):
    """White noise, a new reading every 2 to 6 cycles, the old one repeated between."""
    every = int(rng.integers(2, 7))
    return Made(100.0 + 4.0 * np.repeat(rng.normal(size=n // every + 2), every)[:n], "random")


def interpolated(rng, n):
    """White noise of a logger with 2.3 to 4.7 cycles a reading, drawn through by lines."""
    apart = rng.uniform(2.3, 4.7)
    times = np.arange(0.0, n + 2.0 * apart, apart)
    return Made(100.0 + 4.0 * np.interp(np.arange(n), times, rng.normal(size=len(times))), "random")


def interpolated_gaps(rng, n):
    """White noise of which a third is missing, and filled in by lines."""
    noise, there = 4.0 * rng.normal(size=n), rng.random(n) > 1.0 / 3.0
    there[[0, -1]] = True
    return Made(100.0 + np.interp(np.arange(n), np.flatnonzero(there), noise[there]), "random")


def repeated_buffer(rng, n):
    """White noise of which the logger writes one block of eight in five twice."""
    blocks = 4.0 * rng.normal(size=(n // 8 + 1, 8))
    return Made(100.0 + np.repeat(blocks, 1 + (rng.random(len(blocks)) < 0.2), axis=0).ravel()[:n], "random")


def coin_filter(rng, n):
    """Coin tosses behind a filter of one half: in reverse time a map that doubles."""
    return Made(on_level(recursion(rng, n, lambda x, e: 0.5 * x + float(e > 0.0)), 8.0), "random")


def two_maps(rng, n):
    """Two contracting maps, drawn at random: a fractal that no chaos makes."""
    return Made(on_level(recursion(rng, n, lambda x, e: 0.4 * x if e > 0.0 else 0.9 - 0.5 * x), 8.0), "random")


def slew_limited(rng, n):
    """A servo of limited rate behind targets that jump at random."""
    targets = np.repeat(rng.normal(size=n // 7 + 2), 7)[:n]
    return Made(on_level(iterate_over(targets, lambda y, x: y + np.clip(x - y, -0.4, 0.4)), 6.0), "random")


def dead_zone(rng, n):
    """Correlated noise behind a dead zone of one standard deviation."""
    noise = slow(rng, n)
    return Made(100.0 + 8.0 * (noise - np.clip(noise, -1.0, 1.0)), "random")


def cyclic_noise(rng, n):
    """Noise whose size follows a pattern of 4 cycles, on one level."""
    return Made(100.0 + np.resize([0.5, 1.0, 6.0, 2.0], n) * rng.normal(size=n), "random")


def multiplied_pattern(rng, n):
    """Period three whose size scatters by 3 % from cycle to cycle."""
    return Made(repeated(pattern_of(rng, 3, 20.0), n) * (1.0 + 0.03 * rng.normal(size=n)), "periodic", (3,))


def slipping_cycle(rng, n):
    """Four levels in turn, one step in twenty skipped or held."""
    place = np.cumsum(np.where(rng.random(n) < 0.05, rng.choice([0, 2], n), 1)) % 4
    return Made(np.array([85.0, 110.0, 95.0, 120.0])[place], "periodic", (4,))


def swapped_packets(rng, n):
    """Period seven in packets of sixteen, a few of which come in another order."""
    packets = np.resize(pattern_of(rng, 7, 12.0), 16 * (n // 16 + 1)).reshape(-1, 16)
    place = int(rng.integers(1, len(packets) - 1))
    packets[[place, place + 1 if place + 1 < len(packets) else 0]] = packets[
        [place + 1 if place + 1 < len(packets) else 0, place]
    ]
    return Made(packets.ravel()[:n], "periodic", (7,))


def wandering_hum(rng, n):
    """A line whose phase wanders, as a supply of unsteady frequency makes it."""
    phase = 2.0 * np.pi * (rng.uniform(0.05, 0.45) * np.arange(n) + 0.03 * np.cumsum(rng.normal(size=n)))
    return Made(100.0 + 4.0 * np.cos(phase), "random")


def swept_line(rng, n):
    """A line that sweeps from a tenth to four tenths of a cycle."""
    return Made(100.0 + 4.0 * np.cos(np.pi * 0.3 * np.arange(n) ** 2 / n + 0.2 * np.pi * np.arange(n)), "random")


def doubling_under_way(rng, n):
    """The logistic map from 3.1 to 3.5 over the record: period two, then four."""
    return Made(on_level(drifting(rng, n, 3.1, 3.5), 12.0), "periodic", (2, 4))


def drifting(rng, n, first, last):
    """The logistic map with a growing parameter."""
    x, readings = rng.uniform(0.2, 0.8), np.empty(n)
    for cycle in range(-300, n):
        r = first + (last - first) * max(0, cycle) / n
        x = r * x * (1.0 - x)
        if cycle >= 0:
            readings[cycle] = x
    return readings


def chaos_under_way(rng, n):
    """The logistic map from 3.3 to 4 over the record: chaos from the middle on."""
    return Made(on_level(drifting(rng, n, 3.3, 4.0), 12.0), "chaotic")


def clipped_chaos(rng, n):
    """The logistic map whose largest fifth is clipped."""
    made = on_level(logistic(rng, n), 12.0)
    return Made(np.minimum(made, np.quantile(made, 0.8)), "chaotic")


def coarse_chaos(rng, n):
    """The Henon map through a converter of 16 levels."""
    made = henon(n, skip=500 + int(rng.integers(200)))[:, 0]
    step = np.ptp(made) / 16.0
    return Made(on_level(step * np.round(made / step), 12.0), "chaotic")


def chaos_with_losses(rng, n):
    """The logistic map with 3 % of the cycles missing."""
    made = logistic(rng, int(n / 0.96) + 2)
    return Made(on_level(made[np.sort(rng.choice(len(made), n, False))], 12.0), "chaotic")


def chaos_of_two_channels(rng, n):
    """Readings of the logistic map and of one level in turn: two channels in one column."""
    made = np.full(n, 90.0)
    made[::2] = on_level(logistic(rng, len(made[::2])), 10.0)
    return Made(made, "chaotic")


def chaos_on_drift(rng, n):
    """The Henon map on a level that rises by a tenth, through steps of 1 N."""
    made = on_level(henon(n, skip=500 + int(rng.integers(200)))[:, 0], 10.0) + 10.0 * np.arange(n) / n
    return Made(np.round(made), "chaotic")


def clipped_torus(rng, n):
    """A circle map below its critical coupling, the largest third clipped."""
    made = on_level(circle(rng.uniform(0.1, 0.5), GOLDEN, n), 10.0)
    return Made(np.minimum(made, np.quantile(made, 0.7)), "line", (1,))


def torus_with_losses(rng, n):
    """A line of the golden mean with 3 % of the cycles missing."""
    cycles = np.sort(rng.choice(int(n / 0.97), n, False))
    return Made(100.0 + 8.0 * np.cos(2.0 * np.pi * GOLDEN * cycles), "line", (1,))


def sigma_delta(rng, n):
    """A level through a sigma-delta converter of 10 N: a pattern of two levels that never quite repeats."""
    share = rng.uniform(0.1, 0.9)
    return Made(95.0 + 10.0 * np.diff(np.floor(share * np.arange(n + 1) + rng.random())), "line", (1,))


def rectified_line(rng, n):
    """A line and its absolute value: twice the frequency, and multiples."""
    return Made(100.0 + 8.0 * np.abs(line(rng, n, 0.05)), "line", (1,))


def saturating_noise(rng, n):
    """Noise that a sensor clips at both ends, one standard deviation from the middle."""
    return Made(100.0 + 6.0 * np.clip(slow(rng, n, 0.5), -1.0, 1.0), "random")


KINDS = (
    peak_hold,
    peak_held_pattern,
    largest_of_four,
    shots,
    random_reset,
    overflow,
    wrapped_noise,
    held_by_logger,
    interpolated,
    interpolated_gaps,
    repeated_buffer,
    coin_filter,
    two_maps,
    slew_limited,
    dead_zone,
    cyclic_noise,
    multiplied_pattern,
    slipping_cycle,
    swapped_packets,
    wandering_hum,
    swept_line,
    doubling_under_way,
    chaos_under_way,
    clipped_chaos,
    coarse_chaos,
    chaos_with_losses,
    chaos_of_two_channels,
    chaos_on_drift,
    clipped_torus,
    torus_with_losses,
    sigma_delta,
    rectified_line,
    saturating_noise,
)


def make(kind, seed):
    """(readings, what is stated, the truth) of a kind."""
    return recorder_records.make(kind, seed, 101, KINDS)


if __name__ == "__main__":
    counts, missed = recorder_records.table(KINDS, range(int(sys.argv[1])), make)
    recorder_records.show(counts)
    print(*missed, sep="\n")
