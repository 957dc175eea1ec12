"""The adapter for stable-baselines3 gives what DummyVecEnv gives of single environments."""

import copy
import re
import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.errors import ParameterError

pytest.importorskip("stable_baselines3")

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv, VecMonitor

from chaosgym.envs import SB3VecEnv

BEAM = "chaosgym/ImpactBeamTolerance-v1"
SHORT: dict[str, Any] = {"steps": 6}


def _dummy(count: int, **keywords: Any) -> VecEnv:
    return DummyVecEnv([lambda: gym.make(BEAM, **keywords)] * count)


def _assert_equal_infos(one: list[dict[str, Any]], other: list[dict[str, Any]]) -> None:
    for a, b in zip(one, other, strict=True):
        assert a.keys() == b.keys()
        for name in a:
            assert type(a[name]) is type(b[name])
            assert np.array_equal(a[name], b[name])


@pytest.mark.filterwarnings("ignore:options speed held for the jobs")
def test_steps_equal_those_of_dummy_vec_env() -> None:
    """Observations, rewards, ends, infos, terminal observations, truncation flags and reset infos agree to the bit."""
    envs = [SB3VecEnv(BEAM, 3, max_episode_steps=4, **SHORT), _dummy(3, max_episode_steps=4, **SHORT)]
    for env in envs:
        env.seed(11)
        env.set_options({"speed": 20.0})
    first, second = (env.reset() for env in envs)
    assert np.array_equal(first, second)
    _assert_equal_infos(*(env.reset_infos for env in envs))
    generator = np.random.default_rng(0)
    truncated = 0
    for _ in range(9):
        action = generator.integers(0, 6, 3)
        one, other = (env.step(action) for env in envs)
        for a, b in zip(one[:3], other[:3], strict=True):
            assert a.dtype == b.dtype
            assert np.array_equal(a, b)
        _assert_equal_infos(one[3], other[3])
        _assert_equal_infos(*(env.reset_infos for env in envs))
        truncated += sum(info["TimeLimit.truncated"] for info in one[3])
    assert truncated == 6


class _Rollouts(BaseCallback):
    """Keep the rollouts of a training run."""

    def __init__(self) -> None:
        super().__init__()
        self.kept: list[dict[str, np.ndarray]] = []

    def _on_step(self) -> bool:
        return True

    def _on_rollout_end(self) -> None:
        buffer = self.model.rollout_buffer
        names = ("observations", "actions", "rewards", "episode_starts", "advantages")
        self.kept.append({name: copy.deepcopy(getattr(buffer, name)) for name in names})


def _train(envs: VecEnv) -> tuple[list[dict[str, np.ndarray]], dict[str, torch.Tensor]]:
    torch.set_num_threads(1)
    rollouts = _Rollouts()
    model = PPO("MlpPolicy", envs, n_steps=16, batch_size=16, n_epochs=2, seed=3, device="cpu")
    model.learn(3 * 4 * 16, callback=rollouts)
    return rollouts.kept, model.policy.state_dict()


def test_ppo_learns_the_same() -> None:
    """Same seed: the same rollouts and, after three updates, the same weights as with DummyVecEnv."""
    native = _train(VecMonitor(SB3VecEnv(BEAM, 4, **SHORT)))
    dummy = _train(VecMonitor(_dummy(4, **SHORT)))
    assert len(native[0]) == 3
    for one, other in zip(native[0], dummy[0], strict=True):
        for name in one:
            assert np.array_equal(one[name], other[name]), name
    for name, weights in native[1].items():
        assert torch.equal(weights, dummy[1][name]), name


def test_evaluation_runs_on_it() -> None:
    """stable-baselines3's own evaluation sees whole episodes through VecMonitor."""
    envs = VecMonitor(SB3VecEnv(BEAM, 2, **SHORT))
    model = PPO("MlpPolicy", envs, n_steps=8, batch_size=8, device="cpu", seed=0)
    returns, lengths = evaluate_policy(model, envs, n_eval_episodes=4, return_episode_rewards=True)
    assert lengths == [6] * 4
    assert max(returns) < 0.0


def test_seeds_follow_each_other() -> None:
    """seed(s) gives sub-environment i the seed s + i, used once, and returns them."""
    envs = SB3VecEnv(BEAM, 2, **SHORT)
    assert envs.seed(4) == [4, 5]
    first, second = envs.reset(), envs.reset()
    assert not np.array_equal(first, second)
    assert np.array_equal(first[1], gym.make(BEAM, **SHORT).reset(seed=5)[0])


def test_sub_environments_can_be_asked() -> None:
    """Attributes come for the chosen ones; what would change one alone is refused by name."""
    envs = SB3VecEnv(gym.make_vec(BEAM, num_envs=3, autoreset_mode="SameStep", **SHORT))
    envs.reset()
    assert envs.get_attr("speed", [0, 2]) == [envs.env.jobs.speed[i] for i in (0, 2)]
    assert envs.env_method("get_wrapper_attr", "speed", indices=1) == [envs.env.jobs.speed[1]]
    assert envs.get_attr("task", 1)[0].steps == 6
    assert envs.has_attr("task")
    assert not envs.has_attr("wings")
    assert envs.env_is_wrapped(Monitor) == [False] * 3
    for call in (lambda: envs.set_attr("speed", 4.0), lambda: envs.env_method("reset")):
        with pytest.raises(AttributeError, match=r"speed can't be set|no method 'reset'"):
            call()


def test_other_environments_are_refused() -> None:
    """Only native ones that start anew in the same step can be adapted."""
    for other in (gym.make_vec(BEAM, num_envs=2), gym.make_vec("CartPole-v1", num_envs=2)):
        with pytest.raises(ParameterError, match=re.escape("make_vec(id, autoreset_mode='SameStep')")):
            SB3VecEnv(other)


def test_stable_baselines3_is_imported_when_asked_for() -> None:
    """The environments do without it."""
    code = (
        "import sys, gymnasium, chaosgym; gymnasium.make_vec('chaosgym/ImpactBeam-v1', num_envs=2);"
        "print('stable_baselines3' in sys.modules, 'torch' in sys.modules)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]
