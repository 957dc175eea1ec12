"""The Gymnasium environment, one class for every machine and task.

A step is a whole number of operating cycles, so the phase of the force is zero wherever the speed changes and the
motion goes on from the state in which the last step ended.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.spaces import Space
from numpy.typing import NDArray

from chaosgym.arrays import Indices
from chaosgym.envs.drive import action_space, checked_actions
from chaosgym.envs.jobs import Jobs
from chaosgym.envs.judge import statement_of
from chaosgym.envs.levels import task_of, tolerances_of
from chaosgym.envs.motors import refuse_drive
from chaosgym.envs.observation import Observation, observation_space
from chaosgym.envs.pool import ANY, SHARE, Pool, pool_task
from chaosgym.envs.task import Status, Task, UnknownKeywordError, divided
from chaosgym.envs.variants import OTHER_SIMULATOR, Variants
from chaosgym.errors import ParameterError
from chaosgym.machines import MACHINES
from chaosgym.machines.accuracy import is_tolerance, model_within
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import expand_fidelity, parameters_of, with_settings
from chaosgym.numbers import whole
from chaosgym.series.verdict import Statement
from chaosgym.simulation import CycleRecord

if TYPE_CHECKING:
    from chaosgym.envs.rendering import Dashboard

FIRST = np.zeros(1, np.int64)
"""Index array of the only job."""

MODEL_SPEEDS = 5
"""Speeds of the range at all of which a model within a tolerance has to serve."""

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}


def start_of(settings: "EnvSettings", options: Mapping[str, Any], count: int) -> tuple[float | None, Indices | None]:
    """Return how ``count`` jobs start, by the options of a reset: speed, and numbers (count,) of kept machines.

    Either is None where the reset leaves it to the task.

    Raises
    ------
    ParameterError
        If an option is unknown, the speed lies outside the range of the drive or there is no such machine.
    """
    for name in options:
        if name not in ("machine", "speed"):
            raise ParameterError(f"options has no entry {name!r}; allowed: machine, speed")
    task = settings.task
    speed, low, high = options.get("speed"), task.lowest_speed, task.highest_speed
    if speed is not None and (not isinstance(speed, int | float | np.number) or not low <= speed <= high):
        raise ParameterError(f"options['speed'] = {speed!r} is out of range; allowed: {low:g} to {high:g}")
    machine = options.get("machine")
    numbers = None if machine is None else settings.variants.checked_numbers(machine, count)
    return None if speed is None else float(speed), numbers


class EnvSettings:
    """Task, machines, spaces and model of an environment, from its keywords.

    Parameters
    ----------
    machine
        Name of the machine on the command line, such as "impact-beam", the file of your own, "my-machine.toml", or
        "any" for one of the pool in each job, which takes ``split`` and fields of ``Task`` alone.
    level
        What differs from job to job: "nominal", "clearance", "wear" or "fleet".
    split
        Part of the level's machines: "train", "test", "outside", "corner" or, of the beam, "other_simulator"; None for
        all within its tolerances. Of any machine: "train", "test" or "other_machines"; None trains on the first and
        keeps the second for evaluation.
    sealed
        Whether the machines kept for evaluation are the 512 of this release instead of the 256 of development.
    jobs
        Jobs that a machine does in turn, set right in between, before another is drawn; a reset with a seed or of a
        machine's number begins anew.
    tolerances
        Half width of each field that varies, as a share of its nominal value, instead of the level's.
    fidelity, model_fidelity
        Rungs of the ladder: of the machine at work, and of ``model``, the nominal machine that controllers may use. Or
        errors that are allowed, such as "1 %": all machines have the cheapest model within it over the speeds.
    keywords
        Fields of ``Task`` and of the machine.

    Raises
    ------
    ParameterError
        If a value is out of range; names it and the allowed range.
    UnknownKeywordError
        If a keyword is unknown.
    """

    def __init__(self, machine: str, *, jobs: int = 1, **keywords: Any) -> None:
        self.variants: Variants | Pool
        self.jobs_of_each = whole("jobs", jobs, 1, 10**6)
        if machine == ANY:
            self._take_any(**keywords)
        else:
            self._take(machine, **keywords)
        refuse_drive(self.task, self.variants.nominal)
        self.space = observation_space(self.task)
        self.actions = action_space(self.task)

    def jobs(self, count: int) -> Jobs:
        """Make the jobs of this many machines."""
        return Jobs(self.task, self.variants, self.space, count, self.jobs_of_each)

    def _take_any(self, *, split: str | None = None, **keywords: Any) -> None:
        """A machine of the pool in each job; there is no model of it for controllers."""
        self.variants = Pool(split)
        self.model = nominal = self.variants.nominal
        self.unit = SHARE
        task = pool_task()
        own = (*parameters_of(task), "objective")
        for name in keywords:
            if name not in own:
                raise UnknownKeywordError(
                    f"{name} is nothing that can be set: each job draws a machine; known: split, {', '.join(own)}"
                )
        self.task, _ = divided(task, nominal, keywords)

    def _take(
        self,
        machine: str,
        *,
        level: str = "clearance",
        split: str | None = None,
        sealed: bool = False,
        tolerances: Mapping[str, float] | None = None,
        fidelity: str | None = None,
        model_fidelity: str | None = None,
        **keywords: Any,
    ) -> None:
        if machine not in MACHINES:
            raise ParameterError(f"machine = {machine!r} does not exist; {MACHINES.listed(machine)}")
        kind = MACHINES[machine]
        usual: Machine = kind()
        defaults = usual.task_defaults
        widths = tolerances_of(usual, level)
        self.task, fields = divided(task_of(usual, level), usual, keywords)
        base = {name: value for name, value in defaults.fields.items() if name not in fields}
        if fidelity is not None:
            chosen = kind.model_fields if is_tolerance(fidelity) else kind.fidelity_ladder.get(fidelity, {})
            base = {name: value for name, value in base.items() if name not in chosen}
            fields = expand_fidelity(usual, {**fields, "fidelity": fidelity})
        nominal: Machine = with_settings(usual, base | fields)
        for name in ("lowest_speed", "highest_speed"):
            try:
                nominal.at(getattr(self.task, name))
            except ParameterError as error:
                raise ParameterError(f"{name}: {error}") from None
        if fidelity is not None and is_tolerance(fidelity):
            speeds = np.linspace(self.task.lowest_speed, self.task.highest_speed, MODEL_SPEEDS).tolist()
            nominal = model_within(nominal, fidelity, [nominal.at(speed) for speed in speeds]).machine
        self.variants = Variants(nominal, widths if tolerances is None else tolerances, split, sealed=sealed)
        self.model = with_settings(nominal, defaults.model if model_fidelity is None else {"fidelity": model_fidelity})
        self.unit = parameters_of(nominal)[nominal.speed_field].unit


def first_of(info: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return the info of the one job as plain numbers."""
    return {name: values.item() for name, values in info.items()}


def metadata_of(settings: EnvSettings, modes: Sequence[str], render_mode: str | None) -> dict[str, Any]:
    """Return an environment's metadata, whose ``render_modes`` are those possible of ``modes``.

    None is, where motion has no unit or another program moves the machine.

    Raises
    ------
    ParameterError
        If ``render_mode`` is then not None.
    """
    split, any_machine = settings.variants.split, isinstance(settings.variants, Pool)
    if not any_machine and split != OTHER_SIMULATOR:
        return {**METADATA, "render_modes": list(modes)}
    if render_mode is not None:
        whose = "any machine" if any_machine else f"split = {split!r}"
        raise ParameterError(f"render_mode = {render_mode!r} is not possible with {whose}; allowed: None")
    return {**METADATA, "render_modes": []}


def copied(value: Any) -> Any:
    """Copy what keywords are made of, as deep as it goes; anything else, such as a plant, can't always be copied."""
    if isinstance(value, Mapping):
        return {name: copied(each) for name, each in value.items()}
    if isinstance(value, list | tuple):
        return type(value)(copied(each) for each in value)
    return value.copy() if isinstance(value, np.ndarray) else value


class JobSpec:
    """Specification of an environment whose job ends by itself, as termination, after ``task.steps``."""

    task: Task
    _spec: EnvSpec | None = None

    @property
    def spec(self) -> EnvSpec | None:
        """Specification, with the steps of a job as ``max_episode_steps``."""
        if self._spec is None:
            return None
        own = self._spec.max_episode_steps or self.task.steps
        return replace(self._spec, max_episode_steps=min(own, self.task.steps))

    @spec.setter
    def spec(self, given: EnvSpec | None) -> None:
        self._spec = None if given is None else replace(given, kwargs=copied(given.kwargs))


class MachineEnv(JobSpec, gym.Env[Observation, Any]):
    """A machine whose speed an agent trims around a demand; what it does and takes: docs/environments.md.

    Parameters
    ----------
    machine
        Name of the machine on the command line, or its file.
    render_mode
        None, "rgb_array" or "human".
    keywords
        Those of ``EnvSettings``.

    Raises
    ------
    ParameterError, UnknownKeywordError
        As ``EnvSettings``.
    """

    metadata = METADATA

    def __init__(self, machine: str = "", *, render_mode: str | None = None, **keywords: Any) -> None:
        if render_mode is not None and render_mode not in METADATA["render_modes"]:
            raise ParameterError(f"render_mode = {render_mode!r} is not one of None, human, rgb_array")
        self._take_settings(EnvSettings(machine, **keywords), render_mode)

    def _take_settings(self, settings: EnvSettings, render_mode: str | None) -> None:
        """Take task, spaces and jobs of some settings."""
        self.render_mode, self.settings = render_mode, settings
        self.metadata = metadata_of(settings, METADATA["render_modes"], render_mode)
        self.task, self.model = self.settings.task, self.settings.model
        self.nominal = self.settings.variants.nominal
        self.observation_names = tuple(self.task.places)
        self.observation_space = cast(Space[Observation], self.settings.space)
        self.action_space = cast(Space[Any], self.settings.actions)
        self._job = self.settings.jobs(1)
        self._job.traced = 0 if render_mode is None else 1
        self._runs = False
        self._last: dict[str, Any] = {}
        self._dashboard: Dashboard | None = None

    @property
    def speed(self) -> float:
        """Speed of the machine, in the unit of its speed field."""
        return float(self._job.speed[0])

    @property
    def machine(self) -> Machine:
        """Machine of the current job, at its current speed and clearance."""
        return self._job.machine_at(0)

    @property
    def statement(self) -> Statement:
        """What the last step tells of the running motion, in the form of every verdict.

        Raises
        ------
        gymnasium.error.ResetNeeded
            Before the first step.
        """
        if not self._last:
            raise gym.error.ResetNeeded("no step was run; call reset() and step() first")
        return statement_of(self._job.judge, self._last, self.task.cycles_per_step)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a job, with the machine run in from rest below the first demand.

        Parameters
        ----------
        seed
            Seed of the machine, the demand, the disturbance and the sensors.
        options
            ``{"machine": k}`` takes machine k, from 0 to 255, of those kept for evaluation instead of drawing one;
            ``{"speed": ...}`` starts at that speed.

        Raises
        ------
        ParameterError
            If an option is unknown or out of range.
        SimulationError
            If the machine can't be simulated at its starting speed.
        """
        super().reset(seed=seed)
        speed, numbers = start_of(self.settings, options or {}, 1)
        self._runs = False
        observation, info = self._job.start(FIRST, [self.np_random], numbers, speed)
        self._runs, self._last = True, {}
        if self.render_mode is not None:
            self._show().start()
            if self.render_mode == "human":
                self.render()
        return observation[0], first_of(info)

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Run one step; a simulation that fails ends the job instead of raising.

        Raises
        ------
        ParameterError
            If the action is not one of the action space.
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of a job.
        """
        if not self._runs:
            raise gym.error.ResetNeeded("no job is running; call reset() first")
        actions = checked_actions(self.task, [action], 1)
        outcome = self._job.step(FIRST, actions, [self.np_random])
        info = dict(zip(self._job.told, outcome.report.item(), strict=False))
        self._runs, self._last = info["status"] == Status.RUNNING, info
        if self.render_mode is not None:
            self._show().add(info, outcome.observation[0])
            if self.render_mode == "human":
                self.render()
        return outcome.observation[0], float(outcome.reward[0]), not self._runs, False, info

    def _shown(self) -> CycleRecord:
        """Last step with a time history."""
        from chaosgym.envs.rendering import record_of

        return record_of(self._job.segments[0], self.task.cycles_per_step)

    def _show(self) -> "Dashboard":
        if self._dashboard is None:
            from chaosgym.envs.rendering import Dashboard

            self._dashboard = Dashboard(self.nominal, self.task, window=self.render_mode == "human")
        return self._dashboard

    def render(self) -> Any:
        """Return a picture of the last step (height, width, 3), or show it in a window if the mode is "human"."""
        if self.render_mode is None:
            gym.logger.warn(
                "render() shows nothing without a render_mode; make the environment with rgb_array or human"
            )
            return None
        if self._dashboard is None:
            raise gym.error.ResetNeeded("there is nothing to show yet; call reset() first")
        return self._dashboard.draw(self._shown())

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._dashboard is not None:
            self._dashboard.close()
            self._dashboard = None
