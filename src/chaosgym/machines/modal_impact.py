"""Machines that are a few modes and one gap: from their modes and stops to the model of the kernels, and how it runs.

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

from chaosgym.arrays import Array
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.modal_model import LOAD, STOP, ModalImpactModel, Regimes, Tables, with_drive_from
from chaosgym.machines.abilities import Flexible
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.machine import Machine
from chaosgym.machines.modal_blocks import RIGID_SHARE, largest_modulus, modal_blocks, nearly_rigid, settled
from chaosgym.machines.parameters import check_parameter, refuse_not_finite

if TYPE_CHECKING:
    from chaosgym.core.tangent import Tangents
    from chaosgym.machines.batch import CompiledBatch


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


def _regimes(modes: Modes, *systems: tuple[Array, Array]) -> Regimes:
    """Regimes of several (stiffness, damping) of the same modes."""
    n, rigid = len(modes.tip_shape), bool(np.any(modes.angular_frequency == 0.0))
    parts = []
    for matrices in systems:
        generator, from_modal = modal_blocks(*matrices, rigid)
        output = modes.tip_shape @ from_modal[:n]
        parts.append((generator, np.linalg.inv(from_modal), from_modal, output, largest_modulus(generator)))
    return Regimes(*(np.ascontiguousarray(np.stack(part)) for part in zip(*parts, strict=True)))


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
    refuse_not_finite("a model of modes", *modes, 0.0 if static_force is None else static_force)
    modes = with_rigid_bodies(modes)
    n, tip, stiffness = len(modes.tip_shape), modes.tip_shape, modes.angular_frequency**2
    upper = Stop(contact_stiffness, contact_damping)
    stops = [upper] if lower in (None, upper) else [upper, lower]
    systems = [(np.diag(stiffness), modes.damping)]
    for stop in stops:
        push = np.outer(tip, tip)
        systems.append((np.diag(stiffness) + stop.stiffness * push, modes.damping + stop.damping * push))
    regimes = _regimes(modes, *systems)
    static = np.zeros(n) if static_force is None else np.array(static_force, dtype=float)
    with np.errstate(divide="ignore"):
        compliance = float(np.sum(np.divide(tip**2, stiffness, where=tip != 0.0, out=np.zeros(n))))
    rest, drift, penetration = [], [], []
    for r, stop in enumerate([Stop(0.0, 0.0), *stops]):
        parts = []
        for force in (stop.stiffness * tip, static):
            load = regimes.to_modal[r] @ np.concatenate([np.zeros(n), force])
            parts.append((*settled(regimes.generator[r], load), load))
        rest.append([part[0] for part in parts])
        # whether a coordinate rests under the static force or drifts is a question of the speed
        drift.append([parts[STOP][1], parts[LOAD][2]])
        # (K + k p p') q = k c p at rest, so the tip rests at x with x - c = -c / (1 + k p' K^-1 p)
        penetration.append(-1.0 / (1.0 + stop.stiffness * compliance))
    both = [stops[0], stops[-1]]
    if drive is None:
        drive = np.zeros((2, 1, 2, n))
        drive[0, 0, 1] = modes.force_shape
    model = ModalImpactModel(
        excitation_frequency=math.nan,
        drive=drive,
        static_force=static,
        stops=np.full(2, math.nan),
        contact_stiffness=np.array([stop.stiffness for stop in both]),
        contact_damping=np.array([stop.damping for stop in both]),
        stiffness=stiffness,
        damping=modes.damping,
        tip_shape=tip,
        pressed=np.array([0, 1, len(stops)]),
        regimes=regimes,
        rest=np.array(rest),
        drift=np.array(drift),
        rest_penetration=np.array(penetration),
        tables=Tables(step_phase, np.empty(0), np.empty((0, 0))),
    )
    return with_tables(model)


def with_tables(model: ModalImpactModel, step_phase: float | None = None, rate: float = 0.0) -> ModalImpactModel:
    """Give the model tables of its own, for a drive at ``rate`` [rad/s]; by default of the ``step_phase`` it has."""
    from chaosgym.core.compilation import call, compile_beside
    from chaosgym.core.joints.cycle import advance_joints
    from chaosgym.core.modal_impact import tabulate

    compile_beside(advance_joints, tabulate, f"from {__name__} import prepare_motion; prepare_motion()")
    phase = model.tables.step_phase if step_phase is None else step_phase
    return model._replace(tables=Tables(phase, *call(tabulate, model, phase, rate)))


def prepare_motion() -> None:
    """Compile or load the kernel that moves every machine of modes, which has one signature."""
    from chaosgym.core.compilation import prepare
    from chaosgym.core.cycle import cycle_arrays
    from chaosgym.core.joints.cycle import advance_joints
    from chaosgym.core.joints.space import JointRun
    from chaosgym.core.tangent import no_tangents

    numbers, places = np.empty(0), np.empty(0, np.int64)
    run, arrays = JointRun(numbers, numbers, places, 1.0, 1.0), cycle_arrays(0, 0)
    prepare(advance_joints, run, places, numbers, numbers, numbers, arrays, 0, no_tangents(0, 0), numbers, None)


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

    def contraction(self, contact_time: Array) -> float:
        """Sum of all Lyapunov exponents of a cycle with so much contact on each side [s].

        It is -tr(D) T - d |phi_t|^2 t_contact: damping of the structure, and of the contact while it lasts.
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
