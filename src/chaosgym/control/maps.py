"""Maps of a machine over speed: share of irregular cycles and mean peak of the running motion.

The machine sweeps upwards through the speeds of its task, disturbed as in a job, and is judged as in a job once it has
settled. Such maps are for planners, of models or of the machine itself, and for references; no agent is given one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.task import Task
from chaosgym.envs.vector_env import native_envs
from chaosgym.machines.parameters import parameters_of
from chaosgym.rating_life import damage_in_a_million

SETTLING_CYCLES, JUDGED_CYCLES = 30, 40
"""Cycles at a speed before the motion is judged, and while it is."""

FLEET = 160
"""Simulated machines that a controller may know."""

FLEET_SEED = 77_000_000
"""First seed of their draws."""

SMOOTHING = np.array([0.15, 0.7, 0.15])
"""Weights of a speed and its neighbours: a plan must not rest on a single speed."""


@dataclass(frozen=True)
class Maps:
    """Maps of n machines: ``speeds`` (s,); ``share`` of irregular cycles and ``mean_peak`` [N], (n, s)."""

    speeds: Array
    share: Array
    mean_peak: Array

    def smoothed(self) -> "Maps":
        """The same, each speed averaged with its neighbours."""
        return Maps(self.speeds, _smoothed(self.share), _smoothed(self.mean_peak))

    def damage(self, task: Task) -> Array:
        """Damage of the joint in a step of a task at each speed, (n, s), by the mean peaks."""
        return damage_in_a_million(self.mean_peak, task.reference_force) * (task.reference_damage / task.steps)

    def nearest(self, speeds: Array) -> NDArray[np.int64]:
        """Places of the nearest speeds of the maps."""
        spacing = self.speeds[1] - self.speeds[0]
        place = np.rint((speeds - self.speeds[0]) / spacing).clip(0, len(self.speeds) - 1)
        return np.asarray(place, np.int64)


def _smoothed(values: Array) -> Array:
    wide, places = np.pad(values, ((0, 0), (1, 1)), mode="edge"), values.shape[1]
    return np.asarray(sum(weight * wide[:, k : k + places] for k, weight in enumerate(SMOOTHING)))


def maps_of(
    env: str,
    *,
    machines: Sequence[int] | None = None,
    seeds: Sequence[int] | None = None,
    progress: str | None = None,
    **keywords: Any,
) -> Maps:
    """Maps of machines kept for evaluation, or of those that seeds draw; ``keywords`` of the environment."""
    count = len(machines if machines is not None else seeds or ())
    task = native_envs(env, **keywords).task
    grid, cycles = task.grid, task.cycles_per_step
    settling, judged = -(-SETTLING_CYCLES // cycles), -(-JUDGED_CYCLES // cycles)
    span = task.highest_speed - task.lowest_speed
    steps = len(grid) * (settling + judged)
    # without damage, since a joint that fractured would give its place to another machine
    sweep = {"action": "speed", "steps": steps, "slew_limit": span, "wear": 0.0, "reference_damage": 0.0}
    envs = native_envs(env, count, **(keywords | sweep))
    options = {"speed": float(grid[0])} | ({} if machines is None else {"machine": np.asarray(machines)})
    envs.reset(seed=list(seeds if seeds is not None else range(count)), options=options)
    share, peak = np.zeros((count, len(grid))), np.zeros((count, len(grid)))
    for k, speed in enumerate(tqdm(grid, desc=progress, unit="speed", disable=progress is None, leave=False)):
        actions = np.full((count, 1), speed, np.float32)
        for step in range(settling + judged):
            observations, *_, info = envs.step(actions)
            if step >= settling:
                share[:, k] += info["type_iii"] / judged
                peak[:, k] += observations[:, PLACE.mean_peak_force] / judged
    return Maps(grid, share, peak)


def model_keywords(env: str, **keywords: Any) -> dict[str, Any]:
    """Keywords that make the environment's machine the model that controllers may use."""
    known = native_envs(env, **keywords)
    model, nominal = known.model, known.nominal
    if model == nominal:
        return keywords
    fields = [name for name in parameters_of(model) if getattr(model, name) != getattr(nominal, name)]
    fields += [name for rung in model.fidelity_ladder.values() for name in rung]
    others = {name: value for name, value in keywords.items() if name != "fidelity"}
    return others | {name: getattr(model, name) for name in fields}


def fleet_maps(env: str, *, count: int = FLEET, progress: str | None = None, **keywords: Any) -> Maps:
    """Maps of simulated machines within the tolerances of the environment, by the model that controllers may use."""
    seeds = [FLEET_SEED + k for k in range(count)]
    return maps_of(env, seeds=seeds, progress=progress, **model_keywords(env, **keywords))
