"""Answers of the classifier: type and nature of a machine; irregularity and nature of a record.

The type follows from the natures of a cross by the printed rule (``diagnosis.type_rule``). Where a nature is only
probable, the type's probabilities are those of the rule over every combination of natures.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from itertools import product
from typing import Any

from chaosgym.diagnosis import default_tolerances
from chaosgym.diagnosis.type_rule import CROSS, type_of_cross
from chaosgym.machines import Machine
from chaosgym.series import Diagnosis


@dataclass(frozen=True, kw_only=True)
class NatureAnswer:
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
class Classification:
    """Answer for one machine.

    Attributes
    ----------
    response_type
        "I", "II" or "III" by the printed rule from centre and neighbours; None if that is too close to call, or was
        not asked for or not within the budget: ``type_reason``.
    type_probabilities
        From the natures' probabilities of the five points; empty without a type.
    type_proven
        Whether every nature that the type rests on is proven.
    centre
        Nature of the machine itself.
    neighbours
        Natures one tolerance below and above in speed, and in clearance; empty where the centre decides alone.
    microseconds
        Processor time of the whole answer.
    """

    response_type: str | None
    type_probabilities: Mapping[str, float]
    type_proven: bool
    type_reason: str
    centre: NatureAnswer
    neighbours: tuple[NatureAnswer, ...]
    microseconds: float

    @property
    def nature(self) -> str | None:
        """Nature of the centre."""
        return self.centre.nature

    @property
    def abstained(self) -> bool:
        """Whether not even the nature is answered."""
        return self.centre.nature is None

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; those of the centre stand beside those of the type."""
        centre = asdict(self.centre)
        centre["nature_probabilities"] = centre.pop("probabilities")
        return {
            **centre,
            "plausible": list(self.centre.plausible),
            "probability": self.centre.probability,
            "abstained": self.abstained,
            "response_type": self.response_type,
            "type_probabilities": dict(self.type_probabilities),
            "type_proven": self.type_proven,
            "type_reason": self.type_reason,
            "nature_microseconds": self.centre.microseconds,
            "microseconds": self.microseconds,
            "neighbours": [
                {"nature": point.nature, "probability": point.probability, "proven": point.proven, "stage": point.stage}
                for point in self.neighbours
            ],
        }


@dataclass(frozen=True, kw_only=True)
class RecordAnswer:
    """Answer for one record of peak forces.

    Attributes
    ----------
    irregular
        Whether the settled response scatters by more than the sensor's error, whatever its period up to 16 cycles:
        what a sensor can know. None if the error is not stated, or it is too close to call.
    irregular_probability
        None if the error is not stated.
    amplitude
        By how much the record does not repeat [N]: scatter within the classes of the best period, as the half range of
        an even spread; the sensor's error is part of it.
    nature, nature_probabilities
        The exact nature, which a sensor can see only where the irregularity exceeds its error; None if too close to
        call.
    period
        Cycles after which a regular record repeats; None otherwise.
    plausible
        Natures that hold the truth with 90 % coverage, whichever it is.
    abstained, reason
        Whether neither question is answered, and why.
    warning
        What the record contradicts, such as the stated error; empty if nothing.
    """

    irregular: bool | None
    irregular_probability: float | None
    amplitude: float | None
    nature: str | None
    nature_probabilities: Mapping[str, float]
    period: int | None
    plausible: tuple[str, ...]
    abstained: bool
    reason: str
    warning: str = ""

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {**asdict(self), "plausible": list(self.plausible)}

    def under(self, verdict: Diagnosis) -> "RecordAnswer":
        """Return the answer under the verdict of ``chaosgym.judge_peaks`` on the same record, which decides.

        The classifier has learned from machines alone and takes many random records for chaos. Its probabilities stand
        where it names the nature of the verdict; elsewhere ``reason`` says why there are none. Then it has abstained
        where the verdict is undetermined. What it says of irregularity falls where the verdict contradicts.

        Examples
        --------
        >>> import numpy as np
        >>> peaks = 100.0 + 6.0 * np.random.default_rng(0).normal(size=300)  # white noise
        >>> learned = chaosgym.default_classifier("impact-beam").classify_record(peaks)
        >>> learned.nature, learned.under(chaosgym.judge_peaks(peaks).diagnosis).nature
        ('chaotic', 'undetermined')
        """
        answer = self
        if self.irregular is (verdict.nature == "periodic") and not verdict.condition:
            answer = replace(answer, irregular=None, irregular_probability=None)
        if self.nature != verdict.nature:
            why = self.reason
            if self.nature is not None:
                undecided = verdict.nature == "undetermined"
                why = f"the verdict {'is undetermined' if undecided else 'contradicts what is learned'}"
            answer = replace(answer, nature_probabilities={}, plausible=(), reason=why or "too close to call")
        return replace(answer, nature=verdict.nature, period=verdict.period, abstained=verdict.nature == "undetermined")


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
