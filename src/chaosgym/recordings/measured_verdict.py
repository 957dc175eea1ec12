"""The verdict on a measured record: a diagnosis, and what is known of its readings."""

from dataclasses import dataclass
from typing import Any

from chaosgym.series.noise import SensorError
from chaosgym.series.verdict import Diagnosis


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
