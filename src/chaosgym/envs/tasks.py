r"""What is a job worth? Named terms of reward and cost, each a pure function, weighted in one place.

A step of n cycles of a job of N cycles earns

    - w_time     * duration / (duration of the whole job at top speed)
    - w_damage   * increase of the damage
    - w_type_iii * n / N                     if the step counts as Type III
    - w_failure                              on fracture or a failed simulation

Damage follows the basic rating life of a bearing (``life_law``), p = 10/3 for line contact. The damage of a joint is
that of its worse surface.

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, 3.5.2 and 5.2.1.
ISO 281:2007, Rolling bearings - Dynamic load ratings and rating life.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.design.rating_life import damage_in_a_million
from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import parameter, validate

Array = NDArray[np.float64]


class Status(IntEnum):
    """Where the job stands; ``info["status"]``."""

    RUNNING = 0
    JOB_DONE = 1
    FRACTURE = 2
    SIMULATION_FAILED = 3


class Step(NamedTuple):
    """What a task is told of one step, of one machine or of many: leading axes (...) are machines.

    ``speed`` (...) in the machine's unit, ``duration`` (...) [s], ``peak_force`` (..., cycles, sides) true peak forces
    [N], zero where the simulation failed.
    """

    speed: Array
    duration: Array
    peak_force: Array


def damage_of(peak_force: Array, load_rating: float, acceleration: float) -> Array:
    """Share of its life that each surface uses up.

    Parameters
    ----------
    peak_force : (..., cycles, sides)
        True peak forces [N].
    load_rating
        Force under which a surface lasts a million cycles [N].
    acceleration
        Lives used up in this test for each one of the law.

    Returns
    -------
    (..., sides)
    """
    shares: Array = damage_in_a_million(peak_force, load_rating).sum(axis=-2)
    return shares * (acceleration * 1e-6)


@dataclass(frozen=True, kw_only=True)
class Task:
    """A job and what counts in it."""

    job_cycles: int = parameter(1000, low=1, high=1e9, provenance="assumed", source="200 steps of 5 cycles")
    """Operating cycles of the job."""
    cycles_per_step: int = parameter(5, low=1, high=1e4, provenance="assumed", source="one decision in 0.17 to 1.3 s")
    """Operating cycles in one step."""
    force_limit: float = parameter(
        80.0, unit="N", low=1e-6, high=1e9, provenance="assumed", source="just above the beam's largest peaks"
    )
    """Peak force above which a step costs."""
    load_rating: float = parameter(
        70.0,
        unit="N",
        low=1e-6,
        high=1e9,
        provenance="derived",
        source="largest equivalent force of the nominal machine at constant speed; each environment has its own",
    )
    """Force under which a surface lasts a million cycles."""
    damage_acceleration: float = parameter(
        1000.0, low=0.0, high=1e9, provenance="assumed", source="the worst constant speed uses up one life in a job"
    )
    """Lives used up for each one of the life law."""
    time_weight: float = parameter(1.0, low=0.0, high=1e6, provenance="assumed", source="unit of the reward")
    """Reward lost over a job at top speed."""
    damage_weight: float = parameter(1.0, low=0.0, high=1e6, provenance="assumed", source="a life is worth a job")
    """Reward lost by one life."""
    type_iii_weight: float = parameter(1.0, low=0.0, high=1e6, provenance="assumed", source="as a life")
    """Reward lost by a job that is Type III throughout."""
    failure_weight: float = parameter(10.0, low=0.0, high=1e6, provenance="assumed", source="dearer than any job")
    """Reward lost by fracture or a failed simulation."""

    def __post_init__(self) -> None:
        validate(self)
        if self.job_cycles % self.cycles_per_step:
            raise ParameterError(
                f"job_cycles = {self.job_cycles} is out of range; allowed: multiples of cycles_per_step = "
                f"{self.cycles_per_step}"
            )

    @property
    def steps(self) -> int:
        """Steps of the job."""
        return int(self.job_cycles // self.cycles_per_step)

    @property
    def type_iii_step(self) -> float:
        """Reward lost by a step that counts as Type III."""
        return self.type_iii_weight * self.cycles_per_step / self.job_cycles

    def damage(self, peak_force: Array) -> Array:
        """Share of its life that each surface uses up, (..., sides)."""
        return damage_of(peak_force, self.load_rating, self.damage_acceleration)

    def status(self, failed: Any, cycles_done: Any, damage: Any) -> Any:
        """Where jobs stand (...), by whether their simulation failed, cycles done, and damage of the joint."""
        done = np.where(cycles_done >= self.job_cycles, int(Status.JOB_DONE), int(Status.RUNNING))
        return np.where(failed, int(Status.SIMULATION_FAILED), np.where(damage >= 1.0, int(Status.FRACTURE), done))

    def judge(
        self, step: Step, status: Any, *, type_iii: Any, damage_increase: Any, job_time: float
    ) -> tuple[Array, dict[str, Array]]:
        """Return the rewards of a step (...), and its terms and costs by name.

        Parameters
        ----------
        step
            What happened.
        status : (...)
            Where the jobs stand after it.
        type_iii : (...)
            Whether the step counts as Type III; never where the simulation failed.
        damage_increase : (...)
            By how much the damage of the joint grew.
        job_time
            Duration of the whole job at top speed [s].
        """
        failed = status == int(Status.SIMULATION_FAILED)
        type_iii = type_iii & ~failed
        overload = ~failed & (step.peak_force.max(axis=(-2, -1)) > self.force_limit)
        terms = {
            "reward_time": -self.time_weight * step.duration / job_time,
            "reward_damage": 0.0 - self.damage_weight * damage_increase,
            "reward_type_iii": 0.0 - self.type_iii_step * type_iii,
            "reward_failure": 0.0 - self.failure_weight * (failed | (status == int(Status.FRACTURE))),
        }
        costs = {"cost": type_iii | overload | failed, "cost_type_iii": type_iii, "cost_force": overload}
        named = terms | {name: np.asarray(cost, dtype=float) for name, cost in costs.items()}
        return np.asarray(sum(terms.values())), named
