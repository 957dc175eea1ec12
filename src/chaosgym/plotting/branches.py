"""Drawing of a bifurcation diagram: branches, stable and unstable, what happens on them, and a sweep behind."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from chaosgym.diagnosis.bifurcation_diagram import BifurcationDiagram, Branch
from chaosgym.plotting.design import axis_label
from chaosgym.plotting.style import ACCENT, BAD, INK, MUTED

Array = NDArray[np.float64]

MARKS = {
    "fold": ("s", INK),
    "flip": ("D", "#8e5ea2"),
    "Neimark-Sacker": ("*", "#2e8b57"),
    "symmetry breaking": ("^", "#c77f1e"),
    "branch point": ("v", "#c77f1e"),
    "grazing": ("|", MUTED),
}
"""Mark and colour of each kind of bifurcation."""


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
