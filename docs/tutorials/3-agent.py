# ---
# jupyter:
#   jupytext: {text_representation: {extension: .py, format_name: percent}}
#   kernelspec: {display_name: Python 3, language: python, name: python3}
# ---

# %% [markdown]
# # 3. Train an agent, and read its curves
#
# Production demands a speed. The agent trims it a little, away from chaos. Every reset draws another machine within
# the tolerances, so the agent must feel which speeds are calm.
#
# This tutorial trains for half a minute only. That is enough to see how the pieces fit, and far too little to learn
# the task. The shipped agent took 600,000 steps.
#
# ## The environment

# %%
import gymnasium as gym
import matplotlib.pyplot as plt
import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecMonitor, VecNormalize

import chaosgym
from chaosgym.control.policies.shipped import shipped_policy
from chaosgym.envs import SB3VecEnv

torch.set_num_threads(1)

name = "chaosgym/ImpactBeamTolerance-v1"
env = gym.make(name)
observation, info = env.reset(seed=0)
for label, value in zip(env.unwrapped.observation_names, observation, strict=True):
    print(f"{label:24} {value:8.3f}")

# %% [markdown]
# ## Many machines at once
#
# `gym.make_vec` steps all machines in one compiled call. `SB3VecEnv` is the same environment in the form that
# stable-baselines3 wants.

# %%
envs = gym.make_vec(name, num_envs=8)
observations, infos = envs.reset(seed=0)
print(observations.shape, np.round(1e3 * infos["clearance"], 3), "mm")
envs.close()

# %% [markdown]
# ## Train
#
# Plain PPO with its default network. `VecNormalize` scales observations and rewards.

# %%
train = VecNormalize(VecMonitor(SB3VecEnv(name, num_envs=16)))
model = PPO("MlpPolicy", train, n_steps=60, batch_size=240, seed=0, device="cpu")
returns = []


def keep(local, _):
    """Note the return of every finished job, and go on."""
    returns.extend(one["episode"]["r"] for one in local["infos"] if "episode" in one)
    return True


model.learn(24_000, callback=keep)
print(f"{len(returns)} jobs of training")

# %% [markdown]
# ## Read the curve
#
# A single job says little: machines differ, and so do demands. Look at means over many jobs, and compare with a rule.

# %%
returns = np.array(returns)
block = max(len(returns) // 6, 1)
means = [returns[k : k + block].mean() for k in range(0, len(returns) - block + 1, block)]
errors = [returns[k : k + block].std() / np.sqrt(block) for k in range(0, len(returns) - block + 1, block)]
figure, axes = plt.subplots(figsize=(6, 3), layout="constrained")
axes.errorbar(block * (np.arange(len(means)) + 0.5), means, yerr=errors, marker="o", capsize=3)
axes.set(xlabel="jobs of training", ylabel="return of a job")
plt.show()

# %% [markdown]
# ## Score it
#
# `evaluate` plays machines that no training draws. The score is 0 for following the demand and 1 for a plan made on
# the machine's own map. `VecNormalize` travels with the model.

# %%
mine = chaosgym.evaluate(model, name, machines=16)
print(f"trained here: {mine.score:.2f} ({mine.interval[0]:.2f} to {mine.interval[1]:.2f})")

# %%
shipped = chaosgym.evaluate(shipped_policy(name), name, machines=16)
print(f"shipped:      {shipped.score:.2f} ({shipped.interval[0]:.2f} to {shipped.interval[1]:.2f})")

# %% [markdown]
# Sixteen machines leave wide intervals; use all 256 for a result that you report, and several seeds. An interval that
# holds zero can't be told from following the demand. After so few steps nothing better is to be expected.
#
# The shipped agent is a learned map: it learns what each machine did at every speed, not one reward a step
# (page *Training*).
