"""A broad family of machines with a gap: up to four modes, one or two stops, a force, an unbalance, a base or a mesh.

All is drawn without dimension (ratios of frequencies, damping ratios, the gap over the amplitude of free motion), then
put into SI. All have as many modes, so that one compiled batch holds them; those that are too many move nothing. Ranges
are assumed.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.machines.modal_machine import Drive, ModalMachine, Structure

MODES = 4
"""Modes of each machine."""

KINDS = ("force", "unbalance", "base", "gear")
"""What drives a machine: a force, an unbalance, a base that moves, or the error of a gear pair that turns freely."""

THREE_REGIMES = 1.0 + 1e-9
"""Stiffness of the lower stop over that of the upper one: both are tabulated, as those of any other machine are."""

FIRST, FORCE = 15.0, 10.0
"""Lowest natural frequency [Hz], and amplitude of the drive at top speed [N]: neither matters, but for a unit."""


class JointSensed(ModalMachine):
    """A machine whose sensor is in the joint: it shows the larger of both sides' peaks in each cycle."""

    def sensed(self, peak_force: Array) -> Array:
        """Peak forces [N] that the sensor shows, (..., cycles)."""
        return np.asarray(peak_force.max(axis=-1))


class Ranged(NamedTuple):
    """A ``machine``, and the ``lowest`` and ``highest`` speed [Hz] of its drive."""

    machine: ModalMachine
    lowest: float
    highest: float


def drawn_machine(kind: str, generator: np.random.Generator) -> Ranged:
    """Draw a machine of a kind, ``KINDS``."""
    return _gear_pair(generator) if kind == "gear" else _structure(kind, generator)


def _about(generator: np.random.Generator, low: float, high: float) -> float:
    """A positive number whose logarithm is uniform."""
    return math.exp(generator.uniform(math.log(low), math.log(high)))


def _structure(kind: str, rng: np.random.Generator) -> Ranged:
    """A structure of one to four modes; what drives it is 10 N at top speed."""
    kept = int(rng.integers(1, MODES + 1))
    ratios = [1.0, _about(rng, 1.6, 30.0), *(_about(rng, 1.5, 4.0) for _ in range(MODES - 2))]
    frequencies = FIRST * np.cumprod(ratios)
    damping = np.array([_about(rng, 0.003, 0.05) for _ in range(MODES)])
    joint, source = (rng.choice([-1.0, 1.0], MODES) * rng.uniform(0.3, 1.5, MODES) for _ in range(2))
    joint[0], source[0] = abs(joint[0]) + 0.3, abs(source[0]) + 0.3
    joint[kept:] = source[kept:] = 0.0
    top = FIRST * _about(rng, 0.5, 5.0)
    low = top / _about(rng, 1.4, 4.0)
    stiffness = (2.0 * np.pi * FIRST * _about(rng, 5.0, 80.0)) ** 2 / joint[0] ** 2
    damper = 2.0 * _about(rng, 0.01, 0.4) * np.sqrt(stiffness) / abs(joint[0])
    grows, at = kind != "force", "base" if kind == "base" else "source"
    amplitude = FORCE / (2.0 * np.pi * top) ** 2 if grows else FORCE
    free = _free_amplitude(frequencies, damping, joint * source, np.linspace(low, top, 57), grows)
    gap = float(np.median(free)) * _about(rng, 0.02, 0.8)
    offset = 0.0 if rng.random() < 0.6 else gap * rng.uniform(-0.5, 0.5)
    preload = 0.0 if rng.random() < 0.7 else FORCE * rng.uniform(-0.5, 0.5)
    machine = JointSensed(  # type: ignore[call-arg]
        modes=Structure.of_modes(frequencies, damping, {"joint": joint, at: source}),
        joint="joint",
        drives=(Drive.sine({"base": "displacement"}.get(kind, kind), at, amplitude),),
        speed=top,
        clearance=gap,
        offset=offset,
        stops="two" if rng.random() < 0.6 else "one",
        contact_stiffness=stiffness,
        contact_damping=damper,
        preload=preload,
        lower_stiffness_factor=THREE_REGIMES,
    )
    return Ranged(machine, low, top)


def _free_amplitude(frequencies: Any, damping: Array, shape: Array, speeds: Any, grows: bool) -> Array:
    """Amplitudes [m] of the joint without stops at speeds (s,)."""
    driven, rates = 2.0 * np.pi * speeds[:, None], 2.0 * np.pi * frequencies
    force = FORCE * (driven / driven.max()) ** 2 if grows else FORCE
    receptance = shape * force / (rates**2 - driven**2 + 2j * damping * rates * driven)
    return np.asarray(np.abs(receptance.sum(axis=1)))


def _gear_pair(rng: np.random.Generator) -> Ranged:
    """A pair that turns freely in its backlash, under a mean load and the error of its teeth; one coordinate.

    As A. Kahraman and R. Singh, Journal of Sound and Vibration 142 (1990) 49-75, have it.
    """
    mass, rate, gap = 0.1, 2.0 * np.pi * FIRST, 1e-4
    stiffness = mass * rate**2
    load = _about(rng, 0.03, 0.5)
    error = load * _about(rng, 0.2, 1.0)
    highest = FIRST * _about(rng, 0.8, 2.5)
    shape = np.zeros(MODES)
    shape[0] = mass**-0.5
    frequencies = FIRST * np.array([0.0, 5.0, 10.0, 20.0])
    damping = np.diag([2.0 * _about(rng, 0.02, 0.1) * rate, *(0.1 * rate,) * (MODES - 1)])
    machine = JointSensed(  # type: ignore[call-arg]
        modes=Structure.of_modes(frequencies, damping, {"joint": shape}),
        joint="joint",
        drives=(Drive.sine("unbalance", "joint", error * mass * gap),),
        speed=highest,
        clearance=gap,
        contact_stiffness=stiffness,
        contact_damping=0.0,
        preload=load * stiffness * gap,
        lower_stiffness_factor=THREE_REGIMES,
    )
    return Ranged(machine, highest / _about(rng, 1.4, 4.0), highest)
