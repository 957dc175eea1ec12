r"""Lyapunov exponents, per cycle and per second: the rate at which neighbouring motions part or meet.

    value = lim  1/N  log |w(N)| / |w(0)|         w: a small deviation of the state, N cycles

Where that is cheap w is carried exactly, through contacts by saltation matrices. Elsewhere a
second trajectory starts at a small distance and is brought back to it each cycle (Benettin). ``series.exponent`` has
the estimate from a measured series.

A forced machine has no exponent of zero from the direction of the flow: a periodic response has a negative largest
exponent, and zero means a torus or a bifurcation.

References
----------
G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9-30.
"""

import math

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.machines import Machine
from chaosgym.machines.ignorable import ignorable, relative
from chaosgym.machines.modal_impact import ModalImpactMachine
from chaosgym.series.exponent import ROUND_OFF, LyapunovExponent, average_growth
from chaosgym.simulation import (
    CycleRecord,
    ExactEvents,
    Integrator,
    MotionState,
    begin_state,
    rest_state,
    simulate,
    simulate_with_deviations,
)
from chaosgym.simulation.record import joined

DISTANCE = 1e-7
"""Distance of the second trajectory, relative to the size of the motion."""

ROUNDING = 1e-15
"""Distance below which two trajectories have met; the second one then starts anew."""


def _any_direction(dimension: int) -> Array:
    return np.asarray(matrices.cos(1.0 + np.arange(dimension)))


class Deviation:
    """A motion and one small deviation that travels with it; call ``run`` again and again to go on.

    Attributes
    ----------
    state : MotionState
        Where the motion is.
    """

    def __init__(
        self,
        machine: Machine,
        initial_state: MotionState | ArrayLike | None = None,
        integrator: Integrator | None = None,
    ) -> None:
        rest = begin_state(machine)
        given = rest if initial_state is None else initial_state
        self.state = given if isinstance(given, MotionState) else MotionState(np.array(given, float), rest.bouncing)
        self._machine = machine
        self._integrator = integrator
        self._direction: Array = _any_direction(len(rest.coordinates))
        self._scale: Array | None = None

    @property
    def round_off(self) -> float:
        """Exponent per cycle that rounding alone may give: of a second trajectory, its distance holds few digits."""
        return ROUND_OFF if self.exact else ROUNDING / DISTANCE

    @property
    def exact(self) -> bool:
        """True where the deviation travels in the run of the motion; else it is a second trajectory."""
        exact = self._integrator is None or isinstance(self._integrator, ExactEvents)
        return exact and not self._machine.moving.costly

    def run(self, cycles: int) -> tuple[CycleRecord, Array]:
        """Run on; return the record and the logarithm of the deviation's growth in each cycle, (cycles,)."""
        if self.exact and cycles > 1 and ignorable(self._machine) is not None:
            # what no force depends on would outgrow the rest of a deviation
            runs = [self.run(1) for _ in range(cycles)]
            return joined([record for record, _ in runs]), np.concatenate([growth for _, growth in runs])
        if self.exact:
            integrator = self._integrator if isinstance(self._integrator, ExactEvents) else None
            record, vectors, growth = simulate_with_deviations(
                self._machine, cycles, self.state, deviations=self._direction, integrator=integrator
            )
            self._direction, log_growth = relative(self._machine, vectors[0]), growth[:, 0]
        else:
            record = simulate(self._machine, cycles, self.state, integrator=self._integrator)
            log_growth = self._second_trajectory(record)
        self.state = record.final_state
        return record, log_growth

    def _second_trajectory(self, record: CycleRecord) -> Array:
        states = np.vstack([record.section, record.final_state.coordinates])
        if self._scale is None:
            largest = np.max(np.abs(states), axis=0)
            self._scale = np.where(largest > 0.0, largest, 1.0)
            self._direction = self._scale * self._direction
        log_growth = np.empty(len(record))
        for cycle in range(len(record)):
            length = float(matrices.norm(self._direction / self._scale))
            start = states[cycle] + DISTANCE / length * self._direction
            end = simulate(self._machine, 1, start, integrator=self._integrator).final_state.coordinates
            self._direction = relative(self._machine, end - states[cycle + 1])
            distance = float(matrices.norm(self._direction / self._scale))
            log_growth[cycle] = math.log(max(distance, ROUNDING) / DISTANCE)
            if distance < ROUNDING:
                self._direction = self._scale * _any_direction(len(self._scale))
        return log_growth


def largest_lyapunov_exponent(
    machine: Machine,
    cycles: int = 1000,
    *,
    transient: int = 200,
    initial_state: MotionState | ArrayLike | None = None,
    integrator: Integrator | None = None,
) -> LyapunovExponent:
    """Largest Lyapunov exponent of a machine's motion.

    Parameters
    ----------
    machine
        What to run.
    cycles, transient
        Cycles to average, at least 40, and to run before; the deviation settles during the transient too.
    initial_state
        Rest by default.
    integrator
        With ``RungeKutta4`` the beam too takes two trajectories.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0)
    >>> round(chaosgym.diagnosis.largest_lyapunov_exponent(beam, cycles=200).per_cycle, 3)
    -1.477
    """
    deviation = Deviation(machine, initial_state, integrator)
    if transient:
        deviation.run(transient)
    return average_growth(deviation.run(cycles)[1], machine.cycle_period, deviation.round_off)


def lyapunov_spectrum(
    machine: ModalImpactMachine,
    cycles: int = 200,
    *,
    transient: int = 200,
    initial_state: MotionState | ArrayLike | None = None,
) -> tuple[Array, float]:
    """All exponents of a machine of modes per cycle, descending, (n_states,), and the sum that its damping demands.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0)
    >>> exponents, demanded = chaosgym.diagnosis.lyapunov_spectrum(beam)
    >>> bool(np.isclose(exponents.sum(), demanded))
    True
    """
    states = len(rest_state(machine).coordinates)
    first, vectors, _ = simulate_with_deviations(machine, max(1, transient), initial_state, deviations=np.eye(states))
    record, _, growth = simulate_with_deviations(machine, cycles, first.final_state, deviations=vectors)
    contact_time = record.contact_fraction.mean(axis=0) * machine.cycle_period
    return np.asarray(growth.mean(axis=0)), machine.contraction(contact_time)
