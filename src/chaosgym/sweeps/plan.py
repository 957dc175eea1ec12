"""Which machines does a sweep try? A base machine, axes of parameters, and a rule that places points on them."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from chaosgym.diagnosis import default_tolerances
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import check_parameter, parameters_of, with_settings

Array = NDArray[np.float64]
Sampling = Literal["grid", "random", "sobol"]

DEFAULT_COUNTS = (27, 10)
"""Points of a grid over speed and clearance if no axis is given."""


@dataclass(frozen=True)
class Axis:
    """One parameter of a sweep: its range, the number of grid points, and whether they are spaced by ratio.

    ``count`` is None for random and Sobol sampling.
    """

    field: str
    low: float
    high: float
    count: int | None = None
    scale: Literal["lin", "log"] = "lin"

    def __post_init__(self) -> None:
        shown = f"axis {self.field} = {self.low:g}:{self.high:g}"
        if not np.isfinite([self.low, self.high]).all() or not self.low < self.high:
            raise ParameterError(f"{shown} is empty or reversed; allowed: LOW below HIGH")
        if self.scale not in ("lin", "log"):
            raise ParameterError(f"{shown} has scale {self.scale!r}; allowed: lin, log")
        if self.scale == "log" and self.low <= 0.0:
            raise ParameterError(f"{shown} can't be logarithmic; allowed: LOW above 0")
        if self.count is not None and not 2 <= self.count <= 10**6:
            raise ParameterError(f"{shown} has {self.count} points; allowed: 2 to 1000000")

    @classmethod
    def parse(cls, text: str) -> "Axis":
        """Read ``FIELD=LOW:HIGH[:COUNT][:lin|log]``."""
        field, separator, span = text.partition("=")
        parts = span.split(":")
        scale = parts.pop() if parts[-1] in ("lin", "log") else "lin"
        try:
            if not separator or len(parts) not in (2, 3):
                raise ValueError
            count = int(parts[2]) if len(parts) == 3 else None
            return cls(field, float(parts[0]), float(parts[1]), count, scale)  # type: ignore[arg-type]
        except ParameterError:
            raise
        except ValueError:
            raise ParameterError(f"axis {text!r} is not of the form FIELD=LOW:HIGH[:COUNT][:lin|log]") from None

    def at(self, share: Array) -> Array:
        """Values at shares 0 to 1 of the range."""
        if self.scale == "log":
            return np.asarray(self.low * (self.high / self.low) ** share)
        return np.asarray(self.low + (self.high - self.low) * share)


@dataclass(frozen=True)
class SweepPlan:
    """Points of a sweep and how each is labelled.

    Attributes
    ----------
    machine : Machine
        Base machine; fields that are no axis keep its values.
    axes : tuple of Axis
        The first axis varies slowest on a grid.
    sampling
        "grid", "random" (uniform in the axes' scales) or "sobol" (scrambled Sobol sequence).
    size
        Number of random or Sobol points; ignored on a grid.
    seed
        Of the random or Sobol points.
    transient, cycles
        Each point is run from rest for ``transient`` cycles, then judged by the next ``cycles``.
    """

    machine: Machine
    axes: tuple[Axis, ...]
    sampling: Sampling = "grid"
    size: int = 0
    seed: int = 0
    transient: int = 200
    cycles: int = 200

    def __post_init__(self) -> None:
        known = parameters_of(self.machine)
        names = [axis.field for axis in self.axes]
        if not names or len(set(names)) != len(names):
            raise ParameterError(f"axes {', '.join(names) or '(none)'}: give at least one, each field once")
        for axis in self.axes:
            if axis.field not in known:
                raise ParameterError(f"axis {axis.field!r} is no field; known fields: {', '.join(known)}")
            if known[axis.field].choices:
                raise ParameterError(f"axis {axis.field!r} is a choice and can't be swept; use --set")
            for end in (axis.low, axis.high):
                check_parameter(self.machine, axis.field, end)
            if (self.sampling == "grid") == (axis.count is None):
                rule = "needs a COUNT on a grid" if axis.count is None else "takes no COUNT unless on a grid"
                raise ParameterError(f"axis {axis.field} {rule}: FIELD=LOW:HIGH[:COUNT][:lin|log]")
        if self.sampling != "grid" and not 1 <= self.size <= 10**9:
            raise ParameterError(f"size = {self.size} is out of range; allowed: 1 to 1e9 points")

    def __len__(self) -> int:
        return int(np.prod(self.shape)) if self.sampling == "grid" else self.size

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the grid, or (size,)."""
        if self.sampling == "grid":
            return tuple(axis.count or 0 for axis in self.axes)
        return (self.size,)

    def points(self) -> dict[str, Array]:
        """Values of every axis at every point: {field: (n_points,)}."""
        if self.sampling == "grid":
            shares = np.meshgrid(*[np.linspace(0.0, 1.0, axis.count or 0) for axis in self.axes], indexing="ij")
            columns = [share.ravel() for share in shares]
        elif self.sampling == "sobol":
            power = max(0, int(np.ceil(np.log2(self.size))))
            sequence = qmc.Sobol(len(self.axes), rng=np.random.default_rng(self.seed)).random_base2(power)
            columns = list(sequence[: self.size].T)
        else:
            columns = list(np.random.default_rng(self.seed).random((self.size, len(self.axes))).T)
        return {axis.field: axis.at(column) for axis, column in zip(self.axes, columns, strict=True)}

    def machines(self, points: dict[str, Array], rows: Sequence[int]) -> list[Machine]:
        """Build the machines of some rows of ``points``."""
        return [with_settings(self.machine, {name: points[name][row] for name in points}) for row in rows]

    def type_reach(self) -> dict[str, int]:
        """Over which neighbours of a grid point its response type is judged: {field: steps of the grid}.

        Along speed and clearance, as many steps as the default tolerance of the field holds, and at least one: where
        the grid is coarser than the tolerance, the type stands for a wider neighbourhood. Empty unless on a grid.
        """
        tolerances = default_tolerances(self.machine)
        reach = {}
        for axis in self.axes:
            if axis.count is None or axis.field not in (self.machine.speed_field, self.machine.clearance_field):
                continue
            middle = float(axis.at(np.array([0.5]))[0])
            step = float(axis.at(np.array([0.5 + 1.0 / (axis.count - 1)]))[0]) - middle
            width = tolerances[axis.field].at(middle, 1.0) - middle
            reach[axis.field] = max(1, round(width / step))
        return reach

    def settings(self) -> dict[str, Any]:
        """Everything that decides the rows of the sweep, as JSON values."""
        described = asdict(self)
        described["machine"] = self.machine.name
        described["base"] = {name: getattr(self.machine, name) for name in parameters_of(self.machine)}
        described["axes"] = [asdict(axis) for axis in self.axes]
        described["type_reach"] = self.type_reach()
        return described


def default_axes(machine: Machine, sampling: Sampling) -> tuple[Axis, ...]:
    """Speed and clearance over the machine's usual ranges."""
    fields = (machine.speed_field, machine.clearance_field)
    return tuple(
        Axis(field, *machine.usual_ranges[field], count=count if sampling == "grid" else None)
        for field, count in zip(fields, DEFAULT_COUNTS, strict=True)
    )
