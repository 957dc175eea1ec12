"""A dataset can be checked against the installation that reads it; so are the ones that are shipped."""

import json
from dataclasses import replace
from pathlib import Path

import pyarrow as pa
import pytest

from benchmarks.sweeps.check import check_rows
from benchmarks.sweeps.regions import region_types
from chaosgym.errors import DatasetError
from chaosgym.sweeps import Axis, SweepPlan, read_sweep, run_sweep
from tests.plain_modes import PLAIN_BEAM

SHIPPED = Path(__file__).parents[2] / "datasets"


@pytest.fixture(scope="module")
def sweep(tmp_path_factory):
    """Six beams, labelled here and now."""
    axes = (Axis("excitation_frequency", 18.0, 29.0, 3), Axis("clearance", 5e-5, 1e-4, 2))
    return run_sweep(SweepPlan(PLAIN_BEAM, axes, budget=100, signals=0.5), tmp_path_factory.mktemp("six") / "b")


def with_column(sweep, name, values):
    """The same sweep with another column."""
    place = sweep.table.column_names.index(name)
    table = sweep.table.set_column(
        place, sweep.table.schema.field(place), pa.array(values, sweep.table.field(name).type)
    )
    return replace(sweep, table=table)


def test_rows_computed_here_are_identical(sweep):
    """Same platform, same bits, signals included."""
    found = check_rows(sweep, 6)
    assert (found.identical, found.same_nature, found.same_platform, found.sound) == (6, 6, True, True)


def test_one_changed_bit_is_found(sweep):
    """On the same platform a single differing number makes the dataset unsound."""
    peaks = sweep.column("peak_force_mean")
    found = check_rows(with_column(sweep, "peak_force_mean", [*peaks[:5], peaks[5] * (1.0 + 1e-6)]), 6)
    assert (found.identical, found.same_nature, found.sound) == (5, 6, False)


def test_another_platform_is_held_to_the_natures(sweep):
    """A wrong nature in six is too many; a changed bit is not."""
    made = [{**one, "processor": "abacus"} for one in sweep.provenance]
    metadata = sweep.table.schema.metadata | {b"provenance": json.dumps(made).encode()}
    elsewhere = replace(sweep, table=sweep.table.replace_schema_metadata(metadata))
    peaks = elsewhere.column("peak_force_mean")
    assert check_rows(with_column(elsewhere, "peak_force_mean", [*peaks[:5], peaks[5] * (1.0 + 1e-6)]), 6).sound
    wrong = ["quasiperiodic", *elsewhere.column("nature")[1:]]
    assert not check_rows(with_column(elsewhere, "nature", wrong), 6).sound


def test_more_rows_than_there_are_is_an_error(sweep):
    """It says how many there are."""
    with pytest.raises(DatasetError, match="allowed: 1 to 6"):
        check_rows(sweep, 7)


@pytest.mark.parametrize("name", sorted(folder.name for folder in SHIPPED.iterdir() if folder.is_dir()))
def test_shipped_rows_are_what_is_computed_here(name):
    """Fifty random rows of each shipped sample: bit for bit where it was made, elsewhere their natures."""
    found = check_rows(read_sweep(SHIPPED / name / "sample"), 50, seed=1)
    assert found.sound, f"{found}"


def test_types_of_regions_contain_those_of_crosses(tmp_path):
    """Five points of a region can't show more than 25: no type falls where more points are judged."""
    axes = (Axis("excitation_frequency", 17.0, 29.0), Axis("clearance", 1.2e-4, 1.4e-4))
    crosses = run_sweep(SweepPlan(PLAIN_BEAM, axes, "crosses", size=6, budget=100), tmp_path / "c")
    found = region_types(crosses, 6)
    assert found.points == 6
    order = ("I", "II", "III", "undetermined")
    assert all(order.index(region) >= order.index(cross) for cross, region in found.pairs)
    assert found.moved == sum(count for (cross, region), count in found.pairs.items() if cross != region)
    assert 0 <= found.periodic <= found.irregular
    assert found.lines()[0].startswith("6 centres, ")


def test_only_crosses_are_compared_with_regions(sweep):
    """A grid has no crosses, and that is said."""
    with pytest.raises(DatasetError, match="no crosses"):
        region_types(sweep, 3)
