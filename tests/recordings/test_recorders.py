"""Recorders' own formats, each written by the library of its own: the same force, unit and sampling rate."""

import contextlib
import gc
import io
import struct
import sys

import numpy as np
import pytest
from scipy.io import savemat, wavfile

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.columns import choose_force
from chaosgym.recordings.read import read_recording
from chaosgym.recordings.sampling import sampling
from tests.cli.run import run
from tests.recordings import writers

RATE = 2000.0
FORCE = 20.0 + 15.0 * np.sin(0.7 * np.arange(60))
TIME = np.arange(60) / RATE


def tdms(path):
    """LabVIEW's format, by npTDMS."""
    nptdms = pytest.importorskip("nptdms")
    told = {"wf_increment": 1.0 / RATE, "unit_string": "N"}
    with nptdms.TdmsWriter(path) as file:
        file.write_segment([nptdms.ChannelObject("rig", "Force", FORCE, properties=told)])


def mdf(path):
    """The automotive industry's format, by asammdf."""
    asammdf = pytest.importorskip("asammdf")
    file = asammdf.MDF()
    file.append(asammdf.Signal(FORCE, TIME, name="Force", unit="N"))
    path.write_bytes(b"")
    file.save(path, overwrite=True)
    file.close()


def hdf(path):
    """HDF5 with attributes, by h5py."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file["rig/Force"] = FORCE
        file["rig/Force"].attrs["fs"] = RATE
        file["rig/Force"].attrs["unit"] = "N"


def matlab_of_version_7_3(path):
    """HDF5 behind MATLAB's 512 bytes."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=512) as file:
        file["Force"], file["fs"] = FORCE[None, :], [[RATE]]
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124, b" ") + b"\0\2IM")


def matlab_structure(path):
    """A structure of a structure, as Testlab exports it."""
    x = {"start_value": 0.0, "increment": 1.0 / RATE, "number_of_values": 60.0}
    savemat(path, {"Signal_0": {"x_values": x, "y_values": {"values": FORCE}}})


def excel(path):
    """A sheet with a heading, by openpyxl."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [("Time [s]", "Force [N]"), *zip(TIME.tolist(), FORCE.tolist(), strict=True)]:
        book.active.append(row)
    book.save(path)


def universal(path):
    """A universal file, data set 58, by pyuff."""
    writers.universal(path, "Force", "N", FORCE, step=1.0 / RATE)


def universal_binary(path):
    """The same with binary numbers, 58b."""
    writers.universal(path, "Force", "N", FORCE, 1, 1.0 / RATE)


EVERY = [tdms, mdf, hdf, matlab_of_version_7_3, matlab_structure, excel, universal, universal_binary]


@pytest.mark.parametrize("write", EVERY)
def test_formats_give_force_and_rate(write, tmp_path):
    """Told by their first bytes, whatever the name ends in."""
    path = tmp_path / "record.mf4"
    write(path)
    path = path.rename(tmp_path / "record")
    recording = read_recording(path)
    np.testing.assert_allclose(choose_force(recording).values, FORCE, rtol=1e-11)
    assert sampling(recording, 60).step == pytest.approx(1.0 / RATE)


def test_stamps_of_a_measurement_file_are_read_once(tmp_path):
    """A channel named t that holds the time again is no reading, and the rate is that of the file."""
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path / "record.mf4"
    file = asammdf.MDF()
    signals = [asammdf.Signal(FORCE, TIME, name="Force", unit="N"), asammdf.Signal(TIME, TIME, name="t", unit="s")]
    file.append(signals)
    file.save(path)
    file.close()
    recording = read_recording(path)
    assert list(recording.columns) == ["Force", "time"]
    assert sampling(recording, 60).step == pytest.approx(1.0 / RATE)


def element(kind, data):
    """An element of MATLAB's version 5 with the most significant byte first, filled to eight bytes."""
    return struct.pack(">II", kind, len(data)) + data + bytes(-len(data) % 8)


def test_matlab_of_a_computer_with_the_most_significant_byte_first(tmp_path):
    """Its header ends in MI; written by hand, as MathWorks' description of level 5 has it."""
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack(">H", 0x0100) + b"MI"
    double, words, signed, letters, matrix = 9, 6, 5, 1, 14
    flags = element(words, struct.pack(">II", 6, 0))  # class 6: double
    force = flags + element(signed, struct.pack(">ii", 1, 60)) + element(letters, b"force")
    content = element(matrix, force + element(double, FORCE.astype(">f8").tobytes()))
    (tmp_path / "record.mat").write_bytes(head + content)
    np.testing.assert_array_equal(choose_force(read_recording(tmp_path / "record.mat")).values, FORCE)


@pytest.mark.parametrize("kind", ["PCM_U8", "PCM_16", "PCM_24", "PCM_32", "flac"])
def test_whole_numbers_of_sound_files_are_shares_of_the_full_scale(kind, tmp_path):
    """Full scale is 1, and silence of 8 bit is 0."""
    soundfile = pytest.importorskip("soundfile")
    wave = np.concatenate([np.zeros(8), 0.25 * np.sin(0.3 * np.arange(200))])
    path = tmp_path / "record.wav"
    flac = kind == "flac"
    soundfile.write(path, wave, 8000, subtype=None if flac else kind, format="FLAC" if flac else "WAV")
    recording = read_recording(path)
    (column,) = recording.columns.values()
    np.testing.assert_allclose(column, wave, atol=0.01 if kind == "PCM_U8" else 1e-4)
    assert (recording.rate_hz, set(recording.units.values())) == (8000.0, {"FS"})


def test_floating_point_sound_files_keep_their_numbers(tmp_path):
    """Recorders that store newton as floating-point numbers."""
    path = tmp_path / "record.wav"
    wavfile.write(path, 2000, FORCE.astype(np.float32))
    np.testing.assert_allclose(choose_force(read_recording(path)).values, FORCE, rtol=1e-6)


@pytest.mark.parametrize(
    ("first", "module", "what"),
    [(b"TDSm", "nptdms", "TDMS"), (b"\x89HDF\r\n\x1a\n", "h5py", "HDF5"), (b"fLaC", "soundfile", "FLAC")],
)
def test_a_missing_library_is_named(first, module, what, monkeypatch, tmp_path):
    """One line says which format it is, and what to install or to export."""
    monkeypatch.setitem(sys.modules, module, None)
    (tmp_path / "record").write_bytes(first + bytes(200))
    with pytest.raises(DiagnosisError, match=rf"is an? {what} file, which needs the extra \[recordings\]: .* CSV"):
        read_recording(tmp_path / "record")


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # asammdf drops what it half opened
@pytest.mark.parametrize("write", [tdms, mdf, hdf, matlab_structure, excel])
@pytest.mark.parametrize("left", [0.1, 0.5, 0.95])
def test_torn_files_are_refused_in_one_line(write, left, tmp_path):
    """A file whose end is missing is read as far as its library does, or refused, never with a traceback."""
    path = tmp_path / "record.mf4"
    write(path)
    data = path.read_bytes()
    path.write_bytes(data[: int(left * len(data))])
    with contextlib.suppress(DiagnosisError):
        read_recording(path)
    gc.collect()


def test_stamps_of_a_table_are_the_time(tmp_path):
    """Instants of a Parquet file, in seconds from the first."""
    pq, pa = pytest.importorskip("pyarrow.parquet"), pytest.importorskip("pyarrow")
    stamps = np.datetime64("2022-04-12T13:32:10") + (TIME * 1e6).astype("timedelta64[us]")
    stream = io.BytesIO()
    pq.write_table(pa.table({"force": FORCE, "at": stamps}), stream)
    (tmp_path / "record").write_bytes(stream.getvalue())
    recording = read_recording(tmp_path / "record")
    assert sampling(recording, 60).step == pytest.approx(1.0 / RATE, rel=1e-3)


def workbook(path, **sheets):
    """A workbook with sheets of rows."""
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.remove(book.active)
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)


def test_the_sheet_with_the_data_is_taken_and_named(tmp_path):
    """Notes before the data may hold a date or a number; a column or a sheet that is asked for decides."""
    path = tmp_path / "rig.xlsx"
    one = [("peak [N]",), *((value,) for value in FORCE.tolist())]
    two = [("load [kN]",), *((value,) for value in FORCE.tolist())]
    notes = [("date", "2026-01-01"), ("serial", 12)]
    workbook(path, Notes=notes, One=one, Two=two)
    recording = read_recording(path)
    assert (list(recording.columns), recording.form) == (["peak"], "Excel, sheet 'One' of 'Notes', 'One', 'Two'")
    np.testing.assert_allclose(choose_force(read_recording(path, column="load"), "load").values, 1000.0 * FORCE)
    np.testing.assert_allclose(choose_force(read_recording(path, sheet="Two")).values, 1000.0 * FORCE)
    with pytest.raises(DiagnosisError, match="has no sheet 'Three'; its sheets: 'Notes', 'One', 'Two'"):
        read_recording(path, sheet="Three")
    with pytest.raises(DiagnosisError, match=r"rig.xlsx has no column 'none'"):
        choose_force(read_recording(path, column="none"), "none")


def test_a_sheet_is_named_by_an_option(tmp_path):
    """The one that is named is judged, and said in the line of what was read."""
    path = tmp_path / "rig.xlsx"
    rows = [("peak [N]",), *((40.0 + place % 2,) for place in range(200))]
    workbook(path, One=[("peak [N]",), *rows[1:100]], Two=rows)
    code, out, _ = run("judge", path, "--read", "sheet=Two", "--sensor-error", "0.1 N")
    assert (code, "Excel, sheet 'Two' of 'One', 'Two', column 'peak' (N), 200 readings" in out) == (0, True)


def test_a_sheet_belongs_to_a_workbook(tmp_path):
    """A text has none."""
    (tmp_path / "a.csv").write_text("1\n2\n2\n")
    with pytest.raises(DiagnosisError, match="read as CSV, which has no sheets; got: sheet 'Data'"):
        read_recording(tmp_path / "a.csv", sheet="Data")
