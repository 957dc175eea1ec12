"""The files for rl-baselines3-zoo have the numbers of the scripts, and make models of stable-baselines3."""

import inspect
import runpy
import sys
from pathlib import Path

import gymnasium as gym
import pytest
import yaml
from sb3_contrib import RecurrentPPO
from stable_baselines3 import PPO, SAC

from chaosgym.envs import VisitedSpeeds

AGENTS = Path(__file__).parent.parent.parent / "agents"
SAME = {
    "n_envs": "envs",
    "n_timesteps": "steps",
    "n_steps": "rollout",
    "batch_size": "batch",
    "n_epochs": "epochs",
    "gamma": "gamma",
    "gae_lambda": "gae_lambda",
    "gradient_steps": "gradient_steps",
}
OF_THE_ZOO = {"n_envs", "n_timesteps", "policy", "normalize", "env_wrapper", "env_kwargs"}


@pytest.mark.parametrize(
    ("name", "script", "algorithm"),
    [("ppo", "ppo", PPO), ("ppo_lstm", "recurrent_ppo", RecurrentPPO), ("sac", "sac", SAC)],
)
def test_numbers_are_those_of_the_script(name, script, algorithm, monkeypatch):
    """Every number is the script's default; every other key is one of the algorithm or of the zoo."""
    told = yaml.safe_load((AGENTS / "hyperparams" / f"{name}.yml").read_text())["default"]
    monkeypatch.setattr(sys, "argv", [script])
    monkeypatch.syspath_prepend(str(AGENTS))
    asked = runpy.run_path(str(AGENTS / f"{script}.py"))["arguments"]()
    for theirs, ours in SAME.items():
        if theirs in told:
            assert told[theirs] == getattr(asked, ours), theirs
    assert float(str(told["learning_rate"]).removeprefix("lin_")) == asked.learning_rate
    assert set(told) - OF_THE_ZOO <= set(inspect.signature(algorithm).parameters)
    sizes = eval(told["policy_kwargs"])  # the zoo does the same
    assert sizes in ({"net_arch": [2 * asked.units, asked.units]}, {"lstm_hidden_size": asked.units})
    env = gym.make("chaosgym/ImpactBeamTolerance-v1", **told.get("env_kwargs", {}))
    if "env_wrapper" in told:
        assert told["env_wrapper"] == f"chaosgym.envs.{VisitedSpeeds.__name__}"
        env = VisitedSpeeds(env)
    algorithm(told["policy"], env, policy_kwargs=sizes, device="cpu")
