"""Recorders' files: every dialect gives the same forces, and what can't be a force is never taken for one."""

import hashlib
import io
import os
import sys
import threading

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from scipy.io import savemat, wavfile

from chaosgym.errors import DiagnosisError
from chaosgym.recordings import lines
from chaosgym.recordings.columns import choose_force, forces
from chaosgym.recordings.read import read_recording

FORCES = [48.25, 49.5, 47.75, 48.0, 50.25]

DIALECTS = {
    "plain": "48.25\n49.5\n47.75\n48\n50.25\n",
    "heading": "peak force [N]\n48.25\n49.5\n47.75\n48\n50.25\n",
    "decimal comma": "48,25\n49,5\n47,75\n48,0\n50,25\n",
    "decimal comma and heading": "Kraft [N]\n48,25\n49,5\n47,75\n48,0\n50,25\n",
    "Excel in half of Europe": "Zyklus;Kraft [N]\n1;48,25\n2;49,5\n3;47,75\n4;48\n5;50,25\n",
    "kilonewton": "cycle,force (kN)\n1,0.04825\n2,0.0495\n3,0.04775\n4,0.048\n5,0.05025\n",
    "unit in the name": "stamp,peak_N\n17000000,48.25\n17000001,49.5\n17000003,47.75\n17000004,48\n17000005,50.25\n",
    "a speed beside": "rpm,peak_N\n1140,48.25\n1141,49.5\n1139,47.75\n1140,48\n1140,50.25\n",
    "tabs": "no\tforce / N\n1\t48.25\n2\t49.5\n3\t47.75\n4\t48\n5\t50.25\n",
    "blanks": "# recorder 7\n 1   48.25\n 2   49.5\n 3   47.75\n 4   48.0\n 5   50.25\n",
    "a line of units": "Nr;F\n-;N\n1;48.25\n2;49.5\n3;47.75\n4;48\n5;50.25\n",
    "comments and blank lines": "% rig A\n\n# gain 3\nF [N]\n48.25\n\n49.5\n47.75\n48\n50.25\n\n",
    "quotes": '"cycle","F [N]"\n1,"48.25"\n2,"49.5"\n3,"47.75"\n4,"48"\n5,"50.25"\n',
    "preamble": "Recorder X100\nSerial: 4711\ncycle,F [N]\n1,48.25\n2,49.5\n3,47.75\n4,48\n5,50.25\n",
}


@pytest.mark.parametrize("dialect", DIALECTS)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16"])
def test_every_dialect_gives_the_same_forces(dialect, encoding, tmp_path):
    """Delimiter, decimal mark, heading, units, comments and encoding do not change the forces in newton."""
    path = tmp_path / "Spitzenkräfte 测量.csv"
    path.write_bytes(DIALECTS[dialect].encode(encoding))
    signal = choose_force(read_recording(path))
    np.testing.assert_allclose(signal.values, FORCES, rtol=1e-12)


def binary(kind, path):
    """Write the forces in a binary format."""
    if kind == "parquet":
        pq.write_table(pa.table({"cycle": range(5), "force [N]": FORCES}), path)
    elif kind == "npy":
        np.save(path, np.array(FORCES))
    elif kind == "mat":
        savemat(path, {"force": np.array(FORCES), "comment": "rig A"})
    else:
        wavfile.write(path, 1000, np.array(FORCES, dtype=np.float32))


@pytest.mark.parametrize("kind", ["parquet", "npy", "mat", "wav"])
def test_binary_formats_give_the_same_forces(kind, tmp_path):
    """Told by their first bytes, whatever the name ends in."""
    path = tmp_path / f"record.{kind}"
    binary(kind, path)
    path = path.rename(tmp_path / "record")
    np.testing.assert_allclose(choose_force(read_recording(path)).values, FORCES, rtol=1e-6)


def test_standard_input_is_read_like_a_file(monkeypatch):
    """``-`` is standard input."""
    monkeypatch.setattr(sys, "stdin", io.StringIO(DIALECTS["Excel in half of Europe"]))
    assert choose_force(read_recording("-")).values.tolist() == FORCES


def test_a_hash_tells_files_apart(tmp_path):
    """The hash is that of the bytes, as sha256sum prints it."""
    path = tmp_path / "a.csv"
    path.write_bytes(b"1\n2\n2\n")
    assert read_recording(path).sha256 == hashlib.sha256(b"1\n2\n2\n").hexdigest()


MANY = "\n".join(",".join(row) for row in ([f"c{k}" for k in range(1000)], ["1"] * 1000, ["2"] * 1000, ["1"] * 1000))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1\n2\nx\n", r"line 3: 'x' is not a finite number"),
        ("1\nnan\n3\n", r"line 2: 'nan' is not a finite number"),
        ("40\n\n\nforty\n", r"line 4: 'forty'"),
        ("peak force [N]\n", "no numbers"),
        ("", "no numbers"),
        ("a [N],a [N]\n1,2\n", "two columns alike"),
        (
            "left [N],right [N]\n1,2\n3,1\n",
            "several columns that could be forces: 'left', 'right'; state --read column=NAME",
        ),
        (MANY, r"could be forces: 'c0', .* 'c11' and 988 more; state --read column=NAME"),
        ("cycle,rpm\n1,1140\n2,1141\n3,1139\n", "no column that could be a force"),
        ("1\n2\n3\n4\n5\n6\n", "rises like a counter"),
        ("angle [deg]\n1\n2\n1\n", "no column that could be a force"),
        ("peak [N]\nnan\nnan\n", r"a force \('peak', line 2: 'nan' is not a finite number\)"),
        ("a,b\n1,2\n1,2,3\n", "line 3 has 3 columns; allowed: 2"),
    ],
)
def test_unusable_files_say_why(text, message, tmp_path):
    """One line that names the file and the line, or what to do."""
    path = tmp_path / "peaks.csv"
    path.write_text(text)
    with pytest.raises(DiagnosisError, match=message) as error:
        choose_force(read_recording(path))
    assert "\n" not in str(error.value)


def test_a_column_is_taken_by_name_number_and_unit(tmp_path):
    """``--column`` takes the name without its unit, or a number; ``unit`` says what the file does not."""
    path = tmp_path / "two.csv"
    path.write_text("left,right\n1,2\n3,1\n2,2\n")
    assert choose_force(read_recording(path), "RIGHT").values.tolist() == [2.0, 1.0, 2.0]
    assert choose_force(read_recording(path), "1", "kN").values.tolist() == [1000.0, 3000.0, 2000.0]
    with pytest.raises(DiagnosisError, match="no column 'middle'; its columns of numbers: 'left', 'right'"):
        choose_force(read_recording(path), "middle")
    with pytest.raises(DiagnosisError, match="no column 'lefft'; did you mean left"):
        choose_force(read_recording(path), "lefft")
    assert choose_force(read_recording(path), "left", "V").unit == "V"
    with pytest.raises(DiagnosisError, match="'left' is in furlong, no unit that is known; allowed: N"):
        choose_force(read_recording(path), "left", "furlong")
    path.write_text("shaft [kN]\n1\n3\n2\n")
    assert "column 'shaft' (N as stated, instead of kN)" in choose_force(read_recording(path), "shaft", "N").described
    path.write_text("peak [N]\nnan\nnan\n")
    with pytest.raises(DiagnosisError, match=r"column 'peak', line 2: 'nan' is not a finite number"):
        choose_force(read_recording(path), "peak")


@pytest.mark.parametrize(
    ("title", "scale", "values", "unit"),
    [
        ("Acc [g]", None, [1.0, 3.0, 2.0], "g"),
        ("F [daN]", None, [10.0, 30.0, 20.0], "N"),
        ("Channel A [mV]", "100 mV/N", [0.01, 0.03, 0.02], "N"),
        ("Channel A [V]", "100 mV/N", [10.0, 30.0, 20.0], "N"),
        ("Channel A [V]", "2 kN/V", [2000.0, 6000.0, 4000.0], "N"),
        ("Channel A [mV]", "10 mV/g", [0.1, 0.3, 0.2], "g"),
        ("Channel A [mV]", "10 mV/m/s2", [0.1, 0.3, 0.2], "m/s2"),
        ("plain", "50 N/FS", [50.0, 150.0, 100.0], "N"),
        ("plain", "12,5 N/FS", [12.5, 37.5, 25.0], "N"),
    ],
)
def test_other_quantities_keep_their_unit_or_are_calibrated(title, scale, values, unit, tmp_path):
    """An acceleration stays in g; a voltage becomes a force by the sensor's sensitivity or the amplifier's range."""
    path = tmp_path / "record.csv"
    path.write_text(f"{title}\n1\n3\n2\n")
    signal = choose_force(read_recording(path), scale=scale)
    np.testing.assert_allclose(signal.values, values)
    assert signal.unit == unit


@pytest.mark.parametrize("scale", ["mV/N", "0 mV/N", "-3 mV/N", "nan mV/N", "1e999 mV/N", "3 apples/pear", "3 g/N"])
def test_what_is_no_calibration_is_refused(scale, tmp_path):
    """One line that says what is allowed."""
    path = tmp_path / "record.csv"
    path.write_text("Channel A [mV]\n1\n3\n2\n")
    with pytest.raises(DiagnosisError, match=r"scale = .* (is no calibration|does not fit)"):
        choose_force(read_recording(path), scale=scale)


def test_a_counter_is_no_force_even_when_it_is_named(tmp_path):
    """Cycle numbers as forces would give a life, and a wrong one."""
    path = tmp_path / "counter.csv"
    path.write_text("cycle,peak\n" + "".join(f"{k},{40 + k % 3}\n" for k in range(30)))
    with pytest.raises(DiagnosisError, match="equal steps and can't be a force"):
        choose_force(read_recording(path), "cycle")


def test_runs_are_columns_of_unequal_length(tmp_path):
    """A run that ends early ends in blanks; a blank between two readings is refused."""
    path = tmp_path / "runs.csv"
    path.write_text("calm,wild\n1,2\n3,1\n2,\n")
    assert [signal.values.tolist() for signal in forces(read_recording(path))] == [[1.0, 3.0, 2.0], [2.0, 1.0]]
    path.write_text("calm,wild\n1,2\n3,\n2,1\n")
    with pytest.raises(DiagnosisError, match="line 3: a blank between two numbers"):
        forces(read_recording(path))


@pytest.mark.parametrize(("row", "count"), [('"{}', 180), ('"{},1', 180), ('{},"1', 180)])
@pytest.mark.parametrize("every", [1, 3, 180])
def test_no_reading_is_dropped_for_a_quote(tmp_path, row, count, every):
    """A line with a quote that is not closed is counted and said, wherever it stands and however many there are."""
    plain = row.replace('"', "")
    lines = [(row if i % every == 0 else plain).format(100 + i % 3) for i in range(count)]
    path = tmp_path / "torn.csv"
    path.write_text("force [N]" + ",b" * plain.count(",") + "\n" + "\n".join(lines) + "\n")
    torn = len(range(0, count, every))
    with pytest.raises(DiagnosisError, match=f"line 2: a quote is not closed, as in {torn} of {count} lines"):
        choose_force(read_recording(path), "force")


OTHER_FILES = {
    "photo.png": b"\x89PNG\r\n\x1a\n" + bytes(range(256)),
    "report.pdf": b"%PDF-1.4\n%\xe2\xe3\n1 0 obj\n<<>>\nendobj\n",
    "notes.txt": b"Notes of the rig.\nNothing else.\n",
    "empty.csv": b"",
    "code.py": b"import os\n\nfor k in range(3):\n    print(k)\n",
    "letter.docx": b"PK\x03\x04" + bytes(80),
    "torn.parquet": b"PAR1" + bytes(99),
    "torn.mat": b"MATLAB 5.0 MAT-file" + b"\xf4" * 300,
    "torn.unv": b"    -1\n    58\nx\n    -1\n",
    "random.bin": b"\x07\x00\xff" * 500,
}


@pytest.mark.parametrize("name", OTHER_FILES)
def test_files_that_are_no_recordings_say_so_in_one_line(name, tmp_path):
    """What lies beside recordings in a folder never stops them with another error."""
    (tmp_path / name).write_bytes(OTHER_FILES[name])
    with pytest.raises(DiagnosisError, match=name) as error:
        choose_force(read_recording(tmp_path / name))
    assert "\n" not in str(error.value)


STAMPS = [f"12:{i // 60:02d}:{i % 60:02d};{i},5" for i in range(600)]

LONG_TEXTS = {
    "a footer": "t;force\n" + "".join(f"{i};{i % 7}\n" for i in range(600)) + "end\nof it\n",
    "a further part": "t,f\n" + "".join(f"{i},{i % 7}\n" for i in range(300)) + "***\n" + "a,b\n1,2\n" * 40,
    "a restart": 2 * ("t,force\n" + "".join(f"{i},{i % 7}\n" for i in range(300))),
    "blank lines": "t\tforce\n" + "".join(f"{i}\t{i % 7}\n" + "\n" * (i % 5 == 0) for i in range(600)),
    "instants": "t;force [N]\n" + "\n".join(STAMPS),
    "instants that end": "t;force [N]\n" + "\n".join([*STAMPS, "later;3,5", "later;4"]),
    "labels": "".join(f"t:{i},force:{i % 7}.5\n" for i in range(600)),
    "missing readings": "force\n" + "".join(f"{i % 7 if i % 100 else 'OVR'}\n" for i in range(600)) + "\n\n",
    "quotes": "t,force\n" + "".join(f'{i},"1,{i % 7}00.5"\n' for i in range(600)),
    "text": "state,force\n" + "".join(f"on,{i % 7}\n" for i in range(600)),
    "a wrong reading": "force\n" + "".join(f"{i % 7 if i != 450 else 'x'}\n" for i in range(600)),
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("name", LONG_TEXTS)
def test_a_text_is_the_same_in_blocks_of_any_size(name, encoding, tmp_path, monkeypatch):
    """Blocks of a hundred lines, as texts of many megabytes are read in, change no reading, line, problem or note."""
    path = tmp_path / "record.csv"
    path.write_text(LONG_TEXTS[name], encoding=encoding)
    whole = read_recording(path)
    monkeypatch.setattr(lines, "BLOCK", 1024)
    parts = read_recording(path)
    assert {key: values.tolist() for key, values in parts.columns.items()} == {
        key: pytest.approx(values.tolist(), nan_ok=True) for key, values in whole.columns.items()
    }
    assert list(parts.lines) == list(whole.lines)
    for field in ("form", "units", "problems", "texts", "rates"):
        assert getattr(parts, field) == getattr(whole, field)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes")
def test_pipes_and_devices_never_hang(tmp_path):
    """A pipe that nothing writes into and a device are refused within seconds; a pipe that is written is read."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    with pytest.raises(DiagnosisError, match="into which nothing was written"):
        read_recording(pipe)
    with pytest.raises(DiagnosisError, match="is a device"):
        read_recording("/dev/zero")
    writer = threading.Thread(target=pipe.write_text, args=("48.5\n47\n48\n" * 20000,))
    writer.start()
    assert len(choose_force(read_recording(pipe)).values) == 60000
    writer.join()


def test_a_file_that_is_too_large_is_refused_at_once(tmp_path):
    """2 GiB, of which nothing is read."""
    path = tmp_path / "large.csv"
    with open(path, "wb") as file:
        file.truncate(2**31)
    with pytest.raises(DiagnosisError, match=r"holds 2\.0 GiB; allowed: up to 1 GiB"):
        read_recording(path)


def test_a_text_of_very_many_columns_is_refused_at_once(tmp_path):
    """As many as no recorder has channels: one line that says how many there may be."""
    path = tmp_path / "wide.csv"
    path.write_text("\n".join(",".join(str(place % 7 + row) for place in range(5000)) for row in range(3)))
    with pytest.raises(DiagnosisError, match="has 5000 columns; allowed: 4096"):
        read_recording(path)


def test_standard_input_is_read_as_bytes(monkeypatch):
    """A file of another encoding reads the same behind a pipe as by its name."""
    content = "Kräfte [N]\n48.25\n49.5\n47.75\n48\n50.25\n".encode("latin-1")
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(content), encoding="utf-8"))
    np.testing.assert_array_equal(choose_force(read_recording("-")).values, FORCES)


def test_of_a_recorder_that_began_anew_the_longest_block_is_read(tmp_path):
    """Readings, and notes beside them, of 20 rows and then 30 below another heading."""
    blocks = [[f"{row},{20.0 + 7 * row % 11},ok\n" for row in range(size)] for size in (20, 30)]
    (tmp_path / "record.csv").write_text("cycle,force [N],note\n".join(["", *map("".join, blocks)]))
    recording = read_recording(tmp_path / "record.csv")
    np.testing.assert_array_equal(choose_force(recording).values, 20.0 + 7 * np.arange(30) % 11)
    assert "2 blocks of 20, 30 rows" in recording.form


def test_readings_in_long_rows_are_turned(tmp_path):
    """A row of a name and a thousand forces, alone or below one of instants; the form says so."""
    force = 20.0 + np.arange(1000) * 7 % 11
    rows = {
        name: ",".join([name, *map(str, values)])
        for name, values in (("time [s]", 0.001 * np.arange(1000)), ("force [N]", force))
    }
    for name, written in (("one long row", [rows["force [N]"]]), ("2 long rows", list(rows.values()))):
        (tmp_path / "record.csv").write_text("\n".join(written) + "\n")
        recording = read_recording(tmp_path / "record.csv")
        np.testing.assert_array_equal(recording.columns["force"], force)
        assert name in recording.form
