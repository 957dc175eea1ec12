"""The beam's motion at one operating point. Figures 3.6, 3.7, 3.17 and 5.6."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

from matplotlib.axes import Axes

from chaosgym.machines import ImpactBeam
from thesis import plotting as thesis
from thesis.figures.beam import LARGE, TRANSIENT, runs
from thesis.figures.computations import Computation, ForcePointHistory, History
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure
from thesis.figures.findings import compare_nature, words
from thesis.figures.panels import (
    force_panel,
    motion_panel,
    phase_panel,
    section_panel,
    spectrum_panel,
)
from thesis.figures.printed import printed, within
from thesis.figures.scored import scored, scored_finding


def one_response(frequency: float, resolution: float) -> Mapping[str, Computation]:
    """Time history, spectrum, section and nature of the beam at the large clearance."""
    beam = replace(ImpactBeam(), excitation_frequency=frequency, clearance=LARGE)
    return {
        "history": History(machine=beam, cycles=6, transient=TRANSIENT, samples=2000),
        "long": History(machine=beam, cycles=256, transient=TRANSIENT, samples=128),
        "section": History(machine=beam, cycles=round(2000 * resolution), transient=TRANSIENT, samples=1),
        "response": runs([beam]),
    }


def nature_of(where: str, target: str, nature: str, parts: Parts) -> Sequence[Finding]:
    """Compare the nature of the one response."""
    data = parts["response"]
    return [compare_nature(where, target, (data["peaks"][0], data["nature"][0], data["period"][0]), nature)]


PERIODIC_RESPONSE = ThesisFigure(
    id="3.6",
    title="A periodic response: 19 Hz, ±0.127 mm",
    shows="Time history, phase plane, line spectrum and impact force of a periodic response.",
    parts=partial(one_response, 19.0),
    panels=(
        motion_panel("(a) displacement of the beam tip", "history"),
        phase_panel("(b) phase plane of the beam tip", "history"),
        spectrum_panel("(c) spectrum of the displacement; triangles: multiples of the excitation", "long", 19.0, 600.0),
        force_panel("(d) impact force on one side", "history"),
    ),
    columns=2,
    compare=partial(nature_of, "19 Hz", "IBS-013", "periodic"),
)

CHAOTIC_RESPONSE = ThesisFigure(
    id="3.7",
    title="A chaotic response: 30 Hz, ±0.127 mm",
    shows="Time history, phase plane, broad spectrum, irregular Poincaré map and impact force of a chaotic response.",
    parts=partial(one_response, 30.0),
    panels=(
        motion_panel("(a) displacement of the beam tip", "history"),
        phase_panel("(b) phase plane of the beam tip", "history"),
        spectrum_panel("(c) spectrum of the displacement; triangles: multiples of the excitation", "long", 30.0, 600.0),
        section_panel("(d) Poincaré map of the beam tip", "section"),
        force_panel("(e) impact force on one side", "history", levels="IBS-062"),
    ),
    columns=2,
    compare=partial(nature_of, "30 Hz", "IBS-014", "chaotic"),
)


def force_point(resolution: float) -> Mapping[str, Computation]:
    """Motion where the shaker pushes."""
    beam = replace(ImpactBeam(), excitation_frequency=30.0, clearance=LARGE)
    return {
        "motion": ForcePointHistory(machine=beam, cycles=12, transient=TRANSIENT),
        "response": runs([beam]),
        **scored("IBS-060", "IBS-061"),
    }


def with_levels(panel: Panel, target: str, *, vertical: bool = False) -> Panel:
    """A panel with a printed range of its vertical or, if ``vertical``, also of its horizontal axis."""

    def paint(parts: Parts, ax: Axes) -> None:
        panel.paint(parts, ax)
        thesis.printed_level(*printed(target), ax, "printed range")
        if vertical:
            for level in printed("IBS-060"):
                ax.axvline(level, ls="--", lw=1.1, **thesis.PRINTED)
        else:
            thesis.legend(ax, "upper right")

    return Panel(panel.title, paint)


def motion_ranges(parts: Parts) -> Sequence[Finding]:
    """Ranges of displacement, velocity and peak force."""
    peaks = parts["response"]["peaks"][0]
    low, high = float(peaks.min()), float(peaks.max())
    return [
        scored_finding(parts, "IBS-060", f"displacement of {words(printed('IBS-060'))} mm"),
        scored_finding(parts, "IBS-061", f"velocity of {words(printed('IBS-061'))} m/s"),
        Finding(
            f"peaks of {words(printed('IBS-062'))} N",
            f"{low:.3g} to {high:.3g} N",
            within("IBS-062", (low, high)),
            ("IBS-062",),
        ),
    ]


FORCE_POINT_MOTION = ThesisFigure(
    id="3.17",
    title="Motion where the shaker pushes: 30 Hz, ±0.127 mm",
    shows="Displacement, phase plane and impact force of the numerical model beside those of the experiment.",
    parts=force_point,
    panels=(
        with_levels(motion_panel("(a) displacement of the beam", "motion"), "IBS-060"),
        with_levels(phase_panel("(b) phase plane of the beam", "motion"), "IBS-061", vertical=True),
        force_panel("(c) impact force on one side", "motion", levels="IBS-062"),
    ),
    compare=motion_ranges,
    remark="the numerical half; the measured records are not in print",
)

FIGURES = (
    PERIODIC_RESPONSE,
    CHAOTIC_RESPONSE,
    FORCE_POINT_MOTION,
)
