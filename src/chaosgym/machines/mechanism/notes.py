"""What a user should know of a mechanism: gaps that are not small, motion that may grow, and limits of its motor."""

import math
from functools import lru_cache

import numpy as np

from chaosgym.machines.mechanism.buckling import buckling
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.motor import MOTOR_FIELDS
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
    if machine.has_motor and machine.rub:
        told.append(f"the run-up under the motor leaves friction of {machine.rubs} out")
    if machine.has_motor:
        _, no_load_speed, _ = (getattr(machine, name) for name in MOTOR_FIELDS)
        told += machine.under_motor().notes(machine.speed, no_load_speed)
    told += instabilities_of(machine)
    reach = _reach(machine.mechanism, machine.rubs) if machine.lever else math.inf
    if machine.lever and machine.lever > reach:
        told.append(
            f"{machine.rubs}_radius of {machine.lever:g} m is more than the {reach:.3g} m that its links reach: "
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
