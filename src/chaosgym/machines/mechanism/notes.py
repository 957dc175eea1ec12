"""What a user should know of a mechanism: gaps that are not small, motion that may grow, and limits of its motor."""

import math
from functools import lru_cache

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.machines.mechanism.equations import assembled
from chaosgym.machines.mechanism.links import Beam, Link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.motor import MOTOR_FIELDS
from chaosgym.machines.mechanism.nominal import Revolution
from chaosgym.machines.mechanism.opened import OpenedMechanism

SMALL = 0.02
"""Clearance as a share of a link's length beyond which motions in the gap are not small."""


def instabilities_of(machine: OpenedMechanism) -> tuple[str, ...]:
    """Links that buckle, and links in space that bend undamped."""
    told = [*buckling(machine.scaled(), machine.revolution, machine.crank_rate)]
    undamped = [link.name for link in machine.mechanism.links if link.beam and not link.beam.damping_ratio]
    if len(undamped) > 1 and machine.mechanism.dimensions == 3:
        told.append(
            f"{' and '.join(undamped)} bend without damping: updates of the matrices may make their motion grow "
            "without end; give each a damping_ratio, such as 0.001, or halve matrix_update_interval"
        )
    return tuple(told)


def notes_of(machine: OpenedMechanism) -> tuple[str, ...]:
    """Gaps that are not small, pins larger than links, motion that may grow, and limits of a motor."""
    told = []
    rubbing = [name for name, friction in machine.frictions.items() if friction.acts]
    tight = [name for name in rubbing if name not in machine.loose]
    if machine.has_motor and rubbing:
        told.append(f"the run-up under the motor leaves friction of {', '.join(rubbing)} out")
    if tight:
        told.append(f"friction in {', '.join(tight)} is that of the nominal motion: what knocks add is left out")
    if machine.has_motor:
        _, no_load_speed, _ = (getattr(machine, name) for name in MOTOR_FIELDS)
        told += machine.under_motor().notes(machine.speed, no_load_speed)
    told += [force.note for force in machine.mechanism.forces if force.note]
    units = {"prismatic": "m", "revolute": "rad"}
    moved = ((joint, joint.moves) for joint in machine.mechanism.joints if joint.moves)
    told += filter(None, (cycle.note(f"the motion of {joint.name}", units[joint.kind]) for joint, cycle in moved))
    told += instabilities_of(machine)
    for name, friction in machine.frictions.items():
        reach = _reach(machine.mechanism, name)
        if friction.radius is not None and friction.radius > reach:
            told.append(
                f"{name}_radius of {friction.radius:g} m is more than the {reach:.3g} m that its links reach: "
                "right for an eccentric, else a wrong unit or a place in the radius' stead"
            )
    for joint in machine.mechanism.joints:
        if joint.opened:
            gap, reach = getattr(machine, f"{joint.name}_clearance"), _reach(machine.mechanism, joint.name)
            if gap > SMALL * reach:
                told.append(
                    f"{joint.name}_clearance is {gap / reach:.2g} of the {reach:.3g} m that its links reach: "
                    f"motions are taken as small, and are good to some 2 % only up to {SMALL:g}"
                )
    return tuple(told)


@lru_cache(maxsize=1024)
def _reach(mechanism: Mechanism, joint: str) -> float:
    """Shortest distance [m] between two points of the moving links that a joint joins; infinite if they have one."""
    found = next(each for each in mechanism.joints if each.name == joint)
    shortest = math.inf
    for name, _ in (found.first, found.second):
        if name in mechanism.at:
            places = np.array([point.place[0] for point in mechanism.link(name).points.values()])
            apart = np.linalg.norm(places[:, None] - places, axis=-1)
            shortest = min(shortest, float(np.min(apart[apart > 0.0], initial=math.inf)))
    return shortest


ANGLES = 72
"""Crank angles at which links are asked whether they buckle."""


def buckling(mechanism: Mechanism, revolution: Revolution, rate: float) -> tuple[str, ...]:
    """Tell of each link beyond its Euler load, in each plane in which it bends, at a rate [rad/s] of the crank.

    Returns
    -------
    tuple of str
        Load, Euler load and crank angle of each; empty if there is none.
    """
    bent = [(link, link.beam) for link in mechanism.links if link.beam is not None]
    if not bent:
        return ()
    theta = np.linspace(0.0, 2.0 * math.pi, ANGLES, endpoint=False)
    with_forces, without = (
        assembled(mechanism, revolution, geometric=geometric).matrices_at(theta)[2] for geometric in (True, False)
    )
    stiffening = matrices.tensordot(matrices.power(rate, range(3)), with_forces - without, 1)
    told = []
    for link, beam in bent:
        for plane, moment in (("", beam.second_moment), ("sideways ", beam.sideways_moment)):
            shares = _shares(mechanism, link, f"{plane}mode ", stiffening)
            worst = int(np.argmax(shares))
            if shares[worst] > 1.0:
                euler = _euler_load(beam, moment)
                told.append(
                    f"{link.name} is pushed {plane}beyond its Euler load, where it buckles: "
                    f"{shares[worst] * euler:.4g} N against {euler:.4g} N at crank angle "
                    f"{360.0 * worst / ANGLES:.0f} deg"
                )
    return tuple(told)


def _shares(mechanism: Mechanism, link: Link, modes: str, stiffening: Array) -> Array:
    """Load at each angle (B,) in Euler loads, of the geometric stiffness (B, n, n), in a plane whose modes begin so."""
    names = [name for name in link.elastic if name.startswith(modes)]
    if not names:
        return np.zeros(len(stiffening))
    at = [mechanism.coordinates.index(f"{link.name} {name}") for name in names]
    own = np.sqrt(link.stiffness.diagonal()[[link.elastic.index(name) for name in names]])
    return np.asarray(matrices.eigvalsh(-stiffening[:, at][:, :, at] / np.outer(own, own))[:, -1])


def _euler_load(beam: Beam, second_moment: float) -> float:
    """Load [N] at which a beam that is pinned at both ends buckles."""
    return math.pi**2 * beam.youngs_modulus * second_moment / beam.length**2
