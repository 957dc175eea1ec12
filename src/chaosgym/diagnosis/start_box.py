"""The box from which random initial states are drawn: as large as the motion or the gap, whichever is larger.

A state on the edge of the box at reach 1 moves a joint to its stop in the shape that needs the least energy, or moves
as far as the run from rest. The reach says how many times as far random states lie: at least 3, and up to 10 where the
drive can throw a mode so far. A mode of damping d and force f can't gain energy beyond the velocity f / d.
"""

import math
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.machines import Machine
from chaosgym.machines.abilities import Flexible
from chaosgym.simulation import CycleRecord

LEAST_REACH, LARGEST_REACH = 3.0, 10.0
"""Sizes of the largest random states, in scales of the box."""


class StartBox(NamedTuple):
    """Random initial states: uniform in a box of a size that is itself uniform between 0 and the reach.

    Attributes
    ----------
    scale : (n_states,)
        Half widths at reach 1, in the units of the states; 0 for states that always start at rest.
    reach
        Largest size, in scales.
    measure
        What a scale is, in words: "gaps" or "times the motion".
    """

    scale: Array
    reach: float
    measure: str

    def draw(self, count: int, seed: int) -> Array:
        """Random states (count, n_states); the first ones of more are the same.

        Examples
        --------
        >>> from chaosgym.diagnosis.start_box import StartBox
        >>> StartBox(np.array([1e-3, 1e-2]), 3.0, "gaps").draw(48, seed=0).shape
        (48, 2)
        """
        uniform = np.random.default_rng(seed).uniform(-1.0, 1.0, (count, len(self.scale) + 1))
        return np.asarray(self.reach * np.abs(uniform[:, :1]) * uniform[:, 1:] * self.scale)


def start_box(machine: Machine, record: CycleRecord) -> StartBox:
    """Box of a machine, from its equations and a run from rest.

    Parameters
    ----------
    machine
        At its speed.
    record
        A run from rest, its transient included.

    Examples
    --------
    >>> from chaosgym.diagnosis.start_box import start_box
    >>> beam = chaosgym.ImpactBeam()
    >>> start_box(beam, chaosgym.simulate(beam, 32)).scale.shape
    (12,)
    """
    half, omega = machine.n_velocities, 2.0 * math.pi / machine.cycle_period
    flexible = machine.without_friction
    rates = np.full(half, omega) if flexible is None else np.sqrt(flexible.stiffness)
    swing = np.where(rates > 0.0, rates, omega)
    places, speeds = record.states[:, :half], record.states[:, half : 2 * half]
    moved = np.max(np.hypot(places, speeds / swing), axis=0)
    to_stops = _to_stops(machine, swing)
    scale = np.max([moved, *to_stops], axis=0)
    gaps = max((float(matrices.norm(swing * shape)) for shape in to_stops), default=0.0)
    measure = "gaps" if gaps >= float(matrices.norm(swing * moved)) else "times the motion"
    velocity = np.maximum(swing, omega) * scale
    rest = np.zeros(machine.n_states - 2 * half)
    return StartBox(np.concatenate([scale, velocity, rest]), _reach(flexible, velocity), measure)


def _to_stops(machine: Machine, swing: Array) -> list[Array]:
    """Displacements (n,) that bring each joint to its farthest stop with the least energy."""
    stops = [] if machine.kinematics is None else machine.kinematics.stops
    shapes = [(np.abs(row) / swing**2, float(np.sum((row / swing) ** 2)), gap) for row, gap in stops]
    return [gap * shape / compliance for shape, compliance, gap in shapes if compliance > 0.0]


def _reach(flexible: Flexible | None, velocity: Array) -> float:
    if flexible is None:
        return LEAST_REACH
    force = np.sum(np.linalg.norm(flexible.drive, axis=1), axis=0)
    damping = np.diagonal(flexible.damping)
    with np.errstate(divide="ignore", invalid="ignore"):
        thrown = np.where(force > 0.0, force / damping, 0.0)
        reach = float(matrices.norm(thrown) / matrices.norm(velocity))
    return float(np.clip(np.nan_to_num(reach, nan=LEAST_REACH), LEAST_REACH, LARGEST_REACH))
