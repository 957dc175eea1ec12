"""The plan of a sweep: a base machine, axes of parameters, and a rule that places points on them.

    grid      all combinations of the axes
    random    points uniform in the axes' scales
    sobol     a scrambled Sobol sequence over the axes
    lattice   machines from a Sobol sequence over the axes; each is run on a small lattice of speeds and clearances (its
              patches), put at a place of its own, whose neighbours lie one tolerance apart

On a grid or a lattice the neighbourhoods of response types share their points, so that a type costs about one run
instead of nine. Points are computed by the row, never all at once: a plan may have a billion.
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from chaosgym.diagnosis import Tolerance, default_tolerances
from chaosgym.errors import ParameterError
from chaosgym.machines import MACHINES, Machine
from chaosgym.machines.parameters import check_parameter, parameters_of, with_settings
from chaosgym.sweeps.axes import AXIS_FORM, Axis, Patch

Array = NDArray[np.float64]
Sampling = Literal["grid", "random", "sobol", "lattice"]

DEFAULT_COUNTS = (27, 10)
"""Points of a grid over speed and clearance if no axis is given."""

DEFAULT_BUDGET = 400
"""Cycles that the diagnosis of a point may take."""

CHUNK_SIZE = 256
"""Points that are computed and kept together; on a lattice as many whole machines."""

LEAST_STEPS = 0.9
"""Steps that a tolerance must hold at least, so that neighbours on the grid are neighbours of a response type."""

SPLIT = (("train", 0.70), ("validation", 0.15), ("test", 0.15))
"""Shares of the machines of a lattice."""

GOLDEN, SILVER = 0.6180339887498949, 0.41421356237309515
"""Multiples of an irrational number spread evenly: which rows have signals, and which a type over the full window."""


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
        "grid", "random", "sobol" or "lattice"; see the module.
    size
        Number of random or Sobol points, or of the machines of a lattice; ignored on a grid.
    seed
        Of the random or Sobol points, and of the split of a lattice.
    patches : tuple of Patch
        Of a lattice; the first varies slowest.
    budget
        Cycles from rest that the diagnosis of a point may take.
    signals
        Share of the points whose signals are kept (``label.WINDOWS``).
    full_types
        Share of the points whose response type is judged over all tolerances too, by runs of its own; on a grid or a
        lattice only points with all their neighbours.
    """

    machine: Machine
    axes: tuple[Axis, ...]
    sampling: Sampling = "grid"
    size: int = 0
    seed: int = 0
    patches: tuple[Patch, ...] = ()
    budget: int = DEFAULT_BUDGET
    signals: float = 0.0
    full_types: float = 0.0

    def __post_init__(self) -> None:
        tolerances = default_tolerances(self.machine)
        object.__setattr__(self, "patches", tuple(_with_step(patch, tolerances) for patch in self.patches))
        self._check_fields()
        for axis in self.axes:
            if (self.sampling == "grid") == (axis.count is None):
                rule = "needs a COUNT on a grid" if axis.count is None else "takes no COUNT unless on a grid"
                raise ParameterError(f"axis {axis.field} {rule}: {AXIS_FORM}")
        if (self.sampling == "lattice") != bool(self.patches):
            raise ParameterError("patches and machines belong together; allowed: a lattice with one patch or more")
        if self.sampling != "grid" and not 1 <= self.size <= 10**9:
            raise ParameterError(f"size = {self.size} is out of range; allowed: 1 to 1e9 points")
        if self.budget < 100:
            raise ParameterError(f"budget = {self.budget} cycles is out of range; allowed: 100 or more")
        for name in ("signals", "full_types"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ParameterError(f"{name} = {getattr(self, name):g} is out of range; allowed: a share of 0 to 1")

    def _check_fields(self) -> None:
        known = parameters_of(self.machine)
        names = self.fields
        if not names or len(set(names)) != len(names):
            raise ParameterError(f"axes {', '.join(names) or '(none)'}: give at least one, each field once")
        spans: tuple[Axis | Patch, ...] = (*self.axes, *self.patches)
        for span in spans:
            if span.field not in known:
                raise ParameterError(f"axis {span.field!r} is no field; known fields: {', '.join(known)}")
            if known[span.field].choices:
                raise ParameterError(f"axis {span.field!r} is a choice and can't be swept; use --set")
            for end in (span.low, span.high):
                check_parameter(self.machine, span.field, int(end) if self._is_whole(span.field) else end)

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    @property
    def fields(self) -> tuple[str, ...]:
        """Every field that is varied."""
        return tuple(axis.field for axis in self.axes) + tuple(patch.field for patch in self.patches)

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, (size,), or (machines, points of each patch)."""
        if self.sampling == "grid":
            return tuple(axis.count or 0 for axis in self.axes)
        return (self.size, *(patch.count for patch in self.patches))

    @property
    def chunk_size(self) -> int:
        """Points that are computed and kept together."""
        patch = int(np.prod(self.shape[1:])) if self.sampling == "lattice" else 1
        return max(1, CHUNK_SIZE // patch) * patch

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
        elif self.sampling == "lattice":
            machine, *inside = np.unravel_index(index, self.shape)
            first, last = int(machine.min(initial=0)), int(machine.max(initial=-1))
            drawn = self._drawn(first, last + 1)[machine - first]
            columns = self._axis_values(list(drawn.T[: len(self.axes)]))
            for patch, place, i in zip(self.patches, drawn.T[len(self.axes) :], inside, strict=True):
                columns[patch.field] = patch.at(place, i.astype(float))
        else:
            columns = self._axis_values(list(self._drawn(rows.start, rows.stop).T))
        return {name: np.round(column) if self._is_whole(name) else column for name, column in columns.items()}

    def _axis_values(self, shares: Sequence[Array]) -> dict[str, Array]:
        return {axis.field: axis.at(share) for axis, share in zip(self.axes, shares, strict=True)}

    def _is_whole(self, name: str) -> bool:
        return isinstance(getattr(self.machine, name), int)

    def _drawn(self, start: int, stop: int) -> Array:
        """Points ``start`` to ``stop`` of the sequence over axes and places of patches, (n, dimensions) in 0 to 1."""
        dimensions, generator = len(self.axes) + len(self.patches), np.random.default_rng(self.seed)
        if self.sampling == "random":
            bits: Any = generator.bit_generator
            bits.advance(start * dimensions)
            return generator.random((stop - start, dimensions))
        sequence = qmc.Sobol(dimensions, rng=generator)
        if start:
            return np.asarray(sequence.fast_forward(start).random(stop - start))
        return np.asarray(sequence.random_base2(max(0, int(np.ceil(np.log2(max(1, stop)))))))[:stop]

    def machine_at(self, point: dict[str, float]) -> Machine:
        """Build the machine of one point."""
        return with_settings(
            self.machine, {name: int(value) if self._is_whole(name) else value for name, value in point.items()}
        )

    def machine_numbers(self, rows: range) -> NDArray[np.int64]:
        """Which machine of the lattice each row belongs to, (n_rows,)."""
        return np.arange(rows.start, rows.stop) // int(np.prod(self.shape[1:]))

    def splits(self, rows: range) -> list[str]:
        """Part of the split that each row of a lattice belongs to: whole machines, drawn by the seed."""
        order = np.random.default_rng([self.seed, 1]).permutation(self.size)
        ends = np.cumsum([share for _, share in SPLIT]) * self.size
        parts = np.searchsorted(np.round(ends), order, side="right").clip(max=len(SPLIT) - 1)
        return [SPLIT[part][0] for part in parts[self.machine_numbers(rows)]]

    def with_signals(self, rows: range) -> NDArray[np.bool_]:
        """Which rows keep their signals, (n_rows,)."""
        return np.asarray(np.arange(rows.start, rows.stop) * GOLDEN % 1.0 < self.signals)

    def with_full_type(self, rows: range) -> NDArray[np.bool_]:
        """Which rows are typed over the full window too, (n_rows,)."""
        chosen = np.arange(rows.start, rows.stop) * SILVER % 1.0 < self.full_types
        reach = self.type_reach()
        return np.asarray(chosen & (self.type_neighbours(rows) == 2 * sum(reach.values())))

    def type_neighbours(self, rows: range) -> NDArray[np.int64]:
        """How many of the neighbours that a response type rests on are points of the sweep, (n_rows,)."""
        at = np.unravel_index(np.arange(rows.start, rows.stop), self.shape)
        found = np.zeros(len(rows), dtype=np.int64)
        for axis, far in self.type_axes().items():
            found += np.minimum(at[axis], far) + np.minimum(self.shape[axis] - 1 - at[axis], far)
        return found

    def type_axes(self) -> dict[int, int]:
        """``type_reach`` by the index of the axis in ``shape``."""
        names = [axis.field for axis in self.axes] if self.sampling == "grid" else ["", *self.fields[len(self.axes) :]]
        return {names.index(name): far for name, far in self.type_reach().items()}

    def type_reach(self) -> dict[str, int]:
        """Over which neighbours of a point its response type is judged: {field: steps}.

        Along speed and clearance, as many steps as the default tolerance of the field holds. Empty where the steps of
        one of them are wider than its tolerance, because a type compares points one tolerance apart; and unless on a
        grid or a lattice.
        """
        tolerances = default_tolerances(self.machine)
        spans: tuple[Axis | Patch, ...] = self.axes if self.sampling == "grid" else self.patches
        reach = {}
        for span in spans:
            if span.field not in (self.machine.speed_field, self.machine.clearance_field) or span.count == 1:
                continue
            if isinstance(span, Patch):
                middle, following = span.at(np.array([0.5, 0.5]), np.array([0.0, 1.0]))
            else:
                middle, following = span.at(np.array([0.5, 0.5 + 1.0 / ((span.count or 0) - 1)]))
            width = tolerances[span.field].at(float(middle), 1.0) - float(middle)
            steps = width / float(following - middle)
            if steps < LEAST_STEPS:
                return {}
            reach[span.field] = round(steps)
        return reach

    def settings(self) -> dict[str, Any]:
        """Everything that decides the rows of the sweep, as JSON values."""
        described = {
            name: getattr(self, name) for name in ("sampling", "size", "seed", "budget", "signals", "full_types")
        }
        described["machine"] = self.machine.name
        described["base"] = {name: getattr(self.machine, name) for name in parameters_of(self.machine)}
        described["axes"] = [asdict(axis) for axis in self.axes]
        described["patches"] = [{**asdict(patch), "step": list(patch.step or ())} for patch in self.patches]
        described["type_reach"] = self.type_reach()
        return described

    @classmethod
    def from_settings(cls, settings: dict[str, Any]) -> "SweepPlan":
        """Return the plan whose ``settings`` these are."""
        patches = tuple(Patch(**{**patch, "step": Tolerance(*patch["step"])}) for patch in settings["patches"])
        machine: Any = MACHINES[settings["machine"]]
        return cls(
            machine(**settings["base"]),
            tuple(Axis(**axis) for axis in settings["axes"]),
            patches=patches,
            **{name: settings[name] for name in _PLAIN_FIELDS},
        )


_PLAIN_FIELDS = ("sampling", "size", "seed", "budget", "signals", "full_types")


def _with_step(patch: Patch, tolerances: dict[str, Tolerance]) -> Patch:
    if patch.step is not None:
        return patch
    if patch.field not in tolerances:
        raise ParameterError(f"patch {patch.field} needs a STEP, since the field has no default tolerance")
    return replace(patch, step=tolerances[patch.field])


def default_axes(machine: Machine, sampling: Sampling) -> tuple[Axis, ...]:
    """Speed and clearance over the machine's usual ranges."""
    fields = (machine.speed_field, machine.clearance_field)
    return tuple(
        Axis(field, *machine.usual_ranges[field], count=count if sampling == "grid" else None)
        for field, count in zip(fields, DEFAULT_COUNTS, strict=True)
    )
