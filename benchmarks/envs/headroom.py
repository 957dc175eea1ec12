"""What can a schedule win on a task, and what would one have to know? Mean cost of a step by maps of machines.

The same machines are scheduled by four kinds of knowledge: following the demand; the mean map of all other machines;
the clearance, by the maps of machines whose clearance is near; the machine's own map. The share of the gap between the
first two and the last that the clearance closes tells whether a machine can be learned from what is felt: the mean peak
force tells the clearance.
"""

from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.utils.seeding import np_random

from chaosgym.arrays import Array
from chaosgym.control.maps import FLEET_SEED, Maps, maps_of

WIDTHS = (0.005, 0.01, 0.02, 0.03, 0.05)
"""Widths of the kernel over clearances, as shares of their mean; the best one counts."""


def headroom(env: str, machines: int = 40, keywords: Mapping[str, Any] | None = None) -> dict[str, float]:
    """Costs of a step by what is known, the share of the gap that the clearance closes, and how the peak tells it."""
    given = dict(keywords or {})
    known: Any = gym.make_vec(env, num_envs=1, **given).unwrapped
    seeds = [FLEET_SEED + k for k in range(machines)]
    drawn = [known.settings.variants.drawn(np_random(seed)[0]) for seed in seeds]
    gaps = np.array([getattr(machine, machine.clearance_field) for machine in drawn])
    maps = maps_of(env, seeds=seeds, progress="maps", **given)
    return costs(known.task, maps, gaps)


def costs(task: Any, maps: Maps, gaps: Array) -> dict[str, float]:
    """As ``headroom``, of maps (n, s) of machines with clearances ``gaps`` (n,) [m]."""
    demands = np.arange(task.lowest_demand, task.highest_demand + 1e-9, task.trim_step)
    distance = np.abs(maps.speeds - demands[:, None])
    far = np.where(distance > task.largest_trim + 1e-9, np.inf, task.deviation_weight * distance)
    weight = task.type_iii_weight
    share, every = maps.share, np.arange(len(demands))

    def paid(believed: Array) -> float:
        """Mean cost if each machine is scheduled by what is believed of it, (n, s)."""
        chosen = [(far + weight * row).argmin(axis=1) for row in believed]
        return float(np.mean([far[every, at] + weight * own[at] for own, at in zip(share, chosen, strict=True)]))

    following = float(weight * share[:, maps.nearest(demands)].mean())
    fleet = paid((share.sum(axis=0) - share) / (len(share) - 1))
    by_clearance = min(paid(_of_neighbours(share, gaps, width)) for width in WIDTHS)
    own = paid(maps.smoothed().share)
    blind = min(following, fleet)
    told = [abs(np.corrcoef(gaps, peaks)[0, 1]) for peaks in maps.mean_peak.T]
    return {
        "follow": following,
        "mean map of the others": fleet,
        "clearance known": by_clearance,
        "own map": own,
        "gap closed by the clearance": (blind - by_clearance) / (blind - own),
        "correlation of mean peak and clearance": float(np.median(told)),
    }


def _of_neighbours(share: Array, gaps: Array, width: float) -> Array:
    """Maps of the others, averaged with weights that fall with the distance in clearance."""
    near = np.exp(-0.5 * ((gaps[:, None] - gaps) / (width * gaps.mean())) ** 2) + 1e-9
    np.fill_diagonal(near, 0.0)
    return np.asarray(near / near.sum(axis=1, keepdims=True) @ share)
