"""One verdict on measured peaks: right, or an honest "can't tell", whatever sensor and recorder did to them."""

import numpy as np
import pytest

from chaosgym.diagnosis.measured import judge_peaks
from chaosgym.errors import DiagnosisError
from tests.diagnosis.maps import circle, henon, logistic, three_frequencies
from tests.diagnosis.records import KINDS, make, strong, table

SEEDS = range(7000, 7042)
"""Seeds of the full table; thresholds were set on seeds below 4000."""


ANSWERS = ("right", "wrong", "undetermined")
"""Columns of the table."""


def totals(counts, clear):
    """Records by answer."""
    found = {"right": 0, "wrong": 0, "undetermined": 0, "within": 0}
    for (_, where, answer), count in counts.items():
        if where == clear:
            found[answer] += count
    return found


def check(counts, wrong):
    """No confident error above 1 % of all records, at most 10 % undetermined away from boundaries."""
    clear, edge = totals(counts, True), totals(counts, False)
    print("| kind | right | wrong | undetermined | at a boundary: right | wrong | undetermined |")
    for kind in dict.fromkeys(kind for kind, _, _ in counts):
        columns = [counts.get((kind, where, what), 0) for where in (True, False) for what in ANSWERS]
        print("|", " | ".join(map(str, [kind, *columns])), "|")
    print(f"away from boundaries {clear}, at boundaries {edge}")
    told = [(seed, record.kind, verdict.diagnosis.reason) for seed, record, verdict in wrong]
    assert clear["wrong"] + edge["wrong"] <= 0.01 * sum(counts.values()), told
    assert clear["undetermined"] <= 0.1 * sum(clear.values())
    assert clear["right"] >= 0.89 * sum(clear.values())


def test_records_of_known_nature_are_judged_rightly():
    """Three records of every kind but the cranks: at most 1 % wrong, at most 10 % undetermined where it is clear."""
    kinds = [kind for kind in KINDS if kind != "simulated crank"]
    check(*table(SEEDS[:3], kinds))


@pytest.mark.slow
def test_five_hundred_records_are_judged_rightly():
    """504 records, 42 of each kind: at most 1 % wrong, at most 10 % undetermined away from boundaries."""
    check(*table(SEEDS))


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("kind", ["periodic", "strong chaos", "drift", "simulated beam"])
def test_one_wrong_reading_changes_no_verdict(kind, seed):
    """One reading in a hundred cycles, half as large again, leaves nature and period, and is reported."""
    tried = (make(kind, 8000 + 100 * seed + k) for k in range(100))
    record = next(one for one in tried if len(one.peaks) >= 100 and one.clear)
    spoilt = record.peaks.copy()
    place = 20 + 7 * seed
    spoilt[place] += np.ptp(record.peaks) + 0.5 * np.max(record.peaks)
    before, after = (judge_peaks(peaks, **record.stated) for peaks in (record.peaks, spoilt))
    assert (before.diagnosis.nature, before.diagnosis.period) == (after.diagnosis.nature, after.diagnosis.period)
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
    """24 cycles with a scatter of 1 % are undetermined, and the verdict asks for the sensor's error."""
    verdict = judge_peaks(48.9 + 0.489 * np.random.default_rng(6).normal(size=24)).diagnosis
    assert verdict.nature == "undetermined"
    assert "could be sensor or machine; state the sensor's error" in verdict.reason


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
    with pytest.raises(DiagnosisError, match="finite, 0 or more"):
        judge_peaks(np.ones(20), **{kind: error})


def test_impossible_readings_are_refused():
    """1e308 N and what is not finite."""
    for value in (1e308, np.nan, np.inf):
        with pytest.raises(DiagnosisError, match="no force in newton"):
            judge_peaks(np.full(20, value))


def test_no_contact_is_said():
    """All zeros are no periodic response."""
    verdict = judge_peaks(np.zeros(50)).diagnosis
    assert verdict.nature == "undetermined"
    assert "no contact" in verdict.reason
