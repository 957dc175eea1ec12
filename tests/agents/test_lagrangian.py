"""PPO under a constraint finds the constrained optimum of a problem whose optimum is known."""

from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.spaces import Box
from stable_baselines3.common.callbacks import BaseCallback
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


class Iterates(BaseCallback):
    """Push, its mean square as the policy spreads it, and the multiplier, at the end of every rollout."""

    def __init__(self):
        super().__init__()
        self.rows = []

    def _on_step(self):
        return True

    def _on_rollout_end(self):
        push = float(self.model.predict(np.zeros(1, np.float32), deterministic=True)[0][0])
        deviation = float(self.model.policy.log_std.detach().exp())
        self.rows.append((push, push**2 + deviation**2, float(self.model.multiplier)))


def _trained(limit, steps, monkeypatch):
    """Means of the iterates over the last two fifths of the steps: primal and dual circle around the saddle point."""
    monkeypatch.syspath_prepend(str(AGENTS))
    from constrained_ppo import CostRecorder, LagrangianPPO

    torch.set_num_threads(1)
    iterates = Iterates()
    LagrangianPPO(
        "MlpPolicy",
        CostRecorder(DummyVecEnv([Push] * 4)),
        cost_limit=limit,
        multiplier_rate=0.05,
        n_steps=25,
        batch_size=100,
        n_epochs=3,
        learning_rate=1e-2,
        seed=1,
        device="cpu",
        policy_kwargs={"log_std_init": -1.5},
    ).learn(steps, iterates)
    return np.mean(iterates.rows[-2 * len(iterates.rows) // 5 :], axis=0)


def test_the_constraint_holds_and_is_used_up(monkeypatch):
    """At a mean square of 0.16 the spread of the pushes takes its part; the multiplier is what more cost is worth."""
    push, mean_square, multiplier = _trained(0.16, 20_000, monkeypatch)
    assert mean_square == pytest.approx(0.16, abs=0.03)
    assert multiplier == pytest.approx(1.0 / (2.0 * push), rel=0.25)


def test_a_limit_that_nothing_reaches_changes_nothing(monkeypatch):
    """The push goes to the end of its range, and the multiplier stays at zero."""
    push, _, multiplier = _trained(2.0, 5_000, monkeypatch)
    assert push > 0.9
    assert multiplier == 0.0
