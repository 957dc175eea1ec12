"""A mechanism with clearance in some of its joints, as a machine; ``machine_class`` makes its class."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

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
from chaosgym.machines.mechanism.buckling import buckling
from chaosgym.machines.mechanism.clearance import ROUND, surface_fields
from chaosgym.machines.mechanism.equations import SmallMotion, assembled, crank_inertia, small_motion
from chaosgym.machines.mechanism.joints import ACROSS, ALONG, PITCH, PLACES, SIDEWAYS, TURN, YAW, Joint
from chaosgym.machines.mechanism.links import RIGID
from chaosgym.machines.mechanism.mechanism import Force, Mechanism
from chaosgym.machines.mechanism.motor import MOTOR_FIELDS, Load, Motor, MotorRun, crank_of, turn
from chaosgym.machines.mechanism.nominal import Revolution, places, revolution_of
from chaosgym.machines.mechanism.spatial_beam import fibre_stress_around
from chaosgym.machines.numbers import number, whole
from chaosgym.machines.parameters import assumed, parameter

if TYPE_CHECKING:
    from chaosgym.core.motor import Crank
    from chaosgym.machines.picture import Sketch

SMALL = 0.02
"""Clearance as a share of a link's length beyond which motions in the gap are not small."""

MOTOR_ANGLES = 90
"""Steps of a revolution under the motor."""

TORQUE_ANGLES = 720
"""Crank angles at which the torque of the drive is told."""

MOST_ANGLES, MOST_TURNED = 20_000, 1e6
"""Crank angles at which equations are given at once, and where they may begin [rad]."""

RAMP = 0.02
"""Sliding speed below which friction fades, as a share of the largest in a revolution."""

GUIDED = {ACROSS: {TURN: 1.0, PITCH: 1.0}, SIDEWAYS: {YAW: -1.0}}
"""Turns in a guide, in the plane or in space, that move its stations in either direction per metre of their place."""

FRICTION_ROUNDS = 1000
"""Most rounds in which friction and the force that presses find each other."""

LEAST_MASS = 1e-10
"""Least eigenvalue of a mass matrix whose diagonal is one."""


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
    extremes: ClassVar[Mapping[str, Mapping[str, Any]]] = {"no gravity": {"gravity_factor": 0.0}}

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
        return small_motion(self._scaled(), self.revolution, first + _even(count))

    @property
    def drive_torque(self) -> DriveTorque:
        """Torque of the drive over a revolution at the machine's speed; see ``Machine.drive_torque``."""
        powers = assembled(self._scaled(), self.revolution, matrices=False).torque_at(_even(TORQUE_ANGLES))
        torque = self.crank_rate ** np.arange(3) @ powers
        return DriveTorque(torque + self._friction_torque(TORQUE_ANGLES), self.crank_rate)

    def _friction_torque(self, count: int) -> Array:
        """Torque (B,) that friction takes while the joint's surfaces carry what holds its gap in the middle."""
        if not self._rub:
            return np.zeros(count)
        angles = _even(count)
        rate, signed, driven = self._rubbing(angles)
        own = [k for k, name in enumerate(self.degrees_of_freedom) if name.startswith(f"{self.rubs} ")]
        powers = assembled(self._scaled(), self.revolution, matrices=False).load_at(angles)[:, :, own]
        held_by = np.linalg.pinv(np.concatenate([contact.row for contact in self.contacts if contact.slides])[:, own].T)
        push = -np.tensordot(self.crank_rate ** np.arange(3), powers, 1)
        total, change = np.zeros(count), np.full(count, np.inf)
        # friction itself presses the surfaces, or relieves them
        for _ in range(FRICTION_ROUNDS):
            before, parts = total, np.abs((push - total[:, None] * driven[:, own]) @ held_by.T)
            total = parts.sum(axis=1)
            if self._lever is not None:  # friction turns the force of a pin
                total = np.hypot(*parts.T) / np.hypot(1.0, self._rub * signed)
            change = np.abs(total - before)
            if change.max() <= 1e-9 * total.max():
                return np.asarray(total * self._rub * signed * rate)
            if not total.max() < 1e15 * np.abs(push).max():
                break
        where = math.degrees(angles[change.argmax()])
        raise ParameterError(
            f"{self.rubs}_friction = {self._rub:g} locks the mechanism at crank angle {where:.0f} deg; allowed: less"
        )

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
        scaled, angles = self._scaled(), _even(MOTOR_ANGLES)
        still, viscous, _ = assembled(scaled, self.revolution, matrices=False).torque_at(angles)
        return motor, Load(crank_inertia(scaled, self.revolution, angles), still, viscous)

    def _scaled(self) -> Mechanism:
        """The mechanism with the factors of this machine."""
        links = []
        for link in self.mechanism.links:
            factor = getattr(self, f"{link.name}_mass_factor", 1.0)
            links.append(link._replace(mass=factor * link.mass, inertia=factor * link.inertia))
        gravity = tuple(self.gravity_factor * part for part in self.mechanism.gravity)
        forces = tuple(_Loaded(force, self.load_factor).force for force in self.mechanism.forces)
        return replace(
            self.mechanism,
            links=tuple(links),
            gravity=gravity,
            forces=forces,
        )

    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""
        middles, nodes = middles_and_nodes(self.bins)
        whole = assembled(self._scaled(), self.revolution)
        # on the grid they are sums of squares to the last digit
        self._refuse_massless(whole.matrices[:, 0])
        matrices, load = whole.matrices_at(middles), whole.load_at(nodes)
        if not self._rub:
            return held(*matrices, load)
        _, signed, driven = self._rubbing(middles)
        tangent = self._rub * signed if self._lever is not None else None
        return held(*matrices, load, driven, tangent)

    def _rubbing(self, theta: Array) -> tuple[Array, Array, Array]:
        """Sliding per radian (B,) of the joint with friction, its sign (B,), and what a newton drives (B, n).

        The sign fades where the sliding halts.
        """
        rate, row = assembled(self.mechanism, self.revolution, matrices=False, slides=self.rubs).sliding_at(theta)
        signed = np.clip(rate / max(RAMP * float(np.abs(rate).max()), 1e-300), -1.0, 1.0)
        lever = 1.0 if self._lever is None else self._lever
        return lever * rate, signed, lever * self._rub * signed[:, None] * row

    @property
    def _rub(self) -> float:
        """Coefficient of friction, or 0."""
        return float(getattr(self, f"{self.rubs}_friction")) if self.rubs else 0.0

    @property
    def _lever(self) -> float | None:
        """Radius [m] of a pin with friction."""
        radius = getattr(self, f"{self.rubs}_radius", None)
        return None if radius is None else float(radius)

    @property
    def radix(self) -> int:
        """Contact states of a channel that differ in their matrices: friction tells one side from the other."""
        return 3 if self._rub else 2

    @property
    def law(self) -> int:
        """Law of all contacts."""
        return HERTZ if self.hertz else LINEAR

    def _refuse_massless(self, mass: Array) -> None:
        """Refuse mass matrices (B, n, n) in which some motion moves no mass."""
        size = np.sqrt(np.maximum(np.einsum("bii->bi", mass), 0.0))
        scaled = mass / np.where(size > 0.0, size, 1.0)[:, :, None] / np.where(size > 0.0, size, 1.0)[:, None]
        sizes, ways = np.linalg.eigh(scaled)
        worst = int(np.argmin(sizes[:, 0]))
        if sizes[worst, 0] > LEAST_MASS:
            return
        # rounding may tie what has no mass to what has
        share = np.abs(ways[worst, :, 0])
        name = self.degrees_of_freedom[int(np.argmin(np.where(share > 0.5 * share.max(), size[worst], np.inf)))]
        raise ParameterError(
            f"nothing resists the motion {name!r}: the links that it moves have no mass, or no inertia where they "
            "only turn; allowed: a [[link.NAME.body]] with mass and inertia"
        )

    def row_of(self, joint: str, motion: str) -> Array:
        """The coordinate (n,) that is a motion of a joint."""
        return np.array([float(name == f"{joint} {motion}") for name in self.degrees_of_freedom])

    @property
    def contacts(self) -> list[Contact]:
        """Contacts of all joints with clearance, in their order."""
        found = []
        for joint in self.mechanism.joints:
            if not joint.opened:
                continue
            gap, spring, damper = (getattr(self, f"{joint.name}_{what}") for what in surface_fields(self.hertz))
            slides = joint.name == self.rubs and self._rub > 0.0
            seen = float(joint.name == self.monitored)
            if joint.kind in ROUND:
                ways = [way for way in PLACES if way in joint.opened]
                rows = np.stack([self.row_of(joint.name, way) for way in ways])
                reading = seen * np.eye(3)[[PLACES[way] for way in ways]]
                found.append(Contact(rows, gap, spring, damper, True, reading, slides))
                continue
            for place in self.stations[joint.name] or (0.0,):
                for way in (way for way in GUIDED if way in joint.opened):
                    row = self.row_of(joint.name, way)
                    row = row + sum(place * sign * self.row_of(joint.name, turn) for turn, sign in GUIDED[way].items())
                    reading = seen * np.eye(3)[[PLACES[way]]]
                    found.append(Contact(row[None], gap, spring, damper, True, reading, slides))
        return found

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
        """Where on its bearing the monitored joint carries a force, and the unit of that place.

        Parameters
        ----------
        phase : (n,)
            Phases [rad] of the cycle.
        force : (n, 3)
            Components of the force, as in ``CycleRecord.peak_vector``.

        Returns
        -------
        (place, unit)
            How far the point lies along the guide or slot, and "m"; or the polar angle around a pin, counted from the
            axis of the link that bears, and "deg".
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
        return 1.5 * stiffest ** (2.0 / 3.0) * _heavy(self) ** (1.0 / 3.0) if self.hertz else stiffest

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
        told = [*buckling(self._scaled(), self.revolution, self.crank_rate)]
        undamped = [link.name for link in self.mechanism.links if link.beam and not link.beam.damping_ratio]
        if len(undamped) > 1 and self.mechanism.dimensions == 3:
            told.append(
                f"{' and '.join(undamped)} bend without damping: updates of the matrices may make their motion grow "
                "without end; give each a damping_ratio, such as 0.001, or halve matrix_update_interval"
            )
        return tuple(told)

    @property
    def notes(self) -> tuple[str, ...]:
        """Gaps that are not small, pins larger than links, motion that may grow, and limits of a motor."""
        told = (
            [f"the run-up under the motor leaves friction of {self.rubs} out"] if self.has_motor and self._rub else []
        )
        if self.has_motor:
            _, no_load_speed, _ = (getattr(self, name) for name in MOTOR_FIELDS)
            told += self.under_motor().notes(self.speed, no_load_speed)
        told += self.instabilities
        reach = _reach(self.mechanism, self.rubs) if self._lever else math.inf
        if self._lever and self._lever > reach:
            told.append(
                f"{self.rubs}_radius of {self._lever:g} m is more than the {reach:.3g} m that its links reach: "
                "right for an eccentric, else a wrong unit or a place in the radius' stead"
            )
        for joint in self.mechanism.joints:
            if joint.opened:
                gap, reach = getattr(self, f"{joint.name}_clearance"), _reach(self.mechanism, joint.name)
                if gap > SMALL * reach:
                    told.append(
                        f"{joint.name}_clearance is {gap / reach:.2g} of the {reach:.3g} m that its links reach: "
                        f"motions are taken as small, and are good to some 2 % only up to {SMALL:g}"
                    )
        return tuple(told)

    def share_of_bound(self, states: Array, peak_force: Array) -> float:
        """Largest force, as a share of that of an impact of all masses at ten times the speed of the nominal motion."""
        mechanism = self._scaled()
        theta = _even(72)
        z, mass, fastest, load = self.nominal_places(theta), 0.0, 0.0, 0.0
        for link in mechanism.links:
            own, places = z[:, mechanism.at[link.name]], (*link.points.values(), link.masses)
            moved = np.concatenate([each.moved(own) for each in places], axis=1)
            fastest = max(fastest, float(np.ptp(moved, axis=0).max(initial=0.0)))
            mass += float(link.mass.sum() + link.inertia.sum() / max(self.revolution.length, 1e-9) ** 2)
        for force in mechanism.forces:
            load += float(np.abs(force.at(theta)).max())
        for spring in mechanism.springs:
            apart = mechanism.apart(z, spring.first, spring.second)[0]
            load += spring.stiffness * float(np.abs(np.linalg.norm(apart, axis=1) - spring.free_length).max())
        gravity = math.hypot(*mechanism.gravity)
        speed = 10.0 * (fastest * self.crank_rate + math.sqrt(gravity * self.revolution.length))
        speed += 10.0 * load * self.cycle_period / mass
        damper = max(contact.damping for contact in self.contacts)
        largest = (math.sqrt(self.stiffest * mass) + damper) * speed
        if self.hertz:
            stiffness = max(contact.stiffness for contact in self.contacts)
            largest = (1.25 * mass * speed**2) ** 0.6 * stiffness**0.4 * (1.0 + damper * speed)
        return float(peak_force.max()) / largest

    def sketch(self, record: Any, rows: NDArray[np.int64], force_limit: float) -> "Sketch":
        """Links, and the motion in the gap of the monitored joint; see ``Machine.sketch``."""
        from chaosgym.machines.mechanism.picture import sketch_of_mechanism

        return sketch_of_mechanism(record, rows, force_limit)

    def draw_poses(self, panels: Any) -> None:
        """Draw the links at equal steps of the crank angle, one in each panel."""
        from chaosgym.machines.mechanism.picture import draw_poses

        draw_poses(panels, self)


def _even(count: int) -> Array:
    """Crank angles [rad] of a revolution at equal steps from 0 on."""
    return np.linspace(0.0, 2.0 * math.pi, count, endpoint=False)


class _Loaded(NamedTuple):
    """A force times a factor."""

    given: Force
    factor: float

    @property
    def force(self) -> Force:
        return Force(self.given.point, lambda theta: self.factor * self.given.at(theta))


@lru_cache(maxsize=256)
def _revolution(mechanism: Mechanism) -> Revolution:
    return revolution_of(mechanism)


@lru_cache(maxsize=256)
def _heavy(machine: MechanismMachine) -> float:
    """Ten times the largest load [N] of a gap in the nominal motion."""
    powers = assembled(machine._scaled(), machine.revolution, matrices=False).load_at(_even(72))
    across = [
        machine.degrees_of_freedom.index(f"{joint.name} {ACROSS}") for joint in machine.mechanism.joints if joint.opened
    ]
    return 10.0 * max(
        1.0, float(np.abs(np.einsum("k,kbn->bn", machine.crank_rate ** np.arange(3), powers)[:, across]).max())
    )


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
