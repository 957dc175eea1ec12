"""A sweep has the columns of its schema, or says which one it lacks, whoever wrote its file."""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

from chaosgym.cli import app
from chaosgym.errors import DatasetError
from chaosgym.sweeps import read_sweep
from chaosgym.sweeps.dataset import LATER

SAMPLES = Path(__file__).parents[2] / "datasets"
TABLES = {machine: pq.read_table(SAMPLES / machine / "sample" / "sweep.parquet") for machine in ("impact-beam",)}
COLUMNS = [(machine, name) for machine, table in TABLES.items() for name in table.column_names]


def written(table, folder):
    """A folder whose sweep is a table."""
    pq.write_table(table.slice(0, 2), folder / "sweep.parquet")
    return folder


def test_the_shipped_sample_is_read_from_two_of_its_rows(tmp_path):
    """What the tests below damage is whole."""
    table = TABLES["impact-beam"]
    assert read_sweep(written(table, tmp_path)).table.column_names == table.column_names


@pytest.mark.parametrize(("machine", "name"), COLUMNS)
def test_a_column_that_is_lost_is_named(machine, name, tmp_path):
    """Left out, twice, of another type, or without its unit: one line that names the column."""
    table = TABLES[machine]
    place = table.column_names.index(name)
    texts = pa.array([b"?"] * len(table), pa.binary())
    for damaged in (
        *([] if name in LATER else [table.drop_columns([name])]),  # sweeps of former versions lack these
        table.append_column(table.schema.field(name), table.column(name)),
        table.set_column(place, table.schema.field(name).with_type(pa.binary()), texts),
        table.set_column(place, table.schema.field(name).remove_metadata(), table.column(name)),
    ):
        with pytest.raises(DatasetError, match=f"column '{name}'") as error:
            read_sweep(written(damaged, tmp_path))
        assert "\n" not in str(error.value)


def test_a_column_that_is_asked_for_and_not_there_is_named(tmp_path):
    """Parquet readers leave it out silently."""
    folder = written(TABLES["impact-beam"], tmp_path)
    assert read_sweep(folder, ["nature"]).table.column_names == ["nature"]
    with pytest.raises(DatasetError, match="it has no column 'natur'"):
        read_sweep(folder, ["nature", "natur"])


@pytest.mark.parametrize("words", [["dataset", "info", "FOLDER"], ["dataset", "map", "FOLDER", "--out", "map.png"]])
def test_commands_say_which_column_is_lost(words, tmp_path):
    """Exit 2 and one line."""
    folder = written(TABLES["impact-beam"].drop_columns(["nature"]), tmp_path)
    run = CliRunner().invoke(app, [str(folder) if word == "FOLDER" else word for word in words])
    assert isinstance(run.exception, DatasetError)
    assert "has no column 'nature'" in str(run.exception)
