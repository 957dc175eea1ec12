"""A mechanism with clearance in some of its joints, as a machine; ``machine_class`` makes its class."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.binned.model import HERTZ, LINEAR
from chaosgym.errors import ParameterError
from chaosgym.machines.binned.equations import Contact, Held, held, middles_and_nodes
from chaosgym.machines.binned.machine import BinnedMachine
from chaosgym.machines.binned.model import KEPT_BYTES, MAX_SETS
from chaosgym.machines.drive_torque import DriveTorque
from chaosgym.machines.mechanism.beam import fibre_stress
from chaosgym.machines.mechanism.bound import heaviest_load
from chaosgym.machines.mechanism.clearance import ROUND
from chaosgym.machines.mechanism.contacts import contacts_of
from chaosgym.machines.mechanism.equations import SmallMotion, assembled, crank_inertia, refuse_massless, small_motion
from chaosgym.machines.mechanism.friction import friction_torque, rubbing
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, Joint
from chaosgym.machines.mechanism.links import RIGID
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.motor import MOTOR_FIELDS, Load, Motor, MotorRun, crank_of, turn
from chaosgym.machines.mechanism.nominal import Revolution, even_angles, places, revolution_of
from chaosgym.machines.mechanism.notes import instabilities_of, notes_of
from chaosgym.machines.mechanism.spatial_beam import fibre_stress_around
from chaosgym.machines.numbers import number, whole
from chaosgym.machines.parameters import assumed, parameter

if TYPE_CHECKING:
    from chaosgym.core.motor import Crank
    from chaosgym.machines.picture import Sketch

MOTOR_ANGLES = 90
"""Steps of a revolution under the motor."""

TORQUE_ANGLES = 720
"""Crank angles at which the torque of the drive is told."""

MOST_ANGLES, MOST_TURNED = 20_000, 1e6
"""Crank angles at which equations are given at once, and where they may begin [rad]."""


@dataclass(frozen=True, kw_only=True)
class MechanismMachine(BinnedMachine):
    """A mechanism whose crank turns at constant speed, with clearance in some joints; made by ``machine_of``.

    Every joint with clearance has fields that begin with its name: ``wrist_clearance``, ``wrist_stiffness`` and
    ``wrist_damping`` of the joint "wrist"; every link with mass has a ``rod_mass_factor``.

    Attributes
    ----------
    mechanism
        Its links and joints, in their middle.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names it and what is allowed.
    """

    name: ClassVar[str] = "mechanism"
    speed_field: ClassVar[str] = "speed"
    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        rung: {"matrix_update_interval": interval}
        for rung, interval in (("draft", 6.0), ("standard", 2.0), ("fine", 1.0), ("reference", 0.5))
    }
    stations: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    """Places [m] along a guide at which each joint with clearance can touch."""
    rubs: ClassVar[str] = ""
    """Joint with friction, if there is one."""
    hertz: ClassVar[bool] = False
    """Whether all contacts are Hertzian."""

    mechanism: Mechanism
    displayed: tuple[float, ...] = field(default=(), repr=False)
    """What histories show in place of the displacement of the monitored joint, for each coordinate; none for that."""
    speed: float = assumed(600.0, "rpm", 0.1, 1e5)
    """Constant speed of the crank [rpm]."""
    gravity_factor: float = assumed(1.0, "-", 0.0, 100.0)
    """Factor of gravity."""
    load_factor: float = assumed(1.0, "-", 0.0, 1e3)
    """Factor of the forces over the crank angle, those of a gas among them."""
    matrix_update_interval: float = assumed(2.0, "deg", 0.25, 30.0)
    """Crank angle over which mass, damping and stiffness matrices are held [deg]; divides 360."""
    monitored: str = parameter("", choices=("",), provenance="assumed", source="default")
    """Joint whose motion and force are recorded."""

    @property
    def clearance_field(self) -> str:
        """Field of the clearance of the monitored joint."""
        return f"{self.monitored}_clearance"

    @property
    def degrees_of_freedom(self) -> tuple[str, ...]:
        """Names of the coordinates: the gaps, then what bends."""
        return self.mechanism.coordinates

    @property
    def revolution(self) -> Revolution:
        """Steps of the nominal motion through a revolution."""
        return _revolution(self.mechanism)

    def nominal_places(self, theta: Array) -> Array:
        """Coordinates (B, z) of all links at crank angles (B,) [rad] with every gap in its middle."""
        return places(self.mechanism, self.revolution, theta)

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

    @property
    def motor(self) -> Motor | None:
        """The motor of the file; None where the speed is held constant."""
        if not self.has_motor:
            return None
        stall, speed, inertia = (float(getattr(self, name)) for name in MOTOR_FIELDS)
        return Motor(stall, self.rate_at(speed), inertia)

    def under_motor(self, cycles: int | None = None, speed: float = 0.0) -> MotorRun:
        """Run the crank under its motor, every gap in its middle; see ``motor.turn``.

        Parameters
        ----------
        cycles
            How many, or until the mean speed has settled.
        speed
            At the beginning [rpm].

        Raises
        ------
        ParameterError
            If the machine has no motor.
        """
        return turn(*self._motor_and_load, self.rate_at(speed), cycles)

    @property
    def crank(self) -> "Crank":
        """What turns under the motor, with every gap in its middle; raises as ``under_motor``."""
        return crank_of(*self._motor_and_load)

    @property
    def _motor_and_load(self) -> tuple[Motor, Load]:
        motor = self.motor
        if motor is None:
            raise ParameterError(f"{self.name} has no motor; allowed: a file with [motor]")
        scaled, angles = self.scaled(), even_angles(MOTOR_ANGLES)
        still, viscous, _ = assembled(scaled, self.revolution, matrices=False).torque_at(angles)
        return motor, Load(crank_inertia(scaled, self.revolution, angles), still, viscous)

    def scaled(self) -> Mechanism:
        """The mechanism with the factors of this machine."""
        links = []
        for link in self.mechanism.links:
            factor = getattr(self, f"{link.name}_mass_factor", 1.0)
            links.append(link._replace(mass=factor * link.mass, inertia=factor * link.inertia))
        gravity = tuple(self.gravity_factor * part for part in self.mechanism.gravity)
        forces = tuple(force.times(self.load_factor) for force in self.mechanism.forces)
        return replace(self.mechanism, links=tuple(links), gravity=gravity, forces=forces)

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
    def rub(self) -> float:
        """Coefficient of friction, or 0."""
        return float(getattr(self, f"{self.rubs}_friction")) if self.rubs else 0.0

    @property
    def lever(self) -> float | None:
        """Radius [m] of a pin with friction."""
        radius = getattr(self, f"{self.rubs}_radius", None)
        return None if radius is None else float(radius)

    @property
    def radix(self) -> int:
        """Contact states of a channel that differ in their matrices: friction tells one side from the other."""
        return 3 if self.rub else 2

    @property
    def law(self) -> int:
        """Law of all contacts."""
        return HERTZ if self.hertz else LINEAR

    def row_of(self, joint: str, motion: str) -> Array:
        """The coordinate (n,) that is a motion of a joint."""
        return np.array([float(name == f"{joint} {motion}") for name in self.degrees_of_freedom])

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


@lru_cache(maxsize=256)
def _revolution(mechanism: Mechanism) -> Revolution:
    return revolution_of(mechanism)
