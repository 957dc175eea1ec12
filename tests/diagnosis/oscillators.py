"""Forced oscillators whose orbits, multipliers or exponents are known.

References
----------
S. W. Shaw, P. J. Holmes, A periodically forced piecewise linear oscillator, J. Sound Vib. 90 (1983) 129-155.
Y. Ueda, Randomly transitional phenomena in the system governed by Duffing's equation, J. Stat. Phys. 20 (1979).
J. C. Sprott, Chaos and Time-Series Analysis, Oxford 2003, appendix A (exponents of Ueda's oscillator).
"""

import math
from dataclasses import dataclass

import numpy as np
from numba import njit


@dataclass(frozen=True)
class RigidImpact:
    """x'' + 2 zeta x' + x = cos(w t) for x < gap; x' -> -e x' at x = gap. States are (x, x') at phase zero."""

    frequency: float
    damping: float
    restitution: float
    gap: float

    @property
    def period(self):
        """Forcing period."""
        return 2.0 * math.pi / self.frequency

    @property
    def response(self):
        """Complex amplitude of the steady motion without impacts."""
        return 1.0 / complex(1.0 - self.frequency**2, 2.0 * self.damping * self.frequency)

    def steady(self, t):
        """Steady motion (x, x') at time t."""
        turned = self.response * complex(math.cos(self.frequency * t), math.sin(self.frequency * t))
        return np.array([turned.real, -self.frequency * turned.imag])

    def flow(self, t):
        """Free motion over a time t, (2, 2)."""
        z = self.damping
        w = math.sqrt(1.0 - z * z)
        c, s, decay = math.cos(w * t), math.sin(w * t), math.exp(-z * t)
        return decay * np.array([[c + z / w * s, s / w], [-s / w, c - z / w * s]])

    def step(self, state):
        """State one forcing period later."""
        state, t, pieces = np.array(state, dtype=float), 0.0, 200
        h = self.period / pieces
        for piece in range(pieces):
            end = (piece + 1) * h
            for _ in range(50):
                after = self.steady(end) + self.flow(end - t) @ (state - self.steady(t))
                if after[0] <= self.gap:
                    break
                low, high = 0.0, end - t
                for _ in range(60):
                    middle = 0.5 * (low + high)
                    moved = self.steady(t + middle) + self.flow(middle) @ (state - self.steady(t))
                    low, high = (middle, high) if moved[0] <= self.gap else (low, middle)
                moved = self.steady(t + low) + self.flow(low) @ (state - self.steady(t))
                t += low
                state = np.array([min(moved[0], self.gap), -self.restitution * abs(moved[1])])
            state, t = after, end
        return state

    def one_impact_orbits(self):
        """Closed form: (phase time of the impact, speed before it, multipliers) of each period-1 one-impact orbit."""
        flow, e = self.flow(self.period), self.restitution
        # gap - x_p and x_p' are proportional to the speed v before the impact
        system = np.array([[1.0 - flow[0, 0], flow[0, 1]], [-flow[1, 0], flow[1, 1] - 1.0]])
        alpha, beta = np.linalg.solve(system, [-flow[0, 1] * e, -1.0 - flow[1, 1] * e])
        a = alpha**2 + (beta / self.frequency) ** 2
        b, c = -2.0 * self.gap * alpha, self.gap**2 - abs(self.response) ** 2
        found = []
        for sign in (1.0, -1.0):
            root = b * b - 4.0 * a * c
            speed = (-b + sign * math.sqrt(root)) / (2.0 * a) if root >= 0.0 else -1.0
            if speed <= 0.0:
                continue
            x, v = self.gap - alpha * speed, beta * speed
            turned = complex(x, -v / self.frequency) / self.response
            time = (math.atan2(turned.imag, turned.real) / self.frequency) % self.period
            force = math.cos(self.frequency * time)
            before = force - 2.0 * self.damping * speed - self.gap
            after = force + 2.0 * self.damping * e * speed - self.gap
            saltation = np.array([[-e, 0.0], [(after + e * before) / speed, -e]])
            found.append((time, speed, np.linalg.eigvals(flow @ saltation)))
        return found

    def at_phase_zero(self, time, speed):
        """State at phase zero after an impact at a phase time."""
        left = self.period - time
        start = np.array([self.gap, -self.restitution * speed])
        return self.steady(self.period) + self.flow(left) @ (start - self.steady(time))


@njit
def _duffing(x, v, damping, amplitude, steps):
    h = 2.0 * math.pi / steps
    for i in range(steps):
        t = i * h
        f0, f1, f2 = amplitude * math.cos(t), amplitude * math.cos(t + 0.5 * h), amplitude * math.cos(t + h)
        a1 = f0 - damping * v - x**3
        x2, v2 = x + 0.5 * h * v, v + 0.5 * h * a1
        a2 = f1 - damping * v2 - x2**3
        x3, v3 = x + 0.5 * h * v2, v + 0.5 * h * a2
        a3 = f1 - damping * v3 - x3**3
        x4, v4 = x + h * v3, v + h * a3
        a4 = f2 - damping * v4 - x4**3
        x, v = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4), v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
    return x, v


def duffing(state, *, damping=0.05, amplitude=7.5, steps=200):
    """x'' + damping x' + x^3 = amplitude cos t over one forcing period (Ueda's oscillator)."""
    return np.array(_duffing(state[0], state[1], damping, amplitude, steps))


def iterate(step, state, cycles, *, skip=0):
    """States at successive strobes, (cycles, d)."""
    states = []
    for cycle in range(skip + cycles):
        state = step(state)
        if cycle >= skip:
            states.append(state)
    return np.array(states)
