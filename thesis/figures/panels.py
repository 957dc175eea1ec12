"""Panels that several figures share: each function takes names of parts and gives a panel."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from matplotlib.axes import Axes

from chaosgym.arrays import Array
from chaosgym.design.peak_impacts import PeakImpactDiagram
from chaosgym.design.statistics import histogram
from chaosgym.plotting.design import impact_diagram
from chaosgym.plotting.style import ACCENT, BAD
from chaosgym.series import power_spectrum
from thesis import plotting as thesis
from thesis.figures.computations import Data
from thesis.figures.figure import Finding, Panel, Parts
from thesis.figures.findings import compare_nature, compare_response
from thesis.figures.printed import printed
from thesis.scorecard.crank_runs import ANGLE_CYCLES, revolution_angles


@dataclass(frozen=True)
class ParameterAxis:
    """A horizontal axis: which column of a part it shows, its label, and the factor to the shown unit."""

    field: str
    label: str
    factor: float = 1.0
    unit: str = ""


FREQUENCY = ParameterAxis("excitation_frequency", "excitation frequency [Hz]", 1.0, "Hz")
CRANK_SPEED = ParameterAxis("crank_speed", "crank speed [rpm]", 1.0, "rpm")


@dataclass(frozen=True)
class Mark:
    """A printed force or nature at a value of the axis, in the shown unit.

    Attributes
    ----------
    at
        Where.
    target
        Statement that holds the force, or the nature if ``force`` is "none".
    nature
        Printed nature, or None.
    force
        "mean or range", "largest" or "none".
    sensitivity
        Parameter that the statement is about.
    """

    at: float
    target: str
    nature: str | None = None
    force: Literal["mean or range", "largest", "none"] = "mean or range"
    sensitivity: str = ""


def response_at(data: Data, axis: ParameterAxis, at: float) -> tuple[Array, Any, Any]:
    """Peaks, nature and period of the run nearest to a value of the axis."""
    k = int(np.argmin(np.abs(axis.factor * data[axis.field] - at)))
    return data["peaks"][k], data["nature"][k], data["period"][k]


@dataclass(frozen=True)
class ForceDiagram:
    """Peak forces of every cycle against a parameter, with what the text prints."""

    title: str
    part: str
    axis: ParameterAxis
    marks: tuple[Mark, ...] = ()
    bands: tuple[tuple[str, str], ...] = ()
    """Type and statement of each printed band."""
    natures: tuple[tuple[float, str], ...] = ()
    """Printed natures at values of the axis, besides those of the marks."""
    top: float | None = None
    """Upper end of the force axis [N]."""
    extra: Callable[[Parts, Axes], object] = field(default=lambda parts, ax: None)

    def paint(self, parts: Parts, ax: Axes) -> None:
        """Draw the diagram."""
        data = parts[self.part]
        values = self.axis.factor * data[self.axis.field]
        thesis.force_points(values, data["peaks"], data["nature"], ax)
        shown = [mark for mark in self.marks if mark.force != "none"]
        thesis.printed_forces([thesis.PrintedForce(mark.at, *printed(mark.target)) for mark in shown], ax)
        told = [(mark.at, mark.nature or "") for mark in self.marks if mark.force == "none"]
        thesis.printed_natures([*told, *self.natures], ax)
        thesis.type_bands([thesis.TypeBand(kind, *printed(target)) for kind, target in self.bands], ax)
        ax.set_xlabel(self.axis.label)
        self.extra(parts, ax)
        ax.set_ylim(0.0, self.top or 1.18 * ax.get_ylim()[1])
        thesis.legend(ax, "upper left", columns=4)

    def findings(self, parts: Parts) -> Sequence[Finding]:
        """Compare at every mark."""
        found = []
        for mark in self.marks:
            response = response_at(parts[self.part], self.axis, mark.at)
            where = f"{mark.at:g} {self.axis.unit}".strip()
            if mark.force == "none":
                found.append(compare_nature(where, mark.target, response, mark.nature or "", mark.sensitivity))
            else:
                found.append(
                    compare_response(
                        where,
                        mark.target,
                        response,
                        mark.nature,
                        largest_only=mark.force == "largest",
                        sensitivity=mark.sensitivity,
                    )
                )
        return found

    def panel(self) -> Panel:
        """The panel."""
        return Panel(self.title, self.paint, self.findings, pad=26.0 if self.bands else None)


def force_diagram(title: str, part: str, axis: ParameterAxis, **options: Any) -> Panel:
    """Peak forces against a parameter; options are the fields of ``ForceDiagram``."""
    return ForceDiagram(title, part, axis, **options).panel()


def motion_panel(title: str, part: str) -> Panel:
    """Displacement against time."""

    def paint(parts: Parts, ax: Axes) -> None:
        thesis.curve(parts[part]["time"], 1e3 * parts[part]["displacement"], ax)
        ax.set(xlabel="time [s]", ylabel="displacement [mm]")

    return Panel(title, paint)


def one_sided_force(data: Data) -> Array:
    """Contact force on the upper surface [N]."""
    return np.maximum(data["force"], 0.0)


def force_panel(
    title: str, part: str, *, levels: str | None = None, resultant: bool = False, extra: Any = None
) -> Panel:
    """Contact force on one side, or the ``resultant`` of both, against time.

    ``levels`` is a statement with the printed range of its peaks; ``extra`` draws what else is printed.
    """

    def paint(parts: Parts, ax: Axes) -> None:
        force = np.abs(parts[part]["force"]) if resultant else one_sided_force(parts[part])
        thesis.curve(parts[part]["time"], force, ax)
        if extra is not None:
            extra(parts[part], ax)
            thesis.legend(ax, "upper right")
        if levels is not None:
            thesis.printed_level(*printed(levels), ax, "range of the peaks, printed")
            ax.set_ylim(0.0, 1.25 * max(printed(levels).high, float(np.max(parts[part]["force"]))))
            thesis.legend(ax, "upper right")
        ax.set(xlabel="time [s]", ylabel="impact force [N]")
        ax.set_ylim(bottom=0.0)

    return Panel(title, paint)


def phase_panel(title: str, part: str) -> Panel:
    """Velocity against displacement."""
    return Panel(title, lambda parts, ax: thesis.phase_plane(parts[part]["displacement"], parts[part]["velocity"], ax))


def section_panel(title: str, part: str) -> Panel:
    """One point a cycle."""

    def paint(parts: Parts, ax: Axes) -> None:
        displacement, velocity = parts[part]["section"].T
        thesis.section_points(displacement, velocity, ax)

    return Panel(title, paint)


def spectrum_panel(title: str, part: str, frequency: float, highest: float) -> Panel:
    """Spectrum of the displacement up to a highest frequency [Hz]; ``frequency`` is that of the cycle [Hz]."""

    def paint(parts: Parts, ax: Axes) -> None:
        data = parts[part]
        found = power_spectrum(data["displacement"])
        hertz = found.frequency / (data["time"][1] - data["time"][0])
        shown = hertz <= highest
        thesis.line_spectrum(hertz[shown], found.power[shown], frequency, ax)

    return Panel(title, paint)


def angle_panel(title: str, part: str, label: str, *, sign: bool, extra: Any = None) -> Panel:
    """Contact force over a revolution against the crank angle: the first one with a gap, if there is one.

    ``sign`` tells upper from lower surface.
    """

    def paint(parts: Parts, ax: Axes) -> None:
        several = parts[part]["force"].reshape(ANGLE_CYCLES, -1)
        gaps = [revolution_angles(np.abs(one))["loss"] is not None for one in several]
        force = several[int(np.argmax(gaps))]
        thesis.curve(np.arange(len(force)) * (360.0 / len(force)), force if sign else np.abs(force), ax)
        if extra is not None:
            extra(ax)
        low, high = ax.get_ylim()
        ax.set(xlabel="crank angle [deg]", ylabel=label, xlim=(0.0, 360.0), ylim=(low if sign else 0.0, 1.2 * high))
        ax.set_xticks(np.arange(0.0, 361.0, 45.0))
        thesis.legend(ax, "upper right")

    return Panel(title, paint)


def cycles_panel(
    title: str,
    series: Sequence[tuple[str, int, str]],
    *,
    cycles: tuple[int, int] | None = None,
    joined: bool = True,
    extra: Any = None,
) -> Panel:
    """Peak force of every cycle from rest; ``series`` holds part, row and label of each run, the last one thinnest."""

    def paint(parts: Parts, ax: Axes) -> None:
        widths = (3.0, 1.0) if len(series) > 1 else (1.0,)
        for (part, row, label), colour, width in zip(series, (ACCENT, BAD), widths, strict=False):
            peaks = parts[part]["peaks"][row]
            number = np.arange(1, len(peaks) + 1)
            style = "-o" if joined else "o"
            ax.plot(
                number,
                peaks,
                style,
                ms=2.0 + width if joined else 1.8,
                lw=0.8 * width,
                mew=0.0,
                color=colour,
                label=label,
                rasterized=not joined,
            )
        ax.set(xlabel="cycle", ylabel="peak impact force [N]")
        if cycles is not None:
            ax.set_xlim(*cycles)
        if extra is not None:
            extra(parts, ax)
        ax.set_ylim(0.0, 1.1 * ax.get_ylim()[1])
        thesis.legend(ax, "lower right")

    return Panel(title, paint)


def histogram_panel(title: str, part: str, row: int, *, support: str | None = None) -> Panel:
    """Histogram of the peak forces of one run; ``support`` is a statement with the printed range."""

    def paint(parts: Parts, ax: Axes) -> None:
        peaks = parts[part]["peaks"]
        thesis.histogram_bars(histogram(peaks[row], bins=40), ax)
        ax.set_xlim(0.9 * float(np.nanmin(peaks)), 1.06 * float(np.nanmax(peaks)))
        if support is not None:
            thesis.printed_span(*printed(support), ax, "printed range")
        thesis.legend(ax, "upper right")

    return Panel(title, paint)


def impact_panel(title: str, part: str, cycles: int | None = None, *, spread: float | None = None) -> Panel:
    """Peak Impact Diagram of the first ``cycles`` impacts; places count from the mean of all.

    ``spread`` is the printed length of bearing over which they lie, in the shown unit (mm or deg).
    """

    def paint(parts: Parts, ax: Axes) -> None:
        data = parts[part]
        unit = str(data["unit"])
        place = data["location"] - np.mean(data["location"])
        impact_diagram(PeakImpactDiagram(place[:cycles], data["force"][:cycles], unit), ax)
        shown = "mm" if unit == "m" else "deg"
        factor = 1e3 if unit == "m" else 1.0
        margin = 0.1 * factor * float(np.ptp(place)) + 0.5
        half = 0.5 * (spread or 0.0)
        ax.set_xlim(
            min(factor * float(np.min(place)), -half) - margin, max(factor * float(np.max(place)), half) + margin
        )
        if spread is not None:
            thesis.printed_span(-half, half, ax, f"spread of {spread:.3g} {shown}, printed")
            thesis.legend(ax, "lower right")
        ax.set(xlabel=f"relative location of the peak impact [{shown}]", ylabel="peak impact force [N]")
        ax.set_ylim(0.0, 1.1 * float(np.max(data["force"])))

    return Panel(title, paint)
