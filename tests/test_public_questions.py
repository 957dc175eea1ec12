"""Questions that people asked elsewhere, rebuilt with their own numbers: the answers of docs/public-questions.md."""

import math
import re
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.machines.modal_machine.varying import means
from chaosgym.machines.parameters import with_settings
from tests.machines.bodies import Bodies, Surface

DOCS = Path(__file__).parent.parent / "docs"
PAGE = (DOCS / "public-questions.md").read_text(encoding="utf-8")


def machine(name):
    """Machine of a question."""
    return chaosgym.read_machine(DOCS / "machines" / f"{name}.toml")


def answers(title):
    """Numbers of the answer under a title of the page."""
    (answer,) = re.findall(rf"## {title}\n.*?\n\*\*Answer\.\*\* (.*?)\n\n", PAGE + "\n\n", re.DOTALL)
    return [float(each) for each in re.findall(r"\d+\.\d+", answer)]


def largest(bodies, period, surface, start=(0.0, 0.0, 0.0, 0.0)):
    """Largest force of a surface within a cycle, by SciPy."""
    n = len(bodies.mass)
    states = bodies.motion(np.array(start[: 2 * n]), np.linspace(0.0, period, 40_001))
    return max(
        max(0.0, surface.force(state[:n], state[n:])) for state in states if surface.row @ state[:n] > surface.at
    )


def test_compliant_stoppers():
    """The farthest point for stiffnesses 1 to 5 is that of energy: x^2 + k2 (x - 1/2)^2 = 1; the page rounds them."""
    expected = []
    for stiffness in range(1, 6):
        found = chaosgym.simulate(with_settings(machine("compliant-stoppers"), {"contact_stiffness": stiffness}), 1)
        far = (0.5 * stiffness + math.sqrt(1.0 + 0.75 * stiffness)) / (1.0 + stiffness)
        assert found.peak_force[0] == pytest.approx(stiffness * (far - 0.5), rel=1e-9)
        expected.append(round(far, 4))
    assert answers("Mass between compliant stoppers") == expected


def test_motor_with_backlash():
    """Largest torque in the mesh after a step, as SciPy has it to 1e-6, and the instant of the first touch."""
    row = np.array([1.0, -1.0])
    surface = Surface(row, 0.05, 1e4, 2.0)
    bodies = Bodies(
        np.diag([0.01, 0.05]), np.diag([0.0, 0.02]), np.zeros((2, 2)), lambda t: np.array([1.0, 0.0]),
        [surface, Surface(-row, 0.05, 1e4, 2.0)],
    )  # fmt: skip
    peak = float(chaosgym.simulate(machine("motor-with-backlash"), 1, integrator=TIGHTEST_EVENTS).peak_force.max())
    assert peak == pytest.approx(largest(bodies, 0.2, surface), rel=1e-5)
    assert answers("Motor with backlash") == [round(peak, 2), round(1e3 * math.sqrt(2.0 * 0.05 * 0.01), 2)]


def test_gear_after_a_step():
    """Largest torque at the driver as SciPy has it to 1e-5, and what the follower takes of the step."""
    row = np.array([1.0, -2.0])
    gap = math.radians(0.1)
    surface = Surface(row, gap, 100.0, 0.05)
    bodies = Bodies(
        np.diag([0.001, 0.02]), np.diag([0.0, 0.05]), np.zeros((2, 2)), lambda t: np.array([1.0, 0.0]),
        [surface, Surface(-row, gap, 100.0, 0.05)],
    )  # fmt: skip
    record = chaosgym.simulate(machine("gear-after-a-step"), 1, integrator=TIGHTEST_EVENTS)
    peak = float(record.peak_force.max())
    assert peak == pytest.approx(largest(bodies, 0.2, surface), rel=1e-5)
    assert answers("Gear after a step of torque") == [round(peak, 3), 0.83]
    assert pytest.approx(0.02 / 4.0 / (0.001 + 0.02 / 4.0), abs=0.005) == 0.83


def test_mesh_of_exponent_10_9():
    """Force on the teeth in the first cycle as SciPy has it to 1e-4, the shaft held over parts of a degree in both."""
    given = machine("mesh-of-exponent-10-9")
    row, wheel, power = np.array([0.02, 0.1]), np.array([0.0, 1.0]), 10.0 / 9.0
    values = means(np.array([900.0, 1000, 1100, 1000, 900, 800, 700, 800]), given.bins)
    chi = 1.6 * 0.3 / 0.7 / 0.05
    surfaces = [Surface(sign * row, 2e-5, 2e8, exponent=power, loss=chi) for sign in (1.0, -1.0)]
    state, peak = np.zeros(4), 0.0
    instants = np.linspace(0.0, 1.0 / 30.0, given.bins + 1)
    for begin, end, spring in zip(instants, instants[1:], values, strict=False):
        bodies = Bodies(
            np.diag([2e-4, 5e-3]), 0.3 * np.outer(wheel, wheel), spring * np.outer(wheel, wheel),
            lambda t: np.array([1.5 * math.sin(60.0 * math.pi * t) + 1.0, 0.0]), surfaces,
        )  # fmt: skip
        states = bodies.motion(state, np.linspace(begin, end, 200), steps=1)
        state = states[-1]
        for each in states:
            if row @ each[:2] > 2e-5:
                peak = max(peak, surfaces[0].force(each[:2], each[2:]))
    found = chaosgym.simulate(given, 1, integrator=TIGHTEST_EVENTS)
    assert float(found.peak_force[0, 0]) == pytest.approx(peak, rel=1e-4)
    assert answers("Teeth that touch by a power of 10/9") == [round(float(found.peak_force[0, 0]), 1)]
