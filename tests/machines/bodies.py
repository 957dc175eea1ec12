"""Bodies between stops in SciPy: an independent program for machines' files, in the bodies' own coordinates.

Every change of contact is located by an event, at which the integration stops and begins anew.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp


class Surface(NamedTuple):
    """A stop along a row of displacements (n,), where ``row @ x`` exceeds ``at`` [m].

    Its force is ``stiffness`` p^``exponent`` + ``damping`` p', or with a ``loss`` K p^n (1 + loss p'), never below 0.
    Each newton of it also pulls back by ``drag`` (n,) at time t, as friction does.
    """

    row: np.ndarray
    at: float
    stiffness: float
    damping: float = 0.0
    exponent: float = 1.0
    loss: float | None = None
    drag: Callable | None = None

    def force(self, x, v):
        """Force, without the rule that it never pulls, continued out of reach."""
        elastic, rate = self.spring(x), self.row @ v
        return elastic * (1.0 + self.loss * rate) if self.loss is not None else elastic + self.damping * rate

    def spring(self, x):
        """Force without what it loses."""
        depth = self.row @ x - self.at
        return self.stiffness * depth * abs(depth) ** (self.exponent - 1.0)

    def energy(self, x):
        """Of its spring at a place."""
        depth = self.row @ x - self.at
        return self.stiffness * max(depth, 0.0) ** (self.exponent + 1.0) / (self.exponent + 1.0)


class Bodies(NamedTuple):
    """``mass``, ``damping`` and ``stiffness`` (n, n), what pulls at time t, (n,), and surfaces."""

    mass: np.ndarray
    damping: np.ndarray
    stiffness: np.ndarray
    pull: Callable
    surfaces: list[Surface]

    def motion(self, state, instants, tolerance=1e-12, steps=400):
        """States (len(instants), 2n) from the first instant on."""
        return self._run(state, instants, tolerance, steps)[0]

    def energy(self, state):
        """Of masses, springs and pressed surfaces."""
        x, v = np.split(state, 2)
        held = 0.5 * float(v @ self.mass @ v + x @ self.stiffness @ x)
        pressed = (each for each in self.surfaces if self._phase(each, state) == PRESSED)
        return held + sum(each.energy(x) for each in pressed)

    def balance(self, state, period, size, steps=400):
        """State after a period, and work done, energy lost, and both without their signs; ``size`` of an energy."""
        states, totals = self._run(state, [0.0, period], 1e-12, steps, 1e-13 * size)
        return states[-1], *totals

    def _run(self, state, instants, tolerance, steps, small=None):
        n, inverse = len(self.mass), np.linalg.inv(self.mass)
        time, end, wanted = instants[0], instants[-1], list(instants[1:])
        state, extra = np.array(state, float), 0 if small is None else 3
        found, phases = [state], [self._phase(surface, state) for surface in self.surfaces]
        state = np.concatenate([state, np.zeros(extra)])
        absolute = np.array([1e-17] * 2 * n + [small or 0.0] * extra)

        def slope(t, y):
            x, v = y[:n], y[n : 2 * n]
            pull = self.pull(t)
            push, lost = pull - self.stiffness @ x - self.damping @ v, v @ self.damping @ v
            for surface, phase in zip(self.surfaces, phases, strict=True):
                if phase == PRESSED:
                    force = surface.force(x, v)
                    push = push - (surface.row if surface.drag is None else surface.row + surface.drag(t)) * force
                    lost += (force - surface.spring(x)) * float(surface.row @ v)
            work = float(v @ pull)
            return np.concatenate([v, inverse @ push, [work, lost, abs(work) + lost][:extra]])

        while time < end:
            rules = [(j, *rule) for j, phase in enumerate(phases) for rule in RULES[phase]]
            events = [_event(n, self.surfaces[j], what, way) for j, what, way, _ in rules]
            finest = (end - instants[0]) / steps
            for _ in range(5):
                run = solve_ivp(
                    slope, (time, end), state, "DOP853", dense_output=True, events=events, rtol=tolerance,
                    atol=absolute, max_step=finest,
                )  # fmt: skip
                passed = self._passed_over(run, phases)
                if passed is None:
                    break
                finest /= 8.0
            else:
                # it left by less than rounding: the event is between no two steps
                phases[passed[0]] = passed[1]
                continue
            while wanted and wanted[0] <= run.t[-1]:
                found.append(run.sol(wanted.pop(0))[: 2 * n])
            time, state = run.t[-1], run.y[:, -1].copy()
            for (j, _, _, phase), hits in zip(rules, run.t_events, strict=True):
                if len(hits):
                    if extra and LEFT in (phase, phases[j]) and OPEN not in (phase, phases[j]):
                        # what a surface keeps as it lets go is lost as it relaxes, and is back if it presses again
                        kept = self.surfaces[j].energy(state[:n])
                        state[2 * n + 1] += kept if phase == LEFT else -kept
                        state[2 * n + 2] += kept
                    phases[j] = phase
        return np.array(found), state[2 * n :]

    def _passed_over(self, run, phases):
        """(surface, phase) that one took, and left for, between the ends of steps, where events are looked for."""
        n, shares = len(self.mass), np.arange(1, 8) / 8.0
        inside = (run.t[:-1, None] + np.diff(run.t)[:, None] * shares).ravel()
        states = run.sol(inside)
        for number, (surface, phase) in enumerate(zip(self.surfaces, phases, strict=True)):
            depth = surface.row @ states[:n] - surface.at
            bent = surface.row @ run.y[:n, 0] - surface.at > 1e-12
            if phase == OPEN and np.max(depth, initial=0.0) > 1e-12:
                return number, PRESSED
            if phase == LEFT and bent and np.min(depth, initial=0.0) < -1e-12:
                return number, OPEN
            deep = np.flatnonzero(depth > 1e-12) if phase == LEFT else ()
            if any(surface.force(*np.split(states[: 2 * n, k], 2)) > 1e-12 * surface.stiffness for k in deep):
                return number, PRESSED
        return None

    def _phase(self, surface, state):
        x, v = np.split(state, 2)
        depth, rate = surface.row @ x - surface.at, surface.row @ v
        if depth < 0.0 or (depth == 0.0 and rate <= 0.0):
            return OPEN
        return PRESSED if surface.force(x, v) >= 0.0 else LEFT


OPEN, PRESSED, LEFT = range(3)
"""Out of reach; pressed; within reach while its damper would pull."""

RULES = {
    OPEN: [("depth", 1.0, PRESSED)],
    PRESSED: [("force", -1.0, LEFT)],
    LEFT: [("depth", -1.0, OPEN), ("both", 1.0, PRESSED)],
}
"""By phase: what is read, in which direction it passes zero, and the phase that follows."""


def _event(n, surface, what, direction):
    def reads(t, y):
        x, v = y[:n], y[n : 2 * n]
        depth, force = surface.row @ x - surface.at, surface.force(x, v)
        return {"depth": depth, "force": force, "both": min(depth, force)}[what]

    reads.terminal, reads.direction = True, direction
    return reads
