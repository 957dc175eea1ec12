"""Clocks of recorders are read right, or asked about: a wrong rate makes every cycle and every speed wrong."""

import re

import numpy as np
import pytest
from scipy.io import savemat

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.columns import is_clock
from chaosgym.recordings.cycles import peaks_of_series, series_of
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.read import read_recording
from chaosgym.recordings.sampling import sampling
from chaosgym.units import duration

RATE, COUNT = 1000.0, 6000
FORCE = np.round(20.0 + 15.0 * np.maximum(np.sin(2.0 * np.pi * 20.0 * np.arange(COUNT) / RATE), 0.0), 4)


def series(tmp_path, heading, row, count=COUNT):
    """A text whose rows are written by a function of the number and the force."""
    path = tmp_path / "series.csv"
    path.write_text(heading + "".join(row(k, x) + "\n" for k, x in enumerate(FORCE[:count])))
    return read_recording(path)


CLOCKS = {
    "millis() of a microcontroller": ("millis,force\n", lambda k, x: f"{1234 + k},{x}"),
    "millis() with tabs": ("Millis\tForce [N]\n", lambda k, x: f"{1234 + k}\t{x}"),
    "ms": ("ms;force\n", lambda k, x: f"{7 + k};{x}"),
    "micros()": ("micros,force\n", lambda k, x: f"{88_000 + 1000 * k},{x}"),
    "t_us": ("t_us,force\n", lambda k, x: f"{88_000 + 1000 * k},{x}"),
    "time_millis": ("time_millis,force\n", lambda k, x: f"{k},{x}"),
    "milliseconds since 1970": ("timestamp,force\n", lambda k, x: f"{1_649_770_330_000 + k},{x}"),
    "microseconds since 1970": ("timestamp,force\n", lambda k, x: f"{1_649_770_330_000_000 + 1000 * k},{x}"),
    "nanoseconds since 1970": ("time,force\n", lambda k, x: f"{1_649_770_330_000_000_000 + 1_000_000 * k},{x}"),
    "seconds since 1970": ("time,force\n", lambda k, x: f"{1_649_770_330 + k / RATE:.3f},{x}"),
    "whole seconds": ("time,force\n", lambda k, x: f"13:32:{10 + k // 1000},{x}"),
    "whole seconds, begun amid one": ("time,force\n", lambda k, x: f"13:32:{10 + (k + 700) // 1000},{x}"),
    "whole seconds since 1970": ("time,force\n", lambda k, x: f"{1_649_770_330 + (k + 300) // 1000},{x}"),
    "stamps of 10 ms": ("Time [s],Force [N]\n", lambda k, x: f"{(k + 3) // 10 / 100:.2f},{x}"),
    "a rate that tells the unit": ("Sample rate: 1000 Hz\ntime,force\n", lambda k, x: f"{k},{x}"),
    "Graphtec GL820": (
        "Vendor,GRAPHTEC Corporation\nModel,GL820\nVersion,Ver1.12\nSampling,1ms\nTotal data points,6000       \n"
        "Start time,2022-04-12,13:32:10\nEnd time,2022-04-12,13:32:16\nTrigger time,2022-04-12,13:32:10\nAMP Settings\n"
        'CH,Signal name,Input,Range,Filter,Span\nCH1, " CH 1",DC,1V,Off,1.000000,0.000000,V\nLogic/Pulse,Off\nData\n'
        "Number,Date&Time,ms,CH1,Alarm1-10,Alarm11-20,AlarmOut\nNO.,Time,ms,V,A1234567890,A1234567890,A1234\n",
        lambda k, x: f"{k + 1},2022/04/12 13:32:{10 + k // 1000},{k % 1000:03d},{x:+},LLLLLLLLLL,LLLLLLLLLL,LLLL",
    ),
}


@pytest.mark.parametrize("clock", CLOCKS)
def test_clocks_give_the_rate(clock, tmp_path):
    """1 kHz within 0.1 %, and the cycle of 50 ms, whatever the clock counts in."""
    recording = series(tmp_path, *CLOCKS[clock])
    signal, cut = peaks_of_series(recording)
    assert sampling(recording, COUNT).step * RATE == pytest.approx(1.0, rel=1e-3)
    assert cut.period == pytest.approx(0.05, rel=1e-3)
    assert re.search(r"; (6|5\.99\d*) s at [\d.]+ Hz by column '", signal.described)


@pytest.mark.parametrize(
    ("heading", "row", "message"),
    [
        ("time,force\n", lambda k, x: f"{50 * k},{x}", "rises in steps of 50 without a unit; .*20 if these are milli"),
        ("time,force\n", lambda k, x: f"{0.5 * k},{x}", "rises in steps of 0.5 without a unit; .*2000 if these are"),
        ("Sample rate: 500 Hz\ntime,force\n", lambda k, x: f"{k / RATE:.3f},{x}", "of 0.001 .*the file states 500 Hz"),
        (
            "time,force\n",
            lambda k, x: f"13:32:{10 + k // 3000},{x}",
            "too coarse to tell samples apart; use --read rate-hz",
        ),
        ("time,force\n", lambda k, x: f"{1_000_000_000 + 500 * k},{x}", "in steps of 500 without a unit"),
        (
            "time,force\n",
            lambda k, x: f"13:32:{10 + (k // 500 if k < 2000 else 2 + k // 1000)},{x}",
            "samples within 1 s",
        ),
    ],
)
def test_clocks_that_cannot_be_told_are_a_question(heading, row, message, tmp_path):
    """One line that says what is open, and the option that answers it."""
    recording = series(tmp_path, heading, row)
    with pytest.raises(DiagnosisError, match=message) as error:
        peaks_of_series(recording)
    assert "\n" not in str(error.value)
    signal, cut = peaks_of_series(recording, RecordingOptions(rate_hz=RATE))
    assert signal.described.endswith("; 6 s at 1000 Hz as stated")
    assert cut.period == pytest.approx(0.05, rel=1e-3)


def test_a_stated_rate_that_contradicts_the_file_is_said(tmp_path):
    """A rate of 500 Hz over stamps of 1000 Hz doubles every time: who stated it reads what the file says."""
    recording = series(tmp_path, "time [s],force\n", lambda k, x: f"{k / RATE:.4f},{x}")
    signal, _ = peaks_of_series(recording, RecordingOptions(rate_hz=0.5 * RATE))
    assert signal.described.endswith("at 500 Hz as stated, instead of 1000 Hz by column 'time' [s]")
    assert peaks_of_series(recording, RecordingOptions(rate_hz=RATE))[0].described.endswith("at 1000 Hz as stated")


def test_two_rates_of_a_file_are_a_question(tmp_path):
    """The bearing set of the MFPT society: ``sr`` is the sampling rate, ``rate`` that of the shaft."""
    path = tmp_path / "baseline_1.mat"
    savemat(path, {"bearing": {"gs": FORCE[:, None], "sr": 97656.0, "rate": 25.0, "load": 270.0}})
    recording = read_recording(path)
    with pytest.raises(
        DiagnosisError, match=r"several rates: bearing.sr = 97656 Hz, bearing.rate = 25 Hz; use --read rate-hz"
    ):
        peaks_of_series(recording)
    assert peaks_of_series(recording, RecordingOptions(rate_hz=97656.0))[0].described.endswith("at 97656 Hz as stated")


def test_rates_that_agree_are_no_question(tmp_path):
    """A rate and its interval; the line that is read says which."""
    path = tmp_path / "a.mat"
    savemat(path, {"force": FORCE, "Fs": RATE, "dt": 1.0 / RATE})
    signal, _, _ = series_of(read_recording(path))
    assert signal.described.endswith("; 6 s at 1000 Hz by 'Fs'")


def test_a_signal_may_end_in_time_and_a_speed_beside_it_is_offered(tmp_path):
    """The bearing data of Case Western Reserve University: ``X097_DE_time`` is the accelerometer at the drive end."""
    path = tmp_path / "97.mat"
    savemat(path, {"X097_DE_time": FORCE[:, None] - 25.0, "X097RPM": np.array([[1796]])})
    signal, cut = peaks_of_series(read_recording(path), RecordingOptions(rate_hz=12_000.0))
    assert signal.name == "X097_DE_time"
    assert cut.notes[-1] == "the file states X097RPM = 1796; if that is the speed, state it"


def test_channels_of_their_own_rate_keep_it(tmp_path):
    """Two data sets of as many readings at two rates: each has its own."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(tmp_path / "a", "w") as file:
        for name, rate in (("front", 1000.0), ("rear", 500.0)):
            file[name] = FORCE
            file[name].attrs["fs"] = rate
    recording = read_recording(tmp_path / "a")
    for name, told in (("front", "6 s at 1000 Hz"), ("rear", "12 s at 500 Hz")):
        assert series_of(recording, RecordingOptions(column=name))[0].described.endswith(f"; {told} by the channel")
    assert recording.rate_hz is None


@pytest.mark.parametrize(
    ("seconds", "shown"),
    [(50_000.0, "13.89 h"), (600.0, "10 min"), (119.0, "119 s"), (1.0, "1 s"), (0.0494, "49.4 ms"), (2e-5, "20 µs")],
)
def test_durations_have_no_exponent(seconds, shown):
    """From microseconds to hours."""
    assert duration(seconds) == shown


def test_stamps_may_be_uneven_and_a_gap_of_hours_is_no_tick():
    """A clock never falls; stamps of a busy logger are a few ticks apart, and no gap is most of the time."""
    uneven = np.cumsum(np.random.default_rng(0).uniform(0.5, 1.5, 100))
    assert is_clock(uneven)
    assert not is_clock(uneven[:7]), "a few rising readings are no clock"
    assert not is_clock(np.append(uneven, uneven[-1] + 60.0))
    assert not is_clock(np.append(uneven, 0.0))
