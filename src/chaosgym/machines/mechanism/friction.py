"""Friction in the joints of a mechanism: what it drives in the equations, and what it takes from the drive.

Surfaces with clearance rub under the forces of their contacts. Tight joints rub under those that hold them in the
nominal motion, with friction in it; what knocks add is left out. So do all joints for the torque of the drive. A pin's
force is that of its hole and of friction along it, so that the normal one is its part by sqrt(1 + mu^2).
"""

import math

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.friction_law import Friction
from chaosgym.machines.mechanism.equations import Assembled, Rubbing
from chaosgym.machines.mechanism.joints import ROUND
from chaosgym.machines.mechanism.opened import OpenedMechanism

ROUNDS = 1000
"""Most rounds in which friction and the force that presses find each other."""

SAME = 1e-12
"""Share of the largest force by which the last round may change it."""


def check_friction(kind: str, friction: Friction, loose: bool, spatial: bool = False) -> None:
    """Refuse friction in a joint of some kind that has none.

    Raises
    ------
    ParameterError
        If the joint does not rub, friction lacks a radius, or a radius has no meaning.
    """
    pin = kind in ROUND
    if not pin and kind not in ("prismatic", "slot"):
        raise ParameterError(f"friction has no meaning in a {kind} joint; leave it out")
    if spatial and (pin or not loose):
        what = "of a pin in its hole" if pin else "of a tight joint"
        raise ParameterError(f"friction {what} is modelled in the plane; allowed: in a prismatic joint with clearance")
    if not pin and friction.radius is not None:
        raise ParameterError(f"radius has no meaning in a {kind} joint; leave it out")
    if pin and (friction.radius is None or friction.coefficient is None):
        raise ParameterError("friction of a pin needs its radius, and a radius has no other meaning; allowed: both")
    if friction.radius == 0.0:
        raise ParameterError("radius = 0 m leaves the friction of a pin without moment; allowed: above 0, or neither")


def _coefficients(machine: OpenedMechanism, rate: Array) -> Array:
    """Coefficients (J, B) of joints that slide by ``rate`` (J, B) per radian, with its sign."""
    pairs = zip(machine.frictions.values(), rate, strict=True)
    return np.array([friction.at(friction.lever * each * machine.crank_rate) for friction, each in pairs])


def _levers(machine: OpenedMechanism) -> Array:
    return np.array([friction.lever for friction in machine.frictions.values()])


def loose_friction(machine: OpenedMechanism, whole: Assembled, theta: Array) -> tuple[Array, Array]:
    """``friction`` and ``tangent`` of ``Held``, of the joints with clearance, at crank angles (B,)."""
    found = whole.rubbing_at(theta)
    signed, loose = _coefficients(machine, found.rate), [machine.rubs.index(name) for name in machine.loose]
    driven = (_levers(machine)[:, None] * signed)[:, None] * found.motion
    return np.swapaxes(driven[loose], 1, 2), signed[loose]


def _presses(machine: OpenedMechanism, name: str, pushed: Array, signed: Array) -> Array:
    """Normal force (B,) of a joint that is held by ``pushed`` (r, B), its surfaces sliding by ``signed`` (B,)."""
    joint = next(each for each in machine.mechanism.joints if each.name == name)
    if joint.kind in ROUND:
        return np.asarray(np.hypot.reduce(pushed, axis=0) / np.hypot(1.0, signed))
    if not joint.opened:
        return np.asarray(np.abs(pushed[0]))
    own = [k for k, motion in enumerate(machine.degrees_of_freedom) if motion.startswith(f"{name} ")]
    surfaces = [contact.row for contact in machine.contacts if contact.slides == machine.loose.index(name)]
    return np.asarray(np.abs(product(matrices.pinv(np.concatenate(surfaces)[:, own].T), pushed)).sum(axis=0))


def _nominal(machine: OpenedMechanism, whole: Assembled, theta: Array) -> tuple[Array, Rubbing]:
    """Friction (J, B) [N], of a pin [N m], in the nominal motion, with the sign of its sliding."""
    found = whole.rubbing_at(theta)
    forces = np.einsum("k,krb->rb", matrices.power(machine.crank_rate, range(3)), found.forces)
    signed = _coefficients(machine, found.rate)
    factors, largest = _levers(machine)[:, None] * signed, float(np.abs(forces).max())
    friction, each = np.zeros_like(found.rate), list(zip(machine.rubs, found.rows, signed, strict=True))
    for _ in range(ROUNDS):
        pushed = forces + np.einsum("jb,jrb->rb", friction, found.answer)
        normal = np.array([_presses(machine, name, pushed[rows], sliding) for name, rows, sliding in each])
        change = factors * normal - friction
        friction = friction + change
        if not np.abs(friction).max() < 1e15 * max(largest, 1e-300):
            break
        if np.abs(change).max() <= SAME * np.abs(friction).max():
            return friction, found
    worst, at = np.unravel_index(int(np.argmax(np.abs(change))), change.shape)
    name, where = machine.rubs[worst], math.degrees(theta[at])
    raise ParameterError(
        f"{name}_friction = {machine.frictions[name].coefficient:g} locks the mechanism at crank angle {where:.0f} "
        "deg; allowed: less"
    )


def tight_load(machine: OpenedMechanism, whole: Assembled, theta: Array) -> Array:
    """What the gaps feel (B, n) of friction in tight joints at the machine's speed, as ``SmallMotion.load``."""
    tight = [j for j, name in enumerate(machine.rubs) if name not in machine.loose]
    if not tight:
        return np.zeros((len(theta), len(machine.degrees_of_freedom)))
    friction, found = _nominal(machine, whole, theta)
    return np.asarray(np.einsum("jb,jnb->bn", friction[tight], found.motion[tight]))


def friction_torque(machine: OpenedMechanism, whole: Assembled, theta: Array) -> Array:
    """Torque (B,) [N m] that friction takes from the drive in the nominal motion."""
    friction, found = _nominal(machine, whole, theta)
    return np.asarray(np.einsum("jb,jb->b", friction, found.rate))
