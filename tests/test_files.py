"""Files are whole or not there, and one process at a time writes into a folder."""

import os
import subprocess
import sys

import pytest

from chaosgym.errors import UnfinishedError
from chaosgym.files import held, is_empty, write_atomically

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
    replace = os.replace
    monkeypatch.setattr(os, "replace", lambda *paths: (order.append("rename"), replace(*paths)))
    write_atomically(tmp_path / "a.txt", lambda temporary: temporary.write_text("new"))
    assert order == ["flush", "rename", "flush"]


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
