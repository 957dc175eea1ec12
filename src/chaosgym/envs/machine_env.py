"""How does an agent run a machine through a job? The one environment, for every machine and task.

A step is a whole number of operating cycles at constant speed, so the phase of the force is zero wherever the speed
changes and the motion goes on from the state in which the last step ended.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, cast

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box, Space
from numpy.typing import NDArray

from chaosgym.envs.drive import SpeedDrive, checked_number
from chaosgym.envs.observation import Observation, measured_peaks, observation_names, observation_space, observe
from chaosgym.envs.tasks import LONGEST_PERIOD, Status, Step, Task, does_not_repeat, judged_cycles
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import CycleRecord, MotionState, simulate

if TYPE_CHECKING:
    from chaosgym.envs.rendering import Dashboard

Action = NDArray[np.float32]

RUN_IN_CYCLES = 20
"""Cycles at the starting speed before the job begins; at least a step."""

SENSOR_ERROR = 3.0
"""Half width [N] of the error of a force sensor (thesis 3.5.2)."""

FORCE_RANGE = 5.0
"""Range of the force sensors in units of the force limit."""

WIDEST_TOLERANCE = 4.0
"""Largest factor on the manufacturing tolerances."""

RENDER_SAMPLES = 1000
"""Samples of the motion kept in each cycle for rendering."""

KEPT_MACHINES = 256
"""Machines at one speed that are kept: checking all fields of a new one takes longer than a look-up."""

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


@lru_cache(maxsize=KEPT_MACHINES)
def _at_speed(machine: Machine, speed: float) -> Machine:
    return with_settings(machine, {machine.speed_field: speed})


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
    tolerance
        False for the nominal machine; True for a machine drawn uniformly within the tolerances at each reset; a number
        multiplies their width.
    sensor_error
        Half width [N] of the uniform error of each measured peak force.
    is_type_iii
        Tells whether a step counts as Type III; anything from the measured peaks to a table of regimes by speed.
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
        tolerance: bool | float = False,
        sensor_error: float = SENSOR_ERROR,
        is_type_iii: Callable[[Step], bool] = does_not_repeat,
        render_mode: str | None = None,
    ) -> None:
        if render_mode is not None and render_mode not in METADATA["render_modes"]:
            raise ParameterError(f"render_mode = {render_mode!r} is not one of None, human, rgb_array")
        self.render_mode = render_mode
        self.nominal, self.drive, self.task = machine, drive, task
        self.tolerances, self._is_type_iii = dict(tolerances), is_type_iii
        self._tolerance = checked_number("tolerance", tolerance, 0.0, WIDEST_TOLERANCE)
        self._sensor_error = checked_number("sensor_error", sensor_error, 0.0, FORCE_RANGE * task.force_limit)
        self.observation_names = observation_names(task.cycles_per_step)
        self._space = observation_space(
            drive.lowest_speed, drive.highest_speed, FORCE_RANGE * task.force_limit, task.cycles_per_step
        )
        self.observation_space = cast(Space[Observation], self._space)
        self.action_space = cast(Space[Action], Box(-1.0, 1.0, (1,), np.float32))
        self.machine = _at_speed(machine, drive.lowest_speed)
        self._job_time = task.job_cycles * _at_speed(machine, drive.highest_speed).cycle_period
        self._damage = np.zeros(len(machine.sides))
        self._motion: MotionState | None = None
        self._dashboard: Dashboard | None = None

    @property
    def speed(self) -> float:
        """Speed of the machine, in the unit of its speed field."""
        return float(getattr(self.machine, self.machine.speed_field))

    @property
    def damage(self) -> float:
        """Share of its life that the worse surface of the joint has used up."""
        return float(self._damage.max())

    def _draw_machine(self) -> Machine:
        if self._tolerance == 0.0:
            return self.nominal
        factors = 1.0 + self._tolerance * self.np_random.uniform(-1.0, 1.0, len(self.tolerances)) * np.array(
            list(self.tolerances.values())
        )
        drawn = {
            name: getattr(self.nominal, name) * float(factor)
            for name, factor in zip(self.tolerances, factors, strict=True)
        }
        return with_settings(self.nominal, drawn)

    def _run(self, cycles: int) -> CycleRecord:
        record = simulate(self.machine, cycles, self._motion)
        self._motion = record.final_state
        return record

    def _shown(self) -> CycleRecord:
        """Last step with a time history, each cycle run once more from its start: showing it changes no bit of it."""
        machine = self._record.machine
        runs = [simulate(machine, 1, state, samples_per_cycle=RENDER_SAMPLES) for state in self._record.section]
        return replace(self._record, history=np.concatenate([run.history for run in runs if run.history is not None]))

    def _observe(self) -> Observation:
        measured = measured_peaks(self._record, self._sensor_error, self.np_random)
        remaining = 1.0 - self._cycles_done / self.task.job_cycles
        return observe(self._space, self.speed, self._action, remaining, measured, self._record)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """Start a job, with the machine run in from rest at the starting speed.

        Parameters
        ----------
        seed
            Seed of the machine drawn within tolerances and of the sensor.
        options
            ``{"speed": ...}`` starts at that speed instead of the lowest one.

        Raises
        ------
        ParameterError
            If an option is unknown or the starting speed lies outside the range of the drive.
        SimulationError
            If the machine can't be simulated at its starting speed.
        """
        super().reset(seed=seed)
        speed = self._starting_speed(options or {})
        self._drawn = self._draw_machine()
        self.machine = _at_speed(self._drawn, speed)
        self._motion = None
        self._action = self.drive.action_for(speed)
        self._cycles_done = 0
        self._damage = np.zeros(len(self.machine.sides))
        run_in = self._run(max(RUN_IN_CYCLES, self.task.cycles_per_step))
        self._recent_peaks = run_in.peak_force[:, 0]
        self._record = run_in.after(len(run_in) - self.task.cycles_per_step)
        if self.render_mode is not None:
            self._show().start(self._shown())
            if self.render_mode == "human":
                self.render()
        return self._observe(), {"speed": speed, "damage": 0.0, "status": int(Status.RUNNING)}

    def _starting_speed(self, options: dict[str, Any]) -> float:
        for name in options:
            if name != "speed":
                raise ParameterError(f"options has no entry {name!r}; allowed: speed")
        low, high = self.drive.lowest_speed, self.drive.highest_speed
        return self.drive.rounded(checked_number("options['speed']", options.get("speed", low), low, high))

    def step(self, action: Action) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Run one step; a simulation that fails ends the job instead of raising.

        Raises
        ------
        ParameterError
            If the action is not one finite number.
        gymnasium.error.ResetNeeded
            Before the first reset and after the end of a job.
        """
        if self._motion is None:
            raise gym.error.ResetNeeded("no job is running; call reset() first")
        self._action, target = self.drive.target_of(action)
        speed = self.drive.approach(self.speed, target)
        if speed != self.speed:
            self.machine = _at_speed(self._drawn, speed)
        cycles = self.task.cycles_per_step
        damage_before = self.damage
        try:
            self._record = self._run(cycles)
        except SimulationError:
            status = Status.SIMULATION_FAILED
            peak_force = np.empty((0, len(self._damage)))
        else:
            peak_force = self._record.peak_force
            self._damage = self._damage + self.task.damage(peak_force)
            self._cycles_done += cycles
            kept = judged_cycles(cycles) + LONGEST_PERIOD
            self._recent_peaks = np.concatenate([self._recent_peaks, peak_force[:, 0]])[-kept:]
            status = self._status()
        step = Step(speed, cycles * self.machine.cycle_period, peak_force, self._recent_peaks)
        type_iii = status != Status.SIMULATION_FAILED and self._is_type_iii(step)
        reward, named = self.task.judge(
            step, status, type_iii=type_iii, damage_increase=self.damage - damage_before, job_time=self._job_time
        )
        info = named | {
            "speed": speed,
            "damage": self.damage,
            "status": int(status),
            "is_success": status == Status.JOB_DONE,
        }
        observation = self._observe()
        if status != Status.RUNNING:
            self._motion = None
        if self.render_mode is not None:
            self._show().add(self._shown(), type_iii)
            if self.render_mode == "human":
                self.render()
        return observation, reward, status != Status.RUNNING, False, info

    def _status(self) -> Status:
        if self.damage >= 1.0:
            return Status.FRACTURE
        return Status.JOB_DONE if self._cycles_done >= self.task.job_cycles else Status.RUNNING

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
        return self._dashboard.draw()

    def close(self) -> None:
        """Close the window, if there is one."""
        if self._dashboard is not None:
            self._dashboard.close()
            self._dashboard = None
