"""The best of some runs becomes a folder of the package that says where it comes from."""

import json
import shutil
import subprocess
import sys

import numpy as np
import pytest

from chaosgym.control.policies import load_policy
from chaosgym.control.policies.shipped import shipped_folder
from tests.agents.test_scripts import AGENTS

ENV = "chaosgym/ImpactBeamTolerance-v0"
CONTENDER = "PPO, belief"


@pytest.fixture
def runs(tmp_path):
    """Two runs of one policy, of which the second had the better evaluation, and their comparison."""
    source = shipped_folder(ENV)
    told = json.loads((source / "evaluation.json").read_text())
    (tmp_path / "comparison" / "jobs").mkdir(parents=True)
    for place, earned in enumerate((-2.5, -2.0)):
        folder = tmp_path / f"run-{place}"
        folder.mkdir()
        for name in ("policy.json", "weights.npz"):
            shutil.copyfile(source / name, folder / name)
        for name in ("policy.zip", "policy_normalisation.npz"):
            (folder / name).write_text(f"{name} of run {place}")
        config = json.loads((source / "config.json").read_text())
        config["arguments"]["seed"] = place
        (folder / "config.json").write_text(json.dumps(config))
        (folder / "evaluations.csv").write_text(f"step,return\n0,-3.0\n400,{earned}\n800,-2.9\n")
        jobs = {"setting": told["setting"], "jobs": told["jobs"][place : place + 2]}
        (tmp_path / "comparison" / "jobs" / f"{CONTENDER}-{place}.json").write_text(json.dumps(jobs))
    beside = {name: told[name] for name in ("belief programming", "safe constant", "dynamic programming")}
    report = {
        "reference": "dynamic programming",
        "contenders": {CONTENDER: told["all_seeds"] | {"score_by_seed": [0.1, 0.2], "seeds": 2}, **beside},
    }
    (tmp_path / "comparison" / "report.json").write_text(json.dumps(report))
    return tmp_path


def _ship(folder, pattern):
    command = [
        sys.executable,
        str(AGENTS / "ship_policy.py"),
        "--evaluation",
        str(folder / "comparison"),
        "--contender",
        CONTENDER,
        "--runs",
        str(folder / pattern),
        "--out",
        str(folder / "shipped"),
        "--models",
        str(folder / "models"),
    ]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_best_run_is_shipped_with_its_figures(runs):
    """The policy plays, the figures are those of its seed, the command has what differs from the defaults."""
    done = _ship(runs, "run-*")
    assert done.returncode == 0, done.stderr
    folder = runs / "shipped" / "ImpactBeamTolerance-v0"
    policy = load_policy(folder)
    assert np.isfinite(policy(policy.observation_space.low)).all()
    assert json.loads((folder / "evaluation.json").read_text())["score"] == 0.2
    command = json.loads((folder / "config.json").read_text())["command"]
    assert command.startswith(f"python agents/train_ppo.py --env {ENV} --seed 1 --out runs/")
    card = (folder / "card.md").read_text()
    assert "after 400 steps" in card
    assert "Score 0.20" in card
    assert "Nothing learned" not in card
    model = runs / "models" / "ImpactBeamTolerance-v0"
    assert (model / "policy.zip").read_text() == "policy.zip of run 1"
    assert (model / "policy_normalisation.npz").is_file()


def test_the_card_says_when_training_gained_nothing(runs):
    """The best evaluation is the one before the first step."""
    for place in range(2):
        (runs / f"run-{place}" / "evaluations.csv").write_text(f"step,return\n0,{-1.0 - place}\n400,-2.0\n")
    assert _ship(runs, "run-*").returncode == 0
    card = (runs / "shipped" / "ImpactBeamTolerance-v0" / "card.md").read_text()
    assert "after 0 steps" in card
    assert "Nothing learned" in card


def test_the_figures_of_another_policy_are_not_shipped(runs):
    """Jobs say which policy ran them: a run that was trained again has none yet."""
    path = runs / "comparison" / "jobs" / f"{CONTENDER}-1.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | {"policy": "0" * 64}))
    assert "judged another policy" in _ship(runs, "run-*").stderr
    assert not (runs / "shipped").exists()


def test_a_switch_that_was_off_is_off_in_the_command(runs):
    """And a run of another script is refused, whose arguments mean something else."""
    path = runs / "run-1" / "config.json"
    config = json.loads(path.read_text())
    path.write_text(json.dumps(config | {"arguments": config["arguments"] | {"shaping": False}}))
    assert _ship(runs, "run-*").returncode == 0
    shipped = runs / "shipped" / "ImpactBeamTolerance-v0" / "config.json"
    assert " --no-shaping " in json.loads(shipped.read_text())["command"]
    path.write_text(json.dumps(config | {"script": "train_sac.py"}))
    assert "a run of train_sac.py" in _ship(runs, "run-*").stderr


def test_a_pattern_without_runs_is_named(runs):
    """Nothing is written."""
    done = _ship(runs, "none-*")
    assert "no folder matches" in done.stderr
    assert not (runs / "shipped").exists()
