"""Slider cranks of the figures of chapters 4 and 5: joints, clearances, and runs over one field."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from chaosgym.machines import THESIS_SLIDER_CRANK, SliderCrank
from thesis.figures.computations import Runs
from thesis.figures.panels import ParameterAxis
from thesis.scorecard.observation import THOROUGH
from thesis.statements import read_comparisons

GRAVITY = 9.81
"""The ball joint needs it, the slider joint must do without (see ``machines.slider_crank``) [m/s^2]."""

SMALL, MIDDLE, WIDE, LARGE = 0.03175e-3, 0.0635e-3, 0.127e-3, 0.254e-3
"""Clearances on the inch grid of the drawings [m], printed as 0.032, 0.064, 0.127 and 0.254 mm."""

LOW_DAMPING, HIGH_DAMPING = 0.025, 0.05
"""Contact damping ratios (4.5.4)."""

SECTION_4_4_DAMPING = read_comparisons().unprinted["damping_of_section_4_4"].value
"""Contact damping ratio of figures 4.11 to 4.13, which is not in print: fitted, as for the scorecard."""

TRANSIENT, CYCLES, *_ = THOROUGH["slider-crank"]
"""Revolutions in which a response settles, and those shown of it (4.4.1): as for the scorecard."""

ROD_LENGTH = ParameterAxis("rod_length", "connecting rod length [m]", 1.0, "m")


def slider(clearance: float, **settings: Any) -> SliderCrank:
    """The mechanism with clearance at the slider."""
    return replace(THESIS_SLIDER_CRANK, slider_clearance=clearance, **settings)


def ball(clearance: float, joint: str = "spherical", **settings: Any) -> SliderCrank:
    """The mechanism with clearance at the ball joint, upright."""
    return replace(
        THESIS_SLIDER_CRANK,
        slider_joint="ideal",
        ball_joint=joint,
        ball_clearance=clearance,
        gravity=GRAVITY,
        **settings,
    )


def runs(machines: Sequence[SliderCrank], *fields: str, cycles: int = CYCLES, transient: int = TRANSIENT) -> Runs:
    """Peak forces of several mechanisms."""
    return Runs(machines=tuple(machines), fields=fields, cycles=cycles, transient=transient)


def sweep(machine: SliderCrank, field: str, values: Sequence[float], **options: int) -> Runs:
    """Peak forces over one field."""
    return runs([replace(machine, **{field: value}) for value in values], field, **options)  # type: ignore[arg-type]
