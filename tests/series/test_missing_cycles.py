"""Stand-ins for cycles that a recorder lost: where cycles are lost, and only there."""

import numpy as np
import pytest

from chaosgym.recordings.description import Sampled
from chaosgym.recordings.judge import judge_peaks
from chaosgym.series.missing_cycles import with_stand_ins


@pytest.mark.parametrize("period", [35.28, 34.8, 12.2])
def test_a_pattern_of_no_whole_number_of_cycles_has_lost_none(period):
    """Its phase drifts steadily against the nearest whole period, as that of a sampling beat."""
    phase = (np.arange(1000) / period) % 1.0
    values = 2.2 + 0.8 * phase + 0.01 * np.random.default_rng(1).normal(size=1000)
    whole, origin = with_stand_ins(values, round(period), 0.01)
    assert len(whole) == 1000
    assert (origin >= 0).all()


def test_ring_downs_that_sampling_beats_with_are_period_1():
    """A ring-down of 610 Hz a turn at 24.7 Hz, at 2 kHz with 0.02 g of noise: turns are alike but for the beat."""
    rng, each = np.random.default_rng(3), 2000.0 / 24.7
    starts = each * np.arange(980)
    peaks = []
    for start in starts:
        t = (np.arange(np.ceil(start), np.ceil(start + each)) - start) / 2000.0
        ring = 3.0 * np.exp(-0.04 * 2.0 * np.pi * 610.0 * t) * np.sin(2.0 * np.pi * 610.0 * t)
        peaks.append(np.max(ring + rng.normal(0.0, 0.02, len(t))))
    verdict = judge_peaks(np.array(peaks), sensor_error=0.05, sampled=Sampled(each, 24.7))
    assert verdict.diagnosis.words == "periodic, period 1"
    assert not verdict.gaps


def test_cycles_that_are_lost_by_chance_are_found():
    """Of a pattern of 7 cycles 20 of 1,000 are lost: each gets a stand-in at its place."""
    rng = np.random.default_rng(2)
    kept = np.setdiff1d(np.arange(1000), 1 + rng.choice(998, 20, False))
    pattern = 2.2 + 0.8 * rng.permutation(7) / 7.0
    values = np.resize(pattern, 1000)[kept] + 0.01 * rng.normal(size=len(kept))
    whole, origin = with_stand_ins(values, 7, 0.01)
    assert len(whole) == 1000
    np.testing.assert_array_equal(np.flatnonzero(origin >= 0), kept)
