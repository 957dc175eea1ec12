"""Can a schedule cheat the reward? Each loophole that one could think of is played for a whole job, beside the others.

All schedules run the nominal machine up from its lowest speed, then go on with

    constant         one speed of the regime table, standing still at the lowest one included
    dithering        from step to step between the two speeds at an edge of a Type III band
    beside an edge   a speed that still counts as the calm one of the two, as near to the other as it can be
    sweeping         up and down the whole range as fast as the drive can, across every band
"""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from typing import Any

import gymnasium as gym
import numpy as np

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.regimes import RegimeTable
from chaosgym.envs.tasks import Status

BESIDE = 0.49
"""How far from the calm speed of an edge towards the other one, in units of the space between them."""


READ = ("cost_type_iii", "cost_force", "damage", "status")
"""What is read of the info of a step."""


@dataclass(frozen=True)
class Plan:
    """Speeds, in the machine's unit, that a schedule goes through in turn, each kept for ``hold`` steps."""

    kind: str
    speeds: tuple[float, ...]
    hold: int = 1


@dataclass
class Score:
    """What a plan earned in a job: return, shares of the steps with a cost, damage, and how the job ended.

    ``best_step`` is the largest reward of a step: nothing to collect if it is never above zero.
    """

    plan: Plan
    total: float = 0.0
    type_iii: float = 0.0
    force: float = 0.0
    damage: float = 0.0
    best_step: float = -np.inf
    status: str = Status.RUNNING.name.lower()
    steps: int = 0

    def add(self, reward: float, info: dict[str, float]) -> None:
        """Add a step."""
        self.steps += 1
        self.total += reward
        self.type_iii += (info["cost_type_iii"] - self.type_iii) / self.steps
        self.force += (info["cost_force"] - self.force) / self.steps
        self.damage, self.best_step = info["damage"], max(self.best_step, reward)
        self.status = Status(int(info["status"])).name.lower()

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return asdict(self)


def plans_of(drive: SpeedDrive, table: RegimeTable) -> Iterator[Plan]:
    """Every schedule that is played."""
    speeds, type_iii = table.speeds.tolist(), table.type_iii
    yield from (Plan("constant", (speed,)) for speed in speeds)
    edges = [i for i in range(len(speeds) - 1) if type_iii[i] != type_iii[i + 1]]
    yield from (Plan("dithering", (speeds[i], speeds[i + 1])) for i in edges)
    for i in edges:
        calm, other = (speeds[i + 1], speeds[i]) if type_iii[i] else (speeds[i], speeds[i + 1])
        beside = float(drive.rounded(calm + BESIDE * (other - calm)))
        if beside not in (calm, other):
            yield Plan("beside an edge", (beside,))
    there = max(1, round((drive.highest_speed - drive.lowest_speed) / drive.slew_limit))
    yield Plan("sweeping", (drive.highest_speed, drive.lowest_speed), there)


def audit(env: str) -> list[Score]:
    """Play every schedule for a job of an environment, given by its id, on the nominal machine."""
    pool = gym.make(env, pool="nominal").get_wrapper_attr("pool")
    plans = list(plans_of(pool.drive, pool.nominal_regimes[0]))
    envs: Any = gym.make_vec(env, num_envs=len(plans), pool="nominal", autoreset_mode="SameStep")
    scores = [Score(plan) for plan in plans]
    runs = np.ones(len(plans), np.bool_)
    envs.reset(seed=0)
    step = 0
    while runs.any():
        speeds = [plan.speeds[step // plan.hold % len(plan.speeds)] for plan in plans]
        actions = np.array([[pool.drive.action_for(speed)] for speed in speeds], np.float32)
        _, rewards, ended, _, infos = envs.step(actions)
        for i in np.flatnonzero(runs).tolist():
            source = infos["final_info"] if ended[i] else infos
            scores[i].add(float(rewards[i]), {name: float(source[name][i]) for name in READ})
        runs &= ~ended
        step += 1
    return scores
