"""Figures of short records: what repeats, what is refused, and how periods show through noise."""

import numpy as np
import pytest

from chaosgym.classifier.features import (
    MAX_CYCLES,
    RECORD_FEATURES,
    as_records,
    least_scatter,
    record_amplitude,
    repeat_period,
)
from chaosgym.errors import DiagnosisError
from chaosgym.series.stroboscopic import noisy_class_residuals
from tests.classifier.made_up import record_features, settled


def figure(record, name, **given):
    """One figure of one record."""
    return record_features([record], **given)[0, RECORD_FEATURES.index(name)]


def test_figures_have_no_unit_but_the_level():
    """Newton or pounds: every figure but the level of the force is the same."""
    record = settled(3.9, 50)
    change = record_features([record], sensor_error=1.0) - record_features([record / 4.448], sensor_error=1.0 / 4.448)
    moved = [name for name, gap in zip(RECORD_FEATURES, change[0], strict=True) if abs(gap) > 1e-3]
    assert moved == ["level"]


def test_period_four_repeats_after_four_cycles():
    """A period-4 record of the logistic map has a residual of zero at 4 cycles; chaos has none near it."""
    assert figure(settled(3.5), "repeat period") == 4
    assert figure(settled(3.5), "repeat residual") < -5.0
    assert figure(settled(3.9), "repeat residual") > np.log10(0.05)


def test_rounding_to_single_precision_is_no_figure():
    """A record in double precision has the figures of the same record in single precision, as signals are kept."""
    for rate in (2.6, 3.2, 3.9):
        record = settled(rate, 50)
        np.testing.assert_array_equal(record_features([record]), record_features([record.astype(np.float32)]))


def test_amplitude_is_the_half_range_of_an_even_scatter():
    """Noise of +-2 N on a period of 2 has an amplitude of 2 N; the rule never sees more in it than there is."""
    generator = np.random.default_rng(1)
    records = settled(3.2, 64) + generator.uniform(-2.0, 2.0, (200, 64))
    assert np.median(record_amplitude(as_records(records)[0])) == pytest.approx(2.0, rel=0.1)
    assert np.mean([least_scatter(record) > 2.0 for record in records]) < 0.02
    assert least_scatter(settled(3.9, 64)) > 5.0


def test_the_compiled_rule_is_that_of_the_diagnosis():
    """``least_scatter`` equals the residual that the Two-Step Test compares with a sensor's error."""
    for rate in (2.6, 3.2, 3.9):
        record = settled(rate, 50)
        assert least_scatter(record) == pytest.approx(
            noisy_class_residuals(record[:, None], 12).min(), rel=1e-12, abs=1e-12
        )


def test_exponential_approach_gives_its_rate():
    """Peaks that approach a level by a factor 0.8 a cycle have an approach rate of log 0.8."""
    record = 30.0 + 5.0 * 0.8 ** np.arange(20)
    assert figure(record, "approach rate") == pytest.approx(np.log(0.8), abs=1e-3)


def test_padding_and_length_do_not_matter():
    """NaN after the end changes nothing, and of more than 64 cycles the last 64 count."""
    record = settled(3.9, 100)
    padded = np.full(MAX_CYCLES, np.nan)
    padded[:20] = record[:20]
    np.testing.assert_array_equal(record_features([padded]), record_features([record[:20]]))
    np.testing.assert_array_equal(record_features([record]), record_features([record[-64:]]))


@pytest.mark.parametrize(("rate", "period"), [(2.8, 1), (3.2, 2), (3.5, 4)])
def test_period_shows_through_noise(rate, period):
    """With 1 % noise on 40 cycles the period is found in at least 18 records of 20."""
    generator = np.random.default_rng(4)
    found = [repeat_period(settled(rate, 40) * (1.0 + 0.01 * generator.standard_normal(40))) for _ in range(20)]
    assert found.count(period) >= 18


@pytest.mark.parametrize(
    ("record", "message"),
    [
        (np.ones(7), "7 cycles; allowed: 8 or more"),
        (np.r_[np.ones(10), -1.0], "a negative force"),
        (np.r_[np.ones(10), np.inf], "not finite"),
        (np.r_[np.ones(5), np.nan, np.ones(5)], "NaN between its cycles"),
    ],
)
def test_bad_records_are_named(record, message):
    """Too short, negative, infinite or broken records are errors and no figures."""
    with pytest.raises(DiagnosisError, match=message):
        record_features([record])
