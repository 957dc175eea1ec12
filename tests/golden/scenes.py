"""Machines and tasks of every kind, whose results are kept."""

from collections.abc import Iterator
from typing import Any

from chaosgym import ImpactBeam, SliderCrank

BEAMS: dict[str, dict[str, Any]] = {
    "chaotic": {"excitation_frequency": 30.0},
    "periodic": {"excitation_frequency": 19.0},
    "narrow": {"excitation_frequency": 7.0, "clearance": 0.03e-3},
    "wide": {"excitation_frequency": 24.0, "clearance": 0.254e-3},
    "uniform damping": {"damping_family": "uniform", "excitation_frequency": 13.0},
    "rigid": {"n_modes": 1, "fitted_modes": 0},
    "many modes": {"n_modes": 12, "event_accuracy": "tightest"},
}

CRANKS: dict[str, dict[str, Any]] = {
    "slider joint": {"crank_speed": 190.0, "slider_clearance": 0.254e-3},
    "slider joint, fast": {"crank_speed": 270.0, "slider_clearance": 0.032e-3},
    "ball joint": {"crank_speed": 120.0, "slider_joint": "ideal", "ball_joint": "spherical"},
    "rigid rod": {"rod": "rigid"},
    "coarse bins": {"matrix_update_interval": 5.0},
    "motor at an angle": {"motor_angle": 25.0, "crank_speed": 200.0},
    "in space, ball": {"motor_angle": 25.0, "slider_joint": "ideal", "ball_joint": "spherical"},
    "instrumented": {"slider_joint": "instrumented", "crank_speed": 150.0},
    "both joints": {"ball_joint": "spherical", "crank_speed": 160.0},
    "hertz": {"contact_law": "hertz", "crank_speed": 180.0},
    "gravity": {"gravity": 9.81, "crank_speed": 210.0},
}

RECORDED = ("section", "peak_force", "impacts", "contact_fraction", "bounce_duration")


def scenes() -> Iterator[tuple[str, Any]]:
    """Name and machine of every scene."""
    for kind, cases in ((ImpactBeam, BEAMS), (SliderCrank, CRANKS)):
        for name, fields in cases.items():
            yield f"{kind.name}: {name}", kind(**fields)
