"""Maps of a sweep over speed and clearance, as thesis figures 3.9 and 4.15."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from chaosgym.errors import DatasetError
from chaosgym.machines.parameters import parameters_of
from chaosgym.plotting.overview import TYPE_COLOURS
from chaosgym.sweeps import LabelledSweep, SweepPlan

BINS = 24
"""Bins along speed and along clearance."""


def sweep_map(sweep: LabelledSweep) -> Figure:
    """Natures and types of a grid over speed and clearance, or shares over all machines of any other sweep."""
    plan = sweep.plan
    figure = Figure(figsize=(7.2, 5.0) if plan.sampling == "grid" else (10.5, 4.6), layout="constrained")
    if plan.sampling == "grid":
        nature_map(sweep, figure.subplots())
    else:
        left, right = figure.subplots(1, 2, sharey=True)
        share_map(sweep, "nature", "chaotic", left)
        share_map(sweep, "response_type", "I", right)
    return figure


def nature_map(sweep: LabelledSweep, ax: Axes) -> Axes:
    """Open circles: periodic; black dots: chaotic; crosses: undetermined. Shading: response type."""
    plan = sweep.plan
    speed_field, clearance_field = _plane(plan)
    if set(plan.fields) != {speed_field, clearance_field}:
        raise DatasetError(f"a map needs a grid over {speed_field} and {clearance_field} alone")
    speed, clearance = sweep.column(speed_field), 1e3 * sweep.column(clearance_field)
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
    speed_field, clearance_field = _plane(plan)
    speed, clearance = sweep.column(speed_field), 1e3 * sweep.column(clearance_field)
    edges = [np.linspace(speed.min(), speed.max(), BINS + 1), np.geomspace(clearance.min(), clearance.max(), BINS + 1)]
    known = np.array([value is not None for value in sweep.column(column)])
    chosen = sweep.column(column) == label
    hits, _, _ = np.histogram2d(speed[chosen], clearance[chosen], edges)
    total, _, _ = np.histogram2d(speed[known], clearance[known], edges)
    share = np.divide(hits, total, out=np.full_like(hits, np.nan), where=total > 0)
    mesh = ax.pcolormesh(edges[0], edges[1], share.T, vmin=0.0, vmax=1.0, cmap="cividis")
    ax.figure.colorbar(mesh, ax=ax, label=f"share {label}")
    ax.set_yscale("log")
    return _label(plan, ax, f"{plan.machine.name}: {column.replace('_', ' ')} {label}")


def _plane(plan: SweepPlan) -> tuple[str, str]:
    return plan.machine.speed_field, plan.machine.clearance_field


def _label(plan: SweepPlan, ax: Axes, title: str) -> Axes:
    speed = plan.machine.speed_field
    unit = parameters_of(plan.machine)[speed].unit
    ax.set(xlabel=f"{speed.replace('_', ' ')} [{unit}]", ylabel="clearance [mm]", title=title)
    return ax
