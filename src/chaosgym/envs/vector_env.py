"""The native vector environment: all jobs step in one compiled call, on all processors.

envs = gym.make_vec("chaosgym/ImpactBeam-v1", num_envs=256)

Every sub-environment does what a single environment with its seed does, bit for bit, and has a generator of its own.
"""

import warnings
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.utils.seeding import np_random
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from chaosgym.arrays import Indices
from chaosgym.envs import environment
from chaosgym.envs.drive import checked_actions
from chaosgym.envs.machine_env import EnvSettings, JobSpec, metadata_of, start_of
from chaosgym.envs.observation import Observation
from chaosgym.envs.task import Status
from chaosgym.errors import ParameterError
from chaosgym.numbers import whole

if TYPE_CHECKING:
    from chaosgym.envs.rendering import Dashboard

DRAWN = 4
"""Sub-environments that are drawn; pictures of the others are blank."""

Actions = NDArray[Any]
Flags = NDArray[np.bool_]

SHARED = ("model", "nominal", "observation_names", "render_mode", "task", "settings")
"""Attributes that all sub-environments have in common."""


def native_envs(env: str, count: int = 1, **keywords: Any) -> "MachineVectorEnv":
    """Sub-environments side by side of an id, or of a machine's file; ``keywords`` of the environment.

    Raises
    ------
    ParameterError
        If there is no such environment, or a keyword is out of range.
    """
    return cast(MachineVectorEnv, gym.make_vec(environment(env), num_envs=count, **keywords).unwrapped)


class MachineVectorEnv(JobSpec, gym.vector.VectorEnv[Observation, Actions, NDArray[Any]]):
    """Vector environment of ``gymnasium.make_vec``: sub-environments of one kind.

    Parameters
    ----------
    num_envs
        Number of sub-environments.
    max_episode_steps
        Steps after which a sub-environment is truncated; None for no limit.
    autoreset_mode
        When a sub-environment that has ended is reset: in the next step, in the same step, or by the user with
        ``reset(options={"reset_mask": ...})``.
    render_mode
        None, or "rgb_array" for pictures of the first four sub-environments.
    machine, keywords
        Those of the single environment.

    Raises
    ------
    ParameterError
        If a value is out of range; names it and the allowed range.
    """

    def __init__(
        self,
        num_envs: int = 1,
        *,
        machine: str = "",
        max_episode_steps: int | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **keywords: Any,
    ) -> None:
        if render_mode not in (None, "rgb_array"):
            raise ParameterError(
                f"render_mode = {render_mode!r} is not one of None, rgb_array; a window comes from a single environment"
            )
        for name, count in (("num_envs", num_envs), ("max_episode_steps", max_episode_steps)):
            if count is not None:
                whole(name, count, 1)
        modes = [mode.value for mode in AutoresetMode]
        if autoreset_mode not in (*AutoresetMode, *modes):
            raise ParameterError(f"autoreset_mode = {autoreset_mode!r} is not one of {', '.join(modes)}")
        self.settings = EnvSettings(machine, **keywords)
        metadata = metadata_of(self.settings, ["rgb_array"], render_mode)
        self.task, self.model = self.settings.task, self.settings.model
        self.nominal = self.settings.variants.nominal
        self.observation_names = tuple(self.task.places)
        self.jobs = self.settings.jobs(num_envs)
        self.render_mode = render_mode
        self.jobs.traced = 0 if render_mode is None else min(num_envs, DRAWN)
        self._dashboards: list[Dashboard] = []
        self._generators: list[np.random.Generator | None] = [None] * num_envs
        self._limit = max_episode_steps
        self._elapsed = np.zeros(num_envs, np.int64)
        self._needs_reset = np.ones(num_envs, np.bool_)
        self._has_begun = False
        self._options: tuple[str, ...] = ()
        self.num_envs = num_envs
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**metadata, "autoreset_mode": self.autoreset_mode}
        self.single_action_space = self.settings.actions
        self.single_observation_space = self.settings.space
        self.action_space = batch_space(self.settings.actions, num_envs)
        self.observation_space = batch_space(self.settings.space, num_envs)

    def reset(
        self, *, seed: int | Sequence[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start all jobs, or those that ``options["reset_mask"]`` marks.

        Parameters
        ----------
        seed
            One for each sub-environment, or s for s, s + 1, s + 2, ...
        options
            As for the single environment, with ``"machine"`` one number or (num_envs,), and ``"reset_mask"``:
            (num_envs,) bool. They hold for the jobs that begin here: a job after an autoreset draws its machine and
            starts below its demand, which is warned of.

        Raises
        ------
        ParameterError, SimulationError
            As the single environment.
        """
        options = dict(options or {})
        which = self._masked(options.pop("reset_mask", None))
        seeds = self._seeds(seed)
        start = start_of(self.settings, options, self.num_envs)
        self._options = tuple(options)
        observation, info = self._start(which, [seeds[i] for i in which.tolist()], *start)
        if not self._has_begun:
            self._last = np.zeros(cast(tuple[int, ...], self.observation_space.shape), np.float32)
            self._has_begun = True
        self._last[which] = observation
        infos: dict[str, Any] = {}
        self._add(infos, which, info)
        return self._last.copy(), infos

    def step(self, actions: Actions) -> tuple[Observation, NDArray[Any], Flags, Flags, dict[str, Any]]:
        """Run one step of all jobs; those that have ended start anew as ``autoreset_mode`` says.

        Raises
        ------
        ParameterError
            If the actions are not of the action space.
        gymnasium.error.ResetNeeded
            Before the first reset, and without autoreset after the end of a job.
        """
        actions = checked_actions(self.task, actions, self.num_envs)
        over = np.flatnonzero(self._needs_reset)
        if not self._has_begun or (len(over) and self.autoreset_mode is not AutoresetMode.NEXT_STEP):
            raise gym.error.ResetNeeded(f"no job is running in sub-environments {over.tolist()}; call reset() first")
        running = np.flatnonzero(~self._needs_reset)
        observations = self._last.copy()
        rewards = np.zeros(self.num_envs)
        terminated, truncated = np.zeros(self.num_envs, np.bool_), np.zeros(self.num_envs, np.bool_)
        infos: dict[str, Any] = {}
        if len(running):
            outcome = self.jobs.step(running, actions[running], self._generators_of(running))
            self._elapsed[running] += 1
            observations[running], rewards[running] = outcome.observation, outcome.reward
            info = {name: outcome.report[name] for name in self.jobs.told}
            terminated[running] = info["status"] != Status.RUNNING
            if self._limit is not None:
                truncated[running] = self._elapsed[running] >= self._limit
            self._take_in(running, info, outcome.observation)
            self._report(infos, observations, running, info, terminated | truncated)
        if len(over):
            observations[over], info = self._start_anew(over)
            self._add(infos, over, info)
        self._last = observations
        return observations.copy(), rewards, terminated, truncated, infos

    def _report(
        self, infos: dict[str, Any], observations: Observation, running: Indices, info: Mapping[str, Any], ended: Flags
    ) -> None:
        """Write the info of a step, and start the jobs that have ended if that is to happen in the same step."""
        fresh = np.flatnonzero(ended)
        if self.autoreset_mode is not AutoresetMode.SAME_STEP or len(fresh) == 0:
            self._needs_reset = ended
            self._add(infos, running, info)
            return
        final = np.full(self.num_envs, None, dtype=object)
        last: dict[str, Any] = {}
        for i in fresh.tolist():
            final[i] = observations[i].copy()
        self._add(last, fresh, {name: values[fresh] for name, values in info.items()})
        infos |= {"final_obs": final, "_final_obs": ended.copy(), "final_info": last, "_final_info": ended.copy()}
        if len(fresh) < self.num_envs:
            going = np.flatnonzero(~ended)
            self._add(infos, going, {name: values[going] for name, values in info.items()})
        observations[fresh], started = self._start_anew(fresh)
        self._add(infos, fresh, started)

    def _start_anew(self, which: Indices) -> tuple[Observation, dict[str, Any]]:
        """Start jobs after an autoreset; the options of the reset before do not hold for them."""
        if self._options:
            warnings.warn(
                f"options {', '.join(self._options)} held for the jobs that reset() began, not for those after an "
                "autoreset; with autoreset_mode='Disabled' every reset takes options",
                stacklevel=4,
            )
            self._options = ()
        return self._start(which, [None] * len(which))

    def _start(
        self,
        which: Indices,
        seeds: Sequence[int | None],
        speed: float | None = None,
        machine: Indices | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Start jobs, below their first demand and on machines drawn by default; ``machine`` has all N numbers."""
        for i, seed in zip(which.tolist(), seeds, strict=True):
            if seed is not None or self._generators[i] is None:
                self._generators[i] = np_random(seed)[0]
        numbers = None if machine is None else machine[which]
        result = self.jobs.start(which, self._generators_of(which), numbers, speed)
        self._elapsed[which] = 0
        self._needs_reset[which] = False
        if self.jobs.traced:
            self._begin(which)
        return result

    def _begin(self, which: Indices) -> None:
        """Begin the pictures of jobs."""
        from chaosgym.envs.rendering import Dashboard

        while len(self._dashboards) < self.jobs.traced:
            self._dashboards.append(Dashboard(self.nominal, self.task, window=False))
        for i in which[which < self.jobs.traced].tolist():
            self._dashboards[i].start()

    def _take_in(self, which: Indices, info: Mapping[str, Any], observation: Observation) -> None:
        """Let the pictures take in a step."""
        for k in np.flatnonzero(which < self.jobs.traced).tolist():
            own = {name: info[name][k] for name in ("speed", "demand", "type_iii")}
            self._dashboards[int(which[k])].add(own, observation[k])

    def render(self) -> tuple[Any, ...] | None:
        """Return a picture (height, width, 3) of each sub-environment; those after the first four are blank."""
        if self.render_mode is None:
            gym.logger.warn("render() shows nothing without a render_mode; make the environments with rgb_array")
            return None
        if not self._has_begun:
            raise gym.error.ResetNeeded("there is nothing to show yet; call reset() first")
        from chaosgym.envs.rendering import blank, record_of

        cycles = self.task.cycles_per_step
        pairs = zip(self._dashboards, self.jobs.segments, strict=False)
        drawn = [dashboard.draw(record_of(segments, cycles)) for dashboard, segments in pairs]
        return (*drawn, *(self.num_envs - len(drawn)) * [blank()])

    def _generators_of(self, which: Indices) -> list[np.random.Generator]:
        return [cast(np.random.Generator, self._generators[i]) for i in which.tolist()]

    def _add(self, infos: dict[str, Any], which: Indices, named: Mapping[str, Any]) -> None:
        """Write values (k,) of some sub-environments into arrays by name, each with a mask of who has one."""
        if len(which) == self.num_envs:
            everyone = np.ones(self.num_envs, np.bool_)
            for name, values in named.items():
                infos[name], infos[f"_{name}"] = values, everyone
            return
        for name, values in named.items():
            if name not in infos:
                infos[name], infos[f"_{name}"] = np.zeros(self.num_envs, values.dtype), np.zeros(self.num_envs, bool)
            infos[name][which] = values
            infos[f"_{name}"][which] = True

    def _masked(self, mask: Any) -> Indices:
        if mask is None:
            return np.arange(self.num_envs)
        if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (self.num_envs,):
            raise ParameterError(f"options['reset_mask'] = {mask!r} is not an array ({self.num_envs},) of bool")
        if not mask.any():
            raise ParameterError("options['reset_mask'] marks no sub-environment; allowed: at least one")
        if not self._has_begun and not mask.all():
            raise ParameterError("options['reset_mask'] leaves sub-environments without a job; allowed: all at first")
        return np.flatnonzero(mask)

    def _seeds(self, seed: int | Sequence[int | None] | None) -> Sequence[int | None]:
        if seed is None:
            return [None] * self.num_envs
        if isinstance(seed, int | np.integer):
            return [int(seed) + i for i in range(self.num_envs)]
        seeds: list[int | None] = list(seed) if hasattr(seed, "__len__") else []
        if len(seeds) != self.num_envs or not all(one is None or isinstance(one, int | np.integer) for one in seeds):
            raise ParameterError(
                f"seed = {seed!r} is not usable; allowed: one whole number, or {self.num_envs} whole numbers or None"
            )
        return seeds

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """Return an attribute of each sub-environment: its own (speed, machine, np_random) or one that all share.

        Raises
        ------
        AttributeError
            If there is no such attribute; names those that there are.
        """
        if name in SHARED:
            return (getattr(self, name),) * self.num_envs
        own: dict[str, Callable[[int], Any]] = {
            "speed": lambda i: float(self.jobs.speed[i]),
            "machine": self.jobs.machine_at,
            "np_random": lambda i: self._generators[i],
        }
        if name not in own:
            raise AttributeError(f"a sub-environment has no attribute {name!r}; known: {', '.join((*own, *SHARED))}")
        return tuple(own[name](i) for i in range(self.num_envs))
