"""The command run-agent plays a job, tells what happened, and draws it."""

import json
import shutil

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Box
from PIL import Image

from chaosgym.control.policies import TrainedPolicy, save_policy
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.policies.play import play
from tests.cli.test_cli import run, run_json
from tests.control.made_up import ENV


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A policy that always asks for 19 Hz."""
    env = gym.make(ENV)
    space = Box(env.observation_space.low, env.observation_space.high)
    action = env.get_wrapper_attr("drive").action_for(19.0)
    layer = Dense(np.zeros((1, space.shape[0]), np.float32), np.array([action], np.float32), "none")
    path = tmp_path_factory.mktemp("policy")
    save_policy(TrainedPolicy(ENV, space, Box(-1.0, 1.0, (1,), np.float32), Network(None, (layer,))), path)
    return path


def test_a_job_is_played_and_animated(folder, tmp_path):
    """The speed climbs by 1 Hz a step to 19 Hz and stays; the animation has 50 pictures; the seed decides all."""
    out = tmp_path / "job.gif"
    told = run_json("run-agent", ENV, "--policy", str(folder), "--seed", "4", "--out", str(out))
    assert told["status"] == "job_done"
    np.testing.assert_allclose(told["speed"], np.minimum(5.0 + np.arange(200), 19.0), rtol=1e-6)
    assert np.shape(told["peak_force_N"]) == (200, 5)
    assert len(told["type_iii"]) == 200
    with Image.open(out) as animation:
        assert animation.n_frames == 50


def test_peak_forces_are_all_that_is_shown_as_such():
    """Where the clearance grows the observation ends in the damage, which is no force."""
    env = gym.make("chaosgym/ImpactBeamWear-v0", job_cycles=50)
    job = play(env, lambda observation: env.action_space.high, seed=0)
    assert job.peak_force.shape == (10, env.get_wrapper_attr("task").cycles_per_step)
    assert job.peak_force.min() > 5.0


def test_a_figure_is_drawn_beside_a_table(folder, tmp_path):
    """Every tenth step is a line of the table."""
    out = tmp_path / "job.png"
    code, text, _ = run("run-agent", ENV, "--policy", str(folder), "--out", str(out))
    assert code == 0
    assert len(text.splitlines()) == 1 + 20 + 1 + 1
    with Image.open(out) as figure:
        assert figure.size == (720, 480)


@pytest.mark.skipif(shutil.which("ffmpeg") is None, reason="needs ffmpeg")
def test_a_film_is_written(folder, tmp_path):
    """An MP4 file names its type in its first bytes."""
    out = tmp_path / "job.mp4"
    assert run("run-agent", ENV, "--policy", str(folder), "--out", str(out))[0] == 0
    assert out.read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (("chaosgym/Nothing-v0",), "ENV chaosgym/Nothing-v0 is unknown; known: chaosgym/ImpactBeam-v0"),
        ((ENV, "--policy", "nowhere"), "nowhere holds no policy.json"),
        ((ENV, "--out", "job.pdf"), "job.pdf ends in .pdf; allowed: .png, .gif, .mp4"),
    ],
)
def test_wrong_input_ends_in_one_line(arguments, complaint):
    """Exit code 2, and what is allowed."""
    code, _, err = run("run-agent", *arguments)
    assert code == 2
    assert complaint in err
    assert len(err.strip().splitlines()) <= 3


def test_a_policy_of_another_machine_is_refused(folder):
    """The spaces differ: the message names the environment of the policy."""
    code, _, err = run("run-agent", "chaosgym/SliderCrank-v0", "--policy", str(folder))
    assert code == 2
    assert f"it was trained on {ENV}" in err


def test_runs_are_the_same_for_the_same_seed(folder):
    """And differ for another one: the sensor's errors do."""
    first, second, other = (run_json("run-agent", ENV, "--policy", str(folder), "--seed", seed) for seed in "114")
    assert json.dumps(first) == json.dumps(second)
    assert first["peak_force_N"] != other["peak_force_N"]
