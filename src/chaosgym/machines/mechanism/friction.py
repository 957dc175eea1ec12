"""Friction of one joint of a mechanism: what it drives in the equations, and what it takes from the drive."""

import math

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.equations import assembled
from chaosgym.machines.mechanism.opened import OpenedMechanism

RAMP = 0.02
"""Sliding speed below which friction fades, as a share of the largest in a revolution."""

FRICTION_ROUNDS = 1000
"""Most rounds in which friction and the force that presses find each other."""


def rubbing(machine: OpenedMechanism, theta: Array) -> tuple[Array, Array, Array]:
    """Sliding per radian (B,) of the joint with friction, its sign (B,), and what a newton drives (B, n).

    The sign fades where the sliding halts.
    """
    rate, row = assembled(machine.mechanism, machine.revolution, matrices=False, slides=machine.rubs).sliding_at(theta)
    signed = np.clip(rate / max(RAMP * float(np.abs(rate).max()), 1e-300), -1.0, 1.0)
    lever = 1.0 if machine.lever is None else machine.lever
    return lever * rate, signed, lever * machine.rub * signed[:, None] * row


def friction_torque(machine: OpenedMechanism, angles: Array) -> Array:
    """Torque (B,) that friction takes while the joint's surfaces carry what holds its gap in the middle."""
    if not machine.rub:
        return np.zeros(len(angles))
    rate, signed, driven = rubbing(machine, angles)
    own = [k for k, name in enumerate(machine.degrees_of_freedom) if name.startswith(f"{machine.rubs} ")]
    powers = assembled(machine.scaled(), machine.revolution, matrices=False).load_at(angles)[:, :, own]
    held_by = np.linalg.pinv(np.concatenate([contact.row for contact in machine.contacts if contact.slides])[:, own].T)
    push = -np.tensordot(machine.crank_rate ** np.arange(3), powers, 1)
    total, change = np.zeros(len(angles)), np.full(len(angles), np.inf)
    # friction itself presses the surfaces, or relieves them
    for _ in range(FRICTION_ROUNDS):
        before, parts = total, np.abs((push - total[:, None] * driven[:, own]) @ held_by.T)
        total = parts.sum(axis=1)
        if machine.lever is not None:  # friction turns the force of a pin
            total = np.hypot(*parts.T) / np.hypot(1.0, machine.rub * signed)
        change = np.abs(total - before)
        if change.max() <= 1e-9 * total.max():
            return np.asarray(total * machine.rub * signed * rate)
        if not total.max() < 1e15 * np.abs(push).max():
            break
    where = math.degrees(angles[change.argmax()])
    raise ParameterError(
        f"{machine.rubs}_friction = {machine.rub:g} locks the mechanism at crank angle {where:.0f} deg; allowed: less"
    )
