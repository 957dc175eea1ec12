"""Ten million cycles fit into the memory of a small computer."""

import re
import tracemalloc
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app

MACHINE = Path(__file__).parents[2] / "docs" / "machines" / "moon-shaw-1983.toml"
CYCLES = 20_000
WITHIN = 250.0
"""Bytes a cycle: 2.5 GB for the ten million that the command takes. The record itself has 128."""


@pytest.mark.parametrize("more", [(), ("--out", "p.csv"), ("--out", "p.parquet")])
def test_a_cycle_takes_few_bytes(more, tmp_path, monkeypatch):
    """Peak of what Python and numpy hold, beyond that of a run of ten cycles; the answer is that of the library."""
    monkeypatch.chdir(tmp_path)

    def peak(cycles):
        words = [
            "simulate",
            str(MACHINE),
            "--cycles",
            str(cycles),
            *more,
            *(("--overwrite",) if more[:1] == ("--out",) else ()),
        ]
        tracemalloc.start()
        done = CliRunner().invoke(app, words)
        highest = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        assert done.exception is None, done.output
        return highest

    few = peak(10)
    assert (peak(CYCLES) - few) / CYCLES < WITHIN
    if "p.parquet" in more:
        record = chaosgym.simulate(chaosgym.read_machine(MACHINE), CYCLES)
        table = pq.read_table("p.parquet")
        for place, side in enumerate(record.machine.surfaces):
            np.testing.assert_array_equal(table[f"{side} [N]"], record.peak_force[:, place])


def test_a_long_run_tells_how_far_it_is(monkeypatch, capfd):
    """A bar of all cycles, transient and recorded, which ends full."""
    monkeypatch.setattr("chaosgym.simulation.run.PATIENCE", 0.0)
    chaosgym.simulate(chaosgym.read_machine(MACHINE), CYCLES, transient=CYCLES, progress=True)
    told = re.findall(r"(\d+)/40000", capfd.readouterr().err)
    assert len(told) > 1
    assert [int(one) for one in told] == sorted(map(int, told))
    assert int(told[-1]) == 2 * CYCLES
