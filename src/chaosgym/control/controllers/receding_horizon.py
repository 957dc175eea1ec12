"""What does simulating ahead bring? A search over targets, from where the machine is now, again and again.

Beside the environment runs a copy of the machine, the true one or the nominal one, driven at the same speeds. Every few
steps as many further copies as there are targets in reach go on from it, each towards one target, in one compiled call.
What they wear is simulated; what comes after the horizon is worth what dynamic programming on the table says.
"""

from typing import Any, ClassVar

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from chaosgym.control.controllers.controller import Action, Controller, Knowledge, Observation
from chaosgym.control.forecast import Model, forecast_for, worth_of_steps
from chaosgym.envs.jobs import RUN_IN_CYCLES
from chaosgym.envs.pools import worn
from chaosgym.simulation.batch import at_speed, batch_of

Array = NDArray[np.float64]

COPY = np.zeros(1, np.int64)
"""Place of the copy in the batch; the others are for what may happen."""


class RecedingHorizon(Controller):
    """Searches with the nominal machine.

    Parameters
    ----------
    env
        Environment of one machine.
    horizon
        Steps that are simulated ahead.
    every
        Steps after which it searches again.
    """

    knows: ClassVar[Knowledge] = "nominal"
    model: ClassVar[Model] = "nominal"

    def __init__(self, env: gym.Env[Any, Any], *, horizon: int = 5, every: int = 5) -> None:
        super().__init__(env)
        self.horizon, self.every = horizon, every

    def reset(self) -> None:
        """Start the copy as the environment starts its machine."""
        machine = self.env.nominal if self.model == "nominal" else self.env.machine
        self._new = machine
        self._forecast = forecast_for(self.env, self.model)
        self._worth = worth_of_steps(self._forecast)
        self._speed: Any = np.array([self.env.speed])
        self._damage = np.zeros((1, len(machine.sides)))
        self._batch = batch_of(machine, 2 * self._forecast.moves * self.horizon + 2)
        for place in range(len(self._batch)):
            self._batch.start(place, at_speed(machine, float(self._speed[0])))
        self._batch.run(COPY, max(RUN_IN_CYCLES, self.task.cycles_per_step))
        self._action: Action | None = None

    def __call__(self, observation: Observation) -> Action:
        """Follow the step that the environment ran; search if it is time to."""
        if self._action is not None:
            self._wear(COPY)
            self._speed, damage, _ = self._run(COPY, self._speed, self.drive.target_of(self._action[None])[1])
            self._damage = self._damage + damage
        step = self.step_of(observation)
        if self._action is None or step % self.every == 0:
            self._action = self.command(self._best_target(step))
        return self._action

    def _wear(self, which: NDArray[np.int64]) -> None:
        """Let clearances be what the damage of the copy makes them, where they grow; not so within the horizon."""
        if self.env.pool.wears:
            machine = at_speed(worn(self._new, 1.0 + float(self._damage.max())), float(self._speed[0]))
            for place in which.tolist():
                self._batch.change(place, machine)

    def _run(self, which: NDArray[np.int64], speed: Array, target: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Run some places (k,) for a step: speeds (k,), what each side wore (k, sides), whose simulation failed."""
        speed = self.drive.approach(speed, target)
        self._batch.set_speeds(which, speed)
        cycles = self._batch.run(which, self.task.cycles_per_step)
        return speed, self.task.damage(cycles.peak_force), cycles.failed

    def _best_target(self, step: int) -> float:
        """Return the speed that promises most for the rest of the job."""
        forecast, ahead = self._forecast, min(self.horizon, self._forecast.steps - step)
        at, reach = int(forecast.place_of(self._speed[0])), forecast.moves * self.horizon
        targets = forecast.speeds[max(0, at - reach) : at + reach + 1]
        which = np.arange(1, len(targets) + 1)
        self._wear(which)
        self._batch.branch(0, which)
        speed, damage = np.repeat(self._speed, len(which)), np.repeat(self._damage, len(which), axis=0)
        worth, failed = np.zeros(len(which)), np.zeros(len(which), np.bool_)
        for _ in range(ahead):
            worst = damage.max(axis=1)
            speed, added, failing = self._run(which, speed, targets)
            damage, failed = damage + added, failed | failing
            place = forecast.place_of(speed)
            worth += forecast.time[place] + forecast.type_iii[forecast.level_of(worst), place]
            worth -= forecast.damage_weight * (damage.max(axis=1) - worst)
        if step + ahead < forecast.steps:
            rest = forecast.best_within_reach(self._worth[step + ahead])
            worth += forecast.worth_after(rest, damage.max(axis=1), place)
        return float(targets[np.where(failed, -np.inf, worth).argmax()])


class ClairvoyantHorizon(RecedingHorizon):
    """Searches with this very machine: its copy moves as it does, bit for bit."""

    knows = "machine"
    model = "machine"
