"""Checks of a bearing's criteria: what is reached beside what is required, and the verdict that follows."""

from dataclasses import dataclass
from typing import Literal

from chaosgym.design.bearing import BearingEvaluation, Criteria, hours_of
from chaosgym.design.bending import BendingLife
from chaosgym.design.texts import CRITERIA
from chaosgym.design.wear import WearLife
from chaosgym.plain import Result
from chaosgym.series import Type

Verdict = Literal["meets", "fails", "undetermined", "not judged"]


@dataclass(frozen=True)
class Check(Result):
    """One criterion: what is required, what is reached, and whether that is enough."""

    shows = "name reached required unit stated met"

    name: str
    reached: float
    required: float
    unit: str
    stated: str = ""
    """Who stated what is required: "brief.toml:31", or the option of a command."""

    @property
    def met(self) -> bool:
        """Whether the criterion is met."""
        return self.reached >= self.required

    @property
    def told(self) -> str:
        """What is reached of what is required, for people."""
        reached, required = (CRITERIA[self.name](value) for value in (self.reached, self.required))
        return f"{reached} of {required} {self.unit}".rstrip()


def checks_of(kind: Type, evaluation: BearingEvaluation, share: float, criteria: Criteria) -> tuple[Check, ...]:
    """Each criterion that is stated beside what is reached; the safety factor for Types I and II only."""
    checks = []
    if not criteria.missing("life"):
        checks.append(_check("fatigue life", evaluation.life_interval.low, criteria, "life", "million cycles"))
    if not criteria.missing("reliability"):
        checks.append(_check("reliability", evaluation.reliability_interval.low, criteria, "reliability"))
    if criteria.machines_that_meet is not None and criteria.judges_machines:
        checks.append(_check("machines that meet", share, criteria, "machines_that_meet"))
    if kind in ("I", "II"):
        checks += safety_check(evaluation.safety_factor, criteria)
    return tuple(checks)


def safety_check(reached: float, criteria: Criteria) -> tuple[Check, ...]:
    """The safety factor beside the one that is required; none if it is not asked for."""
    return () if criteria.missing("safety factor") else (_check("safety factor", reached, criteria, "safety_factor"),)


def _check(name: str, reached: float, criteria: Criteria, field: str, unit: str = "") -> Check:
    return Check(name, reached, getattr(criteria, field), unit, criteria.origin(field))


def further_checks(
    bent: BendingLife | None, worn: WearLife | None, criteria: Criteria, cycle_period: float
) -> tuple[Check, ...]:
    """Lives of the flexible part and of a joint that wears, by a cycle's period [s], beside the one required."""
    lives = dict[str, float]()
    if bent is not None:
        lives["bending life"] = bent.assured
    if worn is not None:
        lives["wear life"] = worn.assured / hours_of(1.0, cycle_period)
    if criteria.life is None:
        return ()
    return tuple(_check(name, life, criteria, "life", "million cycles") for name, life in lives.items())


def verdict_of(kind: Type, checks: tuple[Check, ...]) -> Verdict:
    """Verdict of the checks: "fails" if one is missed, "undetermined" if the type is, else "meets"."""
    if not checks:
        return "not judged"
    if not all(check.met for check in checks):
        return "fails"
    return "undetermined" if kind == "undetermined" else "meets"


def enough(life: float, reliability: float, criteria: Criteria) -> bool:
    """Whether a machine's own life [10^6 cycles] and reliability reach those that are required."""
    lasts = bool(criteria.missing("life")) or (criteria.life is not None and life >= criteria.life)
    endures = bool(criteria.missing("reliability")) or reliability >= (criteria.reliability or 0.0)
    return lasts and endures
