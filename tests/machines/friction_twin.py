"""Joints with friction by DOP853 with events, from the law alone: a slider in series with a tangential spring."""

import math

import numpy as np
from scipy.integrate import solve_ivp

OPEN, STICKS, UP, DOWN = 0, 1, 2, -2
"""What a joint does; UP and DOWN are sliding towards where the tangential displacement grows or falls."""


class Twin:
    """A machine with joints in physical terms, for one run; every joint has friction or none."""

    def __init__(self, machine):
        self.machine = machine
        self.rates, self.damping = machine.modes.angular_frequency, machine.modes.damping
        self.rows = np.array([machine.modes.shape(machine.places[name]) for name in machine.joints])
        self.slip = np.zeros_like(self.rows)
        self.mu, self.factor, self.belt = (np.zeros(len(self.rows)) for _ in range(3))
        for j, name in enumerate(machine.joints):
            if name in machine.tangents:
                self.slip[j] = machine.modes.shape(machine.tangents[name])
                self.mu[j] = getattr(machine, f"{name}_friction")
                self.factor[j] = getattr(machine, f"{name}_tangential_factor")
                self.belt[j] = getattr(machine, f"{name}_sliding_speed")
        get = machine.of_joints
        self.upper, self.lower = get("offset") + get("clearance"), get("offset") - get("clearance")
        self.lower[get("stops") == "one"] = -math.inf
        self.spring = np.stack([get("stiffness"), get("stiffness") * get("lower_stiffness_factor")])
        self.damper = np.stack([get("damping"), get("damping") * get("lower_damping_factor")])
        self.preload = get("preload") @ self.rows
        self.omega = 2.0 * math.pi * machine.speed
        self.drives = [(machine.modes.shape(d.at), d.harmonics[0], d.mean) for d in machine.drives]
        self.n, self.m = len(self.rates), len(self.rows)

    def _push(self, j, side, y):
        """Force of a surface, its depth and tangential spring."""
        which = 0 if side > 0 else 1
        x, v = self.rows[j] @ y[: self.n], self.rows[j] @ y[self.n : 2 * self.n]
        depth = x - self.upper[j] if side > 0 else self.lower[j] - x
        return self.spring[which, j] * depth + self.damper[which, j] * side * v, depth

    def _tangential(self, j, side):
        return self.factor[j] * self.spring[0 if side > 0 else 1, j]

    def slope(self, t, y, sides, modes):
        """Rates of displacements, velocities and deflections of the tangential springs."""
        q, v = y[: self.n], y[self.n : 2 * self.n]
        load = self.preload.copy()
        for shape, (k, c, s), mean in self.drives:
            load += shape * (mean + c * math.cos(k * self.omega * t) + s * math.sin(k * self.omega * t))
        stretched = np.zeros(self.m)
        for j in range(self.m):
            if sides[j] == 0:
                continue
            push = self._push(j, sides[j], y)[0]
            load -= sides[j] * push * self.rows[j]
            if self.mu[j] > 0.0:
                if modes[j] == STICKS:
                    load -= self._tangential(j, sides[j]) * y[2 * self.n + j] * self.slip[j]
                    stretched[j] = self.slip[j] @ v - self.belt[j]
                else:
                    load -= math.copysign(self.mu[j] * push, modes[j]) * self.slip[j]
        return np.concatenate([v, load - self.rates**2 * q - self.damping @ v, stretched])

    def _reads(self, t, y, sides, modes):
        """What ends the present modes where it falls below zero: (value, joint, what follows)."""
        found = []
        for j in range(self.m):
            if sides[j] == 0:
                for side in (1, -1):
                    push, depth = self._push(j, side, y)
                    # it presses where depth and force are positive
                    found.append((-min(push, depth / 1e-3), j, side))
                continue
            push, _ = self._push(j, sides[j], y)
            found.append((push, j, OPEN))
            if self.mu[j] == 0.0:
                continue
            if modes[j] == STICKS:
                force = self._tangential(j, sides[j]) * y[2 * self.n + j]
                found.append((self.mu[j] * push - force, j, UP))
                found.append((self.mu[j] * push + force, j, DOWN))
            else:
                sign = math.copysign(1.0, modes[j])
                slope = self.slope(t, y, sides, modes)
                v, a = y[self.n : 2 * self.n], slope[self.n : 2 * self.n]
                which = 0 if sides[j] > 0 else 1
                grows = sides[j] * (self.spring[which, j] * self.rows[j] @ v + self.damper[which, j] * self.rows[j] @ a)
                slides = sign * (self.slip[j] @ v - self.belt[j]) - self.mu[j] * grows / self._tangential(j, sides[j])
                found.append((slides, j, STICKS))
        return found

    def run(self, start, instants):
        """States (k, 2n + m) at the instants, and events (time, joint, what follows), from a state without contact."""
        y, t, sides, modes = start.copy(), 0.0, [0] * self.m, [STICKS] * self.m
        shown, events = [], []
        while True:
            held = tuple(sides), tuple(modes)
            count = len(self._reads(t, y, *held))
            found = solve_ivp(
                lambda t, y, held=held: self.slope(t, y, *held),
                (t, instants[-1]),
                y,
                "DOP853",
                dense_output=True,
                rtol=1e-11,
                atol=1e-16,
                max_step=4e-4 / self.machine.speed,
                events=[self._event(i, *held) for i in range(count)],
            )
            ahead = instants[(instants > t) | (t == 0.0)]
            shown += [self._stretched(found.sol(instant), *held) for instant in ahead[ahead <= found.t[-1]]]
            if found.status != 1:
                return np.array(shown), events
            which = next(i for i in range(count) if len(found.t_events[i]))
            t, y = found.t[-1], found.y[:, -1].copy()
            _, j, follows = self._reads(t, y, *held)[which]
            events.append((t, j, follows))
            if follows == OPEN or sides[j] == 0:
                sides[j], modes[j], y[2 * self.n + j] = follows, self._begins(j, follows, y), 0.0
                continue
            y, modes[j] = self._stretched(y, *held), follows

    def _stretched(self, y, sides, modes):
        """The state with the deflection of what slides."""
        y = y.copy()
        for j in range(self.m):
            if sides[j] != 0 and modes[j] != STICKS:
                push = self._push(j, sides[j], y)[0]
                y[2 * self.n + j] = math.copysign(self.mu[j] * push, modes[j]) / self._tangential(j, sides[j])
        return y

    def _begins(self, j, side, y):
        """What friction does first: without a damper force and limit grow from zero, the faster one decides."""
        if side == OPEN or self.mu[j] == 0.0 or self.damper[0 if side > 0 else 1, j] > 0.0:
            return STICKS
        v = y[self.n : 2 * self.n]
        slips = self.factor[j] * (self.slip[j] @ v - self.belt[j])
        return STICKS if abs(slips) < self.mu[j] * abs(self.rows[j] @ v) else UP if slips > 0.0 else DOWN

    def _event(self, i, sides, modes):
        def event(t, y):
            return self._reads(t, y, sides, modes)[i][0]

        event.terminal, event.direction = True, -1
        return event
