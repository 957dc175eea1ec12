"""The verdict on a machine: a diagnosis with the run that it rests on."""

from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit
from chaosgym.errors import DiagnosisError
from chaosgym.series.exponent import chaos_margin
from chaosgym.series.verdict import Definition, Diagnosis
from chaosgym.simulation import CycleRecord


@dataclass(frozen=True, kw_only=True)
class MachineDiagnosis(Diagnosis):
    """The verdict on a machine's response.

    Attributes
    ----------
    record
        The run that was judged; None where two outcomes were compared alone.
    orbit
        The proven orbit, with its smallest period; None where none was proven.
    orbit_record
        The motion on it, whole periods.
    """

    searched: str = "not looked for"
    record: CycleRecord | None = field(default=None, repr=False, compare=False)
    orbit: PeriodicOrbit | None = field(default=None, repr=False, compare=False)
    orbit_record: CycleRecord | None = field(default=None, repr=False, compare=False)

    @property
    def run(self) -> CycleRecord:
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
    def judged(self) -> CycleRecord:
        """The settled motion that was judged; raises as ``run`` does.

        The proven orbit where there is one, since a proof needs no run that has settled; else the last half of the run.
        """
        return self.orbit_record or self.run.after(len(self.run) // 2)

    @property
    def transient_run(self) -> CycleRecord:
        """The run before the settled motion; raises as ``run`` does.

        All of it where an orbit is proven, since such a run may still be on its way; else its first half.
        """
        return self.run if self.orbit_record is not None else self.run.until(len(self.run) // 2)

    def labelled(self, definition: Definition) -> Self:
        """As of ``Diagnosis``; the margin of chaos by the definition of the thesis is that of its exponent alone."""
        exponent = self.evidence.get("largest_lyapunov_exponent_per_cycle")
        if definition == "settled" or self.transient_chaos or self.nature != "chaotic" or exponent is None:
            return super().labelled(definition)
        return replace(self, margin=chaos_margin(exponent["value"], exponent["standard_error"]))


def of_machine(verdict: Diagnosis, **changes: Any) -> MachineDiagnosis:
    """Return a verdict on a series as that on its machine, with some fields changed, such as ``record``."""
    own = {each.name: getattr(verdict, each.name) for each in fields(verdict) if each.name != "searched"}
    return MachineDiagnosis(**{**own, **changes})
