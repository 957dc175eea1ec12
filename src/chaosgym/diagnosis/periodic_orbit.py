r"""Proof of a periodic response: Newton's method on the map of k cycles, and its Floquet multipliers.

    y <- y - (M - I)^-1 (P(y) - y)         P: the motion over k cycles, M = dP/dy

An orbit is certified if |P(y) - y| falls below 1e-10 of the orbit's size and every eigenvalue of M lies inside the
unit circle, by more than rounding. Newton's method, like M itself, fails near grazing, where P is not smooth.

Where M costs many runs, as of a worn pin, Broyden's method goes on from each.
"""

import math
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices, status
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.tangent import Tangents
from chaosgym.diagnosis.broyden import root_near
from chaosgym.errors import SimulationError
from chaosgym.machines import Machine
from chaosgym.machines.ignorable import relative
from chaosgym.plain import Result
from chaosgym.simulation import CycleRecord, ExactEvents, MotionState, simulate

RESIDUAL = 1e-10
"""Largest miss of a certified orbit, relative to its size."""

CLOSES_WELL = 1e-3 * RESIDUAL
"""Miss at which no further step is worth its runs."""

PRECISE = ExactEvents(event_tolerance=1e-13)
"""Events to rounding error, so that the miss can fall below the limit."""

NEUTRAL = 1e-6
"""How near 1 the largest multiplier of a neutral orbit is: deviations neither grow nor decay, beyond all rounding."""

FINITE_DIFFERENCE = 1e-6
"""Step of the derivative where no exact deviations exist, relative to the size of the coordinate."""

NEAR = 0.05
"""How far Newton's method may move, relative to the size of the motion, to find the orbit that the motion nears."""


@dataclass(frozen=True, kw_only=True)
class PeriodicOrbit(Result):
    """A fixed point of the map of ``period`` cycles.

    Attributes
    ----------
    period
        Cycles.
    state : (n_states,)
        State at the start of a cycle.
    residual
        Miss after one period, relative to the size of the state in energy.
    multipliers : (n_states,) complex
        Floquet multipliers, largest modulus first.
    derivative : (n_states, n_states)
        Of the map of one period: what becomes of small deviations; its eigenvalues are the multipliers.
    distance
        How far the search moved, relative to the size.
    """

    shows = "period residual largest_multiplier distance certified"

    period: int
    state: Array = field(repr=False)
    residual: float
    multipliers: NDArray[np.complex128] = field(repr=False)
    derivative: Array = field(repr=False)
    distance: float

    @property
    def largest_multiplier(self) -> float:
        """Largest modulus of the multipliers: the factor by which deviations change in one period."""
        return float(np.abs(self.multipliers[0]))

    @property
    def certified(self) -> bool:
        """True if the orbit closes and attracts."""
        return self.closes and self.largest_multiplier < 1.0 - NEUTRAL

    @property
    def neutral(self) -> bool:
        """True if the orbit closes, and deviations neither grow nor decay: one of a family that lie side by side."""
        return self.closes and abs(self.largest_multiplier - 1.0) <= NEUTRAL

    @property
    def proven(self) -> bool:
        """True if the orbit closes and does not repel."""
        return self.certified or self.neutral

    @property
    def closes(self) -> bool:
        """True if the orbit closes."""
        return self.residual < RESIDUAL


def find_periodic_orbit(
    machine: Machine, start: MotionState | ArrayLike, period: int, *, iterations: int = 8
) -> PeriodicOrbit | None:
    """Search for a periodic orbit near a state.

    Parameters
    ----------
    machine
        What runs.
    start
        A state near the orbit at the start of a cycle.
    period
        Cycles after which the orbit closes.
    iterations
        Newton steps at most.

    Returns
    -------
    PeriodicOrbit or None
        The best fixed point found, which need not be certified; None if the motion could not be followed.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0)
    >>> near = chaosgym.simulate(beam, cycles=1, transient=50).final_state
    >>> orbit = chaosgym.diagnosis.find_periodic_orbit(beam, near, period=1)
    >>> orbit.certified, round(orbit.largest_multiplier, 4)
    (True, 0.2282)
    """
    given = start.coordinates if isinstance(start, MotionState) else start
    origin = relative(machine, np.array(given, dtype=float))
    state = origin.copy()
    weight = machine.state_weights(origin)
    best: tuple[float, Array, Array] | None = None
    try:
        for _ in range(iterations):
            run, monodromy = period_map(machine, state, period, weight)
            end = run.end
            residual = _share(weight * (end - state), weight * state)
            if best is not None and residual >= best[0]:
                break
            best = (residual, state, monodromy)
            if residual < CLOSES_WELL:
                break
            step = matrices.solve(monodromy - np.eye(len(state)), end - state)
            if not machine.moving.costly:
                state = state - step
            else:
                state = _neared(machine, state - step, period, monodromy, weight)
    except (SimulationError, np.linalg.LinAlgError):
        pass
    if best is None:
        return None
    residual, state, monodromy = best
    multipliers = matrices.eigvals(monodromy)
    return PeriodicOrbit(
        period=period,
        state=state,
        residual=residual,
        multipliers=np.asarray(multipliers[np.argsort(-matrices.modulus(multipliers), kind="stable")], dtype=complex),
        derivative=monodromy,
        distance=_share(weight * (state - origin), weight * origin),
    )


def _neared(machine: Machine, state: Array, period: int, monodromy: Array, weight: Array) -> Array:
    """A state (n_states,) nearer to an orbit by Broyden's method, from the derivative of the map nearby."""
    derivative = monodromy * weight[:, None] / weight - np.eye(len(weight))
    closed = CLOSES_WELL * float(matrices.norm(weight * state))
    root = root_near(
        lambda z: weight * run_period(machine, z / weight, period).end - z, weight * state, derivative, closed
    )
    return root.x / weight


def _share(change: Array, whole: Array) -> float:
    """Size of a change as a share of the whole: 0 where nothing changes, also of a machine at rest."""
    size = float(matrices.norm(change))
    return size / float(matrices.norm(whole)) if np.any(whole) else math.inf if size else 0.0


class Period(NamedTuple):
    """One period of a motion: its final state (n_states,), and what happened in each cycle."""

    end: Array
    arrays: CycleArrays


def run_period(machine: Machine, state: Array, period: int, tangents: Tangents | None = None) -> Period:
    """Run over one period from a state; ``tangents`` travel along. Both are told less what no force depends on.

    It is ``simulate`` without what a few cycles do not need: slices for Ctrl-C, and a record.

    Raises
    ------
    SimulationError
        If the run can't be finished.
    """
    coordinates, bouncing = np.array(state), np.zeros(3 * max(1, len(machine.joints)))
    if not np.all(np.isfinite(coordinates)):
        raise SimulationError("the search leads to numbers beyond all bounds")
    arrays = machine.arrays(period)
    outcome, _ = machine.run(coordinates, bouncing, arrays, PRECISE, tangents)
    if outcome != status.OK:
        raise SimulationError(f"{status.MESSAGES[outcome]}; it can't be followed over {period} cycles")
    if tangents is not None:
        tangents.vectors[:] = relative(machine, tangents.vectors)
    return Period(relative(machine, coordinates), arrays)


def period_map(machine: Machine, state: Array, period: int, weight: Array) -> tuple[Period, Array]:
    """Run over one period from a state, and the derivative (n_states, n_states) of its final state.

    ``weight`` (n_states,) scales the differences that stand for the derivative where no exact deviations exist.
    """
    if machine.moving.deviations:
        along = Tangents(np.eye(len(state)), np.empty((period, 0)))
        run = run_period(machine, state, period, along)
        return run, np.ascontiguousarray(along.vectors.T)
    derivative = np.empty((len(state), len(state)))
    for i in range(len(state)):
        step = FINITE_DIFFERENCE / weight[i]
        pair = []
        for sign in (1.0, -1.0):
            moved = np.array(state)
            moved[i] += sign * step
            pair.append(run_period(machine, moved, period).end)
        derivative[:, i] = (pair[0] - pair[1]) / (2.0 * step)
    return run_period(machine, state, period), derivative


def proven_orbit(machine: Machine, record: CycleRecord, period: int) -> tuple[PeriodicOrbit | None, int]:
    """The orbit that a motion approaches, if Newton's method proves one of this period, and the cycles that took.

    It attracts or is neutral.
    """
    found = find_periodic_orbit(machine, record.final_state, period)
    if found is None or not found.proven or not _approaches(machine, record, found):
        return None, 8 * period
    return primitive(machine, found), 14 * period


def returning_period(section: Array, longest: int, seen: int = 4, back: float = 0.0) -> int:
    """Period, at most ``longest``, after which the last ``seen`` states of a section (cycles, n_states) come back best.

    A state that is nearer than ``back``, relative to the size of the motion, has come back.
    """
    states = section / np.ptp(section, axis=0).clip(1e-300)
    last = states[-seen:]
    periods = range(1, min(longest, len(states) // 2) + 1)
    gaps = np.array([matrices.norm(last - states[-seen - k : -k]) for k in periods])
    return int(np.argmax(gaps <= max(1.5 * float(gaps.min()), back))) + 1


def primitive(machine: Machine, orbit: PeriodicOrbit) -> PeriodicOrbit:
    """The orbit with its smallest period: a multiple of it closes too."""
    if orbit.period == 1:
        return orbit
    states = simulate(machine, orbit.period, orbit.state).states
    size = np.maximum(np.abs(orbit.state), 1e-9 * np.max(np.abs(orbit.state)))
    for divisor in (d for d in range(1, orbit.period) if orbit.period % d == 0):
        if np.max(np.abs(states[divisor] - orbit.state) / size) < 1e-4:
            shorter = find_periodic_orbit(machine, orbit.state, divisor)
            if shorter is not None and shorter.proven:
                return replace(shorter, distance=orbit.distance)
    return orbit


def _approaches(machine: Machine, record: CycleRecord, orbit: PeriodicOrbit) -> bool:
    """True if the motion is near the orbit, and nearer four periods later unless it is there already."""
    if orbit.distance > NEAR:
        return False
    if orbit.distance < 1e-6:
        return True
    later = relative(machine, simulate(machine, 4 * orbit.period, record.final_state).final_state.coordinates)
    now = relative(machine, record.final_state.coordinates) - orbit.state
    size = np.maximum(np.abs(orbit.state), 1e-9 * np.max(np.abs(orbit.state)))
    return bool(matrices.norm((later - orbit.state) / size) < matrices.norm(now / size))
