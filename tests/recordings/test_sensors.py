"""Two sensors on one machine: chaos that one of them hides, and no random process taken for it.

``python -m tests.recordings.test_sensors 8 "chaotic beam"`` prints what one sensor and both tell of eight pairs of a
kind, or of all kinds: right, wrong, undetermined, hidden in the noise.
"""

import sys

import numpy as np
import pytest

from chaosgym import SliderCrank, diagnose, judge_peaks, simulate
from chaosgym.errors import DiagnosisError
from chaosgym.series.determinism import determinism, surrogate
from tests.plain_modes import HARD_BEAM
from tests.recordings import pairs
from tests.recordings.process_records import answer
from tests.series.maps import henon, logistic


def counted(kinds, seeds):
    """Answers of one sensor and of both, by ``(kind, sensors, answer)``; those that are wrong."""
    counts, wrong = {}, []
    for kind in kinds:
        for seed in seeds:
            pair = pairs.make(kind, seed)
            for sensors, peaks in ((1, pair.peaks[:, seed % 2]), (2, pair.peaks)):
                verdict = judge_peaks(peaks, **pair.stated)
                found = answer(pair, verdict)
                counts[kind, sensors, found] = counts.get((kind, sensors, found), 0) + 1
                if found.startswith("wrong"):
                    wrong.append((kind, seed, sensors, pair.nature, verdict.diagnosis.words, verdict.diagnosis.reason))
    return counts, wrong


@pytest.fixture(scope="module")
def chaos():
    """Both surfaces of a chaotic beam (hard pivot, 30 Hz, 0.127 mm) over 500 cycles, with noise of 0.1 %, (500, 2)."""
    peaks = simulate(HARD_BEAM, 500, transient=200).peak_force
    return peaks * (1.0 + 1e-3 * np.random.default_rng(0).normal(size=peaks.shape))


def test_chaos_that_hides_from_one_surface_shows_in_two(chaos):
    """Either surface alone can't tell; the maps of both together are chaotic, an error stated or not."""
    for told in ({}, {"sensor_error": 1.0}):
        assert judge_peaks(chaos[:, 0], **told).diagnosis.nature == "undetermined"
    assert judge_peaks(chaos[:, 1]).diagnosis.nature == "undetermined"
    assert judge_peaks(chaos, sensor_error=1.0).diagnosis.nature == "chaotic"


def test_the_order_of_the_surfaces_does_not_matter(chaos):
    """Columns may be turned round: the order within the cycle is found, as that of the columns as they are is above."""
    assert judge_peaks(chaos[:, ::-1]).diagnosis.nature == "chaotic"


def test_shuffled_cycles_of_chaos_are_not_chaotic(chaos):
    """The same rows in a random order are a random process of the same distribution at both sensors."""
    rows = np.random.default_rng(1).permutation(len(chaos))
    assert judge_peaks(chaos[rows]).diagnosis.nature == "undetermined"


@pytest.mark.parametrize("curve", [np.square, np.exp, np.abs])
def test_a_curved_copy_of_noise_is_no_chaos(curve):
    """A second sensor that is a function of the first is forecast exactly, and says nothing of the past."""
    noise = np.random.default_rng(2).normal(size=600)
    made = 50.0 + 3.0 * np.column_stack([noise, curve(noise)])
    assert judge_peaks(made).diagnosis.nature != "chaotic"


def test_sensors_that_repeat_have_the_common_period():
    """Period two at one sensor and three at the other: the machine repeats every six cycles."""
    noise = 0.05 * np.random.default_rng(3).normal(size=(300, 2))
    table = noise + np.column_stack([np.resize([40.0, 60.0], 300), np.resize([50.0, 70.0, 55.0], 300)])
    found = judge_peaks(table, sensor_sigma=0.05).diagnosis
    assert (found.nature, found.period) == ("periodic", 6)


def test_sensors_that_contradict_each_other_decide_nothing(chaos):
    """A periodic and an irregular sensor: the verdict names both."""
    table = np.column_stack([np.full(500, 50.0), chaos[:, 0]])
    found = judge_peaks(table).diagnosis
    assert found.nature == "undetermined"
    assert found.reason == "the sensors do not agree: sensor 1: periodic, period 1; sensor 2: undetermined"


def test_a_surface_that_is_never_touched_does_not_count():
    """Zeros at one surface leave the verdict of the other."""
    peaks = np.tile([40.0, 60.0], 100)
    assert judge_peaks(np.column_stack([peaks, np.zeros(200)])).diagnosis.period == 2
    assert judge_peaks(np.zeros((50, 2))).diagnosis.nature == "undetermined"


@pytest.mark.parametrize("shape", [(20, 0), (20, 2, 2)])
def test_tables_of_another_shape_are_refused(shape):
    """One row a cycle, one column a sensor."""
    with pytest.raises(DiagnosisError, match="allowed: \\(cycles,\\) or \\(cycles, sensors\\)"):
        judge_peaks(np.ones(shape))


def test_surrogates_of_two_sensors_keep_their_cross_spectrum():
    """Prichard and Theiler (1994): each reading is kept, and so is the correlation of the sensors at every lag."""
    rng = np.random.default_rng(4)
    first = np.convolve(rng.normal(size=700), np.ones(4), "valid")[:600]
    series = np.column_stack([first, np.roll(first, 2) + 0.3 * rng.normal(size=600)])
    made = surrogate(series, rng)
    np.testing.assert_array_equal(np.sort(made, axis=0), np.sort(series, axis=0))

    def crossed(table):
        levelled = (table - table.mean(axis=0)) / table.std(axis=0)
        return np.array([np.mean(levelled[:, 0] * np.roll(levelled[:, 1], -lag)) for lag in range(-8, 9)])

    np.testing.assert_allclose(crossed(made), crossed(series), atol=0.03)
    alone = np.column_stack([surrogate(one[:, None], rng) for one in series.T])
    assert np.max(np.abs(crossed(alone) - crossed(series))) > 0.3
    assert not np.array_equal(made, series)


def test_surrogates_do_not_depend_on_the_unit():
    """In another unit, a power of two so that no rounding differs, a record has the same surrogates."""
    series = np.random.default_rng(6).normal(size=(300, 2))
    plain, small = (surrogate(scale * series, np.random.default_rng(7)) for scale in (1.0, 2.0**-30))
    np.testing.assert_array_equal(2.0**30 * small, plain)


def test_the_sensor_that_shows_chaos_is_named():
    """Of two readings of one chaotic map the first decides, and the reason says so."""
    chaotic = 100.0 + 10.0 * logistic(3.9, 500)
    verdict = judge_peaks(np.column_stack([chaotic, 2.0 * chaotic]), sensor_error=1e-3)
    assert verdict.diagnosis.nature == "chaotic"
    assert verdict.diagnosis.reason.startswith("sensor 1: ")


def test_both_coordinates_of_the_henon_map_have_its_exponent():
    """0.419 a cycle (Sprott 2003) from the pair x, and x times y, over a cycle of two readings."""
    points = henon(1000)
    table = np.column_stack([points[:, 0], points[:, 0] * points[:, 1]])
    noisy = table + 1e-4 * np.random.default_rng(5).normal(size=table.shape)
    low, middle = determinism(noisy).exponent
    assert middle == pytest.approx(0.419, rel=0.1)
    assert 0.0 < low <= middle


def test_small_scatter_of_a_chaotic_surface_is_periodic_under_a_condition_only():
    """A crank whose lower surface scatters by 0.8 % like noise: "if it is random", and both surfaces can't tell."""
    crank = SliderCrank(crank_speed=153.6, slider_clearance=7.7e-5)
    assert diagnose(crank, budget=800).nature == "chaotic"
    peaks = simulate(crank, 256, transient=400).peak_force
    noisy = peaks * (1.0 + 1e-3 * np.random.default_rng(6).normal(size=peaks.shape))
    for told in ({}, {"sensor_sigma": 1e-3 * float(peaks.mean())}):
        found = judge_peaks(noisy[:, 1], **told)
        share = 100.0 * found.coefficient_of_variation
        assert found.diagnosis.words == f"periodic, period 1, if its scatter of {share:.2g} % is random"
        assert judge_peaks(noisy, **told).diagnosis.nature == "undetermined"
    assert judge_peaks(noisy[:, 1], sensor_sigma=found.scatter).diagnosis.words == "periodic, period 1"


def test_a_sensor_that_repeats_if_its_scatter_is_random_does_not_contradict_chaos(chaos):
    """Small noise at one sensor and chaos at both surfaces: chaotic; a surface that repeats exactly contradicts."""
    calm = 50.0 + 0.3 * np.random.default_rng(7).normal(size=len(chaos))
    logistic_peaks = 50.0 + 5.0 * logistic(3.9, len(chaos))
    assert judge_peaks(calm).diagnosis.condition
    assert judge_peaks(np.column_stack([calm, logistic_peaks])).diagnosis.nature == "chaotic"
    assert judge_peaks(np.column_stack([calm, logistic_peaks]), sensor_sigma=0.3).diagnosis.nature == "undetermined"


@pytest.mark.slow
def test_surfaces_of_chaotic_cranks_that_scatter_little_are_never_periodic_for_certain():
    """Of 40 chaotic cranks a quarter of the surfaces scatter by less than 1.5 %: none is periodic without "if"."""
    rng, told = np.random.default_rng(4711), []
    for _ in range(40):
        while True:
            crank = SliderCrank(crank_speed=rng.uniform(120.0, 270.0), slider_clearance=rng.uniform(3e-5, 2.5e-4))
            if diagnose(crank, budget=800).nature == "chaotic":
                break
        for peaks in simulate(crank, 500, transient=400).peak_force.T:
            if 1e-3 < np.std(peaks) / np.mean(peaks) < 0.015:
                told.append(judge_peaks(peaks * (1.0 + 1e-3 * rng.normal(size=500))).diagnosis)
    print(f"{len(told)} of 80 surfaces:", *sorted(one.words for one in told), sep="\n")
    assert len(told) >= 10
    assert all(one.condition for one in told if one.nature == "periodic")


def show(counts):
    """Print a line a kind, and the shares of all."""
    for kind in [*dict.fromkeys(kind for kind, _, _ in counts), ""]:
        row = []
        for sensors in (1, 2):
            of = {key: n for key, n in counts.items() if key[1] == sensors and kind in ("", key[0])}
            names = ("right", "right, if", "wrong", "wrong, if", "undetermined", "within")
            row += [str(sum(n for key, n in of.items() if key[2] == name)) for name in names]
        print("|", " | ".join([kind or "all", *row]), "|")


if __name__ == "__main__":
    table, missed = counted(sys.argv[2:] or pairs.KINDS, range(int(sys.argv[1])))
    show(table)
    print(*missed, sep="\n")
