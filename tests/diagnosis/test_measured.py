import numpy as np
import pytest

from chaosgym.diagnosis import cycles_of, read_peaks, read_series, two_step_test
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import simulate


def test_peaks_are_read_with_and_without_a_header(tmp_path):
    """One column, an optional header line, blank lines ignored."""
    (tmp_path / "a.csv").write_text("peak_force_N\n" + "\n".join(str(50 + i % 3) for i in range(60)) + "\n\n")
    (tmp_path / "b.csv").write_text("\n".join(str(50 + i % 3) for i in range(60)))
    peaks = read_peaks(tmp_path / "a.csv")
    assert np.array_equal(peaks, read_peaks(tmp_path / "b.csv"))
    assert two_step_test(peaks, sensor_error=0.1).period == 3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1\n2\n3\n", "3 data rows; allowed: 16"),
        ("\n".join(["50"] * 40), "dead sensor"),
        ("\n".join(["50", "51"] * 20 + ["nan"]), "'nan' in data row 41"),
        ("\n".join(["50", "51"] * 20 + ["oops"]), "'oops' in data row 41"),
        ("\n".join(["50,1", "51,2"] * 20), "2 columns"),
    ],
)
def test_unusable_peaks_are_refused(tmp_path, text, message):
    """Short, constant, NaN-ridden or malformed files: the error names file, row and rule."""
    (tmp_path / "bad.csv").write_text(text)
    with pytest.raises(DiagnosisError, match=message) as error:
        read_peaks(tmp_path / "bad.csv")
    assert "bad.csv" in str(error.value)
    with pytest.raises(DiagnosisError, match="can't be read"):
        read_peaks(tmp_path / "missing.csv")


def test_a_time_history_gives_the_peaks_and_section_of_its_cycles(tmp_path):
    """The beam's force history, sampled 400 times a cycle, gives the kernel's peaks and displacements back."""
    beam = ImpactBeam(excitation_frequency=10.0)
    record = simulate(beam, 40, transient=100, samples_per_cycle=400)
    force = cycles_of(record.time, record.history[..., 2].ravel(), beam.cycle_period)
    assert len(force.peak) == 40
    assert np.array_equal(force.peak, record.history[..., 2].max(axis=1))
    assert np.all(force.peak <= record.peak_force[:, 0])
    motion = cycles_of(record.time, record.history[..., 0].ravel(), beam.cycle_period)
    assert motion.section == pytest.approx(record.displacement, rel=1e-6)
    rows = "\n".join(f"{t},{x}" for t, x in zip(record.time, record.history[..., 0].ravel(), strict=True))
    (tmp_path / "series.csv").write_text("time_s,displacement_m\n" + rows)
    assert np.allclose(read_series(tmp_path / "series.csv", beam.cycle_period).section, motion.section)


def test_uneven_or_coarse_sampling_is_refused():
    """A gap in time, too few samples a cycle, too few cycles, unequal lengths, values that are not finite."""
    time = np.arange(2000) * 0.01
    values = np.sin(time)
    gap = np.concatenate([time[:500], time[500:] + 0.5])
    with pytest.raises(DiagnosisError, match=r"unevenly: 0\.51 s after sample 499"):
        cycles_of(gap, values, 0.2)
    with pytest.raises(DiagnosisError, match="samples a cycle"):
        cycles_of(time, values, 0.03)
    with pytest.raises(DiagnosisError, match="5 whole cycles"):
        cycles_of(time, values, 4.0)
    with pytest.raises(DiagnosisError, match="equal lengths"):
        cycles_of(time, values[1:], 0.2)
    with pytest.raises(DiagnosisError, match="sample 7"):
        cycles_of(time, np.where(np.arange(2000) == 7, np.nan, values), 0.2)
    with pytest.raises(DiagnosisError, match="period_s"):
        cycles_of(time, values, 0.0)
