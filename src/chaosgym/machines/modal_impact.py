"""Machines that are a few modes and one gap, and how their model runs.

A subclass of ``ModalImpactMachine`` has the fields of a machine and returns its model from ``reduce``, made by
``flexible_model`` of its modal data.
"""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.matrices import product
from chaosgym.core.modal_model import ModalImpactModel, with_drive_from
from chaosgym.machines.abilities import Flexible, FreeBodies, Propagation
from chaosgym.machines.flexible_model import with_tables
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import check_parameter

if TYPE_CHECKING:
    from chaosgym.core.tangent import Tangents
    from chaosgym.machines.batch import CompiledBatch


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

    @property
    def operating_fields(self) -> tuple[str, ...]:
        """Fields that may change from cycle to cycle."""
        return *super().operating_fields, "force_amplitude"

    def stops_at(self, clearance: Any) -> Array:
        """Positions of the upper and the lower stop [m] at a clearance, (2,), or at many, (k, 2)."""
        if isinstance(clearance, float):
            return np.array([clearance, -clearance])  # many times a second
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
    def moving(self) -> Propagation:
        """Exactly, and deviations cross every contact exactly."""
        return Propagation()

    @property
    def flexible(self) -> Flexible:
        """Its equations between contacts."""
        model = self.reduce()
        omega = 2.0 * math.pi * model.excitation_frequency
        drive = model.drive[0] + omega**2 * model.drive[1]
        return Flexible(model.stiffness, model.damping, model.tip_shape[None], drive, model.static_force)

    @property
    def free_bodies(self) -> FreeBodies | None:
        """What holds its free bodies; None where springs hold every mode, which is soon seen."""
        return None if self.structure.stiffness.all() else super().free_bodies

    def state_weights(self, state: Array) -> Array:
        """Weights (n_states,) by which the squared norm of a deviation is its energy.

        A rigid body, which stores none, counts as if it swung once a cycle.
        """
        rates = np.sqrt(self.structure.stiffness)
        return np.concatenate([np.where(rates > 0.0, rates, 2.0 * math.pi / self.cycle_period), np.ones(len(rates))])

    def contraction(self, contact_time: Array) -> float:
        """Sum of all Lyapunov exponents of a cycle with so much contact on each side [s].

        It is -tr(D) T - d |phi_t|^2 t_contact: damping of the structure, and of the contact while it lasts.
        """
        model = self.reduce()
        structure = -float(np.trace(model.damping)) * self.cycle_period
        return structure - float(product(model.contact_damping, contact_time)) * float(np.sum(model.tip_shape**2))

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
        from chaosgym.core.joints.cycle import advance_joints, room_for
        from chaosgym.core.joints.space import JointRun
        from chaosgym.core.modal_impact import make_run
        from chaosgym.core.tangent import no_tangents

        model = self.reduce()
        phase, share = self.__dict__.get("_section", (0.0, 1.0))
        model = with_drive_from(model, phase) if phase else model
        along = tangents or no_tangents(len(coordinates), len(arrays.section))
        if not isinstance(integrator, ExactEvents):
            from chaosgym.core.fixed_step import advance_fixed_step

            status, done = call(advance_fixed_step, model, coordinates, bouncing, arrays, integrator.steps_per_cycle)
            return status, done
        step = integrator.step_phase
        made = call(make_run, model, model.tables, step)
        if not len(made[0]):
            rate = 2.0 * math.pi * model.excitation_frequency * model.drive.shape[1]
            made = call(make_run, model, with_tables(model, step, rate).tables, step)
        tables, own, at, rows, weights = made
        period = share * (1.0 / model.excitation_frequency)
        run = JointRun(tables, own, at, period, integrator.event_tolerance / step)
        motion = coordinates, bouncing, arrays, integrator.event_budget, along, room_for(at, bouncing, along)
        status, done, _ = call(advance_joints, run, rows, weights, *motion, None)
        return status, done

    def batch(self, count: int) -> "CompiledBatch":
        """Return ``count`` variants that move in one compiled call."""
        from chaosgym.machines.batch import ModalImpactBatch

        return ModalImpactBatch(self, count)
