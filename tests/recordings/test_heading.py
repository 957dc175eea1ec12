"""Headings of recorders: names, units, rate and the place of the data, whatever stands above, beside and below them."""

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.columns import choose_force
from chaosgym.recordings.cycles import peaks_of_series
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.quantities import split_unit
from chaosgym.recordings.read import read_recording
from chaosgym.recordings.sampling import choose_time, sampling

COUNT, STEP = 60, 5e-4
TIME = np.arange(COUNT) * STEP
FORCE = np.round(20.0 + 15.0 * np.sin(0.7 * np.arange(COUNT)), 3)
ROWS = list(zip(TIME, FORCE, strict=True))


def rows(form, points=ROWS):
    """Lines of data, written by a format with t and x."""
    return "".join(form.format(t=t, x=x, i=i) for i, (t, x) in enumerate(points))


def comma(text):
    """The same with decimal commas."""
    return text.replace(".", ",")


SETTINGS = ["Record Length,2.5e+03", "Sample Interval,5.0e-04", "Trigger Point,1.25e+03", ",", "Vertical Units,N"]
LVM = (
    "LabVIEW Measurement\t\r\nSeparator\tTab\r\n***End_of_Header***\t\r\n\t\r\nChannels\t1\t\t\r\nSamples\t60\t\r\n"
    "Date\t2022/04/12\t\r\nY_Unit_Label\tN\t\r\nX_Dimension\tTime\t\r\nDelta_X\t0.000500\t\r\n"
    "***End_of_Header***\t\t\r\nX_Value\tForce\tComment\r\n"
)

SHAPES = {
    "Tektronix MSO": "Model,MSO58\n\nHorizontal Units,s\nSample Interval,5e-04\nVertical Units,N\nLabels,\nTIME,CH1\n"
    + rows("{t:.6e},{x}\n"),
    "Tektronix TDS": "".join(f"{(*SETTINGS, *[','] * COUNT)[i]},,{t:.9f},{x},\r\n" for i, (t, x) in enumerate(ROWS)),
    "Keysight": "x-axis,1\r\nsecond,Newton\r\n" + rows("{t:.6E},{x}\r\n"),
    "Rigol": "X,CH1,Start,Increment,\r\nSequence,N,0.000000e+00,5.000000e-04\r\n" + rows("{i},{x},\r\n"),
    "Siglent": "Record Length,Analog:60\nSample Interval,Analog:5e-04\nModel Number,SDS1104X-E\nSecond,N\n"
    + rows("{t:.8f},{x}\n"),
    "DEWESoft": "Data Info\r\nFile name:;T.d7d\r\nStart time:;4/12/2022 13:32:10.000\r\nSample rate:;2000\r\n\r\n"
    "Time (s);Force/AI 1 (N)\r\n" + rows("{t:.6f};{x}\r\n"),
    "catman": "catman AP\r\nKanäle:\t2\r\n\r\nZeit  1 - Standardmessrate\tKraft\r\ns\tN\r\nAbtastrate: 2000 Hz\t"
    "Abtastrate: 2000 Hz\r\n" + comma(rows("{t:.5f}\t{x}\r\n")),
    "Testlab": "Project:\tdemo.lms\r\nRun:\tRun 1\r\nTime\tForce:+X\r\ns\tN\r\nReal\tReal\r\n"
    + rows("{t:.6E}\t{x}\r\n"),
    "imc": "Kraft\r\n[N]\r\ndx=0.0005 s\r\n" + rows("{x}\r\n"),
    "ME'scope": "ME'scopeVES\r\nTrace: M#1\r\nTime (sec)\tM1:1Z (N)\r\n" + rows("{t:.6f}\t{x}\r\n"),
    "B&K": "Header: Pulse\r\nX-axis unit: s\r\nDelta X: 5.0000E-04\r\n\r\n" + rows("{i}\t{t:.6E}\t{x}\r\n"),
    "DASYLab": "DASYLab\r\nDelta: 0.0005 sec.\r\nMeasurement time[s];\tForce [N];\r\n" + rows("{t:.5f};\t{x};\r\n"),
    "LVM": LVM + rows("{t:.6f}\t{x}\r\n"),
    "LVM of two segments": LVM + rows("{t:.6f}\t{x}\r\n") + "\r\n" + LVM[66:] + rows("{t:.6f}\t{x}\r\n"),
    "LVM without x": LVM + rows("\t{x}\r\n"),
    "numpy": "# time [s], force [N]\n" + rows("{t:.6e},{x}\n"),
    "quotes": '"Zeit";"Kraft"\n"s";"N"\n' + comma(rows('"{t:.5f}";"{x}"\n')),
    "footer": "Time [s];Force [N]\n" + rows("{t:.5f};{x}\n") + "Maximum;40.2\nMinimum;-0.2\n",
    "ISO instants": "timestamp,force\n" + rows("2022-04-12T13:32:10.{t:.4f},{x}\n").replace(".0.", "."),
    "German instants": "Datum;Kraft [N]\n" + comma(rows("12#04#2022 13:32:1{t:.4f};{x}\n")).replace("#", "."),
    "American instants": "Time,Force (N)\n" + rows("4/12/2022 1:32:1{t:.4f} PM,{x}\n"),
    "date and time": "Date;Time;Force [N]\n" + rows("12.04.2022;13:32:1{t:.4f};{x}\n"),
    "milliseconds since 1970": "t [ms],force\n" + "".join(f"{1649770330000 + 1e3 * t:.1f},{x}\n" for t, x in ROWS),
}


@pytest.mark.parametrize("name", SHAPES)
def test_force_and_sampling_are_found_in_every_shape(name, tmp_path):
    """Force in newton and step of the time, from the shapes that recorders' programs write."""
    path = tmp_path / "record.txt"
    path.write_bytes(SHAPES[name].encode("cp1252"))
    recording = read_recording(path)
    force = choose_force(recording)
    np.testing.assert_allclose(force.values, FORCE, rtol=1e-9)
    assert sampling(recording, COUNT).step == pytest.approx(STEP, rel=1e-3)


@pytest.mark.parametrize("mark", ["OVR", "#NV", "1.#QNAN", "-1.#IND", "OVERLOAD", "n/a", "NaN", "---", ""])
def test_marks_of_missing_readings_are_counted(mark, tmp_path):
    """One in sixty is named with its line, and its cycle left out; one in twenty is refused."""
    path = tmp_path / "record.csv"
    shown = [f"{t:.5f},{mark if i == 33 else x}\n" for i, (t, x) in enumerate(ROWS)]
    path.write_text("Time [s],Force [N]\n" + "".join(shown))
    signal, cut = peaks_of_series(read_recording(path), RecordingOptions(period=10 * STEP))
    assert "1 of them missing, the first in line 35" in signal.described
    assert any("1 cycles left out" in note for note in cut.notes)
    path.write_text("Time [s],Force [N]\n" + "".join(shown[30:50]))
    with pytest.raises(DiagnosisError, match=r"line 5: .* is not a finite number|line 5: a blank between"):
        choose_force(read_recording(path))


@pytest.mark.parametrize(
    ("written", "delimiter"), [("1.020,125", ";"), ("1,020.125", "\t"), ("1'020.125", ";"), ("1 020,125", ";")]
)
def test_separators_of_thousands_are_understood(written, delimiter, tmp_path):
    """1020.125 N as Germans, Americans, Swiss and French write it."""
    path = tmp_path / "record.csv"
    path.write_text(f"n{delimiter}F [N]\n" + "".join(f"{k}{delimiter}{written}\n" for k in range(9)))
    assert choose_force(read_recording(path)).values.tolist() == [1020.125] * 9


@pytest.mark.parametrize(
    ("title", "unit"),
    [
        ("Channel A", ""),
        ("Sensor_A", ""),
        ("Input V", ""),
        ("F [N]", "N"),
        ("F (kN)", "kN"),
        ("peak_N", "N"),
        ("t (sec)", "s"),
    ],
)
def test_a_unit_is_never_a_word_of_the_name(title, unit):
    """ "Channel A" is no ampere; brackets, and an underscore with a unit of force or time, tell one."""
    assert split_unit(title)[1] == unit


def test_a_counter_is_no_clock(tmp_path):
    """Numbers of samples beside a force give no sampling rate."""
    path = tmp_path / "record.csv"
    path.write_text("n,F [N]\n" + rows("{i},{x}\n"))
    recording = read_recording(path)
    assert choose_time(recording) is None
    with pytest.raises(DiagnosisError, match="no time column; use --read rate-hz"):
        sampling(recording, COUNT)


def test_a_row_of_bare_units_is_no_row_of_names(tmp_path):
    """Units that are not judged, such as degC, and ones that are not known stand in it too."""
    for units in ("s,N,degC", "s,N,furlong"):
        path = tmp_path / "record.csv"
        path.write_text(f"Time,Force,Other\n{units}\n" + rows("{t:.5f},{x},21.5\n"))
        recording = read_recording(path)
        assert list(recording.columns) == ["Time", "Force", "Other"]
        assert choose_force(recording).name == "Force"
        assert recording.units["Other"] == units[4:]


@pytest.mark.parametrize(
    ("entries", "values"),
    [
        (["1,000.12", "999.50"], [1000.12, 999.5]),
        (["1,234,567", "1,000"], [1234567.0, 1000.0]),
        (["1,5", "12,25"], [1.5, 12.25]),
        (["1,000", "2,500"], [1000.0, 2500.0]),
    ],
)
def test_numbers_in_quotes_may_have_commas(entries, values, tmp_path):
    """Thousands of spreadsheets in America, decimals of those in Europe; the points beside them tell which."""
    path = tmp_path / "record.csv"
    times = ["0,5" if "1,5" in entries else "0.5", "1,5" if "1,5" in entries else "1.5"]
    lines = [f'"{time}","{entry}"' for time, entry in zip(times, entries, strict=True)]
    lines = [line if "0,5" in line or "1,5" in line else line.replace('"', "", 2) for line in lines]
    path.write_text("Time [s],Force [N]\n" + "\n".join(lines * 10) + "\n")
    assert read_recording(path).columns["Force"][:2].tolist() == values


def test_a_comma_that_may_be_either_is_a_question(tmp_path):
    """1234 or 1.234: nothing else in the file has a point or a comma."""
    path = tmp_path / "record.csv"
    path.write_text("n,Force [N]\n" + '1,"1,234"\n2,"5,678"\n' * 5)
    with pytest.raises(DiagnosisError, match=r"line 2: '1,234' may be 1234 or 1\.234"):
        read_recording(path)


def test_a_heading_repeated_amid_the_data_is_told(tmp_path):
    """A logger that was started again writes its heading again."""
    path = tmp_path / "record.csv"
    head = "Time [s],Force [N]\n"
    path.write_text(head + rows("{t:.5f},{x}\n", ROWS[:30]) + head + rows("{t:.5f},{x}\n", ROWS[30:]))
    signal, _ = peaks_of_series(read_recording(path), RecordingOptions(period=10 * STEP))
    assert "a heading repeated amid the data left out, first in line 32" in signal.described
    assert len(signal.values) == COUNT


@pytest.mark.parametrize("kind", ["csv", "parquet"])
def test_a_column_of_text_is_named_as_one(kind, tmp_path):
    """It is not said to be absent."""
    path, entries = tmp_path / "record", ["abc", "def", "ghi"] * 5
    if kind == "csv":
        path.write_text("cycle,upper\n" + "".join(f"{k},{entry}\n" for k, entry in enumerate(entries)))
    else:
        pq.write_table(pa.table({"cycle": range(15), "upper": entries}), path)
    with pytest.raises(DiagnosisError, match=r"column 'upper' holds text: 'abc' in (line 2|row 1)$"):
        choose_force(read_recording(path), "upper")
    with pytest.raises(DiagnosisError, match=r"no column that could be a force .*'upper' holds text: 'abc'"):
        choose_force(read_recording(path))
