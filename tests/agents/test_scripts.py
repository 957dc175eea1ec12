"""The training and evaluation scripts run end to end and leave what they promise."""

import csv
import json
import subprocess
import sys
from pathlib import Path

import pytest

AGENTS = Path(__file__).parent.parent.parent / "agents"


def _run(script, *arguments):
    command = [sys.executable, str(AGENTS / script), *arguments]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_a_policy_is_trained_and_saved(tmp_path):
    """train_ppo.py writes policy, config and progress."""
    out = tmp_path / "ppo"
    trained = _run("train_ppo.py", "--steps", "3200", "--rollout", "200", "--out", str(out), "--seed", "3")
    assert trained.returncode == 0, trained.stderr
    config = json.loads((out / "config.json").read_text())
    assert config["arguments"]["seed"] == 3
    assert config["versions"]["stable_baselines3"]
    episodes = list(csv.DictReader((out / "progress.csv").read_text().splitlines()))
    assert len(episodes) == 16
    assert all(float(row["return"]) < 0.0 for row in episodes)


def test_an_existing_folder_is_left_alone(tmp_path):
    """Training never writes into a folder that exists."""
    refused = _run("train_ppo.py", "--out", str(tmp_path))
    assert refused.returncode != 0
    assert "choose another folder" in refused.stderr
    assert list(tmp_path.iterdir()) == []
