"""For which expected gain should the map of the beams' fleet leave the demand, and should it have felt it before?

Machines are of the training split, drawn by seeds that no training, other table or evaluation has, so a rule may be
chosen on them.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from tqdm import tqdm

from chaosgym.control.controllers import Follow
from chaosgym.control.policies.shipped import map_of_the_fleet
from chaosgym.control.rollout import play
from chaosgym.control.scores import MADE_WORSE, difference
from chaosgym.control.statistics import paired_difference

ENV = "chaosgym/ImpactBeamTolerance-v1"

FLEET: Mapping[str, Any] = {"level": "fleet", "split": "train"}

FIRST_SEED = 28_000_000

RULES = [(False, 0.0), (False, 0.05), (False, 0.1), (False, 0.3), (True, 0.05), (True, 0.1), (True, 0.2)]
"""Whether the map is wary, and its least gain; the first one is the reference."""


def risk(machines: int) -> list[dict[str, Any]]:
    """Paired differences of every rule to following, and to the map that leaves any demand for any gain."""
    seeds, shipped = range(FIRST_SEED, FIRST_SEED + machines), map_of_the_fleet("impact-beam")
    assert shipped is not None
    follow = play(Follow(), ENV, seeds=seeds, **FLEET).returns
    played = [
        play(replace(shipped, wary=wary, least_gain=gain), ENV, seeds=seeds, **FLEET)
        for wary, gain in tqdm(RULES, desc="rules", unit="rule", leave=False)
    ]
    return [
        {
            "wary": wary,
            "least_gain": gain,
            "shipped": (wary, gain) == (shipped.wary, shipped.least_gain),
            "type_iii": float(one.type_iii_share.mean()),
            "less_follow": paired_difference(one.returns, follow, MADE_WORSE),
            "less_first": paired_difference(one.returns, played[0].returns, MADE_WORSE),
        }
        for (wary, gain), one in zip(RULES, played, strict=True)
    ]


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table."""
    told = ["| leaves the demand | for a gain above | Type III | less following | made worse | less the first |"]
    told.append("|---" * 6 + "|")
    for row in found:
        when = ("once felt" if row["wary"] else "at once") + " (shipped)" * row["shipped"]
        told.append(
            f"| {when} | {row['least_gain']:g} | {row['type_iii']:.1%} | {difference(row['less_follow'])} "
            f"| {row['less_follow']['made_worse']:.0%} | {difference(row['less_first'])} |"
        )
    return told
