"""The verdict on a machine: a diagnosis with the run that it rests on."""

from dataclasses import dataclass, field, fields
from typing import Any

from chaosgym.errors import DiagnosisError
from chaosgym.series.verdict import Diagnosis
from chaosgym.simulation import CycleRecord


@dataclass(frozen=True, kw_only=True)
class MachineDiagnosis(Diagnosis):
    """The verdict on a machine's response.

    Attributes
    ----------
    record
        The run that was judged; None where two outcomes were compared alone.
    orbit_record
        The motion on the proven orbit, whole periods of it; None where none was proven.
    """

    searched: str = "not looked for"
    record: CycleRecord | None = field(default=None, repr=False, compare=False)
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


def of_machine(verdict: Diagnosis, **changes: Any) -> MachineDiagnosis:
    """Return a verdict on a series as that on its machine, with some fields changed, such as ``record``."""
    own = {each.name: getattr(verdict, each.name) for each in fields(verdict) if each.name != "searched"}
    return MachineDiagnosis(**{**own, **changes})
