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

from chaosgym.arrays import Array
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.modal_model import LOAD, STOP, ModalImpactModel, Regimes, Tables, with_drive_from
from chaosgym.errors import ParameterError
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.machine import Flexible, Machine
from chaosgym.machines.parameters import check_parameter, refuse_not_finite

if TYPE_CHECKING:
    from chaosgym.core.tangent import Tangents
    from chaosgym.machines.batch import CompiledBatch


MAX_CONDITION = 1e6
"""Condition number of a set of eigenvectors below which no better one is looked for."""

HOPELESS_CONDITION = 1e12
"""Condition number beyond which a motion would keep less than four digits."""

RIGID_SHARE = 1e-6
"""Natural frequency, as a share of the fastest one, below which a mode is the motion of a rigid body.

Programs of finite elements print rigid bodies so, at the rounding of their stiffness. A static force would push such a
mode so far away that the gap drowns in the rounding of that distance.
"""

UNCOUPLED = 1e-8
"""Damping between two modes, as a share of their own, that counts as none where modes are nearly critical."""

NEGLIGIBLE = 1e-13
"""Stiffness and damping, against the largest, of a direction that neither springs nor dampers resist."""


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


def modal_blocks(stiffness: Array, damping: Array, rigid: bool, rubs: bool = False) -> tuple[Array, Array]:
    """Real 2 x 2 blocks of q'' + damping q' + stiffness q = 0: generator (4, n) and from_modal (2n, 2n).

    Where the machine can move as a ``rigid`` body, a direction that neither spring nor damper resists drifts, in a
    block of its own. What slides and ``rubs`` makes the matrices unsymmetric, and may let a motion grow.
    """
    scale = math.sqrt(np.linalg.norm(stiffness, 2)) or 1.0
    held, directions = _stretched(stiffness / scale**2 + damping / scale, rubs)
    loose = (held < NEGLIGIBLE * max(1.0, float(held[-1]))) & rigid
    blocks, columns = [], []
    for free in directions[:, loose].T:
        blocks.append((0.0, 1.0, 0.0, 0.0))
        columns.append((np.concatenate([free, 0.0 * free]), np.concatenate([0.0 * free, free])))
    # without such directions, the modes stay as they are, to the last digit
    basis = directions[:, ~loose] if loose.any() else np.eye(len(stiffness))
    if basis.shape[1]:
        own = (basis.T @ stiffness @ basis, basis.T @ damping @ basis)
        _add_damped(*own, basis, rigid, blocks, columns, rubs)
    first, second = zip(*columns, strict=True)
    from_modal = np.column_stack([*first, *second])
    if rubs and loose.any():
        _push_along(stiffness, damping, directions[:, loose], np.array(blocks).T, from_modal)
    return np.array(blocks).T, from_modal


def _stretched(matrix: Array, rubs: bool) -> tuple[Array, Array]:
    """By how much a matrix stretches directions, ascending, and these: singular values and vectors where it rubs."""
    if not rubs:
        return np.linalg.eigh(matrix)
    _, sizes, directions = np.linalg.svd(matrix)
    return sizes[::-1], directions[::-1].T


def _push_along(stiffness: Array, damping: Array, loose: Array, generator: Array, from_modal: Array) -> None:
    """Add to the columns of other coordinates how friction moves directions (n, k) that nothing resists.

    A block B moves others by Y u, and these by X u with X B^2 = -loose' (stiffness Y + damping Y B).
    """
    n = len(stiffness)
    for j in range(loose.shape[1], n):
        block, pair = generator[:, j].reshape(2, 2), [j, n + j]
        moved = from_modal[:n, pair]
        forced = -loose.T @ (stiffness @ moved + damping @ moved @ block)
        square = block @ block
        if block[1, 0] != 0.0:
            along = np.linalg.solve(square.T, forced.T).T
        else:
            # nothing pushes where the other one rests
            along = np.divide(forced, np.diag(square), out=np.zeros_like(forced), where=np.diag(square) > 0.0)
        from_modal[:n, pair] += loose @ along
        from_modal[n:, pair] += loose @ along @ block


def _add_damped(
    stiffness: Array,
    damping: Array,
    basis: Array,
    rigid: bool,
    blocks: list[tuple[float, float, float, float]],
    columns: list[tuple[Array, Array]],
    rubs: bool,
) -> None:
    """Add the blocks of coordinates, columns of ``basis``, that all have a spring or a damper.

    A mode that is critically damped to the last digit has one eigenvector instead of two. If damping couples no modes,
    displacement and velocity of each serve as its coordinates. Else its damping is moved by a billionth, which
    separates the pair; where that leaves equal modes entangled, that of each by another amount. The best set of
    eigenvectors that was found serves, unless it would leave no digits.
    """
    n = len(stiffness)
    scale = math.sqrt(np.linalg.norm(stiffness, 2)) or 1.0
    # a displacement weighs as much as the velocity that belongs to it, in slow modes as in fast ones
    rates, directions = _stretched(stiffness + damping @ damping, rubs)
    weight = directions * np.sqrt(np.maximum(rates, 0.0)) @ directions.T
    found, one, graded = [], np.ones(n), np.arange(1.0, n + 1.0)
    for moved in (0.0 * one, 1e-9 * one, 1e-8 * one, 1e-9 * graded, 1e-8 * graded):
        roots = np.sqrt(1.0 + moved)
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -(np.outer(roots, roots) * damping)]])
        values, vectors = np.linalg.eig(system)
        balanced = np.concatenate([weight @ vectors[:n], vectors[n:]])
        lengths = np.linalg.norm(balanced, axis=0)
        condition = float(np.linalg.cond(balanced / lengths)) if lengths.all() else math.inf
        found.append((condition, values, vectors))
        if condition < MAX_CONDITION:
            break
        if len(found) == 1 and not rubs and _add_uncoupled(stiffness, damping, basis, rigid, blocks, columns):
            return
    condition, values, vectors = min(found, key=lambda each: each[0])
    if not condition < HOPELESS_CONDITION:
        raise ParameterError(
            "modes that are equal and critically damped can't be told apart; allowed: damping ratios that differ from "
            "1 by a millionth or more"
        )
    resting = int(np.sum(_stretched(stiffness, rubs)[0] < NEGLIGIBLE * scale**2)) if rigid else 0
    slowest = np.argsort(np.abs(values))[:resting]
    values[slowest[values[slowest].imag == 0.0]] = 0.0
    vectors = np.concatenate([basis @ vectors[:n], basis @ vectors[n:]])
    turning = [i for i in np.argsort(np.abs(values)) if values[i].imag > 0.0]
    decaying = [i for i in np.argsort(np.abs(values)) if values[i].imag == 0.0]
    for i in turning:
        a, b = min(values[i].real, math.inf if rubs else 0.0), values[i].imag
        blocks.append((a, -b, b, a))
        columns.append((vectors[:, i].real, -vectors[:, i].imag))
    for i, k in zip(decaying[::2], decaying[1::2], strict=True):
        most = math.inf if rubs else 0.0
        blocks.append((min(values[i].real, most), 0.0, 0.0, min(values[k].real, most)))
        columns.append((vectors[:, i].real, vectors[:, k].real))


def _add_uncoupled(
    stiffness: Array,
    damping: Array,
    basis: Array,
    rigid: bool,
    blocks: list[tuple[float, float, float, float]],
    columns: list[tuple[Array, Array]],
) -> bool:
    """Add the blocks of the modes that damping does not couple, in coordinates (w q, q'); False if it does couple them.

    A mode of a ``rigid`` body without a spring creeps to rest, as two real eigenvalues.
    """
    if np.any(stiffness != np.diag(np.diag(stiffness))):
        rates, shapes = np.linalg.eigh(stiffness)
    else:
        rates, shapes = np.diag(stiffness), np.eye(len(stiffness))
    between = shapes.T @ damping @ shapes
    own = np.diag(between)
    held = rates > NEGLIGIBLE * np.max(rates)
    if not (rigid or held.all()) or not np.all(own[held] >= 0.0) or not np.all(own[~held] > NEGLIGIBLE * np.max(own)):
        return False
    if np.any(np.abs(between - np.diag(own)) > UNCOUPLED * np.sqrt(np.outer(own, own))):
        return False
    for rate, resistance, has_spring, shape in zip(rates, own, held, (basis @ shapes).T, strict=True):
        w = math.sqrt(rate) if has_spring else 0.0
        blocks.append((0.0, w, -w, -resistance))
        first, second = (shape / w, 0.0 * shape) if has_spring else (shape, -shape / resistance)
        columns.append((np.concatenate([first, 0.0 * shape]), np.concatenate([second, shape])))
    return True


def largest_modulus(generator: Array) -> float:
    """Largest modulus of an eigenvalue of blocks (4, n) by ``modal_blocks``.

    That of a pair is the root of its determinant; a mode damped beyond its critical damping keeps the block of a pair,
    and has two real eigenvalues.
    """
    turns, half = generator[2] != 0.0, 0.5 * (generator[0] - generator[3])
    split = half**2 + generator[1] * generator[2]
    real = 0.5 * np.abs(generator[0] + generator[3]) + np.sqrt(np.maximum(split, 0.0))
    pair = np.where(split > 0.0, real, np.hypot(generator[0], generator[2]))
    return float(np.max(np.where(turns, pair, np.max(np.abs(generator[[0, 3]]), axis=0))))


def _regimes(modes: Modes, *systems: tuple[Array, Array]) -> Regimes:
    """Regimes of several (stiffness, damping) of the same modes."""
    n, rigid = len(modes.tip_shape), bool(np.any(modes.angular_frequency == 0.0))
    parts = []
    for matrices in systems:
        generator, from_modal = modal_blocks(*matrices, rigid)
        output = modes.tip_shape @ from_modal[:n]
        parts.append((generator, np.linalg.inv(from_modal), from_modal, output, largest_modulus(generator)))
    return Regimes(*(np.ascontiguousarray(np.stack(part)) for part in zip(*parts, strict=True)))


def settled(generator: Array, force: Array) -> tuple[Array, Array]:
    """Position of rest (2n,) of modal coordinates under a constant force (2n,), and the rate of those without one."""
    n = generator.shape[1]
    rest, drift = np.zeros(2 * n), np.zeros(2 * n)
    for j, (p, q, r, s) in enumerate(generator.T):
        pair = [j, n + j]
        if r != 0.0:
            determinant = p * s - q * r
            rest[pair] = (
                (q * force[n + j] - s * force[j]) / determinant,
                (r * force[j] - p * force[n + j]) / determinant,
            )
        elif q != 0.0:
            drift[pair] = force[pair]
        else:
            for i, rate in zip(pair, (p, s), strict=True):
                if rate == 0.0:
                    drift[i] = force[i]
                else:
                    rest[i] = -force[i] / rate
    return rest, drift


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


def passive_share(
    parts: Flexible, springs: Array, dampers: Array, stops: Array, period: float, states: Array, peak_force: Array
) -> float:
    """Largest ratio of energy and force of a run from rest to their bounds, as ``Machine.share_of_bound``.

    Neither structure nor contact gives energy; only the drive does, and what preloads or offsets have stored. So the
    root of twice the energy grows by at most the norm of the modal forces a second.

    Parameters
    ----------
    parts
        Equations of the machine between contacts.
    springs, dampers, stops : (m, 2)
        Of the upper and the lower surface of each joint [N/m], [N s/m]; their positions [m].
    period
        Of a cycle [s].
    """
    n = len(parts.stiffness)
    energy = np.sum(states[:, n : 2 * n] ** 2 + parts.stiffness * states[:, :n] ** 2, axis=1)
    load = float(np.sum(np.linalg.norm(parts.drive, axis=(1, 2)))) + float(np.linalg.norm(parts.static))
    inside = np.maximum(np.stack([-stops[:, 0], stops[:, 1]], axis=1), 0.0)
    stored = math.sqrt(float(np.sum(springs * inside**2)))
    speed = stored + load * np.arange(1, len(states)) * period
    if not speed.any():
        return 0.0 if not energy.any() and not peak_force.any() else math.inf
    surface = np.sqrt(springs) + dampers * np.linalg.norm(parts.joints, axis=1)[:, None]
    forces = peak_force / (surface.ravel() * speed[:, None])
    return max(float(np.max(np.sqrt(energy[1:]) / speed)), float(np.max(forces)))


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
        from chaosgym.core.fixed_step import advance_fixed_step
        from chaosgym.core.joints.cycle import advance_joints, room_for
        from chaosgym.core.joints.space import JointRun
        from chaosgym.core.modal_impact import make_run
        from chaosgym.core.tangent import no_tangents

        model = self.reduce()
        phase, share = self.__dict__.get("_section", (0.0, 1.0))
        model = with_drive_from(model, phase) if phase else model
        along = tangents or no_tangents(len(coordinates), len(arrays.section))
        if not isinstance(integrator, ExactEvents):
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

    def share_of_bound(self, states: Array, peak_force: Array) -> float:
        """Share of the bound of passivity; see ``passive_share``."""
        model = self.reduce()
        surfaces = model.contact_stiffness[None], model.contact_damping[None], model.stops[None]
        return passive_share(self.flexible, *surfaces, self.cycle_period, states, peak_force)

    def batch(self, count: int) -> "CompiledBatch":
        """Return ``count`` variants that move in one compiled call."""
        from chaosgym.machines.batch import ModalImpactBatch

        return ModalImpactBatch(self, count)
