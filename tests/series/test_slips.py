"""Cycles that a recorder lost or wrote twice amid a torus: how many, and never a torus made of chaos."""

import os
from collections import Counter

import numpy as np
import pytest

from chaosgym.recordings.judge import judge_peaks
from chaosgym.series.slips import slips
from tests.recordings.unusual_records import make, torus_with_losses
from tests.series.maps import GOLDEN, circle, logistic


def lost(rng, cycles, share):
    """Cycles of so many readings before which a share is lost."""
    return np.sort(rng.choice(int(cycles / (1.0 - share)), cycles, replace=False))


@pytest.mark.parametrize("share", [0.01, 0.03])
def test_each_lost_cycle_of_a_torus_is_counted(share):
    """Two lines of 6 and 4 N, read to 0.4 N: as many cycles are lost as between the first reading and the last."""
    rng = np.random.default_rng(1)
    cycle = lost(rng, 400, share)
    series = 6.0 * np.cos(2.0 * np.pi * GOLDEN * cycle) + 4.0 * np.cos(2.0 * np.pi * 0.171 * cycle)
    found = slips(series + rng.uniform(-0.4, 0.4, 400))
    assert np.mean(found.cycle != cycle - cycle[0]) < 0.02, "two cycles may be as near to a reading"
    assert found.slipped == cycle[-1] - cycle[0] - 399
    assert found.rest.std() == pytest.approx(0.4 / np.sqrt(3.0), rel=0.1)


def test_cycles_that_are_written_twice_are_counted():
    """Of one line, six of 300 cycles are written twice."""
    cycle = np.sort(np.append(np.arange(294), np.arange(20, 294, 48)))
    found = slips(np.cos(2.0 * np.pi * GOLDEN * cycle))
    assert found.slipped == 6


@pytest.mark.parametrize("seed", range(3))
def test_a_torus_that_lost_cycles_is_no_chaos(seed):
    """A circle map below its critical coupling without 3 % of its cycles: quasiperiodic, if so many are lost."""
    rng = np.random.default_rng(seed)
    cycle = lost(rng, 1200, 0.03)
    series = circle(0.4, GOLDEN, int(cycle[-1]) + 1)[cycle]
    readings = 100.0 + 8.0 * (series - series.mean()) / series.std() + rng.uniform(-0.4, 0.4, 1200)
    found = judge_peaks(readings, sensor_error=0.4).diagnosis
    assert found.nature in ("quasiperiodic", "undetermined")
    if found.nature == "quasiperiodic":
        assert "cycles are lost or written twice" in found.condition
        assert found.evidence["slipped_cycles"] == pytest.approx(cycle[-1] - cycle[0] - 1199, abs=3)


@pytest.mark.parametrize("parameter", [3.6, 3.9])
def test_chaos_is_no_torus_that_lost_cycles(parameter):
    """The logistic map in two bands and in one, as it is and without 3 % of its cycles."""
    rng = np.random.default_rng(2)
    series = 100.0 + 30.0 * logistic(parameter, 700)
    for cycle in (np.arange(600), lost(rng, 600, 0.03)):
        found = judge_peaks(series[cycle] + rng.uniform(-0.4, 0.4, 600), sensor_error=0.4).diagnosis
        assert found.nature != "quasiperiodic"


def two_lines(rng, cycle):
    """Lines of 6 N and of 1.5 to 5 N."""
    low, high = 2.0 * np.pi * rng.uniform(0.05, 0.48, 2)
    return 6.0 * np.cos(low * cycle) + rng.uniform(1.5, 5.0) * np.cos(high * cycle + 1.0)


def circle_map(rng, cycle):
    """A circle map below its critical coupling, standard deviation 8 N."""
    series = circle(rng.uniform(0.2, 0.7), rng.uniform(0.1, 0.45), int(cycle[-1]) + 1)[cycle]
    return 8.0 * (series - series.mean()) / series.std()


RECORDS = int(os.environ.get("CHAOSGYM_TORI", "9"))
"""Records of each kind of torus."""

TORI = {
    "a line": lambda rng, cycle: 8.0 * np.cos(2.0 * np.pi * (rng.uniform(0.06, 0.47) * cycle + rng.random())),
    "two lines": two_lines,
    "a circle map": circle_map,
    "the golden mean": lambda rng, cycle: 8.0 * np.cos(2.0 * np.pi * GOLDEN * cycle),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", TORI)
def test_no_torus_that_lost_cycles_is_called_chaotic(name):
    """Records of 150, 400 and 1,200 readings without 1, 3, 6 % of the cycles; prints the natures."""
    natures = Counter()
    for seed in range(200, 200 + RECORDS):
        rng = np.random.default_rng([seed, list(TORI).index(name)])
        size, share = (150, 400, 1200)[seed % 3], (0.01, 0.03, 0.06)[seed // 3 % 3]
        readings = 100.0 + TORI[name](rng, lost(rng, size, share)) + rng.uniform(-0.4, 0.4, size)
        natures[judge_peaks(readings, sensor_error=None if seed % 2 else 0.4).diagnosis.nature] += 1
    print(name, dict(natures))
    assert natures["chaotic"] == 0


@pytest.mark.slow
def test_the_golden_mean_without_cycles_is_told_or_left_open():
    """The 36 records of seeds 100 to 135 of the unusual kinds; prints the natures."""
    natures = Counter()
    for seed in range(100, 136):
        peaks, stated, _ = make(torus_with_losses, seed)
        natures[judge_peaks(peaks, **stated).diagnosis.nature] += 1
    print(dict(natures))
    assert natures["chaotic"] == 0
