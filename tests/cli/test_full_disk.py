"""A full disk and an output that is closed end every command in one line, or without a word."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests import small_demo
from tests.cli.run import run
from tests.cli.test_answers import BEAM, DOCS, LONG, MAP, PEAKS, QUICK
from tests.test_kills import LEARNED

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")

MOON = f"{DOCS}/machines/moon-shaw-1983.toml"
WRITING = (
    "simulate impact-beam --cycles 300 --out p.csv",
    "simulate impact-beam --cycles 300 --out p.parquet",
    "simulate impact-beam --cycles 3 --series-out s.csv",
    "new-machine --out a.toml",
    f"judge {PEAKS} --plot d.pdf",
    f"judge {PEAKS} --plot d.png",
    f"overlay impact-beam {PEAKS} --out o.png",
    f"{MAP} --out sweep",
    f'judge {PEAKS} --load-rating "500 N" --report r.html',
    f"run-agent {BEAM} --out j.gif",
    f'compare {BEAM} --machines 2 --only "follow the demand" --out s.parquet',
    "train-classifier --data ../made --out learned",
    "demo --out demo",
)
"""Commands that write more than a thousand bytes into a file."""

SHORT = (f"design {MOON} --out r.html", "monitor --log l.csv")
"""Others, which tell as soon that they can't write."""


def ended(command, **options):
    """(Exit code, lines on standard error but for signs of progress) of a command of chaosgym."""
    program = [small_demo.__file__] if command.startswith("demo") else ["-m", "chaosgym"]
    words = [sys.executable, *program, *shlex.split(command)]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False, **options)
    return done.returncode, without_progress(done.stderr)


def without_progress(error):
    """Lines of a text that are no signs of progress."""
    progress = re.compile(r"\s*|.*\|.*|.*: \d+ s|./4 .*| +picture: .*|compiling .*|.*: up to .* processor time")
    return [line for line in error.replace("\r", "\n").splitlines() if not progress.fullmatch(line)]


def say_no_space(code, told):
    """One line on the disk, and the exit code of what could not be finished."""
    return code == 1 and len(told) == 1 and told[0].startswith("Error: [Errno 2")


@pytest.mark.parametrize("command", ["info", "show impact-beam --json", "design --template impact-beam", "--help"])
def test_an_output_on_a_full_disk_is_one_line(command):
    """/dev/full takes nothing: exit code 1, one line that says so, with a buffer of Python before it and without."""
    for unbuffered in ("", "1"):
        with Path("/dev/full").open("wb") as full:
            assert say_no_space(*ended(command, stdout=full, env=os.environ | {"PYTHONUNBUFFERED": unbuffered}))


def limited():
    """Let this process write no file of more than a thousand bytes."""
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))


def test_a_picture_on_a_full_disk_is_one_line(tmp_path):
    """PDF, whose writer ends in an error of its own; nothing is left behind."""
    told = ended(f"judge {PEAKS} --plot d.pdf", cwd=tmp_path, stdout=subprocess.DEVNULL, preexec_fn=limited)
    assert say_no_space(*told)
    assert os.listdir(tmp_path) == []


@pytest.mark.slow
def test_every_command_ends_cleanly_on_a_full_disk_and_with_a_closed_output(tmp_path):
    """With /dev/full as output one line; with none at all a quick command says nothing, and does its work."""
    ended(f"{MAP} --out map", cwd=tmp_path, stdout=subprocess.DEVNULL)
    for name, forms in (LONG | QUICK).items():
        words = name.replace("-", " ", 1) if name.startswith("dataset-") else name
        command = f"{words} {forms.split(';')[0]}"
        if "brief" in command or name == "monitor":
            continue
        with Path("/dev/full").open("wb") as full:
            assert say_no_space(*ended(command, cwd=tmp_path, stdout=full)), command
        if name not in QUICK:
            continue
        fresh = re.sub(r"--(\S*out|fmu) (\S+)", r"--\1 second-\2", command)
        assert ended(fresh, cwd=tmp_path, preexec_fn=lambda: os.close(1)) == (0, []), command


@pytest.mark.slow
def test_every_file_on_a_full_disk_is_one_line(tmp_path):
    """No file may grow beyond a thousand bytes: one line, and none is left in parts."""
    folder = tmp_path / "limited"
    folder.mkdir()
    ended(f"sweep {LEARNED} --out ../made", cwd=folder, stdout=subprocess.DEVNULL)
    for command in WRITING:
        code, told = ended(command, cwd=folder, stdout=subprocess.DEVNULL, preexec_fn=limited)
        assert say_no_space(code, told), (command, code, told)
    left = [
        path
        for path in folder.rglob("*")
        if path.is_file() and (path.name != ".lock" and path.suffix not in (".json", ".toml"))
    ]
    assert left == []


PLACES = {
    "no folder": "nowhere/{}",
    "no folder, but a file": "file/{}",
    "a file system that is only read": "/proc/{}",
    "a name that no file can have": "x" * 300 + "{}",
}
"""Where nothing can be written, whoever asks."""


@pytest.mark.parametrize(
    "place", [pytest.param(one, marks=() if "only read" in one else pytest.mark.slow) for one in PLACES]
)
@pytest.mark.parametrize("command", [one for one in (*WRITING, *SHORT) if not one.startswith(("demo", "train", MAP))])
def test_where_nothing_can_be_written_is_one_line_at_once(command, place, tmp_path, monkeypatch):
    """Exit 1 or 2, before minutes are spent on what can't be kept; what is there stays."""
    if command.startswith("compare") and place == "no folder":
        return  # it makes one, as for all files that it goes on with
    monkeypatch.chdir(tmp_path)
    (tmp_path / "file").write_text("mine")
    form = PLACES[place]
    command = re.sub(r"(--(?:out|plot|report|log|series-out) )(\S+)", lambda one: one[1] + form.format(one[2]), command)
    code, _, error = run(*shlex.split(command))
    told = without_progress(error)
    assert code in (1, 2), told
    assert len(told) == 1
    assert told[0].startswith("Error: ")
    assert len(told[0]) < 500
    assert (tmp_path / "file").read_text() == "mine"
    assert os.listdir(tmp_path) == ["file"]
