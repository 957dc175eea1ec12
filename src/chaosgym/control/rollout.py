"""Rollout of a policy: many machines side by side, one job each, step by step as arrays.

    played = play(policy, "chaosgym/ImpactBeamTolerance-v1", machines=range(64))

Everybody who plays machine k meets the same machine, demand and disturbance. This is the one rollout of evaluation,
comparison, demo and pictures.
"""

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from chaosgym.arrays import Array
from chaosgym.envs.observation import FELT
from chaosgym.envs.pool import SHARE
from chaosgym.envs.task import Status
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ParameterError
from chaosgym.rating_life import damage_in_a_million


class Policy(Protocol):
    """What sets the speeds of machines side by side: a controller or a trained policy.

    ``keywords`` of the environment that it plays in, such as the kind of its actions; ``knows`` what it looks at.
    """

    knows: str

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of the environment."""
        ...

    def start(self, envs: Any) -> None:
        """Begin the jobs of a native vector environment that has been reset."""
        ...

    def __call__(self, observations: Any) -> Any:
        """Return the actions of all jobs for their observations (n, entries)."""
        ...


@dataclass(frozen=True)
class Played:
    """Jobs of n machines; arrays of steps end in NaN where a job ended early.

    Attributes
    ----------
    env, unit
        Environment, and unit of the speeds.
    machines : (n,)
        Numbers of the machines kept for evaluation; -1 for drawn ones.
    seeds : (n,)
        Of the jobs.
    speed, demand, type_iii, reward : (steps, n)
        Speeds, share of the cycles in Type III, and reward of every step.
    felt : (steps, n, 8)
        What the sensors reported, in the order of ``FELT``.
    damage, largest_force : (n,)
        Damage of the joint, see ``chaosgym.envs.task``, and largest true force [N].
    equivalent_force, hours : (n,)
        Constant peak force [N] that wears as much in each cycle, and time [h] that the job took.
    status : (n,)
        How the jobs ended.
    cycles_per_step
        Operating cycles in a step.
    """

    env: str
    unit: str
    machines: NDArray[np.int64]
    seeds: NDArray[np.int64]
    speed: Array
    demand: Array
    type_iii: Array
    reward: Array
    felt: Array
    damage: Array
    largest_force: Array
    equivalent_force: Array
    hours: Array
    status: NDArray[np.int64]
    cycles_per_step: int

    def job(self, place: int) -> "Played":
        """Return one of the jobs alone, by its place among them."""
        one, every = slice(place, place + 1), vars(self)
        last = {name: every[name][one] for name in every if np.ndim(every[name]) == 1}
        second = {name: every[name][:, one] for name in every if np.ndim(every[name]) > 1}
        return replace(self, **last, **second)

    @property
    def returns(self) -> Array:
        """Sum of the rewards of each job, (n,)."""
        return np.asarray(np.nansum(self.reward, axis=0))

    @property
    def type_iii_share(self) -> Array:
        """Share of the cycles of each job in Type III, (n,)."""
        return np.asarray(np.nanmean(self.type_iii, axis=0))

    @property
    def deviation(self) -> Array:
        """Mean distance of speed and demand in each job, (n,)."""
        return np.asarray(np.nanmean(np.abs(self.speed - self.demand), axis=0))

    @property
    def felt_unit(self) -> str:
        """Unit of the measured forces: newtons, or shares of a rated force that each machine has."""
        return "of the rated one" if self.unit == SHARE else "N"

    def life_hours(self, load_rating: float) -> Array:
        """Life [h] at the rate of each job by a load rating [N] (thesis eq. 5.2), (n,); infinite without wear."""
        cycles = np.isfinite(self.speed).sum(axis=0) * self.cycles_per_step
        worn = damage_in_a_million(self.equivalent_force, load_rating)
        with np.errstate(divide="ignore"):
            return np.asarray(1e6 / worn * self.hours / cycles)

    def column(self, name: str) -> Array:
        """One entry of ``FELT`` at every step, (steps, n)."""
        return np.asarray(self.felt[:, :, FELT.index(name)])

    def as_dict(self) -> dict[str, Any]:
        """What became of the first job, as plain numbers; measured forces in their unit."""
        peak = "mean_peak_force_share" if self.unit == SHARE else "mean_peak_force_N"
        return {
            "env": self.env,
            "machine": int(self.machines[0]),
            "seed": int(self.seeds[0]),
            "status": Status(int(self.status[0])).name.lower(),
            "return": float(self.returns[0]),
            "type_iii_share": float(self.type_iii_share[0]),
            "mean_deviation": float(self.deviation[0]),
            "damage": float(self.damage[0]),
            "largest_force_N": float(self.largest_force[0]),
            "equivalent_force_N": float(self.equivalent_force[0]),
            "hours": float(self.hours[0]),
            "unit": self.unit,
            "speed": _plain(self.speed),
            "demand": _plain(self.demand),
            "type_iii": _plain(self.type_iii),
            peak: _plain(self.column("mean_peak_force")),
        }


def _plain(values: Array) -> list[float]:
    first = values[:, 0]
    return [float(value) for value in first[np.isfinite(first)]]


def play(
    policy: Policy,
    env: str,
    machines: Sequence[int] | None = None,
    *,
    seeds: Sequence[int] | None = None,
    progress: str | None = None,
    **keywords: Any,
) -> Played:
    """Run one job on each of some machines, side by side.

    Parameters
    ----------
    policy
        What sets the speeds.
    env
        Id of the environment, or the file of a machine.
    machines
        Numbers of machines kept for evaluation; their jobs have the published seeds unless ``seeds`` is given.
    seeds
        One for each job; without ``machines``, the machines are drawn by them.
    progress
        Name of a progress bar on standard error.
    keywords
        Of the environment.

    Raises
    ------
    ParameterError
        If neither machines nor seeds are given.
    """
    if machines is None and seeds is None:
        raise ParameterError("play needs machines or seeds")
    numbers = None if machines is None else np.asarray(machines, np.int64)
    chosen = np.asarray(machines if seeds is None else seeds, np.int64)
    envs = native_envs(env, len(chosen), **(keywords | policy.keywords))
    given = chosen + (envs.settings.variants.seed if seeds is None else 0)
    options = {} if numbers is None else {"machine": numbers}
    observations, info = envs.reset(seed=given.tolist(), options=options)
    policy.start(envs)
    steps, count = envs.task.steps, len(given)
    kept = {name: np.full((steps, count), np.nan) for name in ("speed", "demand", "type_iii", "reward")}
    felt, reported = np.full((steps, count, len(FELT)), np.nan), [envs.task.places[name] for name in FELT]
    last = {name: np.zeros(count) for name in ("damage", "job_largest_force", "job_equivalent_force", "job_hours")}
    status = np.zeros(count, np.int64)
    runs = np.ones(count, np.bool_)
    for step in trange(steps, desc=progress, unit="step", disable=progress is None, leave=False):
        actions = policy(observations)
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "options .* held for the jobs")  # what begins after a job is not counted
            observations, rewards, ended, _, info = envs.step(actions)
        kept["reward"][step, runs] = rewards[runs]
        for name in ("speed", "demand", "type_iii"):
            kept[name][step, runs] = info[name][runs]
        felt[step, runs] = observations[runs][:, reported]
        status[runs] = info["status"][runs]
        for name, values in last.items():
            values[runs] = info[name][runs]
        runs &= ~ended
        if not runs.any():
            break
    return Played(
        env=env,
        unit=envs.settings.unit,
        machines=np.full(count, -1) if numbers is None else numbers,
        seeds=given,
        felt=felt,
        damage=last["damage"],
        largest_force=last["job_largest_force"],
        equivalent_force=last["job_equivalent_force"],
        hours=last["job_hours"],
        status=status,
        cycles_per_step=envs.task.cycles_per_step,
        **kept,
    )
