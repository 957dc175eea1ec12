"""How irregular are the first steps after a demand has changed, when an agent can't know the new speeds yet?"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from tqdm import tqdm

from chaosgym.control.controllers import BackOff, Follow
from chaosgym.control.policies import shipped_policy
from chaosgym.control.rollout import Policy, play

SINCE = ((0, 0), (1, 1), (2, 4), (5, 9), (10, 19))
"""Steps since the demand changed, from and to; the first of a demand is 0."""


def arrivals(env: str, level: str, machines: int) -> dict[str, dict[str, float]]:
    """Mean share of Type III of each player by steps since the demand changed, on machines of the test split.

    The first demand of a job is left out, since the machine was brought there from rest.
    """
    keywords: dict[str, Any] = {"level": level, "split": "test"}
    some = range(machines)
    players: dict[str, Policy] = {"follow": Follow(), "back off": BackOff(), "shipped": shipped_policy(env, level)}
    return {
        name: shares(*(getattr(play(player, env, some, **keywords), what) for what in ("demand", "type_iii")))
        for name, player in tqdm(players.items(), desc="players", unit="player", leave=False)
    }


def shares(demand: Any, type_iii: Any) -> dict[str, float]:
    """Mean share of Type III by steps since the demand changed, of (steps, machines) each."""
    since = np.full(demand.shape, -1)
    for step in range(1, len(demand)):
        new = demand[step] != demand[step - 1]
        since[step] = np.where(new, 0, np.where(since[step - 1] < 0, -1, since[step - 1] + 1))
    found = {}
    for first, last in (*SINCE, (0, 1)):
        steps = type_iii[(since >= first) & (since <= last) & np.isfinite(type_iii)]
        found[f"{first} to {last}" if last > first else f"{first}"] = float(steps.mean()) if steps.size else math.nan
    return found


def lines(found: Mapping[str, Mapping[str, float]]) -> list[str]:
    """A Markdown table."""
    first = next(iter(found.values()))
    told = [f"| player | {' | '.join(first)} |", "|---" * (1 + len(first)) + "|"]
    return told + [
        f"| {name} | {' | '.join(f'{share:.2f}' for share in row.values())} |" for name, row in found.items()
    ]
