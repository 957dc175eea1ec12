"""Two plants that are no machines of chaosgym, with equations and integrator of their own."""

import math

import numpy as np
from scipy.integrate import solve_ivp


class Bilinear:
    """A mass on a spring with a stop on each side, by scipy's Runge-Kutta method; it tells the force with its sign.

    ``top`` is the fastest speed of its drive [Hz]; it tells the speed that it ran at.
    """

    def __init__(self, top=math.inf, stiffness=2e5):
        self.top, self.stiffness, self.stops = top, stiffness, 0

    def reset(self):
        """Come to rest."""
        self.state, self.resets = np.zeros(2), True

    def stop(self):
        """Count how often it was stopped."""
        self.stops += 1

    def force(self, x):
        """Of the stops at +-1 mm [N], with its sign."""
        return self.stiffness * (np.maximum(x - 1e-3, 0.0) - np.maximum(-x - 1.2e-3, 0.0))

    def run(self, speed, cycles):
        """Largest and smallest force of each cycle [N], and the speed."""
        speed, peaks = min(speed, self.top), []

        def change(t, y):
            push = 50.0 * math.sin(math.tau * speed * t)
            return [y[1], (push - 2000.0 * y[0] - 5.0 * y[1] - self.force(y[0])) / 0.5]

        for _ in range(cycles):
            grid = np.linspace(0.0, 1.0 / speed, 60)
            path = solve_ivp(change, (0.0, 1.0 / speed), self.state, t_eval=grid, rtol=1e-5, atol=1e-8)
            self.state = path.y[:, -1]
            force = self.force(path.y[0])
            peaks.append([force.max(), force.min()])
        return {"peaks": peaks, "speed": speed}


class GearPair:
    """Two gears with backlash under a steady torque and an error of transmission, by steps of semi-implicit Euler.

    The equation of the relative motion along the line of action: A. Kahraman, R. Singh, Journal of Sound and Vibration
    142 (1990) 49-75.
    """

    def reset(self):
        """Come to rest at the driving side."""
        self.x, self.v = 1.0 + 0.1, 0.0

    def run(self, speed, cycles):
        """Largest force of each cycle, 0 while the teeth are apart on both sides, scaled to newtons."""
        steps, peaks = 300, []
        dt = math.tau / (steps * speed / 20.0)
        for _ in range(cycles):
            largest = 0.0
            for step in range(steps):
                force = math.copysign(max(abs(self.x) - 1.0, 0.0), self.x)
                error = 0.2 * (speed / 20.0) ** 2 * math.sin(math.tau * step / steps)
                self.v += dt * (0.1 + error - 0.1 * self.v - force)
                self.x += dt * self.v
                largest = max(largest, abs(force))
            peaks.append(200.0 * largest)
        return peaks
