r"""From the equations of a slider crank to the model that the kernels integrate.

Matrices are held at the middle of each bin of crank angle, loads follow as cubics in the time of a bin, and every set
of closed contacts adds its stiffness and damping. Mass matrices, loads and contacts of all bins depend neither on the
speed nor on the clearance; at a given speed they are summed and turned into propagators. Both results are kept for
machines that differ only in speed or clearance.

The file is long because what is assembled, at which level it is kept, and for whom, is one decision.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable
from dataclasses import fields
from functools import cache, lru_cache
from operator import attrgetter
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.binned.cycle import BinnedModel
from chaosgym.core.binned.series import FORCING_TERMS, series_order
from chaosgym.core.binned.tables import tables
from chaosgym.core.binned.taylor import HERTZ, LINEAR, TaylorModel
from chaosgym.core.lanes import LANES, padded
from chaosgym.machines.parameters import refuse_not_finite
from chaosgym.machines.slider_crank.equations import Equations, equations, loads, rod_of
from chaosgym.machines.slider_crank.joints import Channels, channels_of, display_of, gaps_of, hertz_constants, joints_of
from chaosgym.machines.slider_crank.kinematics import slider_rate
from chaosgym.machines.slider_crank.spatial_equations import spatial_equations, spatial_loads

if TYPE_CHECKING:
    from chaosgym.machines.slider_crank.parameters import SliderCrank

Array = NDArray[np.float64]

PIECE_PHASE = 2.0
"""Longest piece of a Taylor series times largest eigenvalue without contact."""

SPAN_PHASE = 5.0
"""Longest span of a Taylor series times largest eigenvalue without contact: stable for modes damped by 0.1 %."""

SPAN_ERROR = 1e-10
"""Last terms [m/s] of the Taylor series of velocities at the end of a span, by default."""

STEP_PHASE = 0.5
"""Angle [rad] by which the fastest motion turns in half an interval of a look, by default."""

MAX_SETS = 32
"""Contact sets for which propagators are made; a machine with more is left to Taylor series."""

KEPT = 128
"""Machines whose assembled equations are kept, whatever their speed and clearance."""

KEPT_STRUCTURES = 1024
"""Machines whose models are looked up by speed alone."""

KEPT_BYTES = 256_000_000
"""Memory for the propagators of machines at one speed; those used longest ago go first."""

_NOT_IN_THE_MATRICES = ("crank_speed", "slider_clearance", "ball_clearance")


class _RecentModels:
    """Models by key within ``KEPT_BYTES``; several threads may ask at once."""

    def __init__(self) -> None:
        self._models: OrderedDict[Hashable, BinnedModel] = OrderedDict()
        self._bytes = 0
        self._lock = Lock()

    def get(self, key: Hashable, make: Callable[[], BinnedModel]) -> BinnedModel:
        with self._lock:
            if key in self._models:
                self._models.move_to_end(key)
                return self._models[key]
        model = make()
        with self._lock:
            if key not in self._models:
                self._models[key] = model
                self._bytes += model.table.nbytes
            while self._bytes > KEPT_BYTES and len(self._models) > 1:
                self._bytes -= self._models.popitem(last=False)[1].table.nbytes
        return model


_recent = _RecentModels()


def has_propagators(machine: "SliderCrank") -> bool:
    """True if contact is linear, no contact force turns with the ball, and the contact sets are few."""
    if machine.contact_law != "linear" or machine.ball_joint == "spherical":
        return False
    return int(_radix(machine) ** len(gaps_of(machine))) <= MAX_SETS


class ModelsBySpeed:
    """Models, at any speed, of machines that differ in speed and clearance alone; from ``models_by_speed``."""

    def __init__(self, step_phase: float, structure: tuple[Any, ...]) -> None:
        self._step_phase, self._structure = step_phase, structure

    def at(self, crank_speed: float) -> BinnedModel:
        """Return the model at a speed [rpm]; its gaps are zero."""
        return _recent.get(
            (crank_speed, self), lambda: _at_speed(crank_speed, self._step_phase, _structure(*self._structure))
        )


@lru_cache(maxsize=KEPT_STRUCTURES)
def _models_by_speed(step_phase: float, *structure: Any) -> ModelsBySpeed:
    return ModelsBySpeed(step_phase, structure)


def models_by_speed(machine: "SliderCrank", step_phase: float = STEP_PHASE) -> ModelsBySpeed:
    """Models of a machine that ``has_propagators``; ``step_phase`` is that of ``SliderCrank.reduce``."""
    return _models_by_speed(step_phase, *_key(machine))


def exact_model(machine: "SliderCrank", step_phase: float) -> BinnedModel:
    """Model of a machine that ``has_propagators``; ``step_phase`` is that of ``SliderCrank.reduce``."""
    return models_by_speed(machine, step_phase).at(machine.crank_speed)._replace(gap=gaps_of(machine))


def _radix(machine: "SliderCrank") -> int:
    """Contact states of a channel that differ in their matrices: friction tells one side from the other."""
    return 3 if machine.friction_coefficient > 0.0 else 2


def _key(machine: "SliderCrank") -> tuple[Any, ...]:
    """Class and all fields that shape the matrices."""
    kind: Any = type(machine)
    return (kind, *_structure_values(kind)(machine))


@cache
def _structure_values(kind: Any) -> Callable[[Any], tuple[Any, ...]]:
    return attrgetter(*_structure_fields(kind))


@cache
def _structure_fields(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.name not in _NOT_IN_THE_MATRICES)


def _assembled(machine: "SliderCrank", middles: Array, nodes: Array) -> tuple[Equations, Array]:
    """Equations at the middles of the bins and loads at the nodes of the forcing, in the plane or in space."""
    if machine.is_spatial:
        return spatial_equations(machine, middles), spatial_loads(machine, nodes)
    rod = rod_of(machine)
    return equations(machine, middles, rod), loads(machine, nodes, rod)


def _made(kind: type, structure: tuple[Any, ...]) -> "SliderCrank":
    """Machine at the default speed and clearance."""
    machine: SliderCrank = kind(**dict(zip(_structure_fields(kind), structure, strict=True)))
    return machine


@lru_cache(maxsize=KEPT)
def _kept(kind: type, *structure: Any) -> tuple[Array, Array, Array, Array]:
    """``_held``, kept for machines without a table of propagators."""
    return _held(_made(kind, structure))


def _held(machine: "SliderCrank") -> tuple[Array, Array, Array, Array]:
    """Inverse mass, free accelerations and forcing of all bins as in ``_Structure``, and friction per newton."""
    bins = round(360.0 / machine.matrix_update_interval)
    width = 2.0 * math.pi / bins
    middles = (np.arange(bins, dtype=np.float64) + 0.5) * width
    nodes = FORCING_TERMS - 1
    held, loads = _assembled(machine, middles, np.arange(bins * nodes, dtype=np.float64) * width / nodes)
    n = held.mass.shape[-1]
    inverse_mass = np.asarray(np.linalg.inv(held.mass), dtype=np.float64)
    free = np.zeros((3, bins, 2 * n, n))
    free[:, :, :n] = -np.swapaxes(inverse_mass @ held.stiffness, -1, -2)
    free[:2, :, n:] = -np.swapaxes(inverse_mass @ held.damping, -1, -2)
    friction = _friction(machine, middles)[:, None] * held.slider_along
    forcing = _forcing(inverse_mass, loads)
    refuse_not_finite("the equations of a slider crank", inverse_mass, free, forcing, friction)
    return inverse_mass, free, forcing, friction


def _free_motion(free: Array, forcing: Array, rate: float) -> Array:
    """Accelerations without contact at a crank rate, (bins, 2n + 4, n)."""
    return np.concatenate([free[0] + rate * free[1] + rate**2 * free[2], forcing[0] + rate**2 * forcing[1]], axis=1)


def stepped_model(machine: "SliderCrank", step_phase: float) -> TaylorModel:
    """Model of any machine for Taylor series.

    A closed contact turns by ``step_phase`` / 4 in a piece of a series; half of it leaves a sixteenth of the error.
    """
    inverse_mass, free, forcing, friction = _kept(*_key(machine))
    joints = joints_of(machine)
    row = np.concatenate([joint.row for joint in joints])
    acceleration = _free_motion(free, forcing, machine.crank_rate)
    scale = np.array([joint.scale for joint in joints])
    first = np.cumsum([0] + [len(joint.row) for joint in joints])
    linear = machine.contact_law == "linear"
    stiffness, damping = (machine.contact_stiffness, machine.contact_damping) if linear else hertz_constants(machine)
    answer = np.swapaxes(inverse_mass @ row.T, -1, -2)
    slide = -np.einsum("bij,bj->bi", inverse_mass, friction)
    contact = math.sqrt(machine.contact_stiffness * np.max(np.einsum("brn,rn->br", answer, row)))
    bins = len(inverse_mass)
    duration = 2.0 * math.pi / (bins * machine.crank_rate)
    n = len(row[0])
    system = np.zeros((bins, 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = acceleration[:, : 2 * n]
    spectrum = float(np.max(np.abs(np.linalg.eigvals(system[[0, bins // 4]]))))
    return TaylorModel(
        bin_duration=duration,
        steps=max(1, math.ceil(duration * max(4.0 * contact / step_phase, spectrum / PIECE_PHASE))),
        longest=duration / max(1.0, duration * spectrum / SPAN_PHASE),
        tolerance=SPAN_ERROR * step_phase**4,
        contact_rate=contact,
        acceleration=_with_readings(np.concatenate([acceleration, -answer, slide[:, None]], axis=1), row),
        first=first,
        row=row,
        gap=np.array([joint.gap for joint in joints]),
        stiffness=stiffness * scale,
        damping=damping * np.array([joint.damping for joint in joints]) if linear else np.full(len(joints), damping),
        law=LINEAR if linear else HERTZ,
        slides=np.array([float(joint.slides) for joint in joints]),
        two_sided=np.array([joint.two_sided for joint in joints]),
        reading=np.concatenate([joint.reading for joint in joints]),
        monitored=np.array([bool(np.any(joint.reading)) for joint in joints]),
        display=display_of(machine),
    )


def _with_readings(accelerations: Array, row: Array) -> Array:
    """Lanes of ``TaylorModel`` of accelerations (..., n)."""
    rows, n = row.shape
    lanes = np.zeros((*accelerations.shape[:-1], padded(rows + n)))
    lanes[..., :rows] = accelerations @ row.T
    lanes[..., rows : rows + n] = accelerations
    return lanes


def fastest_rate(machine: "SliderCrank", model: TaylorModel) -> float:
    """Largest modulus [1/s] of an eigenvalue with every contact closed."""
    rows, n = model.row.shape
    some = model.acceleration[[0, len(model.acceleration) // 4], :, rows : rows + n]
    pushes = slice(2 * n + FORCING_TERMS, 2 * n + FORCING_TERMS + rows)
    system = np.zeros((len(some), 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = some[:, : 2 * n]
    system[:, :n, n:] += machine.contact_stiffness * model.row.T @ some[:, pushes]
    return float(np.max(np.abs(np.linalg.eigvals(system))))


class _Structure(NamedTuple):
    """Accelerations of all bins by powers of the crank rate, whatever the speed and the clearance.

    ``free``, ``forcing`` and ``push`` are those of ``tables``, of ``bins`` bins in groups of eight; ``lag`` (sets, m)
    [s] damping over stiffness of the closed channels; ``anchor`` as in the model; ``contact`` [rad/s] angular frequency
    of the masses next to the closed contacts; ``spectrum`` [1/s] largest modulus of an eigenvalue.
    """

    channels: Channels
    radix: int
    display: Array
    bins: int
    free: Array
    forcing: Array
    push: Array
    lag: Array
    anchor: Array
    contact: float
    spectrum: float


def _forcing(inverse_mass: Array, loads: Array) -> Array:
    """Cubics in the time of each bin through the loads at its nodes, as accelerations: (2, bins, 4, n)."""
    bins, nodes = len(inverse_mass), FORCING_TERMS - 1
    at = (np.arange(bins)[:, None] * nodes + np.arange(FORCING_TERMS)) % (bins * nodes)
    coefficients = np.linalg.inv(np.vander(np.arange(FORCING_TERMS) / nodes, increasing=True))
    return np.asarray(-np.einsum("bij,kbcj->kbci", inverse_mass, coefficients @ loads[:, at]))


def _push(inverse_mass: Array, channels: Channels, radix: int, friction: Array) -> Array:
    """Accelerations that the closed contacts of every set add: (sets, bins, 2n + m, n).

    ``friction`` (bins, n) is what one newton of contact force drives along the guide.
    """
    bins, n, m = len(inverse_mass), inverse_mass.shape[-1], len(channels.row)
    push = np.zeros((radix**m, bins, 2 * n + m, n))
    for chosen in range(radix**m):
        for j in range(m):
            digit = chosen // radix**j % radix
            if digit:
                row, sign = channels.row[j], 1.0 if digit == 1 else -1.0
                force = row + sign * channels.slides[j] * friction
                answer = np.einsum("bij,bj->bi", inverse_mass, force)[:, None, :]
                push[chosen, :, :n] -= channels.stiffness[j] * row[:, None] * answer
                push[chosen, :, n : 2 * n] -= channels.damping[j] * row[:, None] * answer
                push[chosen, :, 2 * n + j] += channels.stiffness[j] * answer[:, 0]
    return push


def _rates(free: Array, pushed: Array, row: Array) -> tuple[float, float]:
    """(contact, spectrum) of ``_Structure`` from the accelerations (b, 2n, n) of some bins with all contacts closed."""
    n = free.shape[-1]
    local = -row @ pushed[:, :n] @ np.linalg.pinv(row)
    contact = math.sqrt(float(np.max(np.abs(np.linalg.eigvals(local)))))
    system = np.zeros((len(free), 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = free + pushed
    return contact, float(np.max(np.abs(np.linalg.eigvals(system))))


@lru_cache(maxsize=KEPT)
def _structure(kind: type, *structure: Any) -> _Structure:
    machine = _made(kind, structure)
    inverse_mass, free, forcing, friction = _held(machine)
    n = inverse_mass.shape[-1]
    channels = channels_of(machine)
    radix = _radix(machine)
    push = _push(inverse_mass, channels, radix, friction)
    some = [0, len(inverse_mass) // 4]
    contact, spectrum = _rates(free[0, some], push[-1, some, : 2 * n], channels.row)
    lag, anchor = _closed(channels, radix)
    return _Structure(
        channels=channels,
        radix=radix,
        display=display_of(machine),
        bins=len(inverse_mass),
        free=side_by_side(free),
        forcing=side_by_side(forcing),
        push=side_by_side(push),
        lag=lag,
        anchor=anchor,
        contact=contact,
        spectrum=spectrum,
    )


def side_by_side(bins: Array) -> Array:
    """Matrices (..., bins, columns, rows) of eight bins each, (..., groups, rows, columns, 8); the last one repeats."""
    missing = -bins.shape[-3] % LANES
    if missing:
        bins = np.concatenate([bins, np.repeat(bins[..., -1:, :, :], missing, axis=-3)], axis=-3)
    groups = bins.reshape(*bins.shape[:-3], -1, LANES, *bins.shape[-2:])
    return np.ascontiguousarray(np.swapaxes(groups, -3, -1))


def _closed(channels: Channels, radix: int) -> tuple[Array, Array]:
    """(lag, anchor) of ``_Structure``."""
    m, n = channels.row.shape
    lag, anchor = np.zeros((radix**m, m)), np.zeros((radix**m, n, m))
    for chosen in range(radix**m):
        closed = [j for j in range(m) if chosen // radix**j % radix]
        lag[chosen, closed] = channels.damping[closed] / channels.stiffness[closed]
        anchor[chosen][:, closed] = np.linalg.pinv(channels.row[closed])
    return lag, anchor


def _friction(machine: "SliderCrank", crank_angle: Array) -> Array:
    """Friction coefficient with the sign of the nominal slider velocity, ramped through zero."""
    if machine.friction_coefficient == 0.0:
        return np.zeros(len(crank_angle))
    rate = slider_rate(crank_angle, machine.crank_radius, machine.rod_length, math.radians(machine.motor_angle))
    speed = rate / (machine.friction_ramp * machine.crank_radius)
    return np.asarray(machine.friction_coefficient * np.clip(speed, -1.0, 1.0))


def _at_speed(crank_speed: float, step_phase: float, parts: _Structure) -> BinnedModel:
    rate, bins = crank_speed * math.pi / 30.0, parts.bins
    duration = 2.0 * math.pi / (bins * rate)
    steps = max(1, math.ceil(duration * parts.spectrum / (2.0 * LANES * step_phase)))
    order = series_order(parts.spectrum * duration / (LANES * steps))
    accelerations = (parts.free, parts.forcing, parts.push, bins, rate)
    return BinnedModel(
        bin_duration=duration,
        bins=bins,
        steps=steps,
        contact_rate=parts.contact,
        order=order,
        spectrum=parts.spectrum,
        row=parts.channels.row,
        gap=np.zeros(len(parts.channels.row)),
        stiffness=parts.channels.stiffness,
        damping=parts.channels.damping,
        two_sided=parts.channels.two_sided,
        radix=parts.radix,
        reading=parts.channels.reading,
        reach=np.linalg.norm(parts.channels.reading, axis=1),
        display=parts.display,
        anchor=parts.anchor,
        table=tables(*accelerations, parts.channels.row, parts.lag, parts.anchor, duration, steps, order),
    )
