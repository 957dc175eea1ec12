"""What does a policy win on machines that are not those it was trained on, and does a guard keep its promise there?

Each row changes what a beam's job rests on, for all of the same machines; fleets are rows too. The promise: never worse
than backing off by more than the interval of the paired difference.
"""

from collections.abc import Iterable, Mapping
from typing import Any

from tqdm import tqdm

from chaosgym.control.controllers import BackOff, Follow
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.policies import shipped_policy
from chaosgym.control.rollout import Policy, play
from chaosgym.control.scores import MADE_WORSE, difference
from chaosgym.control.statistics import paired_difference

ENV, CRANK = "chaosgym/ImpactBeamTolerance-v1", "chaosgym/SliderCrankTolerance-v1"

FIRST_SEED = 21_000_000
"""Of the machines: neither those of training nor those of an evaluation, nor those on which the guard was chosen."""

ROWS: Mapping[str, Mapping[str, Any]] = {
    "as trained": {},
    "structural damping x2": {"damping_ratio": 0.02},
    "structural damping x0.5": {"damping_ratio": 0.005},
    "contact stiffness x2": {"contact_stiffness": 3.0e7},
    "contact stiffness x0.5": {"contact_stiffness": 0.75e7},
    "contact damping x2": {"contact_damping": 40.0},
    "contact damping x0.5": {"contact_damping": 10.0},
    "force +20 %": {"force_amplitude": 21.36},
    "force -20 %": {"force_amplitude": 14.24},
    "clearance +30 %": {"clearance": 0.1651e-3},
    "clearance -30 %": {"clearance": 0.0889e-3},
    "density +2 %": {"density": 8007.0},
    "speed ripple 1 %": {"speed_ripple": 0.01},
    "sensor error 3 N": {"sensor_error": 3.0},
}

FLEETS: Mapping[str, Mapping[str, Any]] = {
    f"{kind}, {split}": {"env": env, "level": "fleet", "split": split}
    for kind, env in (("beams of the fleet", ENV), ("cranks of the fleet", CRANK))
    for split in ("test", "outside")
}
"""Rows of whole fleets."""


def mismatch(machines: int = 64, rows: Iterable[str] = ROWS) -> list[dict[str, Any]]:
    """Returns of following, backing off, and the level's shipped policy, guarded too; who is worse than backing off."""
    found = []
    for row in tqdm(list(rows), desc="rows", unit="row", leave=False):
        changed = {"env": ENV, **{**ROWS, **FLEETS}[row]}
        agent = shipped_policy(changed["env"], changed.get("level"))
        players: dict[str, Policy] = {
            "follow": Follow(),
            "back off": BackOff(),
            "shipped": agent,
            "guarded": GuardedPolicy(agent),
        }
        seeds = range(FIRST_SEED, FIRST_SEED + machines)
        jobs = {name: play(player, seeds=seeds, **changed).returns for name, player in players.items()}
        found.append({"row": row, "returns": {name: float(returns.mean()) for name, returns in jobs.items()}})
        for name in ("shipped", "guarded"):
            told = paired_difference(jobs[name], jobs["back off"], MADE_WORSE)
            worse = float((jobs[name] < jobs["follow"] - MADE_WORSE).mean())
            found[-1][name] = {"made_worse": worse, "against_back_off": told}
    return found


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table; what is worse than backing off beyond the interval is bold."""
    told = ["| machines | follow | back off | shipped | guarded | shipped less back off | guarded less back off |"]
    told += ["|---" * 7 + "|"]
    for row in found:
        returns = " | ".join(f"{value:.1f}" for value in row["returns"].values())
        shipped, guarded = (difference(row[name]["against_back_off"]) for name in ("shipped", "guarded"))
        told.append(f"| {row['row']} | {returns} | {shipped} | {guarded} |")
    return told
