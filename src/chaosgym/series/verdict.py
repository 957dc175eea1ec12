"""The verdict on a response: its nature, how sure that is, and why.

The words are those of the thesis: periodic, quasiperiodic, chaotic (2.3, 5.2) and Types I, II, III (5.5).
"""

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Literal, NamedTuple

Nature = Literal["periodic", "quasiperiodic", "chaotic", "undetermined"]
"""Nature of one response; undetermined where the evidence does not decide."""

Type = Literal["I", "II", "III", "undetermined"]
"""Type of a response over its tolerance neighbourhood."""

Status = Literal["certified", "agreed", "disputed", "transient", "unresolved"]
"""certified: proven to machine precision; agreed: all tests that decide agree; disputed: they do not;
transient: irregular for long before it settled; unresolved: the budget ended first."""

TYPES: tuple[Type, ...] = ("I", "II", "III", "undetermined")

_EMPTY: Mapping[str, Any] = MappingProxyType({})


class Statement(NamedTuple):
    """What is known of a response, in the one form that commands, JSON, pictures and reports show.

    Each is a phrase for people, empty where there is nothing to say.

    Attributes
    ----------
    nature
        Nature of the settled motion, its period, and the condition that it rests on.
    certainty
        Status and margin.
    reason
        Why.
    transient
        How the motion came there.
    horizon
        How long it was seen.
    other_motions
        Motions from other initial states, and how far was looked for them.
    condition
        What the nature rests on that is not known.
    tells_more
        What would tell more.
    """

    nature: str
    certainty: str
    reason: str
    transient: str
    horizon: str
    other_motions: str
    condition: str
    tells_more: str

    @property
    def headline(self) -> str:
        """Nature and certainty, such as "periodic, period 2 (certified, margin 1.00)"."""
        return f"{self.nature} ({self.certainty})"

    def lines(self) -> list[str]:
        """Headline, reason, and a line for each of the others that has something to say."""
        course = "; ".join(filter(None, (self.transient, self.horizon)))
        others = self.other_motions and f"other motions: {self.other_motions}"
        more = self.tells_more and f"would tell more: {self.tells_more}"
        return [self.headline, *filter(None, (self.reason, course, others, more))]


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
    other_motions
        Motions that other initial states lead to, a phrase each.
    searched
        How far was looked for other motions; empty where the question does not arise, as for a record.
    tells_more
        What would tell more, a phrase each.
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
    other_motions: tuple[str, ...] = ()
    searched: str = ""
    tells_more: tuple[str, ...] = ()
    condition: str = ""

    @property
    def words(self) -> str:
        """Nature, period and condition, such as "periodic, period 2"."""
        told = f"{self.nature}, period {self.period}" if self.period else self.nature
        return f"{told}, {self.condition}" if self.condition else told

    @property
    def statement(self) -> Statement:
        """What is known, in the form that every answer shows.

        Examples
        --------
        >>> chaosgym.two_step_test([1.0, 2.0] * 40).statement.lines()[0]
        'periodic, period 2 (margin 1.00)'
        """
        return Statement(
            nature=self.words,
            certainty=f"{self.status}, margin {self.margin:.2f}" if self.status else f"margin {self.margin:.2f}",
            reason=self.reason,
            transient=self._transient(),
            horizon=self._horizon(),
            other_motions="; ".join(filter(None, (*self.other_motions, self.searched))),
            condition=self.condition,
            tells_more=_either(self.tells_more),
        )

    def _transient(self) -> str:
        if not self.settle_cycle:
            return ""
        return f"{'irregular' if self.transient else 'settles'} for {self.settle_cycle} cycles"

    def _horizon(self) -> str:
        if self.horizon is None or self.status == "certified":
            return ""  # a proof needs none
        lasts = "; no run proves that chaos lasts" if self.nature == "chaotic" else ""
        return f"seen over {self.horizon} cycles{lasts}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        plain = {each.name: getattr(self, each.name) for each in fields(Diagnosis) if each.name != "condition"}
        lists = {name: list(plain[name]) for name in ("other_motions", "tells_more")}
        told = {"evidence": dict(self.evidence), "votes": dict(self.votes), "statement": self.statement._asdict()}
        return {**plain, **lists, **told}


def _either(phrases: tuple[str, ...]) -> str:
    """Phrases as "a, b or c"."""
    return " or ".join(filter(None, (", ".join(phrases[:-1]), *phrases[-1:])))


def undetermined(reason: str, readings: Sized, tells_more: tuple[str, ...] = (), **evidence: Any) -> Diagnosis:
    """Diagnosis of a record that can't be judged, why, and what would tell more."""
    return Diagnosis(
        nature="undetermined",
        margin=0.0,
        reason=reason,
        horizon=len(readings),
        tells_more=tells_more,
        evidence={"cycles": len(readings), **evidence},
    )
