"""From a policy trained with stable-baselines3 to one that numpy plays: its weights are read out as arrays.

Knows the multilayer policies of PPO, SAC and DQN and the one-layer LSTM policy of sb3-contrib's RecurrentPPO, without
importing any of them.
"""

from typing import Any

import numpy as np
from gymnasium.spaces import Discrete

from chaosgym.control.policies.network import Dense, Lstm, Network
from chaosgym.control.policies.policy import Normalisation, TrainedPolicy
from chaosgym.errors import ModelFileError


def exported(model: Any, env: str, envs: Any, *, memory: bool = False) -> TrainedPolicy:
    """Return the deterministic policy of a trained model.

    Parameters
    ----------
    model
        PPO, SAC, DQN or RecurrentPPO.
    env
        Id of the environment, or the file of the machine.
    envs
        What it was trained in: a ``VecNormalize`` or plain; with ``memory``, a ``SB3VisitedSpeeds`` in it.
    memory
        Whether it was trained with a memory of visited speeds.

    Raises
    ------
    ModelFileError
        If the policy has parts that can't be exported; names them.

    Examples
    --------
    >>> from stable_baselines3 import PPO
    >>> from chaosgym.control.policies.export import exported
    >>> from chaosgym.envs.sb3 import SB3VecEnv
    >>> env = "chaosgym/ImpactBeamTolerance-v1"
    >>> venv = SB3VecEnv(env, 4)
    >>> policy = exported(PPO("MlpPolicy", venv), env, venv)
    >>> policy.env
    'chaosgym/ImpactBeamTolerance-v1'
    """
    weights = {name: values.detach().cpu().numpy() for name, values in model.policy.state_dict().items()}
    if hasattr(model.policy, "actor") and hasattr(model.policy.actor, "latent_pi"):
        hidden, last = "actor.latent_pi", "actor.mu"
    elif hasattr(model.policy, "q_net"):
        hidden, last = "q_net.q_net", ""
    else:
        hidden, last = "mlp_extractor.policy_net", "action_net"
    activation = model.policy.activation_fn.__name__.lower()
    places = sorted(int(name.split(".")[-2]) for name in weights if name.startswith(hidden) and name.endswith("weight"))
    last = last or f"{hidden}.{places.pop()}"
    names = [*((f"{hidden}.{place}", activation) for place in places), (last, "none")]
    network = Network(_lstm(weights), tuple(_dense(weights, name, kind) for name, kind in names))
    usual = None
    if memory:
        inner = envs
        while not hasattr(inner, "memory"):
            inner = inner.venv
        usual = inner.memory.usual
    task = envs.get_attr("task")[0]
    return TrainedPolicy(
        env=env,
        action="trim" if isinstance(model.action_space, Discrete) else "continuous",
        network=network,
        normalisation=_normalisation(envs),
        usual=usual,
        squashed=bool(model.policy.squash_output),
        machine=envs.get_attr("nominal")[0].definition,
        observes=tuple(task.places),
        cycles_per_step=task.cycles_per_step,
    )


def _dense(weights: dict[str, Any], name: str, activation: str) -> Dense:
    try:
        return Dense(weights[f"{name}.weight"], weights[f"{name}.bias"], activation)
    except KeyError as error:
        raise ModelFileError(
            f"the policy has no {error}; known: dense policies of PPO, SAC, DQN and RecurrentPPO"
        ) from None


def _lstm(weights: dict[str, Any]) -> Lstm | None:
    if "lstm_actor.weight_ih_l0" not in weights:
        return None
    if "lstm_actor.weight_ih_l1" in weights:
        raise ModelFileError("the policy has more than one layer of LSTM units; allowed: one")
    bias = weights["lstm_actor.bias_ih_l0"] + weights["lstm_actor.bias_hh_l0"]
    return Lstm(weights["lstm_actor.weight_ih_l0"], weights["lstm_actor.weight_hh_l0"], bias)


def _normalisation(envs: Any) -> Normalisation | None:
    if not hasattr(envs, "obs_rms"):
        return None
    statistics = envs.obs_rms
    return Normalisation(statistics.mean, np.sqrt(statistics.var + envs.epsilon), float(envs.clip_obs))
