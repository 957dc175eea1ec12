"""The contacts of a mechanism: the surfaces of each joint with clearance, as rows of its coordinates."""

import numpy as np

from chaosgym.machines.binned.equations import Contact
from chaosgym.machines.mechanism.clearance import ROUND, surface_fields
from chaosgym.machines.mechanism.joints import ACROSS, PITCH, PLACES, SIDEWAYS, TURN, YAW
from chaosgym.machines.mechanism.opened import OpenedMechanism

GUIDED = {ACROSS: {TURN: 1.0, PITCH: 1.0}, SIDEWAYS: {YAW: -1.0}}
"""Turns in a guide, in the plane or in space, that move its stations in either direction per metre of their place."""


def contacts_of(machine: OpenedMechanism) -> list[Contact]:
    """Contacts of all joints with clearance, in their order."""
    found = []
    for joint in machine.mechanism.joints:
        if not joint.opened:
            continue
        gap, spring, damper = (getattr(machine, f"{joint.name}_{what}") for what in surface_fields(machine.hertz))
        slides = joint.name == machine.rubs and machine.rub > 0.0
        seen = float(joint.name == machine.monitored)
        if joint.kind in ROUND:
            ways = [way for way in PLACES if way in joint.opened]
            rows = np.stack([machine.row_of(joint.name, way) for way in ways])
            reading = seen * np.eye(3)[[PLACES[way] for way in ways]]
            found.append(Contact(rows, gap, spring, damper, True, reading, slides))
            continue
        for place in machine.stations[joint.name] or (0.0,):
            for way in (way for way in GUIDED if way in joint.opened):
                row = machine.row_of(joint.name, way)
                row = row + sum(place * sign * machine.row_of(joint.name, turn) for turn, sign in GUIDED[way].items())
                reading = seen * np.eye(3)[[PLACES[way]]]
                found.append(Contact(row[None], gap, spring, damper, True, reading, slides))
    return found
