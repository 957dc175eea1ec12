"""One look for every picture: colours that colour-blind readers tell apart, and the settings of a figure."""

from typing import Any

from matplotlib.figure import Figure

INK, ACCENT, BAD, MUTED, PALE = "#22303c", "#1f6f8b", "#b3392f", "#8a97a3", "#e6eaee"
"""Text, data, what is bad, what stands behind, and grids and stops."""

NATURE_COLOURS = {"periodic": ACCENT, "quasiperiodic": "#8e5ea2", "chaotic": "#d1495b", "undetermined": MUTED}
"""One colour a nature."""

TYPE_COLOURS = {"I": "#3b7dd8", "II": "#f2a93b", "III": "#d1495b", "undetermined": "#bbbbbb"}
"""One colour a response type."""

STYLE: Any = {
    "font.size": 9.5,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlesize": 10.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": PALE,
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "svg.hashsalt": "chaosgym",
    "svg.fonttype": "path",
}
"""Settings for ``matplotlib.rc_context`` around a figure."""


def figure_of(width: float = 6.2, height: float = 3.7) -> Figure:
    """Empty figure of a width and height [in]."""
    return Figure(figsize=(width, height), layout="constrained")
