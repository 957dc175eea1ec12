"""One verdict on measured peaks: right, or an honest "can't tell", whatever sensor and recorder did to them.

``python -m tests.recordings.test_judge 8`` prints the tables of the first eight records of each kind.
"""

import os
import sys

import numpy as np
import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.judge import judge_peaks
from chaosgym.series.determinism import determinism, surrogate
from tests.recordings import held_out, process_records
from tests.recordings.held_out import STATEMENTS
from tests.recordings.process_records import answer
from tests.recordings.records import make, scatter, strong
from tests.series.maps import circle, henon, logistic, three_frequencies

ANSWERS = ("right", "right, if", "wrong", "wrong, if", "undetermined")
"""Answers of the table; "if" are those that rest on the scatter being random, as the verdict says."""


RECORDS = int(os.environ.get("CHAOSGYM_RECORDS", "10"))
"""Records of each kind in the slow tests."""


def judged(module, kinds, seeds):
    """Answers to records: counts by kind and by what is stated of the sensor, in reach or not; those that are wrong."""
    counts, wrong = {}, []
    for kind in kinds:
        for seed in seeds:
            record = module.make(kind, seed)
            verdict = judge_peaks(record.peaks, **record.stated)
            found = answer(record, verdict)
            for row in (kind, f"stated {STATEMENTS[seed % 4]}", "all"):
                key = (row, record.clear, found)
                counts[key] = counts.get(key, 0) + 1
            if found.startswith("wrong"):
                wrong.append((kind, seed, record.nature, verdict.diagnosis.words, verdict.diagnosis.reason))
    return counts, wrong


def share(counts, row, what, where=(True, False)):
    """Share of the records of a row that were answered so."""
    of = {key: count for key, count in counts.items() if key[0] == row and key[1] in where}
    return sum(count for key, count in of.items() if key[2] == what) / max(1, sum(of.values()))


def show(counts):
    """Print the table, as in docs/recordings.md."""
    print("| records | in reach:", " | ".join(ANSWERS), "| others:", " | ".join((*ANSWERS, "within")), "|")
    for row in dict.fromkeys(row for row, _, _ in counts):
        columns = [counts.get((row, where, what), 0) for where in (True, False) for what in (*ANSWERS, "within")]
        del columns[len(ANSWERS)]
        print("|", " | ".join(map(str, [row, *columns])), "|")


def check(counts, wrong):
    """At most 1 % wrong, and 20 % undetermined where the truth is in reach; the docs tell aims and misses."""
    show(counts)
    assert share(counts, "all", "wrong") <= 0.01, wrong
    assert share(counts, "all", "undetermined", (True,)) <= 0.2


def test_records_of_known_nature_are_judged_rightly():
    """One record of every fourth kind of noise and sixth of published systems: none is judged wrongly."""
    for module, kinds in ((process_records, process_records.KINDS[::4]), (held_out, held_out.KINDS[:-1:6])):
        _, wrong = judged(module, kinds, range(7000, 7001))
        assert not wrong


@pytest.mark.slow
def test_noise_in_the_process_is_not_taken_for_chaos():
    """Records with noise in the process, of the kinds that thresholds were set on, other seeds."""
    check(*judged(process_records, process_records.KINDS, range(7000, 7000 + RECORDS)))


@pytest.mark.slow
def test_systems_that_no_threshold_was_set_on_are_judged_rightly():
    """Records of published maps and flows, of random processes and of beams with noisy speed."""
    check(*judged(held_out, held_out.KINDS, range(9000, 9000 + min(RECORDS, 32))))


@pytest.mark.slow
def test_chaos_of_maps_is_found_through_one_percent_of_noise():
    """500 cycles of four chaotic systems, noise of 1 % of the mean force: 85 % are found, none is called periodic.

    Left out are series that settle on a periodic window or a fixed point, or whose bands are as narrow as the noise.
    """
    rng, found = np.random.default_rng(31), []
    for k in range(100):
        kind = list(held_out.CHAOS)[k % 4]
        series = held_out.force(held_out.CHAOS[kind](rng, 500, k, 0.0), rng, rng.uniform(0.1, 0.3))
        sigma = 0.01 * series.mean()
        peaks = series + sigma * rng.normal(size=500)
        if scatter(series[250:]) >= 3.0 * sigma:
            found.append(judge_peaks(peaks).diagnosis.nature)
    print({nature: found.count(nature) for nature in set(found)})
    assert len(found) > 90
    assert found.count("chaotic") >= 0.85 * len(found)
    assert found.count("periodic") == 0


def test_random_scatter_is_never_chaos():
    """Normal scatter of 6 N around 100 N, whatever is stated of the sensor: periodic within it, or undetermined."""
    peaks = 100.0 + 6.0 * np.random.default_rng(0).normal(size=500)
    beyond = judge_peaks(peaks, sensor_error=1.0).diagnosis
    assert "no reading can be forecast from those before" in beyond.reason
    assert beyond.tells_more == ("a second sensor", "the machine's model")
    assert judge_peaks(peaks).diagnosis.nature == "undetermined"
    wide = judge_peaks(peaks, sensor_error=10.0).diagnosis
    outside = 100.0 * np.mean(np.abs(peaks - peaks.mean()) > 10.0)
    assert (wide.nature, wide.period) == ("periodic", 1)
    assert f"{outside:.2g} % of the readings lie outside the stated +-10 N" in wide.reason
    assert "outside" not in judge_peaks(peaks, sensor_sigma=6.0).diagnosis.reason


@pytest.mark.parametrize("stated", [{}, {"sensor_error": 0.2}, {"sensor_sigma": 0.2}])
def test_a_pattern_with_random_scatter_is_an_answer(stated):
    """Period three with a correlated scatter of 2 N: periodic, random, with its standard deviation."""
    rng, noise = np.random.default_rng(1), np.zeros(600)
    for i in range(1, 600):
        noise[i] = 0.5 * noise[i - 1] + np.sqrt(0.75) * 2.0 * rng.normal()
    found = judge_peaks(np.tile([40.0, 60.0, 50.0], 200) + noise, **stated)
    assert (found.diagnosis.nature, found.diagnosis.period, found.random) == ("periodic", 3, True)
    assert found.scatter == pytest.approx(2.0, rel=0.1)
    assert found.coefficient_of_variation == pytest.approx(0.04, rel=0.1)


@pytest.mark.parametrize(
    ("series", "why"),
    [
        (50.0 * np.exp(-np.arange(300) / 100.0), "the force decays"),
        (5.0 * np.exp(np.arange(300) / 100.0), "the force grows"),
        (50.0 + np.exp(np.arange(300) / 100.0) * (-1.0) ** np.arange(300), "its variation grows"),
        (np.where(np.abs(np.arange(300) - 150) < 6, 80.0, 20.0), "a single event"),
    ],
)
def test_what_is_not_steady_is_named(series, why):
    """A decay, a growth, a growing period two and a single event get no nature."""
    verdict = judge_peaks(series + 0.01 * np.random.default_rng(2).normal(size=300), sensor_sigma=0.01).diagnosis
    assert verdict.nature == "undetermined"
    assert verdict.reason.startswith("not a steady response: ")
    assert why in verdict.reason


def test_ten_lost_cycles_leave_period_three():
    """Period three of which ten single cycles were lost, in one of the public records' ways."""
    rng = np.random.default_rng(3)
    pattern = np.tile([40.0, 60.0, 50.0], 200) + 0.05 * rng.normal(size=600)
    found = judge_peaks(np.delete(pattern, 30 + 50 * np.arange(10)), sensor_sigma=0.05)
    assert (found.diagnosis.nature, found.diagnosis.period, len(found.gaps)) == ("periodic", 3, 10)


def test_surrogates_keep_distribution_and_spectrum():
    """Schreiber and Schmitz (1996): the same readings in another order, and nearly the same spectrum."""
    series = logistic(3.9, 512)[:, None]
    made = surrogate(series, np.random.default_rng(4))
    np.testing.assert_array_equal(np.sort(made, axis=0), np.sort(series, axis=0))
    power, its = (np.abs(np.fft.rfft(x[:, 0] - x.mean())) for x in (series, made))
    assert np.sum((power - its) ** 2) < 0.01 * np.sum(power**2)
    assert not np.array_equal(made, series)


@pytest.mark.parametrize(("series", "exponent"), [(logistic(4.0, 500), np.log(2.0)), (2.0 + henon(1000)[:, 0], 0.419)])
def test_the_fitted_map_has_the_published_exponent(series, exponent):
    """ln 2 of the logistic map at r = 4; 0.419 of the Henon map (Sprott 2003), within a tenth, from readings alone."""
    noisy = series + 1e-4 * np.random.default_rng(5).normal(size=len(series))
    low, middle = determinism(noisy).exponent
    assert middle == pytest.approx(exponent, rel=0.1)
    assert 0.0 < low <= middle


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["periodic", "strong chaos", "drift", "simulated beam"])
def test_one_wrong_reading_changes_no_verdict(kind, seed):
    """One reading in a hundred cycles, half as large again, makes no nature or period another one, and is reported."""
    tried = (make(kind, 8000 + 100 * seed + k) for k in range(100))
    record = next(one for one in tried if len(one.peaks) >= 100 and one.clear)
    spoilt = record.peaks.copy()
    place = 20 + 7 * seed
    spoilt[place] += np.ptp(record.peaks) + 0.5 * np.max(record.peaks)
    before, after = (judge_peaks(peaks, **record.stated) for peaks in (record.peaks, spoilt))
    told = {(one.diagnosis.nature, one.diagnosis.period) for one in (before, after)}
    assert len(told - {("undetermined", None)}) <= 1
    assert len(told) == 1 or record.nature == "chaotic"
    assert place + 1 in after.outliers or record.nature == "chaotic"


def test_records_of_the_report_are_not_chaotic():
    """A constant force with 0.1 or 1 % of noise, through a 1 N converter, or with a spike, is never called chaotic."""
    rng = np.random.default_rng(4)
    steady = np.full(300, 48.9)
    spiky = steady.copy()
    spiky[250] = 80.0
    for peaks in (steady + 0.0489 * rng.normal(size=300), steady + 0.489 * rng.normal(size=300), spiky):
        verdict = judge_peaks(peaks).diagnosis
        assert (verdict.nature, verdict.period) == ("periodic", 1)
    for place in (150, 155, 250):
        spiky = steady.copy()
        spiky[place] = 80.0
        found = judge_peaks(spiky)
        assert (found.diagnosis.period, found.outliers) == (1, (place + 1,))
    flicker = judge_peaks(np.round(48.5 + 0.1 * rng.normal(size=300)))
    assert (flicker.diagnosis.nature, flicker.diagnosis.period) == ("periodic", 1)
    assert "within 1 N" in flicker.diagnosis.reason


def test_the_meaning_of_the_stated_error_is_kept():
    """A normal error told by its standard deviation, or an even one by its half width, gives period 1 at every size."""
    rng = np.random.default_rng(5)
    for sigma in (0.1, 0.5, 2.0):
        assert judge_peaks(48.9 + sigma * rng.normal(size=300), sensor_sigma=sigma).diagnosis.period == 1
        even = 48.9 + sigma * rng.uniform(-1.0, 1.0, 300)
        assert judge_peaks(even, sensor_error=sigma).diagnosis.period == 1


def test_an_error_larger_than_the_spread_cannot_tell():
    """A sensor of 1000 N says nothing of chaos between 32 and 73 N, and the verdict says that."""
    verdict = judge_peaks(52.0 + 20.0 * (2.0 * logistic(4.0, 300) - 1.0), sensor_error=1000.0).diagnosis
    assert verdict.nature == "undetermined"
    assert "can't tell" in verdict.reason


def test_a_scatter_that_could_be_either_asks_for_the_error():
    """60 cycles with a scatter of 1 % are undetermined, and the verdict asks for the sensor's error and more cycles."""
    verdict = judge_peaks(48.9 + 0.489 * np.random.default_rng(6).normal(size=60)).diagnosis
    assert verdict.nature == "undetermined"
    assert "noise and fast chaos look alike" in verdict.reason
    assert verdict.tells_more[:2] == ("the sensor's error", "more cycles")
    assert verdict.statement.tells_more.startswith("the sensor's error, more cycles, ")


def test_a_sensor_a_little_worse_than_stated_is_no_chaos():
    """Noise of 4 N where 3 N are stated is not called chaotic."""
    rng = np.random.default_rng(7)
    for _ in range(20):
        verdict = judge_peaks(60.0 + rng.uniform(-4.0, 4.0, 64), sensor_error=3.0).diagnosis
        assert verdict.nature != "chaotic"


def test_missing_cycles_and_changes_are_reported():
    """A lost cycle of a period of four, and the start of chaos, are found where they are."""
    pattern = np.tile([50.0, 60.0, 40.0, 55.0], 60) + 0.05 * np.random.default_rng(8).normal(size=240)
    found = judge_peaks(np.delete(pattern, 100), sensor_sigma=0.05)
    assert (found.diagnosis.period, found.gaps) == (4, (101,))
    chaos = strong(np.random.default_rng(9), 240)
    found = judge_peaks(np.concatenate([pattern, chaos]), sensor_sigma=0.05)
    assert found.diagnosis.nature == "chaotic"
    assert abs(found.changes[0] - 241) <= 3


@pytest.mark.parametrize(
    ("series", "nature", "period"),
    [
        (logistic(3.2, 200), "periodic", 2),
        (logistic(3.5, 200), "periodic", 4),
        (logistic(3.83, 300), "periodic", 3),
        (logistic(3.7, 500), "chaotic", None),
        (logistic(4.0, 300), "chaotic", None),
        (2.0 + henon(500)[:, 0], "chaotic", None),
        (circle(0.5, (np.sqrt(5.0) - 1.0) / 2.0, 1200), "quasiperiodic", None),
        (circle(0.95, 0.5, 200), "periodic", 2),
        (5.0 + three_frequencies(1500), "quasiperiodic", None),
    ],
)
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_mathematical_series_stay_right(series, nature, period, noise):
    """Maps and tori, clean and with 0.1 % of noise, without a stated error."""
    noisy = series + noise * np.mean(np.abs(series)) * np.random.default_rng(3).normal(size=len(series))
    verdict = judge_peaks(noisy).diagnosis
    assert (verdict.nature, verdict.period) == (nature, period)


@pytest.mark.parametrize("size", [0, 7])
def test_short_records_are_refused(size):
    """Below 8 cycles there is no answer."""
    with pytest.raises(DiagnosisError, match="allowed: 8 or more"):
        judge_peaks(np.ones(size))


@pytest.mark.parametrize("error", [np.inf, np.nan, -1.0])
@pytest.mark.parametrize("kind", ["sensor_error", "sensor_sigma"])
def test_errors_that_are_none_are_refused(kind, error):
    """Neither infinity, nor nothing, nor a negative one."""
    with pytest.raises(DiagnosisError, match="out of range; allowed: 0 N or more"):
        judge_peaks(np.ones(20), **{kind: error})


def test_impossible_readings_are_refused():
    """1e308 N and what is not finite."""
    for value in (1e308, np.nan, np.inf):
        with pytest.raises(DiagnosisError, match="no force in newton"):
            judge_peaks(np.full(20, value))
        with pytest.raises(DiagnosisError, match="no reading in g; allowed: finite, up to"):
            judge_peaks(np.full(20, value), unit="g")


def test_readings_whose_squares_are_no_numbers_are_refused():
    """1e-320 N is no force; 1e-100 N is judged."""
    with pytest.raises(DiagnosisError, match="the largest reading is 1e-101 N; allowed: 0, or 1e-100 N and more"):
        judge_peaks(np.full(60, 1e-101))
    assert judge_peaks(np.tile([1e-100, 9e-101], 60)).diagnosis.nature != "chaotic"


def test_no_contact_is_said():
    """All zeros are no periodic response."""
    verdict = judge_peaks(np.zeros(50)).diagnosis
    assert verdict.nature == "undetermined"
    assert "no contact" in verdict.reason


def test_cycles_are_not_filled_into_chaos():
    """The delayed logistic map dwells near its fixed point; no gap is reported, and its map is found through 1 %."""
    x, y, series = 0.1, 0.2, []
    for _ in range(900):
        x, y = 2.27 * x * (1.0 - y), x
        series.append(x)
    peaks = 50.0 * (1.0 + 0.2 * (np.array(series[400:]) - 0.5) / 0.3)
    found = judge_peaks(peaks + 0.5 * np.random.default_rng(10).normal(size=500))
    assert found.gaps == ()
    assert found.diagnosis.nature == "chaotic"


def test_a_hum_is_no_period():
    """One line at a fifth of the speed over 64 cycles may be a hum, and is no period five; a pattern is."""
    rng = np.random.default_rng(11)
    hum = 50.0 + 2.0 * np.cos(2.0 * np.pi * 0.2003 * np.arange(64)) + 0.3 * rng.normal(size=64)
    assert judge_peaks(hum).diagnosis.nature == "undetermined"
    pattern = np.resize([40.0, 70.0, 60.0, 50.0, 55.0], 64) + 0.3 * rng.normal(size=64)
    assert judge_peaks(pattern).diagnosis.period == 5


@pytest.mark.parametrize(("period", "fraction"), [(1, 17 / 55), (4, 5 / 32), (7, 11 / 36)])
@pytest.mark.parametrize("sensor", [{}, {"sensor_sigma": 1.2}])
def test_a_hum_on_a_pattern_is_neither_a_long_period_nor_a_torus_nor_chaos(period, fraction, sensor):
    """A line near a fraction of the cycle, on a pattern: its period, or undetermined, whatever is stated."""
    rng = np.random.default_rng(13)
    pattern = np.resize(50.0 + 8.0 * rng.uniform(-1.0, 1.0, period), 1000)
    line = np.cos(2.0 * np.pi * fraction * (1.0 + 1e-6) * np.arange(1000))
    found = judge_peaks(pattern + 1.5 * line + 0.6 * rng.normal(size=1000), **sensor).diagnosis
    assert (found.nature, found.period) in (("undetermined", None), ("periodic", period))


def test_sizes_are_told_in_the_unit_of_the_readings():
    """No newton in what is said of an acceleration."""
    peaks = 3.0 + 0.02 * np.random.default_rng(12).normal(size=300)
    verdict = judge_peaks(peaks, unit="g")
    assert verdict.unit == "g"
    assert "scatter of 0.0193 g" in verdict.diagnosis.reason
    assert " N" not in verdict.diagnosis.reason


if __name__ == "__main__":
    for name, module, first in (("process", process_records, 7000), ("held out", held_out, 9000)):
        print(name)
        found, missed = judged(module, module.KINDS, range(first, first + int(sys.argv[1])))
        show(found)
        print(*missed, sep="\n")


def _logistic(parameter, seed, cycles=150):
    """Readings of a logistic map, with errors up to 0.4 N."""
    generator = np.random.default_rng(seed)
    x, found = generator.uniform(0.2, 0.8), []
    for _ in range(600 + cycles):
        x = parameter * x * (1.0 - x)
        found.append(x)
    return 50.0 + 80.0 * np.array(found[-cycles:]) + generator.uniform(-0.4, 0.4, cycles)


def test_a_pattern_that_was_left_before_is_periodic_under_a_condition():
    """Beside the tangent bifurcation at 3.8284 a pattern of three cycles is left and found again, for ever."""
    found = [judge_peaks(_logistic(3.8284, seed), sensor_error=0.4).diagnosis for seed in range(8)]
    left = [one for one in found if "does not leave its pattern again, as before cycle" in one.condition]
    assert left
    assert all((one.nature, one.period) == ("periodic", 3) for one in left)


def test_a_response_that_settles_did_not_leave_its_pattern():
    """A motion that dies out comes near its pattern once."""
    k = np.arange(200)
    for seed in range(12):
        generator = np.random.default_rng(seed)
        dying = 30.0 * generator.uniform(0.75, 0.9) ** k * np.cos(generator.uniform(0.0, np.pi) * k)
        verdict = judge_peaks(100.0 + dying + generator.uniform(-0.4, 0.4, 200), sensor_error=0.4).diagnosis
        assert "leave its pattern" not in verdict.condition


@pytest.mark.parametrize("stated", [{"sensor_error": 0.05}, {"sensor_sigma": 0.02}, {}])
@pytest.mark.parametrize("coarse", ["sampled", "rounded"])
def test_the_step_of_the_readings_is_no_sensor_error(coarse, stated):
    """Chaos of 0.4 N under a step of 1 N is never periodic without a condition, whatever error is stated."""
    chaos = logistic(3.9, 400)
    peaks = 100.0 + 0.4 * (chaos - chaos.mean()) / chaos.std()
    readings, step = (peaks, 0.5) if coarse == "sampled" else (np.round(peaks + 0.2), 0.0)
    found = judge_peaks(readings, resolution=step, **stated).diagnosis
    assert found.nature != "periodic" or found.condition


def test_a_step_beyond_the_stated_error_is_a_condition():
    """Noise of 0.4 N is periodic within a stated 0.4 N; beside 0.1 N a step of 0.5 N explains it under a condition."""
    peaks = 100.0 + np.random.default_rng(3).uniform(-0.4, 0.4, 400)
    assert judge_peaks(peaks, sensor_error=0.4, resolution=0.5).diagnosis.condition == ""
    found = judge_peaks(peaks, sensor_error=0.1, resolution=0.5).diagnosis
    assert found.words == "periodic, period 1, if the step of the readings adds 0.5 N to the stated 0.1 N"
    assert "random" in judge_peaks(peaks, resolution=0.5).diagnosis.condition


def laminar(start, cycles):
    """Type-I intermittency (Pomeau and Manneville 1980) at r = 3.8284, 20 N wide, from a start on."""
    x, found = start, np.empty(cycles)
    for cycle in range(cycles):
        x = 3.8284 * x * (1.0 - x)
        found[cycle] = 90.0 + 20.0 * x
    return found


@pytest.mark.parametrize("stated", [{"sensor_error": 0.4}, {"sensor_sigma": 0.25}, {}])
def test_a_pattern_after_a_burst_is_periodic_under_a_condition_only(stated):
    """Wherever a record of 100 or 300 cycles begins amid bursts, its laminar phases are no certain period three."""
    rng, bursts = np.random.default_rng(12), 0
    for cycles in (100, 300):
        for _ in range(3):
            series = laminar(rng.uniform(0.2, 0.9), 400 + cycles)[-cycles:]
            found = judge_peaks(series + rng.uniform(-0.4, 0.4, cycles), **stated).diagnosis
            burst = np.abs(series[3:] - series[:-3]).max() > 2.5
            bursts += burst
            assert not burst or found.nature != "periodic" or found.condition
    assert bursts >= 3


def test_a_response_that_nears_its_pattern_has_settled():
    """A deviation of 20 N that falls by a fifth a cycle is a way to period two, and asks for no condition."""
    time = np.arange(200)
    peaks = 100.0 + 5.0 * (-1.0) ** time + 20.0 * 0.8**time
    noise = np.random.default_rng(5).uniform(-0.4, 0.4, 200)
    assert judge_peaks(peaks + noise, sensor_error=0.4).diagnosis.words == "periodic, period 2"
