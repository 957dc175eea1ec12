"""The response type of a machine from the natures of a cross: its own, and one tolerance away in speed and clearance.

The rule is the printed one (``diagnosis.type_rule``). Where a nature is only probable, the type's probabilities are
those of the rule over every combination of natures.
"""

from collections.abc import Sequence
from itertools import product

from chaosgym.classifier.answer import NatureAnswer
from chaosgym.diagnosis import default_tolerances
from chaosgym.diagnosis.type_rule import CROSS, type_of_cross
from chaosgym.machines import Machine

NEGLIGIBLE = 1e-3
"""Probability below which a nature is left out."""


def neighbours_of(machine: Machine) -> list[Machine]:
    """The four neighbours of a machine, in the order of ``CROSS``.

    Raises
    ------
    ParameterError
        If one of them is not allowed.
    """
    tolerances = default_tolerances(machine)
    fields = (machine.speed_field, machine.clearance_field)
    speed, clearance = (
        [tolerances[field].at(getattr(machine, field), side) for side in (-1.0, 0.0, 1.0)] for field in fields
    )
    return [machine.at(speed[one + 1], clearance[other + 1]) for one, other in CROSS[1:]]


def type_probabilities(machine: Machine, points: Sequence[NatureAnswer]) -> tuple[dict[str, float], str]:
    """Probabilities of Types I, II and III from centre and neighbours (5,), and the reason of the likeliest natures.

    A nature without any probability counts as either with equal chances.
    """
    natures = [_likely(point) for point in points]
    fields = (machine.speed_field, machine.clearance_field)
    peaks = [point.largest_peak or 0.0 for point in points]
    told = {"I": 0.0, "II": 0.0, "III": 0.0}
    best, reason = -1.0, ""
    for combination in product(*natures):
        chance = 1.0
        for _, share in combination:
            chance *= share
        kind, why = type_of_cross([nature for nature, _ in combination], peaks, fields)
        told[kind] += chance
        if chance > best:
            best, reason = chance, why
    total = sum(told.values())
    return {kind: chance / total for kind, chance in told.items()}, reason


def _likely(point: NatureAnswer) -> list[tuple[str, float]]:
    known = [(nature, chance) for nature, chance in point.probabilities.items() if chance >= NEGLIGIBLE]
    return known or [("periodic", 0.5), ("chaotic", 0.5)]
