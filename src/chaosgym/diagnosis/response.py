"""The verdict on a response: its nature, how sure that is, and why.

The words are those of the thesis: periodic, quasiperiodic, chaotic (2.3, 5.2) and Types I, II, III (5.5).
"""

from collections.abc import Mapping, Sized
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal

from chaosgym.errors import DiagnosisError
from chaosgym.signals.noise import SensorError

if TYPE_CHECKING:
    from chaosgym.simulation.record import CycleRecord

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
    record
        The run that was judged; None where a plain series was.
    orbit_record
        The motion on the proven orbit, whole periods of it; None where none was proven.
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
    record: "CycleRecord | None" = field(default=None, repr=False, compare=False)
    orbit_record: "CycleRecord | None" = field(default=None, repr=False, compare=False)
    condition: str = ""

    @property
    def words(self) -> str:
        """Nature, period and condition, such as "periodic, period 2"."""
        told = f"{self.nature}, period {self.period}" if self.period else self.nature
        return f"{told}, {self.condition}" if self.condition else told

    @property
    def run(self) -> "CycleRecord":
        """The run that was judged.

        Raises
        ------
        DiagnosisError
            If the verdict was reached on a plain series.
        """
        if self.record is None:
            raise DiagnosisError("the verdict was reached on a plain series; diagnose a machine to get its run")
        return self.record

    @property
    def judged(self) -> "CycleRecord":
        """The settled motion that was judged; raises as ``run`` does.

        The proven orbit where there is one, since a proof needs no run that has settled; else the last half of the run.
        """
        return self.orbit_record or self.run.after(len(self.run) // 2)

    @property
    def transient_run(self) -> "CycleRecord":
        """The run before the settled motion; raises as ``run`` does.

        All of it where an orbit is proven, since such a run may still be on its way; else its first half.
        """
        return self.run if self.orbit_record is not None else self.run.until(len(self.run) // 2)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        left_out = ("record", "orbit_record", "condition")
        plain = {name: getattr(self, name) for name in self.__dataclass_fields__ if name not in left_out}
        return {**plain, "evidence": dict(self.evidence), "votes": dict(self.votes)}


@dataclass(frozen=True)
class MeasuredVerdict:
    """The verdict on a measured record.

    Attributes
    ----------
    diagnosis
        Nature, period and reason; the reason says within or beyond how many newton.
    error
        Error of the sensor, stated or estimated from the record; None where it can't be estimated.
    scatter
        Standard deviation of the readings around their pattern [N]; None where they repeat, or were not asked.
    coefficient_of_variation
        The same as a share of the mean reading.
    random
        Whether the scatter of a periodic response is taken for that of a random process or sensor. Where it is larger
        than a stated error, or none is stated, ``diagnosis.condition`` says that the verdict rests on this.
    outliers
        Cycles, from 1, whose single readings were left out.
    gaps
        Cycles, from 1, before which some are missing.
    changes
        First cycles, from 1, of a later regime.
    notes
        Sentences for people on what was left out, and on drift.
    unit
        Unit of the readings.
    """

    diagnosis: Diagnosis
    error: SensorError | None
    scatter: float | None = None
    coefficient_of_variation: float | None = None
    random: bool = False
    outliers: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    changes: tuple[int, ...] = ()
    notes: tuple[str, ...] = ()
    unit: str = "N"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: those of the diagnosis, and what is known of the readings."""
        error = None if self.error is None else self.error._asdict()
        own: dict[str, Any] = {n: list(getattr(self, n)) for n in ("outliers", "gaps", "changes", "notes")}
        own |= {name: getattr(self, name) for name in ("scatter", "coefficient_of_variation", "random", "unit")}
        own["condition"] = self.diagnosis.condition
        return {**self.diagnosis.as_dict(), "sensor_error": error, **own}


def undetermined(reason: str, readings: Sized, **evidence: Any) -> Diagnosis:
    """Diagnosis of a record that can't be judged, and why."""
    return Diagnosis(
        nature="undetermined",
        margin=0.0,
        reason=reason,
        horizon=len(readings),
        evidence={"cycles": len(readings), **evidence},
    )
