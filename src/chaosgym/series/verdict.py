"""The verdict on a response: its nature, how sure that is, and why.

The words are those of the thesis: periodic, quasiperiodic, chaotic (2.3, 5.2) and Types I, II, III (5.5).
"""

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Literal

Nature = Literal["periodic", "quasiperiodic", "chaotic", "undetermined"]
"""Nature of one response; undetermined where the evidence does not decide."""

Type = Literal["I", "II", "III", "undetermined"]
"""Type of a response over its tolerance neighbourhood."""

Status = Literal["certified", "agreed", "disputed", "transient", "unresolved"]
"""certified: proven to machine precision; agreed: all tests that decide agree; disputed: they do not;
transient: irregular for long before it settled; unresolved: the budget ended first."""

TYPES: tuple[Type, ...] = ("I", "II", "III", "undetermined")

_EMPTY: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The verdict on one response.

    Attributes
    ----------
    nature
        A ``Nature``.
    period
        Cycles after which a periodic response (or the motion that transient chaos settles on) repeats; else None.
    margin
        Distance of the deciding figure from its threshold: 0 at the threshold, 1 where there is no doubt.
    reason
        One sentence for people.
    evidence
        Figures of each step; numbers, strings and None only, so that it can be written as JSON.
    transient
        True where the response was irregular for long and then settled: transient chaos.
    status
        A ``Status``; None where a single test was run.
    horizon
        Number of cycles, counted from the initial condition, that the verdict rests on.
    settle_cycle
        First cycle of the stretch that repeats, counted from the first cycle judged; None if none does.
    votes
        Nature according to each test.
    condition
        What the nature rests on that is not known, such as "if the cycle is 49.4 ms"; empty if nothing is.

    Examples
    --------
    >>> verdict = chaosgym.diagnose(chaosgym.ImpactBeam(excitation_frequency=23.25))
    >>> verdict.words, verdict.status
    ('periodic, period 2', 'certified')
    >>> sorted(verdict.votes)
    ['lyapunov', 'newton', 'two_step']
    """

    nature: Nature
    period: int | None = None
    margin: float
    reason: str
    evidence: Mapping[str, Any] = field(default_factory=lambda: _EMPTY, repr=False)
    transient: bool = False
    status: Status | None = None
    horizon: int | None = None
    settle_cycle: int | None = None
    votes: Mapping[str, Nature] = field(default_factory=lambda: _EMPTY)
    condition: str = ""

    @property
    def words(self) -> str:
        """Nature, period and condition, such as "periodic, period 2"."""
        told = f"{self.nature}, period {self.period}" if self.period else self.nature
        return f"{told}, {self.condition}" if self.condition else told

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        plain = {each.name: getattr(self, each.name) for each in fields(Diagnosis) if each.name != "condition"}
        return {**plain, "evidence": dict(self.evidence), "votes": dict(self.votes)}


def undetermined(reason: str, readings: Sized, **evidence: Any) -> Diagnosis:
    """Diagnosis of a record that can't be judged, and why."""
    return Diagnosis(
        nature="undetermined",
        margin=0.0,
        reason=reason,
        horizon=len(readings),
        evidence={"cycles": len(readings), **evidence},
    )
