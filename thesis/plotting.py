"""Drawings of the thesis' figures: one function a kind of figure, on plain arrays.

Every function draws on an ``Axes`` and returns it. Printed values are marked in one colour throughout.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.design.statistics import Histogram
from chaosgym.plotting.response import curve as curve
from chaosgym.plotting.response import phase_plane as phase_plane
from chaosgym.plotting.response import section_points as section_points
from chaosgym.plotting.style import ACCENT, INK, MUTED, NATURE_COLOURS, TYPE_COLOURS

PRINTED_COLOUR = "#b8860b"
"""Of everything that the text of the thesis prints."""

PRINTED: Any = {"color": PRINTED_COLOUR, "zorder": 6}


class PrintedForce(NamedTuple):
    """A printed force, or range of forces [N], at a value of the axis."""

    at: float
    low: float
    high: float


class TypeBand(NamedTuple):
    """A printed range of the axis with one response type."""

    type: str
    low: float
    high: float


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


def line_spectrum(frequency: Array, power: Array, cycle_frequency: float, ax: Axes) -> Axes:
    """Spectrum of a motion in dB of its largest line; triangles stand at multiples of the cycle's frequency [Hz]."""
    level = 10.0 * np.log10(np.maximum(power / np.max(power), 1e-12))
    ax.plot(frequency, level, lw=0.8, color=ACCENT)
    multiples = np.arange(cycle_frequency, frequency[-1] + 1e-9, cycle_frequency)
    ax.plot(multiples, np.full(len(multiples), 5.0), "v", ms=3, color=MUTED)
    ax.set(xlabel="frequency [Hz]", ylabel="power [dB of the largest]", ylim=(-100.0, 10.0), xlim=(0.0, frequency[-1]))
    return ax


def printed_forces(marks: Sequence[PrintedForce], ax: Axes) -> Axes:
    """Forces that the text prints: a diamond for one value, a bar beside the points for a range."""
    beside = 0.008 * float(np.ptp(ax.get_xlim()))
    for mark in marks:
        if mark.low == mark.high:
            ax.plot(mark.at, mark.low, "D", mfc="none", ms=6.0, mew=1.4, **PRINTED)
        else:
            middle, half = 0.5 * (mark.low + mark.high), 0.5 * (mark.high - mark.low)
            ax.errorbar(mark.at + beside, middle, half, fmt="none", capsize=4.0, elinewidth=1.6, **PRINTED)
    if marks:
        ax.plot([], [], "D", mfc="none", ms=6.0, mew=1.4, label="printed", **PRINTED)
    return ax


def printed_natures(marks: Sequence[tuple[float, str]], ax: Axes) -> Axes:
    """Natures that the text prints: a word beside a dotted line at each value of the axis."""
    for at, word in marks:
        ax.axvline(at, ls=":", lw=1.1, **PRINTED)
        ax.text(
            at,
            0.02,
            f"{word}, printed",
            rotation=90,
            ha="right",
            va="bottom",
            fontsize=7.0,
            transform=ax.get_xaxis_transform(),
            **PRINTED,
        )
    return ax


def type_bands(bands: Sequence[TypeBand], ax: Axes) -> Axes:
    """Printed ranges of the response types, as strips above the axes' frame."""
    for k, band in enumerate(bands):
        height = 1.015 + 0.05 * (k % 2)
        colour = TYPE_COLOURS[band.type]
        ax.axvspan(band.low, band.high, height, height + 0.045, color=colour, alpha=0.55, lw=0, clip_on=False)
        ax.text(
            0.5 * (band.low + band.high),
            height + 0.02,
            f"Type {band.type} (printed)",
            ha="center",
            va="center",
            fontsize=7.0,
            transform=ax.get_xaxis_transform(),
            color=INK,
        )
    return ax


def legend(ax: Axes, place: Any = "best", columns: int = 1) -> Axes:
    """Legend of what has a label, if anything has."""
    handles, _ = ax.get_legend_handles_labels()
    if handles:
        ax.legend(loc=place, fontsize=8.0, ncols=columns)
    return ax


def nature_plane(
    speed: Array, clearance: Array, nature: NDArray[Any], ax: Axes, *, types: NDArray[Any] | None = None
) -> Axes:
    """Natures over speed (m,) and clearance (n,): open circles periodic, dots chaotic, stars without impacts.

    ``nature`` and ``types`` are (m, n); types are shaded.
    """
    if types is not None:
        shade = np.array([[_rgba(TYPE_COLOURS[str(kind)]) for kind in row] for row in types])
        ax.pcolormesh(cell_edges(speed), cell_edges(clearance), np.swapaxes(shade, 0, 1), rasterized=True)
    x, y = np.meshgrid(speed, clearance, indexing="ij")
    styles: dict[str, dict[str, Any]] = {
        "periodic": {"marker": "o", "mfc": "white", "mec": INK, "mew": 0.7, "ms": 3.6},
        "chaotic": {"marker": "o", "color": INK, "mew": 0.0, "ms": 3.8},
        "no impacts": {"marker": "*", "color": MUTED, "mew": 0.0, "ms": 4.5},
        "quasiperiodic": {"marker": "D", "color": NATURE_COLOURS["quasiperiodic"], "mew": 0.0, "ms": 3.2},
        "undetermined": {"marker": "_", "color": INK, "mew": 0.8, "ms": 4.0},
        "failed": {"marker": "x", "color": INK, "mew": 0.8, "ms": 4.0},
    }
    handles: list[Any] = []
    for kind, style in styles.items():
        here = nature == kind
        if np.any(here):
            ax.plot(x[here], y[here], ls="", **style)
            handles.append(Line2D([], [], ls="", label=kind, **style))
    if types is not None:
        handles += [
            Patch(color=_rgba(colour), label=f"Type {kind}" if len(kind) <= 3 else f"type {kind}")
            for kind, colour in TYPE_COLOURS.items()
            if np.any(types == kind)
        ]
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8.0)
    ax.grid(visible=False)
    return ax


def _rgba(colour: str) -> tuple[float, float, float]:
    """A colour mixed with white."""
    red, green, blue = (int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5))
    return (0.55 + 0.45 * red, 0.55 + 0.45 * green, 0.55 + 0.45 * blue)


def cell_edges(centres: ArrayLike) -> Array:
    """Edges of the cells about ascending centres."""
    values = np.asarray(centres, dtype=float)
    if len(values) == 1:
        return np.array([0.99 * values[0], 1.01 * values[0]])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[2.0 * values[0] - middle[0]], middle, [2.0 * values[-1] - middle[-1]]])


def histogram_bars(found: Histogram, ax: Axes) -> Axes:
    """Number of cycles by peak force [N]; triangles at the modes."""
    ax.bar(found.edges[:-1], found.count, np.diff(found.edges), align="edge", color=ACCENT, alpha=0.8, lw=0)
    top = 1.06 * float(np.max(found.count))
    ax.plot(found.modes, np.full(len(found.modes), top), "v", ms=5, color=INK, label="modes")
    ax.set(xlabel="peak impact force [N]", ylabel="cycles", ylim=(0.0, 1.25 * top))
    return ax


def mean_and_deviation(x: Array, mean: Array, deviation: Array, ax: Axes) -> Axes:
    """Mean peak force [N] with one standard deviation either side."""
    ax.errorbar(x, mean, deviation, fmt="o", ms=4.0, lw=1.0, capsize=3.0, color=ACCENT)
    ax.set_ylabel("mean and one STD [N]")
    return ax


def relative_lives(x: Array, lowest: Array, highest: Array, statistical: Array, ax: Axes) -> Axes:
    """Life relative to a reference: range that single peaks suggest, and statistical mean life (figure 5.12)."""
    ax.vlines(x, lowest, highest, color=MUTED, lw=2.5, alpha=0.6, label="by single peaks")
    ax.plot(x, statistical, "-o", ms=3.0, lw=1.2, color=INK, label="statistical mean life, eq. 5.4")
    ax.set(yscale="log", ylabel="relative fatigue life")
    return ax


def printed_span(low: float, high: float, ax: Axes, label: str | None = "printed") -> Axes:
    """A printed range of the horizontal axis, shaded; a line where both ends agree."""
    if high > low:
        ax.axvspan(low, high, color=PRINTED_COLOUR, alpha=0.18, lw=0, label=label, zorder=0)
    else:
        ax.axvline(low, ls="--", lw=1.2, label=label, **PRINTED)
    return ax


def printed_level(low: float, high: float, ax: Axes, label: str | None = "printed") -> Axes:
    """A printed range of the vertical axis: a line at either end."""
    for k, level in enumerate(sorted({low, high})):
        ax.axhline(level, ls="--", lw=1.1, label=None if k else label, **PRINTED)
    return ax
