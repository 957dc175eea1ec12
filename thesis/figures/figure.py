"""A figure of the thesis, and what its comparison with the print says."""

import textwrap
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.plotting.style import STYLE
from thesis.figures.computations import Computation, Data

Parts = Mapping[str, Data]
"""Results by the name of their part of the figure."""


class Finding(NamedTuple):
    """One statement of the text beside what the machine here does.

    Attributes
    ----------
    printed, here
        What the text says, and what is found here, in words and numbers.
    agrees
        Whether they agree; None where the text gives nothing to decide it by.
    targets
        Names of the statements in the table of the reference.
    sensitivity
        Parameter to which the response is said to be sensitive, if the statement is about that.
    scored
        Whether the scorecard's row of the statement tells all of this.
    """

    printed: str
    here: str
    agrees: bool | None
    targets: tuple[str, ...] = ()
    sensitivity: str = ""
    scored: bool = False


def _no_findings(parts: Parts) -> Sequence[Finding]:
    return ()


@dataclass(frozen=True)
class Panel:
    """One set of axes: how it is drawn, and what its marks say."""

    title: str
    paint: Callable[[Parts, Axes], object]
    findings: Callable[[Parts], Sequence[Finding]] = _no_findings
    pad: float | None = None
    """Room between title and axes [points]."""


@dataclass(frozen=True, kw_only=True)
class ThesisFigure:
    """A figure: what it shows in the thesis, what has to be computed, how it is drawn and compared.

    Attributes
    ----------
    id
        Number in the thesis, or a word for what is drawn beside them.
    title
        Of the whole figure.
    shows
        What the thesis shows, in a sentence.
    parts
        Computations by name, for a resolution: 1 is the usual one, 2 has twice the points.
    panels
        From top to bottom, by rows.
    columns
        Panels in a row.
    height
        Of one panel [inch].
    compare
        Findings beyond those of the panels.
    remark
        How the figure differs from that of the thesis, if it does.
    """

    id: str
    title: str
    shows: str
    parts: Callable[[float], Mapping[str, Computation]]
    panels: tuple[Panel, ...]
    columns: int = 1
    height: float = 2.9
    compare: Callable[[Parts], Sequence[Finding]] = _no_findings
    remark: str = ""

    def draw(self, parts: Parts) -> Figure:
        """Draw all panels."""
        rows = -(-len(self.panels) // self.columns)
        with rc_context(STYLE):
            figure = Figure(
                figsize=(8.4 if self.columns == 1 else 10.4, self.height * rows + 0.5), layout="constrained"
            )
            title = textwrap.fill(f"{self.label}   {self.title}", 84 if self.columns == 1 else 104)
            figure.suptitle(title, x=0.01, ha="left", fontsize=11.5, fontweight="bold")
            grid = figure.subplots(rows, self.columns, squeeze=False).ravel()
            for panel, ax in zip(self.panels, grid, strict=False):
                panel.paint(parts, ax)
                ax.set_title(panel.title, fontweight="normal", pad=panel.pad)
            for ax in grid[len(self.panels) :]:
                ax.set_axis_off()
        return figure

    @property
    def label(self) -> str:
        """What the figure is called in a title."""
        return f"Figure {self.id}" if self.id[0].isdigit() else self.id

    def findings(self, parts: Parts) -> list[Finding]:
        """What agrees with the print and what does not."""
        return [*(finding for panel in self.panels for finding in panel.findings(parts)), *self.compare(parts)]


def steps(low: float, high: float, step: float, *also: float) -> tuple[float, ...]:
    """Evenly spaced values from ``low`` to ``high``, both included, and values that must be among them."""
    count = max(2, round((high - low) / step) + 1)
    values = {float(f"{value:.9g}") for value in (*np.linspace(low, high, count), *also)}
    return tuple(sorted(values))
