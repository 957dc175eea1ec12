"""Named scenes of a slider crank: its options on the command line, scenes whose cost is shown, and its extremes."""

from collections.abc import Mapping
from typing import Any

from chaosgym.machines.machine import Choice, Number, Option

STANDARD_GRAVITY = 9.81

_BALL_ALONE = {"slider_joint": "ideal", "gravity": STANDARD_GRAVITY}

_JOINT = "--clearance-joint"

OPTIONS: Mapping[str, Option] = {
    _JOINT: Choice(
        {
            "slider": {"slider_joint": "clearance", "ball_joint": "ideal"},
            "ball-spherical": {"ball_joint": "spherical", **_BALL_ALONE},
            "ball-instrumented": {"ball_joint": "instrumented", **_BALL_ALONE},
            "both": {"slider_joint": "clearance", "ball_joint": "spherical"},
        },
        redirects={
            "ball-spherical": {"--clearance-mm": "ball_clearance"},
            "ball-instrumented": {"--clearance-mm": "ball_clearance"},
        },
    ),
    "--slider-model": Choice(
        {"plain": {"slider_joint": "clearance"}, "instrumented": {"slider_joint": "instrumented"}},
        only={_JOINT: ("slider", "both")},
    ),
    "--ball-model": Choice(
        {"spherical": {"ball_joint": "spherical"}, "instrumented": {"ball_joint": "instrumented"}},
        only={_JOINT: ("both",)},
    ),
    "--gravity": Choice({"on": {"gravity": STANDARD_GRAVITY}, "off": {"gravity": 0.0}}),
    "--speed-rpm": Number("crank_speed", "rpm"),
    "--clearance-mm": Number("slider_clearance", "mm", 1e-3),
    "--ball-clearance-mm": Number(
        "ball_clearance", "mm", 1e-3, only={_JOINT: ("ball-spherical", "ball-instrumented", "both")}
    ),
    "--motor-angle-deg": Number("motor_angle", "deg"),
    "--contact-damping-ratio": Number("contact_damping_ratio", "-"),
    "--friction": Number("friction_coefficient", "-"),
}

SCENES: Mapping[str, Mapping[str, Any]] = {
    "slider joint": {},
    "ball joint, spherical": {"ball_joint": "spherical", **_BALL_ALONE},
    "ball joint, instrumented": {"ball_joint": "instrumented", **_BALL_ALONE},
    "both joints": {"ball_joint": "spherical"},
    "motor at 20 deg": {"motor_angle": 20.0},
    "friction 0.1": {"friction_coefficient": 0.1},
    "Hertzian contact": {"contact_law": "hertz"},
}

EXTREMES: Mapping[str, Mapping[str, Any]] = {
    "clearance 0": {"slider_clearance": 0.0},
    "clearance 1e-9 m": {"slider_clearance": 1e-9},
    "clearance 20 mm": {"slider_clearance": 0.02},
    "1 rpm": {"crank_speed": 1.0},
    "5000 rpm": {"crank_speed": 5000.0},
    "contact stiffness 1e3 N/m": {"contact_stiffness": 1e3},
    "contact stiffness 1e10 N/m": {"contact_stiffness": 1e10},
    "contact stiffness 1e12 N/m": {"contact_stiffness": 1e12},
    "contact damping ratio 0": {"contact_damping_ratio": 0.0},
    "contact damping ratio 1": {"contact_damping_ratio": 1.0},
    "contact damping ratio 100": {"contact_damping_ratio": 100.0},
    "damping ratio 0": {"damping_ratio": 0.0},
    "damping ratio 1": {"damping_ratio": 1.0},
    "damping ratio 100": {"damping_ratio": 100.0},
    "friction 0.5": {"friction_coefficient": 0.5},
    "Hertzian contact": {"contact_law": "hertz"},
    "gravity 100 m/s2": {"gravity": 100.0},
}
