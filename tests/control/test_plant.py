"""A machine that is not simulated here: a class of twenty lines, or a program behind lines of text."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym.control.controllers import BackOff, Follow, Kriging
from chaosgym.control.plant import Interrupted, PlantError, work
from chaosgym.control.policies import shipped_policy
from chaosgym.errors import ParameterError
from chaosgym.plants.plant import plant_of
from tests.cli.run import run
from tests.control.foreign_plants import Bilinear, GearPair

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
        ("return [80.0]", r"returned peaks of shape \(1,\); allowed: 30 forces, or 30 pairs"),
        ("return [5.0, -2.0] * (cycles // 2)", r"a peak of -2 N in cycle 2 of the step.*\(the run-in\)"),
        ("return 'loud'", "failed: ValueError"),
        ("return None", r"returned peaks of shape \(\)"),
        ("raise OSError('no answer')", "plant broken failed: OSError: no answer"),
        ("raise SystemExit(3)", "plant broken failed: SystemExit: 3"),
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


SHORT = {"steps": 12, "shortest_hold": 4, "longest_hold": 6, "cycles_per_step": 6, "run_in_cycles": 12}


@pytest.mark.parametrize("policy", [Follow, BackOff, Kriging])
@pytest.mark.parametrize("kind", [Bilinear, GearPair])
def test_foreign_plants_are_played(kind, policy):
    """A bilinear oscillator and a gear pair, by equations of their own: a whole job within the range of the drive."""
    plant, operator = kind(), chaosgym.Operator(policy(), BEAM, **SHORT)
    done = work(plant, operator)
    assert done.speed.shape == (12,)
    assert np.isfinite(done.mean_peak).all()
    assert done.lost == 0
    assert operator.task.lowest_speed <= done.speed.min() <= done.speed.max() <= operator.task.highest_speed
    assert np.abs(np.diff(done.speed)).max() <= operator.task.slew_limit


def test_a_gear_pair_may_be_left_in_a_worse_motion():
    """Two motions at one speed: after backing off the demand is held in the other one, and a third of the life is left.

    No controller that goes by measurements can know that before; the page on machines says so.
    """
    backed, followed = (work(GearPair(), chaosgym.Operator(policy, BEAM)) for policy in (BackOff(), Follow()))
    same = backed.speed[80:110] == followed.speed[80:110]
    assert same.all()
    assert followed.mean_peak[80:110].max() < 75.0
    assert backed.mean_peak[80:110].max() < 75.0
    assert followed.damage / backed.damage == pytest.approx(0.33, abs=0.03)


def test_signed_forces_wear_each_stop():
    """The largest and the smallest force of a cycle are those of two stops; the damage is that of the worse one."""

    class Stops:
        def reset(self):
            """Nothing moves."""

        def run(self, speed, cycles):
            """More on the second stop."""
            return np.tile([60.0, -95.0], (cycles, 1))

    done = work(Stops(), chaosgym.Operator(Follow(), BEAM))
    assert done.damage == pytest.approx(0.5)
    assert done.largest_force == 95.0
    np.testing.assert_allclose(done.mean_peak, 95.0)


def test_a_drive_that_tops_out_is_reported():
    """Whose speed stays at 17 Hz under higher demands: the deviation is that of the speed it ran at."""
    done = work(Bilinear(top=17.0), chaosgym.Operator(Follow(), BEAM, **SHORT, lowest_demand=20.0))
    told = done.as_dict()
    assert told["mean_deviation"] == pytest.approx((done.demand - 17.0).mean())
    assert told["largest_miss_of_the_drive"] == pytest.approx(done.speed.max() - 17.0)
    assert told["measured_speed"] == [17.0] * 12
    assert "the drive did not reach the speed that was set" in done.lines("follow")[1]
    assert f"instead of {done.speed.max():.2f} in step" in done.lines("follow")[1]
    assert len(work(Bilinear(), chaosgym.Operator(Follow(), BEAM, **SHORT)).lines("follow")) == 1


@pytest.mark.parametrize("error", [OSError("no answer"), KeyboardInterrupt()])
def test_a_plant_is_stopped_whatever_happens(error):
    """Once after a job that ends well, and once after one that an error or Ctrl-C ends, with its steps kept."""
    plant = Bilinear()
    operator = chaosgym.Operator(Follow(), BEAM, **SHORT)
    work(plant, operator)
    assert plant.stops == 1
    run_well, calls = plant.run, []

    def fail(speed, cycles):
        calls.append(speed)
        if len(calls) == 5:
            raise error
        return run_well(speed, cycles)

    plant.run = fail
    with pytest.raises((PlantError, Interrupted)) as told:
        work(plant, operator, name="mine")
    assert plant.stops == 2
    assert told.value.worked.speed.tolist() == calls[1:4]
    line = "plant mine failed: OSError: no answer (step 4 of 12, cycles 19 to 24)"
    assert str(told.value) == (line if isinstance(error, OSError) else "Ctrl-C")


def test_an_error_of_stop_hides_none():
    """Both are told, in one line; alone it is an error too, since the machine may still run."""

    class Stuck(Bilinear):
        def stop(self):
            """It does not."""
            raise OSError("brake")

    operator = chaosgym.Operator(Follow(), BEAM, **SHORT)
    with pytest.raises(PlantError, match=r"plant stuck: stop\(\) failed: OSError: brake"):
        work(Stuck(), operator, name="stuck")
    plant = Stuck()
    plant.run = lambda speed, cycles: [1.0]
    with pytest.raises(PlantError, match=r"peaks of shape \(1,\).*; stop\(\) failed too: OSError: brake"):
        work(plant, operator, name="stuck")


@pytest.mark.parametrize("dead", [0.0, 1e9, np.nan])
def test_a_dead_sensor_is_said(dead):
    """Zeros, 1e9 N or nothing for ever: the demand is followed, with a warning, and the report counts the steps."""

    class Dead:
        def reset(self):
            """Nothing moves."""

        def run(self, speed, cycles):
            """As the sensor tells it."""
            return [dead] * cycles

    operator = chaosgym.Operator(Kriging(), BEAM, **SHORT)
    with pytest.warns(UserWarning, match="no usable reading for 3 steps"):
        done = work(Dead(), operator)
    follow = work(Bilinear(), chaosgym.Operator(Follow(), BEAM, **SHORT))
    np.testing.assert_array_equal(done.speed, follow.speed)
    assert done.lost == 12
    assert "no usable reading in 12 of 12 steps" in done.lines("kriging")[1]
    json.dumps(done.as_dict(), allow_nan=False)


PROGRAM = """
import os, sys, time
for number, line in enumerate(sys.stdin):
    word, *rest = line.split()
    if word == "done":
        print("heard done", file=sys.stderr)
        break
    if word == "run" and number > 4:
        {misbehave}
    if word == "run":
        print(*[80.0] * int(rest[1]), flush=True)
"""


@pytest.mark.parametrize(
    ("misbehave", "complaint", "hears"),
    [
        ("os.kill(os.getpid(), 9)", "standard input ended", False),
        ("print('eighty', flush=True); continue", "'eighty' is no line of forces", True),
        ("continue", "no answer came within 3 s", True),
    ],
)
def test_a_program_that_fails_ends_in_one_line(misbehave, complaint, hears):
    """Killed, talking nonsense or silent: exit code 2, the steps that were played, and ``done`` to whoever listens."""
    ask = [sys.executable, "-m", "chaosgym", *COMMAND, "-", "--plant-arg", "seconds=3", "--json"]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    with subprocess.Popen(ask, **pipes, text=True) as ours:
        program = PROGRAM.format(misbehave=misbehave)
        theirs = subprocess.Popen(
            [sys.executable, "-c", program], stdin=ours.stdout, stdout=ours.stdin, stderr=subprocess.PIPE, text=True
        )
        ours.stdin.close()
        _, heard = theirs.communicate(timeout=120)
        error = ours.stderr.read()
    assert ours.returncode == 2
    assert complaint in error
    assert "step 4 of 120, cycles 31 to 40" in error
    assert "3 steps of the job Kriging were played" in error
    assert "Traceback" not in error
    assert ("heard done" in heard) is hears


def test_arguments_reach_the_class(tmp_path, monkeypatch):
    """Numbers and text by name; what the class does not take is told in one line."""
    (tmp_path / "mine.py").write_text(
        "class Rig:\n"
        " def __init__(self, force=1.0, port=''): self.force, self.port = force, port\n"
        " def reset(self): assert self.port == 'COM3'\n"
        " def run(self, speed, cycles): return [self.force] * cycles\n"
    )
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*COMMAND, "mine:Rig", "--plant-arg", "force=42.5", "--plant-arg", "port=COM3", "--json")
    assert code == 0, err
    assert set(json.loads(out)["mean_peak_force_N"]) == {42.5}
    code, _, err = run(*COMMAND, "mine:Rig", "--plant-arg", "gain=2")
    assert code == 2
    assert "plant mine:Rig failed: TypeError" in err
    assert "allowed: NAME=VALUE" in run(*COMMAND, "mine:Rig", "--plant-arg", "gain")[2]
    assert "give --plant" in run("run-agent", BEAM, "--plant-arg", "gain=2")[2]


def test_done_is_said_before_a_plant_is_played():
    """A policy that can't be read: the program hears ``done`` and nothing else."""
    code, out, err = run(*COMMAND, "-", "--policy", EXAMPLES)
    assert (code, out) == (2, "done\n")
    assert "policy.json" in err


def test_a_failure_in_the_second_job_counts_its_own_steps(tmp_path, monkeypatch):
    """The whole first job is told, and of the second one that no step was played."""
    (tmp_path / "brake.py").write_text(
        "class Rig:\n"
        " resets = 0\n"
        " def reset(self): Rig.resets += 1; assert Rig.resets < 2, 'the brake is on'\n"
        " def run(self, speed, cycles): return [80.0] * cycles\n"
    )
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*COMMAND, "brake:Rig", "--json")
    assert code == 2
    assert "the brake is on; 0 steps of the job following the demand were played" in err
    assert len(json.loads(out)["speed"]) == 120
    assert json.loads(out)["follow"] is None
