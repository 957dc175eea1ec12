"""Small policies of stable-baselines3, trained for next to nothing, for tests of what becomes of them."""

import torch
from stable_baselines3.common.vec_env import VecNormalize

import chaosgym  # noqa: F401
from chaosgym.envs import SB3VecEnv

ENV = "chaosgym/ImpactBeam-v1"


def trained(algorithm, policy, keywords=None, **options):
    """A model and its VecNormalize, after a few dozen steps of short jobs."""
    torch.set_num_threads(1)
    envs = VecNormalize(SB3VecEnv(ENV, num_envs=2, steps=10, **(keywords or {})))
    return algorithm(policy, envs, seed=3, device="cpu", **options).learn(64), envs
