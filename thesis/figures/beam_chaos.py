"""The beam's chaos: its length, its announcement and the spread of its forces. Figures 5.4, 5.6 and 5.7."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from chaosgym.arrays import Array
from chaosgym.design.statistics import histogram
from chaosgym.machines import ImpactBeam
from chaosgym.plotting.style import ACCENT, NATURE_COLOURS
from thesis import plotting as thesis
from thesis.figures.beam import DAMPING, LARGE, SMALL, TRANSIENT, runs, sweep
from thesis.figures.computations import Computation, Data, History
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from thesis.figures.panels import cycles_panel, force_panel, histogram_panel
from thesis.figures.printed import printed
from thesis.figures.scored import agrees, scored, scored_finding

BRIEF_DAMPING, ENDLESS_DAMPING = 0.011, 0.010
"""Structural damping ratios of figure 5.4 (a) and (b)."""

LONGEST = 4000
"""Cycles of figure 5.4 (b)."""

HISTOGRAM_FREQUENCIES = (22.0, 25.0, 30.0)


def transient_chaos(resolution: float) -> Mapping[str, Computation]:
    """Runs from rest at the two printed dampings, and over the dampings around them."""
    beam = replace(ImpactBeam(), excitation_frequency=30.0, clearance=LARGE)
    around = steps(0.0090, 0.0130, 0.0001 / resolution, BRIEF_DAMPING, ENDLESS_DAMPING)
    return {
        "printed": sweep(beam, "damping_ratio", (BRIEF_DAMPING, ENDLESS_DAMPING), cycles=LONGEST, transient=0),
        "around": sweep(beam, "damping_ratio", around, cycles=2000, transient=0),
        **scored("IBS-069", "IBS-070", "IBS-071"),
    }


def paint_settling(parts: Parts, ax: Axes) -> None:
    """Cycle from which each run repeats, against its damping."""
    data = parts["around"]
    damping, settle, period = DAMPING.factor * data["damping_ratio"], data["settle"], data["period"]
    settled = settle >= 0
    ax.plot(
        damping[~settled],
        np.full(np.sum(~settled), data["peaks"].shape[1]),
        "^",
        ms=4,
        mew=0,
        color=NATURE_COLOURS["chaotic"],
        label="not settled",
    )
    ax.plot(damping[settled], settle[settled], "o", ms=4, mew=0, color=ACCENT, label="settled")
    for x, y, number in zip(damping[settled], settle[settled], period[settled], strict=True):
        ax.annotate(f"{number}", (x, y), xytext=(0, 4), textcoords="offset points", ha="center", fontsize=6.5)
    ax.plot(
        DAMPING.factor * BRIEF_DAMPING,
        printed("IBS-069").low,
        "D",
        ms=7,
        mfc="none",
        mew=1.6,
        label="printed, period 4",
        **thesis.PRINTED,
    )
    ax.set(xlabel=DAMPING.label, ylabel="cycle from which it repeats", yscale="log", ylim=(5.0, 6000.0))
    ax.legend(loc="lower left", ncols=3)


def settled_words(data: Data, row: int) -> str:
    """When one run settles, and on what."""
    if data["settle"][row] < 0:
        return f"no repetition within {data['peaks'].shape[1]} cycles"
    return f"period {data['period'][row]} from cycle {data['settle'][row]} on"


def transients(parts: Parts) -> Sequence[Finding]:
    """Does the chaos end at the printed damping, and where does it end around it?"""
    data, around = parts["printed"], parts["around"]
    wanted, period = printed("IBS-069").low, int(printed("IBS-070").low)
    long = (around["settle"] >= 100) & (around["settle"] <= 1000)
    columns = (around[name][long] for name in ("damping_ratio", "settle", "period"))
    places = [f"{100.0 * d:.3g} % (cycle {s}, period {p})" for d, s, p in zip(*columns, strict=True)]
    elsewhere = ", ".join(places[:6]) + (" ..." if len(places) > 6 else "") if places else "nowhere"
    return [
        Finding(
            f"at 1.1 % damping chaos for about {wanted:g} cycles, then period {period}",
            f"{settled_words(data, 0)}; of {len(long)} dampings from 0.9 to 1.3 % chaos ends between "
            f"cycles 100 and 1000 at {elsewhere}",
            agrees(parts, "IBS-069", "IBS-070"),
            ("IBS-069", "IBS-070"),
            "structural damping",
        ),
        Finding(
            "at 1.0 % chaotic up to 4000 cycles",
            settled_words(data, 1),
            agrees(parts, "IBS-071"),
            ("IBS-071",),
            "structural damping",
        ),
    ]


TRANSIENT_CHAOS = ThesisFigure(
    id="5.4",
    title="Transient chaos: 30 Hz, ±0.127 mm, from rest",
    shows="At 1.1 % damping chaos ends after about 350 cycles in period four; at 1.0 % it lasts for 4000 cycles.",
    parts=transient_chaos,
    panels=(
        cycles_panel(
            "(a) structural damping ratio 0.011",
            [("printed", 0, "")],
            cycles=(0, 1000),
            joined=False,
            extra=lambda parts, ax: thesis.printed_span(*printed("IBS-069"), ax, "end of chaos, printed"),
        ),
        cycles_panel("(b) structural damping ratio 0.010", [("printed", 1, "")], cycles=(0, LONGEST), joined=False),
        Panel("(c) where chaos ends around these dampings; numbers: period of what it settles on", paint_settling),
    ),
    compare=transients,
    remark="panel (c) looks for the transient around the printed damping",
)


def bouncing(resolution: float) -> Mapping[str, Computation]:
    """Impact force of a periodic and of a chaotic response."""
    beams = {
        "a": replace(ImpactBeam(), excitation_frequency=18.0, clearance=SMALL),
        "b": replace(ImpactBeam(), excitation_frequency=30.0, clearance=LARGE),
    }
    return {
        name: History(machine=beam, cycles=4, transient=TRANSIENT, samples=4000) for name, beam in beams.items()
    } | dict(scored("IBS-074", "IBS-075"))


def first_touches(data: Data) -> Array:
    """Instants [s] at which the upper surface is touched first after the lower one."""
    struck = np.flatnonzero(data["force"])
    side = np.sign(data["force"][struck])
    return np.asarray(data["time"][struck[1:][(side[1:] > 0.0) & (side[:-1] < 0.0)]])


def bouncing_spans(data: Data, ax: Axes, *, frequency: float, target: str) -> None:
    """Printed duration of bouncing from the first touch on, a share of the half cycle."""
    lasting = printed(target).low * 0.5 / frequency
    for k, start in enumerate(first_touches(data)):
        thesis.printed_span(start, start + lasting, ax, None if k else "bouncing, printed")


def bouncing_share(parts: Parts) -> Sequence[Finding]:
    """How long does bouncing last, in half cycles?"""
    wanted = printed("IBS-074").low
    return [
        scored_finding(parts, "IBS-074", f"±0.03 mm, 18 Hz: bouncing lasts {wanted:.2g} of the half cycle"),
        scored_finding(
            parts,
            "IBS-075",
            "±0.127 mm, 30 Hz: in some cycles bouncing lasts to the end of the half cycle",
            more="what is left includes the flight to the other side",
        ),
    ]


BOUNCING = ThesisFigure(
    id="5.6",
    title="Bouncing as a precursor of chaos",
    shows="Bouncing lasts a seventh of each half cycle in a periodic response, up to its end in a chaotic one.",
    parts=bouncing,
    panels=(
        force_panel(
            "(a) ±0.03 mm clearance, 18 Hz", "a", extra=partial(bouncing_spans, frequency=18.0, target="IBS-074")
        ),
        force_panel(
            "(b) ±0.127 mm clearance, 30 Hz: in some cycles to the end of the half cycle",
            "b",
            extra=partial(bouncing_spans, frequency=30.0, target="IBS-075"),
        ),
    ),
    compare=bouncing_share,
)


def beam_histograms(resolution: float) -> Mapping[str, Computation]:
    """Long records at three frequencies."""
    return {
        "long": runs(
            [
                replace(ImpactBeam(), excitation_frequency=frequency, clearance=LARGE)
                for frequency in HISTOGRAM_FREQUENCIES
            ],
            "excitation_frequency",
            cycles=round(3000 * resolution),
        )
    }


def multiple_peaks(parts: Parts) -> Sequence[Finding]:
    """Are all three chaotic, with more than one mode?"""
    data = parts["long"]
    found = []
    for row, frequency in enumerate(HISTOGRAM_FREQUENCIES):
        peaks, nature = data["peaks"][row], str(data["nature"][row])
        modes = len(histogram(peaks).modes)
        found.append(
            Finding(
                f"{frequency:g} Hz: chaotic, bounded, several peaks in the histogram",
                f"{nature}, {peaks.min():.3g} to {peaks.max():.3g} N, {modes} mode{'s' * (modes > 1)}",
                nature == "chaotic" and modes > 1,
                ("IBS-077",) if frequency == 25.0 else ("IBS-076",),
            )
        )
    return found


BEAM_HISTOGRAMS = ThesisFigure(
    id="5.7",
    title="Histograms of the peak impact force, ±0.127 mm",
    shows="Bounded distributions with several peaks at 22, 25 and 30 Hz.",
    parts=beam_histograms,
    panels=tuple(
        histogram_panel(f"({name}) {frequency:g} Hz", "long", row)
        for row, (name, frequency) in enumerate(zip("abc", HISTOGRAM_FREQUENCIES, strict=True))
    ),
    height=2.4,
    compare=multiple_peaks,
)

FIGURES = (TRANSIENT_CHAOS, BOUNCING, BEAM_HISTOGRAMS)
