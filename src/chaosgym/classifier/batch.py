"""How are the rows of a Parquet file classified? By the machine's fields as columns, or by a column of records.

A column ``peak_force`` of lists is taken as records; otherwise every varied field must be a column, in SI units.
Fields that training did not vary may be columns too, and must then be as in training. All columns are kept.
"""

from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from chaosgym.classifier.features import MAX_CYCLES
from chaosgym.classifier.shipped import MachineClassifier
from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically

RECORDS, SENSOR_ERROR = "peak_force", "sensor_error"


def classify_file(classifier: MachineClassifier, source: str | Path, out: str | Path) -> dict[str, Any]:
    """Classify every row of a Parquet file, write its columns and the answers to another, and count them.

    Raises
    ------
    DatasetError
        If the file can't be read, or lacks a column, or ``out`` exists or has no folder.
    """
    try:
        table = pq.read_table(source)
    except (pa.ArrowException, OSError) as error:
        raise DatasetError(f"{source} can't be read as Parquet: {error}") from error
    target = Path(out)
    if target.exists() or not target.absolute().parent.is_dir():
        raise DatasetError(f"{out} exists already, or its folder does not; choose another file")
    if RECORDS in table.column_names and pa.types.is_nested(table.schema.field(RECORDS).type):
        answers = _of_records(classifier, table)
    else:
        answers = _of_parameters(classifier, table, str(source))
    for name, values in answers.items():
        if name in table.column_names:
            table = table.drop_columns([name])
        kind = pa.string() if values.dtype.kind in "OU" else None
        table = table.append_column(name, pa.array(values.tolist(), kind))
    write_atomically(target, lambda temporary: pq.write_table(table, temporary))
    counts = Counter(str(kind) for kind in answers["response_type"] if kind is not None)
    return {
        "rows": len(table),
        "abstained": int(answers["abstained"].sum()),
        "out": str(out),
        "response_types": {name: counts[name] for name in sorted(counts)},
    }


def _of_parameters(classifier: MachineClassifier, table: pa.Table, source: str) -> dict[str, Any]:
    lacking = [name for name in classifier.fields if name not in table.column_names]
    if lacking:
        raise DatasetError(
            f"{source} has no column {lacking[0]}; needed: {', '.join(classifier.fields)} in SI units, "
            f"or {RECORDS} with lists of peaks"
        )
    values = np.column_stack([_numbers(table, name, source) for name in classifier.fields])
    answers = classifier.classify_table(values)
    foreign = np.zeros(len(table), dtype=bool)
    for name, value in classifier.card["base"].items():
        if name not in classifier.fields and name in table.column_names:
            foreign |= np.array([entry != value for entry in table.column(name).to_pylist()], dtype=bool)
    answers["abstained"] = answers["abstained"] | foreign
    answers["reason"] = np.where(foreign, "differs from the classifier's training machine", answers["reason"])
    for name in ("response_type", "nature"):
        answers[name] = np.where(foreign, None, answers[name])
    return answers


def _numbers(table: pa.Table, name: str, source: str) -> Any:
    try:
        return table.column(name).cast(pa.float64()).to_numpy(zero_copy_only=False)
    except pa.ArrowException as error:
        raise DatasetError(f"{source}, column {name}: {error}; allowed: numbers") from error


def _of_records(classifier: MachineClassifier, table: pa.Table) -> dict[str, Any]:
    records = [np.asarray(record or (), dtype=float)[-MAX_CYCLES:] for record in table.column(RECORDS).to_pylist()]
    peaks = np.full((len(records), MAX_CYCLES), np.nan)
    for row, record in enumerate(records):
        peaks[row, : len(record)] = record
    errors = None
    if SENSOR_ERROR in table.column_names:
        errors = table.column(SENSOR_ERROR).cast(pa.float64()).to_numpy(zero_copy_only=False)
    return classifier.classify_records(peaks, sensor_error=errors)
