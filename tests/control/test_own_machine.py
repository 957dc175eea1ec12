"""The file of a machine stands wherever the id of an environment does, and is told from another one by its content."""

import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

import chaosgym
from agents.training import load_checkpoint, save_checkpoint
from chaosgym.control.comparison import compare
from chaosgym.control.controllers import Follow
from chaosgym.control.evaluation import Evaluation
from chaosgym.control.policies import load_policy, save_policy
from chaosgym.control.policies.export import exported
from chaosgym.control.rollout import play
from chaosgym.control.scores import ONE, ZERO, Scores
from chaosgym.envs import SB3VecEnv, environment
from chaosgym.envs.sb3 import SB3VisitedSpeeds
from chaosgym.errors import DatasetError, ModelFileError, ParameterError
from chaosgym.machines.machine_file import template
from tests.cli.run import run, run_json

AGENTS = Path(__file__).parent.parent.parent / "agents"


@pytest.fixture
def machine_file(tmp_path):
    """The template of a machine's file."""
    path = tmp_path / "my-machine.toml"
    path.write_text(template())
    return path


def _harder(path):
    path.write_text(path.read_text().replace('force = "4 N"', 'force = "5 N"'))


def _small(path):
    envs = VecNormalize(SB3VisitedSpeeds(SB3VecEnv(str(path), 2, steps=20)))
    return PPO("MlpPolicy", envs, n_steps=32, batch_size=32, n_epochs=1, seed=3, device="cpu"), envs


def test_a_policy_of_a_file_plays_that_machine_alone(machine_file, tmp_path):
    """Trained, written, read, played and drawn; another machine, and the same file with another force, are refused."""
    model, envs = _small(machine_file)
    save_policy(exported(model.learn(64), str(machine_file), envs, memory=True), tmp_path)
    command = ("run-agent", str(machine_file), "--policy", str(tmp_path))
    told = run_json(*command, "--out", str(tmp_path / "job.png"))
    assert told["status"] == "job_done"
    assert (told["env"], told["unit"]) == (str(machine_file), "Hz")
    assert (tmp_path / "job.png").stat().st_size > 10_000
    with pytest.raises(ModelFileError, match=r"my-machine\.toml .machine [0-9a-f]{16}.*this is impact-beam"):
        play(load_policy(tmp_path), "chaosgym/ImpactBeam-v1", [0])
    _harder(machine_file)
    code, _, err = run(*command)
    assert code == 2
    assert "the policy was trained on" in err
    assert "Traceback" not in err


def test_a_checkpoint_of_a_file_goes_on_with_that_machine_alone(machine_file, tmp_path, monkeypatch):
    """Its environments are read again with their machines; a file that has changed is refused."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "me"))
    model, envs = _small(machine_file)
    save_checkpoint(tmp_path, model.learn(64))
    again, _ = load_checkpoint(tmp_path, PPO, _small(machine_file)[1])
    kept, known = (one.get_attr("nominal")[0] for one in (again.env, envs))
    assert kept == known
    _harder(machine_file)
    with pytest.raises(ParameterError, match="has changed"):
        load_checkpoint(tmp_path, PPO, _small(machine_file)[1])


def test_a_machine_of_a_file_is_pickled_with_its_fields():
    """A worn one of docs/machines, read again, is the same."""
    worn = chaosgym.read_machine(Path(__file__).parents[2] / "docs/machines/moon-shaw-1983.toml").at(clearance=2e-3)
    assert pickle.loads(pickle.dumps(worn)) == worn


def test_the_file_runs_within_its_tolerances(machine_file):
    """It is what MachineTolerance makes of it: the same jobs, step by step."""
    assert environment(str(machine_file)).kwargs == {"machine": str(machine_file), "level": "clearance"}
    short = play(Follow(), str(machine_file), range(2), steps=6)
    long = play(Follow(), "chaosgym/MachineTolerance-v0", range(2), steps=6, machine=str(machine_file))
    np.testing.assert_array_equal(short.reward, long.reward)
    assert np.ptp(short.felt[0], axis=0).max() > 0.0


def test_a_comparison_of_a_file_goes_on_with_that_machine_alone(machine_file, tmp_path):
    """On the template the own map avoids Type III that following meets; a changed file is another comparison."""
    out = tmp_path / "mine.parquet"
    scores = Scores(compare(str(machine_file), out, machines=2, only=[ZERO, ONE]))
    assert scores.row(ONE)["type_iii"] < 0.5 * scores.row(ZERO)["type_iii"]
    compare(str(machine_file), out, machines=2, only=[ZERO])
    _harder(machine_file)
    with pytest.raises(DatasetError, match=r"it is of .*my-machine\.toml \([0-9a-f]{16}\)"):
        compare(str(machine_file), out, machines=2, only=[ZERO])


def test_a_policy_is_evaluated_on_a_file(machine_file):
    """Following the demand scores 0 by definition."""
    result = chaosgym.evaluate(Follow(), str(machine_file), machines=2)
    assert result.score == 0.0
    assert result.type_iii > 0.0


def _scores(following, own, mine):
    contenders = [name for name in (ZERO, ONE, "mine") for _ in following]
    rows = {"contender": contenders, "machine": [*range(len(following))] * 3, "knows": [""] * len(contenders)}
    zeros = {name: np.zeros(len(contenders)) for name in ("type_iii", "deviation", "damage", "largest_force", "failed")}
    table = {**rows, **zeros, "seed": [0] * len(contenders), "job_return": np.concatenate([following, own, mine])}
    return Scores(pa.table(table))


def test_where_the_own_map_loses_nobody_has_a_score():
    """The scale would be turned over: who loses most would score best."""
    with pytest.raises(ParameterError, match=r"there is no score.*earns -4.50, not more than"):
        _scores([-4.0, -4.0], [-4.0, -5.0], [-9.0, -9.0]).row("mine")


def test_calm_machines_have_no_score_and_do_not_spoil_that_of_others():
    """Where the own map gains nothing there is no scale; draws of calm machines alone are left out of the interval."""
    calm = np.array([-3.0, -4.0, -5.0])
    with pytest.raises(ParameterError, match=r"there is no score.*not more than 'follow the demand' with -4.00"):
        _scores(calm, calm, calm + 1.0).row("mine")
    following = np.array([-3.0, -3.0, -9.0])
    row = _scores(following, np.array([-3.0, -3.0, -5.0]), np.array([-3.0, -3.0, -7.0])).row("mine")
    assert (row["score"], *row["score_interval"]) == pytest.approx((0.5, 0.5, 0.5))


@pytest.mark.slow
def test_a_script_trains_on_a_file_and_goes_on(machine_file, tmp_path):
    """PPO by agents/ppo.py, in two parts, leaves a policy that plays the machine."""
    out = tmp_path / "run"
    for steps in (6_000, 12_000):
        command = (AGENTS / "ppo.py", "--env", machine_file, "--steps", steps, "--envs", 32, "--every", 5_000)
        done = subprocess.run(
            [sys.executable, *map(str, (*command, "--out", out))], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
    assert len((out / "progress.csv").read_text().splitlines()) >= 3
    assert play(load_policy(out), str(machine_file), range(2)).returns.max() < 0.0


def test_an_evaluation_prints_as_one_line():
    """What a notebook shows is the score, not the arrays of every job."""
    result = Evaluation(0.256, (0.14, 0.36), -19.6, 0.07, 1.234, played=None)  # type: ignore[arg-type]
    assert repr(result) == "<score 0.26 (0.14 to 0.36), return -19.60, Type III 7.0%, 1.23 off the demand>"
