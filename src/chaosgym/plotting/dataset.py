"""Pictures of a sweep: maps over speed and clearance, as thesis figures 3.9 and 4.15, and forces along one field."""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from numpy.typing import NDArray

from chaosgym.errors import DatasetError
from chaosgym.plotting.design import axis_label
from chaosgym.plotting.response import force_spans
from chaosgym.plotting.style import STYLE, TYPE_COLOURS, figure_of
from chaosgym.sweeps import LabelledSweep, SweepPlan

Array = NDArray[np.float64]

BINS = 24
"""Bins along speed and along clearance."""


def sweep_map(sweep: LabelledSweep) -> Figure:
    """Natures and types of a grid over two fields, forces along one, or shares over all machines of any other sweep."""
    plan = sweep.plan
    with matplotlib.rc_context(STYLE):
        figure = figure_of(*((6.2, 3.6) if len(plan.fields) == 1 else (6.2, 4.8)))
        if len(plan.fields) == 1:
            force_diagram(sweep, figure.subplots())
        elif plan.sampling == "grid" and len(plan.fields) == 2:
            nature_map(sweep, figure.subplots())
        else:
            figure.set_size_inches(9.5, 4.4)
            left, right = figure.subplots(1, 2, sharey=True)
            share_map(sweep, "nature", "chaotic", left)
            share_map(sweep, "response_type", "I", right)
    return figure


def force_diagram(sweep: LabelledSweep, ax: Axes) -> Axes:
    """Smallest to largest peak force along the one field that varies, by nature."""
    machine, (field,) = sweep.plan.machine, sweep.plan.fields
    label, factor = axis_label(machine, field)
    known = np.array([nature is not None for nature in sweep.column("nature")])
    at, low, high = (sweep.column(name)[known] for name in (field, "peak_force_min", "peak_force_max"))
    force_spans(factor * at, low, high, sweep.column("nature")[known], ax)
    ax.set(xlabel=label, title=f"{machine.name}: forces of {len(at)} points")
    return ax


def nature_map(sweep: LabelledSweep, ax: Axes) -> Axes:
    """Open circles: periodic; black dots: chaotic; crosses: undetermined. Shading: response type."""
    plan = sweep.plan
    if len(plan.fields) != 2:
        raise DatasetError(f"a map needs a grid over two fields; this one varies {', '.join(plan.fields)}")
    across, up = _plane(plan)
    speed, clearance = _shown(sweep, across), _shown(sweep, up)
    order = np.lexsort((clearance, speed))
    shape = (len(np.unique(speed)), len(np.unique(clearance)))
    grids = [values[order].reshape(shape) for values in (speed, clearance)]
    kinds = [str(kind) for kind in sweep.column("response_type")[order]]
    index = np.array([list(TYPE_COLOURS).index(kind) for kind in kinds]).reshape(shape)
    colours = ListedColormap(list(TYPE_COLOURS.values()))
    ax.pcolormesh(*grids, index, cmap=colours, vmin=-0.5, vmax=3.5, alpha=0.45, edgecolors="none", linewidth=0)
    nature = sweep.column("nature")
    marks: dict[str, dict[str, Any]] = {
        "periodic": {"facecolors": "none", "edgecolors": "black", "linewidths": 0.6},
        "chaotic": {"color": "black"},
        "undetermined": {"marker": "x", "color": "black"},
    }
    for name, style in marks.items():
        rows = nature == name
        if rows.any():
            ax.scatter(speed[rows], clearance[rows], s=9, label=name, **style)
    shown = [
        Patch(color=colour, alpha=0.45, label=f"Type {kind}") for kind, colour in TYPE_COLOURS.items() if kind in kinds
    ]
    handles = [*ax.get_legend_handles_labels()[0], *shown]
    ax.figure.legend(handles=handles, loc="outside lower center", fontsize=8, ncols=6)
    return _label(plan, ax, f"{plan.machine.name}: natures and response types")


def share_map(sweep: LabelledSweep, column: str, label: str, ax: Axes) -> Axes:
    """Share of the rows with a label in bins of speed and clearance, over all machines."""
    plan = sweep.plan
    across, up = _plane(plan)
    speed, clearance = _shown(sweep, across), _shown(sweep, up)
    logarithmic = bool(clearance.min() > 0.0)
    spaced = np.geomspace if logarithmic else np.linspace
    edges = [np.linspace(speed.min(), speed.max(), BINS + 1), spaced(clearance.min(), clearance.max(), BINS + 1)]
    known = np.array([value is not None for value in sweep.column(column)])
    chosen = sweep.column(column) == label
    hits, _, _ = np.histogram2d(speed[chosen], clearance[chosen], edges)
    total, _, _ = np.histogram2d(speed[known], clearance[known], edges)
    share = np.divide(hits, total, out=np.full_like(hits, np.nan), where=total > 0)
    mesh = ax.pcolormesh(edges[0], edges[1], share.T, vmin=0.0, vmax=1.0, cmap="cividis")
    ax.figure.colorbar(mesh, ax=ax, label=f"share {label}")
    if logarithmic:
        ax.set_yscale("log")
    return _label(plan, ax, f"{plan.machine.name}: {column.replace('_', ' ')} {label}")


def _plane(plan: SweepPlan) -> tuple[str, str]:
    """The two fields of a map: speed and clearance where both vary, else the first two."""
    usual = plan.machine.speed_field, plan.machine.clearance_field
    return usual if {*usual} <= {*plan.fields} or plan.sampling == "crosses" else (plan.fields[0], plan.fields[1])


def _shown(sweep: LabelledSweep, field: str) -> Array:
    """A field of every row, lengths in mm."""
    return np.asarray(axis_label(sweep.plan.machine, field)[1] * sweep.column(field))


def _label(plan: SweepPlan, ax: Axes, title: str) -> Axes:
    across, up = (axis_label(plan.machine, field)[0] for field in _plane(plan))
    ax.set(xlabel=across, ylabel=up, title=title)
    return ax
