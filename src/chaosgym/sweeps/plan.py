"""The plan of a sweep: a base machine, axes of parameters, and a rule that places points on them.

    grid      all combinations of the axes
    random    points uniform in the axes' scales
    sobol     a scrambled Sobol sequence over the axes
    crosses   independent machines, uniform over the axes, which hold speed and clearance; each is five points: the
              centre, and one tolerance below and above it in speed and in clearance: what its response type rests on

On a grid the neighbourhoods of response types share their points. Points are computed by the row, never all at once: a
plan may have a billion.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from math import prod
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.diagnosis import default_tolerances
from chaosgym.diagnosis.attractors import STARTS
from chaosgym.diagnosis.response_type import check_initial_states
from chaosgym.diagnosis.type_rule import CROSS
from chaosgym.errors import ParameterError
from chaosgym.machines import MACHINES, Machine
from chaosgym.machines.parameters import USUAL, check_parameter, parameters_of, suggestion, with_settings
from chaosgym.numbers import MOST_SEED, number, whole
from chaosgym.series.verdict import DEFINITIONS, Definition
from chaosgym.sweeps.axes import AXIS_FORM, Axis

Sampling = Literal["grid", "random", "sobol", "crosses"]

DEFAULT_COUNTS = (27, 10)
"""Points of a grid over speed and clearance if no axis is given."""

DEFAULT_BUDGET = 400
"""Cycles that the diagnosis of a point may take."""

CHUNK_SIZE = 256
"""Points that are computed and kept together; of crosses the whole ones among them."""

PARTS, SMALLEST_CHUNK = 64, 4
"""Where each point has a type by runs of its own: chunks of a plan, which threads share, and fewest points of one."""

SPLIT = (("train", 0.70), ("validation", 0.15), ("test", 0.15))
"""Shares of the machines of crosses."""

GOLDEN, SILVER = 0.6180339887498949, 0.41421356237309515
"""Multiples of an irrational number spread evenly: which rows have signals, and which a type over the full window."""


def spread(size: int) -> list[int]:
    """Numbers below ``size`` in an order of which each beginning is spread over all of them.

    Examples
    --------
    >>> from chaosgym.sweeps.plan import spread
    >>> spread(8)
    [0, 5, 2, 7, 4, 1, 6, 3]
    """
    order: list[int] = np.argsort(np.argsort(np.arange(size) * GOLDEN % 1.0)).tolist()
    return order


@dataclass(frozen=True)
class SweepPlan:
    """Points of a sweep and how each is labelled.

    Attributes
    ----------
    machine : Machine
        Base machine; fields that are neither axis nor patch keep its values.
    axes : tuple of Axis
        The first axis varies slowest on a grid.
    sampling
        "grid", "random", "sobol" or "crosses"; see the module.
    size
        Number of random or Sobol points, or of crosses; ignored on a grid.
    seed
        Of the random or Sobol points, and of the split of crosses.
    budget
        Cycles from rest that the diagnosis of a point may take.
    signals
        Share of the points whose signals are kept (``label.WINDOWS``).
    full_types
        Share of the points whose response type is judged over all tolerances too, by runs of its own; only points with
        all their neighbours where these are points of the sweep.
    initial_states
        Of these types, as of ``response_type``; 3 in plans that were written without it.
    definition
        Of natures and types: "settled", or "thesis", which plans that were written without it have.

    Examples
    --------
    >>> speeds = chaosgym.Axis("excitation_frequency", 10.0, 20.0, 11)
    >>> plan = chaosgym.SweepPlan(chaosgym.ImpactBeam(), (speeds,))
    >>> len(plan)
    11
    """

    machine: Machine
    axes: tuple[Axis, ...]
    sampling: Sampling = "grid"
    size: int = 0
    seed: int = 0
    budget: int = DEFAULT_BUDGET
    signals: float = 0.0
    full_types: float = 0.0
    initial_states: int = STARTS
    definition: Definition = "settled"

    def __post_init__(self) -> None:
        self._check_fields()
        if self.sampling not in get_args(Sampling):
            raise ParameterError(f"sampling = {self.sampling!r} is unknown; allowed: {', '.join(get_args(Sampling))}")
        for axis in self.axes:
            if (self.sampling == "grid") == (axis.count is None):
                rule = "needs a COUNT on a grid" if axis.count is None else "takes no COUNT unless on a grid"
                raise ParameterError(f"axis {axis.field} {rule}: {AXIS_FORM}")
        if self.sampling == "crosses":
            self._check_crosses()
        whole("size", self.size, 0 if self.sampling == "grid" else 1)
        whole("seed", self.seed, 0, MOST_SEED)
        whole("budget", self.budget, 100)
        check_initial_states(self.initial_states)
        if self.definition not in DEFINITIONS:
            raise ParameterError(f"definition = {self.definition!r} is unknown; allowed: {', '.join(DEFINITIONS)}")
        for name in ("signals", "full_types"):
            number(name, getattr(self, name), 0.0, 1.0)

    def _check_fields(self) -> None:
        known = parameters_of(self.machine)
        names = self.fields
        if not names or len(set(names)) != len(names):
            raise ParameterError(f"axes {', '.join(names) or '(none)'}: give at least one, each field once")
        for axis in self.axes:
            if axis.field not in known:
                raise ParameterError(f"axis {axis.field!r} is no field{suggestion(axis.field, [*USUAL, *known])}")
            if known[axis.field].choices:
                raise ParameterError(f"axis {axis.field!r} is a choice and can't be swept; use --set")
            for end in (axis.low, axis.high):
                check_parameter(self.machine, axis.field, int(end) if self._is_whole(axis.field) else end)
            if self.machine.initial_state and axis.field in self.machine.model_fields:
                raise ParameterError(f"axis {axis.field!r} changes the model; an initial state belongs to one")

    def _check_crosses(self) -> None:
        """Refuse crosses without speed and clearance, or whose arms leave what is allowed."""
        tolerances = default_tolerances(self.machine)
        for field in self._cross_fields:
            ends = {axis.field: (axis.low, axis.high) for axis in self.axes}.get(field)
            if ends is None:
                raise ParameterError(f"crosses need an axis of {field}; they lie in speed and clearance")
            for end, side in zip(ends, (-1.0, 1.0), strict=True):
                check_parameter(self.machine, field, tolerances[field].at(end, side))

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    @property
    def fields(self) -> tuple[str, ...]:
        """Every field that is varied."""
        return tuple(axis.field for axis in self.axes)

    @property
    def _cross_fields(self) -> tuple[str, str]:
        return self.machine.speed_field, self.machine.clearance_field

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, (size,), or (crosses, their points)."""
        if self.sampling == "grid":
            return tuple(axis.count or 0 for axis in self.axes)
        return (self.size, len(CROSS)) if self.sampling == "crosses" else (self.size,)

    @property
    def chunk_size(self) -> int:
        """Points that are computed and kept together."""
        together = len(CROSS) if self.sampling == "crosses" else 1
        size = max(SMALLEST_CHUNK, len(self) // PARTS) if self.full_types == 1.0 else CHUNK_SIZE
        return max(together, min(size, CHUNK_SIZE) // together * together)

    def chunks(self) -> list[range]:
        """Rows of every chunk."""
        size = self.chunk_size
        return [range(start, min(start + size, len(self))) for start in range(0, len(self), size)]

    def points(self, rows: range | None = None) -> dict[str, Array]:
        """Values of every varied field at some rows, all by default: {field: (n_rows,)}."""
        rows = range(len(self)) if rows is None else rows
        index = np.arange(rows.start, rows.stop)
        if self.sampling == "grid":
            at = np.unravel_index(index, self.shape)
            shares = [np.linspace(0.0, 1.0, axis.count or 0)[i] for axis, i in zip(self.axes, at, strict=True)]
            columns = self._axis_values(shares)
        elif self.sampling == "crosses":
            machine, place = np.divmod(index, len(CROSS))
            first = rows.start // len(CROSS)
            columns = self._axis_values(list(self._drawn(first, -(-rows.stop // len(CROSS)))[machine - first].T))
            tolerances = default_tolerances(self.machine)
            for field, share in zip(self._cross_fields, np.array(CROSS, dtype=float)[place].T, strict=True):
                columns[field] = np.array(
                    [tolerances[field].at(*pair) for pair in zip(columns[field], share, strict=True)]
                )
        else:
            columns = self._axis_values(list(self._drawn(rows.start, rows.stop).T))
        return {name: np.round(column) if self._is_whole(name) else column for name, column in columns.items()}

    def sample(self, count: int) -> list[Machine]:
        """Machines of a few points, spread evenly over the rows."""
        rows = sorted(set(np.linspace(0, len(self) - 1, count).astype(int).tolist()))
        at = [self.points(range(row, row + 1)) for row in rows]
        return [with_settings(self.machine, {name: column[0] for name, column in point.items()}) for point in at]

    def _axis_values(self, shares: Sequence[Array]) -> dict[str, Array]:
        return {axis.field: axis.at(share) for axis, share in zip(self.axes, shares, strict=True)}

    def _is_whole(self, name: str) -> bool:
        return isinstance(getattr(self.machine, name), int)

    def _drawn(self, start: int, stop: int) -> Array:
        """Points ``start`` to ``stop`` of the sequence over the axes, (n, dimensions) in 0 to 1."""
        dimensions, generator = len(self.axes), np.random.default_rng(self.seed)
        if self.sampling in ("random", "crosses"):
            bits: Any = generator.bit_generator
            bits.advance(start * dimensions)
            return generator.random((stop - start, dimensions))
        from scipy.stats import qmc  # slow to import, and few plans need it

        sequence = qmc.Sobol(dimensions, rng=generator)
        if start:
            return np.asarray(sequence.fast_forward(start).random(stop - start))
        return np.asarray(sequence.random_base2(max(0, int(np.ceil(np.log2(max(1, stop)))))))[:stop]

    def drawn(self) -> Array:
        """Numbers that place random or Sobol points, or crosses, on the axes: (size, axes) in 0 to 1."""
        return self._drawn(0, self.size)

    def machine_at(self, point: dict[str, float]) -> Machine:
        """Build the machine of one point."""
        return with_settings(
            self.machine, {name: int(value) if self._is_whole(name) else value for name, value in point.items()}
        )

    def machine_numbers(self, rows: range) -> NDArray[np.int64]:
        """Which cross each row belongs to, (n_rows,)."""
        return np.arange(rows.start, rows.stop) // len(CROSS)

    def splits(self, rows: range) -> list[str]:
        """Part of the split that each row of crosses belongs to: whole machines, by seed and number alone."""
        machines = self.machine_numbers(rows)
        first, generator = int(machines.min(initial=self.size)), np.random.default_rng([self.seed, 1])
        bits: Any = generator.bit_generator
        bits.advance(first)
        drawn = generator.random(int(machines.max(initial=first)) + 1 - first)
        parts = np.searchsorted(np.cumsum([share for _, share in SPLIT]), drawn, side="right").clip(max=len(SPLIT) - 1)
        return [SPLIT[part][0] for part in parts[machines - first]]

    def with_signals(self, rows: range) -> NDArray[np.bool_]:
        """Which rows keep their signals, (n_rows,)."""
        return np.asarray(np.arange(rows.start, rows.stop) * GOLDEN % 1.0 < self.signals)

    def with_full_type(self, rows: range) -> NDArray[np.bool_]:
        """Which rows are typed over the full window too, (n_rows,): a share of those with all neighbours, or a grid."""
        chosen = np.arange(rows.start, rows.stop) * SILVER % 1.0 < self.full_types
        if self.sampling == "grid" and self.full_types == 1.0:
            return np.ones(len(rows), dtype=bool)
        return np.asarray(chosen & (self.type_neighbours(rows) == self.all_neighbours))

    def type_neighbours(self, rows: range) -> NDArray[np.int64]:
        """How many of the neighbours that a response type rests on are points of the sweep, (n_rows,)."""
        if self.sampling == "crosses":
            return np.where(np.arange(rows.start, rows.stop) % len(CROSS) == 0, len(CROSS) - 1, 0)
        at = np.unravel_index(np.arange(rows.start, rows.stop), self.shape)
        found = np.ones(len(rows), dtype=np.int64)
        for axis, far in self.type_axes().items():
            found *= np.minimum(at[axis], far) + np.minimum(self.shape[axis] - 1 - at[axis], far) + 1
        return found - 1

    def type_axes(self) -> dict[int, int]:
        """``type_reach`` by the index of the axis in ``shape``."""
        return {self.fields.index(name): far for name, far in self.type_reach().items()}

    @property
    def all_neighbours(self) -> int:
        """Neighbours of a point that has all that its response type rests on; 0 where none are points of the sweep."""
        return (
            len(CROSS) - 1
            if self.sampling == "crosses"
            else prod(2 * far + 1 for far in self.type_reach().values()) - 1
        )

    def type_reach(self) -> dict[str, int]:
        """Over which neighbours of a point its response type is judged: {field: steps}.

        In speed and clearance, as many steps as the default tolerance of the field holds. Empty where the steps of
        one of them are wider than its tolerance, because a type compares points one tolerance apart; and unless on a
        grid.
        """
        tolerances = default_tolerances(self.machine)
        reach = {}
        for axis in self.axes if self.sampling == "grid" else ():
            if axis.field in self._cross_fields:
                middle, following = axis.at(np.array([0.5, 0.5 + 1.0 / ((axis.count or 0) - 1)]))
                reach[axis.field] = tolerances[axis.field].steps(float(middle), float(following))
                if not reach[axis.field]:
                    return {}
        return reach

    def settings(self) -> dict[str, Any]:
        """Everything that decides the rows of the sweep, as JSON values."""
        described = {name: getattr(self, name) for name in _PLAIN_FIELDS}
        if not self.full_types or self.initial_states == WITHOUT_SEARCH:
            del described["initial_states"]
        if self.definition == UNSTATED:
            del described["definition"]
        described["machine"] = self.machine.name
        described["base"] = {name: getattr(self.machine, name) for name in parameters_of(self.machine)}
        if self.machine.initial_state != type(self.machine).initial_state:
            described["initial_state"] = list(self.machine.initial_state)
        described["axes"] = [asdict(axis) for axis in self.axes]
        described["type_reach"] = self.type_reach()
        return described

    @classmethod
    def from_settings(cls, settings: dict[str, Any]) -> "SweepPlan":
        """Return the plan whose ``settings`` these are."""
        machine: Any = MACHINES[settings["machine"]]
        base = machine(**settings["base"])
        unstated = WITHOUT_SEARCH if settings["full_types"] else STARTS
        return cls(
            base.from_state(settings["initial_state"]) if "initial_state" in settings else base,
            tuple(Axis(**axis) for axis in settings["axes"]),
            **{name: {"initial_states": unstated, "definition": UNSTATED, **settings}[name] for name in _PLAIN_FIELDS},
        )


_PLAIN_FIELDS = ("sampling", "size", "seed", "budget", "signals", "full_types", "initial_states", "definition")

UNSTATED: Definition = "thesis"
"""Definition of natures in plans whose settings do not state one."""

WITHOUT_SEARCH = 3
"""Initial states of full types in plans whose settings do not state them."""


def default_axes(machine: Machine, sampling: Sampling) -> tuple[Axis, ...]:
    """Speed and clearance over the machine's usual ranges."""
    fields = (machine.speed_field, machine.clearance_field)
    return tuple(
        Axis(field, *machine.usual_ranges[field], count=count if sampling == "grid" else None)
        for field, count in zip(fields, DEFAULT_COUNTS, strict=True)
    )
