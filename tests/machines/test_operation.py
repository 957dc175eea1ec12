"""Speed, force and gap that change from cycle to cycle: against another program, and against runs cycle by cycle."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import chaosgym
from chaosgym import ImpactBeam, SliderCrank, simulate
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.simulation.record import joined
from tests.third_machine import ImpactOscillator

PIPE = Path("docs/machines/pipe-in-two-supports.toml")
FIELDS = ("section", "peak_force", "impacts", "contact_fraction", "bounce_duration", "displacement")


def _noise(machine, cycles, **spreads):
    generator = np.random.default_rng(5)
    return {
        field: getattr(machine, field) * (1.0 + spread * generator.standard_normal(cycles))
        for field, spread in spreads.items()
    }


def _cycle_by_dop853(speed, force, gap, state, times):
    """Displacements at the times and the state at the last, stopped at each touch and release: the push jumps there."""

    def depth(t, y):
        return abs(y[0]) - gap

    def push(t, y):
        return 1e6 * depth(t, y) + 50.0 * math.copysign(1.0, y[0]) * y[1]

    depth.direction, push.direction = 1.0, -1.0
    depth.terminal = push.terminal = True
    shown, t, pressed = [], 0.0, depth(0.0, state) > 0.0 and push(0.0, state) > 0.0
    while len(shown) < len(times):

        def slope(t, y, pressed=pressed):
            stop = math.copysign(push(t, y), y[0]) if pressed else 0.0
            return y[1], force * math.sin(2.0 * math.pi * speed * t) - 2.0 * y[1] - 1e3 * y[0] - stop

        ends, until = push if pressed else depth, (t, times[-1])
        run = solve_ivp(
            slope, until, state, "DOP853", times[len(shown) :], events=ends, rtol=3e-14, atol=1e-18, max_step=1e-4
        )
        shown += list(run.y[0]) if len(run.t) else []
        if run.status == 1:
            t, state, pressed = run.t_events[0][0], run.y_events[0][0], not pressed
    return shown, run.y[:, -1]


def test_a_mass_at_changing_speed_force_and_gap_moves_as_another_program_says():
    """Displacement of five cycles equals DOP853's (rtol 3e-14), cycle by cycle on its own phase, to 1e-8 of the gap."""
    machine = ImpactOscillator(frequency=7.0)
    operation = {
        "frequency": [7.0, 7.4, 6.1, 9.0, 8.2],
        "force_amplitude": [5.0, 9.0, 2.0, 6.0, 8.0],
        "gap": [1e-3, 0.9e-3, 1.2e-3, 1.2e-3, 0.7e-3],
    }
    record = simulate(machine, 5, samples_per_cycle=40, operation=operation, integrator=TIGHTEST_EVENTS)
    state, expected, instants, begin = np.zeros(2), [], [], 0.0
    for speed, force, gap in zip(*operation.values(), strict=True):
        times = np.arange(41) / 40.0 / speed
        shown, state = _cycle_by_dop853(speed, force, gap, state, times)
        expected.append(shown[:-1])
        instants.append(begin + times[:-1])
        begin += times[-1]
    assert record.impacts.sum() >= 8
    np.testing.assert_allclose(record.history[:, :, 0], expected, rtol=0.0, atol=1e-8 * 1e-3)
    np.testing.assert_allclose(record.time, np.concatenate(instants), rtol=1e-12)


@pytest.mark.parametrize(
    ("machine", "spreads"),
    [
        (ImpactBeam(excitation_frequency=19.0), {"excitation_frequency": 0.01, "force_amplitude": 0.1}),
        (chaosgym.read_machine(PIPE), {"speed": 0.01, "drive_level": 0.1, "saddle_clearance": 0.05}),
        pytest.param(SliderCrank(), {"crank_speed": 0.01}, marks=pytest.mark.slow),
    ],
    ids=["beam", "pipe in two supports", "crank"],
)
def test_a_run_is_its_cycles_one_after_the_other(machine, spreads):
    """Noise of the operation gives the bytes of runs of a cycle each; values that stay give those of a plain run."""
    operation = _noise(machine, 6, **spreads)
    found, state, records = simulate(machine, 6, operation=operation), None, []
    for values in zip(*operation.values(), strict=True):
        records.append(simulate(replace(machine, **dict(zip(operation, values, strict=True))), 1, state))
        state = records[-1].final_state
    expected = joined(records)
    still = simulate(machine, 6, operation={field: np.full(6, getattr(machine, field)) for field in operation})
    plain = simulate(machine, 6)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
        np.testing.assert_array_equal(getattr(still, name), getattr(plain, name))
    for field, values in operation.items():
        np.testing.assert_array_equal(found.after(2).operation[field], values[2:])


def test_transient_and_parts_go_on_from_each_other():
    """The transient runs at the first values; two parts are the whole, unless one has other fields that change."""
    machine, drift = ImpactBeam(), {"excitation_frequency": np.linspace(18.0, 20.0, 8)}
    whole = simulate(machine, 8, transient=5, operation=drift)
    first = simulate(
        machine,
        3,
        simulate(machine.at(18.0), 5).final_state,
        operation={"excitation_frequency": drift["excitation_frequency"][:3]},
    )
    second = simulate(
        machine, 5, first.final_state, operation={"excitation_frequency": drift["excitation_frequency"][3:]}
    )
    both = first.followed_by(second)
    for name in FIELDS:
        np.testing.assert_array_equal(getattr(both, name), getattr(whole, name))
    np.testing.assert_array_equal(both.operation, whole.operation)
    with pytest.raises(SimulationError, match="allowed: the same fields"):
        first.followed_by(simulate(machine, 2, first.final_state))


@pytest.mark.parametrize(
    ("operation", "message"),
    [
        ({"excitation_frequency": [19.0, 19.0]}, r"shape \(2,\); allowed: \(3,\)"),
        ({"excitation_frequency": [19.0, math.nan, 19.0]}, "excitation_frequency = nan Hz is out of range"),
        ({"clearance": [1e-4, -1e-4, 1e-4]}, "clearance = -0.0001 m is out of range"),
        ({"clearance": ["a", "b", "c"]}, "is no array; allowed: a number for each cycle"),
        ({"length": [0.3, 0.3, 0.4]}, "can't change while impact-beam runs; allowed: excitation_frequency, clearance"),
    ],
)
def test_an_operation_that_does_not_fit_is_refused_in_one_line(operation, message):
    """A wrong length, no number, a value out of range, a field on which the modes depend: what and what is allowed."""
    with pytest.raises(ParameterError, match=message) as error:
        simulate(ImpactBeam(), 3, operation=operation)
    assert "\n" not in str(error.value)
