"""Drawing of a bifurcation diagram: branches, stable and unstable, what happens on them, and a sweep behind."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation_diagram import BifurcationDiagram, Branch
from chaosgym.branches.bifurcation_map import BifurcationMap
from chaosgym.plotting.labels import axis_label
from chaosgym.plotting.style import ACCENT, BAD, INK, MUTED

MARKS = {
    "fold": ("s", INK),
    "flip": ("D", "#8e5ea2"),
    "Neimark-Sacker": ("*", "#2e8b57"),
    "symmetry breaking": ("^", "#c77f1e"),
    "branch point": ("v", "#c77f1e"),
    "grazing": ("|", MUTED),
}
"""Mark and colour of each kind of bifurcation."""


SQUARES = {
    "period 1": "#d5e5ea",
    "period 2": "#a9cbd6",
    "longer period": "#79aec0",
    "periodic": "#eef3f5",
    "quasiperiodic": "#d9c6e0",
    "chaotic": "#f0b9c0",
    "undetermined": "#dddddd",
}
"""Colour of each kind of square behind curves; "periodic" is one that is not proven."""

SHADES = ("#79aec0", "#f0b9c0", "#c8dfb0", "#d9c6e0", "#f2d29b", "#a9cbd6", "#b7b0d8", "#e3b7a0")
"""Colours of the branches in a picture of shares."""

STYLES: dict[str, dict[str, Any]] = {
    "stable": {"color": ACCENT, "lw": 1.6},
    "unstable": {"color": BAD, "lw": 0.9, "ls": (0, (3, 2))},
}


def branches(diagram: BifurcationDiagram, ax: Axes) -> Axes:
    """Largest peak force [N] of periodic orbits along a field; dots behind: what a sweep from rest meets."""
    label, factor = axis_label(diagram.machine, diagram.field)
    for number, point in enumerate(diagram.sweep):
        at = np.full(len(point.peaks), factor * point.value)
        ax.plot(at, point.peaks, "o", ms=5.0, mew=0.0, color=MUTED, alpha=0.35, label=None if number else "sweep")
    for number, branch in enumerate(diagram.branches):
        values, peaks, state = _path(branch)
        for name, style in STYLES.items():
            drawn = np.where(_joined(state, name == "stable"), peaks, np.nan)
            ax.plot(factor * values, drawn, label=None if number else name, **style)
    seen: set[str] = set()
    for one in diagram.bifurcations:
        mark, colour = MARKS[one.kind]
        size = 5.0 if one.kind == "grazing" else 3.5
        name = "" if one.kind in seen else one.kind
        seen.add(one.kind)
        place = factor * one.value, one.largest_peak
        ax.plot(*place, mark, ms=size, mew=0.8, color=colour, label=name or None, zorder=5)
    ax.set(xlabel=label, ylabel="largest peak force [N]", xlim=(factor * diagram.low, factor * diagram.high))
    heights = [branch.peaks.max(axis=1) for branch in diagram.branches] + [point.peaks for point in diagram.sweep]
    if heights:
        everything = np.concatenate(heights)
        ax.set_ylim(0.95 * float(everything.min()), 1.05 * float(everything.max()) or 1.0)
    return ax


def shares(diagram: BifurcationDiagram, ax: Axes) -> Axes:
    """Shares of the random starts that settle on each motion along a field, stacked.

    Motions are runs of stable orbits of the branches, each with the forces that it has, and what lies on no branch.
    """
    label, factor = axis_label(diagram.machine, diagram.field)
    points = [point for point in diagram.sweep if point.motions]
    places = diagram.places(points)
    parts = np.array(
        [[sum(one.share for one in point.motions if one.place == place) for point in points] for place in places]
    )
    there = [row for row in range(len(places)) if parts[row].any()]
    names = [_place_name(diagram, places[row]) for row in there]
    colours = [MUTED if places[row][0] is None else SHADES[row % len(SHADES)] for row in there]
    ax.stackplot([factor * point.value for point in points], parts[there], labels=names, colors=colours, lw=0.0)
    ax.set(xlabel=label, ylabel="share of starts", xlim=(factor * diagram.low, factor * diagram.high), ylim=(0.0, 1.0))
    return ax


def _place_name(diagram: BifurcationDiagram, place: tuple[int | None, int | None]) -> str:
    """Name of a motion in the legend: its branch, and its force where several motions lie on it."""
    number, stretch = place
    if number is None:
        return "not periodic or not proven"
    if stretch is None or len(diagram.branches[number - 1].stretches) == 1:
        return f"branch {number}"
    force = max(one.largest_peak for point in diagram.sweep for one in point.motions if one.place == place)
    return f"branch {number}, {f'up to {force:.3g} N' if force > 0.0 else 'without contact'}"


def bifurcation_map(found: BifurcationMap, ax: Axes) -> Axes:
    """Curves of bifurcations over two fields; squares behind: nature from rest, and the period where it is not 1."""
    (across, x), (up, y) = (axis_label(found.machine, name) for name in (found.along, found.against))
    wide, high = ([*values, 2.0 * values[-1] - values[-2]] for values in (found.along_values, found.against_values))
    edges = [factor * (np.array(values) - 0.5 * (values[1] - values[0])) for factor, values in ((x, wide), (y, high))]
    colours = _square_colours(found)
    ax.pcolormesh(*edges, np.swapaxes(colours, 0, 1), linewidth=0, zorder=0)
    seen: set[str] = set()
    for curve in found.curves:
        mark, colour = MARKS[curve.kind]
        name = "" if curve.kind in seen else curve.kind
        seen.add(curve.kind)
        place = x * curve.along_values, y * curve.against_values
        ax.plot(*place, "-", lw=1.3, marker=mark, ms=2.2, mew=0.0, color=colour, label=name or None, zorder=5)
    names = _square_names(found)
    for square, shade in SQUARES.items():
        if np.any(names == square):
            ax.plot([], [], "s", ms=7, color=shade, label=square)
    limits = ((edge[0], edge[-1]) for edge in edges)
    ax.set(xlabel=across, ylabel=up, **dict(zip(("xlim", "ylim"), limits, strict=True)))
    ax.grid(visible=False)
    return ax


def _square_names(found: BifurcationMap) -> NDArray[np.str_]:
    """What each square of a sweep is, (n, m): a period where it is proven, else the nature."""
    periods = np.select(
        [found.period == 1, found.period == 2, found.period > 2], ["period 1", "period 2", "longer period"], ""
    )
    return np.where(found.period > 0, periods, found.nature)


def _square_colours(found: BifurcationMap) -> Array:
    """Colours (n, m, 3) of the squares of a sweep."""
    names = _square_names(found)
    colours = np.empty((*names.shape, 3))
    for name, colour in SQUARES.items():
        colours[names == name] = to_rgb(colour)
    return colours


def _path(branch: Branch) -> tuple[Array, Array, Array]:
    """Values, largest peaks and state of a branch: 1 for stable orbits, 0 for unstable ones, NaN at bifurcations."""
    values, peaks, state = list(branch.values), list(branch.peaks.max(axis=1)), [float(one) for one in branch.stable]
    for one, place in reversed(list(zip(branch.bifurcations, branch.at, strict=True))):
        values.insert(place + 1, one.value)
        peaks.insert(place + 1, one.largest_peak)
        state.insert(place + 1, np.nan)
    return np.array(values), np.array(peaks), np.array(state)


def _joined(state: Array, stable: bool) -> NDArray[np.bool_]:
    """Orbits that a line joins: those of one state, and the bifurcations at their ends."""
    chosen = state == float(stable)
    for _ in range(int(np.sum(np.isnan(state)))):
        beside = np.zeros_like(chosen)
        beside[1:] |= chosen[:-1]
        beside[:-1] |= chosen[1:]
        wider = chosen | (np.isnan(state) & beside)
        if np.array_equal(wider, chosen):
            break
        chosen = wider
    return np.asarray(chosen)
