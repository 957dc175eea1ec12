"""PPO under a constraint finds the constrained optimum of a problem whose optimum is known."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box
from stable_baselines3.common.vec_env import DummyVecEnv

AGENTS = Path(__file__).parent.parent.parent / "agents"


class Push(gym.Env):
    """Pushing with a force from -1 to 1 is worth the force and costs its square, where it is positive."""

    observation_space = Box(-1.0, 1.0, (1,), np.float32)
    action_space = Box(-1.0, 1.0, (1,), np.float32)

    def reset(self, *, seed=None, options=None):
        """Start ten pushes."""
        super().reset(seed=seed)
        self.left = 10
        return np.zeros(1, np.float32), {}

    def step(self, action):
        """Push once."""
        self.left -= 1
        push = float(action[0])
        return np.zeros(1, np.float32), push, self.left == 0, False, {"cost": max(push, 0.0) ** 2}


def _trained(limit, monkeypatch):
    monkeypatch.syspath_prepend(str(AGENTS))
    from train_ppo_lagrangian import CostRecorder, LagrangianPPO

    torch.set_num_threads(1)
    model = LagrangianPPO(
        "MlpPolicy", CostRecorder(DummyVecEnv([Push] * 4)), cost_limit=limit, multiplier_rate=0.05, n_steps=50,
        batch_size=100, n_epochs=5, learning_rate=5e-3, seed=1, device="cpu", policy_kwargs={"log_std_init": -1.5},
    ).learn(30_000)  # fmt: skip
    push = float(model.predict(np.zeros(1, np.float32), deterministic=True)[0][0])
    return push, float(model.policy.log_std.detach().exp()), float(model.multiplier)


def test_the_constraint_holds_and_is_used_up(monkeypatch):
    """At a mean square of 0.16 the spread of the pushes takes its part; the multiplier is what more cost is worth."""
    push, deviation, multiplier = _trained(0.16, monkeypatch)
    assert push**2 + deviation**2 == pytest.approx(0.16, abs=0.04)
    assert multiplier == pytest.approx(1.0 / (2.0 * push), rel=0.25)


def test_a_limit_that_nothing_reaches_changes_nothing(monkeypatch):
    """The push goes to the end of its range, and the multiplier stays at zero."""
    push, _, multiplier = _trained(2.0, monkeypatch)
    assert push > 0.9
    assert multiplier == 0.0
