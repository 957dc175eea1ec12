"""Keys of the file of modes or matrices, and what to do where people write other words for them."""

from collections.abc import Mapping
from typing import Any

from chaosgym.machines.contact_law import LAW_KEYS
from chaosgym.machines.file_keys import INITIAL_STATE, OPERATION, TEXT, Key, Keys
from chaosgym.machines.modal_machine.drive import KINDS
from chaosgym.machines.parameters import suggestion
from chaosgym.units import TURNING, turns

PAGE = "docs/own-machine.md, 'What is modelled'"

TURNS = "what turns has a gap in rad or arcmin, forces in N m, springs in N m/rad, masses in kg m^2, by the same keys"

LIMITS = {
    "torque moment inertia rad arcmin": TURNS,
    "static stribeck regularisation": "friction of [joint] sticks and slides, exactly, at one coefficient; one that "
    "falls with the speed fits a mechanism",
    "coulomb mu tangential": "friction of [joint] is Coulomb's, and tangent the point that sticks and slides",
    "random psd noise seed white": "a random drive does not fit: what drives repeats with every cycle",
    "flow fluid velocity wind": "forces that depend on the motion, as of a flow, do not fit",
    "time_varying mesh parametric stiffness_samples": "stiffness of [joint] or [[spring]] takes samples of one cycle",
    "chirp ramp": "a drive that does not repeat with every cycle does not fit; sweep over the speed",
    "step impulse": "a step is a [[load]] from rest, an impulse an initial_state; neither needs a [[drive]]",
    "control controller pid feedback": "a controller within the machine does not fit; an agent trims the speed only",
    "gap backlash play": "clearance is half the gap, with one stop the way to it: of a backlash, its half",
    "joints gaps second": "several gaps are several [[joint]] tables, each with at, clearance, stiffness and damping",
    "cam lift": "a cam's lift moves the base and pulls the spring to ground, as in docs/machines/cam-follower.toml",
    "amplitude": "the amplitude is the number of the force, unbalance, displacement or acceleration itself",
    "frequency omega rad/s": "frequencies are in Hz (1 rad/s = 0.159 Hz); a drive's is harmonic times speed",
    "gravity weight drag constant": "what is constant is a [[load]]: a force, or an acceleration of the base",
    "ratio teeth gear belt": "a ratio is a factor at a point: at = 'motor - 3 gear', or '20 mm pinion + 60 mm wheel'",
    "cubic nonlinear hertz": "a stop may be Hertzian, of any exponent: hertz_stiffness in place of stiffness",
}
"""By words that a key or a unit holds."""


def hint(word: str) -> str:
    """What to say of a key or a unit that is unknown; empty if nothing is known of it."""
    given = word.lower()
    parts = {given, *given.replace("-", "_").split("_"), *given.replace("*", " ").replace("/", " ").split()}
    for words, told in LIMITS.items():
        if parts & set(words.split()):
            return f"; {told} ({PAGE})"
    return ""


def told_of(word: str, known: list[str]) -> str:
    """End of a message about an unknown key: what is known of the word, or the nearest key."""
    return hint(word) or suggestion(word, known)


SHAPE = Key(
    "mass-normalised mode shape there, a number for each mode; 'base': participation [kg^1/2, beside modal_masses kg]",
    "kg^-1/2",
    "row",
    bare=True,
)

TABLES: Mapping[str, Mapping[str, Key]] = {
    "": {"title": Key("what the machine is", kind=TEXT)},
    "structure": {
        "frequencies": Key("natural frequencies of the machine free of contact; 0 for a rigid body", "Hz", "row"),
        "damping_ratios": Key("of each mode, or one for all", "-", "row", share=True),
        "modal_damping": Key("full matrix of modal damping, a row for each mode", "1/s", "rows"),
        "modal_masses": Key("of each mode, if the shapes are not mass-normalised", "kg", "row"),
        "matrices": Key(".npz file with arrays M, K and, if known, C, base and names", kind=TEXT),
        "mass": Key("Matrix Market or .npy file", kind=TEXT),
        "stiffness": Key("Matrix Market or .npy file", kind=TEXT),
        "damping": Key("Matrix Market or .npy file; without it, damping_ratios", kind=TEXT),
        "units": Key("of the matrices", kind=TEXT, choices=("kg m N", "t mm N")),
        "modes": Key("how many of the slowest modes are kept", kind="count"),
        "residual_mode": Key(
            "keep the static deflection of the joint by all other modes; true by default", kind="flag"
        ),
        "base": Key("degrees of freedom that move with the base", kind="texts"),
        "universal_file": Key("file with data sets 55 of a modal test (extra [uff])", kind=TEXT),
    },
    "structure.shapes": {"*": SHAPE},
    "structure.degrees_of_freedom": {"*": Key("row of the matrices, counted from 0", kind="count")},
    "structure.points": {"*": Key("node and direction in the universal file, such as '12 +y'", kind=TEXT)},
    "structure.residual": {
        "at": Key("point whose compliance by the modes that were left out is known", kind=TEXT),
        "compliance": Key("what they add there", "m/N"),
        "frequency": Key("of the one mode that stands for them; twice the highest by default", "Hz"),
    },
    "joint": {
        "name": Key("of one of several joints: its fields begin with it, as in left_clearance", kind=TEXT),
        "at": Key(
            "point that moves in the gap, 'pinion - wheel', 'motor - 3 gear' or '50 mm pinion + rack'", kind=TEXT
        ),
        "clearance": Key("half the gap; with one stop its distance", "m"),
        "offset": Key("middle of the gap, from where the joint rests unloaded", "m"),
        "stops": Key("two, or one on the upper side", kind=TEXT, choices=("two", "one")),
        "stiffness": Key("spring of a stop; samples of one cycle, or a CSV file of them, if it varies", "N/m", "row"),
        "column": Key("of the CSV file, if it has several beside its angles", kind=TEXT),
        "damping": Key("damper of a stop; it varies as the spring does", "N s/m"),
        "friction": Key("coefficient of Coulomb friction at the stops, along tangent or slides"),
        "tangent": Key("point that moves along the surfaces, 'shaft' or '-shaft': it sticks or slides", kind=TEXT),
        "tangential_stiffness": Key("spring in series with friction; by default 0.82 of that of the stop", "N/m"),
        "sliding_speed": Key("of the surfaces, as of a belt, where the tangent grows; 0 by default", "m/s"),
        "slides": Key("in place of tangent: point that slides to where it grows, and is pulled back", kind=TEXT),
        **LAW_KEYS,
        "preload": Key("constant force towards the upper stop", "N"),
    },
    "joint.lower": {
        "stiffness": Key("spring of the lower stop, if it differs", "N/m"),
        "damping": Key("damper of the lower stop, if it differs", "N s/m"),
    },
    "spring": {
        "at": Key("point that it holds, or 'pinion - wheel' as of a joint", kind=TEXT),
        "stiffness": Key("beside the structure's own; samples of one cycle, or a CSV file of them", "N/m", "row"),
        "damping": Key("of a damper beside it, or alone; 0 by default", "N s/m", low=0.0, high=1e9),
        "column": Key("of the CSV file, if it has several beside its angles", kind=TEXT),
    },
    "load": {
        "at": Key("point that it pulls at, where the shape grows, or as of a joint; 'base' for a weight", kind=TEXT),
        "force": Key("constant: a weight, a drag torque, a preload", KINDS["force"]),
        "acceleration": Key(
            "constant, of the base; that of gravity, upward, is the weight of all that the base carries",
            KINDS["acceleration"],
        ),
    },
    "drive": {
        "at": Key("point where it acts; 'base' for a motion of the base, with which the stops move", kind=TEXT),
        "force": Key("amplitude, samples of one cycle, or a CSV file of them", KINDS["force"], "row"),
        "unbalance": Key("mass times eccentricity: the force grows with speed squared", KINDS["unbalance"], "row"),
        "displacement": Key("of the base: amplitude, samples of a cycle, or a CSV file", KINDS["displacement"], "row"),
        "acceleration": Key("of the base: amplitude, samples of a cycle, or a CSV file", KINDS["acceleration"], "row"),
        "column": Key("of the CSV file, if it has several beside its angles", kind=TEXT),
        "harmonic": Key("of the speed; 1 by default", kind="count"),
        "angle": Key("phase of the sine", "deg"),
        "harmonics": Key("how many the samples are cut to", kind="count"),
    },
    "operation": {
        "speed": Key("operating cycles a second", "Hz"),
        "initial_state": INITIAL_STATE,
        "speed_range": Key("lowest and highest", "Hz", "row"),
        "clearance_range": Key("lowest and highest, of the monitored or the first joint", "m", "row"),
        "monitored": Key("joint that is shown and judged; if open, the one with the largest force", kind=TEXT),
    },
    **OPERATION,
}
"""Tables of the file by their path; "*" is a name that the user chooses."""


def _unit_of(name: str, given: Any, key: Key) -> str:
    """Unit of a key: that of what turns where the unit given says so, and none of a shape that has none."""
    base = ("kg^1/2", "kg m", "kg")  # the last two beside modal masses
    for unit in base if name == "structure.shapes.base" else (key.unit,):
        moves = turns(given, unit)
        if moves is not None:
            return TURNING[unit] if moves else unit
    return "-" if key is SHAPE else key.unit  # no unit, which modal masses allow


KEYS = Keys(
    TABLES,
    required=("structure", "joint", "operation"),
    lists=("drive", "load", "spring"),
    either=("joint",),
    unknown=told_of,
    misfit=hint,
    unit_of=_unit_of,
    beside=TURNING,
)
