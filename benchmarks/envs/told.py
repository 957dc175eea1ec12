"""What would a learned map win if it were told the label that is paid, and how well does it tell the label itself?

Beams of a split of the fleet, others than those of the published tables. *Told* knows the share of irregular cycles
that was charged at each speed of this job, as no sensor does; it bounds what any sense of the present motion can win.
*Sensed* is told instead what the shipped sense makes of each step there, ``classifier="on"``; *mixed* what map and
sense make of it together.
"""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import numpy as np
from scipy.special import expit, logit

from benchmarks.envs.job_memory import ENV, FLEET
from chaosgym.arrays import Array
from chaosgym.control.controllers import Follow
from chaosgym.control.controllers.controller import Observations, added, place_of, seen
from chaosgym.control.policies import load_policy
from chaosgym.control.policies.learned_map import LearnedMap
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.control.rollout import Policy
from chaosgym.control.scores import MADE_WORSE, difference
from chaosgym.control.statistics import paired_difference
from chaosgym.envs.memory import irregularity
from chaosgym.envs.vector_env import native_envs

FIRST_MACHINE, FIRST_SEED = 128, 26_000_000

WEIGHT = 0.5
"""Steps that the map's own answer counts beside those that were charged."""


MIXED = (-0.42, 0.63, 0.43)
"""Logit of a step by map and sense together: constant, and weights of their logits; a regression on jobs that the map
played on 768 machines of training, with a part of the steps at random speeds."""


class Watched(LearnedMap):
    """The shipped map, at once and for any gain; of every held step it keeps the label, and what others make of it."""

    tells = ""

    def __init__(self) -> None:
        shipped = load_policy(shipped_folder(ENV, "fleet"))
        given = {part.name: getattr(shipped, part.name) for part in fields(shipped) if part.init}
        super().__init__(**given | {"least_gain": 0.0, "wary": False})
        self.paid: Array | None = None
        self.rows: list[tuple[Array, ...]] = []

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of the environment that it plays in."""
        return super().keywords | {"classifier": "on"}

    def begin(self, envs: Any) -> None:
        """Begin jobs of which nothing was charged."""
        super().begin(envs)
        self._charged, self._steps = np.zeros((2, envs.num_envs, len(envs.task.grid)))

    def predicted(self, observations: Observations) -> tuple[Array, Array]:
        """What the map foretells, at speeds of this job mixed with what was charged if it is told that."""
        share, peak = super().predicted(observations)
        if self.paid is not None:
            task, every = self.task, np.arange(len(observations))
            at, held = place_of(seen(observations, "speed"), task), self.settled
            sensed = added(observations, task, "irregular_probability")
            answers = (self.paid, share[every, at], irregularity(observations), sensed)
            self.rows.append(tuple(values[held] for values in answers))
            told = {"sense": sensed, "both": _mixed(share[every, at], sensed)}.get(self.tells, self.paid)
            self._charged[every[held], at[held]] += told[held]
            self._steps[every[held], at[held]] += 1.0
        if self.tells:
            share = (WEIGHT * share + self._charged) / (WEIGHT + self._steps)
        return share, peak


class Sensed(Watched):
    """The same, told what the sense makes of each held step."""

    tells = "sense"


class Mixed(Watched):
    """The same, told what map and sense make of each held step together."""

    tells = "both"


class Told(Watched):
    """The same, told what was charged."""

    tells = "label"


def _mixed(share: Array, sensed: Array) -> Array:
    """What map and sense make of steps (n,) together."""
    constant, of_map, of_sense = MIXED
    return np.asarray(expit(constant + of_map * _logit(share) + of_sense * _logit(sensed)))


def _logit(share: Array) -> Array:
    return np.asarray(logit(share.clip(1e-5, 1.0 - 1e-5)))


def returns(player: Policy, machines: int, split: str) -> tuple[Array, Array]:
    """Return and share of irregular cycles of each machine's job."""
    envs = native_envs(ENV, machines, **FLEET | {"split": split}, **player.keywords)
    numbers = np.arange(FIRST_MACHINE, FIRST_MACHINE + machines)
    observations, _ = envs.reset(seed=[FIRST_SEED + k for k in range(machines)], options={"machine": numbers})
    player.start(envs)
    total, irregular, runs = np.zeros(machines), np.zeros(machines), np.ones(machines, np.bool_)
    for _ in range(envs.task.steps):
        observations, rewards, ended, _, info = envs.step(player(observations))
        total, irregular = total + runs * rewards, irregular + runs * info["type_iii"] / envs.task.steps
        if isinstance(player, Watched):
            player.paid = info["type_iii"].copy()
        runs &= ~ended
    return total, irregular


def told(machines: int, split: str) -> dict[str, Any]:
    """Returns and paired differences of following, the map and the maps that are told; areas under the curve."""
    from sklearn.metrics import roc_auc_score

    watched = Watched()
    players: dict[str, Policy] = {"follow": Follow(), "map": watched}
    players |= {"sensed": Sensed(), "mixed": Mixed(), "told": Told()}
    played = {name: returns(player, machines, split) for name, player in players.items()}
    label, share, felt, sensed = (np.concatenate(column) for column in zip(*watched.rows, strict=True))
    by_name = {name: one[0] for name, one in played.items()}
    return {
        "machines": machines,
        "return": {name: float(one[0].mean()) for name, one in played.items()},
        "type_iii": {name: float(one[1].mean()) for name, one in played.items()},
        **{
            f"{name} less {other}": paired_difference(by_name[name], by_name[other], MADE_WORSE)
            for other, names in (("follow", ("map", "sensed", "mixed", "told")), ("map", ("sensed", "mixed", "told")))
            for name in names
        },
        "held steps": len(label),
        "auc": {
            "map": float(roc_auc_score(label > 0.5, share)),
            "sense": float(roc_auc_score(label > 0.5, sensed)),
            "both": float(roc_auc_score(label > 0.5, _mixed(share, sensed))),
            "felt irregularity": float(roc_auc_score(label > 0.5, felt)),
        },
    }


def lines(found: Mapping[str, Any]) -> list[str]:
    """What was found, a line each."""
    rows = [f"{found['machines']} machines, {found['held steps']} held steps of the map"]
    rows += [
        f"{name}: return {value:.1f}, Type III {found['type_iii'][name]:.1%}" for name, value in found["return"].items()
    ]
    rows += [
        f"{name}: {difference(found[name])}, {found[name]['made_worse']:.0%} made worse"
        for name in found
        if " less " in name
    ]
    return rows + [f"area under the curve of the {name}: {area:.3f}" for name, area in found["auc"].items()]
