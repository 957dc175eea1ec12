"""The training and evaluation scripts run end to end and leave what they promise."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.jobs import run_job
from chaosgym.control.policies import load_policy

AGENTS = Path(__file__).parent.parent.parent / "agents"
SHORT = ("--envs", "2", "--jobs", "2", "--evaluate-every", "400", "--seed", "3")
SCRIPTS = {
    "train_ppo.py": ("--steps", "800"),
    "train_ppo_lstm.py": ("--steps", "800", "--units", "8"),
    "train_ppo_lagrangian.py": ("--steps", "800"),
    "train_sac.py": ("--steps", "800", "--learning-starts", "200", "--gradient-steps", "1"),
}


def _run(script, *arguments):
    command = [sys.executable, str(AGENTS / script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def _rows(path):
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.mark.slow
@pytest.mark.parametrize("script", list(SCRIPTS))
def test_a_run_leaves_a_policy_that_numpy_plays(script, tmp_path):
    """Every script writes its arguments, every job, the evaluations and the policy; a second start is refused."""
    out = tmp_path / "run"
    arguments = (*SCRIPTS[script], *SHORT, "--out", str(out))
    trained = _run(script, *arguments)
    assert trained.returncode == 0, trained.stderr
    config = json.loads((out / "config.json").read_text())
    assert config["arguments"]["seed"] == 3
    assert config["versions"]["stable_baselines3"]
    assert [row["step"] for row in _rows(out / "evaluations.csv")] == ["0", "400", "800"]
    assert all(float(row["return"]) < 0.0 for row in _rows(out / "progress.csv"))
    assert len(_rows(out / "progress.csv")) == 4
    assert all((out / name).is_file() for name in ("policy.zip", "policy_normalisation.npz"))
    assert not list(out.glob("checkpoint*"))
    policy = load_policy(out)
    assert policy(policy.observation_space.high).shape == (1,)
    refused = _run(script, *arguments)
    assert "finished; choose another folder" in refused.stderr


@pytest.mark.slow
def test_a_policy_drives_a_machine_that_it_has_not_met(tmp_path):
    """The policy carries its belief along: it drives a held-out machine to the end of a job."""
    env, out = "chaosgym/ImpactBeamTolerance-v0", tmp_path / "run"
    trained = _run("train_ppo.py", "--env", env, "--steps", "800", *SHORT, "--out", str(out))
    assert trained.returncode == 0, trained.stderr
    row = run_job(gym.make(env, pool="held-out", job_cycles=100), load_policy(out), 3, 0)
    assert row.cycles == 100


@pytest.mark.slow
def test_an_interrupted_run_goes_on(tmp_path):
    """What a kill leaves behind is a checkpoint; the same command ends with the rows of one whole run."""
    out = tmp_path / "run"
    arguments = ("--steps", "1200", *SHORT, "--out", str(out))
    script = (AGENTS / "train_ppo.py").read_text()
    killed = script.replace(
        "    run.learn(model)", "    run.save(model.learn(400), 'checkpoint')\n    raise SystemExit(9)"
    )
    (tmp_path / "killed.py").write_text(f"import sys\nsys.path.insert(0, {str(AGENTS)!r})\n" + killed)
    assert _run(tmp_path / "killed.py", *arguments).returncode == 9
    (out / "progress.csv").write_text("step,return,length\n200,-1,100\n600,-9,200\n")
    resuming = script.replace("    run.learn(model)", "    run.learn(model)\n    run.save(model, 'checkpoint')")
    (tmp_path / "resuming.py").write_text(f"import sys\nsys.path.insert(0, {str(AGENTS)!r})\n" + resuming)
    resumed = _run(tmp_path / "resuming.py", *arguments)
    assert resumed.returncode == 0, resumed.stderr
    steps = [int(row["step"]) for row in _rows(out / "progress.csv")]
    assert steps == [200, 800, 800, 1200, 1200]
    with np.load(out / "checkpoint_normalisation.npz") as held:
        assert held["obs_count"] == pytest.approx(1200 + 4, abs=1.0)
    assert "finished; choose another folder" in _run("train_ppo.py", *arguments).stderr


@pytest.mark.parametrize(("option", "value"), [("--env", "CartPole-v1"), ("--envs", "0")])
def test_wrong_arguments_leave_no_folder(option, value, tmp_path):
    """The corrected command finds nothing in its way."""
    refused = _run("train_ppo.py", option, value, "--out", str(tmp_path / "run"))
    assert refused.returncode != 0
    assert not (tmp_path / "run").exists()


def test_a_run_that_left_no_checkpoint_begins_anew(tmp_path, monkeypatch):
    """What it wrote down before is not part of the new run."""
    monkeypatch.syspath_prepend(AGENTS)
    from common import _opened

    path = tmp_path / "evaluations.csv"
    path.write_text("step,return\n0,-2.0\n400,-1.9\n800,-1.8\n")
    assert [row["step"] for row in _rows(_opened(path, ["step", "return"], 400))] == ["0", "400"]
    assert _rows(_opened(path, ["step", "return"], 0)) == []


def test_an_existing_folder_is_left_alone(tmp_path):
    """Training never writes into a folder that is not its own."""
    refused = _run("train_ppo.py", "--out", str(tmp_path))
    assert refused.returncode != 0
    assert "choose another folder" in refused.stderr
    assert list(tmp_path.iterdir()) == []
