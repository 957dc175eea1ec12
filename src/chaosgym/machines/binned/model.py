r"""From the equations of a mechanism to the model that the kernels integrate.

Matrices are held at the middle of each bin of crank angle, loads follow as cubics in the time of a bin, and every set
of closed contacts adds its stiffness and damping. Mass matrices, loads and contacts of all bins depend neither on the
speed nor on the clearance; at a given speed they are summed and turned into propagators. Both results are kept for
machines that differ only in speed or clearance.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from dataclasses import fields
from functools import cache, lru_cache
from operator import attrgetter
from threading import Lock
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.binned.model import FORCING_TERMS, BinnedModel, TaylorModel
from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import refuse_not_finite

if TYPE_CHECKING:
    from chaosgym.machines.binned.machine import BinnedMachine


PIECE_PHASE = 2.0
"""Longest piece of a Taylor series times largest eigenvalue without contact."""

SPAN_PHASE = 5.0
"""Longest span of a Taylor series times largest eigenvalue without contact: stable for modes damped by 0.1 %."""

SPAN_ERROR = 1e-10
"""Last terms [m/s] of the Taylor series of velocities at the end of a span, by default."""

STEP_PHASE = 0.5
"""Angle [rad] by which the fastest motion turns in half an interval of a look, by default."""

PIN_ROWS = 2
"""Directions of a pin in the plane."""

MAX_SETS = 32
"""Contact sets for which propagators are made; a machine with more is left to Taylor series."""

KEPT = 128
"""Machines whose assembled equations are kept, whatever their speed and clearance."""

KEPT_STRUCTURES = 1024
"""Machines whose models are looked up by speed alone."""

KEPT_STEPPED = 16
"""Models for Taylor series that are kept: some hundred kB each."""

MOST_STEPS = 1e9
"""Steps of a bin; a cycle's budget ends by default long before."""

KEPT_BYTES = 256_000_000
"""Memory for the propagators of machines at one speed; those used longest ago go first."""


class Contact(NamedTuple):
    """A surface, or two opposite ones; more than one row is a ball in a shell.

    Attributes
    ----------
    row : (R, n)
        Displacement in each direction per unit coordinate.
    gap, stiffness, damping
        Clearance [m]; k [N/m] and d [N s/m], or K [N/m^1.5] and chi [s/m] of Hertz's law.
    two_sided
        False if a contact with one row has a surface only where row . p is positive.
    reading : (R, 3)
        Recorded force (along, upward or across, sideways) per newton along each row; zero of another joint.
    slides
        Whether friction acts along the guide.
    drag : (n,) or None
        What friction drives per newton of contact force, on surfaces that slide past steadily.
    share : (bins,) or None
        Factor of stiffness and damping over the cycle.
    """

    row: Array
    gap: float
    stiffness: float
    damping: float
    two_sided: bool
    reading: Array
    slides: bool = False
    drag: Array | None = None
    share: Array | None = None


class Held(NamedTuple):
    """Accelerations of all bins by powers of the rate w of the drive, whatever the speed and the clearance.

    Attributes
    ----------
    inverse_mass : (bins, n, n)
    free : (3, bins, 2n, n)
        Per unit of coordinates and velocities.
    forcing : (powers, bins, 4, n)
        Of the forcing, a cubic in the time of a bin, by powers 0 and 2, or 0, 1 and 2.
    friction : (bins, n)
        What one newton of contact force drives along the guide.
    tangent : (bins,)
        Of the angle by which friction of a pin turns its contact force.
    """

    inverse_mass: Array
    free: Array
    forcing: Array
    friction: Array
    tangent: Array


def held(
    mass: Array,
    damping: Array,
    stiffness: Array,
    loads: Array,
    friction: Array | None = None,
    tangent: Array | None = None,
) -> Held:
    """Held accelerations of M p'' + D p' + K p = -loads, of all bins.

    Parameters
    ----------
    mass, damping, stiffness
        (bins, n, n), (2, bins, n, n) and (3, bins, n, n) at the middles of the bins, by powers of the rate.
    loads : (powers, 3 bins, n)
        At the nodes of the forcing, three a bin from the beginning of the first on.
    friction, tangent : (bins, n), (bins,)
        As in ``Held``; none if omitted.
    """
    bins, n = mass.shape[:2]
    inverse_mass = np.asarray(np.linalg.inv(mass), dtype=np.float64)
    free = np.zeros((3, bins, 2 * n, n))
    free[:, :, :n] = -np.swapaxes(inverse_mass @ stiffness, -1, -2)
    free[:2, :, n:] = -np.swapaxes(inverse_mass @ damping, -1, -2)
    found = Held(
        inverse_mass,
        free,
        _forcing(inverse_mass, loads),
        np.zeros((bins, n)) if friction is None else friction,
        np.zeros(bins) if tangent is None else tangent,
    )
    refuse_not_finite("the equations of a mechanism", *found)
    return found


def middles_and_nodes(bins: int) -> tuple[Array, Array]:
    """Angles [rad] of the middles of the bins, and of the nodes of the forcing."""
    width = 2.0 * math.pi / bins
    nodes = FORCING_TERMS - 1
    middles = (np.arange(bins, dtype=np.float64) + 0.5) * width
    return middles, np.arange(bins * nodes, dtype=np.float64) * width / nodes


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


class ModelsBySpeed:
    """Models, at any speed, of machines that differ in speed and clearance alone; from ``models_by_speed``."""

    def __init__(self, step_phase: float, structure: tuple[Any, ...]) -> None:
        self._step_phase, self._structure = step_phase, structure

    def at(self, speed: float) -> BinnedModel:
        """Return the model at a speed, in the unit of the speed field; its gaps are zero."""
        return _recent.get((speed, self), lambda: self._made(speed))

    def _made(self, speed: float) -> BinnedModel:
        kind, *_ = self._structure
        return _at_rate(kind.rate_at(speed), self._step_phase, _structure(*self._structure))


@lru_cache(maxsize=KEPT_STRUCTURES)
def _models_by_speed(step_phase: float, *structure: Any) -> ModelsBySpeed:
    return ModelsBySpeed(step_phase, structure)


def models_by_speed(machine: "BinnedMachine", step_phase: float = STEP_PHASE) -> ModelsBySpeed:
    """Models of a machine that ``has_propagators``; ``step_phase`` is that of ``BinnedMachine.reduce``."""
    return _models_by_speed(step_phase, *_key(machine))


def exact_model(machine: "BinnedMachine", step_phase: float) -> BinnedModel:
    """Model of a machine that ``has_propagators``; ``step_phase`` is that of ``BinnedMachine.reduce``."""
    return models_by_speed(machine, step_phase).at(machine.drive_speed)._replace(gap=machine.gaps)


def _key(machine: "BinnedMachine") -> tuple[Any, ...]:
    """Class and all fields that shape the matrices."""
    kind: Any = type(machine)
    return (kind, *_structure_values(kind)(machine))


@cache
def _structure_values(kind: Any) -> Callable[[Any], tuple[Any, ...]]:
    return attrgetter(*_structure_fields(kind))


@cache
def _structure_fields(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.name not in kind.beside_matrices)


def _made(kind: type, structure: tuple[Any, ...]) -> "BinnedMachine":
    """Machine at the default speed and clearance."""
    machine: BinnedMachine = kind(**dict(zip(_structure_fields(kind), structure, strict=True)))
    return machine


@lru_cache(maxsize=KEPT)
def _kept(kind: type, *structure: Any) -> Held:
    """What is held, kept for machines without a table of propagators."""
    return _made(kind, structure).held()


def _free_motion(free: Array, forcing: Array, rate: float) -> Array:
    """Accelerations without contact at a crank rate, (bins, 2n + 4, n)."""
    driven = _even_powers(forcing, rate)
    return np.concatenate([free[0] + rate * free[1] + rate**2 * free[2], driven[0] + rate**2 * driven[1]], axis=1)


def _even_powers(forcing: Array, rate: float) -> Array:
    """Forcing by powers 0 and 2 of a rate, (2, ...): what grows with its first power is summed into the constant."""
    return forcing if len(forcing) == 2 else np.stack([forcing[0] + rate * forcing[1], forcing[2]])


@lru_cache(maxsize=KEPT_STEPPED)
def stepped_model(machine: "BinnedMachine", step_phase: float) -> TaylorModel:
    """Model of any machine for Taylor series; kept for the last machines, which a search asks for again and again.

    A closed contact turns by ``step_phase`` / 4 in a piece of a series; half of it leaves a sixteenth of the error.
    """
    inverse_mass, free, forcing, friction, tangent = _kept(*_key(machine))
    contacts = machine.contacts
    row = np.concatenate([contact.row for contact in contacts])
    rate = machine.crank_rate
    acceleration = _free_motion(free, forcing, rate)
    first = np.cumsum([0] + [len(contact.row) for contact in contacts])
    answer = np.swapaxes(inverse_mass @ row.T, -1, -2)
    for at, each in zip(first, contacts, strict=False):
        if each.slides and len(each.row) == PIN_ROWS:
            across = np.array([answer[:, at + 1], -answer[:, at]])
            answer[:, at : at + PIN_ROWS] += np.swapaxes(tangent[:, None] * across, 0, 1)
    slide = -np.einsum("bij,bj->bi", inverse_mass, friction)
    contact = math.sqrt(machine.stiffest * np.max(np.einsum("brn,rn->br", answer, row)))
    bins = len(inverse_mass)
    duration = 2.0 * math.pi / (bins * rate)
    n = len(row[0])
    system = np.zeros((bins, 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = acceleration[:, : 2 * n]
    spectrum = float(np.max(np.abs(np.linalg.eigvals(system[machine.sampled_bins]))))
    return TaylorModel(
        bin_duration=duration,
        steps=_whole_steps(duration * max(4.0 * contact / step_phase, spectrum / PIECE_PHASE)),
        longest=duration / max(1.0, duration * spectrum / SPAN_PHASE),
        tolerance=SPAN_ERROR * step_phase**4,
        contact_rate=contact,
        acceleration=_with_readings(np.concatenate([acceleration, -answer, slide[:, None]], axis=1), row),
        first=first,
        row=row,
        gap=np.array([contact.gap for contact in contacts]),
        stiffness=np.array([contact.stiffness for contact in contacts]),
        damping=np.array([contact.damping for contact in contacts]),
        law=machine.law,
        slides=np.array([float(contact.slides) for contact in contacts]),
        two_sided=np.array([contact.two_sided for contact in contacts]),
        reading=np.concatenate([contact.reading for contact in contacts]),
        monitored=np.array([bool(np.any(contact.reading)) for contact in contacts]),
        display=machine.display,
    )


def _whole_steps(wanted: float) -> int:
    """Steps of a bin, whole and at least one; refused where no kernel would ever end."""
    if not wanted < MOST_STEPS:
        raise ParameterError(
            f"the fastest motion takes {wanted:.1e} steps in a bin; allowed: up to {MOST_STEPS:g}, with more mass and "
            "inertia, less stiffness and damping, or a higher speed"
        )
    return max(1, math.ceil(wanted))


def _with_readings(accelerations: Array, row: Array) -> Array:
    """Lanes of ``TaylorModel`` of accelerations (..., n)."""
    from chaosgym.core.lanes import padded

    rows, n = row.shape
    lanes = np.zeros((*accelerations.shape[:-1], padded(rows + n)))
    lanes[..., :rows] = accelerations @ row.T
    lanes[..., rows : rows + n] = accelerations
    return lanes


def fastest_rate(machine: "BinnedMachine", model: TaylorModel) -> float:
    """Largest modulus [1/s] of an eigenvalue with every contact closed."""
    rows, n = model.row.shape
    some = model.acceleration[machine.sampled_bins, :, rows : rows + n]
    pushes = slice(2 * n + FORCING_TERMS, 2 * n + FORCING_TERMS + rows)
    system = np.zeros((len(some), 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = some[:, : 2 * n]
    system[:, :n, n:] += machine.stiffest * model.row.T @ some[:, pushes]
    return float(np.max(np.abs(np.linalg.eigvals(system))))


class Channels(NamedTuple):
    """Contacts of one row each, as in ``BinnedModel`` and ``Contact``: ``slides`` (m,), ``drag`` (m, n)."""

    row: Array
    stiffness: Array
    damping: Array
    two_sided: NDArray[np.bool_]
    reading: Array
    slides: NDArray[np.bool_]
    drag: Array
    share: Array


def channels_of(contacts: Sequence[Contact]) -> Channels:
    """Contacts that have one row each, as arrays; ``share`` is given for all or for none."""
    n = contacts[0].row.shape[1]
    shares = [contact.share for contact in contacts if contact.share is not None]
    return Channels(
        row=np.concatenate([contact.row for contact in contacts]),
        stiffness=np.array([contact.stiffness for contact in contacts]),
        damping=np.array([contact.damping for contact in contacts]),
        two_sided=np.array([contact.two_sided for contact in contacts]),
        reading=np.concatenate([contact.reading for contact in contacts]),
        slides=np.array([contact.slides for contact in contacts]),
        drag=np.array([np.zeros(n) if contact.drag is None else contact.drag for contact in contacts]),
        share=np.array(shares).T if shares else np.empty((0, len(contacts))),
    )


class _Structure(NamedTuple):
    """Accelerations of all bins by powers of the crank rate, whatever the speed and the clearance.

    ``free`` and ``forcing`` are those of ``Held``, ``push`` that of all sets, with ``bins`` bins in groups of eight;
    ``lag`` (sets, m) [s] damping over stiffness of the closed channels; ``anchor`` as in the model; ``contact`` [rad/s]
    angular frequency of the masses next to the closed contacts; ``spectrum`` [1/s] largest modulus of an eigenvalue.
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
                force = row + sign * channels.drag[j] + sign * channels.slides[j] * friction
                answer = np.einsum("bij,bj->bi", inverse_mass, force)[:, None, :]
                if len(channels.share):
                    answer = channels.share[:, j, None, None] * answer
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
    inverse_mass, free, forcing, friction, _ = machine.held()
    n = inverse_mass.shape[-1]
    channels = channels_of(machine.contacts)
    radix = machine.radix
    push = _push(inverse_mass, channels, radix, friction)
    some = machine.sampled_bins
    contact, spectrum = _rates(free[0, some], push[-1, some, : 2 * n], channels.row)
    lag, anchor = _closed(channels, radix)
    return _Structure(
        channels=channels,
        radix=radix,
        display=machine.display,
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
    from chaosgym.core.lanes import LANES

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


def _at_rate(rate: float, step_phase: float, parts: _Structure) -> BinnedModel:
    from chaosgym.core.binned.series import series_order
    from chaosgym.core.binned.tables import tables
    from chaosgym.core.lanes import LANES

    bins = parts.bins
    duration = 2.0 * math.pi / (bins * rate)
    steps = _whole_steps(duration * parts.spectrum / (2.0 * LANES * step_phase))
    order = series_order(parts.spectrum * duration / (LANES * steps))
    accelerations = (parts.free, _even_powers(parts.forcing, rate), parts.push, bins, rate)
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
        share=parts.channels.share,
        two_sided=parts.channels.two_sided,
        radix=parts.radix,
        reading=parts.channels.reading,
        reach=np.linalg.norm(parts.channels.reading, axis=1),
        display=parts.display,
        anchor=parts.anchor,
        table=tables(*accelerations, parts.channels.row, parts.lag, parts.anchor, duration, steps, order),
    )
