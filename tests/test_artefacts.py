"""What is computed and committed is current: made from the files that are there now, by content."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

STALE: dict[str, str] = {}
"""Artefacts known to be stale, and why they still are. An entry goes with the commit that makes the artefact anew."""


def _status():
    """Letter of ``doit list`` for every artefact: U up to date, R to be run. It compares contents, not times."""
    command = [sys.executable, "-m", "doit", "list", "--all", "--status"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    lines = [line.split() for line in done.stdout.splitlines()]
    return {words[1]: words[0] for words in lines if ":" in words[1]}


def test_nothing_shipped_is_stale():
    """Every artefact was made, or accepted, with the present content of what it is computed from, or is listed."""
    found = _status()
    assert len(found) > 15
    stale = {name for name, letter in found.items() if letter != "U"}
    assert sorted(stale) == sorted(STALE), "doit NAME makes one anew, doit reset-dep NAME accepts one known to hold"


@pytest.mark.parametrize(
    ("edit", "letter"),
    [
        ("def f(x):\n    return x + 1\n", "U"),
        ('"""A module."""\n\n\ndef f(x):\n    """Add one."""\n    return x + 1  # one more\n', "U"),
        ("def f(x):\n    return x + 2\n", "R"),
        ("def f(x):\n    return '# x' + 1\n", "R"),
    ],
)
def test_an_artefact_is_stale_when_what_it_rests_on_means_something_else(tmp_path, edit, letter):
    """Another date, comment or docstring of a source makes nothing stale; another statement does."""
    config = (ROOT / "dodo.py").read_text().partition("GOLDEN =")[0]
    task = "def task_part():\n    yield {'name': 'x', 'file_dep': ['source.py'], 'actions': []}\n"
    (tmp_path / "dodo.py").write_text(config + task)
    (tmp_path / "source.py").write_text("def f(x):\n    return x + 1\n")

    def doit(*words):
        command = [sys.executable, "-m", "doit", *words]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=True).stdout.split()

    assert "R" in doit("list", "--all", "--status")
    doit("run", "part")
    kept = (tmp_path / "artefacts.txt").read_text()
    assert kept.startswith("part:x  source.py  ")
    (tmp_path / "source.py").write_text(edit)
    listed = doit("list", "--all", "--status")
    assert listed[listed.index("part:x") - 1] == letter
    doit("reset-dep", "part")
    assert ((tmp_path / "artefacts.txt").read_text() == kept) == (letter == "U")
