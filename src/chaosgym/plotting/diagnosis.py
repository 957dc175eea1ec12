"""What does a diagnosis look like? The thesis' plots of a response, and the map of types.

Every function takes a result object and an optional ``ax``, returns the Axes, and computes no physics.
"""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import BoundaryNorm, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from chaosgym.diagnosis import TYPES, LyapunovExponent, ResponseMap, power_spectrum
from chaosgym.machines.parameters import parameters_of
from chaosgym.plotting.overview import TYPE_COLOURS
from chaosgym.plotting.thesis import cell_edges, phase_plane, section_points
from chaosgym.simulation import CycleRecord


def _axes(ax: Axes | None) -> Axes:
    return Figure(figsize=(6.4, 4.2), layout="constrained").subplots() if ax is None else ax


def time_history(record: CycleRecord, ax: Axes | None = None, *, cycles: int = 4) -> Axes:
    """Contact force against time, in cycles, over the last ``cycles`` of a record with a time history."""
    ax = _axes(ax)
    time = record.time / record.machine.cycle_period
    history = record.history
    assert history is not None
    shown = min(cycles, len(record)) * history.shape[1]
    ax.plot(time[-shown:], history[..., 2].ravel()[-shown:], lw=0.8)
    ax.set(xlabel="time [cycles]", ylabel="contact force [N]", title="Time history")
    return ax


def peak_force_history(record: CycleRecord, ax: Axes | None = None) -> Axes:
    """Peak force of every cycle, one colour a side: step I of the Two-Step Test."""
    ax = _axes(ax)
    for column, side in enumerate(record.machine.sides):
        ax.plot(record.peak_force[:, column], ".", ms=3, label=side)
    ax.set(xlabel="cycle", ylabel="peak force [N]", ylim=(0.0, None), title="Peak force of every cycle")
    ax.legend(loc="upper right", fontsize=8)
    return ax


def phase_portrait(record: CycleRecord, ax: Axes | None = None) -> Axes:
    """Velocity against displacement of the monitored joint, from a record with a time history."""
    ax = _axes(ax)
    time = record.time
    history = record.history
    assert history is not None
    phase_plane(history[..., 0].ravel(), history[..., 1].ravel(), ax)
    ax.set(title=f"Phase portrait, {time[-1]:.2f} s")
    return ax


def poincare_section(record: CycleRecord, ax: Axes | None = None) -> Axes:
    """Displacement and velocity once a cycle: step II of the Two-Step Test."""
    ax = _axes(ax)
    section_points(record.displacement, record.velocity, ax)
    ax.set(title="Poincaré section")
    return ax


def spectrum(record: CycleRecord, ax: Axes | None = None) -> Axes:
    """Power spectrum of the stroboscopic displacement: lines or a broad band."""
    ax = _axes(ax)
    found = power_spectrum(record.displacement)
    largest = float(found.power.max())
    level = (
        10.0 * np.log10(np.maximum(found.power / largest, 1e-16)) if largest > 0.0 else np.full(len(found.power), -160)
    )
    ax.plot(found.frequency, level, lw=0.8)
    ax.set(
        xlabel="frequency [oscillations per cycle]", ylabel="power [dB of the largest]", ylim=(-165, 5),
        title=f"Spectrum, one sample a cycle; floor {found.floor:.1e}",
    )  # fmt: skip
    return ax


def orbit_diagram(records: Sequence[CycleRecord], ax: Axes | None = None, *, side: int = 0) -> Axes:
    """Peak forces of every recorded cycle against speed, one column of points a record."""
    ax = _axes(ax)
    field = records[0].machine.speed_field
    unit = parameters_of(records[0].machine)[field].unit
    for record in records:
        peaks = record.peak_force[:, side]
        ax.plot(np.full(len(peaks), getattr(record.machine, field)), peaks, ",", color="black")
    ax.set(
        xlabel=f"{field.replace('_', ' ')} [{unit}]", ylabel="peak force [N]", ylim=(0.0, None), title="Orbit diagram"
    )
    return ax


def exponent_history(exponent: LyapunovExponent, ax: Axes | None = None) -> Axes:
    """Means of successive blocks of a largest Lyapunov exponent, and three standard errors about their mean."""
    ax = _axes(ax)
    blocks = np.array(exponent.history)
    cycle = (np.arange(len(blocks)) + 0.5) * (exponent.cycles / len(blocks))
    ax.plot(cycle, blocks, "o-", ms=3, lw=0.8, label="blocks")
    ax.plot(cycle, np.cumsum(blocks) / np.arange(1, len(blocks) + 1), label="running mean")
    error = 3.0 * exponent.standard_error
    ax.axhspan(exponent.per_cycle - error, exponent.per_cycle + error, alpha=0.2, label="3 standard errors")
    ax.axhline(0.0, color="black", lw=0.6)
    ax.set(xlabel="cycle", ylabel="exponent [1/cycle]", title="Largest Lyapunov exponent")
    ax.legend(fontsize=8)
    return ax


def response_map(result: ResponseMap, ax: Axes | None = None) -> Axes:
    """Types over speed and clearance."""
    ax = _axes(ax)
    codes = np.array([[TYPES.index(kind) for kind in row] for row in result.type.tolist()])
    colours = ListedColormap([TYPE_COLOURS[kind] for kind in TYPES])
    norm = BoundaryNorm(np.arange(len(TYPES) + 1) - 0.5, len(TYPES))
    ax.pcolormesh(cell_edges(result.speed), 1e3 * cell_edges(result.clearance), codes.T, cmap=colours, norm=norm)
    field = result.machine.speed_field
    unit = parameters_of(result.machine)[field].unit
    ax.set(xlabel=f"{field.replace('_', ' ')} [{unit}]", ylabel="clearance [mm]", title="Response types")
    handles = [Patch(color=colour, label=kind) for kind, colour in TYPE_COLOURS.items() if kind in result.type]
    ax.legend(handles=handles, loc="upper left", fontsize=8, ncols=4)
    return ax
