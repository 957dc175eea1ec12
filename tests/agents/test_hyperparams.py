"""The hyperparameters for rl-zoo are those of the scripts."""

import importlib

import pytest
import yaml

from tests.agents.test_scripts import AGENTS

NAMES = {
    "n_envs": "envs",
    "n_timesteps": "steps",
    "n_steps": "rollout",
    "batch_size": "batch",
    "n_epochs": "epochs",
    "learning_rate": "learning_rate",
    "gamma": "gamma",
    "gae_lambda": "gae_lambda",
    "ent_coef": "entropy",
    "learning_starts": "learning_starts",
    "gradient_steps": "gradient_steps",
    "buffer_size": "steps",
}


@pytest.mark.parametrize("algorithm", ["ppo", "ppo_lstm", "sac"])
def test_a_number_is_the_same_in_both_places(algorithm, monkeypatch):
    """Every number of the YAML file that the script has too, and those inside policy_kwargs."""
    monkeypatch.syspath_prepend(str(AGENTS))
    arguments = importlib.import_module(f"train_{algorithm}").Arguments()
    written = yaml.safe_load((AGENTS / "hyperparams" / f"{algorithm}.yml").read_text())["default"]
    compared = {name: written[name] for name in NAMES if name in written}
    assert compared == {name: getattr(arguments, NAMES[name]) for name in compared}
    inner = eval(written.get("policy_kwargs", "dict()"))
    assert inner.get("log_std_init") == getattr(arguments, "log_std", None)
    assert inner.get("net_arch", [None])[0] == (arguments.units if algorithm == "ppo" else None)
    assert inner.get("lstm_hidden_size") == (arguments.units if algorithm == "ppo_lstm" else None)
