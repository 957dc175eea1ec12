"""A mechanism with clearance in some of its joints: its fields, its nominal motion, and what drives it."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.binned.machine import BinnedMachine
from chaosgym.machines.friction_law import FRICTION_FIELDS, Friction
from chaosgym.machines.mechanism.equations import assembled, crank_inertia
from chaosgym.machines.mechanism.links import MOST_MODES, Link
from chaosgym.machines.mechanism.mechanism import Mechanism
from chaosgym.machines.mechanism.motor import LINE, MOTOR_FIELDS, Load, Motor, MotorRun, crank_of, turn
from chaosgym.machines.mechanism.nominal import Revolution, even_angles, places, revolution_of
from chaosgym.machines.parameters import assumed, parameter

if TYPE_CHECKING:
    from chaosgym.core.motor import Crank

MOTOR_ANGLES = 90
"""Steps of a revolution under the motor."""


@dataclass(frozen=True, kw_only=True)
class OpenedMechanism(BinnedMachine):
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
    model_fields: ClassVar[tuple[str, ...]] = ("matrix_update_interval",)
    stations: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    """Places [m] along a guide at which each joint with clearance can touch."""
    rubs: ClassVar[tuple[str, ...]] = ()
    """Joints with friction, with clearance or without."""
    motor_curve: ClassVar[tuple[tuple[float, ...], tuple[float, ...]]] = LINE
    """Speeds and torques of its motor, as shares of that without load and of that at rest."""
    laws: ClassVar[Mapping[str, float]] = {}
    """Exponent of the penetration of each joint with clearance; LINEAR of a spring and damper."""

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
    def model_numbers(self) -> Mapping[str, float]:
        """Bins, and modes of each link that bends; see ``Machine.model_numbers``."""
        beams = {link.name: link.beam for link in self.mechanism.links if link.beam is not None}
        modes = {f"{name}_modes": beam.modes for name, beam in beams.items()}
        return {**modes, "matrix_update_interval": self.matrix_update_interval}

    @property
    def finer(self) -> "Self | None":
        """The machine with bins of half the angle, and twice the modes of links that bend; see ``Machine.finer``."""
        links = tuple(_with_twice_the_modes(link) for link in self.mechanism.links)
        bends = any(link.beam is not None for link in links)
        try:
            return replace(
                self,
                matrix_update_interval=0.5 * self.matrix_update_interval,
                mechanism=replace(self.mechanism, links=links) if bends else self.mechanism,
                displayed=() if bends else self.displayed,
            )
        except ParameterError:
            return None

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

    @property
    def motor(self) -> Motor | None:
        """The motor of the file; None where the speed is held constant."""
        if not self.has_motor:
            return None
        stall, speed, inertia = (float(getattr(self, name)) for name in MOTOR_FIELDS)
        return Motor(stall, self.rate_at(speed), inertia, self.motor_curve)

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

    @property
    def frictions(self) -> Mapping[str, Friction]:
        """Friction of each joint that has some."""
        parts: dict[str, list[Any]] = {
            name: [getattr(self, f"{name}_{what}", None) for what in FRICTION_FIELDS] for name in self.rubs
        }
        return {name: Friction(*each) for name, each in parts.items()}

    @property
    def loose(self) -> tuple[str, ...]:
        """Joints with clearance and friction."""
        return tuple(name for name in self.rubs if name in self.laws)

    def row_of(self, joint: str, motion: str) -> Array:
        """The coordinate (n,) that is a motion of a joint."""
        return np.array([float(name == f"{joint} {motion}") for name in self.degrees_of_freedom])


def _with_twice_the_modes(link: Link) -> Link:
    """A link that bends in twice as many modes, as far as a beam may keep so many; any other as it is."""
    if link.beam is None or link.remade is None:
        return link
    return link.remade(link.beam._replace(modes=min(2 * link.beam.modes, MOST_MODES)))


@lru_cache(maxsize=256)
def _revolution(mechanism: Mechanism) -> Revolution:
    return revolution_of(mechanism)
