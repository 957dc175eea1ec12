"""Machines that are a few modes and one gap: from modal data to the model of the kernels, and how that runs.

A subclass of ``ModalImpactMachine`` has the fields of a machine and returns its model from ``reduce``, made by
``flexible_model`` of its modal data.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.cycle import CycleArrays
from chaosgym.core.modal_model import ModalImpactModel, Regimes, Tables, with_drive_from
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.machine import Flexible, Machine
from chaosgym.machines.modal_blocks import settled
from chaosgym.machines.parameters import check_parameter, refuse_not_finite

if TYPE_CHECKING:
    from chaosgym.core.tangent import Tangents
    from chaosgym.machines.batch import CompiledBatch

Array = NDArray[np.float64]

RIGID_SHARE = 1e-6
"""Natural frequency, as a share of the fastest one, below which a mode is the motion of a rigid body.

Programs of finite elements print rigid bodies so, at the rounding of their stiffness. A static force would push such a
mode so far away that the gap drowns in the rounding of that distance.
"""


class Modes(NamedTuple):
    """Modes of a machine free of contact.

    ``angular_frequency`` (n,) [rad/s], 0 for motions of a rigid body; ``damping`` (n, n) modal damping [1/s];
    ``tip_shape``, ``force_shape`` (n,) mass-normalised shapes [kg^-1/2] at the place in the gap and where the force
    acts.
    """

    angular_frequency: Array
    damping: Array
    tip_shape: Array
    force_shape: Array


class Stop(NamedTuple):
    """A surface that pushes with a spring [N/m] and a damper [N s/m]."""

    stiffness: float
    damping: float


def nearly_rigid(angular_frequency: Array) -> NDArray[np.bool_]:
    """Which modes (n,) are so slow that they count as motions of a rigid body, though their frequency is not 0."""
    return (angular_frequency > 0.0) & (angular_frequency < RIGID_SHARE * np.max(angular_frequency))


def with_rigid_bodies(modes: Modes) -> Modes:
    """Modes without the springs of those that are ``nearly_rigid``, and without their dampers if these are as slow."""
    slow = nearly_rigid(modes.angular_frequency)
    if not slow.any():
        return modes
    damping = modes.damping.copy()
    for i in np.flatnonzero(slow):
        if np.max(np.abs(damping[i])) < RIGID_SHARE * np.max(modes.angular_frequency):
            damping[i], damping[:, i] = 0.0, 0.0
    return modes._replace(angular_frequency=np.where(slow, 0.0, modes.angular_frequency), damping=damping)


def flexible_model(
    modes: Modes,
    contact_stiffness: float,
    contact_damping: float,
    *,
    lower: Stop | None = None,
    static_force: Array | None = None,
    drive: Array | None = None,
    step_phase: float = ExactEvents.step_phase,
) -> ModalImpactModel:
    """Model of a machine with springs [N/m] and dampers [N s/m] for stops; not yet at a speed.

    Parameters
    ----------
    modes
        The machine free of contact.
    contact_stiffness, contact_damping
        Of the upper stop, and of the lower one if ``lower`` is not given.
    static_force : (n,)
        Modal force that is always there [N kg^-1/2]; none by default.
    drive : (2, H, 2, n)
        As of the model; a sine of 1 N by default.
    step_phase
        For which the tables are made; see ``ExactEvents``.
    """
    from chaosgym.machines.pressed_sets import PressedSets

    refuse_not_finite("a model of modes", *modes, 0.0 if static_force is None else static_force)
    modes = with_rigid_bodies(modes)
    n, tip, stiffness = len(modes.tip_shape), modes.tip_shape, modes.angular_frequency**2
    both = np.array([(contact_stiffness, contact_damping), lower or (contact_stiffness, contact_damping)])
    sets = PressedSets(stiffness, modes.damping, tip[None], both[None, :, 0], both[None, :, 1], np.array([True]))
    found = [sets.of(code) for code in range(sets.count)]
    static = np.zeros(n) if static_force is None else np.array(static_force, dtype=float)
    loads = [each.to_modal @ np.concatenate([np.zeros(n), static]) for each in found]
    if drive is None:
        drive = np.zeros((2, 1, 2, n))
        drive[0, 0, 1] = modes.force_shape
    model = ModalImpactModel(
        excitation_frequency=math.nan,
        drive=drive,
        static_force=static,
        stops=np.full(2, math.nan),
        contact_stiffness=both[:, 0].copy(),
        contact_damping=both[:, 1].copy(),
        stiffness=stiffness,
        damping=modes.damping,
        tip_shape=tip,
        pressed=np.array([0, 1, sets.count - 1]),
        regimes=Regimes(
            generator=np.stack([each.generator for each in found]),
            to_modal=np.stack([each.to_modal for each in found]),
            from_modal=np.stack([each.from_modal for each in found]),
            output=np.stack([tip @ each.from_modal[:n] for each in found]),
            fastest=np.array([each.fastest for each in found]),
        ),
        rest=np.array(
            [(each.rest[0], settled(each.generator, load)[0]) for each, load in zip(found, loads, strict=True)]
        ),
        # whether a coordinate rests under the static force or drifts is a question of the speed
        drift=np.array([(each.drift[0], load) for each, load in zip(found, loads, strict=True)]),
        rest_penetration=np.array([each.constants[0, 0] for each in found]),
        tables=Tables(step_phase, np.empty(0), np.empty((0, 0))),
    )
    return with_tables(model)


def with_tables(model: ModalImpactModel) -> ModalImpactModel:
    """Return the model with tables of its own, for the ``step_phase`` of those that it has."""
    from chaosgym.core.compilation import call
    from chaosgym.core.modal_impact import shortest_intervals, tabulate

    phase = model.tables.step_phase
    shortest = call(shortest_intervals, model.regimes, phase, 0.0)
    return model._replace(tables=Tables(phase, shortest, call(tabulate, model, shortest)))


@dataclass(frozen=True, kw_only=True)
class ModalImpactMachine(Machine):
    """A machine of a few modes, driven by one harmonic force, that rattles between two surfaces.

    A subclass has the fields below and one for the clearance, half the gap, and defines ``structure``. Its speed is
    the frequency of the force [Hz].
    """

    if TYPE_CHECKING:
        force_amplitude: float
        """Amplitude of the force [N]."""
        contact_stiffness: float
        """Spring of a surface [N/m]."""
        contact_damping: float
        """Damper of a surface [N s/m]."""

    @property
    @abstractmethod
    def structure(self) -> ModalImpactModel:
        """Model by ``flexible_model``, whatever frequency, force and clearance."""

    @property
    def interpolated(self) -> ModalImpactModel | None:
        """That model, where ``along`` has interpolated it."""
        return self.__dict__.get("_interpolated")

    def along(self, field: str, low: float, high: float) -> Callable[[float], Machine]:
        """Return the machine at any value of a field; models of many modes are interpolated between both.

        Raises
        ------
        ParameterError
            By what is returned, if the field's own range ends before.
        """
        if field in (self.speed_field, self.clearance_field):
            return super().along(field, low, high)
        exact: Callable[[float], Any] = super().along(field, low, high)
        if exact(low).structure is exact(high).structure:
            return lambda value: self._with_unchecked(**{field: check_parameter(self, field, value)})
        from chaosgym.machines.model_line import interpolated

        models = cache(lambda: interpolated(lambda value: exact(value).structure, low, high))

        def at(value: float) -> Any:
            # the ends ask for no other model
            if value in (low, high) or not low <= value <= high:
                return exact(value)
            found = models()
            if found is None:
                return exact(value)
            return self._with_unchecked(_interpolated=found(value), **{field: check_parameter(self, field, value)})

        return at

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed [Hz], or at many."""
        return 1.0 / speed

    @property
    def force_shape(self) -> Array:
        """Mass-normalised mode shapes where the force acts, (n,) [kg^-1/2]."""
        return np.asarray(self.structure.drive[0, 0, 1])

    @property
    def operating_fields(self) -> tuple[str, ...]:
        """Fields that may change from cycle to cycle."""
        return *super().operating_fields, "force_amplitude"

    def stops_at(self, clearance: Any) -> Array:
        """Positions of the upper and the lower stop [m] at a clearance, (2,), or at many, (k, 2)."""
        return np.stack([clearance, -np.asarray(clearance)], axis=-1)

    def reduce(self) -> ModalImpactModel:
        """Return the modal model; machines that differ in frequency, force or clearance share the costly part."""
        speed, clearance = getattr(self, self.speed_field), getattr(self, self.clearance_field)
        structure, stops = self.structure, self.stops_at(clearance)
        return structure._replace(excitation_frequency=speed, drive=self.force_amplitude * structure.drive, stops=stops)

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] of the kept modes between the surfaces, (n_modes,)."""
        return np.asarray(np.sqrt(self.structure.stiffness) / (2.0 * math.pi))

    @property
    def n_states(self) -> int:
        """Displacement and velocity of every mode."""
        return 2 * len(self.structure.stiffness)

    @property
    def fastest_rate(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, contacts closed."""
        return float(np.max(self.structure.regimes.fastest))

    @property
    def carries_deviations(self) -> bool:
        """Always: deviations cross every contact exactly."""
        return True

    @property
    def flexible(self) -> Flexible:
        """Its equations between contacts."""
        model = self.reduce()
        omega = 2.0 * math.pi * model.excitation_frequency
        drive = model.drive[0] + omega**2 * model.drive[1]
        return Flexible(model.stiffness, model.damping, model.tip_shape[None], drive, model.static_force)

    def state_weights(self, state: Array) -> Array:
        """Weights (n_states,) by which the squared norm of a deviation is its energy.

        A rigid body, which stores none, counts as if it swung once a cycle.
        """
        rates = np.sqrt(self.structure.stiffness)
        return np.concatenate([np.where(rates > 0.0, rates, 2.0 * math.pi / self.cycle_period), np.ones(len(rates))])

    def contraction(self, contact_time: Array, impacts: float) -> float:
        """Sum of all Lyapunov exponents of a cycle with so much contact on each side [s] and so many impacts.

        It is -tr(D) T - d |phi_t|^2 t_contact: damping of the structure, and of the contact while it lasts. Where
        impacts take no time, 2 log(e) each stands for the contact.
        """
        model = self.reduce()
        structure = -float(np.trace(model.damping)) * self.cycle_period
        return structure - float(model.contact_damping @ contact_time) * float(np.sum(model.tip_shape**2))

    @property
    def mirrors(self) -> bool:
        """True for equal stops at equal distances, odd harmonics and no constant force."""
        model = self.reduce()
        stops = (model.contact_stiffness, model.contact_damping, np.abs(model.stops))
        alike = all(both[0] == both[1] for both in stops) and model.stops[0] > model.stops[1]
        return bool(alike and not model.static_force.any() and not model.drive[:, 1::2].any())

    def section_at(self, phase: float, share: float = 1.0) -> Self:
        """Return the machine whose cycles begin at a phase of the drive; see ``Machine.section_at``."""
        return self._with_unchecked(_section=(phase % 1.0, share))

    def run(
        self,
        coordinates: Array,
        bouncing: Array,
        arrays: CycleArrays,
        integrator: Integrator,
        tangents: "Tangents | None" = None,
    ) -> tuple[int, int]:
        """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
        from chaosgym.core.compilation import call
        from chaosgym.core.modal_impact import advance_model
        from chaosgym.core.tangent import no_tangents

        model = self.reduce()
        phase, share = self.__dict__.get("_section", (0.0, 1.0))
        model = with_drive_from(model, phase) if phase else model
        along = tangents or no_tangents(len(coordinates), len(arrays.section))
        if isinstance(integrator, ExactEvents):
            step, tolerance, budget = integrator.step_phase, integrator.event_tolerance, integrator.event_budget
            motion = coordinates, bouncing, arrays, budget, along
            outcome = call(advance_model, model, share, step, tolerance, *motion)
        else:
            from chaosgym.core.fixed_step import advance_fixed_step

            outcome = call(advance_fixed_step, model, coordinates, bouncing, arrays, integrator.steps_per_cycle)
        status, done = outcome
        return status, done

    def share_of_bound(self, states: Array, peak_force: Array) -> float:
        """Share of the bound of passivity: neither structure nor contact gives energy away.

        The energy E of the modes grows by the work of the force alone, so sqrt(2 E) by at most F |phi_f| a second.
        """
        model, n = self.reduce(), len(self.structure.stiffness)
        energy = np.sum(states[:, n:] ** 2 + model.stiffness * states[:, :n] ** 2, axis=1)
        if self.force_amplitude == 0.0:
            return 0.0 if not energy.any() and not peak_force.any() else math.inf
        instants = np.arange(1, len(states)) * self.cycle_period
        speed = self.force_amplitude * float(np.linalg.norm(self.force_shape)) * instants
        surface = math.sqrt(self.contact_stiffness) + self.contact_damping * float(np.linalg.norm(model.tip_shape))
        force = surface * speed
        return max(float(np.max(np.sqrt(energy[1:]) / speed)), float(np.max(peak_force.max(axis=1) / force)))

    def batch(self, count: int) -> "CompiledBatch":
        """Return ``count`` variants that move in one compiled call."""
        from chaosgym.machines.batch import ModalImpactBatch

        return ModalImpactBatch(self, count)
