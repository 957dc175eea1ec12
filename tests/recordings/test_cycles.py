"""Series are cut into cycles at equal phases, whatever the recorder did to their time stamps."""

import tracemalloc

import numpy as np
import pytest

from chaosgym.errors import DiagnosisError, ParameterError
from chaosgym.recordings.cycles import cycle_period, peaks_of_series
from chaosgym.recordings.judge import judge_peaks
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.read import read_recording

RATE, HZ = 12_800.0, 20.0
TIME = np.arange(0.0, 10.0, 1.0 / RATE)


def recording(tmp_path, columns, head, formats):
    """A CSV file of columns."""
    path = tmp_path / "series.csv"
    rows = zip(*columns, strict=True)
    path.write_text(head + "\n" + "\n".join(",".join(f % v for f, v in zip(formats, row, strict=True)) for row in rows))
    return read_recording(path)


SHAPES = {
    "sine": np.sin,
    "cosine": np.cos,
    "rectified sine": lambda angle: np.abs(np.sin(angle)),
    "half sine": lambda angle: np.maximum(np.sin(angle), 0.0),
    "half sine with a third harmonic": lambda angle: np.maximum(np.sin(angle) + 0.3 * np.sin(3.0 * angle), 0.0),
    "pulses": lambda angle: np.exp(-40.0 * (1.0 - np.cos(angle - 0.3))),
}


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("hz", [20.0, 19.37])
def test_a_repeating_series_is_periodic(shape, hz, tmp_path):
    """Every shape that repeats, written with time stamps in whole microseconds, has period 1 and its own amplitude."""
    value = 30.0 * SHAPES[shape](2.0 * np.pi * hz * TIME)
    found = recording(tmp_path, (TIME, value), "time [s],force [N]", ("%.6f", "%.9f"))
    _, cut = peaks_of_series(found, RecordingOptions(period=1.0 / hz))
    verdict = judge_peaks(cut.peaks, resolution=cut.resolution).diagnosis
    assert (verdict.nature, verdict.period) == ("periodic", 1)
    np.testing.assert_allclose(cut.peaks, np.abs(value).max(), rtol=2e-3)
    assert len(cut.peaks) >= int(10.0 * hz) - 1


def test_a_subharmonic_series_has_its_period(tmp_path):
    """Half the frequency of the cycle doubles the period: two amplitudes in turn."""
    value = np.maximum(np.sin(2.0 * np.pi * HZ * TIME), 0.0) * (1.0 + 0.3 * np.sign(np.sin(np.pi * HZ * TIME + 0.1)))
    found = recording(tmp_path, (TIME, value), "time [s],force [N]", ("%.6f", "%.9f"))
    _, cut = peaks_of_series(found, RecordingOptions(period=1.0 / HZ))
    assert judge_peaks(cut.peaks, resolution=cut.resolution).diagnosis.period == 2
    np.testing.assert_allclose(np.unique(np.round(cut.peaks, 2)), [0.7, 1.3])


def test_the_cycle_is_estimated_and_said_so(tmp_path):
    """The strongest line, refined between its bins, gives the cycle to 1e-4; the note says that it is an estimate."""
    value = (
        5.0
        + np.maximum(np.sin(2.0 * np.pi * 19.37 * TIME), 0.0)
        + 0.05 * np.random.default_rng(0).normal(size=len(TIME))
    )
    found = recording(tmp_path, (TIME, value), "time [s],force [N]", ("%.6f", "%.9f"))
    _, cut = peaks_of_series(found)
    assert cut.period == pytest.approx(1.0 / 19.37, rel=1e-4)
    assert any("estimated from the spectrum" in note for note in cut.notes)


def test_a_stated_cycle_beside_the_line_is_doubted(tmp_path):
    """0.2 % beside the line of the spectrum is said."""
    value = np.maximum(np.sin(2.0 * np.pi * HZ * TIME), 0.0)
    found = recording(tmp_path, (TIME, value), "time [s],force [N]", ("%.6f", "%.9f"))
    _, cut = peaks_of_series(found, RecordingOptions(period=0.0501))
    assert any("beside the stated" in note for note in cut.notes)
    _, cut = peaks_of_series(found, RecordingOptions(period=0.05))
    assert not cut.notes


def test_a_tachometer_gives_cycles_of_unequal_length(tmp_path):
    """A speed that wanders by 10 % is cut by the pulses: one peak a turn, and period 1."""
    turns = HZ * TIME + 0.5 * np.sin(2.0 * np.pi * 0.3 * TIME)
    value = 30.0 * np.exp(-40.0 * (1.0 - np.cos(2.0 * np.pi * turns - 2.0)))
    pulses = 5.0 * ((turns % 1.0) < 0.1)
    found = recording(tmp_path, (TIME, value, pulses), "time [s],force [N],tacho [V]", ("%.6f", "%.6f", "%.1f"))
    _, cut = peaks_of_series(found, RecordingOptions(tachometer="tacho"))
    assert len(cut.peaks) == pytest.approx(10.0 * HZ, abs=3)
    assert judge_peaks(cut.peaks, resolution=cut.resolution).diagnosis.period == 1


def test_a_gap_is_reported_with_its_line_and_its_cycles_left_out(tmp_path):
    """Samples 50,000 to 52,000 are missing: the phase goes on behind the gap."""
    value = 30.0 * np.maximum(np.sin(2.0 * np.pi * HZ * TIME), 0.0)
    kept = np.r_[0:50_000, 52_000 : len(TIME)]
    found = recording(tmp_path, (TIME[kept], value[kept]), "time [s],force [N]", ("%.6f", "%.6f"))
    _, cut = peaks_of_series(found, RecordingOptions(period=1.0 / HZ))
    assert any("line 50002" in note for note in cut.notes)
    assert any("cycles left out" in note for note in cut.notes)
    np.testing.assert_allclose(cut.peaks, 30.0, rtol=1e-3)


@pytest.mark.parametrize(
    ("stamps", "message"),
    [
        ([0.0, 0.1, 0.2, 0.35, 0.4, 0.5], "line 5.*unevenly"),
        ([0.0, 0.1, 0.05, 0.2, 0.3], "line 4: time does not rise"),
        (np.arange(100) * 0.1, "holds 5.0 samples"),
    ],
)
def test_series_that_cannot_be_cut_are_refused(stamps, message, tmp_path):
    """Uneven, falling or coarse time stamps end in an error with the line."""
    value = np.tile([1.0, 3.0, 2.0], 40)[: len(stamps)]
    found = recording(tmp_path, (stamps, value), "time [s],force [N]", ("%.4f", "%.3f"))
    with pytest.raises(DiagnosisError, match=message):
        peaks_of_series(found, RecordingOptions(period=0.5))


@pytest.mark.parametrize("text", ["1200 rpm", "20 Hz", "0.02 kHz", "50 ms", "0.05s"])
def test_a_cycle_is_stated_by_its_speed_or_its_time(text):
    """Turns a minute, cycles a second or the time of one."""
    assert cycle_period(text) == pytest.approx(0.05, rel=1e-15)


@pytest.mark.parametrize(
    ("text", "why"), [("20", "no unit"), ("0 Hz", "above 0"), ("-3 s", "above 0"), ("3 N", "unit")]
)
def test_a_cycle_without_unit_or_size_is_refused(text, why):
    """The message says what is allowed."""
    with pytest.raises(ParameterError, match=why):
        cycle_period(text)


def test_a_reading_that_alternates_with_every_sample_is_too_coarse(tmp_path):
    """Its line is at half the sampling rate: two samples a cycle."""
    np.save(tmp_path / "n.npy", np.tile([0.0, 1.0], 200))
    with pytest.raises(DiagnosisError, match=r"a cycle of 2 ms holds 2.0 samples; allowed: at least 8"):
        peaks_of_series(read_recording(tmp_path / "n.npy"), RecordingOptions(rate_hz=1000.0))


def test_the_cycle_of_a_long_series_is_that_of_all_of_it(tmp_path):
    """Three million samples, 19.3712 Hz beside the impacts' ringing at 310 Hz: the line of means over the whole record.

    A stated cycle 0.05 % beside it is doubted, as in a short one.
    """
    time, hz = np.arange(3_000_000) / 20_000.0, 19.3712
    value = 40.0 * np.maximum(np.sin(2.0 * np.pi * hz * time), 0.0) ** 5 * np.cos(2.0 * np.pi * 310.0 * time) ** 2
    np.save(tmp_path / "long.npy", (value + np.random.default_rng(1).normal(0.0, 0.1, len(time))).astype(np.float32))
    found = read_recording(tmp_path / "long.npy")
    _, cut = peaks_of_series(found, RecordingOptions(rate_hz=20_000.0))
    assert cut.period * hz == pytest.approx(1.0, abs=3e-7)
    _, cut = peaks_of_series(found, RecordingOptions(rate_hz=20_000.0, period=1.0005 / hz))
    assert any("beside the stated" in note for note in cut.notes)


def test_a_series_needs_less_than_three_times_its_file(tmp_path):
    """Six million readings in single precision, from the file to the peaks."""
    value = 30.0 * np.maximum(np.sin(0.01 * np.arange(6_000_000)), 0.0)
    np.save(tmp_path / "long.npy", value.astype(np.float32))
    del value
    tracemalloc.start()
    try:
        peaks_of_series(
            read_recording(tmp_path / "long.npy"), RecordingOptions(rate_hz=10_000.0, period=2.0 * np.pi / 100.0)
        )
        held = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert held < 2.7 * (tmp_path / "long.npy").stat().st_size
