"""Which rows of a sweep train the classifier, and which judge it? Whole machines, or whole blocks of a plane, apart.

A random split would put near-copies of every test point into the training set.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.records import WINDOWS, signals_of
from chaosgym.errors import DatasetError
from chaosgym.machines import MACHINES, Machine
from chaosgym.sweeps import LabelledSweep

Array = NDArray[np.float64]

TYPES = ("I", "II", "III")
LEAST_ROWS, RARE = 50, 0.01
"""Rows that a sweep must have to be learned, and share of them below which a nature is left out as too rare."""

LARGE, THIRD = 50_000, 1.0 / 3.0
"""Rows beyond which a lattice is thinned to train from parameters, and what is kept of it."""

BLOCKS = 12
"""Without machines, the held-out rows are rectangles of a BLOCKS x BLOCKS board over the first two fields."""

HELD_OUT, CALIBRATION = 0.25, 0.15
"""Shares of the blocks that judge and that calibrate."""

AWAY_EXPONENT, AWAY_SPREAD = 0.1, 6.0
"""Away from boundaries: exponent beyond 0.1 a cycle, and if chaotic a spread of the peaks above 6 N."""


@dataclass(frozen=True)
class Examples:
    """Labelled responses of one machine.

    Attributes
    ----------
    machine, fields
        Base machine and varied fields.
    values : (n, n_fields)
        Of the fields in SI units.
    response_type, nature : (n,) of str
        Labels.
    period : (n,)
        0 where there is none.
    groups : (n,)
        Machine or block of each row: never on both sides of the split.
    calibration, test : (n,)
        Rows that calibrate and rows that judge; the others train.
    clear : (n,)
        Rows away from boundaries.
    signals
        By window, (peaks, section, rows); empty if the sweep has none.
    left_out
        Rows of the sweep that are not used.
    ranges
        Lowest and highest value of each field, (n_fields,) each: those of the sweep's axes and of its rows.
    """

    machine: Machine
    fields: tuple[str, ...]
    values: Array
    response_type: NDArray[np.str_]
    nature: NDArray[np.str_]
    period: NDArray[np.int64]
    groups: NDArray[np.int64]
    calibration: NDArray[np.bool_]
    test: NDArray[np.bool_]
    clear: NDArray[np.bool_]
    signals: dict[str, tuple[Array, Array, NDArray[np.int64]]]
    left_out: int
    ranges: tuple[Array, Array]

    @property
    def training(self) -> NDArray[np.bool_]:
        """Rows that train (n,)."""
        return np.asarray(~(self.calibration | self.test))

    def signals_where(self, chosen: NDArray[np.bool_]) -> dict[str, tuple[Array, Array, NDArray[np.int64]]]:
        """Signals of the rows that are chosen (n,)."""
        return {
            window: tuple(part[chosen[rows]] for part in (peaks, section, rows))  # type: ignore[misc]
            for window, (peaks, section, rows) in self.signals.items()
        }


def thinned(sweep: LabelledSweep, seed: int) -> LabelledSweep:
    """Every third row of a large sweep, by chance, and all that judge: neighbours on a lattice are near-copies."""
    if len(sweep.table) <= LARGE or "split" not in sweep.table.column_names:
        return sweep
    judges = sweep.column("split").astype(str) == "test"
    kept = (np.random.default_rng(seed).random(len(judges)) < THIRD) | judges
    return LabelledSweep(sweep.table.filter(kept), sweep.settings)


def examples_of(sweep: LabelledSweep, seed: int) -> Examples:
    """Take the usable rows of a sweep: with a response type, and a nature that is not too rare to learn.

    Raises
    ------
    DatasetError
        If fewer than 50 rows are usable, or training or test rows hold one response type only.
    """
    fields = tuple(span["field"] for span in (*sweep.settings["axes"], *sweep.settings.get("patches", ())))
    lacking = [name for name in (*fields, "response_type", "nature", "period") if name not in sweep.table.column_names]
    if lacking:
        raise DatasetError(f"the sweep has no column {lacking[0]}; is it one of `chaosgym sweep`?")
    types = np.array([str(value) for value in sweep.column("response_type")])
    natures = np.array([str(value) for value in sweep.column("nature")])
    usable = np.isin(types, TYPES)
    for nature in np.unique(natures[usable]):
        if np.mean(natures[usable] == nature) < RARE:
            usable &= natures != nature
    if usable.sum() < LEAST_ROWS:
        raise DatasetError(f"only {usable.sum()} rows have a response type; at least {LEAST_ROWS} are needed to train")
    values = np.column_stack([sweep.column(name)[usable].astype(float) for name in fields])
    groups, calibration, test = _split(sweep, usable, values, seed)
    for name, rows in (("training", ~(test | calibration)), ("held-out", test)):
        if len(np.unique(types[usable][rows])) < 2:
            raise DatasetError(f"the {name} rows hold one response type only; sweep a wider range or more points")
    machine: Any = MACHINES[sweep.settings["machine"]]
    place = np.cumsum(usable) - 1
    signals: dict[str, tuple[Array, Array, NDArray[np.int64]]] = {}
    if f"{WINDOWS[0]}_peak_force" in sweep.table.column_names:
        for window in WINDOWS:
            peaks, section, at = signals_of(sweep.table, window)
            kept = usable[at]
            signals[window] = (peaks[kept], section[kept], place[at[kept]])
    return Examples(
        machine=machine(**sweep.settings["base"]),
        fields=fields,
        values=values,
        response_type=types[usable],
        nature=natures[usable],
        period=np.nan_to_num(sweep.column("period")[usable].astype(float)).astype(np.int64),
        groups=groups,
        calibration=calibration,
        test=test,
        clear=_clear(sweep, usable, natures[usable]),
        signals=signals,
        left_out=int(np.sum(~usable)),
        ranges=_ranges(sweep.settings, values),
    )


def _ranges(settings: dict[str, Any], values: Array) -> tuple[Array, Array]:
    spans = (*settings["axes"], *settings.get("patches", ()))
    low = [min(span.get("low", seen), seen) for span, seen in zip(spans, values.min(axis=0), strict=True)]
    high = [max(span.get("high", seen), seen) for span, seen in zip(spans, values.max(axis=0), strict=True)]
    return np.array(low, dtype=float), np.array(high, dtype=float)


def _clear(sweep: LabelledSweep, usable: NDArray[np.bool_], nature: NDArray[np.str_]) -> NDArray[np.bool_]:
    if "exponent" not in sweep.table.column_names:
        return np.ones(len(nature), dtype=bool)
    exponent, low, high = (
        sweep.column(name)[usable].astype(float) for name in ("exponent", "peak_force_min", "peak_force_max")
    )
    return np.asarray((np.abs(exponent) > AWAY_EXPONENT) & ((nature == "periodic") | (high - low > AWAY_SPREAD)))


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
