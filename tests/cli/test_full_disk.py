"""A full disk and an output that is closed end every command in one line, or without a word."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

from tests import small_demo
from tests.cli.test_answers import BEAM, LONG, MAP, PEAKS, QUICK
from tests.test_kills import LEARNED

pytestmark = pytest.mark.skipif(not Path("/dev/full").exists(), reason="there is no /dev/full")

WRITING = (
    "simulate impact-beam --cycles 300 --out p.csv",
    "simulate impact-beam --cycles 300 --out p.parquet",
    "simulate impact-beam --cycles 3 --series-out s.csv",
    "new-machine --out a.toml",
    f"judge {PEAKS} --plot d.pdf",
    f"judge {PEAKS} --plot d.png",
    f"overlay impact-beam {PEAKS} --out o.png",
    f"{MAP} --out sweep",
    f'judge {PEAKS} --load-rating "500 N" --out r.html',
    f"run-agent {BEAM} --out j.gif",
    f'compare {BEAM} --machines 2 --only "follow the demand" --out s.parquet',
    "train-classifier --data ../made --out learned",
    "demo --out demo",
)
"""Commands that write more than a thousand bytes into a file."""


def ended(command, **options):
    """(Exit code, lines on standard error but for signs of progress) of a command of chaosgym."""
    program = [small_demo.__file__] if command.startswith("demo") else ["-m", "chaosgym"]
    words = [sys.executable, *program, *shlex.split(command)]
    done = subprocess.run(words, stdin=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, check=False, **options)
    lines = done.stderr.replace("\r", "\n").splitlines()
    progress = re.compile(r"\s*|.*\|.*|.*: \d+ s|./4 .*| +picture: .*")
    return done.returncode, [line for line in lines if not progress.fullmatch(line)]


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
    """With /dev/full as output one line; with none at all nothing is said, and the work is done."""
    ended(f"{MAP} --out map", cwd=tmp_path, stdout=subprocess.DEVNULL)
    for name, forms in (LONG | QUICK).items():
        words = name.replace("-", " ", 1) if name.startswith("dataset-") else name
        command = f"{words} {forms.split(';')[0]}"
        if "brief" in command or name == "monitor":
            continue
        with Path("/dev/full").open("wb") as full:
            assert say_no_space(*ended(command, cwd=tmp_path, stdout=full)), command
        fresh = re.sub(r"--(\S*)out (\S+)", r"--\1out second-\2", command)
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
