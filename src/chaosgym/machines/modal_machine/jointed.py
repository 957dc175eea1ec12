"""Your own machine with several joints: the modes of a structure, any number of joints, and a periodic drive."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.cycle import CycleArrays, cycle_arrays
from chaosgym.core.matrices import product
from chaosgym.core.tangent import Tangents, no_tangents
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import Flexible, FreeBodies, Propagation
from chaosgym.machines.flexible_model import Modes, with_rigid_bodies
from chaosgym.machines.friction_law import OF_FRICTION
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.joint_sets import PressedSets, Sliders
from chaosgym.machines.joint_tables import JointTables
from chaosgym.machines.machine import Machine
from chaosgym.machines.modal_machine.drive import checked, modal_drive
from chaosgym.machines.modal_machine.driven_structure import DrivenStructure
from chaosgym.machines.parameters import parameter

if TYPE_CHECKING:
    from chaosgym.machines.joint_tables import JointBatch


LARGEST = "largest"
"""Word for the joint with the largest force."""


@dataclass(frozen=True, kw_only=True)
class JointedMachine(DrivenStructure, Machine):
    """A structure of a few modes with several joints and a periodic drive; made by ``machine_with_joints``.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range or a point does not exist; names it and what is allowed.
    """

    name: ClassVar[str] = "jointed-machine"
    tangents: ClassVar[Mapping[str, str]] = {}
    """Point whose motion is along the surfaces, by the name of each joint that may have friction."""

    monitored: str = parameter(LARGEST, choices=(LARGEST,), provenance="assumed", source="default")
    """Joint whose motion is shown and whose force is judged; "largest": the one with the largest force of a run."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        modal_drive(self.modes, map(checked, self.drives))
        for name, row in zip(self.joints, self.joint_shapes, strict=True):
            if not row.any():
                raise ParameterError(f"{name}.at = {self.places[name]!r} never moves: every shape is 0 there")
        for name, point in self.tangents.items():
            if not self.modes.shape(point).any():
                raise ParameterError(f"{name}.tangent = {point!r} never moves: every shape is 0 there")

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.places)

    @property
    def sides(self) -> tuple[str, ...]:  # type: ignore[override]
        """Names of all surfaces, the upper and the lower one of each joint."""
        return tuple(f"{name} {side}" for name in self.joints for side in ("upper", "lower"))

    @property
    def clearance_field(self) -> str:
        """Field of the clearance of the monitored joint, or of the first one."""
        return f"{self.joints[0] if self.monitored == LARGEST else self.monitored}_clearance"

    @property
    def operating_fields(self) -> tuple[str, ...]:
        """Fields that may change from cycle to cycle."""
        gaps = (f"{name}_{what}" for name in self.joints for what in ("clearance", "offset"))
        return self.speed_field, "drive_level", *gaps

    def of_joints(self, what: str) -> Array:
        """Values of a field of all joints, such as "clearance", (m,)."""
        return np.array([getattr(self, f"{name}_{what}") for name in self.joints])

    @property
    def joint_shapes(self) -> Array:
        """Mass-normalised displacement of each joint per modal coordinate, (m, n) [kg^-1/2]."""
        return np.array([self.modes.shape(self.places[name]) for name in self.joints])

    @property
    def rubbing(self) -> tuple[str, ...]:
        """Names of the joints with friction."""
        return tuple(name for name in self.tangents if getattr(self, f"{name}_friction") > 0.0)

    @property
    def stops(self) -> Array:
        """Positions of the upper and the lower stop of each joint [m], infinite where there is none, (m, 2)."""
        gap, middle = self.of_joints("clearance"), self.of_joints("offset")
        lower = np.where(self.of_joints("stops") == "two", middle - gap, -math.inf)
        return np.stack([middle + gap, lower], axis=1)

    def room_of(self, joint: int | None = None) -> tuple[float, float]:
        """Displacement [m] of a joint, or of that behind ``clearance_field``, at its stops; see ``Machine.room_of``."""
        watched = self.joints.index(self.clearance_field.removesuffix("_clearance"))
        upper, lower = self.stops[watched if joint is None else joint].tolist()
        return lower, upper

    @property
    def sets(self) -> PressedSets:
        """The structure with each set of pressed surfaces; machines that differ in what drives them share them."""
        beside = {f"{name}_{what}": 0.0 for name in self.joints for what in ("clearance", "offset", "preload")}
        return _sets(self._with_unchecked(speed=1.0, drive_level=1.0, drives=(), monitored=LARGEST, **beside))

    def reduce(self) -> PressedSets:
        """Return what the kernels integrate between contact events."""
        return self.sets

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] between the surfaces, (n_modes,)."""
        return np.asarray(self.frequency_factor * self.modes.angular_frequency / (2.0 * math.pi))

    @property
    def notes(self) -> tuple[str, ...]:
        """What turns or rubs, modes that count as rigid, and what sampled drives leave out."""
        along = ", ".join(f"{self.tangents[name]!r} ({name})" for name in self.rubbing)
        rubs = along and f"friction sticks and slides along {along}"
        return self._notes(rubs)

    @property
    def flexible(self) -> Flexible | None:
        """Its equations between contacts; None with friction, which acts beside the forces of the joints."""
        return None if self.rubbing else self.without_friction

    @property
    def without_friction(self) -> Flexible:
        """The structure's equations between contacts, without friction."""
        points = self.modes.points_beside(self.places.values())
        return Flexible(self.sets.stiffness, self.sets.damping, self.sets.shape, *self._drive(), points)

    @property
    def free_bodies(self) -> FreeBodies:
        """What holds its free bodies: joints, and friction along them."""
        rows = [*self.sets.shape, *(self.modes.shape(self.tangents[name]) for name in self.rubbing)]
        return FreeBodies(self.sets.stiffness == 0.0, self.sets.damping, np.array(rows))

    @property
    def n_states(self) -> int:
        """Displacement and velocity of every mode, and the deflection of every tangential spring."""
        return 2 * self.n_velocities + len(self.rubbing)

    @property
    def n_velocities(self) -> int:
        """One of every mode."""
        return len(self.modes.angular_frequency)

    @property
    def fastest_rate(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, all contacts closed."""
        return self.sets.fastest

    @property
    def moving(self) -> Propagation:
        """Exactly only, and deviations cross every contact exactly."""
        return Propagation(fixed_steps=False)

    def state_weights(self, state: Array) -> Array:
        """Weights (n_states,) by which the squared norm of a deviation is its energy."""
        rates = self.frequency_factor * self.modes.angular_frequency
        return np.concatenate([rates, np.ones(len(rates)), np.sqrt(self.sets.sliders.springs[:, 0])])

    def contraction(self, contact_time: Array) -> float:
        """Sum of all Lyapunov exponents of a cycle with so much contact on each surface [s], (2m,).

        It is -tr(D) T - sum of d |phi|^2 t_contact: damping of the structure, and of each contact while it lasts. With
        friction it is -inf: while a joint slides, its spring's deflection follows from the force alone.
        """
        if self.rubbing:
            return -math.inf
        sets = self.sets
        structure = -float(np.trace(sets.damping)) * self.cycle_period
        return structure - float(product((sets.dampers * np.sum(sets.shape**2, axis=1)[:, None]).ravel(), contact_time))

    def _drive(self) -> tuple[Array, Array]:
        """Modal forces of cosine and sine of each harmonic, (H, 2, n), and constant ones, (n,)."""
        harmonics, static = self._load()
        omega = 2.0 * math.pi * self.speed
        return np.ascontiguousarray(self.drive_level * (harmonics[0] + omega**2 * harmonics[1])), static

    def _load(self) -> tuple[Array, Array]:
        """The drive at level 1, (2, H, 2, n) as of ``put_sets``, and constant modal forces, (n,)."""
        harmonics, static = modal_drive(self.modes, self.drives)
        return harmonics, static + product(self.of_joints("preload"), self.joint_shapes)

    def tables(self, step_phase: float = ExactEvents.step_phase) -> JointTables:
        """Return tables of its own at its speed and drive, none made yet."""
        return JointTables(self.sets, self.speed, self.drive_level, *self._load(), step_phase)

    def batch(self, count: int) -> "JointBatch":
        """Return ``count`` variants that move in one compiled call."""
        from chaosgym.machines.joint_tables import JointBatch

        return JointBatch(self, count)

    def run(
        self,
        coordinates: Array,
        bouncing: Array,
        arrays: CycleArrays,
        integrator: Integrator,
        tangents: Tangents | None = None,
    ) -> tuple[int, int]:
        """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
        assert isinstance(integrator, ExactEvents), "no fixed steps"
        # gaps are no part of the tables
        gaps = {f"{name}_{what}": 0.0 for name in self.joints for what in ("clearance", "offset")}
        tables = _tables(self._with_unchecked(**gaps, monitored=LARGEST), integrator.step_phase)
        along = tangents or no_tangents(len(coordinates), len(arrays.section))
        return tables.advance(self.stops, coordinates, bouncing, arrays, integrator, along)

    def arrays(self, cycles: int, samples: int = 0) -> CycleArrays:
        """Return the arrays into which ``run`` writes."""
        return cycle_arrays(cycles, self.n_states, samples, joints=len(self.joints))

    def further_results(self, arrays: CycleArrays) -> dict[str, Any]:
        """Motion of every joint."""
        return {"motions": arrays.tip, "histories": arrays.history if arrays.history.shape[1] else None}

    def sensed(self, peak_force: Array) -> Array:
        """Largest force [N] of each cycle on the surfaces of the monitored joint, or on all: (..., cycles)."""
        if self.monitored == LARGEST:
            return np.asarray(peak_force.max(axis=-1))
        first = 2 * self.joints.index(self.monitored)
        return np.asarray(peak_force[..., first : first + 2].max(axis=-1))


@lru_cache(maxsize=64)
def _sets(machine: JointedMachine) -> PressedSets:
    shape, of = machine.joint_shapes, machine.of_joints
    rates = machine.frequency_factor * machine.modes.angular_frequency
    damping = machine.damping_factor * machine.modes.damping
    free = with_rigid_bodies(Modes(rates, damping, shape[0], np.zeros_like(shape[0])))
    springs = of("stiffness")[:, None] * np.stack([np.ones(len(shape)), of("lower_stiffness_factor")], axis=1)
    dampers = of("damping")[:, None] * np.stack([np.ones(len(shape)), of("lower_damping_factor")], axis=1)
    sliders = None
    if machine.rubbing:
        joints = np.array([machine.joints.index(name) for name in machine.rubbing], np.int64)
        along = np.array([machine.modes.shape(machine.tangents[name]) for name in machine.rubbing])
        friction, factors, speeds = (
            np.array([getattr(machine, f"{name}_{what}") for name in machine.rubbing]) for what in OF_FRICTION
        )
        sliders = Sliders(joints, along, friction, speeds, springs[joints] * factors[:, None])
    return PressedSets(free.angular_frequency**2, free.damping, shape, springs, dampers, of("stops") == "two", sliders)


@lru_cache(maxsize=8)
def _tables(machine: JointedMachine, step_phase: float) -> JointTables:
    """Tables of a machine at its speed and drive; few are kept, since they are large."""
    return machine.tables(step_phase)
