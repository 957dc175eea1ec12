"""The model of propagators, by which machines with few sets of contacts move exactly from bin to bin.

Every set of closed contacts adds its stiffness and damping to the equations, which are summed at a given speed and
turned into propagators. Models are kept for machines that differ only in speed or clearance.
"""

import math
from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from functools import lru_cache
from threading import Lock
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.binned.model import BinnedModel
from chaosgym.core.matrices import product
from chaosgym.machines.binned.equations import (
    STEP_PHASE,
    Contact,
    even_powers,
    largest_rate,
    whole_steps,
)
from chaosgym.machines.binned.held_machine import KEPT, HeldMachine, structure_of

MAX_SETS = 32
"""Contact sets for which propagators are made; a machine with more is left to Taylor series."""

KEPT_STRUCTURES = 1024
"""Machines whose models are looked up by speed alone."""

KEPT_BYTES = 256_000_000
"""Memory for the propagators of machines at one speed; those used longest ago go first."""


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

    def __init__(self, structure: HeldMachine, step_phase: float) -> None:
        self._structure, self._step_phase = structure, step_phase

    def at(self, speed: float) -> BinnedModel:
        """Return the model at a speed, in the unit of the speed field; its gaps are zero."""
        return _recent.get((speed, self), lambda: self._made(speed))

    def _made(self, speed: float) -> BinnedModel:
        return _at_rate(self._structure.rate_at(speed), self._step_phase, _structure(self._structure))


@lru_cache(maxsize=KEPT_STRUCTURES)
def _models_by_speed(structure: HeldMachine, step_phase: float) -> ModelsBySpeed:
    return ModelsBySpeed(structure, step_phase)


def models_by_speed(machine: HeldMachine, step_phase: float = STEP_PHASE) -> ModelsBySpeed:
    """Models of a machine that ``has_propagators``; ``step_phase`` is that of ``BinnedMachine.reduce``."""
    return _models_by_speed(structure_of(machine), step_phase)


def exact_model(machine: HeldMachine, step_phase: float) -> BinnedModel:
    """Model of a machine that ``has_propagators``; ``step_phase`` is that of ``BinnedMachine.reduce``."""
    return models_by_speed(machine, step_phase).at(machine.drive_speed)._replace(gap=machine.gaps)


class Channels(NamedTuple):
    """Contacts of one row each, as in ``BinnedModel`` and ``Contact``."""

    row: Array
    stiffness: Array
    damping: Array
    two_sided: NDArray[np.bool_]
    reading: Array
    slides: tuple[int, ...]
    share: Array


def channels_of(contacts: Sequence[Contact]) -> Channels:
    """Contacts that have one row each, as arrays; ``share`` has no rows where it is 1 of all."""
    bins = max((len(contact.share) for contact in contacts if contact.share is not None), default=0)
    shares = [np.ones(bins) if contact.share is None else contact.share for contact in contacts]
    return Channels(
        row=np.concatenate([contact.row for contact in contacts]),
        stiffness=np.array([contact.stiffness for contact in contacts]),
        damping=np.array([contact.damping for contact in contacts]),
        two_sided=np.array([contact.two_sided for contact in contacts]),
        reading=np.concatenate([contact.reading for contact in contacts]),
        slides=tuple(contact.slides for contact in contacts),
        share=np.ascontiguousarray(np.array(shares).T),
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


def _push(inverse_mass: Array, channels: Channels, radix: int, friction: Array) -> Array:
    """Accelerations that the closed contacts of every set add: (sets, bins, 2n + m, n).

    ``friction`` (S, bins, n) is what one newton of contact force drives by each friction.
    """
    bins, n, m = len(inverse_mass), inverse_mass.shape[-1], len(channels.row)
    push = np.zeros((radix**m, bins, 2 * n + m, n))
    for chosen in range(radix**m):
        for j in range(m):
            digit = chosen // radix**j % radix
            if digit:
                row, sign, rubs = channels.row[j], 1.0 if digit == 1 else -1.0, channels.slides[j]
                force = row + (sign * friction[rubs] if rubs >= 0 else np.zeros((bins, n)))
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
    local = product(-row, pushed[:, :n], matrices.pinv(row))
    contact = math.sqrt(float(np.max(matrices.modulus(matrices.eigvals(local)))))
    return contact, largest_rate(free + pushed)


@lru_cache(maxsize=KEPT)
def _structure(machine: HeldMachine) -> _Structure:
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
        anchor[chosen][:, closed] = matrices.pinv(channels.row[closed])
    return lag, anchor


def _at_rate(rate: float, step_phase: float, parts: _Structure) -> BinnedModel:
    from chaosgym.core.binned.series import series_order
    from chaosgym.core.binned.tables import tables
    from chaosgym.core.compilation import call
    from chaosgym.core.lanes import LANES

    bins = parts.bins
    duration = 2.0 * math.pi / (bins * rate)
    steps = whole_steps(duration * parts.spectrum / (2.0 * LANES * step_phase))
    order = series_order(parts.spectrum * duration / (LANES * steps))
    accelerations = (parts.free, even_powers(parts.forcing, rate), parts.push, bins, rate)
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
        table=call(tables, *accelerations, parts.channels.row, parts.lag, parts.anchor, duration, steps, order),
    )
