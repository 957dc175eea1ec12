"""Answers of the classifier about a machine: type and nature.

The type follows from the natures of a cross by the printed rule (``diagnosis.type_rule``). Where a nature is only
probable, the type's probabilities are those of the rule over every combination of natures.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

from chaosgym.diagnosis import default_tolerances
from chaosgym.diagnosis.type_rule import CROSS, type_of_cross
from chaosgym.machines import Machine
from chaosgym.plain import Result


@dataclass(frozen=True, kw_only=True)
class NatureAnswer(Result):
    """Nature of one machine, as far as it was followed.

    Attributes
    ----------
    nature
        "periodic" or "chaotic"; None if the classifier abstained.
    probabilities
        Of every nature; they sum to 1. A proven nature has the probability 1.
    proven
        Whether Newton's method proved a periodic orbit that the motion nears.
    stage
        Which stage decided: "parameters", "8 cycles" ... "64 cycles" from rest, "certificate", or "nothing".
    cycles
        Simulated cycles.
    period
        Of a proven orbit; None otherwise.
    largest_peak
        Of the proven orbit, or of the last half of the simulated cycles, both sides [N]; None without any.
    plausible
        Natures that hold the truth with 90 % coverage, whichever it is.
    reason
        Why there is no answer, or how it came about.
    microseconds
        Processor time that it took.
    """

    shows = "nature probability proven stage"

    nature: str | None
    probabilities: Mapping[str, float]
    proven: bool
    stage: str
    cycles: int
    period: int | None
    largest_peak: float | None
    plausible: tuple[str, ...]
    reason: str
    microseconds: float

    @property
    def probability(self) -> float:
        """Of the most probable nature."""
        return max(self.probabilities.values(), default=0.0)


@dataclass(frozen=True, kw_only=True)
class Classification(Result):
    """Answer for one machine.

    Attributes
    ----------
    response_type
        "I", "II" or "III" by the printed rule from one run of the centre and one of each neighbour; None if that is
        too close to call, or was not asked for or not within the budget: ``type_reason``.
    type_probabilities
        From the natures' probabilities of the five points; empty without a type.
    type_proven
        Whether every nature that the type rests on is proven.
    begun
        Where these runs begin: "rest", or "its initial state".
    centre
        Nature of the machine itself.
    neighbours
        Natures one tolerance below and above in speed, and in clearance; empty where the centre decides alone.
    microseconds
        Processor time of the whole answer.
    """

    shows = (
        "nature=centre.nature proven=centre.proven stage=centre.stage cycles=centre.cycles period=centre.period "
        "largest_peak=centre.largest_peak plausible=centre.plausible reason=centre.reason "
        "nature_probabilities=centre.probabilities probability=centre.probability abstained response_type "
        "type_probabilities type_proven type_reason searched nature_microseconds=centre.microseconds microseconds "
        "neighbours"
    )

    response_type: str | None
    type_probabilities: Mapping[str, float]
    type_proven: bool
    type_reason: str
    begun: str
    centre: NatureAnswer
    neighbours: tuple[NatureAnswer, ...]
    microseconds: float

    @property
    def searched(self) -> str:
        """How far was looked for other motions."""
        return f"judged by runs from {self.begun} alone; `chaosgym diagnose --types` looks for other motions"

    @property
    def nature(self) -> str | None:
        """Nature of the centre."""
        return self.centre.nature

    @property
    def abstained(self) -> bool:
        """Whether not even the nature is answered."""
        return self.centre.nature is None


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
