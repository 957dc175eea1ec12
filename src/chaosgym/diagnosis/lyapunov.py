r"""Lyapunov exponents, per cycle and per second: the rate at which neighbouring motions part or meet.

    value = lim  1/N  log |w(N)| / |w(0)|         w: a small deviation of the state, N cycles

On a machine that ``carries_deviations`` w is carried exactly, through contacts by saltation matrices. On any other a
second trajectory starts at a small distance and is brought back to it each cycle (Benettin). On a measured series the
mean divergence of nearest neighbours serves (Rosenstein), which needs a few thousand cycles and sees neither weak chaos
nor decay.

A forced machine has no exponent of zero from the direction of the flow: a periodic response has a negative largest
exponent, and zero means a torus or a bifurcation.

References
----------
G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Meccanica 15 (1980) 9-30.
M. T. Rosenstein, J. J. Collins, C. J. De Luca, Physica D 65 (1993) 117-134.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.stroboscopic import as_samples
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.machines.modal_impact import ModalImpactMachine
from chaosgym.simulation import (
    CycleRecord,
    ExactEvents,
    Integrator,
    MotionState,
    rest_state,
    simulate,
    simulate_with_deviations,
)

DISTANCE = 1e-7
"""Distance of the second trajectory, relative to the size of the motion."""

ROUNDING = 1e-15
"""Distance below which two trajectories have met; the second one then starts anew."""

ROUND_OFF = 1e-12
"""Exponent per cycle that rounding alone may give to a deviation that is carried exactly."""

POLYNOMIAL = float(np.log(4.0))
"""Logarithm of the growth of a deviation that goes with the square of time, while the time doubles."""

BLOCKS = 20
"""Blocks whose scatter gives the standard error."""


@dataclass(frozen=True, kw_only=True)
class LyapunovExponent:
    """A largest Lyapunov exponent with its uncertainty.

    Attributes
    ----------
    per_cycle
        Mean logarithm of the growth of a deviation in one cycle.
    standard_error
        Of ``per_cycle``, from the scatter of block means; the larger of the values for 20 and for 10 blocks.
    cycle_period
        Duration of a cycle [s]; 1 where time counts in cycles.
    history : (blocks,)
        Means of successive blocks: they show a drift that the standard error hides.
    cycles
        Number of cycles averaged.
    round_off
        Value that rounding alone may give.
    """

    per_cycle: float
    standard_error: float
    cycle_period: float
    history: tuple[float, ...] = field(repr=False)
    cycles: int
    round_off: float = ROUND_OFF

    @property
    def per_second(self) -> float:
        """Exponent per second [1/s]."""
        return self.per_cycle / self.cycle_period

    @property
    def sign(self) -> int:
        """+1 or -1 where the exponent differs from zero by more than three standard errors and rounding, else 0.

        A positive one must also make more of a deviation than the square of time does, as in conserved motions.
        """
        certain = abs(self.per_cycle) > max(3.0 * self.standard_error, self.round_off)
        grows = self.per_cycle * self.cycles > POLYNOMIAL
        return int(np.sign(self.per_cycle)) if certain and (grows or self.per_cycle < 0.0) else 0

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "value": self.per_cycle,
            "standard_error": self.standard_error,
            "per_second": self.per_second,
            "cycles": self.cycles,
            "history": list(self.history),
        }


def average_growth(log_growth: ArrayLike, cycle_period: float = 1.0, round_off: float = ROUND_OFF) -> LyapunovExponent:
    """Exponent from the logarithms of the growth in successive cycles, (cycles,); ``round_off`` as in the result."""
    growth = as_samples(log_growth, minimum=2 * BLOCKS)[:, 0]

    def means(blocks: int) -> Array:
        length = len(growth) // blocks
        return np.asarray(growth[len(growth) - blocks * length :].reshape(blocks, length).mean(axis=1))

    error = max(float(np.std(means(count), ddof=1) / np.sqrt(count)) for count in (BLOCKS, BLOCKS // 2))
    return LyapunovExponent(
        per_cycle=float(growth.mean()),
        standard_error=error,
        cycle_period=cycle_period,
        history=tuple(float(value) for value in means(BLOCKS)),
        cycles=len(growth),
        round_off=round_off,
    )


def _any_direction(dimension: int) -> Array:
    return np.asarray(np.cos(1.0 + np.arange(dimension)))


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
        rest = rest_state(machine)
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
        return self._machine.carries_deviations and exact

    def run(self, cycles: int) -> tuple[CycleRecord, Array]:
        """Run on; return the record and the logarithm of the deviation's growth in each cycle, (cycles,)."""
        if self.exact:
            integrator = self._integrator if isinstance(self._integrator, ExactEvents) else None
            record, vectors, growth = simulate_with_deviations(
                self._machine, cycles, self.state, deviations=self._direction, integrator=integrator
            )
            self._direction, log_growth = vectors[0], growth[:, 0]
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
            length = float(np.linalg.norm(self._direction / self._scale))
            start = states[cycle] + DISTANCE / length * self._direction
            end = simulate(self._machine, 1, start, integrator=self._integrator).final_state.coordinates
            self._direction = end - states[cycle + 1]
            distance = float(np.linalg.norm(self._direction / self._scale))
            log_growth[cycle] = np.log(max(distance, ROUNDING) / DISTANCE)
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


def exponent_from_series(
    series: ArrayLike, *, dimension: int = 3, steps: int = 8, cycle_period: float = 1.0
) -> LyapunovExponent:
    """Largest exponent of a measured series of one sample a cycle, by the divergence of nearest neighbours.

    Parameters
    ----------
    series : (cycles,)
        Settled and nearly free of noise; 1000 cycles or more.
    dimension
        Number of successive samples that make a point.
    steps
        Cycles over which neighbours are followed.

    Raises
    ------
    DiagnosisError
        If there are fewer than 500 cycles, the series is constant, or neighbours are as far apart at the start as they
        ever get, as in noise.

    Notes
    -----
    Good to about a fifth for strong chaos. It can't see a negative exponent: for a periodic series there is no
    divergence to follow. It underestimates where a step of one cycle already fills the attractor (exponents near or
    above 1), and takes sensor noise for divergence.

    Examples
    --------
    >>> x = [0.3]
    >>> for _ in range(1999):
    ...     x.append(4.0 * x[-1] * (1.0 - x[-1]))  # the logistic map, whose exponent is ln 2 = 0.693
    >>> round(chaosgym.diagnosis.exponent_from_series(x).per_cycle, 2)
    0.69
    """
    x = as_samples(series, minimum=500)[:, 0]
    spread = float(np.std(x))
    if spread <= 1e-9 * float(np.max(np.abs(x))):
        raise DiagnosisError("the series is constant; allowed: a series that varies")
    points = np.lib.stride_tricks.sliding_window_view(x / spread, dimension)
    usable = len(points) - steps
    from scipy.spatial import cKDTree

    distances, partners = cKDTree(points[:usable]).query(points[:usable], k=12)
    apart = np.abs(partners - np.arange(usable)[:, None]) > dimension
    apart &= distances > 1e-12
    first = np.argmax(apart, axis=1)
    kept = np.flatnonzero(apart.any(axis=1))
    if len(kept) < usable // 2:
        raise DiagnosisError("the series repeats: neighbours do not part, and there is no exponent to measure")
    partner = partners[kept, first[kept]]
    # distances of the newest sample of each point: no delay between divergence and cycle
    gaps = np.abs(
        x[kept[:, None] + dimension - 1 + np.arange(steps)] - x[partner[:, None] + dimension - 1 + np.arange(steps)]
    )
    logs = np.log(np.maximum(gaps / spread, 1e-12))
    curve = logs.mean(axis=0)
    ceiling = float(np.mean(np.log(np.abs(np.subtract.outer(x[::7], x[3::7])) / spread + 1e-12)))
    rising = np.flatnonzero(curve > ceiling - 1.0)
    last = max(2, int(rising[0]) if len(rising) else steps - 1)
    if curve[0] > ceiling - 1.0:
        raise DiagnosisError("nearest neighbours are as far apart as any two points: noise, or far too few cycles")
    growth = (logs[:, last] - logs[:, 0]) / last
    return average_growth(growth, cycle_period)
