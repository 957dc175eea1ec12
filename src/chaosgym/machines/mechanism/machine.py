"""A mechanism with clearance in some of its joints, as a machine; ``machine_class`` makes its class."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import BendingPart
from chaosgym.machines.binned.equations import Contact, Held, held, middles_and_nodes
from chaosgym.machines.binned.model import KEPT_BYTES, MAX_SETS
from chaosgym.machines.contact_law import stiffness_at
from chaosgym.machines.drive_torque import DriveTorque
from chaosgym.machines.mechanism.beam import fibre_stress
from chaosgym.machines.mechanism.equations import SmallMotion, assembled, refuse_massless, small_motion
from chaosgym.machines.mechanism.friction import friction_torque, loose_friction, tight_load
from chaosgym.machines.mechanism.joints import (
    ACROSS,
    ALONG,
    PITCH,
    PLACES,
    ROUND,
    SIDEWAYS,
    TURN,
    YAW,
    LinkJoint,
    surface_fields,
)
from chaosgym.machines.mechanism.links import RIGID, Link
from chaosgym.machines.mechanism.nominal import even_angles
from chaosgym.machines.mechanism.notes import instabilities_of, notes_of
from chaosgym.machines.mechanism.opened import OpenedMechanism
from chaosgym.machines.mechanism.spatial_beam import fibre_stress_around
from chaosgym.numbers import number, whole

if TYPE_CHECKING:
    from chaosgym.machines.picture import Sketch

TORQUE_ANGLES = 720
"""Crank angles at which the torque of the drive is told."""

MOST_ANGLES, MOST_TURNED = 20_000, 1e6
"""Crank angles at which equations are given at once, and where they may begin [rad]."""

GUIDED = {ACROSS: {TURN: 1.0, PITCH: 1.0}, SIDEWAYS: {YAW: -1.0}}
"""Turns in a guide, in the plane or in space, that move its stations in either direction per metre of their place."""


@dataclass(frozen=True, kw_only=True)
class MechanismMachine(OpenedMechanism):
    """A mechanism whose crank turns at constant speed, with clearance in some joints; made by ``machine_of``.

    Its fields are those of ``OpenedMechanism``, and those of its joints and links.
    """

    def equations(self, first: float, count: int) -> SmallMotion:
        """Equations of small motions at ``count`` crank angles from ``first`` [rad] on; see ``small_motion``.

        Raises
        ------
        ParameterError
            If the angles are out of range.
        """
        whole("count", count, 1, MOST_ANGLES)
        number("first", first, -MOST_TURNED, MOST_TURNED, "rad")
        return small_motion(self.scaled(), self.revolution, first + even_angles(count))

    @property
    def drive_torque(self) -> DriveTorque:
        """Torque of the drive over a revolution at the machine's speed; see ``Machine.drive_torque``."""
        angles = even_angles(TORQUE_ANGLES)
        whole = assembled(self.scaled(), self.revolution, matrices=False, rubbing=self.rubs)
        torque = product(matrices.power(self.crank_rate, range(3)), whole.torque_at(angles))
        if self.rubs:
            torque = torque + friction_torque(self, whole, angles)
        return DriveTorque(torque, self.crank_rate)

    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""
        middles, nodes = middles_and_nodes(self.bins)
        whole = assembled(self.scaled(), self.revolution, rubbing=self.rubs)
        # on the grid they are sums of squares to the last digit
        refuse_massless(whole.matrices[:, 0], self.degrees_of_freedom)
        matrices, load = whole.matrices_at(middles), whole.load_at(nodes)
        if not self.rubs:
            return held(*matrices, load)
        load[0] += tight_load(self, whole, nodes)
        return held(*matrices, load, *loose_friction(self, whole, middles))

    @property
    def radix(self) -> int:
        """Contact states of a channel that differ in their matrices: friction tells one side from the other."""
        return 3 if any(self.frictions[name].acts for name in self.loose) else 2

    @property
    def contacts(self) -> list[Contact]:
        """Contacts of all joints with clearance, in their order."""
        found, loose = [], self.loose
        for joint in self.mechanism.joints:
            if not joint.opened:
                continue
            law = self.laws[joint.name]
            gap, spring, damper = (getattr(self, f"{joint.name}_{what}") for what in surface_fields(law))
            slides = loose.index(joint.name) if joint.name in loose else -1
            seen = float(joint.name == self.monitored)
            if joint.kind in ROUND:
                ways = [way for way in PLACES if way in joint.opened]
                rows = np.stack([self.row_of(joint.name, way) for way in ways])
                reading = seen * np.eye(3)[[PLACES[way] for way in ways]]
                found.append(Contact(rows, gap, spring, damper, True, reading, slides, exponent=law))
                continue
            if joint.radii:
                reading = seen * np.eye(3)[[PLACES[ACROSS]]]
                found.append(
                    Contact(self.row_of(joint.name, TURN)[None], gap, spring, damper, True, reading, exponent=law)
                )
                continue
            for place in self.stations[joint.name] or (0.0,):
                for way in (way for way in GUIDED if way in joint.opened):
                    row = self.row_of(joint.name, way)
                    row = row + sum(place * sign * self.row_of(joint.name, turn) for turn, sign in GUIDED[way].items())
                    reading = seen * np.eye(3)[[PLACES[way]]]
                    found.append(Contact(row[None], gap, spring, damper, True, reading, slides, exponent=law))
        return found

    @property
    def has_propagators(self) -> bool:
        """True if every contact is a linear channel, and the sets of closed ones are few and fit into memory."""
        rows = [len(contact.row) for contact in self.contacts]
        n, sets = len(self.degrees_of_freedom), self.radix ** len(rows)
        return (
            not any(self.laws.values())
            and max(rows) == 1
            and sets <= MAX_SETS
            and sets * self.bins * 16 * (2 * n + 5) ** 2 < KEPT_BYTES
        )

    @property
    def display(self) -> Array:
        """Displacement of the monitored joint: across it."""
        return np.array(self.displayed) if self.displayed else self.row_of(self.monitored, self._watched.gap)

    @property
    def bending_parts(self) -> Mapping[str, BendingPart]:
        """Links that bend, with two outer fibres or in space 16 around."""
        bend = [link for link in self.mechanism.links if link.beam is not None]
        return {link.name: BendingPart(partial(self._fibre_stress, link), self._showing) for link in bend}

    def _showing(self, row: Array) -> Self:
        return replace(self, displayed=tuple(row.tolist()))

    def _fibre_stress(self, link: Link, position: float, fibre: float) -> Array:
        beam: Any = link.beam
        if not 0.0 <= position <= beam.length:
            raise ParameterError(
                f"section at {position:g} m is outside the link {link.name}; allowed: 0 to {beam.length:g} m"
            )
        at_fibres = (fibre_stress if link.rigid == RIGID else fibre_stress_around)(link, beam, position, fibre)
        stress = np.zeros((len(at_fibres), len(self.degrees_of_freedom)))
        stress[:, [self.degrees_of_freedom.index(f"{link.name} {name}") for name in link.elastic]] = at_fibres
        return stress

    @property
    def _watched(self) -> LinkJoint:
        return next(each for each in self.mechanism.joints if each.name == self.monitored)

    @property
    def round_bearing(self) -> bool:
        """True for a pin in its hole, and a ball in its socket."""
        return self._watched.kind in ROUND

    def bearing_place(self, phase: Array, force: Array) -> tuple[Array, str]:
        """Where on its bearing the monitored joint carries a force, and the unit; see ``SliderCrank.bearing_place``.

        How far along the guide or slot [m]; or the polar angle around a pin [deg], from the axis of the bearing link.
        """
        joint = self._watched
        if self.round_bearing:
            first = 1 if ALONG not in joint.opened else 0
            return np.degrees(np.arctan2(force[:, first + 1], force[:, first])), "deg"
        return self.mechanism.along(self.nominal_places(phase), joint)[0], "m"

    @property
    def stiffest(self) -> float:
        """Stiffness [N/m] of the stiffest contact; of a Hertzian one, at ten times the largest nominal load."""
        load = heaviest_load(self) if any(self.laws.values()) else 0.0
        return max(stiffness_at(contact.stiffness, contact.exponent, load) for contact in self.contacts)

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] of what bends, at rest at crank angle 0 with every joint tight; none if rigid."""
        elastic = sum(len(link.elastic) for link in self.mechanism.links)
        if not elastic:
            return np.zeros(0)
        found = self.equations(0.0, 12)
        stiffness, mass = found.stiffness[0, 0, -elastic:, -elastic:], found.mass[0, -elastic:, -elastic:]
        squares, _ = matrices.eigh(stiffness, mass)
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi))

    def sensed(self, peak_force: Array) -> Array:
        """Largest force [N] of each cycle on either side of the monitored joint, (..., cycles)."""
        return np.asarray(peak_force.max(axis=-1))

    @property
    def instabilities(self) -> tuple[str, ...]:
        """Links that buckle, and links in space that bend undamped."""
        return instabilities_of(self)

    @property
    def notes(self) -> tuple[str, ...]:
        """Gaps that are not small, pins larger than links, motion that may grow, and limits of a motor."""
        return notes_of(self)

    def sketch(self, record: Any, rows: NDArray[np.int64], force_limit: float) -> "Sketch":
        """Links, and the motion in the gap of the monitored joint; see ``Machine.sketch``."""
        from chaosgym.machines.mechanism.picture import sketch_of_mechanism

        return sketch_of_mechanism(record, rows, force_limit)

    def draw_poses(self, panels: Any) -> bool:
        """Draw the links at equal steps of the crank angle, one in each panel; see ``Machine.draw_poses``."""
        from chaosgym.machines.mechanism.picture import draw_poses

        draw_poses(panels, self)
        return True


@lru_cache(maxsize=256)
def heaviest_load(machine: OpenedMechanism) -> float:
    """Ten times the largest load [N] of a gap in the nominal motion."""
    powers = assembled(machine.scaled(), machine.revolution, matrices=False).load_at(even_angles(72))
    across = [
        machine.degrees_of_freedom.index(f"{joint.name} {joint.gap}")
        for joint in machine.mechanism.joints
        if joint.opened
    ]
    return 10.0 * max(
        1.0,
        float(np.abs(np.einsum("k,kbn->bn", matrices.power(machine.crank_rate, range(3)), powers)[:, across]).max()),
    )
