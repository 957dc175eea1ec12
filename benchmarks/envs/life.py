"""What does kriging win of the joint's life, on machines of which nobody has a model? All sets are untouched by tuning.

The score is 0 for following the demand and 1 for the own map, by returns under ``objective="life"``; a machine is made
worse if its job costs 1 % more than under following. The reference force of a file is set so that following
has a damage of 0.28 in a job, as on the beam, and the sensor's error is as large beside it.
"""

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from tqdm import tqdm

from benchmarks.envs.pool import FOLLOWING
from chaosgym.control.controllers import Follow, Kriging, MapFollower
from chaosgym.control.maps import maps_of
from chaosgym.control.rollout import Played, play
from chaosgym.control.statistics import bootstrap_interval
from chaosgym.envs.pool import read_pool
from chaosgym.rating_life import LIFE_EXPONENT

ANY, BEAM, CRANK = "chaosgym/AnyMachine-v0", "chaosgym/ImpactBeamTolerance-v1", "chaosgym/SliderCrankTolerance-v1"

FILES = ("heat-exchanger-tube", "kahraman-singh-1990", "moon-shaw-1983", "shaw-holmes-1983")
"""Published machines of ``docs/machines`` that a compiled batch runs."""

MADE_WORSE = 0.01


def _rated(path: str, machines: int) -> dict[str, Any]:
    """Keywords of a file's task whose following has as much damage as on the beam."""
    far = 1e9
    damage = play(
        Follow(), path, range(machines), objective="life", reference_force=far, sensor_error=0.0
    ).damage.mean()
    rated = far * (damage / FOLLOWING) ** (1.0 / LIFE_EXPONENT)
    return {"reference_force": float(rated), "sensor_error": 0.0125 * float(rated)}


def sets(machines: int, folder: Path) -> Mapping[str, tuple[str, list[int], dict[str, Any]]]:
    """Environment, numbers of machines and keywords of each set."""
    some, fleet = list(range(machines)), {"level": "fleet", "split": "test", "objective": "life"}
    found: dict[str, tuple[str, list[int], dict[str, Any]]] = {
        "any machine, test": (ANY, list(range(2 * machines)), {"split": "test"})
    }
    others = [row.kind for row in read_pool() if row.split == "other_machines"]
    for kind, name in (("base", "on a moving base"), ("gear", "gear pairs")):
        of_kind = [number for number, other in enumerate(others) if other == kind][:machines]
        found[f"any machine, {name}"] = (ANY, of_kind, {"split": "other_machines"})
    found["beams of the fleet, test"] = (BEAM, some, fleet)
    found["cranks of the fleet, test, draft"] = (CRANK, some[: machines // 3], fleet | {"fidelity": "draft"})
    for name in FILES:
        found[name] = (str(folder / f"{name}.toml"), some[: machines // 2], {"objective": "life"})
    return found


def life(machines: int, folder: Path, names: Iterable[str] | None = None) -> list[dict[str, Any]]:
    """What following, kriging and the own map come to on each set."""
    known, found = sets(machines, folder), []
    for name in tqdm(list(names or known), desc="sets", unit="set", leave=False):
        env, numbers, keywords = known[name]
        if env.endswith(".toml"):
            keywords = keywords | _rated(env, len(numbers))
        map_ = maps_of(env, machines=numbers, **{key: value for key, value in keywords.items() if key != "wear"})
        players = {"follow": Follow(), "kriging": Kriging(price=None), "own": MapFollower([map_])}
        jobs = {who: play(player, env, numbers, **keywords) for who, player in players.items()}
        found.append({"set": name, "machines": len(numbers)} | _compared(**jobs))
    return found


def _compared(follow: Played, kriging: Played, own: Played) -> dict[str, Any]:
    zero, mine, one = (job.returns for job in (follow, kriging, own))

    def score(drawn: Any) -> Any:
        return (mine[drawn] - zero[drawn]).mean(axis=-1) / (one[drawn] - zero[drawn]).mean(axis=-1)

    def lives(job: Played) -> float:
        return float(np.exp(np.log(follow.damage / job.damage).mean()))

    every = np.arange(len(zero))
    return {
        "score": float(score(every)),
        "interval": bootstrap_interval(len(zero), score).tolist(),
        "life": {"kriging": lives(kriging), "own": lives(own)},
        "load": {who: lives(job) ** (-1.0 / LIFE_EXPONENT) for who, job in (("kriging", kriging), ("own", own))},
        "made_worse": {
            who: float(np.mean(job.returns < (1.0 + MADE_WORSE) * zero))
            for who, job in (("kriging", kriging), ("own", own))
        },
        "worst": float(((mine - zero) / -zero.mean()).min()),
    }


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table."""
    told = ["| machines | number | score | 95 % | life | load | life, own map | made worse | made worse, own map |"]
    told += ["|---" * 9 + "|"]
    for row in found:
        low, high = row["interval"]
        told.append(
            f"| {row['set']} | {row['machines']} | {row['score']:.2f} | {low:.2f} to {high:.2f} "
            f"| x{row['life']['kriging']:.2f} | x{row['load']['kriging']:.2f} | x{row['life']['own']:.2f} "
            f"| {row['made_worse']['kriging']:.0%} | {row['made_worse']['own']:.0%} |"
        )
    return told
