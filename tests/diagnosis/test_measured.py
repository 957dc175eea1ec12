"""Measured signals: cut into periods correctly, refused when they can't be judged."""

import numpy as np
import pytest

from chaosgym.diagnosis import two_step_test
from chaosgym.diagnosis.measured import read_columns, samples_per_period
from chaosgym.errors import DiagnosisError


def test_a_series_is_cut_at_equal_phases():
    """A subharmonic sine of twice the period gives two alternating samples a cycle, judged periodic with period 2."""
    time = np.arange(0.0, 60.0, 0.01)
    samples = samples_per_period(time, 3.0 + np.sin(np.pi * time) + 0.2 * np.sin(2 * np.pi * time), 1.0)
    assert samples.shape == (59, 2)
    np.testing.assert_allclose(samples[:, 0], 3.0, atol=1e-9)
    verdict = two_step_test(samples, sensor_error=1e-3)
    assert (verdict.nature, verdict.period) == ("periodic", 2)


def test_largest_value_is_that_of_its_own_period():
    """Each period's maximum counts once, in its own row."""
    time = np.arange(0.0, 3.0, 0.01)
    value = np.where(np.isclose(time, 1.5), 7.0, 1.0)
    assert samples_per_period(time, value, 1.0)[:, 1].tolist() == [1.0, 7.0]


@pytest.mark.parametrize(
    ("time", "period", "message"),
    [
        ([0.0, 0.1, 0.3, 0.4], 0.2, "unevenly"),
        ([0.0, -0.1, -0.2], 0.2, "unevenly"),
        (np.arange(100) * 0.1, 0.5, r"holds 5\.0 samples"),
        (np.arange(100) * 0.1, 20.0, "less than one period"),
        (np.arange(100) * 0.1, 0.0, "above 0"),
    ],
)
def test_series_that_cannot_be_cut_are_refused(time, period, message):
    """Uneven, coarse or short series end in an error that says why."""
    with pytest.raises(DiagnosisError, match=message):
        samples_per_period(time, np.ones(len(time)), period)


@pytest.mark.parametrize(
    ("text", "columns", "message"),
    [
        ("1\n2\nx\n", 1, r"line 3: 'x' is not a number"),
        ("1\nnan\n", 1, r"line 2: 'nan' is not finite"),
        ("1,2\n", 1, r"line 1 has 2 columns; allowed: 1"),
        ("peak force [N]\n", 1, "no numbers"),
    ],
)
def test_bad_files_name_the_line(tmp_path, text, columns, message):
    """A file that is not a column of finite numbers is refused with its line."""
    path = tmp_path / "peaks.csv"
    path.write_text(text)
    with pytest.raises(DiagnosisError, match=message):
        read_columns(path, columns)


def test_a_header_is_skipped(tmp_path):
    """The first line may name the column."""
    path = tmp_path / "peaks.csv"
    path.write_text("peak force [N]\n1.5\n2.5\n")
    assert read_columns(path, 1).tolist() == [[1.5], [2.5]]


def test_a_short_noisy_record_says_which_periods_it_can_show():
    """With a sensor error 19 cycles of period 2 are too few, and the verdict says so; 40 are enough."""
    short = two_step_test(np.tile([4.0, 3.0], 10)[:19], sensor_error=1e-3)
    assert short.nature == "undetermined"
    assert "19 cycles show periods up to 1 only" in short.reason
    assert two_step_test(np.tile([4.0, 3.0], 20), sensor_error=1e-3).period == 2
