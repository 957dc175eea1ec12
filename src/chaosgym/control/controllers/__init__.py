"""Rules that set speeds without learning; ``chaosgym.control.comparison`` runs them all on the same machines."""

from chaosgym.control.controllers.chaos_control import OGY, DelayedFeedback
from chaosgym.control.controllers.controller import Controller
from chaosgym.control.controllers.feedback import BackOff, Bandit, ExtremumSeeking, ForceFeedback, HillClimbing
from chaosgym.control.controllers.kriging import Kriging
from chaosgym.control.controllers.planned import (
    Belief,
    CommonSchedule,
    ConstantTrim,
    Follow,
    MapFollower,
    RecedingHorizon,
    Schedule,
    SkipBands,
)
from chaosgym.control.controllers.table import Table, learned_tables

__all__ = [
    "OGY",
    "BackOff",
    "Bandit",
    "Belief",
    "CommonSchedule",
    "ConstantTrim",
    "Controller",
    "DelayedFeedback",
    "ExtremumSeeking",
    "Follow",
    "ForceFeedback",
    "HillClimbing",
    "Kriging",
    "MapFollower",
    "RecedingHorizon",
    "Schedule",
    "SkipBands",
    "Table",
    "learned_tables",
]
