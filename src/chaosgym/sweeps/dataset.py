"""A labelled sweep as one Parquet file whose schema says units, definitions and provenance.

Any Parquet reader opens it; the columns are the swept fields in SI units, then the labels, their evidence and the
signals. Every page has a checksum, so that damage is found and named. Row groups are the chunks of the run.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from chaosgym import files
from chaosgym.errors import DatasetError
from chaosgym.files import first_line
from chaosgym.machines.parameters import parameters_of
from chaosgym.parquet import parquet_of
from chaosgym.series.verdict import Definition
from chaosgym.sweeps.plan import UNSTATED, WITHOUT_SEARCH, SweepPlan

WINDOW = 64
"""Cycles of a signal."""

WINDOWS: Mapping[str, int] = {"start": 0, "settled": 200}
"""First cycle of each signal, counted from rest."""

SIGNALS: Mapping[str, Mapping[str, str]] = {
    "start": {"peak_force": "N", "displacement": "m", "velocity": "m/s"},
    "settled": {"peak_force": "N"},
}
"""What is kept of each cycle: peak force of the first side; stroboscopic displacement and velocity of the joint."""

SENSOR_ERROR = 3.0
"""Largest error [N] of the sensor to which ``resolvable`` refers (thesis 3.6)."""


class Column(NamedTuple):
    """Type, unit and meaning of a column."""

    kind: pa.DataType
    unit: str
    meaning: str


STATUS_MEANING = (
    "certified: a periodic orbit proven by Newton's method; agreed: all tests that speak say the same; disputed: they "
    "don't; transient: chaos that died out; unresolved: the budget ended first; failed: no run"
)


def _figure(unit: str, meaning: str) -> Column:
    return Column(pa.float32(), unit, meaning)


NATURE_OF: Mapping[str, str] = {
    "settled": "that of the settled motion",
    "thesis": "chaotic too where the history repeats only after transient chaos, as in thesis 5.2.3",
}
"""Whose nature a row has, by the definition of its plan."""

CROSS_COLUMNS: Mapping[str, Column] = {
    "machine": Column(pa.int32(), "-", "the five rows of one cross: centre, speed below and above, clearance likewise"),
    "split": Column(pa.string(), "-", "train, validation or test; whole machines"),
}

LABELS: Mapping[str, Column] = {
    "nature": Column(pa.string(), "-", "periodic, quasiperiodic, chaotic or undetermined; null if failed"),
    "period": Column(pa.int32(), "cycles", "cycles after which a periodic response repeats; null otherwise"),
    "response_type": Column(pa.string(), "-", ""),
    "type_neighbours": Column(pa.int32(), "-", "neighbours that the response type rests on; fewer at a border"),
    "full_response_type": Column(
        pa.string(), "-", "I, II, III or undetermined over all tolerances and three initial states, by runs of its own"
    ),
    "motions": Column(pa.int32(), "-", "motions that the search of a full type met; null where it made none"),
    "other_motions": Column(
        pa.string(), "-", "the other ones: force, share of the starts, where each is stable; and how far was looked"
    ),
    "status": Column(pa.string(), "-", STATUS_MEANING),
    "margin": _figure("-", "distance of the verdict from its threshold: 0 on it, 1 without doubt"),
    "two_step": Column(
        pa.string(),
        "-",
        "nature by both steps of the Two-Step Test alone (thesis 5.2.1); undetermined where it does not decide",
    ),
    "irregularity": _figure(
        "N",
        "half range of the peak force within the classes of the best period up to 16, largest class, of the settled "
        "signal or, in a sweep that keeps none, of the last 64 judged cycles: what a sensor must resolve to see that "
        "the response does not repeat",
    ),
    "resolvable": Column(
        pa.bool_(), "-", f"irregularity above {SENSOR_ERROR:g} N: irregular to the sensor of the thesis"
    ),
    "exponent": _figure("1/cycle", "largest Lyapunov exponent; of the orbit itself where certified"),
    "exponent_error": _figure("1/cycle", "standard error of the exponent; 0 where certified"),
    "peak_force_min": _figure("N", "smallest peak force of a judged cycle, first side of the joint"),
    "peak_force_max": _figure("N", "largest peak force of a judged cycle, first side"),
    "peak_force_mean": _figure("N", "mean peak force of the judged cycles, first side"),
    "peak_force_std": _figure("N", "standard deviation of the peak force, first side"),
    "largest_peak": _figure("N", "largest peak force of the settled cycles, both sides: the statistic of the types"),
    "impacts_per_cycle": _figure("-", "contacts that begin in a judged cycle, both sides"),
    "contact_fraction": _figure("-", "share of the time in contact, both sides"),
    "bounce_fraction": _figure("-", "longest bouncing before sustained contact, in half cycles"),
    "settle_cycle": Column(pa.int32(), "cycles", "first cycle from rest that repeats; null if none does"),
    "transient_chaos": Column(pa.int32(), "cycles", "cycles from rest for which a response that settled was chaotic"),
    "horizon": Column(pa.int32(), "cycles", "cycles from rest that the verdict rests on; the last half is judged"),
    "cycles_used": Column(pa.int32(), "cycles", "cycles computed for the verdict, Newton's method included"),
    "headline": Column(pa.string(), "-", "the verdict in words, as every command prints it; null if failed"),
    "reason": Column(pa.string(), "-", "why the verdict is what it is, or why the run failed"),
}
"""Labels and their evidence."""

LATER = ("two_step", "transient_chaos", "headline", "motions", "other_motions")
"""Columns that sweeps of former versions lack."""

_NEIGHBOURS = "I, II, III or undetermined over the neighbours in {fields} up to one tolerance away, one initial state"
_CROSS = "I, II, III or undetermined over the other four points of the cross, one initial state; of centres only"
_FULL = "as full_response_type, since the sweep has no neighbours one tolerance away; on a grid III where not periodic"


def signal_columns() -> dict[str, Column]:
    """Columns of the signals, lists of ``WINDOW`` cycles each; null where they are not kept.

    Lists without a fixed size: some readers fail on those with one among which there are nulls.
    """
    kind = pa.list_(pa.float32())
    return {
        f"{window}_{name}": Column(kind, unit, f"{name} of cycles {first} to {first + WINDOW - 1} from rest")
        for window, first in WINDOWS.items()
        for name, unit in SIGNALS[window].items()
    }


FIXED = "the same in every row"


def fixed_fields(plan: SweepPlan) -> dict[str, Any]:
    """Fields that the sweep does not vary, which every row repeats: a row alone describes its machine."""
    values = {name: getattr(plan.machine, name) for name in parameters_of(plan.machine) if name not in plan.fields}
    return {name: value if isinstance(value, str) else float(value) for name, value in values.items()}


def schema(plan: SweepPlan, settings: Mapping[str, Any]) -> pa.Schema:
    """Schema of a plan's rows: units and meanings on the columns, settings and label definitions on the whole."""
    described = parameters_of(plan.machine)
    columns = {name: Column(pa.float64(), described[name].unit, described[name].source) for name in plan.fields}
    for name, value in fixed_fields(plan).items():
        kind = pa.string() if isinstance(value, str) else pa.float64()
        columns[name] = Column(kind, described[name].unit, f"{FIXED}: {described[name].source}")
    if plan.sampling == "crosses":
        columns |= CROSS_COLUMNS
    columns |= LABELS
    reach = plan.type_reach()
    about_type = _NEIGHBOURS.format(fields=" and ".join(reach)) if reach else _FULL
    about_type = _CROSS if plan.sampling == "crosses" else about_type
    meaning = f"{LABELS['nature'].meaning}; {NATURE_OF[plan.definition]}"
    columns["nature"] = LABELS["nature"]._replace(meaning=meaning)
    columns["response_type"] = LABELS["response_type"]._replace(meaning=about_type)
    if plan.full_types and plan.initial_states != WITHOUT_SEARCH:
        searched = f"all tolerances and from {plan.initial_states} random starts, by runs of its own"
        searched = f"I, II, III or undetermined over {searched}"
        columns["full_response_type"] = LABELS["full_response_type"]._replace(meaning=searched)
    if plan.signals:
        columns |= signal_columns()
    definitions = {name: column.meaning for name, column in columns.items() if name not in described}
    return pa.schema(
        [
            pa.field(name, kind, metadata={"unit": unit, "meaning": meaning})
            for name, (kind, unit, meaning) in columns.items()
        ],
        metadata={"chaosgym": json.dumps(settings, sort_keys=True), "definitions": json.dumps(definitions)},
    )


DATA_FILE = "sweep.parquet"

DAMAGE = (pa.ArrowException, *files.DAMAGE)
"""What a damaged file raises."""


@dataclass(frozen=True)
class LabelledSweep:
    """A labelled sweep: ``table`` with one row a point, and the ``settings`` that made it."""

    table: pa.Table
    settings: dict[str, Any]

    def __repr__(self) -> str:
        return f"<{len(self.table)} labelled points of {self.settings['machine']}>"

    def column(self, name: str) -> Any:
        """Return a column as a numpy array."""
        return self.table.column(name).to_numpy(zero_copy_only=False)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, or (n_points,) if the points do not form one."""
        if self.settings["sampling"] != "grid":
            return (len(self.table),)
        return tuple(axis["count"] for axis in self.settings["axes"])

    @property
    def definition(self) -> Definition:
        """Whose nature its rows have."""
        stated: Definition = self.settings.get("definition", UNSTATED)
        return stated

    @property
    def plan(self) -> SweepPlan:
        """What was labelled."""
        return SweepPlan.from_settings(self.settings)

    @property
    def provenance(self) -> list[dict[str, str]]:
        """Every installation that computed some of the rows."""
        found: list[dict[str, str]] = json.loads(self.table.schema.metadata[b"provenance"])
        return found


@contextmanager
def parquet_writer(path: Path, schema: pa.Schema) -> Iterator[pq.ParquetWriter]:
    """Open a Parquet file with checksums and zstandard compression; signals are split by byte."""
    lists = [field.name for field in schema if pa.types.is_list(field.type)]
    numbers = [field.name for field in schema if pa.types.is_floating(field.type)]
    words = [field.name for field in schema if field.name not in (*numbers, *lists)]
    with pq.ParquetWriter(
        path,
        schema,
        compression="zstd",
        compression_level=9,
        write_page_checksum=True,
        use_dictionary=words,
        use_byte_stream_split=[f"{name}.list.element" for name in lists],
    ) as writer:
        yield writer


def read_sweep(folder: str | Path, columns: list[str] | None = None) -> LabelledSweep:
    """Read a finished sweep, or some columns of it.

    Raises
    ------
    DatasetError
        If the folder holds no finished sweep, or its file is damaged.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> speeds = chaosgym.Axis("excitation_frequency", 10.0, 22.0, 3)
    >>> with TemporaryDirectory() as folder:
    ...     made = chaosgym.run_sweep(chaosgym.SweepPlan(chaosgym.ImpactBeam(), (speeds,)), folder)
    ...     sweep = chaosgym.read_sweep(folder, ["excitation_frequency", "period"])
    >>> sweep.table.to_pydict()
    {'excitation_frequency': [10.0, 16.0, 22.0], 'period': [1, 1, None]}
    """
    path = Path(folder) / DATA_FILE
    if not path.is_file():
        raise DatasetError(
            f"{folder} holds no finished sweep (no {DATA_FILE}); run `chaosgym sweep` again to finish it"
        )
    try:
        return _understood(parquet_of(path, columns), columns)
    except DAMAGE as error:
        raise DatasetError(f"{path} can't be read as a chaosgym sweep: {first_line(error)}") from error


def _understood(table: pa.Table, columns: list[str] | None) -> LabelledSweep:
    """Sweep of a table, all of whose metadata can be read: pages have checksums, the footer has none."""
    metadata = table.schema.metadata
    sweep = LabelledSweep(table, json.loads(metadata[b"chaosgym"]))
    for values, kind in (
        (sweep.plan, SweepPlan),
        (sweep.provenance, list),
        (json.loads(metadata[b"definitions"]), dict),
    ):
        if not isinstance(values, kind):
            raise TypeError(f"its metadata hold a {type(values).__name__} for a {kind.__name__}")
    _check_columns(table.schema, schema(sweep.plan, sweep.settings), columns)
    return sweep


def _alike(one: pa.DataType, other: pa.DataType) -> bool:
    """Whether two types are one, or integers of other widths, as of sweeps of former versions."""
    return bool(one == other or (pa.types.is_integer(one) and pa.types.is_integer(other)))


def _check_columns(there: pa.Schema, needed: pa.Schema, columns: list[str] | None) -> None:
    """Refuse a table that lacks a column of its sweep, or has it in another type or without unit and meaning."""
    for name in (one for one in needed.names if one not in LATER or one in there.names) if columns is None else columns:
        if there.get_field_index(name) < 0:
            raise ValueError(f"it has no column {name!r}, or has it twice; allowed: all of {', '.join(needed.names)}")
        field = there.field(name)
        if name in needed.names and not _alike(field.type, needed.field(name).type):
            raise ValueError(f"its column {name!r} holds {field.type}; allowed: {needed.field(name).type}")
        for key in (b"unit", b"meaning"):
            if key not in (field.metadata or {}):
                raise ValueError(f"its column {name!r} lacks its {key.decode()}")
            field.metadata[key].decode()
