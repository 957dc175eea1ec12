"""Drawings of responses: what moves, what hits and how often, and of a sweep as maps (thesis figures 3.9 and 4.15).

Those of one response take plain arrays and draw on an ``Axes``.
"""

from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.errors import DatasetError
from chaosgym.machines import Machine
from chaosgym.machines.picture import CALM, draw
from chaosgym.plotting.labels import axis_label, called
from chaosgym.plotting.style import ACCENT, INK, MUTED, NATURE_COLOURS, PALE, STYLE, TYPE_COLOURS, figure_of
from chaosgym.recordings.measured_sweep import SweepTypes
from chaosgym.simulation import simulate
from chaosgym.sweeps import LabelledSweep, SweepPlan

BEFORE, CYCLES, SAMPLES = 100, 4, 60
"""Cycles in which the machine may settle, cycles that are drawn, and samples of each."""


def draw_machine(machine: Machine, panel: Axes) -> None:
    """Draw a machine at the start of a cycle, after it may have settled, with its gaps larger than they are."""
    record = simulate(machine, CYCLES, transient=BEFORE, samples_per_cycle=SAMPLES)
    draw(panel, record.of_joint(), CALM, 0.0, float(record.peak_force.max()) or 1.0)


def curve(x: ArrayLike, y: ArrayLike, ax: Axes, *, label: str | None = None, color: str = ACCENT) -> Axes:
    """A time history, or any other line."""
    ax.plot(x, y, lw=0.9, color=color, label=label)
    ax.margins(x=0.0)
    return ax


def phase_plane(displacement: ArrayLike, velocity: ArrayLike, ax: Axes, *, pale: bool = False) -> Axes:
    """Velocity [m/s] against displacement [m], the latter shown in mm; ``pale`` behind a section."""
    ax.plot(1e3 * np.asarray(displacement), velocity, lw=0.5, color=ACCENT, alpha=0.4 if pale else 1.0)
    return _plane_labels(ax)


def section_points(displacement: ArrayLike, velocity: ArrayLike, ax: Axes, *, color: str = ACCENT) -> Axes:
    """Displacement [m] and velocity [m/s] once a cycle (Poincaré section), the former shown in mm."""
    ax.plot(1e3 * np.asarray(displacement), velocity, ".", ms=3, color=color)
    ax.locator_params(nbins=5)
    return _plane_labels(ax)


def _plane_labels(ax: Axes) -> Axes:
    ax.set(xlabel="displacement [mm]", ylabel="velocity [m/s]")
    return ax


def stops(room: tuple[float, float], ax: Axes, *, vertical: bool = False) -> Axes:
    """The lower and the upper stop [m], as shaded ground in mm, across the axis of the displacement."""
    ends = ax.get_ylim() if vertical else ax.get_xlim()
    places = [(sign, 1e3 * place) for sign, place in zip((-1.0, 1.0), room, strict=True) if np.isfinite(place)]
    reach = max(1.02 * float(np.max(np.abs(ends))), *(1.15 * abs(place) for _, place in places))
    span = ax.axhspan if vertical else ax.axvspan
    for sign, place in places:
        span(place, sign * 2.0 * reach, color=PALE, lw=0, zorder=0)
    (ax.set_ylim if vertical else ax.set_xlim)(-reach, reach)
    return ax


def cycle_points(peaks: Array, ax: Axes, *, first: int = 1, color: str = ACCENT, label: str | None = None) -> Axes:
    """Peak force [N] of every cycle, counted from ``first``."""
    number = np.arange(first, first + len(peaks))
    ax.plot(number, peaks, ".", ms=3.5, mew=0.0, color=color, label=label, rasterized=len(peaks) > 5000)
    ax.set(xlabel="cycle", ylabel="peak force [N]", ylim=(0.0, 1.12 * float(np.max(peaks)) or 1.0))
    ax.margins(x=0.01)
    return ax


def next_peak(peaks: Array, ax: Axes, *, color: str = ACCENT) -> Axes:
    """Return map: the peak force [N] of the next cycle against that of this one; a period k leaves k points."""
    low, high = float(np.min(peaks)), float(np.max(peaks))
    margin = 0.06 * (high - low) or 0.05 * high or 1.0
    limits = (low - margin, high + margin)
    ax.plot(limits, limits, color=MUTED, lw=0.8, zorder=0)
    ax.plot(peaks[:-1], peaks[1:], ".", ms=4, mew=0.0, color=color)
    ax.set(xlabel="peak force of a cycle [N]", ylabel="of the next cycle [N]", xlim=limits, ylim=limits)
    return ax


def force_spans(values: Array, low: Array, high: Array, nature: NDArray[Any], ax: Axes) -> Axes:
    """Smallest to largest peak force [N] against a parameter (values,), by nature; circles where they are one."""
    marks = {"periodic": "o", "quasiperiodic": "D", "chaotic": "s", "undetermined": "x"}
    for kind, colour in NATURE_COLOURS.items():
        rows = nature == kind
        if rows.any():
            ax.vlines(values[rows], low[rows], high[rows], color=colour, lw=2.0, alpha=0.8)
            ax.plot(values[rows], high[rows], marks[kind], ms=3, mew=0.5, color=colour)
    ax.legend(
        handles=[
            Line2D([], [], ls="", marker=marks[kind], ms=4, color=colour, label=kind)
            for kind, colour in NATURE_COLOURS.items()
            if np.any(nature == kind)
        ],
        loc="upper left",
        ncols=2,
    )
    ax.set(ylabel="peak force [N], least to largest", ylim=(0.0, 1.25 * float(np.nanmax(high)) or 1.0))
    return ax


def types_over_speed(speeds: Array, peaks: Array, types: SweepTypes, ax: Axes) -> Axes:
    """Peaks over the speed, their means, and the regions of types."""
    at = [one.speed for one in types.speeds]
    middles = 0.5 * (np.array(at[1:]) + np.array(at[:-1]))
    ends = [at[0] - (middles[0] - at[0]), *middles, at[-1] + (at[-1] - middles[-1])]
    for region in types.regions:
        low, high = ends[at.index(region.first)], ends[at.index(region.last) + 1]
        ax.axvspan(low, high, color=TYPE_COLOURS[region.type], alpha=0.18, lw=0.0)
        ax.text(0.5 * (low + high), 1.02, region.type, transform=ax.get_xaxis_transform(), ha="center", fontsize=9)
    irregular = np.isin(speeds, [one.speed for one in types.speeds if one.nature == "irregular"])
    for nature, shown, which in (("periodic", "periodic", ~irregular), ("chaotic", "irregular", irregular)):
        if which.any():
            ax.plot(speeds[which], peaks[which], ".", ms=3.5, mew=0.0, color=NATURE_COLOURS[nature], label=shown)
    ax.plot(at, [one.mean_peak for one in types.speeds], color=INK, lw=0.8, label="mean")
    ax.set(xlim=(ends[0], ends[-1]), ylim=(0.0, 1.08 * float(peaks.max()) or 1.0))
    ax.legend(loc="upper left", fontsize=8)
    return ax


def chance_bars(chances: dict[str, float], ax: Axes) -> Axes:
    """Probabilities by name, the first one on top."""
    names = list(chances)
    colours = [NATURE_COLOURS.get(name, ACCENT) for name in names]
    ax.barh(names, list(chances.values()), color=colours, height=0.6)
    for row, value in enumerate(chances.values()):
        inside = value > 0.8
        place: dict[str, Any] = {"ha": "right", "color": "white"} if inside else {"ha": "left"}
        ax.text(value + (-0.02 if inside else 0.02), row, f"{value:.2f}", va="center", fontsize=8.5, **place)
    ax.invert_yaxis()
    ax.set(xlim=(0.0, 1.0), xlabel="probability")
    ax.grid(axis="y", visible=False)
    return ax


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
    ax.set(xlabel=label, title=f"{called(machine)}: forces of {len(at)} points")
    return ax


def nature_map(sweep: LabelledSweep, ax: Axes) -> Axes:
    """Open circles: periodic; diamonds: quasiperiodic; dots: chaotic; crosses: undetermined. Shading: response type."""
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
        "quasiperiodic": {"marker": "D", "color": NATURE_COLOURS["quasiperiodic"]},
        "chaotic": {"color": "black"},
        "undetermined": {"marker": "x", "color": "black"},
    }
    for name, style in marks.items():
        rows = nature == name
        if rows.any():
            ax.scatter(speed[rows], clearance[rows], s=9, label=name, **style)
    shown = [
        Patch(color=colour, alpha=0.45, label=f"Type {kind}" if kind != "undetermined" else _untyped(sweep))
        for kind, colour in TYPE_COLOURS.items()
        if kind in kinds
    ]
    handles = [*ax.get_legend_handles_labels()[0], *shown]
    ax.figure.legend(
        handles=handles, loc="outside lower center", fontsize=8, ncols=len(handles) if len(handles) < 6 else 4
    )
    return _label(plan, ax, f"{called(plan.machine)}: natures and response types")


def _untyped(sweep: LabelledSweep) -> str:
    """What the points without a type are."""
    natures = set(sweep.column("nature")[sweep.column("response_type") == "undetermined"])
    return "periodic, tolerance not checked" if natures == {"periodic"} else "type undetermined"


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
    return _label(plan, ax, f"{called(plan.machine)}: {column.replace('_', ' ')} {label}")


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
