"""What is computed and committed is current: made from the files that are there now, by content."""

import runpy
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent

LAST_DIGITS = "made before machines had the same bits on every processor: chaotic jobs differ, periodic ones by 1e-6"
MACHINES = ("ImpactBeam", "SliderCrank")
TRAINED = ("ImpactBeamWear-v1", *(f"{name}Tolerance-v1{fleet}" for name in MACHINES for fleet in ("", "-fleet")))
COMPARED = (*TRAINED, "ImpactBeam-v1", "SliderCrank-v1", "SliderCrankWear-v1")

STALE: dict[str, str] = {
    "picture:tradeoff-slider-crank": "its rung fine has one mode more; docs/tradeoff.md has it over random cranks",
    "jobs:other-simulator": LAST_DIGITS,
    **{
        f"scores:{name}": f"{LAST_DIGITS}; following and what is shipped were played anew, others not"
        for name in COMPARED
    },
}
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


def test_a_new_controller_makes_no_comparison_stale(tmp_path, monkeypatch):
    """What comparisons rest on stays the same beside a controller that has not played in them."""
    controllers = "src/chaosgym/control/controllers"
    for name in ("dodo.py", "tests/golden/golden.json", "datasets/datasets.toml", controllers):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (shutil.copytree if Path(ROOT, name).is_dir() else shutil.copy)(ROOT / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)

    def rests_on():
        made = runpy.run_path("dodo.py")
        return [each["file_dep"] for task in ("task_scores", "task_jobs") for each in made[task]()]

    before = rests_on()
    assert any(file.startswith(controllers) for file in before[0])
    Path(controllers, "bold.py").write_text("class Bold: ...\n")
    assert rests_on() == before
