"""A dataset is read by others: pandas, polars and DuckDB, without chaosgym."""

import json

import duckdb
import numpy as np
import pandas
import polars
import pyarrow.parquet as pq
import pytest

from chaosgym.sweeps import Axis, SweepPlan, run_sweep
from tests.plain_modes import PLAIN_BEAM

PLAN = SweepPlan(
    PLAIN_BEAM,
    (Axis("length", 0.27, 0.28), Axis("excitation_frequency", 8.0, 12.0), Axis("clearance", 1e-4, 2e-4)),
    "crosses",
    5,
    0,
    100,
    0.5,
)


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """A small dataset: its file, and its rows as chaosgym sees them."""
    folder = tmp_path_factory.mktemp("readers") / "beam"
    return str(folder / "sweep.parquet"), run_sweep(PLAN, folder)


def test_pandas_reads_it(written):
    """Every row and column, words as words, signals as sequences."""
    file, sweep = written
    frame = pandas.read_parquet(file)
    assert list(frame.columns) == sweep.table.column_names
    assert frame["nature"].tolist() == sweep.column("nature").tolist()
    assert len(frame["settled_peak_force"].dropna().iloc[0]) == 64


def test_polars_reads_it(written):
    """Signals are lists of 64 numbers; null where they are not kept."""
    file, sweep = written
    frame = polars.read_parquet(file)
    assert frame["start_velocity"].dtype == polars.List(polars.Float32)
    kept = np.stack(frame["start_velocity"].drop_nulls().to_list())
    assert kept.shape == (len(PLAN) - sweep.table.column("start_velocity").null_count, 64)
    assert frame.group_by("split").len()["len"].sum() == len(PLAN)
    np.testing.assert_array_equal(frame["clearance"], sweep.column("clearance"))


def test_duckdb_reads_it(written):
    """One line of SQL counts the classes."""
    file, sweep = written
    with duckdb.connect() as connection:
        rows = connection.execute(f"select nature, count(*) from '{file}' group by nature").fetchall()
        lengths = connection.execute(f"select distinct len(settled_peak_force) from '{file}'").fetchall()
    assert dict(rows) == {name: list(sweep.column("nature")).count(name) for name, _ in rows}
    assert {(64,)} <= set(lengths) <= {(64,), (None,)}


def test_schema_says_units_definitions_settings_and_provenance(written):
    """All of it stands in the file's own metadata, as JSON."""
    file, _ = written
    schema = pq.read_schema(file)
    settings = json.loads(schema.metadata[b"chaosgym"])
    assert (settings["machine"], settings["size"], settings["budget"]) == ("impact-beam", 5, 100)
    assert schema.field("settled_peak_force").metadata[b"unit"] == b"N"
    assert "200 to 263" in json.loads(schema.metadata[b"definitions"])["settled_peak_force"]
    made = json.loads(schema.metadata[b"provenance"])
    assert len(made) == 1
    assert set(made[0]) >= {"commit", "numba", "processor", "chaosgym"}
    assert pq.ParquetFile(file).num_row_groups == len(PLAN.chunks())
