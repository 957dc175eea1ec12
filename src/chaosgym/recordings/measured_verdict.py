"""The verdict on a measured record: a diagnosis, and what is known of its readings."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from chaosgym.plain import Result
from chaosgym.series.noise import SensorError
from chaosgym.series.verdict import Diagnosis


class Feature(NamedTuple):
    """One thing that is seen: its kind, a phrase for people, and its figures."""

    kind: str
    text: str
    figures: dict[str, float]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {"kind": self.kind, "text": self.text, **self.figures}


@dataclass(frozen=True)
class MeasuredVerdict(Result):
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
        Whether a periodic response is taken to have scatter of a random process or sensor, a line from outside, or
        spikes apart. Where these exceed a stated error, or none is stated, ``diagnosis.condition`` says that the
        verdict rests on this.
    outliers
        Cycles, from 1, whose single readings were left out.
    gaps
        Cycles, from 1, before which some are missing.
    changes
        First cycles, from 1, of a later regime.
    description
        What is seen beside the nature: patterns, lines, trends, changes, spikes, levels, bursts.
    notes
        Sentences for people on what was left out, and on drift.
    unit
        Unit of the readings.
    """

    shows = (
        "sensor_error=error outliers gaps changes notes scatter coefficient_of_variation random unit description "
        "condition=diagnosis.condition"
    )

    diagnosis: Diagnosis
    error: SensorError | None
    scatter: float | None = None
    coefficient_of_variation: float | None = None
    random: bool = False
    outliers: tuple[int, ...] = ()
    gaps: tuple[int, ...] = ()
    changes: tuple[int, ...] = ()
    description: tuple[Feature, ...] = ()
    notes: tuple[str, ...] = ()
    unit: str = "N"

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences for people: what is seen, and the notes."""
        return (*(f"seen: {feature.text}" for feature in self.description), *self.notes)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON: those of the diagnosis, and what is known of the readings."""
        return {**self.diagnosis.as_dict(), **super().as_dict()}
