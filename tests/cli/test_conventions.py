"""What people expect of a command line: completion, JSON, plain text, quiet ends, constant exit codes."""

import json
import os
import signal
import subprocess
import sys
import time

import click
import pytest

from chaosgym.cli import COMMANDS, app
from tests.cli.run import run

CHAOSGYM = [sys.executable, "-m", "chaosgym"]


def every_command(group, path=()):
    """Commands of a group and of the groups in it, with their names."""
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        if isinstance(command, click.Group):
            yield from every_command(command, (*path, name))
        else:
            yield " ".join((*path, name)), command


def test_every_command_gives_json():
    """Each has --json."""
    commands = dict(every_command(app))
    assert {"dataset info", "dataset map", "explore", "simulate"} <= set(commands)
    without = [name for name, command in commands.items() if "as_json" not in {p.name for p in command.params}]
    assert without == []


@pytest.mark.parametrize("name", COMMANDS)
def test_a_command_has_a_dozen_options_at_most(name):
    """What is seldom stated is a key of one option, so that the help of a command stays short."""
    options = app.get_command(click.Context(app), name).params
    assert len([option for option in options if isinstance(option, click.Option)]) <= 12


def completed(words, number):
    """What the shell is offered for the word of that number."""
    asked = {"_CHAOSGYM_COMPLETE": "bash_complete", "COMP_WORDS": words, "COMP_CWORD": str(number)}
    code = "import sys; sys.argv[0] = 'chaosgym'; from chaosgym.cli import main; main()"
    done = subprocess.run([sys.executable, "-c", code], env={**os.environ, **asked}, capture_output=True, text=True)
    return [line.split(",")[1] for line in done.stdout.split()]


def test_the_shell_completes_commands_machines_and_options():
    """As click's completion asks: _CHAOSGYM_COMPLETE=bash_source chaosgym prints the script of it."""
    assert completed("chaosgym si", 1) == ["simulate"]
    assert completed("chaosgym diagnose imp", 2) == ["impact-beam"]
    assert completed("chaosgym diagnose impact-beam --fre", 3) == ["--frequency-hz"]


@pytest.mark.parametrize("color", [{}, {"NO_COLOR": "1"}])
def test_nothing_is_coloured(color):
    """Neither tables nor errors hold escape sequences."""
    for words in (["info"], ["simulate", "steam-engine"]):
        done = subprocess.run([*CHAOSGYM, *words], env={**os.environ, **color}, capture_output=True, check=False)
        assert done.stdout + done.stderr
        assert b"\x1b" not in done.stdout + done.stderr


def test_a_reader_that_leaves_is_no_error():
    """`chaosgym simulate --cycles 10000 --json | head -c 1` ends without a word, as any program in a pipe does."""
    process = subprocess.Popen(
        [*CHAOSGYM, "simulate", "impact-beam", "--cycles", "10000", "--json"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stderr is not None
    with process:
        process.stdout.read(1)
        process.stdout.close()
        told = process.stderr.read().decode()
    assert process.returncode == 141
    assert "Traceback" not in told
    assert "Error" not in told


def test_ten_million_cycles_show_progress_and_end_at_once():
    """A bar appears after two seconds; Ctrl-C ends the command within two more, with the exit code 130."""
    process = subprocess.Popen(
        [*CHAOSGYM, "simulate", "impact-beam", "--cycles", "10000000"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    assert process.stderr is not None
    with process:
        seen = b""
        while b"simulate:" not in seen:
            seen += process.stderr.read(1)
        process.send_signal(signal.SIGINT)
        began = time.monotonic()
        process.communicate(timeout=60)
        assert time.monotonic() - began < 10.0
    assert process.returncode == 130


def test_commands_use_one_blas_thread():
    """Numpy's own BLAS and the one that scipy brings, loaded after the command began."""
    program = (
        "import click\nfrom chaosgym.cli import run_command\n"
        "@click.command()\ndef count():\n"
        "    import scipy.linalg\n    from threadpoolctl import threadpool_info\n"
        "    print([pool['num_threads'] for pool in threadpool_info() if pool['user_api'] == 'blas'])\n"
        "run_command(count)"
    )
    found = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert set(json.loads(found.stdout)) == {1}


def test_a_warning_is_one_line():
    """A command tells what the library warns of, and no line of its code."""
    code = (
        "import warnings, click; from chaosgym.cli import run_command\n"
        "run_command(click.command()(lambda: warnings.warn('the sensor is dead')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "note: the sensor is dead\n")


@pytest.mark.parametrize(
    ("machine", "rungs"), [("impact-beam", "standard, fine, reference"), ("own.toml", "reference,")]
)
def test_the_help_of_a_machine_names_its_models(machine, rungs, tmp_path, monkeypatch):
    """What ``--fidelity`` takes depends on the machine, so that the help names what this one takes."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "own.toml").write_text(run("new-machine", "modes")[1])
    told = " ".join(run("simulate", machine, "--help")[1].split())
    assert f"is allowed ('1 %'), or {'one of ' if ', ' in rungs else ''}{rungs}" in told
    assert run("simulate", machine, "--cycles", "1", "--fidelity", rungs.split(", ")[0].strip(","))[0] == 0
