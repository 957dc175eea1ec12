r"""Periodic orbits of a machine along one of its fields: the equations that continuation solves, and Newton's method.

    F(y, p) = P(y, p) - y = 0        P: the motion over k cycles, p: the field, M = dP/dy carried through contacts

Unknowns are scaled: z = W y / |W y_0| with the weights of energy, s = (p - low) / (high - low). What a machine must
offer is its stroboscopic map with its derivative (``periodic_orbit.period_map``), nothing else.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.core.tangent import Tangents
from chaosgym.diagnosis.broyden import Root, root_near
from chaosgym.diagnosis.periodic_orbit import Period, period_map, run_period
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines import Machine

CLOSED, CLOSELY = 1e-10, 1e-12
"""Miss of an orbit, relative to its size, at which Newton's method stops, and at which it does at a bifurcation."""

MOST_ITERATIONS, FEW_ITERATIONS = 14, 4
"""Of Newton's method, and where each costs many runs and Broyden's method came first."""

MOST_HALVINGS, ROUGH = 3, 1e-2
"""Halvings of a step of Newton's method that makes the miss larger, and the miss above which it is not worth them."""

SLOPE_STEPS = (1e-7, 1e-8)
"""Steps in s of the difference that stands for dP/ds, the next one where the map bends too much, as near grazing.

It errs by 1e-7 or more, and by more where the motion repels. It steers the steps, and moves no orbit that is found and
no multiplier."""

BENT = 0.01
"""Share of such a difference by which its two halves may differ."""

ALIKE, ALIKE_TIME = 1e-7, 1e-4
"""Differences of peak forces and of contact times of both sides that count as none, as shares of the largest.

The time of a grazing contact is good to the root of the orbit's miss only."""

HALVED = 1e-6
"""Distance, relative to the size of the motion, of states half a period apart that are one."""

NOISE = 1e-12
"""Change of s that tells nothing of dP/ds."""


class NotFollowedError(Exception):
    """Newton's method did not reach an orbit; says why."""


@contextmanager
def _told_as_not_followed() -> Iterator[None]:
    """Raise what a run or an equation refuses as an orbit that was not reached."""
    try:
        yield
    except (SimulationError, ParameterError) as error:
        raise NotFollowedError(str(error).split(";")[0]) from error
    except np.linalg.LinAlgError as error:
        raise NotFollowedError("the equations have no single solution there") from error


@dataclass(frozen=True)
class OrbitFamily:
    """Periodic orbits of ``period`` cycles of a machine whose ``field`` lies between ``low`` and ``high``.

    ``weight`` (n,) turns a state into scaled coordinates. ``machines`` gives the machine at a value. ``noise`` is how
    much the map jumps, in these coordinates, when the field moves by nothing to speak of: rounding of a model that is
    computed anew for each value. States lie on the section at ``phase`` cycles after the start of the period; another
    one serves where that meets a contact (``section.py``). Orbits of a ``mirrored`` family do the same on both sides
    half a period apart: their map is the mirror image of half a period, in which no other branch crosses theirs.
    """

    machine: Machine
    field: str
    low: float
    high: float
    period: int
    weight: Array
    machines: Callable[[float], Machine]
    noise: float = 0.0
    phase: float = 0.0
    mirrored: bool = False

    def value(self, s: float) -> float:
        """The field's value at s."""
        return float(self.low + (self.high - self.low) * s)

    def machine_at(self, s: float) -> Machine:
        """The machine at s.

        Raises
        ------
        ParameterError
            If the field's own range ends before.
        """
        machine = self.machines(self.value(s))
        return _on_section(machine, self.phase) if self.phase else machine

    def state(self, x: Array) -> Array:
        """Physical state (n_states,) on the section of scaled unknowns."""
        return np.asarray(x[:-1] / self.weight)

    def start(self, point: OrbitPoint) -> Array:
        """Physical state (n_states,) of an orbit at the start of a cycle."""
        return self._after(point.x, point.x[-1], point.phase, self.period) if point.phase else self.state(point.x)

    def carried(self, point: OrbitPoint, phase: float) -> tuple[Array, Array]:
        """Unknowns (n + 1,) and unit tangent (n + 1,) of an orbit on the section at another phase.

        Raises
        ------
        SimulationError
            If the motion can't be followed.
        """
        x, s, last = point.x, float(point.x[-1]), phase if phase > point.phase else phase + self.period
        low, high = max(s - SLOPE_STEPS[0], 0.0), min(s + SLOPE_STEPS[0], 1.0)
        slope = (self._after(x, high, point.phase, last) - self._after(x, low, point.phase, last)) / (high - low)
        along = Tangents(np.ascontiguousarray((point.tangent[:-1] / self.weight)[None]), np.empty((1, 0)))
        end = self.weight * self._after(x, s, point.phase, last, along)
        moved = self.weight * (along.vectors[0] + slope * point.tangent[-1])
        tangent = np.append(moved, point.tangent[-1])
        return np.append(end, s), tangent / matrices.norm(tangent)

    def _after(self, x: Array, s: float, begun: float, ended: float, along: Tangents | None = None) -> Array:
        """Physical state (n_states,) at one phase of the motion from that of ``x`` at another, with the field at s."""
        machine = _on_section(self.machines(self.value(s)), begun, ended - begun)
        return run_period(machine, self.state(x), 1, along).end

    def with_mirror(self, point: OrbitPoint) -> "tuple[OrbitFamily, OrbitPoint]":
        """The mirrored family and an orbit of it, if the orbit and the machines along the field are symmetric."""
        if not point.symmetric or self.mirrored or not all(self.machine_at(s).mirrors for s in (0.0, 0.5, 1.0)):
            return self, point
        other = replace(self, mirrored=True)
        try:
            return other, other.solve(point.x, point.tangent)
        except NotFollowedError:
            return self, point

    def at_phase(self, phase: float) -> "OrbitFamily":
        """The family on the section at another phase."""
        return self if phase == self.phase else replace(self, phase=phase)

    def solve(
        self,
        guess: Array,
        normal: Array,
        slope: Array | None = None,
        *,
        near: tuple[Array, ...] = (),
        closed: float = CLOSED,
        exact: bool = True,
        measured: bool = True,
        patient: bool = True,
    ) -> OrbitPoint:
        """The orbit nearest to a guess on the plane through it that is normal to ``normal`` (n + 1,).

        The tangent of the point is turned along ``normal``.

        Parameters
        ----------
        slope : (n,)
            dP/ds as far as it is known.
        near : (n, n) each
            Derivatives of the map at orbits nearby, in scaled coordinates. Where a derivative costs several runs,
            Broyden's method starts from each until it converges.
        closed
            Miss that suffices, relative to the size of the motion.
        exact
            Measure dP/ds at the orbit; otherwise what Newton's method learned of it serves.
        measured
            Measure the derivative of the map too; otherwise what Broyden's method learned of it serves where it
            converged, and the multipliers are rough.
        patient
            Go on by Newton's method where Broyden's does not converge.

        Raises
        ------
        NotFollowedError
            If there is none near, or the motion can't be followed.
        """
        with _told_as_not_followed():
            iterations = MOST_ITERATIONS
            if near and slope is not None and self.machine.moving.costly:
                root = self._neared(guess, normal, slope, near, closed)
                guess, slope = root.x, root.derivative[:, -1]
                if root.miss <= max(closed, 4.0 * self.noise) and not measured:
                    _, cycles, machine = self._turn(guess[-1])
                    run = run_period(machine, self.state(guess), cycles)
                    return self._point(guess, root.derivative[:, :-1], slope, run, normal, measured=False)
                if not patient and not root.miss < CLOSED:
                    raise NotFollowedError("Broyden's method does not converge")
                closed, iterations = max(closed, root.miss) if root.miss < CLOSED else closed, FEW_ITERATIONS
            x, matrix, slope, run = self._solve(guess, normal, slope, closed, iterations)
            return self._point(x, matrix, self.slope(x, run.end) if exact else slope, run, normal)

    def measured(self, point: OrbitPoint, *, exact: bool = True) -> OrbitPoint:
        """An orbit with its derivative measured, and dP/ds where ``exact``.

        Raises
        ------
        NotFollowedError
            If the motion can't be followed.
        """
        if point.measured:
            return point
        with _told_as_not_followed():
            along = point.tangent
            x, matrix, slope, run = self._solve(point.x, along, point.slope, CLOSED, FEW_ITERATIONS)
            return self._point(x, matrix, self.slope(x, run.end) if exact else slope, run, along)

    def _neared(self, guess: Array, normal: Array, slope: Array, near: tuple[Array, ...], closed: float) -> Root:
        """Unknowns nearer to an orbit by Broyden's method, from the first derivative nearby with which it converges.

        The miss is relative to the size of the motion, and the derivative is that of the map.
        """
        size = max(float(matrices.norm(guess[:-1])), 1e-300)
        closed, one = max(closed, 4.0 * self.noise), np.eye(len(slope), len(guess))
        best: Root | None = None
        for each in near:
            derivative = np.column_stack([each, slope]) - one
            root = root_near(self.miss, guess, derivative, closed * size, normal)
            root = root._replace(derivative=root.derivative + one, miss=root.miss / size)
            best = root if best is None or root.miss < best.miss else best
            if best.miss <= closed:
                break
        assert best is not None
        return best

    def _solve(
        self, guess: Array, normal: Array, slope: Array | None, closed: float, iterations: int
    ) -> tuple[Array, Array, Array, Period]:
        """(x, matrix, slope, run) of an orbit."""
        x, last = guess, np.inf
        enough, closed = max(CLOSED, 4.0 * self.noise), max(closed, 4.0 * self.noise)
        miss, matrix, run = self._map(x)
        slope = self.slope(x, run.end) if slope is None else slope
        for _ in range(iterations):
            size = float(matrices.norm(miss)) / max(float(matrices.norm(x[:-1])), 1e-300)
            if not np.isfinite(size) or size > 2.0 * max(last, 1e-2):
                break
            if size <= closed or (size < enough and size > 0.1 * last):
                return x, matrix, slope, run
            wanted = -np.append(miss, product(normal, x - guess))
            step = np.asarray(matrices.solve(_bordered(matrix, slope, normal), wanted), dtype=float)
            last, before = size, matrix
            x, change, (miss, matrix, run) = self._damped(x, step, size)
            if abs(change[-1]) > max(NOISE, 100.0 * self.noise):
                # the new miss tells more of dP/ds than a difference does near grazing
                slope = slope + (miss - 0.5 * product(matrix - before, change[:-1])) / change[-1]
        raise NotFollowedError("Newton's method does not converge")

    def _damped(self, x: Array, change: Array, size: float) -> tuple[Array, Array, tuple[Array, Array, Period]]:
        """x after a step of Newton's method, the step, and the map there.

        The step is halved while it makes the miss larger: at grazing it overshoots from one side to the other.
        """
        enough = size * max(float(matrices.norm(x[:-1])), 1e-300)
        derived = not self.machine.moving.costly
        for halvings in range(MOST_HALVINGS + 1):
            found = self._map(x + change) if derived else None
            miss = self.miss(x + change) if found is None else found[0]
            if float(matrices.norm(miss)) < enough or size > ROUGH or halvings == MOST_HALVINGS:
                break
            change = 0.5 * change
        return x + change, change, found or self._map(x + change)

    def _point(
        self, x: Array, matrix: Array, slope: Array, run: Period, along: Array, measured: bool = True
    ) -> OrbitPoint:
        tangent = matrices.solve(_bordered(matrix, slope, along), np.append(np.zeros(len(matrix)), 1.0))
        force, spent = run.arrays.peak_force.max(axis=0), run.arrays.contact_time.sum(axis=0)
        if self.mirrored:
            force, spent = np.full_like(force, force.max()), np.full_like(spent, spent.sum())
        alike = all(
            np.all(np.abs(both[::2] - both[1::2]) <= share * max(both.max(), 1e-300))
            for both, share in ((force, ALIKE), (spent, ALIKE_TIME))
        )
        return OrbitPoint(
            x=x,
            matrix=product(matrix, matrix) if self.mirrored else matrix,
            solved=matrix,
            slope=slope,
            tangent=tangent / matrices.norm(tangent),
            impacts=self._contacts(run),
            peaks=force,
            symmetric=alike and self.period % 2 == 1 and float(force.max()) > 0.0,
            halved=self.period % 2 == 0 and self._same(run.arrays.section[self.period // 2], run.arrays.section[0]),
            phase=self.phase,
            measured=measured,
        )

    def _same(self, one: Array, other: Array) -> bool:
        """True if two physical states are one."""
        size = float(matrices.norm(self.weight * other))
        return float(matrices.norm(self.weight * (one - other))) <= HALVED * max(size, 1e-300)

    def _map(self, x: Array) -> tuple[Array, Array, Period]:
        """Miss of a scaled state, derivative of the map and the run."""
        sign, cycles, machine = self._turn(x[-1])
        run, matrix = period_map(machine, self.state(x), cycles, self.weight)
        return sign * self.weight * run.end - x[:-1], sign * matrix * self.weight[:, None] / self.weight, run

    def _turn(self, s: float) -> tuple[float, int, Machine]:
        """Sign of the map, and what runs for how many of its cycles."""
        if self.mirrored:
            return -1.0, 1, _on_section(self.machines(self.value(s)), self.phase, 0.5 * self.period)
        return 1.0, self.period, self.machine_at(s)

    def _contacts(self, run: Period) -> tuple[int, ...]:
        """Contacts that begin in a period, of each side."""
        counts = contacts_of(run)
        return tuple(sum(counts) for _ in counts) if self.mirrored else counts

    def slope(self, x: Array, ended: Array) -> Array:
        """dP/ds (n,) where a run began that ``ended`` (n_states,), by a central difference; just inside the range."""
        least = np.sqrt(self.noise)
        for step in (max(step, least) for step in SLOPE_STEPS):
            middle = float(np.clip(x[-1], step, 1.0 - step))
            low, high = (self.end(x, middle + side) for side in (-step, step))
            sign = -1.0 if self.mirrored else 1.0
            bend = matrices.norm(low + high - 2.0 * sign * self.weight * ended) if middle == x[-1] else 0.0
            if bend < BENT * matrices.norm(high - low):
                break
        return np.asarray((high - low) / (2.0 * step))

    def end(self, x: Array, s: float) -> Array:
        """Scaled state (n,) that the map makes of that of ``x``, with the field at s."""
        sign, cycles, machine = self._turn(s)
        return np.asarray(sign * self.weight * run_period(machine, self.state(x), cycles).end)

    def impacts(self, x: Array) -> tuple[int, ...]:
        """Contacts that begin in one period from scaled unknowns, of each side.

        Raises
        ------
        NotFollowedError
            If the motion can't be followed.
        """
        with _told_as_not_followed():
            _, cycles, machine = self._turn(x[-1])
            return self._contacts(run_period(machine, self.state(x), cycles))

    def tangent(self, x: Array, along: Array) -> Array:
        """Unit tangent (n + 1,) of the orbits of the map as it is at x, near an orbit, turned along ``along``.

        Raises
        ------
        NotFollowedError
            If the motion can't be followed, or the tangent is not determined.
        """
        with _told_as_not_followed():
            _, matrix, run = self._map(x)
            slope = self.slope(x, run.end)
            tangent = matrices.solve(_bordered(matrix, slope, along), np.append(np.zeros(len(matrix)), 1.0))
        return np.asarray(tangent / matrices.norm(tangent))

    def miss(self, x: Array) -> Array:
        """Miss (n,) of scaled unknowns after one period."""
        return self.end(x, x[-1]) - x[:-1]

    def with_period(self, period: int) -> "OrbitFamily":
        """The family of another period."""
        return replace(self, period=period)


def _bordered(matrix: Array, slope: Array, normal: Array) -> Array:
    """Derivative of the equations of an orbit on a plane, (n + 1, n + 1)."""
    n = len(matrix)
    system = np.empty((n + 1, n + 1))
    system[:n, :n] = matrix
    system.flat[: n * (n + 1) : n + 2] -= 1.0
    system[:n, n], system[n] = slope, normal
    return system


def _on_section(machine: Machine, phase: float, share: float = 1.0) -> Machine:
    """The machine whose cycles begin at a phase, for one that ``moves_section``."""
    other = machine.section_at(phase, share)
    assert other is not None
    return other


def contacts_of(run: Period) -> tuple[int, ...]:
    """Contacts that begin in a period, of each side."""
    return tuple(run.arrays.impacts.sum(axis=0).tolist())
