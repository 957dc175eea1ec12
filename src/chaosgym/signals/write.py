"""Columns for the next tool, as CSV or Parquet by the end of the name, whole or not at all."""

from collections.abc import Mapping
from pathlib import Path

import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
from numpy.typing import ArrayLike

from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically


def check_target(path: str | Path, overwrite: bool) -> None:
    """Check that a table may be written before it is computed.

    Raises
    ------
    DatasetError
        If the name ends in neither .csv nor .parquet, the folder is missing, or the file exists.
    """
    target = Path(path)
    if target.suffix not in (".csv", ".parquet"):
        raise DatasetError(f"{path} ends in {target.suffix or 'nothing'}; allowed: .csv, .parquet")
    if not target.absolute().parent.is_dir():
        raise DatasetError(f"{target.absolute().parent} is no folder; choose another file")
    if target.exists() and not overwrite:
        raise DatasetError(f"{path} exists; use --overwrite or another name")


def write_table(columns: Mapping[str, ArrayLike], path: str | Path) -> None:
    """Write columns by name as CSV or Parquet."""
    table = pa.table({name: pa.array(values) for name, values in columns.items()})
    if Path(path).suffix == ".csv":
        options = pyarrow.csv.WriteOptions(quoting_style="none")
        write_atomically(Path(path), lambda target: pyarrow.csv.write_csv(table, target, write_options=options))
    else:
        write_atomically(Path(path), lambda target: pq.write_table(table, target))
