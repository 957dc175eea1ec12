"""Which ways to set the speed are there without learning? From chance to one that knows everything.

from chaosgym.controllers import SkipBands
controller = SkipBands(env)          # after observation, info = env.reset(): controller.reset()
action = controller(observation)
"""

from chaosgym.controllers.belief_programming import BeliefProgramming
from chaosgym.controllers.constant import ClairvoyantConstant, ConstantSpeed, HighestSpeed, LowestSpeed, SafeConstant
from chaosgym.controllers.controller import Controller
from chaosgym.controllers.delayed_feedback import DelayedFeedback
from chaosgym.controllers.dynamic_programming import DynamicProgramming, NeighbourProgramming, NominalProgramming
from chaosgym.controllers.force_feedback import ForceFeedback
from chaosgym.controllers.greedy import GreedyClassifier
from chaosgym.controllers.identified_programming import IdentifiedProgramming
from chaosgym.controllers.ogy import OGY
from chaosgym.controllers.random_speed import RandomSpeed
from chaosgym.controllers.receding_horizon import ClairvoyantHorizon, RecedingHorizon
from chaosgym.controllers.skip_bands import SkipBands

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
