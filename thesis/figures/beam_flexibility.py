"""Crests of the peak force and the beam's first bending frequency. Figures 3.10 and 3.11."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from matplotlib.axes import Axes

from chaosgym.arrays import Array
from chaosgym.machines import ImpactBeam
from chaosgym.machines.impact_beam.modes import pinned_pinned_frequency
from chaosgym.plotting.style import ACCENT, MUTED
from thesis import plotting as thesis
from thesis.figures.beam import LENGTHS, TINY, sweep
from thesis.figures.computations import Computation
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure, steps
from thesis.figures.panels import (
    FREQUENCY,
)
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding


def flexibility(resolution: float) -> Mapping[str, Computation]:
    """Three lengths at the tiny clearance."""
    values = steps(1.0, 30.0, 0.15 / resolution)
    curves = {
        f"{1e3 * length:g}": sweep(
            replace(ImpactBeam(), clearance=TINY, length=length),
            "excitation_frequency",
            values,
            cycles=50,
            transient=150,
        )
        for length in LENGTHS
    }
    return {**curves, **scored("IBS-037")}


def _length_curves(parts: Parts) -> list[tuple[float, Array, Array]]:
    """Length [m], frequency [Hz] and largest peak [N] of each."""
    return [
        (length, data["excitation_frequency"], data["peaks"].max(axis=1))
        for length, data in ((length, parts[f"{1e3 * length:g}"]) for length in LENGTHS)
    ]


def length_curves(parts: Parts, ax: Axes, *, ratio: bool) -> None:
    """Largest peak against frequency or frequency ratio, for the three lengths."""
    for (length, frequency, force), colour in zip(_length_curves(parts), (ACCENT, "#d1495b", MUTED), strict=True):
        unit = pinned_pinned_frequency(ImpactBeam(), length) if ratio else 1.0
        name = f"{1e3 * length:g} mm ({pinned_pinned_frequency(ImpactBeam(), length):.1f} Hz)"
        thesis.curve(frequency / unit, force, ax, label=name, color=colour)
    if not ratio:
        thesis.printed_span(*printed("IBS-036"), ax, "fluctuates, printed")
    label = "excitation frequency / first pinned-pinned frequency" if ratio else FREQUENCY.label
    ax.set(xlabel=label, ylabel="peak impact force [N]", ylim=(0.0, None))
    thesis.legend(ax, "upper left")


def fluctuation(parts: Parts) -> Sequence[Finding]:
    """Is the force smooth below 15 Hz and rough above?"""
    low, high = printed("IBS-036")
    rough = []
    for _, frequency, force in _length_curves(parts):
        inside = (frequency >= low) & (frequency <= high)
        trend = np.polyval(np.polyfit(frequency[inside], force[inside], 2), frequency[inside])
        rough.append(float(np.std(force[inside] - trend) / np.mean(force[inside])))
    here = float(np.mean(rough))
    return [
        scored_finding(parts, "IBS-037", f"Type I, a smooth rise, to {low:g} Hz at the three lengths"),
        Finding(
            f"{low:g} to {high:g} Hz: fluctuates", f"{here:.0%} of the force about its trend", here > 0.05, ("IBS-036",)
        ),
    ]


def collapse(parts: Parts) -> Sequence[Finding]:
    """By which factor must frequencies be divided for the crests of two lengths to coincide best?"""
    curves = _length_curves(parts)
    length, frequency, force = curves[0]
    base = pinned_pinned_frequency(ImpactBeam(), length)
    low, high = printed("IBS-036")
    inside = (frequency >= low) & (frequency <= 0.95 * high)
    scales = np.linspace(0.94, 1.06, 241)
    found = []
    for other, grid, values in curves[1:]:
        match = [np.corrcoef(force[inside], np.interp(frequency[inside] * s, grid, values))[0, 1] for s in scales]
        expected = pinned_pinned_frequency(ImpactBeam(), other) / base
        best = float(scales[int(np.argmax(match))])
        agreement = float(np.interp(expected, scales, match))
        found.append(
            Finding(
                f"{1e3 * other:g} mm: crests coincide with those of {1e3 * length:g} mm over the frequency ratio "
                f"(factor {expected:.4f})",
                f"correlation {agreement:.2f} at that factor, {np.interp(1.0, scales, match):.2f} over the frequency; "
                f"best {max(match):.2f} at {best:.4f}",
                agreement > 0.8 or abs(best - expected) < 0.002,
                ("IBS-038",),
                "beam length",
            )
        )
    return found


FORCE_FOR_LENGTHS = ThesisFigure(
    id="3.10",
    title="Peak impact force for three beam lengths, ±0.015 mm",
    shows="Smooth below 15 Hz, fluctuating from 15 to 30 Hz, with crests that shift with the length.",
    parts=flexibility,
    panels=(Panel("", partial(length_curves, ratio=False)),),
    height=3.6,
    compare=fluctuation,
)

FORCE_OVER_RATIO = ThesisFigure(
    id="3.11",
    title="The same against the ratio of excitation to first pinned-pinned frequency",
    shows="Crests and valleys of the three lengths coincide over the frequency ratio.",
    parts=flexibility,
    panels=(Panel("", partial(length_curves, ratio=True)),),
    height=3.6,
    compare=collapse,
)

FIGURES = (
    FORCE_FOR_LENGTHS,
    FORCE_OVER_RATIO,
)
