"""Keys of the file of a mechanism."""

from collections.abc import Mapping
from typing import Any

from chaosgym.machines.contact_law import LAW_KEYS
from chaosgym.machines.file_keys import INITIAL_STATE, OPERATION, TEXT, Key, Keys
from chaosgym.machines.friction_law import LAW_OF_SLIDING
from chaosgym.machines.mechanism.beam import END, START
from chaosgym.machines.mechanism.joints import KINDS, SPATIAL_KINDS

LIMITS = {
    "coulomb mu tangential_stiffness": "friction is Coulomb's, of a guide, a slot or a pin: friction",
    "hertz": "a surface is a linear spring and damper, or Hertzian: hertz_stiffness and hertz_damping in their place",
    "gap backlash play": "clearance is how far the pin may leave the middle of its hole, or half a guide's gap",
    "radius diameter": "a round beam has a diameter, a pin with friction a radius, a cylinder a bore",
    "torque": "the torque that the crank takes is a result; a motor's is [motor] stall_torque, or torques at speeds; "
    "a link's is a [[moment]]",
    "cam lift rise": "a cam's rise is the [[motion]] of a tight prismatic joint",
    "length": "a link's length is the distance of its points",
    "speed": "the speed of the crank stands in [operation]",
}
"""What people look for and does not fit, or has another name: words, and what to say."""


def _unknown(word: str, known: list[str]) -> str:
    from chaosgym.machines.parameters import suggestion

    for words, told in LIMITS.items():
        if word.lower() in words.split():
            return f"; {told}"
    return suggestion(word, known)


HARMONICS = {
    "harmonic": Key("of the crank: one number is then the amplitude of a sine", kind="count"),
    "angle": Key("phase of the sine", "deg"),
    "harmonics": Key("how many the samples are cut to; 16 by default, at most 64", kind="count"),
}
"""Keys of what pulls over the crank angle; see ``loads.cycle_of``."""

HEAVIEST, LONGEST = 1e9, 1e6
"""Most mass [kg] and distance [m] that a file may state."""

PLACE: Mapping[str, Any] = {"unit": "m", "kind": "row", "low": -LONGEST, "high": LONGEST}

KEYS = Keys(
    {
        "": {"title": Key("what the machine is", kind=TEXT)},
        "ground": {
            "gravity": Key("acceleration; none by default", "m/s^2", low=0.0, high=1e6),
            "gravity_direction": Key("in which it pulls, from the x axis on; -90 by default, downward", "deg"),
        },
        "ground.points": {"*": Key("x and y on the ground; with z the mechanism is one in space", **PLACE)},
        "link": {
            "angle": Key("roughly, at crank angle 0: tells which way a loop is closed; 0 by default", "deg"),
            "orientation": Key("the same in space: turns about x, then y, then z of the ground", "deg", "row"),
            "axis": Key(
                "in space: own axis about which it may turn right round; of its pin on the ground, or z", kind="row"
            ),
        },
        "link.points": {"*": Key("x and y in the axes of the link; with z the mechanism is one in space", **PLACE)},
        "link.beam": {
            "length": Key("along x from the link's origin; its points are 'start' and 'end'", "m", low=1e-3, high=1e3),
            "diameter": Key("of a round section; or width and height", "m", low=1e-5, high=10.0),
            "width": Key("of a rectangular section, across the plane of x and y", "m", low=1e-5, high=10.0),
            "height": Key("of a rectangular section, in the plane of x and y", "m", low=1e-5, high=10.0),
            "youngs_modulus": Key("of its material", "Pa", low=1e5, high=1e13),
            "density": Key("of its material", "kg/m^3", low=1.0, high=1e5),
            "modes": Key("bending modes that are kept, in space in either plane", kind="count"),
            "damping_ratio": Key("of each mode and of its stretch; 0 by default", share=True, low=0.0, high=10.0),
            "stretch": Key("whether its length changes; true by default", kind="flag"),
        },
        "link.body": {
            "at": Key("end of a beam with which the body turns, 'start' or 'end'", kind=TEXT, choices=(START, END)),
            "mass": Key("of a rigid body of the link", "kg"),
            "inertia": Key(
                "about its own centre, in space about x, y and z of the link; 0 by default",
                "kg m^2",
                "row",
                low=0.0,
                high=HEAVIEST,
            ),
            "centre": Key("x and y (z) in the axes of the link, from the end of a beam on; 0 by default", **PLACE),
        },
        "joint": {
            "name": Key("begins the names of its fields, as in wrist_clearance", kind=TEXT),
            "kind": Key("what it holds", kind=TEXT, choices=tuple(dict.fromkeys([*KINDS, *SPATIAL_KINDS]))),
            "between": Key(
                "two points, such as ['crank.pin', 'rod.start']; a guide or slot is of the first", kind="texts"
            ),
            "axis": Key("of a guide or slot, in the axes of the first link; 0 by default", "deg"),
            "first_axis": Key(
                "in space: of a pin, guide or cross in axes of the first link; x of a guide, else z", kind="row"
            ),
            "second_axis": Key("in space: the same in axes of the second link; first_axis by default", kind="row"),
            "turn": Key("of the second link from the first, where the joint holds it; 0 by default", "deg"),
            "radii": Key("of the pitch circles of a gear or belt on both links; below 0 for an inner gear", "m", "row"),
            "carrier": Key("link on which both axes of a gear or belt lie; the ground by default", kind=TEXT),
            "driven": Key("true for the one revolute joint whose turn is the crank angle", kind="flag"),
            "clearance": Key("how far the pin may leave the middle of its hole, or half the gap of a guide", "m"),
            "stiffness": Key("spring of a surface", "N/m"),
            "damping": Key("damper of a surface", "N s/m"),
            **LAW_KEYS,
            "friction": Key("Coulomb coefficient of a guide, a slot or a pin; none by default"),
            "radius": Key("of a pin with friction; the first link has the hole", "m"),
            **LAW_OF_SLIDING,
            "stations": Key("where a guide can touch, along it from the point; else it can't tilt", "m", "row"),
        },
        "motion": {
            "joint": Key("tight prismatic or revolute joint whose free motion is prescribed; in the plane", kind=TEXT),
            "displacement": Key(
                "along a prismatic joint, as of a cam or a moving ground: amplitude of a sine, or samples", "m", "row"
            ),
            "swing": Key("turn of a revolute joint's second link from its first: amplitude, or samples", "deg", "row"),
            **HARMONICS,
        },
        "force": {
            "at": Key("point it acts on, such as 'ram.nose'", kind=TEXT),
            "direction": Key("from the x axis of the ground on; 0 by default", "deg"),
            "force": Key("constant, amplitude beside harmonic, or samples of a revolution at equal steps", "N", "row"),
            **HARMONICS,
        },
        "moment": {
            "at": Key("point of the link that it turns, such as 'rocker.pin'; in the plane", kind=TEXT),
            "moment": Key(
                "counterclockwise; constant, amplitude beside harmonic, or samples of a revolution", "N m", "row"
            ),
            **HARMONICS,
        },
        "gas": {
            "at": Key("point of the piston, such as 'piston.pin'", kind=TEXT),
            "direction": Key("in which the piston compresses, from the x axis of the ground on; 0 by default", "deg"),
            "bore": Key("diameter of the cylinder", "m", low=1e-4, high=10.0),
            "dead_volume": Key("as a share of the swept volume", low=1e-3, high=100.0),
            "suction": Key("pressure at which the inlet opens", "Pa", low=0.0, high=1e9),
            "discharge": Key("pressure at which the outlet opens", "Pa"),
            "behind": Key(
                "pressure on the other side of the piston; that of suction by default", "Pa", low=0.0, high=1e9
            ),
            "exponent": Key("of the polytropic changes; 1.3 by default", low=0.5, high=3.0),
        },
        "spring": {
            "between": Key("two points, such as ['ground.wall', 'yoke.slot']", kind="texts"),
            "stiffness": Key("of the spring", "N/m", low=0.0, high=1e12),
            "free_length": Key("without force", "m", low=0.0, high=LONGEST),
            "preload": Key(
                "pull at the free length, as of coils that lie close; none by default", "N", low=-1e9, high=1e9
            ),
            "damping": Key("of a damper beside it; none by default", "N s/m", low=0.0, high=1e9),
        },
        "damper": {
            "between": Key("two points, such as ['ground.wall', 'yoke.slot']", kind="texts"),
            "damping": Key("of the damper", "N s/m", low=0.0, high=1e9),
        },
        "torsion_spring": {
            "between": Key("points of two links, whose turns it holds together; in the plane", kind="texts"),
            "stiffness": Key("of the spring; none for a damper alone", "N m/rad", low=0.0, high=1e12),
            "free_angle": Key(
                "turn of the second link from the first one without moment; 0 by default", "deg", low=-1e4, high=1e4
            ),
            "preload": Key(
                "moment at the free angle that turns the second link back; none by default", "N m", low=-1e9, high=1e9
            ),
            "damping": Key("of a damper beside it; none by default", "N m s/rad", low=0.0, high=1e9),
        },
        "motor": {
            "stall_torque": Key("at rest; falls in a straight line to none at no_load_speed", "N m"),
            "no_load_speed": Key("at which it gives no torque", "rpm"),
            "speeds": Key("of its curve, from 0 on, in place of the line; straight lines lie between", "rpm", "row"),
            "torques": Key("at these speeds, 0 at the last", "N m", "row"),
            "inertia": Key("of rotor and flywheel, at the crank; 0 by default", "kg m^2"),
        },
        "operation": {
            "speed": Key("of the crank, constant", "rpm"),
            "initial_state": INITIAL_STATE,
            "speed_range": Key("lowest and highest", "rpm", "row"),
            "clearance_range": Key("lowest and highest, of the monitored joint", "m", "row"),
            "monitored": Key("joint that is recorded; the first with clearance by default", kind=TEXT),
        },
        **OPERATION,
    },
    required=("ground", "link", "joint", "operation"),
    lists=("joint", "motion", "force", "moment", "gas", "spring", "damper", "torsion_spring", "link.body"),
    named=("link",),
    unknown=_unknown,
)
