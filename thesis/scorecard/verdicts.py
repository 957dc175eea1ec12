"""Hit, near or miss, by the tolerance of a value's kind; the worst condition decides."""

import math
from collections.abc import Sequence
from typing import Any, Literal, NamedTuple

from thesis.scorecard.findings import Finding, Value
from thesis.statements import Comparison

Verdict = Literal["hit", "near", "miss", "contradictory", "not-computed"]

COUNTED: tuple[Verdict, ...] = ("hit", "near", "miss", "contradictory")
"""Verdicts with a count of their own; what is not computed is the rest of a total."""

NEAR = 2.0
"""How many tolerances are still near."""


class Judged(NamedTuple):
    """One statement and what was found.

    ``error`` is the deviation in tolerances: up to 1 is a hit, up to 2 near; infinite where the nature is wrong.
    """

    comparison: Comparison
    findings: tuple[Finding, ...]
    error: float
    verdict: Verdict

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        values = [_plain(finding.value) for finding in self.findings]
        return {
            "id": self.comparison.id,
            "machine": self.comparison.machine,
            "group": self.comparison.group,
            "printed": _plain(self.comparison.printed),
            "value": values[0] if len(values) == 1 else values or None,
            "unit": self.comparison.shown_unit,
            "tolerance": allowed(self.comparison),
            "verdict": self.verdict,
            "reason": self.reason,
            "reading": self.comparison.reading,
        }

    @property
    def reason(self) -> str:
        """What is compared, and what was found; for a contradictory statement, what contradicts it."""
        one = self.comparison
        parts = [one.contradictory, one.not_computed, one.statement.quantity, self.notes, one.tolerance.reason]
        return " | ".join(part for part in parts if part)

    @property
    def notes(self) -> str:
        """What was found besides the value."""
        return "; ".join(dict.fromkeys(finding.note for finding in self.findings if finding.note))

    @property
    def shown_value(self) -> str:
        """What was found, with its unit; "-" for nothing."""
        return self._shown(self.as_dict()["value"])

    @property
    def shown_printed(self) -> str:
        """What is printed, with its unit."""
        return self._shown(_plain(self.comparison.printed))

    def _shown(self, value: Any) -> str:
        unit = self.comparison.shown_unit
        return shown(value) + ("" if unit == "-" or value is None else f" {unit}")


def judge(comparison: Comparison, findings: Sequence[Finding]) -> Judged:
    """Judge what was found for every condition of a statement."""
    error = max((error_of(comparison, finding) for finding in findings), default=math.inf)
    verdict: Verdict
    if comparison.contradictory:
        verdict = "contradictory"
    elif not findings:
        verdict = "not-computed"
    else:
        verdict = "hit" if error <= 1.0 else "near" if error <= NEAR else "miss"
    return Judged(comparison, tuple(findings), error, verdict)


def error_of(comparison: Comparison, finding: Finding) -> float:
    """Deviation of one finding from the printed value, in tolerances."""
    if not finding.agrees or finding.value is None:
        return math.inf
    printed, value = comparison.printed, finding.value
    if isinstance(printed, str) or isinstance(value, str):
        return 0.0
    if isinstance(printed, tuple):
        ends = value if isinstance(value, tuple) else (value, value)
        return max(_error(comparison, one, other) for one, other in zip(printed, ends, strict=True))
    assert isinstance(value, float)
    return _error(comparison, printed, value)


def allowed(comparison: Comparison) -> float | list[float] | None:
    """Largest deviation of a hit, in the printed unit; None for natures; a factor is given as such."""
    printed = comparison.printed
    if isinstance(printed, str):
        return None
    if isinstance(printed, tuple):
        return [_allowed(comparison, one) for one in printed]
    return _allowed(comparison, printed)


def _allowed(comparison: Comparison, printed: float) -> float:
    tolerance = comparison.tolerance
    if tolerance.factor:
        return tolerance.factor
    axis = _axis_of(comparison)
    step = tolerance.steps * axis.step / axis.unit if tolerance.steps and axis is not None else 0.0
    return max(tolerance.relative * abs(printed), tolerance.absolute, step)


def _axis_of(comparison: Comparison) -> Any:
    return comparison.across if comparison.quantity == "map_clearance" else comparison.along


def _error(comparison: Comparison, printed: float, value: float) -> float:
    if comparison.tolerance.factor:
        if value <= 0.0:
            return math.inf
        return abs(math.log(value / printed)) / math.log(comparison.tolerance.factor)
    limit = _allowed(comparison, printed)
    difference = abs(value - printed)
    if limit == 0.0:
        return 0.0 if difference == 0.0 else math.inf
    return difference / limit * (1.0 - 1e-9)


def shown(value: Any) -> str:
    """A number, a word, or several of them, for people."""
    if isinstance(value, list):
        return ", ".join(shown(one) for one in value)
    return "-" if value is None else value if isinstance(value, str) else f"{value:.4g}"


def _plain(value: Value) -> Any:
    if isinstance(value, tuple):
        return [_plain(one) for one in value]
    return round(value, 6) if isinstance(value, float) else value
