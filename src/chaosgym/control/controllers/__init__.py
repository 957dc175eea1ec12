"""Rules that set speeds without learning; ``chaosgym.control.comparison`` runs them all on the same machines."""

from chaosgym.control.controllers.controller import Controller
from chaosgym.control.controllers.feedback import BackOff, Bandit, BestFelt
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
    "BackOff",
    "Bandit",
    "Belief",
    "BestFelt",
    "CommonSchedule",
    "ConstantTrim",
    "Controller",
    "Follow",
    "Kriging",
    "MapFollower",
    "RecedingHorizon",
    "Schedule",
    "SkipBands",
    "Table",
    "learned_tables",
]
