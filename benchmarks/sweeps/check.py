"""Rows of a dataset labelled again: does it still say what this installation computes?"""

import random

import pyarrow as pa
from tqdm import tqdm

from benchmarks.sweeps.agreement import Agreement, agreement
from chaosgym.errors import DatasetError
from chaosgym.sweeps.dataset import LabelledSweep
from chaosgym.sweeps.label import provenance
from chaosgym.sweeps.run import relabel


def check_rows(sweep: LabelledSweep, points: int, *, seed: int | None = None, progress: bool = False) -> Agreement:
    """Label some rows of a sweep again.

    Parameters
    ----------
    sweep
        All columns of it.
    points
        Number of rows.
    seed
        Of the rows; different ones at every call if there is none.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If there are not as many rows.
    """
    if not 1 <= points <= len(sweep.table):
        raise DatasetError(f"points = {points} is out of range; allowed: 1 to {len(sweep.table)}, the rows")
    rows = sorted(random.Random(seed).sample(range(len(sweep.table)), points))
    again = [relabel(sweep, [row]) for row in tqdm(rows, desc="check", unit="row", disable=not progress)]
    return agreement(sweep.table.take(rows), pa.concat_tables(again), sweep.provenance, [provenance()])
