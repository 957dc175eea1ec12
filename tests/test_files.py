"""Files are whole or not there, and one process at a time writes into a folder."""

import io
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from chaosgym.errors import ChaosgymError, DatasetError, UnfinishedError
from chaosgym.files import (
    array_of,
    claimed,
    contents,
    held,
    is_empty,
    made_whole,
    toml_of,
    unpacked,
    write_atomically,
)
from chaosgym.parquet import parquet_of

HOLD = """
import sys, time
from pathlib import Path
from chaosgym.files import held
with held(Path(sys.argv[1])):
    print("held", flush=True)
    time.sleep(60)
"""


def test_a_failed_write_leaves_the_old_file_and_no_other(tmp_path):
    """The old content stays, and the temporary file is gone."""
    path = tmp_path / "a.txt"
    write_atomically(path, lambda temporary: temporary.write_text("old"))

    def fail(temporary):
        temporary.write_text("half")
        raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_atomically(path, fail)
    assert [one.name for one in tmp_path.iterdir()] == ["a.txt"]
    assert path.read_text() == "old"


def test_a_file_that_another_process_writes_meanwhile_is_replaced(tmp_path):
    """Two processes that fill one cache both end well: the last to end wins."""
    target = tmp_path / "cached.json"

    def write(temporary):
        temporary.write_text("this")
        target.write_text("the other's")

    write_atomically(target, write)
    assert target.read_text() == "this"


def test_contents_reach_the_disk_before_the_name(tmp_path, monkeypatch):
    """The file is flushed before it is renamed, and the folder after: a power cut leaves no empty file."""
    order = []
    monkeypatch.setattr(os, "fsync", lambda descriptor: order.append("flush"))
    replace, open_file = os.replace, os.open
    opened = []
    monkeypatch.setattr(
        os, "open", lambda path, flags: (opened.append((path.suffix, flags)), open_file(path, flags))[1]
    )
    monkeypatch.setattr(os, "replace", lambda *paths: (order.append("rename"), replace(*paths)))
    write_atomically(tmp_path / "a.txt", lambda temporary: temporary.write_text("new"))
    assert order == ["flush", "rename", "flush"]
    assert opened == [(".tmp", os.O_RDWR), ("", os.O_RDONLY)], "Windows flushes only what is open for writing"


def test_a_folder_is_held_by_one_process(tmp_path):
    """A second process is told at once; after the first was killed the folder is free, and its leftovers are gone."""
    with subprocess.Popen([sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE) as other:
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(UnfinishedError, match="another process writes into"), held(tmp_path):
            pass
        (tmp_path / ".plan.json.17.chaosgym.tmp").write_text("half")
        other.kill()
    assert is_empty(tmp_path)
    with held(tmp_path):
        assert not list(tmp_path.glob(".*.tmp"))


def test_a_folder_is_whole_or_not_there(tmp_path):
    """What a killed process left of it is gone with the next one; a failure leaves nothing; what is there stays."""
    half = tmp_path / ".out.chaosgym.tmp"
    (half / "deep").mkdir(parents=True)
    (half / "deep" / "half").write_text("half")
    with pytest.raises(OSError, match="disk full"), made_whole(tmp_path / "out"):
        raise OSError("disk full")
    assert list(tmp_path.iterdir()) == []
    (half / "deep").mkdir(parents=True)
    (tmp_path / "out").mkdir()
    with made_whole(tmp_path / "out") as folder:
        (folder / "a").write_text("whole")
        assert is_empty(tmp_path / "out")
    assert [path.relative_to(tmp_path).as_posix() for path in sorted(tmp_path.rglob("*"))] == ["out", "out/a"]
    with pytest.raises(DatasetError, match="exists and is no empty folder"), made_whole(tmp_path / "out"):
        pass
    assert (tmp_path / "out" / "a").read_text() == "whole"


def test_arrays_are_what_was_saved():
    """Names, kinds and values; what holds objects is refused rather than unpickled."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, a=np.arange(3), b=np.ones((2, 2), np.float32))
    found = unpacked(buffer.getvalue(), 10_000)
    assert sorted(found) == ["a", "b"]
    assert found["a"].tolist() == [0, 1, 2]
    assert (found["b"].dtype, found["b"].shape) == (np.float32, (2, 2))
    buffer = io.BytesIO()
    np.savez(buffer, a=np.array([print], dtype=object))
    with pytest.raises(ValueError, match="pickle"):
        unpacked(buffer.getvalue(), 10_000)


def _archive(*members):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for number, member in enumerate(members):
            archive.writestr(f"{number}.npy", member)
    return buffer.getvalue()


def _array(shape):
    """Bytes of an array of eight bytes whose head claims a shape."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": "<f8", "fortran_order": False, "shape": shape})
    return buffer.getvalue() + bytes(8)


def test_the_bound_holds_for_all_members_together():
    """Two arrays that fill it to the last byte are read; one byte less, and they are not."""
    size = len(_array((1,)))
    assert len(unpacked(_archive(_array((1,)), _array((1,))), 2 * size)) == 2
    with pytest.raises(ValueError, match=f"unpacked it has {2 * size} bytes; allowed: up to {2 * size - 1}"):
        unpacked(_archive(_array((1,)), _array((1,))), 2 * size - 1)


def test_an_array_that_claims_more_than_any_computer_has_is_refused():
    """2^61 bytes cannot be had."""
    with pytest.raises(ValueError, match=r"^an array claims 2305843009213693952 bytes and has 8"):
        unpacked(_archive(_array((2**58,))), 10_000)


def test_only_what_this_package_wrote_is_deleted(tmp_path):
    """Temporary files of others, and those in folders that were not claimed, stay."""
    (tmp_path / "notes").mkdir()
    (tmp_path / "chunks").mkdir()
    others = [tmp_path / ".draft.tmp", tmp_path / "notes" / ".draft.tmp", tmp_path / "notes" / ".a.7.chaosgym.tmp"]
    own = [tmp_path / ".plan.json.7.chaosgym.tmp", tmp_path / "chunks" / ".0.parquet.7.chaosgym.tmp"]
    for path in (*others, *own):
        path.write_text("x")
    with held(tmp_path, "chunks"):
        assert [path.exists() for path in others] == [True] * 3
        assert not any(path.exists() for path in own)


def test_a_folder_of_others_is_not_claimed(tmp_path):
    """New, empty and begun folders are; one with anything else, or a file, is refused."""
    assert claimed(tmp_path / "new", "mark", what="run") == tmp_path / "new"
    assert claimed(tmp_path, "mark", what="run") == tmp_path
    (tmp_path / "thesis.txt").write_text("years")
    for path in (tmp_path, tmp_path / "thesis.txt"):
        with pytest.raises(DatasetError, match="exists and is no run; choose another folder"):
            claimed(path, "mark", what="run")
    (tmp_path / "mark").write_text("")
    assert claimed(tmp_path, "mark", what="run") == tmp_path


@pytest.mark.skipif(os.name != "posix", reason="links, modes and pipes of POSIX")
def test_overwriting_keeps_link_and_mode(tmp_path):
    """The file behind a link is replaced and the link stays; a private file stays private, also while it is written."""
    (tmp_path / "real.csv").write_text("old")
    (tmp_path / "real.csv").chmod(0o600)
    (tmp_path / "link.csv").symlink_to("real.csv")
    seen = []

    def write(temporary):
        seen.append(temporary.stat().st_mode & 0o777)
        temporary.write_text("new")

    write_atomically(tmp_path / "link.csv", write)
    assert (tmp_path / "link.csv").is_symlink()
    assert (tmp_path / "real.csv").read_text() == "new"
    assert [*seen, (tmp_path / "real.csv").stat().st_mode & 0o777] == [0o600, 0o600]


@pytest.mark.skipif(os.name != "posix", reason="pipes and devices of POSIX")
def test_pipes_and_devices_are_neither_written_over_nor_read(tmp_path):
    """A pipe stays a pipe; what has no end is not read."""
    os.mkfifo(tmp_path / "pipe")
    for path, kind in ((tmp_path / "pipe", "a pipe"), ("/dev/null", "a device"), (tmp_path, "a folder")):
        with pytest.raises(ChaosgymError, match=f"is {kind}; allowed: a file"):
            write_atomically(path, lambda temporary: temporary.write_text("x"))
        with pytest.raises(ValueError, match=f"it is {kind}, not a file"):
            contents("/dev/zero" if kind == "a device" else path, 100)
    assert (tmp_path / "pipe").is_fifo()


def test_files_are_read_as_far_as_a_bound(tmp_path):
    """A file of the bound is read, one byte more is refused; a name that no file can have too."""
    (tmp_path / "a").write_bytes(bytes(100))
    assert contents(tmp_path / "a", 100) == bytes(100)
    with pytest.raises(ValueError, match="it has 100 bytes; allowed: up to 99"):
        contents(tmp_path / "a", 99)
    for name in ("gone", "a\0b", "x" * 5000):
        with pytest.raises(ValueError, match=r"can't be read|null"):
            contents(tmp_path / name, 99)


@pytest.mark.parametrize("text", ["a = " + "[" * 3000, "a = " + "7" * 4400, "a = ", b"\xff\xfe"])
def test_no_toml_is_one_line(text, tmp_path):
    """Brackets, digits and bytes that the parser chokes on."""
    (tmp_path / "a.toml").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(ValueError, match=r"is not valid TOML: .") as told:
        toml_of(tmp_path / "a.toml")
    assert "\n" not in str(told.value)
    (tmp_path / "a.toml").write_text("a = 7")
    assert toml_of(tmp_path / "a.toml") == ("a = 7", {"a": 7})


def test_a_table_that_claims_many_cells_is_refused(tmp_path):
    """A few bytes of Parquet can stand for millions of equal rows."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    pq.write_table(pa.table({"a": pa.array(np.zeros(1_000))}), tmp_path / "a.parquet")
    assert parquet_of(tmp_path / "a.parquet").num_rows == 1000
    assert parquet_of(tmp_path / "a.parquet", ["a"]).column_names == ["a"]
    with pytest.raises(ValueError, match=r"be read as Parquet: ."):
        parquet_of(tmp_path / "b.parquet")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chaosgym.parquet.MOST_CELLS", 1000)
        assert parquet_of(tmp_path / "a.parquet").num_rows == 1000
        patch.setattr("chaosgym.parquet.MOST_CELLS", 999)
        with pytest.raises(ValueError, match="it claims 1000 cells; allowed: up to 999"):
            parquet_of(tmp_path / "a.parquet")


@pytest.mark.parametrize("kind", ["text", "list of texts"])
def test_a_text_that_is_repeated_counts_as_often(tmp_path, kind):
    """A file of 1 kB that refers to 8 kB a thousand times claims a million cells, and is read where so many may be."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    column = pa.array(1000 * ["x" * 8000] if kind == "text" else 500 * [2 * ["x" * 8000]])
    pq.write_table(pa.table({"a": column}), tmp_path / "a.parquet", store_schema=False)
    assert parquet_of(tmp_path / "a.parquet").column("a").to_pylist() == column.to_pylist()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chaosgym.parquet.MOST_CELLS", 999_999)
        with pytest.raises(ValueError, match="it claims 1000000 cells; allowed: up to 999999"):
            parquet_of(tmp_path / "a.parquet")


def test_an_array_has_the_bytes_that_its_head_claims():
    """One number too few or too many, objects, and text that is no head."""
    buffer = io.BytesIO()
    np.save(buffer, np.arange(3.0))
    assert array_of(buffer.getvalue()).tolist() == [0.0, 1.0, 2.0]
    for content in (buffer.getvalue()[:-8], buffer.getvalue() + bytes(8), b"no array", buffer.getvalue()[:20]):
        with pytest.raises(ValueError, match=r"array|magic|EOF"):
            array_of(content)
