r"""Your own machine with joints that are Hertzian, slide one way, or vary over the cycle.

    q'' + D q' + [W^2 + sum_i k_i(wt) psi_i psi_i'] q = f(t) - sum_s (s phi + mu tau) N_s
    N_s = share(wt) (k (s phi'q - c_s) + d s phi'q'),     positive where a stop presses

Stiffness is held over bins of the cycle, at its mean in each, and between two changes of contact the motion is exact
(``core.binned``). Friction is Coulomb's, mu N, on surfaces that slide past each other in one direction all the time,
as a belt or a rotor that turns: the point ``slides`` slides to where it grows, and friction pulls it back.
Any number of joints; results are those of the monitored one.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.binned.model import LINEAR
from chaosgym.core.binned.tables import table_places
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import FreeBodies, Propagation
from chaosgym.machines.binned.equations import Contact, Held, held, middles_and_nodes
from chaosgym.machines.binned.machine import BinnedMachine
from chaosgym.machines.binned.model import KEPT_BYTES, MAX_SETS
from chaosgym.machines.contact_law import stiffness_at
from chaosgym.machines.flexible_model import Modes, with_rigid_bodies
from chaosgym.machines.machine import TaskDefaults
from chaosgym.machines.modal_machine.drive import checked, modal_drive
from chaosgym.machines.modal_machine.driven_structure import DrivenStructure
from chaosgym.machines.modal_machine.varying import HeldSpring, checked_samples, means
from chaosgym.machines.parameters import assumed, parameter

SHALLOW = 0.1
"""Penetration of a Hertzian surface, as a share of its gap, up to which its stiffness counts at the least."""


@dataclass(frozen=True, kw_only=True)
class HeldJoints(DrivenStructure, BinnedMachine):
    """A structure of a few modes with several joints of any law; made by ``machine_with_joints``.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range or a point does not exist; names it and what is allowed.
    """

    name: ClassVar[str] = "held-joints"
    exponents: ClassVar[Mapping[str, float]] = {}
    """Exponent of the penetration of each joint; LINEAR of a spring and damper."""
    samples: ClassVar[Mapping[str, tuple[float, ...]]] = {}
    """Stiffness over the cycle of joints in which it varies, in any unit."""
    slides: ClassVar[Mapping[str, str]] = {}
    """Point that slides past one way all the time, of joints that rub so."""

    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        rung: {"matrix_update_interval": interval}
        for rung, interval in (("draft", 4.0), ("standard", 1.0), ("fine", 0.5), ("reference", 0.25))
    }
    model_fields: ClassVar[tuple[str, ...]] = ("modes", "matrix_update_interval")
    task_defaults: ClassVar[TaskDefaults] = TaskDefaults(task={"speed_ripple": 0.0, "kick": 3e-4})
    """A table is made at each speed, so that jobs are kicked and their speed has no ripple."""

    springs: tuple[HeldSpring, ...] = field(default=())
    variation: float = assumed(1.0, "-", 0.0, 100.0)
    """Factor of how far samples of a stiffness are from their mean."""
    matrix_update_interval: float = assumed(1.0, "deg", 0.1, 30.0)
    """Part of a cycle of 360 deg over which stiffness is held [deg]; divides 360."""
    monitored: str = parameter("", choices=("",), provenance="assumed", source="default")
    """Joint whose motion and force are recorded and judged."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        for name, place in self.places.items():
            if not self.modes.shape(place).any():
                raise ParameterError(f"{name}.at = {place!r} never moves: every shape is 0 there")
        for name, place in self.slides.items():
            if not self.modes.shape(place).any():
                raise ParameterError(f"{name}.slides = {place!r} never moves: every shape is 0 there")
        modal_drive(self.modes, map(checked, self.drives))
        for spring in self.springs:
            self._varied(f"stiffness of the spring at {spring.at!r}", spring.values)
            self.modes.shape(spring.at)
        for name, values in self.samples.items():
            share = self._varied(f"stiffness of {name}", values)
            if not np.min(share) > 0.0:
                raise ParameterError(f"stiffness of {name} is 0 somewhere in the cycle; allowed: above 0 throughout")
        if self.places:
            self._refuse_many()

    def _refuse_many(self) -> None:
        """Refuse what needs propagators beside what has none."""
        surfaces = len(self.contacts)
        if self.has_propagators:
            modes = self.n_states // 2
            needed = 2**surfaces * self.bins * table_places(modes, surfaces).length * 8
            if needed > KEPT_BYTES:
                raise ParameterError(
                    f"{modes} modes with friction or varying stiffness need {needed / 1e6:,.0f} MB of tables; allowed: "
                    f"{KEPT_BYTES / 1e6:,.0f} MB (keep fewer modes or joints, or raise matrix_update_interval)"
                )
            return
        for name in self.samples:
            raise ParameterError(
                f"stiffness over the cycle of {name} needs tables of all sets of {surfaces} surfaces, each linear; "
                f"allowed: {int(math.log2(MAX_SETS))} surfaces, none Hertzian"
            )

    def _finer_fields(self) -> dict[str, Any]:
        """More modes, and parts of a cycle of half the angle."""
        return {**super()._finer_fields(), "matrix_update_interval": 0.5 * self.matrix_update_interval}

    def _varied(self, name: str, values: tuple[float, ...]) -> Array:
        """Samples of a stiffness with ``variation``."""
        given = checked_samples(name, values, 0.0)
        varied = np.mean(given) + self.variation * (given - np.mean(given))
        if np.min(varied) < 0.0:
            raise ParameterError(
                f"{name} falls to {np.min(varied):.4g} N/m with variation = {self.variation:g}; allowed: 0 or more "
                "throughout the cycle"
            )
        return np.asarray(varied)

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed [Hz], or at many."""
        return 1.0 / speed

    @staticmethod
    def rate_at(speed: float) -> float:
        """Angular velocity [rad/s] of the drive at a speed [Hz]."""
        return 2.0 * math.pi * speed

    @property
    def n_states(self) -> int:
        """Displacement and velocity of every mode."""
        return 2 * len(self.modes.angular_frequency)

    @property
    def _free(self) -> Modes:
        rates = self.frequency_factor * self.modes.angular_frequency
        damping = self.damping_factor * self.modes.damping
        for spring in self.springs:
            there = self.modes.shape(spring.at)
            damping = damping + spring.damping * np.outer(there, there)
        return with_rigid_bodies(Modes(rates, damping, np.zeros_like(rates), np.zeros_like(rates)))

    @property
    def free_bodies(self) -> FreeBodies:
        """What holds its free bodies: joints, and springs over the cycle."""
        springs = [self.modes.shape(spring.at) for spring in self.springs]
        rows = np.array([*(row for contact in self.contacts for row in contact.row), *springs])
        return FreeBodies(self._free.angular_frequency == 0.0, self._free.damping, rows)

    def stiffness(self) -> Array:
        """Modal stiffness between the stops in each bin, (bins, n, n) [1/s^2]."""
        total = np.repeat(np.diag(self._free.angular_frequency**2)[None], self.bins, axis=0)
        for spring in self.springs:
            shape, values = self.modes.shape(spring.at), self._varied("", spring.values)
            total += means(values, self.bins)[:, None, None] * np.outer(shape, shape)
        return total

    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""
        harmonics, static = modal_drive(self.modes, self.drives)
        load = static + self._preload()
        orders = np.arange(1, harmonics.shape[1] + 1)
        angles = np.outer(middles_and_nodes(self.bins)[1], orders)
        waves = np.stack([matrices.cos(angles), matrices.sin(angles)], axis=-1)
        forces = self.drive_level * np.einsum("bhp,khpn->kbn", waves, harmonics)
        n = len(load)
        damping = np.stack([np.repeat(self._free.damping[None], self.bins, axis=0), np.zeros((self.bins, n, n))])
        stiffness = np.zeros((3, self.bins, n, n))
        stiffness[0] = self.stiffness()
        mass = np.repeat(np.eye(n)[None], self.bins, axis=0)
        rubs = np.repeat(np.array(self._rubs()).reshape(-1, 1, n), self.bins, axis=1)
        return held(mass, damping, stiffness, -(forces + np.stack([load, np.zeros(n)])[:, None]), rubs)

    @property
    def moving(self) -> Propagation:
        """As other machines whose matrices are held, but by no fixed steps."""
        return super().moving._replace(fixed_steps=False)

    def further_results(self, arrays: CycleArrays) -> dict[str, Any]:
        """Return nothing more: contact stays in one place."""
        return {}

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] between the stops at the mean stiffness, (n_modes,)."""
        squares = matrices.eigvalsh(np.mean(self.stiffness(), axis=0))
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi))

    def state_weights(self, state: Array) -> Array:
        """Weights (n_states,) by which the squared norm of a deviation is its energy; see ``ModalImpactMachine``."""
        rates = np.sqrt(np.einsum("bii->i", self.stiffness()) / self.bins)
        return np.concatenate([np.where(rates > 0.0, rates, 2.0 * math.pi / self.cycle_period), np.ones(len(rates))])

    def _of(self, joint: str, what: str) -> float:
        return float(getattr(self, f"{joint}_{what}"))

    @property
    def clearance_field(self) -> str:
        """Field of the clearance of the monitored joint."""
        return f"{self.monitored}_clearance"

    def _preload(self) -> Array:
        pulls = [self._of(name, "preload") * self.modes.shape(place) for name, place in self.places.items()]
        return np.asarray(np.sum(pulls, axis=0))

    def _rubs(self) -> list[Array]:
        return [self._of(name, "friction") * self.modes.shape(place) for name, place in self.slides.items()]

    @property
    def contacts(self) -> list[Contact]:
        """The stops of all joints, of each the upper one first; like ones on either side of the middle are one."""
        return [contact for name in self.places for contact in self._stops(name)]

    def _stops(self, joint: str) -> list[Contact]:
        row, share = self.modes.shape(self.places[joint]), None
        slides = list(self.slides).index(joint) if joint in self.slides else -1
        if joint in self.samples:
            values = self._varied("", self.samples[joint])
            share = means(values / np.mean(values), self.bins)
        gap, middle = self._of(joint, "clearance"), self._of(joint, "offset")
        factors = self._of(joint, "lower_stiffness_factor"), self._of(joint, "lower_damping_factor")
        two, law = getattr(self, f"{joint}_stops") == "two", self.exponents.get(joint, LINEAR)
        like = two and middle == 0.0 and factors == (1.0, 1.0) and slides < 0 and share is None
        sides = [(1.0, gap + middle, 1.0, 1.0)]
        if two and not like:
            sides.append((-1.0, gap - middle, *factors))
        return [
            Contact(
                row=side * row[None],
                gap=at,
                stiffness=stiff * self._of(joint, "stiffness"),
                damping=damp * self._of(joint, "damping"),
                two_sided=like,
                reading=np.array([[0.0, side * (joint == self.monitored), 0.0]]),
                slides=slides,
                share=share,
                exponent=law,
            )
            for side, at, stiff, damp in sides
        ]

    @property
    def has_propagators(self) -> bool:
        """True if every surface is linear and the sets of pressed ones are few."""
        return not any(self.exponents.values()) and 2 ** len(self.contacts) <= MAX_SETS

    @property
    def display(self) -> Array:
        """Displacement of the monitored joint per modal coordinate."""
        return self.modes.shape(self.places[self.monitored])

    @property
    def stiffest(self) -> float:
        """Largest mean stiffness of a stop [N/m]; of a Hertzian one, under ten times all that drives it."""
        harmonics, static = modal_drive(self.modes, self.drives)
        omega = 2.0 * math.pi * self.speed
        driven = np.abs(static + self._preload()) + self.drive_level * np.sum(
            np.abs(harmonics[0] + omega**2 * harmonics[1]), axis=(0, 1)
        )
        found = []
        for contact in self.contacts:
            row = np.abs(contact.row[0])
            force = 10.0 * float(product(row, driven)) / float(product(row, row))
            least = contact.stiffness * (SHALLOW * max(abs(contact.gap), 1e-6)) ** (contact.exponent or 1.0)
            found.append(stiffness_at(contact.stiffness, contact.exponent, max(force, least)))
        return max(found)

    def room_of(self, joint: int | None = None) -> tuple[float, float]:
        """Displacement [m] of the monitored joint at its lower and its upper stop; infinite where there is none."""
        gap, middle = self._of(self.monitored, "clearance"), self._of(self.monitored, "offset")
        two = getattr(self, f"{self.monitored}_stops") == "two"
        return middle - gap if two else -math.inf, middle + gap

    @property
    def notes(self) -> tuple[str, ...]:
        """What turns or rubs, modes that count as rigid, and what sampled drives leave out."""
        rubs = [
            f"friction always pulls {place!r} one way ({name}), on surfaces that slide past faster than it moves"
            for name, place in self.slides.items()
            if self._of(name, "friction") > 0.0
        ]
        return self._notes(*rubs)
