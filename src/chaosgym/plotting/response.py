"""Drawings of a response: what moves, what hits, and how often. Plain arrays in; each draws on an ``Axes``."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from numpy.typing import ArrayLike, NDArray

from chaosgym.plotting.style import ACCENT, MUTED, NATURE_COLOURS, PALE

Array = NDArray[np.float64]


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


def force_points(values: Array, peaks: Array, nature: Sequence[str] | NDArray[Any], ax: Axes) -> Axes:
    """Peak forces (values, cycles) [N] against a parameter (values,), coloured by the nature of each response."""
    for kind, colour in NATURE_COLOURS.items():
        of_kind = np.asarray(nature) == kind
        if np.any(of_kind):
            shown = peaks[of_kind]
            across = np.repeat(values[of_kind], shown.shape[1])
            size = 3.0 if kind == "chaotic" else 4.5
            ax.plot(across, shown.ravel(), ".", ms=size, mew=0.0, color=colour, rasterized=True)
            ax.plot([], [], ".", ms=8.0, mew=0.0, color=colour, label=kind)
    middle = np.nanmean(peaks, axis=1)
    ax.plot(values, middle, lw=0.6, color=MUTED, zorder=1)
    ax.set_ylabel("peak impact force [N]")
    ax.margins(x=0.02)
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
