"""The shipped datasets: complete, small, and made again row for row."""

from pathlib import Path

import numpy as np
import pytest

from chaosgym.sweeps import read_sweep, relabel
from chaosgym.sweeps.provenance import PACKAGES, provenance

DATASETS = Path(__file__).parents[2] / "datasets"
FROM_NEIGHBOURS = ("response_type", "type_neighbours")
SAME_BYTES = (*PACKAGES, "python", "platform", "processor")
ROWS = 50


@pytest.mark.parametrize(
    ("name", "points", "signals", "full_types"),
    [("impact-beam", 100_000, 19_900, 1_000), ("slider-crank", 8_000, 2_000, 200)],
)
def test_shipped_datasets_hold_what_their_cards_promise(name, points, signals, full_types):
    """Enough points, signals and full-window types; parts of the split share no machine."""
    sweep = read_sweep(DATASETS / name)
    table = sweep.table
    assert len(table) >= points
    assert len(table) - table.column("settled_peak_force").null_count >= signals
    assert len(table) - table.column("full_response_type").null_count >= full_types
    parts, machines = sweep.column("split"), sweep.column("machine")
    owners = [set(machines[parts == part]) for part in ("train", "validation", "test")]
    assert sum(len(owner) for owner in owners) == len(set(machines))
    assert min(len(owner) for owner in owners) >= 0.1 * len(set(machines))
    assert (DATASETS / name / "CARD.md").is_file()


def test_shipped_datasets_are_small():
    """All of them together take less than 60 MB."""
    assert sum(path.stat().st_size for path in DATASETS.rglob("*") if path.is_file()) < 60e6


@pytest.mark.parametrize("name", ["impact-beam", pytest.param("slider-crank", marks=pytest.mark.slow)])
def test_random_rows_are_made_again(name):
    """50 rows: bit for bit with the packages and processor that made them, else 48 with the same nature."""
    sweep = read_sweep(DATASETS / name)
    rows = np.sort(np.random.default_rng(11).choice(len(sweep.table), ROWS, replace=False))
    again, kept = relabel(sweep, rows.tolist()), sweep.table.take(rows)
    made = sweep.provenance
    if len(made) == 1 and all(made[0][key] == provenance()[key] for key in SAME_BYTES):
        names = [column for column in kept.column_names if column not in FROM_NEIGHBOURS]
        differing = [column for column in names if again.column(column).to_pylist() != kept.column(column).to_pylist()]
        assert differing == []
    same = np.array(again.column("nature").to_pylist()) == np.array(kept.column("nature").to_pylist())
    assert same.sum() >= ROWS - 2
