"""The slider crank's contact force over a revolution. Figures 4.7, 4.10 to 4.12 and 4.25."""

from collections.abc import Mapping, Sequence

import numpy as np
from matplotlib.axes import Axes

from chaosgym.machines import SliderCrank
from chaosgym.machines.slider_crank.machine import frequencies_at
from thesis import plotting as thesis
from thesis.figures.computations import Computation, History
from thesis.figures.crank import MIDDLE, SECTION_4_4_DAMPING, SMALL, TRANSIENT, WIDE, ball, runs, slider
from thesis.figures.figure import Finding, Parts, ThesisFigure
from thesis.figures.findings import compare_nature, words
from thesis.figures.panels import (
    angle_panel,
    force_panel,
    motion_panel,
    phase_panel,
    section_panel,
)
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding
from thesis.scorecard.crank_runs import ANGLE_CYCLES, ANGLE_SAMPLES

SPHERICAL = ball(MIDDLE, crank_speed=120.0)
INSTRUMENTED = ball(WIDE, "instrumented", crank_speed=100.0)
SLIDER = slider(SMALL, crank_speed=230.0, contact_damping_ratio=SECTION_4_4_DAMPING)
THIN_ROD = ball(WIDE, "instrumented", crank_speed=200.0, rod_diameter=3.175e-3)


def revolutions(machine: SliderCrank, *targets: str) -> Mapping[str, Computation]:
    """Settled revolutions, and statements about their crank angles."""
    force = History(machine=machine, cycles=ANGLE_CYCLES, transient=TRANSIENT, samples=ANGLE_SAMPLES)
    return {"force": force, **scored(*targets)}


def ball_angles(parts: Parts) -> Sequence[Finding]:
    """Where is contact lost, resumed, and kept for good?"""
    return [
        scored_finding(parts, "SSC-025", f"no contact from {words(printed('SSC-025'))} deg"),
        scored_finding(parts, "SSC-026", f"bouncing from {words(printed('SSC-026'))} deg"),
    ]


def ball_spans(ax: Axes) -> None:
    """Printed ranges of crank angle."""
    thesis.printed_span(*printed("SSC-025"), ax, "no contact, printed")
    for angle in printed("SSC-026"):
        ax.axvline(angle, lw=1.0, ls=":", **thesis.PRINTED)


BALL_FORCE = ThesisFigure(
    id="4.7",
    title="Contact force in the ball joint, spherical clearance: ±0.0635 mm, 120 rpm",
    shows="Contact to 70 deg, none to 95 deg, then an impact and bouncing until 130 deg.",
    parts=lambda resolution: revolutions(SPHERICAL, "SSC-025", "SSC-026"),
    panels=(
        angle_panel(
            "dotted: bouncing from 95 to 130 deg, printed", "force", "contact force [N]", sign=False, extra=ball_spans
        ),
    ),
    compare=ball_angles,
)


def impulse_angles(parts: Parts) -> Sequence[Finding]:
    """Where do the largest forces of both half revolutions stand, and is contact ever lost?"""
    force = np.abs(parts["force"]["force"])
    first, second = printed("SSC-037")
    lost = float(np.mean(force == 0.0))
    return [
        scored_finding(parts, "SSC-037", f"impulses at {first:g} and {second:g} deg"),
        Finding("no contact loss before the impulses", f"no contact in {lost:.1%} of the revolution", lost < 0.01),
    ]


def impulse_lines(ax: Axes) -> None:
    """Printed crank angles of the impulses."""
    for k, angle in enumerate(printed("SSC-037")):
        thesis.printed_span(angle, angle, ax, None if k else "impulses, printed")


INSTRUMENTED_FORCE = ThesisFigure(
    id="4.10",
    title="Contact force in the instrumented ball joint: ±0.127 mm, 100 rpm",
    shows="Two large impulses, at 100 and at 300 deg, without a loss of contact before them.",
    parts=lambda resolution: revolutions(INSTRUMENTED, "SSC-037"),
    panels=(angle_panel("", "force", "contact force [N]", sign=False, extra=impulse_lines),),
    compare=impulse_angles,
)


def slider_angles(parts: Parts) -> Sequence[Finding]:
    """Where is contact lost, and where does the large impact stand?"""
    loss, impact = printed("SSC-038").low, printed("SSC-039").low
    return [
        scored_finding(parts, "SSC-038", f"contact lost at {loss:g} deg"),
        scored_finding(parts, "SSC-039", f"large impact at {impact:g} deg"),
    ]


def slider_lines(ax: Axes) -> None:
    """Printed crank angles of loss and resumption."""
    low, high = printed("SSC-038").low, printed("SSC-039").low
    thesis.printed_span(low, high, ax, "no contact, printed")


SLIDER_FORCE = ThesisFigure(
    id="4.11",
    title="Contact force in the slider joint: ±0.032 mm, 230 rpm",
    shows="Contact lost at 55 deg and resumed at 75 deg with a large impact; upper surface positive, lower negative.",
    parts=lambda resolution: revolutions(SLIDER, "SSC-038", "SSC-039"),
    panels=(angle_panel("", "force", "contact force [N]", sign=True, extra=slider_lines),),
    compare=slider_angles,
)


def slider_response(resolution: float) -> Mapping[str, Computation]:
    """Time history, section and nature."""
    return {
        "history": History(machine=SLIDER, cycles=6, transient=TRANSIENT, samples=2000),
        "section": History(machine=SLIDER, cycles=round(1000 * resolution), transient=TRANSIENT, samples=1),
        "response": runs([SLIDER]),
    }


def slider_nature(parts: Parts) -> Sequence[Finding]:
    """Is the response chaotic?"""
    data = parts["response"]
    response = data["peaks"][0], data["nature"][0], data["period"][0]
    return [
        compare_nature(f"230 rpm, contact damping {SECTION_4_4_DAMPING:.1%}, fitted", "SSC-040", response, "chaotic")
    ]


SLIDER_RESPONSE = ThesisFigure(
    id="4.12",
    title="Vibration of the slider across its guide: ±0.032 mm, 230 rpm",
    shows="Irregular time history, phase plane, Poincaré map and impact force.",
    parts=slider_response,
    panels=(
        motion_panel("(a) displacement of the slider", "history"),
        phase_panel("(b) phase plane of the slider", "history"),
        section_panel("(c) Poincaré map of the slider", "section"),
        force_panel("(d) impact force, either surface", "history", resultant=True),
    ),
    columns=2,
    compare=slider_nature,
    remark="4.4 prints no contact damping; with 2.5 % the text says periodic at this speed (4.5.3)",
)


def thin_rod(parts: Parts) -> Sequence[Finding]:
    """Is the model stiffer than the rod that was measured?"""
    longer = ball(WIDE, "instrumented", rod_diameter=3.175e-3, rod_length=0.240)
    first = float(frequencies_at(longer, 0.0)[0])
    force = np.abs(parts["force"]["force"])
    return [
        Finding(
            "the model's first natural frequency lies above the measured 18 Hz (rod of 240 mm)",
            f"{first:.1f} Hz",
            first > 18.0,
            ("SSC-108",),
        ),
        Finding(
            "similar pattern and order of magnitude as measured",
            f"largest force {force.max():.0f} N",
            None,
            ("SSC-107",),
        ),
    ]


THIN_ROD_FORCE = ThesisFigure(
    id="4.25",
    title="Contact force in the instrumented ball joint, rod of 3.18 mm: ±0.127 mm, 200 rpm",
    shows="Measured and numerical contact force; the numerical ripples are faster than the measured ones.",
    parts=lambda resolution: revolutions(THIN_ROD),
    panels=(angle_panel("(b) numerical result", "force", "contact force [N]", sign=False),),
    compare=thin_rod,
    remark="the numerical half; the measured record is not in print",
)

FIGURES = (BALL_FORCE, INSTRUMENTED_FORCE, SLIDER_FORCE, SLIDER_RESPONSE, THIN_ROD_FORCE)
