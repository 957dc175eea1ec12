"""The verdict on a response: its nature, how sure that is, and why.

The words are those of the thesis: periodic, quasiperiodic, chaotic (2.3, 5.2) and Types I, II, III (5.5).
"""

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field, fields, replace
from types import MappingProxyType
from typing import Any, Literal, NamedTuple, Self

Nature = Literal["periodic", "quasiperiodic", "chaotic", "undetermined"]
"""Nature of one response; undetermined where the evidence does not decide."""

Type = Literal["I", "II", "III", "undetermined"]
"""Type of a response over its tolerance neighbourhood."""

Status = Literal["certified", "agreed", "disputed", "transient", "unresolved"]
"""certified: proven to machine precision; agreed: all tests that decide agree; disputed: they do not; unresolved: the
budget ended first; transient: chaos that died out, in labels by the thesis' definition alone."""

Definition = Literal["settled", "thesis"]
"""Whose nature a label is: that of the settled motion, or chaotic too where chaos died out (thesis 5.2.3)."""

DEFINITIONS: tuple[Definition, ...] = ("settled", "thesis")

MOST_ESCAPES = 3.0
"""Escapes in all the time that was seen without any, at most, at 95 % confidence: the rule of three."""

TYPES: tuple[Type, ...] = ("I", "II", "III", "undetermined")

MEANINGS: Mapping[Nature, str] = MappingProxyType(
    {
        "periodic": "each period is like the last, so that one period tells all peaks",
        "quasiperiodic": "no cycle repeats exactly, but peaks keep to a pattern, so that their statistics hold",
        "chaotic": "single peaks can't be foretold, so that only statistics of many cycles hold",
        "undetermined": "decide nothing by it yet",
    }
)
"""What a nature means for whoever relies on the machine."""

TYPE_MEANINGS: Mapping[Type, str] = MappingProxyType(
    {
        "I": "repeats, and follows a trend when parameters vary",
        "II": "repeats, but small variations change the force by more than 10 %",
        "III": "unpredictable in detail, so that only statistics hold",
        "undetermined": "the nature of the nominal response could not be told",
    }
)
"""What a type means over the tolerances."""

COEXISTING = "repeats, but how it was started decides which of several motions it is"
"""What Type III means where motions of different force coexist."""

AT_REST = "at rest under the load"
"""The manner of a response that does not move."""

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
    meaning
        What it means for whoever relies on the machine.
    """

    nature: str
    certainty: str
    reason: str
    transient: str
    horizon: str
    other_motions: str
    condition: str
    tells_more: str
    meaning: str

    @property
    def headline(self) -> str:
        """Nature and certainty, such as "periodic, period 2 (certified, margin 1.00 of 1)"."""
        return f"{self.nature} ({self.certainty})"

    def lines(self) -> list[str]:
        """Headline, reason, meaning, and a line for each of the others that has something to say."""
        course = "; ".join(filter(None, (self.transient, self.horizon)))
        others = self.other_motions and f"other motions: {self.other_motions}"
        more = self.tells_more and f"would tell more: {self.tells_more}"
        means = self.meaning and f"means: {self.meaning}"
        return [self.headline, *filter(None, (self.reason, means, course, others, more))]


@dataclass(frozen=True, kw_only=True)
class Diagnosis:
    """The verdict on one response.

    Attributes
    ----------
    nature
        A ``Nature``.
    period
        Cycles after which a periodic response repeats; else None.
    margin
        Distance of the deciding figure from its threshold: 0 at the threshold, 1 where there is no doubt.
    reason
        One sentence for people.
    evidence
        Figures of each step; numbers, strings and None only, so that it can be written as JSON.
    transient_chaos
        Cycles for which the response was chaotic before it settled; 0 where it settled soon or steadily.
    manner
        What more there is to say of the settled motion, such as "without contact" or "neutral"; empty for most.
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
    transient_chaos: int = 0
    manner: str = ""
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
        """Nature, period and condition, such as "periodic, period 2"; how long chaos lasted, or lasts at least."""
        if self.nature == "chaotic" and self.transient_chaos:  # by the thesis' definition
            return f"chaotic for {self.transient_chaos} cycles, then period {self.period}"
        if self.manner == AT_REST:
            told = AT_REST
        elif self.nature == "chaotic" and self.horizon is not None:
            told = f"chaotic for at least {self.horizon} cycles"
        else:
            told = _listed(self.nature, f"period {self.period}" if self.period else "", self.manner)
        after = f"after {self.transient_chaos} cycles of transient chaos" if self.transient_chaos else ""
        return _listed(told, after, self.condition)

    def labelled(self, definition: Definition) -> Self:
        """The verdict as a label by a definition.

        By that of the thesis (5.2.3) a response whose history repeats only after transient chaos counts as chaotic,
        with the status "transient" and the period that it ended on.

        Examples
        --------
        >>> x = [0.3]
        >>> for n in range(599):
        ...     x.append((4.0 if n < 200 else 3.83) * x[-1] * (1.0 - x[-1]))
        >>> verdict = chaosgym.two_step_test(x)
        >>> verdict.nature, verdict.labelled("thesis").nature
        ('periodic', 'chaotic')
        """
        repeats = self.settle_cycle is not None and self.settle_cycle < (self.horizon or 0)
        if definition == "settled" or not self.transient_chaos or not repeats:
            return self
        return replace(
            self,
            nature="chaotic",
            status="transient",
            margin=self.margin if self.status == "certified" else 0.0,
            reason=f"transient chaos for {self.transient_chaos} cycles; then {self.reason}",
        )

    @property
    def statement(self) -> Statement:
        """What is known, in the form that every answer shows.

        Examples
        --------
        >>> chaosgym.two_step_test([1.0, 2.0] * 40).statement.lines()[0]
        'periodic, period 2 (margin 1.00 of 1)'
        """
        margin = f"margin {self.margin:.2f} of 1"
        return Statement(
            nature=self.words,
            certainty=f"{self.status}, {margin}" if self.status else margin,
            reason=self.reason,
            transient=self._transient(),
            horizon=self._horizon(),
            other_motions="; ".join(filter(None, (*self.other_motions, self.searched))),
            condition=self.condition,
            tells_more=_either(self.tells_more),
            meaning=MEANINGS[self.nature],
        )

    def _transient(self) -> str:
        if not self.settle_cycle:
            return ""
        irregular = self.transient_chaos and f"chaotic for {self.transient_chaos} cycles, "
        return f"{irregular or ''}settles for {self.settle_cycle} cycles"

    def _horizon(self) -> str:
        if self.horizon is None or self.status == "certified":
            return ""  # a proof needs none
        if self.nature != "chaotic":
            return f"seen over {self.horizon} cycles"
        rate = escape_rate(self.horizon)
        return f"seen over {self.horizon} cycles: its chaos ends at a rate of at most {rate:.1e} a cycle (95 %)"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        plain = {each.name: getattr(self, each.name) for each in fields(Diagnosis) if each.name != "condition"}
        lists = {name: list(plain[name]) for name in ("other_motions", "tells_more")}
        told = {"evidence": dict(self.evidence), "votes": dict(self.votes), "statement": self.statement._asdict()}
        return {**plain, **lists, **told}


def escape_rate(cycles: int) -> float:
    """Bound on the rate [1/cycle] at which chaos ends that did not in so many cycles, at 95 % confidence.

    Examples
    --------
    >>> from chaosgym.series.verdict import escape_rate
    >>> escape_rate(3000)
    0.001
    """
    return MOST_ESCAPES / cycles


def _listed(*phrases: str) -> str:
    """The phrases that are not empty, with commas."""
    return ", ".join(filter(None, phrases))


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
