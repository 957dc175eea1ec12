"""Keys that a machine's file does not have: words that people write instead of the right key, and what to do."""

from chaosgym.machines.parameters import suggestion

PAGE = "docs/own-machine.md, 'What is modelled'"

TURNS = "what turns has a gap in rad or arcmin, forces in N m, springs in N m/rad, masses in kg m^2, by the same keys"

LIMITS = {
    "torque moment inertia rad arcmin": TURNS,
    "coulomb stribeck mu tangential": "friction of [joint] is Coulomb's, and tangent the point that sticks and slides",
    "random psd noise seed white": "a random drive does not fit: what drives repeats with every cycle",
    "flow fluid velocity wind": "forces that depend on the motion, as of a flow, do not fit",
    "time_varying mesh parametric stiffness_samples": "stiffness of [joint] or [[spring]] takes samples of one cycle",
    "chirp ramp step impulse": "a drive that does not repeat with every cycle does not fit; sweep over the speed",
    "control controller pid feedback": "a controller within the machine does not fit; an agent trims the speed only",
    "gap backlash play": "clearance is half the gap: of a backlash, its half",
    "joints gaps second": "several gaps are several [[joint]] tables, each with at, clearance, stiffness and damping",
    "cam lift": "a cam's lift moves the base and pulls the spring to ground, as in docs/machines/cam-follower.toml",
    "amplitude": "the amplitude is the number of the force, unbalance, displacement or acceleration itself",
    "frequency omega rad/s": "frequencies are in Hz (1 rad/s = 0.159 Hz); a drive's is harmonic times speed",
    "gravity weight": "a weight is a preload, or a force of constant samples",
    "cubic nonlinear hertz": "stops are linear springs; a stiffness that grows with the load does not fit",
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
