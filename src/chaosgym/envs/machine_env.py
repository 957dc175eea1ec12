"""How does an agent run a machine through a job? The one environment, for every machine and task.

A step is a whole number of operating cycles at constant speed, so the phase of the force is zero wherever the speed
changes and the motion goes on from the state in which the last step ended.
"""

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, cast

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from chaosgym.envs.drive import SpeedDrive, checked_number
from chaosgym.envs.jobs import Jobs, Rules
from chaosgym.envs.observation import Observation, observation_names, observation_space
from chaosgym.envs.pools import Pool
from chaosgym.envs.regimes import RegimeTable
from chaosgym.envs.tasks import Status, Task
from chaosgym.errors import ParameterError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import CycleRecord, simulate
from chaosgym.simulation.batch import SerialBatch, at_speed

if TYPE_CHECKING:
    from chaosgym.envs.rendering import Dashboard

Action = NDArray[np.float32]

SENSOR_ERROR = 3.0
"""Half width [N] of the error of a force sensor (thesis 3.5.2)."""

FORCE_RANGE = 5.0
"""Range of the force sensors in units of the force limit."""

RENDER_SAMPLES = 1000
"""Samples of the motion kept in each cycle for rendering."""

THE_ONE = np.zeros(1, np.int64)
"""Number of the one job."""

METADATA: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 10}


def nominal_machine(reference: Machine, parameters: Mapping[str, Any]) -> Machine:
    """Return the reference machine with some fields replaced, but not its speed.

    Raises
    ------
    ParameterError
        If a field is the speed, unknown, or out of range.
    """
    if reference.speed_field in parameters:
        raise ParameterError(
            f"{reference.speed_field} is what the agent commands; set lowest_speed and highest_speed instead"
        )
    return with_settings(reference, parameters)


class Start(NamedTuple):
    """Speed at which jobs start, and the numbers of their machines in the pool, None if they are drawn."""

    speed: float
    machine: NDArray[np.int64] | None


def start_of(pool: Pool, options: Mapping[str, Any]) -> Start:
    """Return how jobs start, by the options of a reset.

    Raises
    ------
    ParameterError
        If an option is unknown, the speed lies outside the range of the drive or the machine is not in the pool.
    """
    for name in options:
        if name not in ("machine", "speed"):
            raise ParameterError(f"options has no entry {name!r}; allowed: machine, speed")
    drive = pool.drive
    low, high = drive.lowest_speed, drive.highest_speed
    speed = checked_number("options['speed']", options.get("speed", low), low, high)
    machine = options.get("machine")
    return Start(float(drive.rounded(speed)), None if machine is None else pool.checked(machine))


def _first(info: Mapping[str, NDArray[Any]]) -> dict[str, Any]:
    """Return the info of the one job as plain numbers."""
    return {name: values[0].item() for name, values in info.items()}


class MachineEnv(gym.Env[Observation, Action]):
    """A machine, the drive that sets its speed, and a task.

    Parameters
    ----------
    machine
        The nominal machine.
    drive
        Meaning of the action.
    task
        Job, reward and cost.
    tolerances
        Half width of the manufacturing tolerance of each field that varies, as a share of its nominal value.
    pool
        "nominal" for the nominal machine, or the pool that the machine of each job is drawn from: "training" or
        "held-out".
    wear
        Whether the clearance grows with the damage, which the agent then sees.
    sensor_error
        Half width [N] of the uniform error of each measured peak force.
    render_mode
        None, "rgb_array" or "human".

    Raises
    ------
    ParameterError
        If a value is out of range; names it and the allowed range.
    """

    metadata = METADATA

    def __init__(
        self,
        machine: Machine,
        drive: SpeedDrive,
        task: Task,
        *,
        tolerances: Mapping[str, float],
        pool: str = "nominal",
        wear: bool = False,
        sensor_error: float = SENSOR_ERROR,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in METADATA["render_modes"]:
            raise ParameterError(f"render_mode = {render_mode!r} is not one of None, human, rgb_array")
        self.render_mode = render_mode
        self.nominal, self.drive, self.task, self.tolerances = machine, drive, task, dict(tolerances)
        for speed in (drive.highest_speed, drive.lowest_speed):
            at_speed(machine, speed)
        self.pool = Pool(machine, drive, self.tolerances, pool, wear)
        self.observation_names = observation_names(task.cycles_per_step, wear)
        space = observation_space(
            drive.lowest_speed, drive.highest_speed, FORCE_RANGE * task.force_limit, task.cycles_per_step, wear
        )
        self.observation_space = cast(Space[Observation], space)
        self.action_space = cast(Space[Action], Box(-1.0, 1.0, (1,), np.float32))
        self.rules = Rules(
            machine,
            drive,
            task,
            space,
            self.pool,
            sensor_error=checked_number("sensor_error", sensor_error, 0.0, FORCE_RANGE * task.force_limit),
        )
        self._batch = SerialBatch(1)
        self._job = Jobs(self.rules, self._batch)
        self._runs = False
        self._dashboard: Dashboard | None = None

    @property
    def speed(self) -> float:
        """Speed of the machine, in the unit of its speed field."""
        return float(self._job.speed[0])

    @property
    def machine(self) -> Machine:
        """Machine of the current job, at its current speed."""
        return self._job.machine_at(0)

    @property
    def machine_number(self) -> int:
        """Number of the machine of the current job in the pool."""
        return int(self._job.chosen[0])

    @property
    def regimes(self) -> RegimeTable:
        """Regimes of the machine of the current job, with its present clearance."""
        return self._job.regimes_at(0)

    @property
    def nominal_regimes(self) -> RegimeTable:
        """Regimes of the nominal machine, with as much wear."""
        return self._job.nominal_regimes_at(0)

    @property
    def damage(self) -> float:
        """Share of its life that the worse surface of the joint has used up."""
        return float(self._job.damage.max())

    def _last_step(self) -> CycleRecord:
        record = self._batch.records[0]
        assert record is not None
        return record.after(len(record) - self.task.cycles_per_step)

    def _shown(self) -> CycleRecord:
        """Last step with a time history, each cycle run once more from its start: showing it changes no bit of it."""
        record = self._last_step()
        runs = [simulate(record.machine, 1, state, samples_per_cycle=RENDER_SAMPLES) for state in record.section]
        return replace(record, history=np.concatenate([run.history for run in runs if run.history is not None]))

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a job, with the machine run in from rest at the starting speed.

        Parameters
        ----------
        seed
            Seed of the machine's number in the pool and of the sensor.
        options
            ``{"speed": ...}`` starts at that speed instead of the lowest one; ``{"machine": k}`` takes machine k of the
            pool.

        Raises
        ------
        ParameterError
            If an option is unknown, the starting speed lies outside the range of the drive or the machine is not in
            the pool.
        SimulationError
            If the machine can't be simulated at its starting speed.
        """
        super().reset(seed=seed)
        start = start_of(self.pool, options or {})
        self._runs = False
        observation, info = self._job.start(THE_ONE, start.speed, [self.np_random], start.machine)
        self._runs = True
        if self.render_mode is not None:
            self._show().start()
            if self.render_mode == "human":
                self.render()
        return observation[0], _first(info)

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Run one step; a simulation that fails ends the job instead of raising.

        Raises
        ------
        ParameterError
            If the action is not one finite number.
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of a job.
        """
        if not self._runs:
            raise gym.error.ResetNeeded("no job is running; call reset() first")
        if np.shape(action) != (1,):
            raise ParameterError(f"action = {action!r} is not usable; allowed: one number from -1 to 1, shape (1,)")
        outcome = self._job.step(THE_ONE, np.asarray(action)[None], [self.np_random])
        info = _first(outcome.info)
        self._runs = info["status"] == Status.RUNNING
        if self.render_mode is not None:
            self._show().add(self._last_step(), info["cost_type_iii"] > 0.0)
            if self.render_mode == "human":
                self.render()
        return outcome.observation[0], float(outcome.reward[0]), not self._runs, False, info

    def _show(self) -> "Dashboard":
        if self._dashboard is None:
            from chaosgym.envs.rendering import Dashboard

            self._dashboard = Dashboard(self.nominal, self.drive, self.task, window=self.render_mode == "human")
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
