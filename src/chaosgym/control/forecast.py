"""What will a job cost, by the table of the machine's regimes alone?

A step at a speed of the table takes its time, wears the joint as the equivalent force there says, and costs the weight
of Type III where the table says so. What a change of speed stirs up is left out; the reward in the environment is the
judge, and this is how a planner guesses it.
"""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from chaosgym.envs.pools import Pool
from chaosgym.envs.regimes import RegimeTable, nearest
from chaosgym.envs.tasks import Task

Array = NDArray[np.float64]
Places = NDArray[np.int64]

Model = Literal["nominal", "machine"]
"""Machine that a planner takes for the true one: the nominal one, or this very machine."""

DAMAGE_LEVELS = 41
"""Grid of the damage, from none to fracture; values in between are interpolated."""


class Forecast(NamedTuple):
    """What steps at each of n speeds of a table bring, by L levels of damage.

    ``time`` (n,) and ``type_iii`` (L, n) are rewards; ``wear`` (L, n) is the damage that a step adds, ``damage`` (L,)
    the levels, ``moves`` the places of the table by which the speed may change in a step, ``steps`` those of the whole
    job, ``fracture`` the reward of one.
    """

    speeds: Array
    damage: Array
    time: Array
    type_iii: Array
    wear: Array
    damage_weight: float
    moves: int
    steps: int
    fracture: float

    def reward(self) -> Array:
        """Return the reward of a step (L, n), without that of a fracture."""
        return np.asarray(self.time + self.type_iii - self.damage_weight * self.wear)

    def place_of(self, speed: Any) -> Places:
        """Return the places of the nearest speeds of the table, (...)."""
        return nearest(self.speeds, speed)

    def level_of(self, damage: Any) -> Places:
        """Return the nearest level of a damage (...)."""
        return nearest(self.damage, damage)

    def within_reach(self, place: int) -> Places:
        """Return the places that one step reaches from a place."""
        return np.arange(max(0, place - self.moves), min(len(self.speeds), place + self.moves + 1))

    def best_within_reach(self, worth: Array) -> Array:
        """Return the largest worth (L, n) that one step reaches from each place."""
        return np.asarray(maximum_filter1d(worth, 2 * self.moves + 1, axis=1, mode="nearest"))

    def worth_after(self, ahead: Array, damage: Array, places: Places) -> Array:
        """Return the worth (...) of being at places (...) with a damage (...), interpolated in ``ahead`` (L, n)."""
        level = np.clip(damage, 0.0, 1.0) * (len(self.damage) - 1)
        low = np.minimum(level.astype(np.int64), len(self.damage) - 2)
        share = level - low
        between = (1.0 - share) * ahead[low, places] + share * ahead[low + 1, places]
        return np.where(damage >= 1.0, self.fracture, between)


def forecast_of(pool: Pool, tables: Sequence[RegimeTable], task: Task) -> Forecast:
    """Return what a task costs by tables for each clearance of a pool; no step wears more than a life."""
    drive, period_at = pool.drive, pool.nominal.period_at
    damage = np.linspace(0.0, 1.0, DAMAGE_LEVELS)
    at_level = [tables[place] for place in nearest(pool.levels, 1.0 + damage).tolist()]
    job_time = task.job_cycles * period_at(drive.highest_speed)
    type_iii = np.array([table.type_iii for table in at_level])
    forces = np.array([np.tile(table.equivalent_force, (task.cycles_per_step, 1)) for table in at_level])
    spacing = pool.speeds[1] - pool.speeds[0]
    return Forecast(
        speeds=pool.speeds,
        damage=damage,
        time=-task.time_weight * task.cycles_per_step * period_at(pool.speeds) / job_time,
        type_iii=-task.type_iii_step * type_iii,
        wear=np.minimum(task.damage(forces), 1.0),
        damage_weight=task.damage_weight,
        moves=max(1, int(drive.slew_limit / spacing * (1.0 + 1e-12))),
        steps=task.steps,
        fracture=-task.failure_weight,
    )


def forecast_for(env: Any, model: Model) -> Forecast:
    """Return the forecast of the environment's present machine, or of its nominal one."""
    pool = env.pool
    tables = pool.nominal_regimes if model == "nominal" else pool.regimes(env.machine_number)
    return forecast_of(pool, tables, env.task)


def training_forecasts(env: Any) -> list[Forecast]:
    """Return the forecasts of all machines of the training pool."""
    pool = env.pool.sister("training")
    return [forecast_of(pool, pool.regimes(k), env.task) for k in range(len(pool))]


def worth_of_steps(forecast: Forecast) -> Array:
    """Solve the job by dynamic programming, from its end.

    Returns
    -------
    (steps, L, n)
        Reward of step t at a place of the table, and of the best steps after it, by the damage before it.
    """
    reward = forecast.reward()
    worth = np.empty((forecast.steps, *reward.shape))
    ahead = np.zeros(reward.shape)
    after = forecast.damage[:, None] + forecast.wear
    places = np.broadcast_to(np.arange(len(forecast.speeds)), after.shape)
    for step in reversed(range(forecast.steps)):
        worth[step] = reward + forecast.worth_after(ahead, after, places)
        ahead = forecast.best_within_reach(worth[step])
    return worth


def constant_returns(forecast: Forecast, start: int) -> Array:
    """Return of a whole job (n,) that goes from place ``start`` straight to each place and stays there."""
    reward, places = forecast.reward(), np.arange(len(forecast.speeds))
    damage, returns, runs = np.zeros(len(places)), np.zeros(len(places)), np.ones(len(places), np.bool_)
    at = np.full(len(places), start)
    for _ in range(forecast.steps):
        at = at + np.clip(places - at, -forecast.moves, forecast.moves)
        level = forecast.level_of(damage)
        damage = damage + np.where(runs, forecast.wear[level, at], 0.0)
        breaks = runs & (damage >= 1.0)
        returns += np.where(runs, reward[level, at], 0.0) + np.where(breaks, forecast.fracture, 0.0)
        runs &= ~breaks
    return returns
