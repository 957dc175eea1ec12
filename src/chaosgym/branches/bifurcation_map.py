"""Motions over two fields, and the curves on which they change: natures and periods of a sweep, bifurcations over it.

Branches along the first field, at the machine's own value of the second one, give the bifurcations. Each at which
stability ends is followed over the second field. A curve that does not cross the machine's own value is not found.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Bifurcation
from chaosgym.branches.bifurcation_curve import BifurcationCurve, follow_bifurcation
from chaosgym.branches.bifurcation_diagram import BifurcationDiagram
from chaosgym.branches.branch import MOST_UNSTABLE
from chaosgym.branches.diagram_search import PATIENCE, SWEEP_BUDGET, follow
from chaosgym.branches.family_along import continuous_field
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, with_settings
from chaosgym.plain import Result
from chaosgym.simulation.parallel import parallel_map

COLUMNS, ROWS = 25, 13
"""Points of the sweep along the first and along the second field."""

SAME = 1e-6
"""Relative difference below which two bifurcations of one kind and period lie at one place."""


@dataclass(frozen=True, kw_only=True)
class BifurcationMap(Result):
    """Natures of a sweep over two fields, and curves of bifurcations.

    Attributes
    ----------
    machine
        What runs.
    along, against
        First and second field.
    along_values, against_values : (n,), (m,)
        Of the sweep.
    nature : (n, m) of str
        From rest.
    period : (n, m) int
        In cycles, of proven periodic motions; 0 for all others.
    diagram
        Branches along the first field at the machine's own value of the second one.
    curves
        Of the bifurcations at which stability ends.
    """

    shows = "machine=machine.name along against along_values against_values nature period curves"

    machine: Machine
    along: str
    against: str
    along_values: Array
    against_values: Array
    nature: NDArray[np.str_]
    period: NDArray[np.int64]
    diagram: BifurcationDiagram
    curves: tuple[BifurcationCurve, ...]

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        about = parameters_of(self.machine)
        units = {"along_unit": about[self.along].unit, "against_unit": about[self.against].unit}
        return {**super().as_dict(), **units}

    def rows(self) -> Iterator[dict[str, Any]]:
        """One row for each point of a curve, for a table."""
        for number, curve in enumerate(self.curves, 1):
            for along, against in zip(curve.along_values, curve.against_values, strict=True):
                yield {
                    "curve": number,
                    "kind": curve.kind,
                    "period": curve.period,
                    self.along: float(along),
                    self.against: float(against),
                }


def bifurcation_map(
    machine: Machine,
    along: str,
    against: str,
    span: tuple[float, float],
    other: tuple[float, float],
    *,
    columns: int = COLUMNS,
    rows: int = ROWS,
    longest_period: int = 2,
    most_unstable: float = MOST_UNSTABLE,
    workers: int | None = None,
    progress: bool = False,
) -> BifurcationMap:
    """Sweep a machine over two fields, and follow the bifurcations of its branches over both.

    Parameters
    ----------
    machine
        What runs; its own value of the second field is where branches are followed.
    along, against
        First and second field, or "speed" or "clearance".
    span, other
        Lowest and highest value of either.
    columns, rows
        Points of the sweep along the first and the second field; ``columns`` seed the branches.
    longest_period, most_unstable, workers, progress
        As for ``follow``.

    Raises
    ------
    ParameterError
        If a field is unknown or does not vary continuously, both are the same, a span is empty or leaves the field's
        range, or the machine's own value of the second field lies outside of ``other``.

    Examples
    --------
    >>> from chaosgym.branches.bifurcation_map import bifurcation_map
    >>> found = bifurcation_map(
    ...     chaosgym.ImpactBeam(), "speed", "clearance", (17.0, 18.2), (0.11e-3, 0.14e-3)
    ... )  # doctest: +SKIP
    """
    first, second = continuous_field(machine, along), continuous_field(machine, against)
    if first == second:
        raise ParameterError(f"{first} can't vary along itself; allowed: two different fields")
    own = float(getattr(machine, second))
    if not other[0] < other[1] or not other[0] <= own <= other[1]:
        raise ParameterError(
            f"{second} = {own:g} of the machine is not within {other[0]:g} to {other[1]:g}; allowed: a range around it"
        )
    for value in other:
        with_settings(machine, {second: value})
    diagram = follow(
        machine,
        first,
        span,
        sweep=columns,
        longest_period=longest_period,
        most_unstable=most_unstable,
        workers=workers,
        progress=progress,
    )
    across, up = np.linspace(*span, columns), np.linspace(*other, rows)
    nature, period = _swept(machine, first, second, across, up, workers, progress)
    curves = [
        follow_bifurcation(machine, one, first, second, other)
        for one in tqdm(_ends(diagram), desc="curve", unit="curve", delay=PATIENCE, disable=not progress)
    ]
    return BifurcationMap(
        machine=machine,
        along=first,
        against=second,
        along_values=across,
        against_values=up,
        nature=nature,
        period=period,
        diagram=diagram,
        curves=tuple(curves),
    )


def _swept(
    machine: Machine, first: str, second: str, across: Array, up: Array, workers: int | None, progress: bool
) -> tuple[NDArray[np.str_], NDArray[np.int64]]:
    """Natures and periods from rest, (n, m)."""
    places = [{first: float(a), second: float(b)} for a in across for b in up]

    def judged(place: dict[str, float]) -> tuple[str, int]:
        verdict = diagnose(with_settings(machine, place), budget=SWEEP_BUDGET)
        return verdict.nature, (verdict.period or 0) if verdict.status == "certified" else 0

    found = parallel_map(judged, places, workers=workers, progress="map" if progress else None)
    shape = (len(across), len(up))
    return np.array([nature for nature, _ in found]).reshape(shape), np.array([p for _, p in found]).reshape(shape)


def _ends(diagram: BifurcationDiagram) -> list[Bifurcation]:
    """Bifurcations of all branches at which stability ends, each once."""
    kept: list[Bifurcation] = []
    for one in diagram.bifurcations:
        known = any(
            (one.kind, one.period) == (other.kind, other.period)
            and abs(one.value - other.value) < SAME * abs(one.value)
            and abs(one.largest_peak - other.largest_peak) < 1e-4 * max(one.largest_peak, 1e-300)
            for other in kept
        )
        if one.loses_stability and not one.ends and not known:
            kept.append(one)
    return kept
