"""A rig in twenty lines: a shaken mass between two stops, by small steps of the semi-implicit Euler method."""

from math import sin, tau

MASS, SPRING, DAMPER, GAP, STOP, PUSH, STEPS = 0.5, 2000.0, 5.0, 1e-3, 2e5, 50.0, 400  # SI units; steps of a cycle


class Rig:
    """What ``chaosgym run-agent ... --plant rig:Rig`` calls."""

    def reset(self):
        """Come to rest."""
        self.x = self.v = 0.0

    def run(self, speed, cycles):
        """Run cycles at a speed [Hz]; return the largest force of each on the upper stop [N]."""
        peaks, dt = [], 1.0 / (STEPS * speed)
        for _ in range(cycles):
            forces = []
            for step in range(STEPS):
                forces.append(STOP * max(self.x - GAP, 0.0))
                stop = forces[-1] - STOP * max(-self.x - GAP, 0.0)
                push = PUSH * sin(tau * step / STEPS)
                self.v += dt * (push - SPRING * self.x - DAMPER * self.v - stop) / MASS
                self.x += dt * self.v
            peaks.append(max(forces))
        return peaks
