"""Files are whole or not there, and one process at a time writes into a folder."""

import io
import os
import subprocess
import sys
import zipfile

import numpy as np
import pytest

from chaosgym.errors import UnfinishedError
from chaosgym.files import held, is_empty, unpacked, write_atomically

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
        (tmp_path / ".plan.json.17.tmp").write_text("half")
        other.kill()
    assert is_empty(tmp_path)
    with held(tmp_path):
        assert not list(tmp_path.glob("*.tmp"))


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
    with pytest.raises(ValueError, match=r"^an array claims more bytes than the computer has"):
        unpacked(_archive(_array((2**58,))), 10_000)
