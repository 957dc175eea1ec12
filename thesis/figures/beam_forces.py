"""The beam's peak force against frequency, length and damping. Figures 3.8, 3.12 and 3.13."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from chaosgym.machines import ImpactBeam
from thesis.figures.beam import DAMPING, LARGE, LENGTH, SMALL, sweep
from thesis.figures.computations import Computation
from thesis.figures.figure import Finding, Parts, ThesisFigure, steps
from thesis.figures.findings import describe_forces
from thesis.figures.flips import flips
from thesis.figures.panels import (
    FREQUENCY,
    Mark,
    force_diagram,
    response_at,
)
from thesis.figures.printed import printed
from thesis.figures.scored import agrees, scored, scored_finding


def force_against_frequency(resolution: float) -> Mapping[str, Computation]:
    """Both halves of figure 3.8."""
    values = steps(1.0, 30.0, 0.5 / resolution, 18.0, 19.0, 20.0, 29.0)
    curves = {
        name: sweep(replace(ImpactBeam(), clearance=clearance), "excitation_frequency", values)
        for name, clearance in (("a", SMALL), ("b", LARGE))
    }
    return {**curves, **scored("IBS-020", "IBS-021", "IBS-022", "IBS-023")}


def bands_and_jumps(parts: Parts) -> Sequence[Finding]:
    """Where the types end, and how much the force changes from one hertz to the next: below 8 Hz, and above."""
    data = parts["a"]
    values, force = data["excitation_frequency"], data["peaks"].max(axis=1)
    whole = np.arange(1.0, 31.0)
    at_whole = np.interp(whole, values, force)
    change = np.abs(np.diff(at_whole)) / at_whole[:-1]
    smooth, rough = float(np.max(change[3:7])), float(np.max(change[7:]))
    return [
        scored_finding(parts, "IBS-020", "Type I, a smooth rise, to 8 Hz at ±0.032 and ±0.127 mm"),
        scored_finding(parts, "IBS-021", "±0.032 mm: Type II, periodic, to 30 Hz"),
        scored_finding(parts, "IBS-022", "±0.127 mm: Type II, periodic, to 17 Hz"),
        scored_finding(parts, "IBS-023", "±0.127 mm: Type III, chaotic, from 16 Hz on"),
        Finding(
            "±0.032 mm: the force fluctuates above 8 Hz, and not below (change per hertz, from 4 Hz on)",
            f"at most {smooth:.0%} per hertz up to 8 Hz, up to {rough:.0%} above",
            smooth < 0.1 < rough,
            (),
            "speed",
        ),
    ]


FORCE_AGAINST_FREQUENCY = ThesisFigure(
    id="3.8",
    title="Peak impact force against excitation frequency",
    shows="Type I below 8 Hz, Type II above at the small clearance, Type III above 16 Hz at the large one.",
    parts=force_against_frequency,
    panels=(
        force_diagram(
            "(a) ±0.032 mm clearance (dimensionless 0.01)",
            "a",
            FREQUENCY,
            marks=(
                Mark(18.0, "IBS-024", "periodic", sensitivity="speed"),
                Mark(19.0, "IBS-025", "periodic", sensitivity="speed"),
                Mark(20.0, "IBS-026", "periodic", sensitivity="speed"),
            ),
            bands=(("I", "IBS-020"), ("II", "IBS-021")),
        ),
        force_diagram(
            "(b) ±0.127 mm clearance (dimensionless 0.04)",
            "b",
            FREQUENCY,
            marks=(
                Mark(29.0, "IBS-028", "periodic", sensitivity="speed"),
                Mark(30.0, "IBS-029", "chaotic", sensitivity="speed"),
            ),
            bands=(("I", "IBS-020"), ("II", "IBS-022"), ("III", "IBS-023")),
        ),
    ),
    height=3.4,
    compare=bands_and_jumps,
)


def length_sweep(resolution: float) -> Mapping[str, Computation]:
    """Beam lengths 279 to 304 mm."""
    beam = replace(ImpactBeam(), excitation_frequency=29.0, clearance=LARGE)
    return {"lengths": sweep(beam, "length", steps(0.279, 0.304, 0.0025 / max(1, round(resolution))))}


def length_flip(parts: Parts) -> Sequence[Finding]:
    """Does 1 % of length change the nature where printed, and where else?"""
    data = parts["lengths"]
    natures = [str(response_at(data, LENGTH, at)[1]) for at in (281.5, 284.0)]
    return [
        Finding(
            "+1 % of length, 281.5 to 284 mm, turns periodic into chaotic",
            f"{natures[0]} to {natures[1]} there; the nature changes at {flips(data, LENGTH, 2.5)}",
            natures == ["periodic", "chaotic"],
            ("IBS-042", "IBS-043"),
            "beam length",
        )
    ]


FORCE_AGAINST_LENGTH = ThesisFigure(
    id="3.12",
    title="Peak impact force against beam length: 29 Hz, ±0.127 mm",
    shows="The nature changes for 1 % of length: 70 N, periodic, at 281.5 mm; up to 95 N, chaotic, at 284 mm.",
    parts=length_sweep,
    panels=(
        force_diagram(
            "",
            "lengths",
            LENGTH,
            marks=(
                Mark(281.5, "IBS-042", "periodic", sensitivity="beam length"),
                Mark(284.0, "IBS-043", "chaotic", "largest", "beam length"),
            ),
        ),
    ),
    height=3.6,
    compare=length_flip,
)


def damping_sweep(resolution: float) -> Mapping[str, Computation]:
    """Structural damping 1 to 8 %."""
    beam = replace(ImpactBeam(), excitation_frequency=30.0, clearance=LARGE)
    values = steps(0.01, 0.08, 0.0025 / resolution)
    return {"dampings": sweep(beam, "damping_ratio", values), **scored("IBS-045")}


def damping_calms(parts: Parts) -> Sequence[Finding]:
    """Does the spread fall along the sweep, and is there chaos at its end?"""
    data = parts["dampings"]
    spread = np.ptp(data["peaks"], axis=1)
    chaotic = data["damping_ratio"][data["nature"] == "chaotic"]
    end = response_at(data, DAMPING, 8.0)
    last = f"{100.0 * chaotic.max():.3g} %" if len(chaotic) else "nowhere"
    return [
        Finding(
            "the variation of the peak force falls from 1 % to 8 % structural damping",
            f"{spread[0]:.3g} N at 1 %, {spread[len(spread) // 2]:.3g} N at 4.5 %, {spread[-1]:.3g} N at 8 %; "
            f"last chaotic at {last}; rank correlation with damping {parts['IBS-045']['value']}",
            agrees(parts, "IBS-045"),
            ("IBS-045",),
            "structural damping",
        ),
        Finding(
            "no chaos at 8 %",
            describe_forces(end[0], str(end[1]), int(end[2])),
            end[1] == "periodic",
            ("IBS-046",),
            "structural damping",
        ),
    ]


FORCE_AGAINST_DAMPING = ThesisFigure(
    id="3.13",
    title="Peak impact force against structural damping: 30 Hz, ±0.127 mm",
    shows="The variation of the peak force falls as the damping ratio grows from 1 to 8 %.",
    parts=damping_sweep,
    panels=(force_diagram("", "dampings", DAMPING, natures=((printed("IBS-046").low, "no chaos"),)),),
    height=3.6,
    compare=damping_calms,
)

FIGURES = (
    FORCE_AGAINST_FREQUENCY,
    FORCE_AGAINST_LENGTH,
    FORCE_AGAINST_DAMPING,
)
