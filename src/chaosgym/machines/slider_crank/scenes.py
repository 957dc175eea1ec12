"""Named scenes of a slider crank: its options on the command line, and scenes whose cost is shown."""

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
