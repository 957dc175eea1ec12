"""Motions that repeat, turn at a constant rate or rest without noise are no chaos, though maps forecast them."""

import numpy as np
import pytest

from chaosgym.recordings.fixed_motion import line_of, long_pattern, without_trend
from chaosgym.recordings.judge import judge_peaks
from tests.recordings.process_records import recursion

SEEDS = range(400, 404)


def read(rng, series):
    """A series around 100 N, read with an error of 0.4 N at most."""
    return series + rng.uniform(-0.4, 0.4, len(series))


def natures(make, seeds=SEEDS, **stated):
    """Words of the verdicts on records of several seeds."""
    return [judge_peaks(make(np.random.default_rng(seed)), **stated).diagnosis.words for seed in seeds]


@pytest.mark.parametrize(("period", "seen"), [(40, 4), (33, 4), (64, 3), (40, 8)])
def test_a_long_pattern_that_is_seen_a_few_times_is_periodic(period, seen):
    """An index table of 40 places, seen 4 times, repeats every 40 cycles: its earlier copies forecast it, no map."""

    def table(rng):
        steps = rng.normal(size=period)
        pattern = np.cumsum(steps) - np.linspace(0.0, steps.sum(), period)
        return read(rng, np.tile(100.0 + 5.0 * pattern / pattern.std(), seen))

    told = natures(table, sensor_error=0.4)
    assert "chaotic" not in told
    assert sum(words.startswith(f"periodic, period {period}") for words in told) >= 3


def test_nothing_is_claimed_across_a_change():
    """Noise whose amplifier is switched to a tenth of the range midway: never chaotic, and the change is named."""

    def switched(rng):
        noise = recursion(rng, 120, lambda x, e: 0.5 * x + e)
        return (100.0 + 3.5 * noise) * np.where(np.arange(120) < 60, 1.0, 0.1)

    assert "chaotic" not in natures(switched, range(400, 412))


def test_regular_stick_slip_is_a_line_of_the_machine():
    """A sawtooth at 0.137 turns a cycle is quasiperiodic under a condition, not intermittent chaos by one part."""
    told = natures(lambda rng: read(rng, 80.0 + 40.0 * ((rng.random() + 0.137 * np.arange(1200)) % 1.0)))
    assert sum(words.startswith("quasiperiodic, if its line of period 7.") for words in told) >= 3
    assert set(words.partition(",")[0] for words in told) <= {"quasiperiodic", "undetermined"}


@pytest.mark.parametrize("share", [0.01, 0.03, 0.06])
def test_a_pattern_keeps_its_period_whatever_cycles_are_missing(share):
    """1,200 cycles of period 3 of which 3 % are missing: periodic, and nearly as many gaps as cycles are missing."""

    def lossy(rng):
        whole = np.resize([80.0, 100.0, 125.0], int(1200 / (1.0 - share)) + 1)
        return read(rng, whole[np.sort(rng.choice(len(whole), 1200, False))])

    verdict = judge_peaks(lossy(np.random.default_rng(400)), sensor_error=0.4)
    assert verdict.diagnosis.words == "periodic, period 3"
    assert len(verdict.gaps) > 0.8 * share * 1200


def test_readings_beyond_the_stated_error_leave_a_condition():
    """Type-I intermittency over 150 cycles looks like period 3, and its readings leave the stated error."""

    def intermittent(rng):
        x, series = rng.uniform(0.2, 0.8), []
        for _ in range(150 + int(rng.integers(400, 900))):
            x = 3.8284 * x * (1.0 - x)
            series.append(x)
        return read(rng, 50.0 + 80.0 * np.array(series[-150:]))

    told = natures(intermittent, range(400, 412), sensor_error=0.4)
    assert told.count("periodic, period 3") <= 1
    assert any("if the sensor errs by more than the stated 0.4 N" in words for words in told)
    steady = judge_peaks(read(np.random.default_rng(400), np.tile([80.0, 100.0, 125.0], 50)), sensor_error=0.4)
    assert steady.diagnosis.words == "periodic, period 3"


def test_spikes_at_equal_intervals_are_named():
    """An impact every 70 cycles is a damaged tooth: it is said, and stands in the verdict; a single spike does not."""
    peaks = read(np.random.default_rng(400), np.full(300, 100.0))
    peaks[35::70] = 115.0
    verdict = judge_peaks(peaks, sensor_error=0.4)
    assert verdict.diagnosis.words == "periodic, period 1, apart from a spike every 70 cycles"
    assert any("a spike every 70 cycles" in note for note in verdict.notes)
    assert not any("wrong readings:" in note for note in verdict.notes)
    peaks[35:200:70] = 100.0
    assert judge_peaks(peaks, sensor_error=0.4).diagnosis.words == "periodic, period 1"


def test_a_pattern_may_grow():
    """Period 3 that grows by 15 % is periodic, and the growth comes out within a hundredth."""
    rng = np.random.default_rng(400)
    pattern = np.tile([-15.0, 0.0, 15.0], 100) * (1.0 + 0.15 * (np.arange(300) / 300 - 0.5))
    assert without_trend(100.0 + pattern, 3)[1] == pytest.approx(0.15, abs=0.01)
    assert judge_peaks(read(rng, 100.0 + pattern), sensor_error=0.4).diagnosis.words == "periodic, period 3"


def test_a_line_is_told_with_its_period():
    """A modulation of 160.26 cycles on one level and a hum on period 3: their periods within a thousandth."""
    rng, cycles = np.random.default_rng(400), np.arange(1200)
    slow = read(rng, 100.0 + 5.0 * np.sin(2.0 * np.pi * 0.00624 * cycles))
    assert line_of(slow).cycles == pytest.approx(1.0 / 0.00624, rel=1e-3)
    assert judge_peaks(slow, sensor_error=0.4).diagnosis.words == (
        "periodic, period 1, if its line of period 160.3 cycles is from outside, else quasiperiodic"
    )
    hum = read(rng, np.resize([80.0, 100.0, 125.0], 1200) + 3.0 * np.sin(2.0 * np.pi * 0.2113 * cycles))
    found = line_of(hum)
    assert (found.period, found.pure) == (3, True)
    assert found.cycles == pytest.approx(1.0 / 0.2113, rel=1e-3)


@pytest.mark.parametrize(("overtone", "nature"), [(0.0, "periodic"), (0.05, "quasiperiodic")])
def test_what_is_added_from_outside_has_no_multiples(overtone, nature):
    """A sinusoid of 15 % is a hum, however large; with a multiple of 5 % of it, it is an oscillation of the machine."""
    turns = 2.0 * np.pi * 0.2713 * np.arange(400)

    def humming(rng):
        return read(rng, 100.0 + 21.0 * (np.cos(turns) + overtone * np.cos(2.0 * turns)))

    assert {words.partition(",")[0] for words in natures(humming, sensor_error=0.4)} == {nature}


@pytest.mark.parametrize(("size", "nature"), [(1000, "periodic, period 5, if"), (64, "undetermined")])
def test_a_sinusoid_of_five_cycles_is_a_pattern_if_it_is_seen_often(size, nature):
    """A hum seldom lies within a thousandth of a fifth of a cycle by chance, but often within a sixtieth."""
    pattern = 100.0 + 10.0 * np.cos(0.4 * np.pi * np.arange(size))
    told = natures(lambda rng: pattern + 3.0 * rng.normal(size=size), sensor_error=1.0)
    assert all(words.startswith(nature) for words in told)


def test_a_hum_on_a_pattern_that_is_seen_a_few_times_is_no_longer_pattern():
    """A pattern of 8 cycles and a hum near 5/32 over 128 cycles is as well one of 32, which is not claimed."""

    def humming(rng):
        hum = 10.0 * np.cos(2.0 * np.pi * 0.15647 * np.arange(128))
        return np.resize(rng.uniform(40.0, 60.0, 8), 128) + hum + 0.2 * rng.normal(size=128)

    assert not [words for words in natures(humming) if words.startswith("periodic, period 32")]


@pytest.mark.parametrize("correlation", [0.0, 0.5, 0.9, 0.99])
def test_noise_has_neither_a_long_pattern_nor_a_line(correlation):
    """Of 40 records of noise of any correlation none has a pattern or a line."""
    for seed in range(40):
        noise = recursion(np.random.default_rng(seed), 400, lambda x, e: correlation * x + e)
        assert line_of(100.0 + noise) is None
        assert long_pattern(noise, float(np.var(noise)), 0.0) is None or correlation > 0.9


def test_noise_around_a_resting_map_is_periodic():
    """The logistic map at 3.3 has period 2; noise of 0.06 in x hides the pattern, and the fitted map rests on it."""

    def driven(rng):
        x, series = 0.4, []
        for _ in range(600):
            x = min(max(3.3 * x * (1.0 - x) + 0.06 * rng.normal(), 0.0), 1.0)
            series.append(x)
        return read(rng, 50.0 + 80.0 * np.array(series[-400:]))

    told = natures(driven)
    assert sum(words.startswith("periodic, period 2, if") for words in told) >= 2
    assert set(told) == {"undetermined", *(words for words in told if words.startswith("periodic, period 2, if"))}


@pytest.mark.parametrize("cycles", [150, 400])
def test_an_alternation_as_small_as_the_scatter_is_a_period(cycles):
    """Peaks alternate by 0.5 N in random scatter of 0.25 N: period 2, under the condition that period 1 would have."""
    rng = np.random.default_rng(cycles)
    peaks = 50.0 + 0.25 * (-1.0) ** np.arange(cycles) + 0.25 * rng.normal(size=cycles)
    found = judge_peaks(peaks).diagnosis
    assert (found.nature, found.period) == ("periodic", 2)
    assert found.condition.startswith("if its scatter of 0.4") or found.condition.startswith("if its scatter of 0.5")


@pytest.mark.parametrize("seed", range(4))
def test_random_scatter_has_no_period(seed):
    """White noise, and noise whose neighbours differ in sign, do not alternate."""
    noise = np.random.default_rng(seed).normal(size=402)
    for scatter in (noise[2:], noise[2:] - 0.3 * noise[1:-1]):
        assert judge_peaks(100.0 + 0.5 * scatter).diagnosis.period == 1
