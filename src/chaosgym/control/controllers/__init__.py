"""Which ways to set the speed are there without learning? From chance to one that knows everything.

from chaosgym.control.controllers import SkipBands
controller = SkipBands(env)          # after observation, info = env.reset(): controller.reset()
action = controller(observation)
"""

from chaosgym.control.controllers.belief_programming import BeliefProgramming
from chaosgym.control.controllers.constant import (
    ClairvoyantConstant,
    ConstantSpeed,
    HighestSpeed,
    LowestSpeed,
    SafeConstant,
)
from chaosgym.control.controllers.controller import Controller
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

__all__ = [
    "OGY",
    "BeliefProgramming",
    "ClairvoyantConstant",
    "ClairvoyantHorizon",
    "ConstantSpeed",
    "Controller",
    "DelayedFeedback",
    "DynamicProgramming",
    "ForceFeedback",
    "GreedyClassifier",
    "HighestSpeed",
    "IdentifiedProgramming",
    "LowestSpeed",
    "NeighbourProgramming",
    "NominalProgramming",
    "RandomSpeed",
    "RecedingHorizon",
    "SafeConstant",
    "SkipBands",
]
