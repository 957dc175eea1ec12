"""Which controllers does a comparison run, and in which environment? The ladder, from chance to knowing everything."""

from collections.abc import Callable
from typing import Any, NamedTuple

import gymnasium as gym

from chaosgym.control.controllers.belief_programming import BeliefProgramming
from chaosgym.control.controllers.constant import ClairvoyantConstant, HighestSpeed, LowestSpeed, SafeConstant
from chaosgym.control.controllers.controller import Controller, Knowledge
from chaosgym.control.controllers.delayed_feedback import DelayedFeedback
from chaosgym.control.controllers.dynamic_programming import (
    DynamicProgramming,
    NeighbourProgramming,
    NominalProgramming,
)
from chaosgym.control.controllers.force_feedback import ForceFeedback
from chaosgym.control.controllers.greedy import GreedyClassifier
from chaosgym.control.controllers.identified_programming import IdentifiedProgramming
from chaosgym.control.controllers.ogy import OGY
from chaosgym.control.controllers.random_speed import RandomSpeed
from chaosgym.control.controllers.receding_horizon import ClairvoyantHorizon, RecedingHorizon
from chaosgym.control.controllers.skip_bands import SkipBands

SAFE_CONSTANT, REFERENCE = "safe constant", "dynamic programming"
"""Rungs whose scores are 0 and 1."""

NOMINAL_SEARCH, CLAIRVOYANT_SEARCH = "nominal search", "clairvoyant search"
"""Rungs whose difference is what a wrong model costs."""


class Rung(NamedTuple):
    """A controller: how it is made, what it knows, and whether it acts in each cycle."""

    make: Callable[[gym.Env[Any, Any]], Controller]
    knows: Knowledge
    each_cycle: bool = False


def skip_bands_under_feedback(env: gym.Env[Any, Any]) -> SkipBands:
    """Skip bands whose demand comes from the force sensor."""
    return SkipBands(env, ForceFeedback(env))


LADDER: dict[str, Rung] = {
    "random": Rung(RandomSpeed, RandomSpeed.knows),
    "lowest": Rung(LowestSpeed, LowestSpeed.knows),
    "highest": Rung(HighestSpeed, HighestSpeed.knows),
    "force feedback": Rung(ForceFeedback, ForceFeedback.knows),
    "delayed feedback": Rung(DelayedFeedback, DelayedFeedback.knows, each_cycle=True),
    "skip bands": Rung(SkipBands, SkipBands.knows),
    "skip bands, feedback": Rung(skip_bands_under_feedback, SkipBands.knows),
    "greedy": Rung(GreedyClassifier, GreedyClassifier.knows),
    "nominal programming": Rung(NominalProgramming, NominalProgramming.knows),
    NOMINAL_SEARCH: Rung(RecedingHorizon, RecedingHorizon.knows),
    SAFE_CONSTANT: Rung(SafeConstant, SafeConstant.knows),
    "belief programming": Rung(BeliefProgramming, BeliefProgramming.knows),
    "identified programming": Rung(IdentifiedProgramming, IdentifiedProgramming.knows),
    "neighbour programming": Rung(NeighbourProgramming, NeighbourProgramming.knows),
    "OGY": Rung(OGY, OGY.knows, each_cycle=True),
    "clairvoyant constant": Rung(ClairvoyantConstant, ClairvoyantConstant.knows),
    CLAIRVOYANT_SEARCH: Rung(ClairvoyantHorizon, ClairvoyantHorizon.knows),
    REFERENCE: Rung(DynamicProgramming, DynamicProgramming.knows),
}
"""By name, those that know more further down."""


def each_cycle_keywords(env: gym.Env[Any, Any]) -> dict[str, Any]:
    """Return keywords that make the same environment with a decision each cycle, and a drive that is as quick."""
    unwrapped: Any = env.unwrapped
    drive, cycles = unwrapped.drive, unwrapped.task.cycles_per_step
    free = {"speed_grid": 0.0} if drive.speed_grid > 0.0 else {}
    return {"cycles_per_step": 1, "slew_limit": drive.slew_limit / cycles, **free}
