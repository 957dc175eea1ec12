"""Machines that are a few modes and one gap: from modal data to the model of the kernels, and how that runs.

A subclass of ``ModalImpactMachine`` has the fields of a machine and returns its model from ``reduce``, made by
``flexible_model`` or ``rigid_model`` of its modal data.
"""

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays, Episode
from chaosgym.core.fixed_step import advance_fixed_step
from chaosgym.core.modal_impact import ModalImpactModel, advance
from chaosgym.core.propagator import Regimes
from chaosgym.core.restitution import RestitutionModel, advance_restitution
from chaosgym.core.tangent import Tangents
from chaosgym.machines.batch import CompiledBatch, ModalImpactBatch, RestitutionBatch
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.linear_impact import linear_impact
from chaosgym.machines.machine import Machine, refuse_fixed_steps

Array = NDArray[np.float64]

MAX_CONDITION = 1e8
"""Largest condition number of a usable set of eigenvectors."""


class Modes(NamedTuple):
    """Modes of a machine free of contact.

    ``angular_frequency`` (n,) [rad/s]; ``damping`` (n, n) modal damping [1/s]; ``tip_shape``, ``force_shape`` (n,)
    mass-normalised shapes [kg^-1/2] at the place in the gap and where the force acts.
    """

    angular_frequency: Array
    damping: Array
    tip_shape: Array
    force_shape: Array


def _modal_blocks(stiffness: Array, damping: Array) -> tuple[Array, Array, Array]:
    """Real 2 x 2 blocks of q'' + damping q' + stiffness q = 0: (rotates (n,), rate (n, 2), from_modal (2n, 2n)).

    A mode that is critically damped to the last digit has one eigenvector instead of two. Its damping is then moved by
    a billionth, which separates the pair.
    """
    n = len(stiffness)
    scale = math.sqrt(np.linalg.norm(stiffness, 2))
    for nudged in (1.0, 1.0 + 1e-9, 1.0 + 1e-8):
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -nudged * damping]])
        values, vectors = np.linalg.eig(system)
        balanced = vectors * np.concatenate([np.full(n, scale), np.ones(n)])[:, None]
        if np.linalg.cond(balanced / np.linalg.norm(balanced, axis=0)) < MAX_CONDITION:
            break
    turning = [i for i in np.argsort(np.abs(values)) if values[i].imag > 0.0]
    decaying = [i for i in np.argsort(np.abs(values)) if values[i].imag == 0.0]
    rotates, rate, columns = [], [], []
    for i in turning:
        rotates.append(True)
        rate.append((min(values[i].real, 0.0), values[i].imag))
        columns += [vectors[:, i].real, -vectors[:, i].imag]
    for i, k in zip(decaying[::2], decaying[1::2], strict=True):
        rotates.append(False)
        rate.append((min(values[i].real, 0.0), min(values[k].real, 0.0)))
        columns += [vectors[:, i].real, vectors[:, k].real]
    return np.array(rotates), np.array(rate), np.column_stack(columns)


def _derivative(rotates: Array, rate: Array) -> Array:
    """Block-diagonal matrix B of u' = B u."""
    from scipy.linalg import block_diag

    blocks = [[[a, -b], [b, a]] if turns else [[a, 0.0], [0.0, b]] for turns, (a, b) in zip(rotates, rate, strict=True)]
    return np.asarray(block_diag(*blocks))


def _bound(rotates: Array, row: Array) -> Array:
    """Coefficients m with |row . exp(B t) u| <= sum m |u| for all t >= 0."""
    pairs = np.abs(row).reshape(-1, 2)
    turning = np.hypot(pairs[:, 0], pairs[:, 1])[:, None]
    return np.where(rotates[:, None], turning, pairs).ravel()


def _regimes(modes: Modes, *systems: tuple[Array, Array]) -> Regimes:
    """Regimes of several (stiffness, damping) of the same modes."""
    tip = modes.tip_shape
    n = len(tip)
    load = np.concatenate([np.zeros(n), modes.force_shape])
    parts = []
    for matrices in systems:
        rotates, rate, from_modal = _modal_blocks(*matrices)
        to_modal = np.linalg.inv(from_modal)
        derivative = _derivative(rotates, rate)
        displacement = tip @ from_modal[:n]
        rows = [displacement]
        for _ in range(3):
            rows.append(rows[-1] @ derivative)
        magnitude = np.stack([_bound(rotates, rows[2]), _bound(rotates, rows[3])])
        modulus = np.where(rotates[:, None], np.hypot(rate[:, :1], rate[:, 1:]), np.abs(rate)).ravel()
        parts.append(
            (
                rotates,
                rate,
                to_modal,
                from_modal,
                np.stack(rows[:3]),
                magnitude,
                to_modal @ load,
                modulus,
                modulus.max(),
            )
        )
    return Regimes(*(np.ascontiguousarray(np.stack(part)) for part in zip(*parts, strict=True)))


def flexible_model(modes: Modes, contact_stiffness: float, contact_damping: float) -> ModalImpactModel:
    """Model of a machine whose surfaces are a spring [N/m] and a damper [N s/m]; not yet at an operating point."""
    n, tip, stiffness = len(modes.tip_shape), modes.tip_shape, modes.angular_frequency**2
    pressed_stiffness = np.diag(stiffness) + contact_stiffness * np.outer(tip, tip)
    pressed_damping = modes.damping + contact_damping * np.outer(tip, tip)
    regimes = _regimes(modes, (np.diag(stiffness), modes.damping), (pressed_stiffness, pressed_damping))
    # rest with one surface pressing: (K + k p p') q = k c p, so x - c = -c / (1 + k p' K^-1 p)
    compliance = contact_stiffness * float(np.sum(tip**2 / stiffness))
    position = contact_stiffness * (tip / stiffness) / (1.0 + compliance)
    rest = regimes.to_modal[1] @ np.concatenate([position, np.zeros(n)])
    return ModalImpactModel(
        excitation_frequency=math.nan,
        force_amplitude=math.nan,
        clearance=math.nan,
        contact_stiffness=contact_stiffness,
        contact_damping=contact_damping,
        stiffness=stiffness,
        damping=modes.damping,
        tip_shape=tip,
        force_shape=modes.force_shape,
        regimes=regimes,
        rest=np.ascontiguousarray(rest),
        rest_penetration=-1.0 / (1.0 + compliance),
    )


def rigid_model(modes: Modes, contact_stiffness: float, contact_damping: float) -> RestitutionModel:
    """Model of a machine with one mode whose impacts take no time; not yet at an operating point."""
    stiffness = modes.angular_frequency**2
    impact = linear_impact(1.0 / float(modes.tip_shape[0]) ** 2, contact_stiffness, contact_damping)
    return RestitutionModel(
        excitation_frequency=math.nan,
        force_amplitude=math.nan,
        clearance=math.nan,
        stiffness=stiffness,
        damping=modes.damping,
        tip_shape=modes.tip_shape,
        force_shape=modes.force_shape,
        regimes=_regimes(modes, (np.diag(stiffness), modes.damping)),
        restitution=impact.restitution,
        contact_duration=impact.duration,
        force_per_speed=impact.force_per_speed,
    )


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
    def structure(self) -> ModalImpactModel | RestitutionModel:
        """Model by ``flexible_model`` or ``rigid_model``, whatever frequency, force and clearance."""

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed [Hz], or at many."""
        return 1.0 / speed

    def reduce(self) -> ModalImpactModel | RestitutionModel:
        """Return the modal model; machines that differ in frequency, force or clearance share the costly part."""
        return self.structure._replace(
            excitation_frequency=getattr(self, self.speed_field),
            force_amplitude=self.force_amplitude,
            clearance=getattr(self, self.clearance_field),
        )

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
    def runs_fixed_steps(self) -> bool:
        """True unless impacts take no time."""
        return isinstance(self.structure, ModalImpactModel)

    def run(
        self,
        coordinates: Array,
        bouncing: Array,
        arrays: CycleArrays,
        integrator: Integrator,
        tangents: Tangents | None = None,
    ) -> tuple[int, int]:
        """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
        model = self.reduce()
        motion = (model, coordinates, Episode(side=bouncing[:1], touch=bouncing[1:]), arrays)
        along = () if tangents is None else (tangents,)
        if isinstance(integrator, ExactEvents):
            step, tolerance, budget = integrator.step_phase, integrator.event_tolerance, integrator.event_budget
            if isinstance(model, ModalImpactModel):
                outcome = call(advance, *motion, step, tolerance, budget, *along)
            else:
                outcome = call(advance_restitution, *motion, step, budget, *along)
        elif isinstance(model, ModalImpactModel):
            outcome = call(advance_fixed_step, *motion, integrator.steps_per_cycle)
        else:
            raise refuse_fixed_steps(integrator, self)
        status, done = outcome
        return status, done

    def share_of_bound(self, states: Array, peak_force: Array) -> float:
        """Share of the bound of passivity: neither structure nor contact gives energy away.

        The energy E of the modes grows by the work of the force alone, so sqrt(2 E) by at most F |phi_f| a second.
        """
        model, n = self.reduce(), len(self.structure.stiffness)
        energy = np.sum(states[:, n:] ** 2 + model.stiffness * states[:, :n] ** 2, axis=1)
        if model.force_amplitude == 0.0:
            return 0.0 if not energy.any() and not peak_force.any() else math.inf
        instants = np.arange(1, len(states)) * self.cycle_period
        speed = model.force_amplitude * float(np.linalg.norm(model.force_shape)) * instants
        surface = math.sqrt(self.contact_stiffness) + self.contact_damping * float(np.linalg.norm(model.tip_shape))
        force = surface * speed
        return max(float(np.max(np.sqrt(energy[1:]) / speed)), float(np.max(peak_force.max(axis=1) / force)))

    def batch(self, count: int) -> CompiledBatch:
        """Return ``count`` variants that move in one compiled call."""
        return (ModalImpactBatch if self.runs_fixed_steps else RestitutionBatch)(self, count)
