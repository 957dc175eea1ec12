"""The demo passes through every floor; here with a smaller sweep and a shorter training."""

import re
from pathlib import Path

import gymnasium as gym
import pytest

from chaosgym import demo
from chaosgym.envs.evaluation import constant_speed, evaluate
from chaosgym.errors import DatasetError
from chaosgym.sweeps import Axis

README = (Path(__file__).parent.parent / "README.md").read_text()


def test_readme_shows_what_constant_speeds_of_the_demo_earn():
    """Return, share of Type III, damage and time of the constant speeds are those of the table."""
    rows = re.findall(r"^\| constant (\d+) Hz[^|]*\| (\S+) \| (\S+) % \| (\S+) \| (\S+) \|$", README, re.MULTILINE)
    assert len(rows) == 3
    env = gym.make(demo.ENVIRONMENT)
    for speed, *written in rows:
        earned = evaluate(env, constant_speed(env, float(speed)), demo.JOBS, demo.TEST_SEED).summary()
        found = [earned["return"], 100.0 * earned["type_iii_share"], earned["damage"], earned["time_cost"]]
        assert [float(value) for value in written] == pytest.approx(found, abs=0.02)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:CUDA initialization")
def test_demo_computes_every_number_and_draws_the_figure(tmp_path, monkeypatch):
    """Three points of the printed natures, a typed sweep, a judged classifier, an agent beside constant speeds."""
    axes = (Axis("excitation_frequency", 6.0, 30.0, 24, "log"), Axis("clearance", 1.0e-4, 1.45e-4, 5, "log"))
    monkeypatch.setattr(demo, "AXES", axes)
    monkeypatch.setattr(demo, "TRAINING_STEPS", 1600)
    monkeypatch.setattr(demo, "JOBS", 1)
    monkeypatch.setattr(demo, "CONSTANT_SPEEDS", 3)
    said = []
    result = demo.run_demo(tmp_path / "demo", say=said.append)
    assert [row["nature"] for row in result["points"].values()] == ["periodic", "periodic", "chaotic"]
    assert result["points"]["III"]["type_in_sweep"] == "III"
    assert result["sweep"]["points"] == 120
    assert 0.0 <= result["classifier"]["parameters"]["response_type"]["classifier"]["accuracy"][0] <= 1.0
    assert result["agent"]["agent"]["return"] < 0.0
    assert (tmp_path / "demo" / "overview.png").stat().st_size > 20_000
    assert len(said) == 5
    assert any("chaotic" in line for line in demo.demo_table(result))
    with pytest.raises(DatasetError, match="choose another folder"):
        demo.run_demo(tmp_path / "demo", say=said.append)
