r"""A structure of a few modes with one joint whose surfaces rub, or with stiffness that varies over the cycle.

    q'' + D q' + [W^2 + sum_i k_i(wt) psi_i psi_i'] q = f(t) - sum_s (s phi + mu tau) N_s
    N_s = share(wt) (k (s phi'q - c_s) + d s phi'q'),     positive where a stop presses

Stiffness is held over bins of the cycle, at its mean in each, and between two changes of contact the motion is exact
(``core.binned``). Friction is Coulomb's, mu N, on surfaces that slide past each other in one direction all the time,
as a belt or a rotor that turns: the point ``slides`` slides to where it grows, and friction pulls it back.

structure = Structure.of_modes([0.0], [[600.0]], {"mesh": [3.2]})
machine = VaryingMachine(modes=structure, joint="mesh", samples=(1.2, 1.2, 0.8, 0.8), preload=40.0, speed=700.0)
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.binned.tables import table_places
from chaosgym.core.cycle import CycleArrays
from chaosgym.errors import ParameterError
from chaosgym.machines.binned.equations import Contact, Held, held, middles_and_nodes
from chaosgym.machines.binned.machine import BinnedMachine
from chaosgym.machines.binned.model import KEPT_BYTES
from chaosgym.machines.flexible_model import Modes, with_rigid_bodies
from chaosgym.machines.machine import Option, TaskDefaults
from chaosgym.machines.modal_machine.drive import Drive, checked, drive_notes, modal_drive
from chaosgym.machines.modal_machine.machine import ModalMachine, as_there, rigid_note, turning_note
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.machines.parameters import assumed
from chaosgym.numbers import numbers

FEWEST, MOST = 3, 3600
"""Samples of a stiffness over the cycle."""

STIFFEST = 1e13
"""Stiffness [N/m] that a machine may have."""


class Spring(NamedTuple):
    """A spring at one point of a structure, beside those that its modes know.

    ``values`` [N/m] are samples over one cycle at equal steps, the first at its beginning, with straight lines between;
    or one number.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import Spring
    >>> Spring("mesh", (1e8, 1.5e8, 1e8)).values[1]
    150000000.0
    """

    at: str
    values: tuple[float, ...]


def checked_samples(name: str, values: Any, low: float) -> Array:
    """Stiffness over a cycle: one number, or samples.

    Raises
    ------
    ParameterError
        If there are too few or too many, or one is below ``low``.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import checked_samples
    >>> checked_samples("stiffness", 2e6, 0.0)
    array([2000000.])
    """
    given = numbers(name, np.atleast_1d(values), low, STIFFEST, "N/m")
    if len(given) != 1 and not FEWEST <= len(given) <= MOST:
        raise ParameterError(f"{name} has {len(given)} samples of a cycle; allowed: 1, or {FEWEST} to {MOST}")
    return given


def means(values: Array, bins: int) -> Array:
    """Mean over each of some equal parts of a cycle of samples with straight lines between, (bins,).

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import means
    >>> means(np.array([0.0, 1.0, 2.0, 1.0]), 2)
    array([1., 1.])
    >>> means(np.array([0.0, 1.0, 2.0, 1.0]), 4)
    array([0.5, 1.5, 1.5, 0.5])
    """
    count = len(values)
    closed = np.append(values, values[0])
    whole = np.concatenate([[0.0], np.cumsum(0.5 * (closed[:-1] + closed[1:]))])
    at = np.arange(bins + 1) * (count / bins)
    i = np.minimum(at.astype(int), count - 1)
    part = at - i
    area = whole[i] + closed[i] * part + 0.5 * (closed[i + 1] - closed[i]) * part**2
    return np.asarray(np.diff(area) * (bins / count))


@dataclass(frozen=True, kw_only=True)
class VaryingMachine(BinnedMachine):
    """A structure with one joint, whose contact rubs or whose stiffness varies over the cycle.

    Fields that are not listed are those of ``ModalMachine``.

    Attributes
    ----------
    samples
        Stiffness of both stops over the cycle, in any unit: ``contact_stiffness`` times them over their mean, and the
        damper alike; () if it is constant.
    springs
        Springs of the structure beside its modes.
    slides
        Point that slides to where it grows, such as "shaft" or "-shaft", and is pulled back; "" without friction.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range, a point does not exist, or a stiffness becomes negative.

    Examples
    --------
    >>> from chaosgym.machines.modal_machine.varying import VaryingMachine
    >>> structure = chaosgym.Structure.of_modes([0.0], [[600.0]], {"mesh": [3.2]})
    >>> drive = chaosgym.Drive.sine("force", "mesh", 5.0)
    >>> machine = VaryingMachine(
    ...     modes=structure, joint="mesh", drives=(drive,), samples=(1.2, 1.2, 0.8, 0.8), preload=40.0, speed=700.0
    ... )
    >>> chaosgym.simulate(machine, cycles=10, transient=100).peak_force.shape
    (10, 2)
    """

    name: ClassVar[str] = "varying-machine"
    speed_field: ClassVar[str] = "speed"
    clearance_field: ClassVar[str] = "clearance"
    aliases: ClassVar[Mapping[str, str]] = ModalMachine.aliases
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = ModalMachine.usual_ranges
    options: ClassVar[Mapping[str, Option]] = ModalMachine.options
    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        rung: {"matrix_update_interval": interval}
        for rung, interval in (("draft", 4.0), ("standard", 1.0), ("fine", 0.5), ("reference", 0.25))
    }
    turning: ClassVar[tuple[str, ...]] = ()
    """Names of joints that turn, as of ``ModalMachine``."""
    beside_matrices: ClassVar[tuple[str, ...]] = ("speed", "clearance", "offset")
    task_defaults: ClassVar[TaskDefaults] = TaskDefaults(task={"speed_ripple": 0.0, "kick": 3e-4})
    """A table is made at each speed, so that jobs are kicked and their speed has no ripple."""

    modes: Structure
    joint: str
    drives: tuple[Drive, ...] = field(default=())
    springs: tuple[Spring, ...] = field(default=())
    samples: tuple[float, ...] = field(default=())
    slides: str = field(default="")
    speed: float = as_there("speed")
    clearance: float = as_there("clearance")
    offset: float = as_there("offset")
    stops: str = as_there("stops")
    contact_stiffness: float = as_there("contact_stiffness")
    contact_damping: float = as_there("contact_damping")
    lower_stiffness_factor: float = as_there("lower_stiffness_factor")
    lower_damping_factor: float = as_there("lower_damping_factor")
    preload: float = as_there("preload")
    drive_level: float = as_there("drive_level")
    damping_factor: float = as_there("damping_factor")
    frequency_factor: float = as_there("frequency_factor")
    friction: float = assumed(0.0, "-", 0.0, 10.0)
    """Coefficient of Coulomb friction at the stops."""
    variation: float = assumed(1.0, "-", 0.0, 100.0)
    """Factor of how far samples of a stiffness are from their mean."""
    matrix_update_interval: float = assumed(1.0, "deg", 0.1, 30.0)
    """Part of a cycle of 360 deg over which stiffness is held [deg]; divides 360."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        if not self.modes.shape(self.joint).any():
            raise ParameterError(f"joint = {self.joint!r} never moves: every shape is 0 there")
        if self.slides and not self.modes.shape(self.slides).any():
            raise ParameterError(f"slides = {self.slides!r} never moves: every shape is 0 there")
        if self.friction > 0.0 and not self.slides:
            raise ParameterError("friction needs slides, the point that it pulls along")
        modal_drive(self.modes, map(checked, self.drives))
        for spring in self.springs:
            self._varied(f"stiffness of the spring at {spring.at!r}", spring.values)
            self.modes.shape(spring.at)
        if self.samples:
            share = self._varied("stiffness of the joint", self.samples) / np.mean(self.samples)
            if not np.min(share) * self.contact_stiffness > 0.0:
                raise ParameterError("stiffness of the joint is 0 somewhere in the cycle; allowed: above 0 throughout")
        self._refuse_large()

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

    def _refuse_large(self) -> None:
        """Refuse more propagators than memory is given to them."""
        surfaces = 2 if self.stops == "two" else 1
        needed = 2**surfaces * self.bins * table_places(self.n_states // 2, surfaces).length * 8
        if needed > KEPT_BYTES:
            raise ParameterError(
                f"{self.n_states // 2} modes with friction or varying stiffness need {needed / 1e6:,.0f} MB of tables; "
                f"allowed: {KEPT_BYTES / 1e6:,.0f} MB (keep fewer modes, or raise matrix_update_interval)"
            )

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
        shape = self.modes.shape(self.joint)
        rates = self.frequency_factor * self.modes.angular_frequency
        return with_rigid_bodies(Modes(rates, self.damping_factor * self.modes.damping, shape, np.zeros_like(shape)))

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
        load = static + self.preload * self.modes.shape(self.joint)
        orders = np.arange(1, harmonics.shape[1] + 1)
        angles = np.outer(middles_and_nodes(self.bins)[1], orders)
        waves = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
        forces = self.drive_level * np.einsum("bhp,khpn->kbn", waves, harmonics)
        n = len(load)
        damping = np.stack([np.repeat(self._free.damping[None], self.bins, axis=0), np.zeros((self.bins, n, n))])
        stiffness = np.zeros((3, self.bins, n, n))
        stiffness[0] = self.stiffness()
        mass = np.repeat(np.eye(n)[None], self.bins, axis=0)
        return held(mass, damping, stiffness, -(forces + np.stack([load, np.zeros(n)])[:, None]))

    @property
    def gaps(self) -> Array:
        """Distances [m] of the upper and the lower stop from where the joint rests without any load."""
        both = np.array([self.clearance + self.offset, self.clearance - self.offset])
        return both if self.stops == "two" else both[:1]

    @property
    def contacts(self) -> list[Contact]:
        """The stops, the upper one first."""
        row, drag = self.modes.shape(self.joint), None
        if self.friction > 0.0:
            drag = self.friction * self.modes.shape(self.slides)
        share = None
        if self.samples:
            values = self._varied("", self.samples)
            share = means(values / np.mean(values), self.bins)
        lower = self.lower_stiffness_factor, self.lower_damping_factor
        return [
            Contact(
                row=side * row[None],
                gap=gap,
                stiffness=stiff * self.contact_stiffness,
                damping=damp * self.contact_damping,
                two_sided=False,
                reading=np.array([[0.0, side, 0.0]]),
                drag=drag,
                share=share,
            )
            for side, gap, (stiff, damp) in zip((1.0, -1.0), self.gaps.tolist(), ((1.0, 1.0), lower), strict=False)
        ]

    @property
    def has_propagators(self) -> bool:
        """Always: both stops are linear."""
        return True

    @property
    def display(self) -> Array:
        """Displacement of the joint per modal coordinate."""
        return self.modes.shape(self.joint)

    @property
    def stiffest(self) -> float:
        """Largest mean stiffness of a stop [N/m]."""
        return max(contact.stiffness for contact in self.contacts)

    @property
    def fastest_rate(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, contacts closed."""
        return float(self.reduce().spectrum)  # type: ignore[union-attr]

    @property
    def runs_fixed_steps(self) -> bool:
        """Never."""
        return False

    def further_results(self, arrays: CycleArrays) -> dict[str, Any]:
        """Return nothing more: contact stays in one place."""
        return {}

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] between the stops at the mean stiffness, (n_modes,)."""
        squares = np.linalg.eigvalsh(np.mean(self.stiffness(), axis=0))
        return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi))

    @property
    def room(self) -> tuple[float, float]:
        """Displacement [m] of the joint at its lower and its upper stop; with one stop there is no lower one."""
        return -self.gaps[1] if self.stops == "two" else -math.inf, self.gaps[0]

    def shape_of(self, place: str) -> Array:
        """Mode shapes (n,) at a point of the structure; see ``Machine.shape_of``."""
        return self.modes.shape(place)

    def state_weights(self, state: Array) -> Array:
        """Weights (n_states,) by which the squared norm of a deviation is its energy; see ``ModalImpactMachine``."""
        rates = np.sqrt(np.einsum("bii->i", self.stiffness()) / self.bins)
        return np.concatenate([np.where(rates > 0.0, rates, 2.0 * math.pi / self.cycle_period), np.ones(len(rates))])

    @property
    def notes(self) -> tuple[str, ...]:
        """What turns or rubs, modes that count as rigid, and what sampled drives leave out."""
        rubs = ""
        if self.friction > 0.0:
            rubs = f"friction always pulls {self.slides!r} one way, on surfaces that slide past faster than it moves"
        hertz = self.frequency_factor * self.modes.angular_frequency / (2.0 * math.pi)
        notes = turning_note(self.turning), rigid_note(hertz), rubs, *drive_notes(self.drives)
        return tuple(filter(None, notes))
