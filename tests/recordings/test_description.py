"""What is seen in a record beside its nature, each with the figures that it was made with."""

import numpy as np
import pytest

from chaosgym.recordings.description import Sampled
from chaosgym.recordings.judge import judge_peaks


def read(seed, series):
    """A series, read with an error of 0.4 N at most."""
    return series + np.random.default_rng(seed).uniform(-0.4, 0.4, len(series))


def seen(peaks, kind, **stated):
    """The feature of a kind that is seen, as in JSON."""
    features = judge_peaks(peaks, **stated).as_dict()["description"]
    return next(feature for feature in features if feature["kind"] == kind)


def test_a_line_is_seen_with_its_period_and_share():
    """A modulation of 160.26 cycles, 99 % of the variance, on one level."""
    found = seen(read(1, 100.0 + 5.0 * np.sin(2.0 * np.pi * 0.00624 * np.arange(1200))), "line")
    assert found["period_cycles"] == pytest.approx(160.26, rel=1e-3)
    assert found["share_of_variance"] == pytest.approx(12.5 / (12.5 + 0.16 / 3.0), abs=2e-3)


def test_a_pattern_is_seen_with_its_length_and_its_growth():
    """A pattern of 40 cycles eight times; period 3 that grows by a fifth on a level that rises by 4 N."""
    table = np.tile(100.0 + 5.0 * np.random.default_rng(2).normal(size=40), 8)
    found = seen(read(2, table), "pattern")
    assert (found["cycles"], found["times"]) == (40, 8)
    assert found["standard_deviation"] == pytest.approx(0.4 / np.sqrt(3.0), rel=0.1)
    time = np.arange(300) / 300.0
    worn = read(3, 100.0 + 4.0 * time + np.tile([-15.0, 0.0, 15.0], 100) * (1.0 + 0.2 * (time - 0.5)))
    assert seen(worn, "trend of the pattern")["share"] == pytest.approx(0.2, abs=0.01)
    assert seen(worn, "drift")["change"] == pytest.approx(4.0, abs=0.3)


def test_spikes_steps_and_levels_are_seen():
    """A spike of 15 N every 70 cycles; a step from 100 to 120 N at cycle 151; hops between 90 and 110 N."""
    peaks = read(4, np.full(300, 100.0))
    peaks[35::70] += 15.0
    found = seen(peaks, "spikes")
    assert found["every_cycles"] == 70.0
    assert found["height"] == pytest.approx(15.0, abs=0.5)
    step = seen(read(5, np.where(np.arange(300) < 150, 100.0, 120.0)), "change")
    assert abs(step["cycle"] - 151) <= 1
    assert (step["level_before"], step["level_after"]) == (pytest.approx(100.0, abs=0.2), pytest.approx(120.0, abs=0.2))
    state = np.cumsum(np.random.default_rng(6).random(400) < 0.1) % 2
    peaks = read(6, 90.0 + 20.0 * state)
    hops = seen(peaks, "levels")
    assert hops["hops"] == np.count_nonzero(np.diff(state))
    assert judge_peaks(peaks).diagnosis.tells_more[0] == "what switches between its two levels"


def test_bursts_are_seen_and_even_noise_has_none():
    """GARCH of 4 % comes in bursts, white noise does not."""
    rng, series, variance = np.random.default_rng(7), np.empty(1000), 1.0
    for cycle in range(1000):
        series[cycle] = np.sqrt(variance) * rng.normal()
        variance = 0.05 + 0.2 * series[cycle] ** 2 + 0.75 * variance
    found = seen(100.0 + 4.0 * series, "bursts")
    assert found["largest"] > 2.0 * found["least"]
    assert judge_peaks(100.0 + 4.0 * rng.normal(size=1000)).description == ()


@pytest.mark.parametrize("excess", [0.05, 0.1])
def test_bursts_grow_as_the_map_of_type_three_intermittency_does(excess):
    """The map has slope -(1 + excess) at its fixed point 1/3, by which deviations grow (Pomeau and Manneville 1980)."""
    x, series = 0.2, []
    for _ in range(2500):
        x = (1.0 - 2.0 * x - (1.0 - excess) * np.cos(2.0 * np.pi * (x - 1.0 / 12.0)) / (2.0 * np.pi)) % 1.0
        series.append(x)
    found = seen(read(9, 100.0 + 40.0 * np.array(series[500:])), "growth of bursts")
    assert found["growth_per_cycle"] == pytest.approx(excess, abs=0.01)
    assert found["level"] == pytest.approx(100.0 + 40.0 / 3.0, abs=0.2)


def test_a_sampling_beat_and_hum_are_told_by_the_rate_of_the_series():
    """Half sines sampled 8.38 times a cycle beat; a line of 50 Hz is an alias at 12.3 cycles a second."""
    starts = 8.38 * np.arange(400)
    largest = [np.max(np.sin(np.pi * (np.arange(np.ceil(s), np.ceil(s + 8.38)) - s) / 8.38)) for s in starts]
    beat = read(8, 300.0 * np.array(largest))
    verdict = judge_peaks(beat, sensor_error=0.4, sampled=Sampled(8.38, 12.3))
    assert verdict.diagnosis.words.startswith("periodic, period 1")
    assert "from outside" not in verdict.diagnosis.words
    assert "as sampling 8.38 times a cycle makes" in verdict.description[0].text
    hum = read(9, 100.0 + 2.0 * np.sin(2.0 * np.pi * 50.0 / 12.3 * np.arange(400)))
    text = judge_peaks(hum, sensor_error=0.4, sampled=Sampled(800.0, 12.3)).description[0].text
    assert text.endswith("as a hum of 50 Hz makes")
    assert "makes" not in judge_peaks(hum, sensor_error=0.4).description[0].text


def test_what_is_seen_is_told_in_the_unit_of_the_readings():
    """No newton in what is seen of an acceleration."""
    table = np.tile(3.0 + 0.2 * np.random.default_rng(2).normal(size=40), 8)
    verdict = judge_peaks(table + 0.01 * np.random.default_rng(3).normal(size=320), unit="g")
    assert verdict.remarks[0].startswith("seen: a pattern of 40 cycles, seen 8 times, to a standard deviation of 0.0")
    assert " N" not in verdict.remarks[0]
