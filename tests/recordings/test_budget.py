"""A small file must not take the computer: readings are counted before they are read, and patterns are linear."""

import io
import math
import re
import struct
import subprocess
import sys
import time
import zipfile
import zlib
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chaosgym.errors import DiagnosisError
from chaosgym.recordings import raw
from chaosgym.recordings.quantities import CLOCK, SUFFIXES, TIMES, UNITS, as_unit, split_unit
from chaosgym.recordings.read import read_recording
from chaosgym.recordings.stream import LineReader
from tests.recordings.writers import WRITERS


@pytest.mark.parametrize("kind", WRITERS)
def test_the_budget_is_the_number_of_readings_in_every_format(kind, tmp_path, monkeypatch):
    """Where one reading less is allowed the file is refused in one line; a heading, or a clock, may count as well."""
    values = np.sin(np.arange(60.0))
    WRITERS[kind](tmp_path / "record", "force", "N", values)
    count = sum(map(len, read_recording(tmp_path / "record").columns.values()))
    monkeypatch.setattr(raw, "MOST_READINGS", 2 * count)
    read_recording(tmp_path / "record")
    monkeypatch.setattr(raw, "MOST_READINGS", count - 1)
    with pytest.raises(DiagnosisError, match=f"claims .* readings or more; allowed: up to {count - 1} in all") as error:
        read_recording(tmp_path / "record")
    assert "\n" not in str(error.value)


def parquet_of_zeros(path):
    """A hundred million zeros in half a megabyte."""
    table = pa.table({"force": pa.array(np.zeros(10**6))})
    with pq.ParquetWriter(path, table.schema) as file:
        for _ in range(100):
            file.write_table(table)


def parquet_of_one_text(path):
    """Ten thousand references to one text of a megabyte."""
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(10_000, np.int32)), pa.array(["x" * 10**6]))
    pq.write_table(pa.table({"force": np.arange(10_000.0) % 7, "note": text}), path, compression="zstd")


def parquet_of_one_text_written_elsewhere(path):
    """As above, without the note of Arrow that the texts are references."""
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(10_000, np.int32)), pa.array(["x" * 10**6]))
    table = pa.table({"force": np.arange(10_000.0) % 7, "note": text})
    pq.write_table(table, path, compression="zstd", store_schema=False)


def parquet_of_a_list(path):
    """One row that is a list of a hundred million zeros."""
    values = pa.array(np.zeros(10**6))
    table = pa.table({"force": pa.ListArray.from_arrays(pa.array([0, 10**6], pa.int32()), values)})
    with pq.ParquetWriter(path, table.schema) as file:
        for _ in range(100):
            file.write_table(table)


def hdf_of_fill_values(path):
    """Sixty data sets of which nothing was written."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        for number in range(60):
            file.create_dataset(f"c{number}", (5 * 10**7,), "f8", chunks=(10**6,))


def hdf_beside_another_file(path):
    """A data set whose readings are taken from another file of the computer."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_dataset("force", (100,), "f8", external=[(str(Path(__file__).resolve()), 0, 800)])


def hdf_of_a_virtual_set(path):
    """A data set made of those of another file."""
    h5py = pytest.importorskip("h5py")
    layout = h5py.VirtualLayout((100,), "f8")
    layout[:] = h5py.VirtualSource(str(path) + ".other", "x", (100,))
    with h5py.File(path, "w") as file:
        file.create_virtual_dataset("force", layout)


def flac_of_silence(path):
    """Sixty million samples of silence."""
    soundfile = pytest.importorskip("soundfile")
    with soundfile.SoundFile(path, "w", 48_000, 1, "PCM_16", format="FLAC") as file:
        for _ in range(60):
            file.write(np.zeros(10**6, np.int16))


def element(kind, content):
    """An element of a MATLAB file."""
    return struct.pack("<II", kind, len(content)) + content + bytes(-len(content) % 8)


def variable(kind, sides, parts):
    """A variable of a class with its parts."""
    flags, shape = element(6, struct.pack("<II", kind, 0)), element(5, struct.pack(f"<{len(sides)}i", *sides))
    return element(14, flags + shape + element(1, b"force") + parts)


def matlab(path, variables):
    """A MATLAB file of version 5 with packed variables."""
    packed = [zlib.compress(one) for one in variables]
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H", 0x0100) + b"IM"
    path.write_bytes(head + b"".join(struct.pack("<II", 15, len(one)) + one for one in packed))


def matlab_of_zeros(path):
    """Two hundred and ten million bytes of zeros."""
    matlab(path, [variable(6, (210_000_000, 1), element(2, bytes(210_000_000)))])


def matlab_of_cells(path):
    """An array of two billion cells, of which none is there."""
    matlab(path, [variable(1, (2**31 - 1, 1), b"")])


def matlab_of_nested_cells(path):
    """A cell in a cell, a hundred thousand times, each of which claims to be empty."""
    flags, shape = element(6, struct.pack("<II", 1, 0)), element(5, struct.pack("<2i", 1, 1))
    matlab(path, [100_000 * (struct.pack("<II", 14, 0) + flags + shape + element(1, b"force"))])


SHEET = "xl/worksheets/sheet1.xml"


def workbook(path, rows):
    """A workbook whose sheet holds rows as XML."""
    openpyxl = pytest.importorskip("openpyxl")
    empty = io.BytesIO()
    openpyxl.Workbook().save(empty)
    with zipfile.ZipFile(empty) as old, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as new:
        for name in old.namelist():
            if name != SHEET:
                new.writestr(name, old.read(name))
        with new.open(SHEET, "w", force_zip64=True) as sheet:
            sheet.write(b'<worksheet xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"><sheetData>')
            for row in rows:
                sheet.write(row)
            sheet.write(b"</sheetData></worksheet>")


def excel_of_many_rows(path):
    """More than five million rows; a sheet of Excel has 1,048,576."""
    workbook(path, 510 * [10_000 * b"<row><c><v>1</v></c></row>"])


def excel_of_wide_rows(path):
    """Ten thousand rows, each with a cell in the last column only."""
    rows = (b'<row r="%d"><c r="XFD%d"><v>1</v></c></row>' % (row, row) for row in range(1, 10**4))
    workbook(path, rows)


def excel_that_unpacks(path):
    """Three hundred megabytes of blanks."""
    workbook(path, 300 * [b" " * 2**20])


def excel_of_entities(path):
    """A text that names itself ten times in each of thirty entities."""
    workbook(path, [])
    named = "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10 if k else "x" * 100}">' for k in range(30))
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("xl/sharedStrings.xml", f"<!DOCTYPE s [{named}]><sst><si><t>&a29;</t></si></sst>")


def text_of_many_entries(path):
    """Sixty million readings of a letter each."""
    path.write_bytes(b"force\n" + 60_000_000 * b"1\n")


BOMBS = {
    make.__name__: (make, told)
    for make, told in (
        (parquet_of_zeros, "claims 100,000,000 readings"),
        (parquet_of_one_text, "Parquet; force>"),
        (parquet_of_one_text_written_elsewhere, "Parquet; force>"),
        (parquet_of_a_list, "claims 100,000,000 readings"),
        (hdf_of_fill_values, "claims 100,000,000 readings"),
        (hdf_beside_another_file, "whose readings are in another file"),
        (hdf_of_a_virtual_set, "whose readings are in another file"),
        (flac_of_silence, "claims 60,000,000 readings"),
        (matlab_of_zeros, "unpacks to more than 200,000,000 bytes"),
        (matlab_of_cells, "more than 1,000,000 cells"),
        (matlab_of_nested_cells, "more than 1,000 cell arrays"),
        (excel_of_many_rows, "more than 5,000,000 cells"),
        (excel_of_wide_rows, "more than 5,000,000 cells"),
        (excel_that_unpacks, "unpacks to 314,"),
        (excel_of_entities, "holds no numbers"),
        (text_of_many_entries, "claims 60,000,001 readings"),
    )
}
"""Files that claim much, and what is said of each; a column of text is left out."""

WATCHED = """
import os, resource, sys, time
from chaosgym.errors import DiagnosisError
from chaosgym.recordings import formats
from chaosgym.recordings.read import read_recording
for module in ("pyarrow.parquet", "scipy.io", "h5py", "openpyxl", "soundfile"):
    try:
        __import__(module)
    except ImportError:
        pass

def read(path):
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.process_time()
    try:
        said = repr(read_recording(path))
    except DiagnosisError as error:
        said = str(error)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(used * 1024, time.process_time() - began)
    print(said, flush=True)

for line in sys.stdin:
    if (child := os.fork()) == 0:
        read(line.rstrip("\\n"))
        os._exit(0)
    print(f"ended with {os.waitpid(child, 0)[1]}", flush=True)
"""


@pytest.fixture(scope="module")
def watched():
    """What reads each file of a path in a process of its own, whose memory and time it says; all modules are loaded."""
    with subprocess.Popen(
        [sys.executable, "-c", WATCHED], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.stdin.close()


@pytest.mark.parametrize("kind", BOMBS)
def test_a_file_that_claims_much_is_refused_before_it_is_read(kind, tmp_path, watched):
    """One line, in seconds, with little memory beside what the file itself takes."""
    make, told = BOMBS[kind]
    path = tmp_path / "record"
    make(path)
    print(path, file=watched.stdin, flush=True)
    figures, said, *more = iter(watched.stdout.readline, "ended with 0\n")
    used, seconds = map(float, figures.split())
    assert more == []
    assert told in said
    assert used < 2.5e8 + 2 * path.stat().st_size * (kind != "text_of_many_entries"), f"{used / 1e6:.0f} MB"
    assert seconds < 30.0


def test_every_lack_of_memory_is_one_line():
    """What no budget foresees ends a command in one line, exit code 1."""
    program = (
        "import click; from chaosgym.cli import run_command\n"
        "@click.command()\n"
        "def large(): __import__('numpy').ones(2**45)\n"
        "run_command(large)"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert run.returncode == 1
    assert re.fullmatch(r"Error: there is not enough memory: .*\n", run.stderr), run.stderr


LETTERS = " _([])/1,.;\"':#%-+eE\tnN"


def seconds(work):
    """Processor time of a call."""
    began = time.process_time()
    work()
    return time.process_time() - began


def proportional(read, count, what):
    """Whether twice as many letters take less than three times as long; a busy computer may ask for another look."""
    few = many = math.inf
    for _ in range(15):
        few, many = min(few, read(count, what)), min(many, read(2 * count, what))
        if many < 3.0 * few + 0.01:
            return True
    return False


def answer(read, *values, **named):
    """Call a reader, which may refuse what it reads in one line."""
    said = ""
    try:
        read(*values, **named)
    except DiagnosisError as error:
        said = str(error)
    assert len(said) < 1000
    assert "\n" not in said


TEXTS = {
    "a title": lambda fill: f"a{fill}b\n1\n2\n",
    "a title and a unit": lambda fill: f"a{fill}b [N],c\n1,2\n2,1\n",
    "a title in quotes": lambda fill: f'"a{fill}b","c"\n1,2\n2,1\n',
    "a setting": lambda fill: f"Sample rate: {fill}x\nforce\n1\n2\n",
    "a reading": lambda fill: f"force\n1\n{fill}x\n2\n",
    "a reading of several": lambda fill: f"time;force\n0;1\n1;{fill}x\n2;2\n",
    "an instant": lambda fill: f"time;force\n0;1\n12:00:00{fill}x;2\n2;2\n",
    "words of a heading": lambda fill: f"samp{fill}" + f",samp{fill}" * 20 + "\n" + "1" + ",1" * 20 + "\n",
}


@pytest.mark.parametrize("place", TEXTS)
def test_reading_a_text_takes_time_in_proportion_to_it(place, tmp_path):
    """Twice as many letters of any kind, anywhere, take less than three times as long."""
    path = tmp_path / "record.csv"

    def read(count, letters):
        path.write_text(TEXTS[place](letters * (count // len(letters))))

        return seconds(lambda: answer(read_recording, path))

    for letters in (*LETTERS.replace("\t", ""), "freq", "a ", "_ ", "[(", "1,", "1.", '"1', "in ", "1e"):
        assert proportional(read, 10_000, letters), letters


@pytest.mark.parametrize("letters", ["1", " ", "a_", "1,", '"1', "["])
def test_a_line_of_a_stream_takes_time_in_proportion_to_it(letters):
    """As for files; the heading, and a reading."""

    def read(count, first):
        line = "a" + letters * (count // len(letters)) + "b"
        return seconds(lambda: answer(LineReader("1", ";").read, line, 1, first=first))

    for first in (True, False):
        assert proportional(read, 40_000, first)


@given(
    st.lists(st.sampled_from(["N", "kN", "/", " ", "_", "in", "a", "Force", "[", "]", "(", ")", "m/s", "min", "ms"]))
)
def test_names_and_units_are_those_of_the_patterns(words):
    """The search in one pass finds in short titles what patterns find, whose time is the square of the length."""
    text = "".join(words).strip()
    assert split_unit(text) == by_patterns(text)


def by_patterns(text):
    """Name and unit of a title by regular expressions."""
    if written := re.fullmatch(r"(.*?)[\s_]*[\[(]\s*([^\])]*?)\s*[\])]", text):
        unit = as_unit(written[2])
        if unit or "[" in text:
            return written[1].strip() or text, unit or written[2]
    if (written := re.fullmatch(r"(.+?)\s*/\s*(\S+)", text)) and as_unit(written[2]):
        return written[1].strip(), as_unit(written[2])
    if written := re.fullmatch(r"(.+?)(?:_|\s+in\s+)(\S+)", text):
        unit = as_unit(written[2])
        allowed = unit in SUFFIXES if written[2] in UNITS else len(written[2]) > 2
        if unit and (allowed or (unit == "min" and CLOCK.fullmatch(written[1]))):
            return written[1].strip(), unit
    unit = as_unit(text)
    return text, unit if unit in TIMES and len(text) > 1 and text.casefold() != "min" else ""


JUDGED = """
import re, sys
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.runs import judged_runs
judged_runs(sys.argv[1], RecordingOptions(column="force", period=0.04, rate_hz=float(sys.argv[2]) or None))
print(1024 * int(re.search(r"VmHWM:\\s*(\\d+) kB", open("/proc/self/status").read())[1]))
"""


def largest_table(path, values):
    """A column, in groups of a million rows."""
    pq.write_table(pa.table({"force": values}), path)


def largest_structure(path, values):
    """A data set of HDF5, packed."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w") as file:
        file.create_dataset("force", data=values, chunks=True, compression="gzip", compression_opts=1)


def largest_text(path, values):
    """Times and forces, half as many rows."""
    with open(path, "w") as file:
        file.write("time [s],force [N]\n")
        for start in range(0, len(values) // 2, 10**5):
            rows = enumerate(values[start : min(start + 10**5, len(values) // 2)].tolist(), start)
            file.write("".join(f"{row / 50_000.0:.5f},{value:.2f}\n" for row, value in rows))


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the largest memory is Linux's")
@pytest.mark.parametrize("make", [largest_table, largest_structure, largest_text])
def test_the_largest_files_are_judged_within_a_gigabyte(make, tmp_path):
    """All but two million of the readings that a recording may have, in one column or in two."""
    values = 100.0 * np.maximum(0.0, np.sin(2.0 * np.pi * 25.0 * np.arange(raw.MOST_READINGS - 2 * 10**6) / 50_000.0))
    path = tmp_path / "record"
    make(path, values)
    rate = "0" if make is largest_text else "50000"
    call = [sys.executable, "-c", JUDGED, str(path), rate]
    run = subprocess.run(call, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr[-2000:]
    assert float(run.stdout) < 1e9
