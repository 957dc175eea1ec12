"""What is computed and committed is current: made from the files that are there now, by content."""

import subprocess
import sys
from pathlib import Path

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


def test_an_edit_of_what_an_artefact_is_computed_from_is_noticed(tmp_path):
    """A changed byte makes an artefact stale; a changed date does not."""
    (tmp_path / "source.txt").write_text("one")
    (tmp_path / "dodo.py").write_text(
        "DOIT_CONFIG = {'backend': 'json', 'dep_file': 'made.json'}\n"
        "def task_part():\n    yield {'name': 'x', 'file_dep': ['source.txt'], 'actions': []}\n"
    )

    def letter(command):
        done = subprocess.run(
            [sys.executable, "-m", "doit", *command], cwd=tmp_path, capture_output=True, text=True, check=True
        )
        return next((line.split()[0] for line in done.stdout.splitlines() if "part:x" in line), "")

    listing = ["list", "--all", "--status"]
    assert letter(listing) == "R"
    letter(["run"])
    assert letter(listing) == "U"
    (tmp_path / "source.txt").touch()
    assert letter(listing) == "U"
    (tmp_path / "source.txt").write_text("two")
    assert letter(listing) == "R"
