"""Verdicts on random machines against an integrator that shares no equation with the library.

``CHAOSGYM_REFEREED=300`` asks for three hundred machines, which takes some minutes of processor time.
"""

import os

import numpy as np
import pytest

from chaosgym import diagnose
from tests.diagnosis.ordinary import machine
from tests.diagnosis.runge_kutta import RungeKutta

MACHINES = int(os.environ.get("CHAOSGYM_REFEREED", "20"))

MISS = 1e-5
"""Largest miss of an orbit after its period, as a share of its size."""

DEVIATION = 1e-6
"""Size of the deviations whose growth is measured, as a share of the motion's."""

NEAR, PERIODS, WINDOW = 1e-4, 24, 6
"""Distance from an orbit at which a motion has arrived, periods in which it may, and those at both ends over which
distances are compared: many approach in spirals."""

CYCLES, SETTLE = 48, 8
"""Cycles over which two motions part, and those before in which their distance turns into the direction of growth;
eight times as many where these leave a doubt."""

ERRORS = 5.0
"""Standard errors that two exponents may be apart."""


class Followed:
    """Maps of one cycle of a machine, and sizes: coordinates and their rates apart."""

    def __init__(self, made, states):
        self.after = RungeKutta(made.reduce()).after
        half = states.shape[1] // 2
        sizes = [np.max(np.abs(states[:, :half])), np.max(np.abs(states[:, half:]))]
        self.size = np.maximum(np.repeat(sizes, half), 1e-300)

    def distance(self, one, other):
        """Between two states, as a share of the motion's size."""
        return float(np.max(np.abs(one - other) / self.size))

    def largest_multiplier(self, state, period):
        """Largest Floquet multiplier of an orbit, by a deviation in each coordinate."""
        steps = DEVIATION * self.size
        ends = [self.after(state + step, period) for step in np.diag(steps)]
        derivative = (np.array(ends) - self.after(state, period)).T / steps
        return float(np.max(np.abs(np.linalg.eigvals(derivative))))

    def exponent(self, state, cycles):
        """(Largest Lyapunov exponent per cycle, its standard error) by two motions brought near each cycle."""
        other, growth = state + DEVIATION * self.size, []
        for _ in range(SETTLE + cycles):
            state, other = self.after(state, 1), self.after(other, 1)
            parted = np.linalg.norm((other - state) / self.size)
            growth.append(np.log(max(parted, 1e-300) / DEVIATION))
            other = state + (other - state) * DEVIATION / max(parted, 1e-300)
        blocks = np.reshape(growth[SETTLE:], (6, -1)).mean(axis=1)
        return float(blocks.mean()), float(blocks.std(ddof=1) / np.sqrt(len(blocks)))


def objection(made):
    """(Nature and status of the verdict on a machine, what the referee holds against it; empty if nothing)."""
    verdict = diagnose(made)
    told, states = f"{verdict.nature}, {verdict.status}", verdict.judged.section
    followed = Followed(made, states)
    if verdict.nature == "undetermined":
        return told, ""
    if verdict.period:  # also of chaos that died out
        return told, against_orbit(followed, verdict, states[-1])
    claimed = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    for cycles in (CYCLES, 8 * CYCLES):
        found, error = followed.exponent(states[-1], cycles)
        apart = abs(found - claimed["value"]) > ERRORS * np.hypot(error, claimed["standard_error"]) + 0.02
        wrong = found - 2.0 * error < 0.0 if verdict.nature == "chaotic" else abs(found) > 2.0 * error + 0.02
        if not (apart or wrong):
            return told, ""
    return told, f"exponent {found:.3f} +- {error:.3f}, not {claimed['value']:.3f}"


def against_orbit(followed, verdict, state):
    """Whether the orbit closes, no sooner, attracts, and is where the motion from rest goes."""
    period, told, orbit = verdict.period, [], [state]
    for _ in range(period):
        orbit.append(followed.after(orbit[-1]))
    misses = [followed.distance(state, later) for later in orbit[1:]]
    if misses[-1] > MISS:
        told.append(f"misses by {misses[-1]:.1e} after {period} cycles")
    if min(misses[:-1], default=1.0) < MISS:
        told.append(f"closes before {period} cycles")
    multiplier = followed.largest_multiplier(state, period)
    if multiplier >= 1.0:
        told.append(f"multiplier {multiplier:.4f}")
    end, near = verdict.run.final_state.coordinates, []
    while len(near) < PERIODS and (not near or near[-1] > NEAR):
        near.append(min(followed.distance(end, one) for one in orbit))
        end = followed.after(end, period)
    if near[-1] > NEAR and max(near[-WINDOW:]) > max(near[:WINDOW]):
        told.append(f"the motion from rest stays {near[-1]:.1e} from it")
    return "; ".join(told)


def refereed(seeds):
    """Objections by seed; prints every machine as it is judged."""
    found = {}
    for seed in seeds:
        kind, made = machine(seed)
        nature, told = objection(made)
        print(seed, kind, nature, told, flush=True)
        if told:
            found[seed] = f"{kind}, {nature}: {told}"
    return found


@pytest.mark.slow
def test_verdicts_on_random_machines_hold_by_another_integrator():
    """Orbits close, attract and draw the motion from rest; motions that are told chaotic part, at the rate told."""
    assert refereed(range(MACHINES)) == {}
