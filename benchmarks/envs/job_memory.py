"""What does a policy win if it remembers the earlier jobs of a machine?

Each beam of the fleet's test split does one job after another, with other demands and disturbances, from the clearance
of the first: it was set right in between. Machines are others than those of the published tables. By default the
map of the fleet plays, and leaves any demand at once, and for any gain.
"""

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import trange

from chaosgym.control.controllers import Follow
from chaosgym.control.policies import load_policy
from chaosgym.control.policies.learned_map import LearnedMap
from chaosgym.control.policies.policy import TrainedPolicy
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.control.rollout import Policy, play
from chaosgym.control.scores import MADE_WORSE, difference
from chaosgym.control.statistics import paired_difference

ENV, FLEET = "chaosgym/ImpactBeamTolerance-v1", {"level": "fleet", "split": "test"}

FIRST_MACHINE, FIRST_SEED = 64, 25_000_000
"""Of the machines, and of the jobs of all of them."""


class Keeping:
    """A learned map, or recurrent policy, that goes on from its memory of the last jobs of the same machines."""

    def __init__(self, policy: LearnedMap | TrainedPolicy) -> None:
        self.policy, self.knows, self.keywords = policy, policy.knows, policy.keywords
        self._begun = False

    def start(self, envs: Any) -> None:
        """Begin the next jobs."""
        name = "memory" if isinstance(self.policy, LearnedMap) else "_state"
        kept = getattr(self.policy, name) if self._begun else None
        self.policy.start(envs)
        if kept is not None:
            setattr(self.policy, name, kept)
        self._begun = True

    def __call__(self, observations: Any) -> Any:
        """Actions of the policy."""
        return self.policy(observations)


def job_memory(machines: int, jobs: int, kept: Path | None, folder: Path | None = None) -> list[dict[str, Any]]:
    """Returns of following, of a policy that forgets and of one that remembers, job by job, with differences.

    They are written into the file ``kept``, a line a job. The policy is that in ``folder``, or the shipped map.
    """
    some = range(FIRST_MACHINE, FIRST_MACHINE + machines)
    forgets, remembers = (_player(folder) for _ in range(2))
    players: dict[str, Policy] = {"follow": Follow(), "forgets": forgets, "remembers": Keeping(remembers)}
    told = []
    for job in trange(jobs, desc="jobs", unit="job", leave=False):
        seeds = [FIRST_SEED + 1_000 * job + k for k in range(machines)]
        played = {name: play(player, ENV, some, seeds=seeds, **FLEET) for name, player in players.items()}
        told.append({"job": job + 1} | {name: one.returns.tolist() for name, one in played.items()})
        if kept is not None:
            kept.write_text("".join(json.dumps(row) + "\n" for row in told), encoding="utf-8")
    return [_compared(row) for row in told] + [_compared(_later(told))] * (jobs > 2)


def _player(folder: Path | None) -> LearnedMap | TrainedPolicy:
    """The policy in a folder, or the shipped map without its rule."""
    policy = load_policy(folder or shipped_folder(ENV, "fleet"))
    if folder is None and isinstance(policy, LearnedMap):
        return replace(policy, least_gain=0.0, wary=False)
    return policy


def _later(told: list[dict[str, Any]]) -> dict[str, Any]:
    """Means of each machine over the jobs from the second one on."""
    names = [name for name in told[0] if name != "job"]
    return {"job": f"2 to {len(told)}"} | {name: np.mean([row[name] for row in told[1:]], axis=0) for name in names}


def _compared(row: Mapping[str, Any]) -> dict[str, Any]:
    follow, forgets, remembers = (np.array(row[name]) for name in ("follow", "forgets", "remembers"))
    return {
        "job": row["job"],
        "machines": len(follow),
        "follow": float(follow.mean()),
        "forgets": paired_difference(forgets, follow, MADE_WORSE),
        "remembers": paired_difference(remembers, follow, MADE_WORSE),
        "gain": paired_difference(remembers, forgets, MADE_WORSE),
    }


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table."""
    told = ["| job | follow | forgets less follow | remembers less follow | remembers less forgets |", "|---" * 5 + "|"]
    for row in found:
        cells = [difference(row[name]) for name in ("forgets", "remembers", "gain")]
        told.append(f"| {row['job']} | {row['follow']:.1f} | {' | '.join(cells)} |")
    return told
