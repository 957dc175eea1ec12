"""Keys of the file of a mechanism."""

from chaosgym.machines.file_keys import OPERATION, TEXT, Key, Keys
from chaosgym.machines.mechanism.beam import END, START
from chaosgym.machines.mechanism.joints import KINDS, SPATIAL_KINDS

LIMITS = {
    "coulomb mu tangential_stiffness": "friction is Coulomb's, of a joint with clearance: friction",
    "hertz exponent restitution law": "a surface is a linear spring and damper, or Hertzian: hertz_stiffness and "
    "hertz_damping in place of stiffness and damping",
    "gap backlash play": "clearance is how far the pin may leave the middle of its hole, or half a guide's gap",
    "radius diameter": "a round beam has a diameter, a pin with friction a radius, a cylinder a bore",
    "torque": "the torque that the crank takes is a result; that of a motor is [motor] stall_torque",
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


POINT = Key("x and y in the axes of the link; with z the mechanism is one in space", "m", "row")

KEYS = Keys(
    {
        "": {"title": Key("what the machine is", kind=TEXT)},
        "ground": {
            "gravity": Key("acceleration; none by default", "m/s^2"),
            "gravity_direction": Key("in which it pulls, from the x axis on; -90 by default, downward", "deg"),
        },
        "ground.points": {"*": Key("x and y on the ground; with z the mechanism is one in space", "m", "row")},
        "link": {
            "angle": Key("roughly, at crank angle 0: tells which way a loop is closed; 0 by default", "deg"),
            "orientation": Key("the same in space: turns about x, then y, then z of the ground", "deg", "row"),
            "axis": Key(
                "in space: own axis about which it may turn right round; of its pin on the ground, or z", kind="row"
            ),
        },
        "link.points": {"*": POINT},
        "link.beam": {
            "length": Key("along x from the link's origin; its points are 'start' and 'end'", "m"),
            "diameter": Key("of a round section; or width and height", "m"),
            "width": Key("of a rectangular section, across the plane of x and y", "m"),
            "height": Key("of a rectangular section, in the plane of x and y", "m"),
            "youngs_modulus": Key("of its material", "Pa"),
            "density": Key("of its material", "kg/m^3"),
            "modes": Key("bending modes that are kept, in space in either plane", kind="count"),
            "damping_ratio": Key("of each mode and of its stretch; 0 by default"),
            "stretch": Key("whether its length changes; true by default", kind="flag"),
        },
        "link.body": {
            "at": Key("end of a beam with which the body turns, 'start' or 'end'", kind=TEXT, choices=(START, END)),
            "mass": Key("of a rigid body of the link", "kg"),
            "inertia": Key(
                "about its own centre, in space about x, y and z of the link; 0 by default", "kg m^2", "row"
            ),
            "centre": Key("x and y (z) in the axes of the link, from the end of a beam on; 0 by default", "m", "row"),
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
            "driven": Key("true for the one revolute joint whose turn is the crank angle", kind="flag"),
            "clearance": Key("how far the pin may leave the middle of its hole, or half the gap of a guide", "m"),
            "stiffness": Key("spring of a surface", "N/m"),
            "damping": Key("damper of a surface", "N s/m"),
            "hertz_stiffness": Key("K of a Hertzian surface, N = K x^1.5 (1 + chi x')", "N/m^1.5"),
            "hertz_damping": Key("chi of it: 3/2 (1 - e) / v for restitution e near 1 at impact speed v", "s/m"),
            "friction": Key("Coulomb coefficient of a guide, a slot or a pin, where it touches; none by default"),
            "radius": Key("of a pin with friction; the first link has the hole", "m"),
            "stations": Key("where a guide can touch, along it from the point; else it can't tilt", "m", "row"),
        },
        "force": {
            "at": Key("point it acts on, such as 'ram.nose'", kind=TEXT),
            "direction": Key("from the x axis of the ground on; 0 by default", "deg"),
            "force": Key("constant, or samples of a revolution at equal steps from crank angle 0 on", "N", "row"),
        },
        "gas": {
            "at": Key("point of the piston, such as 'piston.pin'", kind=TEXT),
            "direction": Key("in which the piston compresses, from the x axis of the ground on; 0 by default", "deg"),
            "bore": Key("diameter of the cylinder", "m"),
            "dead_volume": Key("as a share of the swept volume"),
            "suction": Key("pressure at which the inlet opens", "Pa"),
            "discharge": Key("pressure at which the outlet opens", "Pa"),
            "behind": Key("pressure on the other side of the piston; that of suction by default", "Pa"),
            "exponent": Key("of the polytropic changes; 1.3 by default"),
        },
        "spring": {
            "between": Key("two points, such as ['ground.wall', 'yoke.slot']", kind="texts"),
            "stiffness": Key("of the spring", "N/m"),
            "free_length": Key("without force", "m"),
            "damping": Key("of a damper beside it; none by default", "N s/m"),
        },
        "motor": {
            "stall_torque": Key("at rest; falls in a straight line to none at no_load_speed", "N m"),
            "no_load_speed": Key("at which it gives no torque", "rpm"),
            "inertia": Key("of rotor and flywheel, at the crank; 0 by default", "kg m^2"),
        },
        "operation": {
            "speed": Key("of the crank, constant", "rpm"),
            "initial_state": Key(
                "displacements, then velocities, of all coordinates in SI units; rest if left out", "-", "row"
            ),
            "speed_range": Key("lowest and highest", "rpm", "row"),
            "clearance_range": Key("lowest and highest, of the monitored joint", "m", "row"),
            "monitored": Key("joint that is recorded; the first with clearance by default", kind=TEXT),
        },
        **OPERATION,
    },
    required=("ground", "link", "joint", "operation"),
    lists=("joint", "force", "gas", "spring", "link.body"),
    named=("link",),
    unknown=_unknown,
)
