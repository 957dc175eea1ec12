"""Recipes with other libraries train for some seconds; those of libraries that are not installed are left out."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from chaosgym.control.policies import load_policy
from chaosgym.control.rollout import play

AGENTS = Path(__file__).parents[2] / "agents"
BEAM = "chaosgym/ImpactBeamTolerance-v1"


def run(script, *options, **environment):
    """What a script of ``agents`` prints."""
    command = [sys.executable, *map(str, (AGENTS / script, *options))]
    done = subprocess.run(command, capture_output=True, text=True, check=False, env=os.environ | environment)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.mark.slow
def test_plain_ppo_leaves_a_curve_and_a_policy(tmp_path):
    """A row for 10,000 steps, and what numpy plays."""
    run("recipes/with_sb3.py", "--steps", 12_000, "--out", tmp_path)
    rows = (tmp_path / "progress.csv").read_text().splitlines()
    assert rows[0] == "step,return,type_iii,deviation,processor_seconds"
    step, gained, type_iii, *_ = map(float, rows[1].split(","))
    assert 10_000 <= step <= 12_000
    assert gained < 0.0 < type_iii < 1.0
    assert play(load_policy(tmp_path), BEAM, range(2)).returns.max() < 0.0


@pytest.mark.slow
def test_a_policy_is_cloned_from_a_dataset(tmp_path):
    """Of two jobs at random: the network is scored on machines that no training draws."""
    pytest.importorskip("minari")
    run("export_minari.py", "--jobs", 2, "--out", tmp_path)
    data = {"MINARI_DATASETS_PATH": str(tmp_path)}
    told = run(
        "recipes/with_minari.py", "chaosgym/ImpactBeamTolerance/random-v1", "--epochs", 2, "--machines", 4, **data
    )
    assert "on 240 steps of 2 jobs" in told
    assert "on 4 machines" in told.splitlines()[-1]


@pytest.mark.slow
def test_torchrl_trains(tmp_path):
    """Two rollouts of whole jobs on all machines."""
    pytest.importorskip("torchrl")
    told = run("recipes/with_torchrl.py", "--rollouts", 2, "--machines", 4)
    assert told.splitlines()[-1].startswith("2: return of a job -")


@pytest.mark.slow
def test_plain_torch_trains():
    """Two rollouts of whole jobs, and a score on machines that no training draws."""
    told = run("recipes/with_torch.py", "--rollouts", 2, "--machines", 4, "--scored", 4).splitlines()
    assert told[1].startswith("2: return of a job -")
    assert told[-1].endswith("on 4 machines")


@pytest.mark.slow
def test_skrl_trains():
    """Two rollouts of whole jobs, and a score on machines that no training draws."""
    pytest.importorskip("skrl")
    told = run("recipes/with_skrl.py", "--rollouts", 2, "--machines", 4, "--scored", 4)
    assert "240 steps on each of 4 machines" in told
    assert "on 4 machines" in told.splitlines()[-1]
