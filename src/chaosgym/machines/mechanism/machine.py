"""A mechanism with clearance in some of its joints, as a machine; ``machine_class`` makes its class."""

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.binned.model import HERTZ, LINEAR
from chaosgym.errors import ParameterError
from chaosgym.machines.binned.equations import Contact, Held, held, middles_and_nodes
from chaosgym.machines.binned.model import KEPT_BYTES, MAX_SETS
from chaosgym.machines.drive_torque import DriveTorque
from chaosgym.machines.mechanism.beam import fibre_stress
from chaosgym.machines.mechanism.bound import heaviest_load
from chaosgym.machines.mechanism.clearance import ROUND
from chaosgym.machines.mechanism.contacts import contacts_of
from chaosgym.machines.mechanism.equations import SmallMotion, assembled, refuse_massless, small_motion
from chaosgym.machines.mechanism.friction import friction_torque, rubbing
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, Joint
from chaosgym.machines.mechanism.links import RIGID
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
        powers = assembled(self.scaled(), self.revolution, matrices=False).torque_at(even_angles(TORQUE_ANGLES))
        torque = self.crank_rate ** np.arange(3) @ powers
        return DriveTorque(torque + friction_torque(self, even_angles(TORQUE_ANGLES)), self.crank_rate)

    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""
        middles, nodes = middles_and_nodes(self.bins)
        whole = assembled(self.scaled(), self.revolution)
        # on the grid they are sums of squares to the last digit
        refuse_massless(whole.matrices[:, 0], self.degrees_of_freedom)
        matrices, load = whole.matrices_at(middles), whole.load_at(nodes)
        if not self.rub:
            return held(*matrices, load)
        _, signed, driven = rubbing(self, middles)
        tangent = self.rub * signed if self.lever is not None else None
        return held(*matrices, load, driven, tangent)

    @property
    def radix(self) -> int:
        """Contact states of a channel that differ in their matrices: friction tells one side from the other."""
        return 3 if self.rub else 2

    @property
    def law(self) -> int:
        """Law of all contacts."""
        return HERTZ if self.hertz else LINEAR

    @property
    def contacts(self) -> list[Contact]:
        """Contacts of all joints with clearance, in their order."""
        return contacts_of(self)

    @property
    def has_propagators(self) -> bool:
        """True if every contact is a linear channel, and the sets of closed ones are few and fit into memory."""
        rows = [len(contact.row) for contact in self.contacts]
        n, sets = len(self.degrees_of_freedom), self.radix ** len(rows)
        return (
            not self.hertz
            and max(rows) == 1
            and sets <= MAX_SETS
            and sets * self.bins * 16 * (2 * n + 5) ** 2 < KEPT_BYTES
        )

    @property
    def display(self) -> Array:
        """Displacement of the monitored joint: across it."""
        return np.array(self.displayed) if self.displayed else self.row_of(self.monitored, ACROSS)

    def showing(self, row: Array) -> Self:
        """The machine whose histories show a row (n,) of its coordinates; see ``Machine.showing``."""
        return replace(self, displayed=tuple(row.tolist()))

    @property
    def bending_links(self) -> tuple[str, ...]:
        """Names of the links that bend."""
        return tuple(link.name for link in self.mechanism.links if link.beam is not None)

    def fibre_stress(self, link: str, position: float, fibre: float) -> Array:
        """Stress at the outer fibres of a link, two or in space 16 around it; see ``Machine.fibre_stress``."""
        if link not in self.bending_links:
            bend = ", ".join(self.bending_links) or "a link with a [link.NAME.beam]"
            raise ParameterError(f"link {link!r} does not bend; allowed: {bend}")
        found = self.mechanism.link(link)
        beam: Any = found.beam
        if not 0.0 <= position <= beam.length:
            raise ParameterError(
                f"section at {position:g} m is outside the link {link}; allowed: 0 to {beam.length:g} m"
            )
        names = [f"{link} {name}" for name in found.elastic]
        told = (fibre_stress if found.rigid == RIGID else fibre_stress_around)(found, beam, position, fibre)
        stress = np.zeros((len(told), len(self.degrees_of_freedom)))
        stress[:, [self.degrees_of_freedom.index(name) for name in names]] = told
        return stress

    @property
    def _watched(self) -> Joint:
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
        stiffest = max(contact.stiffness for contact in self.contacts)
        return 1.5 * stiffest ** (2.0 / 3.0) * heaviest_load(self) ** (1.0 / 3.0) if self.hertz else stiffest

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] of what bends, at rest at crank angle 0 with every joint tight; none if rigid."""
        elastic = sum(len(link.elastic) for link in self.mechanism.links)
        if not elastic:
            return np.zeros(0)
        from scipy.linalg import eigh

        found = self.equations(0.0, 12)
        stiffness, mass = found.stiffness[0, 0, -elastic:, -elastic:], found.mass[0, -elastic:, -elastic:]
        squares = eigh(stiffness, mass, eigvals_only=True)
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

    def draw_poses(self, panels: Any) -> None:
        """Draw the links at equal steps of the crank angle, one in each panel."""
        from chaosgym.machines.mechanism.picture import draw_poses

        draw_poses(panels, self)
