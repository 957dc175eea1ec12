"""Ctrl-C ends every command at once, whatever it computes."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from chaosgym.cli.interrupt import ABORTED, GRACE_SECONDS, heard_at_once

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processor time is read from /proc")

DEAF = "hashlib.pbkdf2_hmac('sha256', b'', b'', 2**31 - 1)"
"""Minutes in compiled code that lets other threads run and looks at no signal, as a kernel does."""

PATIENT = """try:
        time.sleep(100)
    except KeyboardInterrupt:
        print('put away')
        raise SystemExit(7)"""
"""What Python can end by itself, in its own way."""

REVOLUTION = ("slider-crank", "--set", "n_modes=12", "--clearance-joint", "ball-spherical")
"""A crank that takes millions of steps a revolution, within its budget: some seconds in one call of a kernel."""

COMMANDS = {
    "revolutions of a million steps": ("simulate", "slider-crank", "--set", "n_modes=16", "--cycles", "1000"),
    "revolutions of millions of steps": ("simulate", *REVOLUTION, "--cycles", "100"),
    "a diagnosis": ("diagnose", *REVOLUTION),
    "a sweep": (
        "sweep",
        "impact-beam",
        "--sampling",
        "sobol:100000",
        "--budget",
        "100000",
        "--workers",
        "2",
        "--out",
        "OUT",
    ),
}


def _started(*arguments):
    """A Python process that hears SIGINT, even if this one was started in the background, where it is ignored."""
    return subprocess.Popen(
        [sys.executable, *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def _processor_seconds(process):
    fields = Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


@pytest.mark.parametrize(("work", "code", "says"), [(DEAF, ABORTED, "Aborted."), (PATIENT, 7, "put away")])
def test_compiled_code_is_left_and_python_ends_by_itself(work, code, says):
    """A call that looks at no signal ends half a second later; what Python can end goes its own way before."""
    program = (
        "import hashlib, time\nfrom chaosgym.cli.interrupt import heard_at_once\n"
        f"with heard_at_once():\n    print('on', flush=True)\n    {work}\n"
    )
    with _started("-c", program) as process:
        assert process.stdout.readline() == "on\n"
        time.sleep(0.3)
        process.send_signal(signal.SIGINT)
        assert says in "".join(process.communicate(timeout=60))
        assert process.returncode == code


RIG = """
import sys, time
class Rig:
    steps = 0
    def reset(self): pass
    def run(self, speed, cycles):
        self.steps += 1
        if self.steps == 4:
            print("runs", file=sys.stderr, flush=True)
            time.sleep(60.0)
        return [80.0] * cycles
    def stop(self):
        print("brakes", file=sys.stderr, flush=True)
        time.sleep(3.0 * GRACE)
        print("stands", file=sys.stderr, flush=True)
"""


@pytest.mark.parametrize("asked", [["SIGINT"], ["SIGTERM"], ["SIGHUP"], ["SIGINT", "SIGINT"]])
def test_a_machine_is_brought_to_rest_first(asked, tmp_path, monkeypatch):
    """However long it brakes, with its steps kept; asked twice, the command ends at once."""
    (tmp_path / "rig.py").write_text(RIG.replace("GRACE", str(GRACE_SECONDS)))
    monkeypatch.chdir(tmp_path)
    ask = ("run-agent", "chaosgym/ImpactBeamTolerance-v1", "--plant", "rig:Rig", "--json")
    with _started("-m", "chaosgym", *ask) as process:
        heard = ""
        for number, mark in zip(asked, ("runs", "Stopping the machine"), strict=False):
            while mark not in heard:
                line = process.stderr.readline()
                assert line, heard
                heard += line
            process.send_signal(getattr(signal, number))
        out, rest = process.communicate(timeout=60)
    heard += rest
    assert process.returncode == ABORTED
    assert "brakes" in heard
    assert "Traceback" not in heard
    assert ("stands" in heard) is (len(asked) == 1)
    if len(asked) == 1:
        assert "Ctrl-C; 2 steps of the job Kriging were played" in heard
        assert len(json.loads(out)["speed"]) == 2


def test_the_watch_ends_with_the_command():
    """Afterwards signals are nobody's but the program's."""
    with heard_at_once():
        watched = signal.set_wakeup_fd(-1)
        signal.set_wakeup_fd(watched)
        assert watched >= 0
    assert signal.set_wakeup_fd(-1) == -1


@pytest.mark.slow
@pytest.mark.parametrize("command", COMMANDS)
def test_ctrl_c_ends_a_command_that_computes(command, tmp_path):
    """SIGINT after four seconds of processor time: exit 130 within a few more, one line, no traceback."""
    arguments = [str(tmp_path / "out") if word == "OUT" else word for word in COMMANDS[command]]
    with _started("-m", "chaosgym", *arguments) as process:
        while process.poll() is None and _processor_seconds(process) < 4.0:
            time.sleep(0.05)
        assert process.poll() is None, process.stderr.read()
        before = _processor_seconds(process)
        process.send_signal(signal.SIGINT)
        sent = time.monotonic()
        spent = before
        while process.poll() is None and time.monotonic() - sent < 60.0:
            spent = _processor_seconds(process) or spent
            time.sleep(0.02)
        _, told = process.communicate(timeout=10)
    assert process.returncode == ABORTED
    assert "Traceback" not in told
    assert told.rstrip().endswith("Aborted.")
    assert spent - before < 2 * (os.cpu_count() or 1) * GRACE_SECONDS + 1.0
