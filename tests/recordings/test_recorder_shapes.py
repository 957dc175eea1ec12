"""What recorders, telephones, microcontrollers and controllers write is read without a further word, or asked about."""

import json

import numpy as np
import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.lines import arranged
from chaosgym.recordings.read import read_recording
from chaosgym.recordings.runs import judged_files, judged_runs
from tests.recordings.binary_shapes import binaries
from tests.recordings.more_shapes import ASKED, KNOWN, NEWER, told
from tests.recordings.recorder_shapes import FORCE, RATE, SHAPES, TIME, judged

QUICK = sorted(SHAPES)[::3]
"""A third of the shapes; ``python -m tests.recordings.recorder_shapes`` judges all."""


@pytest.mark.parametrize("name", QUICK)
def test_a_replica_is_read_and_judged_without_a_further_word(name, tmp_path):
    """Its 119 cycles of 50 ms, in the unit and at the rate that the file states, are periodic."""
    content = SHAPES[name]()
    (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    assert judged(tmp_path / name) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(SHAPES) - set(QUICK)))
def test_every_other_replica_too(name, tmp_path):
    """The rest of them."""
    test_a_replica_is_read_and_judged_without_a_further_word(name, tmp_path)


MENDED = (
    "labview.lvm",
    "titled-blocks.csv",
    "one-row.txt",
    "labels-with-units.log",
    "messages.jsonl",
    "edge-impulse.json",
    "matlab-mobile.csv",
    "physics-toolbox-axes.csv",
    "universal-robots.csv",
    "influx.csv",
)
"""Shapes that were not read when they were written."""


@pytest.mark.parametrize("name", MENDED)
def test_a_shape_that_was_not_read_is_read(name, tmp_path):
    """Blank first columns, titled blocks, units behind values, instants in JSON, months by name, axes at rest."""
    assert told(tmp_path / name, (KNOWN | NEWER)[name]) == ""


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted({*KNOWN, *NEWER} - {*MENDED, *ASKED}))
def test_shapes_that_were_written_after_the_readers_are_read(name, tmp_path):
    """The rest of them."""
    test_a_shape_that_was_not_read_is_read(name, tmp_path)


@pytest.mark.slow
def test_binary_shapes_are_read(tmp_path):
    """Each format's own library writes them; the one that states no rate is a question."""
    for name, write in binaries().items():
        answer = told(tmp_path / name, write)
        assert answer == "" if name not in ASKED else "states no sampling rate" in answer


def test_numbers_in_parentheses_without_a_name_are_a_question(tmp_path):
    """A first one that rises by 5 may count milliseconds."""
    assert "'column 1 [ms]'" in told(tmp_path / "record.txt", NEWER["micropython.txt"])


def test_instants_in_an_unknown_form_are_a_question(tmp_path):
    """A clock that is not understood is never passed over: its readings may be samples."""
    lines = [f"{12 + n // 1200} o'clock 13:{n // 20 % 60:02d},{100 + n % 3}" for n in range(300)]
    (tmp_path / "record.csv").write_text("time,force\n" + "\n".join(lines))
    with pytest.raises(DiagnosisError, match=r"column 'time' holds text: .* no instant that is known; state the rate"):
        judged_runs(tmp_path / "record.csv")


def read(tmp_path, text):
    """Recording of a text or of bytes."""
    path = tmp_path / "record"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_recording(path)


@pytest.mark.parametrize(
    ("text", "columns"),
    [
        ("t:0,force:1.5\nt:1,force:2.5\nt:2,force:1.0\n", {"t": [0, 1, 2], "force": [1.5, 2.5, 1.0]}),
        ("F=1.5\nstart\nF=2.5\nF=1e1\n", {"F": [1.5, 2.5, 10.0]}),
        ("I (10) a: F=1\nI (20) a: F=-2\nI (30) a: F=3\n", {"time": [10, 20, 30], "F": [1, -2, 3]}),
        ('{"t": 0, "x": {"N": 1}}\n{"t": 1, "x": {"N": 2}}\n{"t": 2, "x":', {"t": [0, 1], "x.N": [1, 2]}),
        ("[[0, 1.5], [1, 2.5], [2, 1]]", {"column 1": [0, 1, 2], "column 2": [1.5, 2.5, 1]}),
        ('{"a": {"force": [1, null, 3]}, "fs": 100}', {"a/force": [1, np.nan, 3]}),
    ],
)
def test_what_is_no_table_becomes_one(text, columns, tmp_path):
    """Labelled values, a log, JSON in three forms, whose last line may be torn off: the numbers as written."""
    recording = read(tmp_path, text)
    assert list(recording.columns) == list(columns)
    for name, values in columns.items():
        np.testing.assert_array_equal(recording.columns[name], values)


@pytest.mark.parametrize(
    "text",
    [
        "time,force\n0,1.5\n1,2.5\n",
        "Force: 12 N\n1.5\n2.5\n",
        "a: 1\nb: 2\nc: 3\n",
        ",".join(f"c{k}" for k in range(100)) + "\n" + "\n".join(",".join(["1"] * 100) for _ in range(3)),
    ],
)
def test_a_table_is_left_as_it_is(text):
    """A heading with a colon, settings alone, and a wide table of few readings are none of the other forms."""
    assert arranged(text.splitlines()) is None


def test_a_recorder_that_was_started_again_is_read_by_its_longest_block(tmp_path):
    """The block, its line and the sizes of both are said; a clock that falls amid a block is still refused."""
    (tmp_path / "b.csv").write_text(str(SHAPES["two-blocks.csv"]()))
    recording = read_recording(tmp_path / "b.csv")
    assert "2 blocks of 12000, 400 rows of which the one from line 2 on is read" in recording.form
    assert [len(values) for values in recording.columns.values()] == [12_000, 12_000]
    falls = "t [s],F [N]\n" + "".join(f"{k % 50},{k % 7}\n" for k in range(100))
    (tmp_path / "f.csv").write_text(falls)
    with pytest.raises(DiagnosisError, match="time does not rise"):
        judged_files(str(tmp_path / "f.csv"), RecordingOptions(kind="series"))


def test_days_of_a_spreadsheet_are_no_seconds(tmp_path):
    """Days since 1899 in steps of 0.5 ms are told from seconds of the day, which have the same size."""
    days = "Date,F [N]\n" + "".join(f"{44663.5 + t / 86400.0:.12f},{f:.4f}\n" for t, f in zip(TIME, FORCE, strict=True))
    seconds = "Date,F [N]\n" + "".join(f"{44663.5 + t:.6f},{f:.4f}\n" for t, f in zip(TIME, FORCE, strict=True))
    for text in (days, seconds):
        (tmp_path / "d.csv").write_text(text)
        run = judged_files(str(tmp_path / "d.csv"))[0].runs[0]
        assert f"at {RATE:g} Hz" in run.notes[0]


def test_axes_are_judged_each_and_one_that_cannot_be_says_why(tmp_path):
    """An accelerometer's axis in which nothing moves has no cycle; the others are judged."""
    noise = 0.01 * np.random.default_rng(0).normal(size=len(TIME))
    rows = (f"{t:.5f},{f:.5f},{n:.5f}" for t, f, n in zip(TIME, FORCE, noise, strict=True))
    (tmp_path / "a.csv").write_text("time [s],x [m/s^2],y [m/s^2]\n" + "\n".join(rows))
    (file,) = judged_files(str(tmp_path / "a.csv"))
    assert [run.name for run in file.runs] == ["x"]
    assert file.error.startswith("column 'y': no line of the spectrum stands out")


def test_an_archive_that_claims_more_than_it_holds_is_refused(tmp_path):
    """The head of an array says how many readings follow; more than the bytes that follow are a damaged file."""
    content = bytearray(SHAPES["arrays.npz"]())
    place = content.index(b"(12000,)")
    content[place : place + 8] = b"(99999,)"
    with pytest.raises(DiagnosisError, match=r"claims 99,999 readings|can't be read"):
        read(tmp_path, bytes(content))


def test_what_is_no_json_says_so(tmp_path):
    """Lists of unequal length, and a text that begins as JSON does, end in one line."""
    for text, said in (("[[1, 2], [1]]", "unequal length"), ('{"a": 1,\n"b"}\n{"c"}', "is no JSON")):
        with pytest.raises(DiagnosisError, match=said):
            read(tmp_path, text)
    assert json.loads(str(SHAPES["table.json"]()))["rate_hz"] == RATE
