"""The native vector environment for stable-baselines3: its own kind of vector environment.

envs = SB3VecEnv("chaosgym/ImpactBeam-v1", num_envs=16)
PPO("MlpPolicy", VecMonitor(envs)).learn(100_000)

Gives what ``DummyVecEnv`` gives of as many single environments, with one compiled call a step.
"""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from chaosgym.envs.memory import SpeedMemory, Usual, remembered_space
from chaosgym.envs.observation import Observation
from chaosgym.envs.vector_env import MachineVectorEnv, native_envs
from chaosgym.errors import ParameterError

Selection = int | Iterable[int] | None
"""Sub-environments: one, some, or all of them."""


def rows_of(infos: Mapping[str, Any], count: int) -> list[dict[str, Any]]:
    """Return the infos of a vector environment as plain numbers, one dictionary for each sub-environment."""
    names = [name for name in infos if not name.startswith("_")]
    columns = [infos[name].tolist() for name in names]
    masks = [infos[f"_{name}"] for name in names]
    if all(mask.all() for mask in masks):
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]
    return [
        {name: column[i] for name, column, mask in zip(names, columns, masks, strict=True) if mask[i]}
        for i in range(count)
    ]


class SB3VecEnv(VecEnv):
    """The native vector environment of an id, as stable-baselines3's ``VecEnv``.

    Parameters
    ----------
    env
        Id of a chaosgym environment, a machine's file, or a native vector environment with autoreset in the same step.
    num_envs, keywords
        Of ``native_envs``, for an id or a file.

    Raises
    ------
    ParameterError
        If ``env`` is not usable, or a keyword is not.
    """

    def __init__(self, env: str | gym.vector.VectorEnv[Any, Any, Any], num_envs: int = 1, **keywords: Any) -> None:
        if isinstance(env, str):
            env = native_envs(env, num_envs, autoreset_mode=AutoresetMode.SAME_STEP, **keywords)
        native = env.unwrapped
        if not isinstance(native, MachineVectorEnv) or native.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ParameterError(f"env = {env} is not one of a chaosgym id, make_vec(id, autoreset_mode='SameStep')")
        self.env = native
        self._infos: list[dict[str, Any]] = []
        super().__init__(native.num_envs, native.single_observation_space, native.single_action_space)

    def reset(self) -> Observation:
        """Start all jobs, with the seeds and options that ``seed`` and ``set_options`` have set.

        Raises
        ------
        ParameterError
            If the options are not usable, or not the same for all sub-environments.
        """
        if any(options != self._options[0] for options in self._options):
            raise ParameterError("options differ between sub-environments; allowed: the same for all")
        observations, infos = self.env.reset(seed=self._seeds, options=self._options[0])
        self.reset_infos = rows_of(infos, self.num_envs)
        self._reset_seeds()
        self._reset_options()
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Take the actions of the next step."""
        self._actions = actions

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Run the step; a job that ends starts anew, its last observation goes into ``terminal_observation``."""
        observations, rewards, terminated, truncated, infos = self.env.step(self._actions)
        ended = terminated | truncated
        if not ended.any():
            rows = rows_of(infos, self.num_envs)
            for row in rows:
                row["TimeLimit.truncated"] = False
            return observations, rewards.astype(np.float32), ended, rows
        final = infos.pop("final_obs")
        last = rows_of(infos.pop("final_info"), self.num_envs)
        del infos["_final_obs"], infos["_final_info"]
        rows = rows_of(infos, self.num_envs)
        for i in np.flatnonzero(ended).tolist():
            self.reset_infos[i] = rows[i]
            rows[i] = last[i] | {"terminal_observation": final[i]}
        for i, row in enumerate(rows):
            row["TimeLimit.truncated"] = bool(truncated[i] and not terminated[i])
        return observations, rewards.astype(np.float32), ended, rows

    def close(self) -> None:
        """Close the environment."""
        self.env.close()

    def get_attr(self, attr_name: str, indices: Selection = None) -> list[Any]:
        """Return an attribute of some sub-environments; see ``MachineVectorEnv.get_attr``."""
        values = self.env.get_attr(attr_name)
        return [values[i] for i in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: Selection = None) -> None:
        """Refuse: sub-environments are set up by keywords alone.

        Raises
        ------
        AttributeError
            Always.
        """
        raise AttributeError(f"{attr_name} can't be set; give it as a keyword when the environment is made")

    def env_method(
        self, method_name: str, *method_args: Any, indices: Selection = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of some sub-environments: ``get_wrapper_attr`` or ``has_wrapper_attr``, with a name.

        Raises
        ------
        AttributeError
            If it is another one: the rest is done for all sub-environments at once.
        """
        chosen = list(self._get_indices(indices))
        if method_name == "get_wrapper_attr":
            return self.get_attr(str(method_args[0]), chosen)
        if method_name == "has_wrapper_attr":
            return [self.has_attr(str(method_args[0]))] * len(chosen)
        raise AttributeError(f"a sub-environment has no method {method_name!r}; known: get_wrapper_attr")

    def env_is_wrapped(
        self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: Selection = None
    ) -> list[bool]:
        """Tell that no sub-environment is wrapped; ``VecMonitor`` and the like wrap all of them."""
        return [False for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return no pictures: they come from single environments."""
        return [None] * self.num_envs


class SB3VisitedSpeeds(VecEnvWrapper):
    """What ``VisitedSpeeds`` is for one environment.

    Parameters
    ----------
    envs
        A ``SB3VecEnv``.
    usual, learns
        As for ``SpeedMemory``.
    """

    def __init__(self, envs: VecEnv, usual: Usual | None = None, *, learns: bool = True) -> None:
        task = envs.get_attr("task")[0]
        self.memory = SpeedMemory(task, envs.num_envs, usual, learns=learns)
        super().__init__(envs, observation_space=remembered_space(task))

    def reset(self) -> Observation:
        """Start all jobs, with nothing remembered."""
        self.memory.forget(np.ones(self.num_envs, np.bool_))
        return self.memory.add(cast(Observation, self.venv.reset()))

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Run the step and remember it; a job that starts anew remembers nothing of the last one."""
        stepped, rewards, ended, infos = self.venv.step_wait()
        given = cast(Observation, stepped)
        if not ended.any():
            return self.memory.add(given), rewards, ended, infos
        fresh = np.flatnonzero(ended).tolist()
        last = given.copy()
        for i in fresh:
            last[i] = infos[i]["terminal_observation"]
        seen = self.memory.add(last)
        for i in fresh:
            infos[i]["terminal_observation"] = seen[i].copy()
        self.memory.forget(ended)
        seen[ended] = self.memory.first(ended, given)
        return seen, rewards, ended, infos
