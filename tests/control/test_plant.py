"""A machine that is not simulated here: a class of twenty lines, or a program behind lines of text."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym.control.controllers import Follow, Kriging
from chaosgym.control.plant import plant_of, work
from chaosgym.control.policies import shipped_policy
from chaosgym.errors import ParameterError
from tests.cli.run import run

BEAM = "chaosgym/ImpactBeamTolerance-v1"
EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"
COMMAND = ("run-agent", BEAM, "--plant")


@pytest.fixture
def here(monkeypatch):
    """The folder of the example is the current one, as the page says."""
    monkeypatch.chdir(EXAMPLES)


def test_kriging_helps_a_rig_of_twenty_lines(here):
    """On a machine that nobody here modelled: nearer to its speeds of little load, within reach of the demand."""
    code, out, err = run(*COMMAND, "rig:Rig", "--json")
    assert code == 0, err
    told = json.loads(out)
    assert len(told["speed"]) == len(told["follow"]["speed"]) == 120
    assert told["life"] == pytest.approx(told["follow"]["damage"] / told["damage"])
    assert told["life"] > 1.0
    assert np.mean(told["mean_peak_force_N"]) < np.mean(told["follow"]["mean_peak_force_N"])
    assert told["follow"]["mean_deviation"] < 0.1 < told["mean_deviation"] < 2.0


def test_lines_say_what_the_class_says(here):
    """The same rig behind a pipe, by a program that knows the three words alone, gives the same job."""
    program = (
        "import sys; from rig import Rig; rig = Rig()\n"
        "for line in sys.stdin:\n"
        "    word, *rest = line.split()\n"
        "    if word == 'reset': rig.reset()\n"
        "    elif word == 'run': print(*rig.run(float(rest[0]), int(rest[1])), flush=True)\n"
        "    else: break\n"
        "print(sys.stdin.read(), file=sys.stderr)\n"
    )
    ask = [sys.executable, "-m", "chaosgym", *COMMAND, "-", "--json"]
    with subprocess.Popen(ask, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as ours:
        pipes = {"stdin": ours.stdout, "stdout": ours.stdin, "stderr": subprocess.PIPE}
        theirs = subprocess.run([sys.executable, "-c", program], **pipes, text=True, check=True)
    assert ours.returncode == 0
    by_lines = json.loads(theirs.stderr)
    by_class = json.loads(run(*COMMAND, "rig:Rig", "--json")[1])
    assert by_lines["plant"] == "-"
    np.testing.assert_allclose(by_lines["mean_peak_force_N"], by_class["mean_peak_force_N"], rtol=1e-6)


def test_a_trained_policy_is_told_more():
    """With impacts and bouncing it plays; peaks alone are not enough for it."""

    class Told:
        def reset(self):
            """Nothing moves."""

        def run(self, speed, cycles):
            """As a sensor would."""
            return {"peaks": [80.0] * cycles, "impacts": 16.0, "bouncing": 0.7}

    class Mute(Told):
        def run(self, speed, cycles):
            """The peaks alone."""
            return [80.0] * cycles

    operator = chaosgym.Operator(shipped_policy(BEAM), BEAM, steps=20)
    assert work(Told(), operator).speed.shape == (20,)
    with pytest.raises(ParameterError, match="a trained policy looks at impacts and bouncing too"):
        work(Mute(), operator)


def test_damage_is_that_of_the_peaks():
    """Under the reference force throughout, a job has the reference damage, by definition."""

    class Constant:
        def reset(self):
            """Nothing to do."""

        def run(self, speed, cycles):
            """The reference force."""
            return np.full(cycles, 95.0)

    done = work(Constant(), chaosgym.Operator(Follow(), BEAM))
    assert done.damage == pytest.approx(0.5)
    assert done.largest_force == 95.0


@pytest.mark.parametrize(
    ("body", "complaint"),
    [
        ("return [80.0]", r"returned peaks of shape \(1,\); allowed: 30 finite forces"),
        ("return [float('nan')] * cycles", "finite forces from 0 N on"),
        ("return 'loud'", "failed: ValueError"),
        ("return None", r"failed: TypeError|returned peaks of shape \(\)"),
        ("raise OSError('no answer')", "plant broken failed: OSError: no answer"),
    ],
)
def test_what_is_no_reading_is_refused(body, complaint):
    """In one line that says what a step must return."""
    space = {}
    exec(f"class Broken:\n def reset(self): pass\n def run(self, speed, cycles):\n  {body}", space)
    with pytest.raises(ParameterError, match=complaint) as told:
        work(space["Broken"](), chaosgym.Operator(Kriging(), BEAM), name="broken")
    assert "\n" not in str(told.value)


@pytest.mark.parametrize(
    ("name", "complaint"),
    [
        ("rig", "plant = 'rig' is not usable; allowed: module:Class"),
        ("nowhere:Rig", "plant nowhere:Rig failed: ModuleNotFoundError"),
        ("rig:Gone", "plant rig:Gone failed: AttributeError"),
        ("collections:OrderedDict", "has no method reset"),
    ],
)
def test_a_plant_that_is_not_there_is_refused(name, complaint, here):
    """By name, in one line."""
    with pytest.raises(ParameterError, match=complaint):
        plant_of(name)


@pytest.mark.parametrize(("answer", "complaint"), [("", "standard input ended"), ("eighty\n", "is no line of forces")])
def test_a_line_that_is_none_ends_in_one_line(answer, complaint):
    """Exit code 2, also where standard input is empty."""
    done = subprocess.run(
        [sys.executable, "-m", "chaosgym", *COMMAND, "-"], input=answer, capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert complaint in done.stderr
    assert len(done.stderr.strip().splitlines()) <= 3
    assert "Traceback" not in done.stderr
