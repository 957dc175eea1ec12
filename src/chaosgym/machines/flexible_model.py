"""Model of the kernels of a machine of a few modes: from its modes and stops."""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.matrices import inv, product
from chaosgym.core.modal_model import LOAD, STOP, ModalImpactModel, Regimes, Tables
from chaosgym.errors import ParameterError
from chaosgym.machines.integrators import ExactEvents
from chaosgym.machines.modal_blocks import RIGID_SHARE, largest_modulus, modal_blocks, nearly_rigid, settled
from chaosgym.machines.parameters import refuse_not_finite


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
        output = product(modes.tip_shape, from_modal[:n])
        parts.append((generator, inv(from_modal), from_modal, output, largest_modulus(generator)))
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
    try:
        regimes = _regimes(modes, *systems)
    except np.linalg.LinAlgError as error:
        raise ParameterError(f"rounding hides the modes of this machine ({error}); take fewer modes") from error
    static = np.zeros(n) if static_force is None else np.array(static_force, dtype=float)
    with np.errstate(divide="ignore"):
        compliance = float(np.sum(np.divide(tip**2, stiffness, where=tip != 0.0, out=np.zeros(n))))
    rest, drift, penetration = [], [], []
    for r, stop in enumerate([Stop(0.0, 0.0), *stops]):
        parts = []
        for force in (stop.stiffness * tip, static):
            load = product(regimes.to_modal[r], np.concatenate([np.zeros(n), force]))
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
    from chaosgym.core.compilation import call
    from chaosgym.core.modal_impact import tabulate

    phase = model.tables.step_phase if step_phase is None else step_phase
    return model._replace(tables=Tables(phase, *call(tabulate, model, phase, rate)))
