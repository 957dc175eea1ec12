"""Rows of a sweep that train the classifier, and rows that judge it: whole machines, or blocks of a plane, apart."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DatasetError
from chaosgym.machines import MACHINES, Machine
from chaosgym.sweeps import LabelledSweep
from chaosgym.sweeps.dataset import WINDOW

NATURES = ("periodic", "chaotic")
"""Natures that are learned; quasiperiodic responses are too rare."""

LEAST_ROWS = 50
"""Rows that a sweep must have to be learned."""

BLOCKS = 12
"""Without machines, the held-out rows are rectangles of a BLOCKS x BLOCKS board over the first two fields."""

HELD_OUT, CALIBRATION = 0.25, 0.15
"""Shares of the blocks that judge and that calibrate."""


@dataclass(frozen=True)
class Examples:
    """Labelled responses of one machine.

    Attributes
    ----------
    machine, fields
        Base machine and varied fields.
    values : (n, n_fields)
        Of the fields in SI units.
    nature : (n,) of str
        Labels.
    groups : (n,)
        Machine or block of each row: never on both sides of the split.
    calibration, test : (n,)
        Rows that calibrate and rows that judge; the others train.
    start : (n, 64, 3)
        First cycles from rest: peak force [N], stroboscopic displacement and velocity; NaN where not kept.
    settled : (n, 64)
        Peak force [N] of settled cycles; NaN where not kept.
    left_out
        Rows of the sweep that are not used.
    ranges
        Lowest and highest value of each field, (n_fields,) each: those of the sweep's axes and of its rows.
    """

    machine: Machine
    fields: tuple[str, ...]
    values: Array
    nature: NDArray[np.str_]
    groups: NDArray[np.int64]
    calibration: NDArray[np.bool_]
    test: NDArray[np.bool_]
    start: Array
    settled: Array
    left_out: int
    ranges: tuple[Array, Array]

    @property
    def has_signals(self) -> NDArray[np.bool_]:
        """Rows (n,) whose signals are kept."""
        return np.asarray(~np.isnan(self.settled[:, 0]) & ~np.isnan(self.start[:, 0, 0]))


def examples_of(sweep: LabelledSweep, seed: int) -> Examples:
    """Take the rows of a sweep that have a nature which is learned.

    Raises
    ------
    DatasetError
        If fewer than 50 rows are usable, or training or test rows hold one nature only.
    """
    fields = tuple(axis["field"] for axis in sweep.settings["axes"])
    lacking = [name for name in (*fields, "nature") if name not in sweep.table.column_names]
    if lacking:
        raise DatasetError(f"the sweep has no column {lacking[0]}; is it one of `chaosgym sweep`?")
    natures = np.array([str(value) for value in sweep.column("nature")])
    usable = np.isin(natures, NATURES)
    if usable.sum() < LEAST_ROWS:
        raise DatasetError(f"only {usable.sum()} rows have a nature; at least {LEAST_ROWS} are needed to train")
    values = np.column_stack([sweep.column(name)[usable].astype(float) for name in fields])
    groups, calibration, test = _split(sweep, usable, values, seed)
    for name, rows in (("training", ~(test | calibration)), ("held-out", test)):
        if len(np.unique(natures[usable][rows])) < 2:
            raise DatasetError(f"the {name} rows hold one nature only; sweep a wider range or more points")
    machine: Any = MACHINES[sweep.settings["machine"]]
    axes = sweep.settings["axes"]
    ends = zip(axes, values.min(axis=0), values.max(axis=0), strict=True)
    ranges = np.array([(min(axis["low"], low), max(axis["high"], high)) for axis, low, high in ends])
    names = ("peak_force", "displacement", "velocity")
    return Examples(
        machine=machine(**sweep.settings["base"]),
        fields=fields,
        values=values,
        nature=natures[usable],
        groups=groups,
        calibration=calibration,
        test=test,
        start=np.stack([_signal(sweep, f"start_{name}", usable) for name in names], axis=2),
        settled=_signal(sweep, "settled_peak_force", usable),
        left_out=int(np.sum(~usable)),
        ranges=(ranges[:, 0], ranges[:, 1]),
    )


def _signal(sweep: LabelledSweep, name: str, rows: NDArray[np.bool_]) -> Array:
    """Signal (n, cycles) of some rows, NaN where there is none."""
    out = np.full((len(rows), WINDOW), np.nan)
    if name in sweep.table.column_names:
        column = sweep.table.column(name).combine_chunks()
        kept = column.is_valid().to_numpy(zero_copy_only=False)
        out[kept] = column.drop_null().flatten().to_numpy(zero_copy_only=False).reshape(-1, WINDOW)
    return out[rows]


def _split(
    sweep: LabelledSweep, usable: NDArray[np.bool_], values: Array, seed: int
) -> tuple[NDArray[np.int64], NDArray[np.bool_], NDArray[np.bool_]]:
    """Groups of the rows, which calibrate, which judge: the sweep's split by machine, or else blocks of the plane."""
    if "split" in sweep.table.column_names:
        parts = np.array([str(part) for part in sweep.column("split")])[usable]
        return sweep.column("machine")[usable].astype(np.int64), parts == "validation", parts == "test"
    board = _blocks(values)
    drawn = np.random.default_rng(seed).permutation(np.unique(board))
    judges = max(1, round(HELD_OUT * len(drawn)))
    calibrates = drawn[judges : judges + round(CALIBRATION * len(drawn))]
    return board, np.isin(board, calibrates), np.isin(board, drawn[:judges])


def _blocks(values: Array) -> NDArray[np.int64]:
    """Number of the block of each row, (n,)."""
    board = np.zeros(len(values), dtype=np.int64)
    for column in values[:, :2].T:
        scale = np.log(column) if column.min() > 0.0 else column
        edges = np.linspace(scale.min(), scale.max(), BLOCKS + 1)[1:-1]
        board = board * BLOCKS + np.digitize(scale, edges)
    return board
