"""Classification of the rows of a Parquet file: by the machine's fields as columns, or by a column of records.

A column ``peak_force`` of lists is taken as records; otherwise every varied field must be a column, in SI units. Other
fields of the machine may be columns too. All columns are kept.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from tqdm import tqdm

from chaosgym.classifier.features import MAX_CYCLES
from chaosgym.classifier.machine_classifier import MachineClassifier
from chaosgym.errors import DatasetError, ParameterError
from chaosgym.files import write_atomically
from chaosgym.machines.parameters import parameters_of, with_settings
from chaosgym.parquet import parquet_of

RECORDS, SENSOR_ERROR = "peak_force", "sensor_error"

KEPT = ("response_type", "nature", "probability", "proven", "stage", "cycles", "period", "largest_peak", "microseconds")
"""Columns of the answer for a machine, beside its probabilities."""

WORDS = ("response_type", "nature", "stage", "reason", "warning")


def classify_file(
    classifier: MachineClassifier,
    source: str | Path,
    out: str | Path,
    *,
    budget_us: float | None = None,
    types: bool = True,
    progress: bool = False,
) -> dict[str, Any]:
    """Classify every row of a Parquet file, write its columns and the answers to another, and count them.

    Parameters
    ----------
    classifier, source, out
        What judges, what is read, what is written.
    budget_us, types
        Of each machine, as for ``MachineClassifier.classify``; a budget of 0 answers natures from parameters alone, all
        rows at once.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If the file can't be read, or lacks a column, or ``out`` exists or has no folder.
    """
    try:
        table = parquet_of(source)
    except ValueError as error:
        raise DatasetError(f"{source} {error}") from None
    target = Path(out)
    if target.exists() or not target.absolute().parent.is_dir():
        raise DatasetError(f"{out} exists already, or its folder does not; choose another file")
    if RECORDS in table.column_names and pa.types.is_nested(table.schema.field(RECORDS).type):
        answers = _of_records(classifier, table)
    elif budget_us == 0.0:
        answers = _of_parameters(classifier, table, str(source))
    else:
        answers = _of_machines(classifier, table, str(source), budget_us, types, progress)
    for name, values in answers.items():
        if name in table.column_names:
            table = table.drop_columns([name])
        table = table.append_column(name, pa.array(list(values), pa.string() if name in WORDS else None))
    write_atomically(target, lambda temporary: pq.write_table(table, temporary))
    kinds = {name: Counter(str(kind) for kind in answers.get(name, ()) if kind is not None) for name in KEPT[:2]}
    return {
        "rows": len(table),
        "abstained": int(np.sum(answers["abstained"])),
        "out": str(out),
        "response_types": dict(sorted(kinds["response_type"].items())),
        "natures": dict(sorted(kinds["nature"].items())),
    }


def _values(classifier: MachineClassifier, table: pa.Table, source: str) -> dict[str, Any]:
    """Columns of the machine's fields, as numbers where training varied them."""
    lacking = [name for name in classifier.fields if name not in table.column_names]
    if lacking:
        raise DatasetError(
            f"{source} has no column {lacking[0]}; needed: {', '.join(classifier.fields)} in SI units, "
            f"or {RECORDS} with lists of peaks"
        )
    columns: dict[str, Any] = {name: _numbers(table, name, source) for name in classifier.fields}
    others = [name for name in parameters_of(classifier.machine) if name not in columns and name in table.column_names]
    for name in others:
        whole = isinstance(getattr(classifier.machine, name), int)
        column = table.column(name).to_pylist()
        columns[name] = [int(value) if whole and value == int(value) else value for value in column]
    return columns


def _numbers(table: pa.Table, name: str, source: str) -> list[float]:
    try:
        numbers: list[float] = table.column(name).cast(pa.float64()).fill_null(float("nan")).to_pylist()
        return numbers
    except pa.ArrowException as error:
        raise DatasetError(f"{source}, column {name}: {error}; allowed: numbers") from error


def _of_parameters(classifier: MachineClassifier, table: pa.Table, source: str) -> dict[str, Any]:
    columns = _values(classifier, table, source)
    varied = [columns[name] for name in classifier.fields]
    answers = classifier.classify_table(np.column_stack(varied) if varied else np.empty((len(table), 0)))
    base = classifier.card["base"]
    others = [name for name in columns if name not in classifier.fields]
    foreign = np.array([any(columns[name][row] != base[name] for name in others) for row in range(len(table))], bool)
    answers["abstained"] = answers["abstained"] | foreign
    answers["reason"] = np.where(foreign, "differs from the classifier's training machine", answers["reason"])
    answers["nature"] = np.where(foreign, None, answers["nature"])
    return answers


def _of_machines(
    classifier: MachineClassifier,
    table: pa.Table,
    source: str,
    budget_us: float | None,
    types: bool,
    progress: bool,
) -> dict[str, Any]:
    columns = _values(classifier, table, source)
    rows = []
    for row in tqdm(range(len(table)), desc="classify", unit="machine", disable=not progress, mininterval=0.5):
        try:
            machine = with_settings(classifier.machine, {name: column[row] for name, column in columns.items()})
            found = classifier.classify(machine, budget_us=budget_us, types=types).as_dict()
        except ParameterError as error:
            found = {"abstained": True, "reason": str(error), "nature_probabilities": {}}
        chances = found["nature_probabilities"]
        told = {f"probability_{name}": chances.get(name) for name in classifier.classes}
        rows.append({**{name: found.get(name) for name in (*KEPT, "abstained", "reason")}, **told})
    return {name: [row[name] for row in rows] for name in rows[0]} if rows else {"abstained": []}


def _of_records(classifier: MachineClassifier, table: pa.Table) -> dict[str, Any]:
    records = [np.asarray(record or (), dtype=float)[-MAX_CYCLES:] for record in table.column(RECORDS).to_pylist()]
    peaks = np.full((len(records), MAX_CYCLES), np.nan)
    for row, record in enumerate(records):
        peaks[row, : len(record)] = record
    errors = None
    if SENSOR_ERROR in table.column_names:
        errors = table.column(SENSOR_ERROR).cast(pa.float64()).to_numpy(zero_copy_only=False)
    return classifier.classify_records(peaks, sensor_error=errors)
