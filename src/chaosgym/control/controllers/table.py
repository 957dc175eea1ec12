r"""A table of training machines: share of irregular steps and mean measurements at each speed and clearance.

The clearance of the machine at work is inferred from the measurements, by Bayes' rule over classes of clearance, with
independent normal errors of five readings at each speed. Where the clearance is all that differs between machines this
is what a learned agent is compared with; other differences between machines are not modelled.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from chaosgym.arrays import Array
from chaosgym.control.controllers.controller import Controller, Observations, place_of, seen
from chaosgym.envs.task import Task
from chaosgym.envs.vector_env import native_envs
from chaosgym.rating_life import damage_in_a_million

CLASSES = 25
"""Classes of clearance, from the smallest to the largest that was met (assumed)."""

JOBS, AT_ONCE, MOVES, FIRST_SEED = 1024, 128, 0.15, 88_000_000
"""Jobs on training machines, how many at once, part of the steps that go to another speed, and first seed (assumed)."""

READINGS = ("mean_peak_force", "std_peak_force", "repeat_1", "impacts_per_cycle", "bouncing_share")
FLOORS = np.array([0.03, 0.15, 0.15, 0.15, 0.01])
"""What the clearance is inferred from, and least deviations of it (assumed); the first three as logarithms [log N]."""

SMOOTHING = (0.5, 1.0)
"""Deviations of the kernel that smooths over places of speed and classes (assumed)."""

TEMPER = 0.3
"""Share of the evidence of a settled step that counts, since steps are alike (assumed)."""

STAYING = 0.02
"""Cost by which another speed must be better than the present one, as a share of an irregular step (assumed)."""


class LearnedTables(NamedTuple):
    """By speed and class (s, c): ``share`` irregular, ``mean_peak`` [N], and of the readings (s, c, 5) the rest."""

    share: Array
    mean_peak: Array
    mean: Array
    deviation: Array


def readings_of(observations: NDArray[Any]) -> Array:
    """Readings (n, 5) of observations (n, entries) from which the clearance is inferred."""
    felt = np.column_stack([seen(observations, name) for name in READINGS])
    return np.column_stack([np.log(felt[:, :3] + (1.0, 0.3, 0.3)), felt[:, 3:]])


def learned_tables(env: str, *, jobs: int = JOBS, progress: str | None = None, **keywords: Any) -> LearnedTables:
    """Play machines of an environment at random speeds of its grid, and count; ``keywords`` of the environment."""
    rows = []
    envs = native_envs(env, min(jobs, AT_ONCE), **(keywords | {"action": "speed"}))
    for first in trange(0, jobs, envs.num_envs, desc=progress, unit="batch", disable=progress is None, leave=False):
        rows.append(_played(envs, FIRST_SEED + first))
    speed, clearance, irregular, felt, peak = (np.concatenate(parts) for parts in zip(*rows, strict=True))
    low, high = clearance.min(), clearance.max()
    kind = (CLASSES * (clearance - low) / max(high - low, 1e-12)).astype(int).clip(0, CLASSES - 1)
    return _counted(envs.task, place_of(speed, envs.task), kind, irregular, felt, peak)


def _played(envs: Any, seed: int) -> tuple[Array, ...]:
    """Speed, clearance, share irregular, readings and mean peak of the steps of jobs that held their speed."""
    task, count, generator = envs.task, envs.num_envs, np.random.default_rng(seed)
    observations, _ = envs.reset(seed=seed)
    target, kept = generator.choice(task.grid, count), []
    for _ in range(task.steps - 1):
        target = np.where(generator.random(count) < MOVES, generator.choice(task.grid, count), target)
        before = seen(observations, "speed")
        observations, _, ended, _, info = envs.step(target[:, None].astype(np.float32))
        held = (np.abs(seen(observations, "speed") - before) < 0.3 * task.trim_step) & ~ended
        at = observations[held]
        values = (seen(at, "speed"), info["clearance"][held], info["type_iii"][held], readings_of(at))
        kept.append((*values, seen(at, "mean_peak_force")))
    return tuple(np.concatenate(parts) for parts in zip(*kept, strict=True))


def _counted(task: Task, place: Any, kind: Any, irregular: Array, felt: Array, peak: Array) -> LearnedTables:
    from scipy.ndimage import gaussian_filter

    def total(values: Array) -> Array:
        sums = np.zeros((len(task.grid), CLASSES))
        np.add.at(sums, (place, kind), values)
        return np.asarray(gaussian_filter(sums, SMOOTHING))

    count = total(np.ones(len(place)))
    known = np.maximum(count, 1e-9)
    mean = np.stack([total(column) / known for column in felt.T], axis=-1)
    squares = np.stack([total(column**2) / known for column in felt.T], axis=-1)
    deviation = np.sqrt(np.maximum(squares - mean**2, 0.0)) + FLOORS
    return LearnedTables((total(irregular) + 0.02) / (count + 0.1), total(peak) / known, mean, deviation)


class Table(Controller):
    """Goes to the speed of least expected cost within reach, by tables of training machines.

    Parameters
    ----------
    tables
        Of ``learned_tables``.
    """

    knows = "tolerances"

    def __init__(self, tables: LearnedTables) -> None:
        super().__init__()
        self.tables = tables

    def begin(self, envs: Any) -> None:
        """Start from a uniform prior over the classes of clearance."""
        self._fit, self._last = np.zeros((self.count, CLASSES)), np.full(self.count, np.nan)

    def speeds(self, observations: Observations) -> Array:
        """The speed of least expected cost."""
        task, grid = self.task, self.task.grid
        speed, demand = seen(observations, "speed"), seen(observations, "demand")
        place = place_of(speed, task)
        deviation = self.tables.deviation[place]
        miss = (readings_of(observations)[:, None] - self.tables.mean[place]) / deviation
        settled = np.abs(speed - self._last) < 0.3 * task.trim_step
        weight = TEMPER * np.where(settled, 1.0, 0.1)[:, None]
        self._fit += weight * (np.maximum(-0.5 * miss**2, -4.5) - np.log(deviation)).sum(axis=-1)
        self._last = speed
        chance = np.exp(self._fit - self._fit.max(axis=1, keepdims=True))
        chance /= chance.sum(axis=1, keepdims=True)
        lost = (
            damage_in_a_million(chance @ self.tables.mean_peak.T, task.reference_force)
            * task.reference_damage
            / task.steps
        )
        cost = self.cost(chance @ self.tables.share.T, lost, demand, grid)
        cost[np.arange(self.count), place] -= STAYING * task.type_iii_weight
        cost[np.abs(grid - demand[:, None]) > task.largest_trim + 0.5 * task.trim_step] = np.inf
        return np.asarray(grid[cost.argmin(axis=1)])
