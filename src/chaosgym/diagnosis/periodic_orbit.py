r"""Proof of a periodic response: Newton's method on the map of k cycles, and its Floquet multipliers.

    y <- y - (M - I)^-1 (P(y) - y)         P: the motion over k cycles, M = dP/dy

An orbit is certified if |P(y) - y| falls below 1e-10 of the orbit's size and every eigenvalue of M lies inside the
unit circle. Newton's method, like M itself, fails near grazing, where P is not smooth.
"""

import math
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.core import status
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.tangent import Tangents
from chaosgym.errors import SimulationError
from chaosgym.machines import Machine
from chaosgym.simulation import ExactEvents, MotionState

RESIDUAL = 1e-10
"""Largest miss of a certified orbit, relative to its size."""

PRECISE = ExactEvents(event_tolerance=1e-13)
"""Events to rounding error, so that the miss can fall below the limit."""

FINITE_DIFFERENCE = 1e-6
"""Step of the derivative where no exact deviations exist, relative to the size of the coordinate."""


@dataclass(frozen=True, kw_only=True)
class PeriodicOrbit:
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
        return self.residual < RESIDUAL and self.largest_multiplier < 1.0

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "period": self.period,
            "residual": self.residual,
            "largest_multiplier": self.largest_multiplier,
            "distance": self.distance,
            "certified": self.certified,
        }


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
    origin = np.array(start.coordinates if isinstance(start, MotionState) else start, dtype=float)
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
            if residual < 1e-3 * RESIDUAL:
                break
            state = state - np.linalg.solve(monodromy - np.eye(len(state)), end - state)
    except (SimulationError, np.linalg.LinAlgError):
        pass
    if best is None:
        return None
    residual, state, monodromy = best
    multipliers = np.linalg.eigvals(monodromy)
    return PeriodicOrbit(
        period=period,
        state=state,
        residual=residual,
        multipliers=np.asarray(multipliers[np.argsort(-np.abs(multipliers))], dtype=complex),
        derivative=monodromy,
        distance=_share(weight * (state - origin), weight * origin),
    )


def _share(change: Array, whole: Array) -> float:
    """Size of a change as a share of the whole: 0 where nothing changes, also of a machine at rest."""
    size = float(np.linalg.norm(change))
    return size / float(np.linalg.norm(whole)) if np.any(whole) else math.inf if size else 0.0


class Period(NamedTuple):
    """One period of a motion: its final state (n_states,), and what happened in each cycle."""

    end: Array
    arrays: CycleArrays


def run_period(machine: Machine, state: Array, period: int, tangents: Tangents | None = None) -> Period:
    """Run over one period from a state; ``tangents`` travel along.

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
    return Period(coordinates, arrays)


def period_map(machine: Machine, state: Array, period: int, weight: Array) -> tuple[Period, Array]:
    """Run over one period from a state, and the derivative (n_states, n_states) of its final state.

    ``weight`` (n_states,) scales the differences that stand for the derivative where no exact deviations exist.
    """
    if machine.carries_deviations:
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
