"""Statistics of the crank's forces for a designer. Figures 5.8 to 5.14."""

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from chaosgym.design.fatigue import CUBIC_EXPONENT, RelativeLife, equivalent_force, relative_life
from chaosgym.design.peak_impacts import PeakImpactDiagram, filling_cycles
from chaosgym.design.statistics import convergence, histogram, running_statistics
from thesis import plotting as thesis
from thesis.figures.computations import Computation, PeakImpacts
from thesis.figures.crank import (
    HIGH_DAMPING,
    LARGE,
    LOW_DAMPING,
    MIDDLE,
    SECTION_4_4_DAMPING,
    SMALL,
    TRANSIENT,
    WIDE,
    ball,
    runs,
    slider,
    sweep,
)
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from thesis.figures.findings import compare_response
from thesis.figures.panels import CRANK_SPEED, histogram_panel, impact_panel
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding
from thesis.scorecard.crank_runs import CLOUD_CYCLES

HISTOGRAM_CLEARANCES = (SMALL, MIDDLE, WIDE)


def clearance_histograms(resolution: float) -> Mapping[str, Computation]:
    """Long records at three clearances."""
    machines = [slider(gap, crank_speed=250.0, contact_damping_ratio=LOW_DAMPING) for gap in HISTOGRAM_CLEARANCES]
    return {"long": runs(machines, "slider_clearance", cycles=round(2000 * resolution))}


def spread_modes(parts: Parts) -> Sequence[Finding]:
    """Modes of each histogram."""
    data = parts["long"]
    found = []
    for gap, peaks, nature in zip(HISTOGRAM_CLEARANCES, data["peaks"], data["nature"], strict=True):
        modes = len(histogram(peaks).modes)
        here = f"{nature}, {peaks.min():.3g} to {peaks.max():.3g} N, {modes} mode{'s' * (modes > 1)}"
        found.append(Finding(f"±{1e3 * gap:.3f} mm: measured histogram with several peaks", here, None, ("SSC-120",)))
    return found


CLEARANCE_HISTOGRAMS = ThesisFigure(
    id="5.8",
    title="Simulated counterpart: histograms of the peak force in the slider joint, 250 rpm",
    shows="Measured histograms with several peaks at three clearances.",
    parts=clearance_histograms,
    panels=tuple(
        histogram_panel(f"({name}) ±{1e3 * gap:.3f} mm", "long", row)
        for row, (name, gap) in enumerate(zip("abc", HISTOGRAM_CLEARANCES, strict=True))
    ),
    height=2.4,
    compare=spread_modes,
    remark="that figure is measured; contact damping 2.5 %",
)

WILD = slider(LARGE, crank_speed=190.0, contact_damping_ratio=HIGH_DAMPING)


def wild_record(cycles: int, resolution: float) -> Mapping[str, Computation]:
    """A record at 190 rpm and the large clearance, and the 50 cycles that figure 4.14 shows of it."""
    return {"long": runs([WILD], cycles=cycles), "shown": runs([WILD])}


def support(parts: Parts) -> Sequence[Finding]:
    """Range and modes of the histogram."""
    shown = parts["shown"]
    response = shown["peaks"][0], shown["nature"][0], shown["period"][0]
    modes = len(histogram(parts["long"]["peaks"][0]).modes)
    return [
        compare_response("190 rpm, 50 cycles", "SSC-056", response, "chaotic"),
        Finding("several peaks in the histogram", f"{modes} mode{'s' * (modes > 1)}", modes > 1, ("SSC-121",)),
    ]


SLIDER_HISTOGRAM = ThesisFigure(
    id="5.9",
    title="Histogram of the peak force in the slider joint: ±0.254 mm, 190 rpm",
    shows="A bounded distribution with several peaks.",
    parts=partial(wild_record, 3000),
    panels=(histogram_panel("", "long", 0, support="SSC-056"),),
    compare=support,
)


HALF_BEARING = 180.0
"""Of the ball joint [deg]."""


def ball_clouds(resolution: float) -> Mapping[str, Computation]:
    """Peak impacts in the ball joint."""
    machines = {"a": ball(MIDDLE, crank_speed=120.0), "b": ball(LARGE, crank_speed=110.0)}
    clouds = {
        name: PeakImpacts(machine=machine, cycles=CLOUD_CYCLES, transient=TRANSIENT)
        for name, machine in machines.items()
    }
    return {**clouds, **scored("SSC-122", "SSC-123")}


def ball_spread(parts: Parts) -> Sequence[Finding]:
    """Share of half the bearing, 180 deg, over which the impacts spread."""
    return [
        scored_finding(parts, "SSC-122", "±0.064 mm, 120 rpm: impacts spread over a sixth of half the bearing"),
        scored_finding(
            parts,
            "SSC-123",
            "±0.245 mm, 110 rpm: impacts spread over almost all of half the bearing",
            sensitivity="clearance",
        ),
    ]


BALL_CLOUDS = ThesisFigure(
    id="5.10",
    title="Peak Impact Diagrams of the ball joint, spherical clearance",
    shows="Impacts spread over a sixth of half the bearing at ±0.064 mm, over almost all of it at ±0.245 mm.",
    parts=ball_clouds,
    panels=(
        impact_panel("(a) ±0.064 mm, 120 rpm", "a", spread=HALF_BEARING * printed("SSC-122").low),
        impact_panel("(b) ±0.254 mm, 110 rpm", "b", spread=HALF_BEARING * printed("SSC-123").low),
    ),
    compare=ball_spread,
    remark="(b) at ±0.254 mm: the printed 0.245 mm is not on the grid of the other clearances",
)

GUIDED = slider(WIDE, crank_speed=190.0, contact_damping_ratio=HIGH_DAMPING)


def slider_cloud(resolution: float) -> Mapping[str, Computation]:
    """Peak impacts on the guide."""
    return {"cloud": PeakImpacts(machine=GUIDED, cycles=CLOUD_CYCLES, transient=TRANSIENT), **scored("SSC-124")}


def guide_spread(parts: Parts) -> Sequence[Finding]:
    """Length of guide over which the impacts spread."""
    return [scored_finding(parts, "SSC-124", f"impacts spread over {printed('SSC-124').low:g} mm of the guide")]


SLIDER_CLOUD = ThesisFigure(
    id="5.11",
    title="Peak Impact Diagram of the slider joint: ±0.127 mm, 190 rpm",
    shows="Impacts spread over 6 mm of the guide.",
    parts=slider_cloud,
    panels=(impact_panel("", "cloud", spread=printed("SSC-124").low),),
    compare=guide_spread,
)


def life_sweep(resolution: float) -> Mapping[str, Computation]:
    """Peak forces over the speed, as in figure 4.13."""
    machine = slider(SMALL, contact_damping_ratio=SECTION_4_4_DAMPING)
    return {"slider": sweep(machine, "crank_speed", steps(100.0, 300.0, 10.0 / max(1, round(resolution))))}


def lives(parts: Parts) -> list[RelativeLife]:
    """Life relative to that at 100 rpm."""
    peaks = parts["slider"]["peaks"]
    reference = equivalent_force(peaks[0], CUBIC_EXPONENT)
    return [relative_life(row, reference) for row in peaks]


def paint_lives(parts: Parts, ax: Axes) -> None:
    """Relative lives, and the measured ranges that the text gives."""
    lowest, highest, statistical = np.array(lives(parts)).T
    thesis.relative_lives(parts["slider"]["crank_speed"], lowest, highest, statistical, ax)
    for k, (speed, target) in enumerate(((140.0, "SSC-126"), (200.0, "SSC-127"), (210.0, "SSC-128"))):
        low, high = printed(target)
        ax.plot(
            [speed, speed],
            [low, high],
            "-D",
            ms=5,
            mfc="none",
            lw=1.4,
            label=None if k else "measured, printed",
            **thesis.PRINTED,
        )
    ax.set(xlabel=CRANK_SPEED.label)
    thesis.legend(ax, "lower left")


def life_ranges(parts: Parts) -> Sequence[Finding]:
    """Relative life at the three speeds of the text."""
    found = []
    speed = parts["slider"]["crank_speed"]
    for at, target in ((140.0, "SSC-126"), (200.0, "SSC-127"), (210.0, "SSC-128")):
        here = lives(parts)[int(np.argmin(np.abs(speed - at)))]
        low, high = printed(target)
        found.append(
            Finding(
                f"{at:g} rpm: measured relative life {low:g}" + (f" to {high:g}" if high > low else ""),
                f"{here.lowest:.2g} to {here.highest:.2g}, statistical mean {here.statistical:.2g}",
                None,
                (target,),
            )
        )
    return found


RELATIVE_LIVES = ThesisFigure(
    id="5.12",
    title="Simulated counterpart: relative fatigue life of the slider joint against crank speed, ±0.032 mm",
    shows="Measured lives relative to 100 rpm, by the cube of single peaks and by the statistical mean.",
    parts=life_sweep,
    panels=(Panel("", paint_lives),),
    height=3.8,
    compare=life_ranges,
    remark="that figure is measured; contact damping 2.5 %",
)


def filling(parts: Parts) -> Sequence[Finding]:
    """After how many impacts has the diagram taken shape?"""
    data = parts["cloud"]
    diagram = PeakImpactDiagram(data["location"], data["force"], str(data["unit"]))
    cycles = filling_cycles(diagram)
    wanted = printed("SSC-130").low
    return [
        Finding(
            f"the diagram takes shape after {wanted:g} cycles",
            f"95 % of the impacts fall into visited sections after {cycles} cycles"
            if cycles
            else f"not within {len(data['force'])} cycles",
            cycles is not None and 0.5 * wanted <= cycles <= 2.0 * wanted,
            ("SSC-130",),
        )
    ]


GROWING_CLOUD = ThesisFigure(
    id="5.13",
    title="Peak Impact Diagrams of the slider joint from records of growing length: ±0.127 mm, 190 rpm",
    shows="The diagram takes shape after 80 cycles.",
    parts=slider_cloud,
    panels=tuple(
        impact_panel(f"({name}) {cycles} cycles", "cloud", cycles)
        for name, cycles in zip("abc", (40, 60, 80), strict=True)
    ),
    height=2.5,
    compare=filling,
)


def running_panel(title: str, which: str, label: str) -> Panel:
    """Running mean or deviation."""

    def paint(parts: Parts, ax: Axes) -> None:
        running = running_statistics(parts["long"]["peaks"][0])
        thesis.curve(running.cycles, getattr(running, which), ax)
        thesis.printed_span(*printed("SSC-130"), ax, "converged, printed")
        ax.set(xlabel="number of cycles", ylabel=label)
        ax.set_ylim(0.0, 1.25 * ax.get_ylim()[1])
        thesis.legend(ax, "lower right")

    return Panel(title, paint)


def converged(parts: Parts) -> Sequence[Finding]:
    """After how many cycles do mean and deviation stay in their bands?"""
    wanted = printed("SSC-130").low
    found = convergence(parts["long"]["peaks"][0])
    return [
        Finding(
            f"mean and STD converge after {wanted:g} cycles",
            f"within 2 % and 15 % of their final values after {found.cycles} cycles; by their standard errors "
            f"{found.needed} cycles are needed",
            0.5 * wanted <= found.cycles <= 2.0 * wanted,
            ("SSC-130",),
        )
    ]


RUNNING_STATISTICS = ThesisFigure(
    id="5.14",
    title="Running statistics of the peak force: ±0.254 mm, 190 rpm",
    shows="Mean and standard deviation converge after 80 cycles.",
    parts=partial(wild_record, 200),
    panels=(
        running_panel("(a) mean", "mean", "mean [N]"),
        running_panel("(b) one standard deviation", "deviation", "STD [N]"),
    ),
    compare=converged,
)

FIGURES = (
    CLEARANCE_HISTOGRAMS,
    SLIDER_HISTOGRAM,
    BALL_CLOUDS,
    SLIDER_CLOUD,
    RELATIVE_LIVES,
    GROWING_CLOUD,
    RUNNING_STATISTICS,
)
