"""A crank under its motor: run-up, swing and stall against the equation of motion by hand in SciPy."""

import json
import math
import re
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import chaosgym
from chaosgym import simulate
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.machines.machine_file import template
from chaosgym.machines.parameters import with_settings
from tests.machines.test_drive_torque import AHEAD, CRANK, PISTON, ROD, ROD_INERTIA, ROD_MASS

FOLDER = Path(__file__).parents[2] / "docs" / "machines"
MOTOR = '[motor]\nstall_torque = "60 N m"\nno_load_speed = "1500 rpm"\ninertia = "0.02 kg m^2"\n\n[operation]'
LOSSY = '[[spring]]\nbetween = ["ground.shaft", "piston.pin"]\nstiffness = "100 N/m"\nfree_length = "0.1 m"\n'


@pytest.fixture
def motored(tmp_path):
    """The compressor with a motor, a damper at its piston, and other texts replaced."""

    def read(*replaced):
        text = (FOLDER / "compressor.toml").read_text(encoding="utf-8")
        damped = f'{LOSSY}damping = "40 N s/m"\n\n{MOTOR}'
        for old, new in (("[operation]", damped), *replaced):
            assert old in text, old
            text = text.replace(old, new, 1)
        (tmp_path / "own.toml").write_text(text, encoding="utf-8")
        return chaosgym.read_machine(tmp_path / "own.toml")

    return read


def place(theta):
    """Place of the piston."""
    return CRANK * math.cos(theta) + math.sqrt(ROD**2 - (CRANK * math.sin(theta)) ** 2)


def slide(theta):
    """Its derivative by the crank angle, and that of the rod's angle."""
    low = math.sqrt(ROD**2 - (CRANK * math.sin(theta)) ** 2)
    return -CRANK * math.sin(theta) * (1.0 + CRANK * math.cos(theta) / low), -CRANK * math.cos(theta) / low


def inertia(theta):
    """Of rod and piston at the crank, and its derivative."""

    def at(angle):
        moved, swung = slide(angle)
        swing = -math.asin(CRANK / ROD * math.sin(angle))
        x = -CRANK * math.sin(angle) - AHEAD * math.sin(swing) * swung
        y = CRANK * math.cos(angle) + AHEAD * math.cos(swing) * swung
        return ROD_MASS * (x**2 + y**2) + ROD_INERTIA * swung**2 + PISTON * moved**2

    return at(theta), (at(theta + 1e-5) - at(theta - 1e-5)) / 2e-5


def height(theta):
    """Derivative of the height of all masses times their weight."""

    def at(angle):
        swing = -math.asin(CRANK / ROD * math.sin(angle))
        return 9.81 * (ROD_MASS * (CRANK * math.cos(angle) + AHEAD * math.cos(swing)) + PISTON * place(angle))

    return (at(theta + 1e-5) - at(theta - 1e-5)) / 2e-5


def gas(theta):
    """Force of the gas on the piston, by the side of the stroke."""
    volume = (CRANK + ROD - place(theta)) / (2.0 * CRANK) + 0.08
    if math.sin(theta) < 0.0:
        pressure = min(1e5 * (1.08 / volume) ** 1.3, 5e5)
    else:
        pressure = max(5e5 * (0.08 / volume) ** 1.3, 1e5)
    return -(pressure - 1e5) * math.pi / 4.0 * 0.06**2


def by_hand(stall, no_load, wheel, cycles, rate=0.0, curve=None):
    """Instants of whole turns and the motion (t, theta, w) of the crank in time, by LSODA; fewer if it stops."""
    given = curve or (lambda w: stall * (1.0 - w / no_load))

    def slope(_, state):
        theta, w = state
        felt, change = inertia(theta)
        moved = slide(theta)[0]
        pull = gas(theta) - 100.0 * (place(theta) - 0.1) - 40.0 * moved * w
        torque = given(w) - 0.5 * change * w**2 - height(theta) + pull * moved
        return [w, torque / (wheel + felt)]

    def turned(_, state):
        return math.sin(0.5 * state[0])

    def stopped(t, state):
        return state[1] if t > 1e-6 else 1.0

    def done(_, state):
        return state[0] - 2.0 * math.pi * (cycles + 0.01)

    stopped.terminal, done.terminal = True, True
    found = solve_ivp(
        slope, (0.0, 100.0), [0.0, rate], "LSODA", events=(turned, stopped, done), rtol=1e-8, atol=1e-10, max_step=2e-3
    )
    return np.array([t for t in found.t_events[0] if t > 1e-6]), found


def test_the_inertia_that_the_crank_feels(motored):
    """That of rod and piston by hand; half its derivative is the torque that grows with the square of the speed."""
    given, theta = motored(), np.arange(360) * math.pi / 180.0
    from chaosgym.machines.mechanism.equations import crank_inertia

    found = crank_inertia(given.mechanism, given.revolution, np.arange(360) * 2.0 * np.pi / 360)
    np.testing.assert_allclose(found, [inertia(angle)[0] for angle in theta], rtol=1e-9)
    change = given.equations(0.0, 360).torque[2]
    np.testing.assert_allclose(change, [0.5 * inertia(angle)[1] for angle in theta], atol=1e-5 * np.abs(change).max())


@pytest.mark.parametrize("wheel", [0.02, 0.2])
def test_a_run_up_is_that_of_the_equation_of_motion(wheel, motored):
    """Mean speed of each of 20 turns from rest to 0.1 %, lowest and highest of the last one to 0.1 % of its mean."""
    given = with_settings(motored(), {"motor_inertia": wheel})
    run = given.under_motor(20)
    turns, found = by_hand(60.0, 1500.0 * math.pi / 30.0, wheel, 20)
    expected = 60.0 / np.diff(np.append(0.0, turns))
    np.testing.assert_allclose(run.speed, expected[:20], rtol=1e-3)
    last = found.y[1][(found.t > turns[18]) & (found.t < turns[19])] * 30.0 / math.pi
    assert run.lowest[-1] == pytest.approx(last.min(), abs=1e-3 * run.speed[-1])
    assert run.highest[-1] == pytest.approx(last.max(), abs=1e-3 * run.speed[-1])


CURVE = 'speeds = "0, 500, 1000, 1400, 1500 rpm"\ntorques = "25, 20, 40, 50, 0 N m"\n'


def test_a_curve_of_torque_is_that_of_the_equation_of_motion(motored):
    """An induction motor, weaker at half its speed than at rest: each turn to 0.02 %, the first one to 0.2 %."""
    line = 'stall_torque = "60 N m"\nno_load_speed = "1500 rpm"\n'
    given = with_settings(motored((line, CURVE)), {"motor_inertia": 0.2})
    rates = np.array([0.0, 500.0, 1000.0, 1400.0, 1500.0]) * math.pi / 30.0
    turns, _ = by_hand(0, 0, 0.2, 20, curve=lambda w: float(np.interp(w, rates, [25.0, 20.0, 40.0, 50.0, 0.0])))
    found, expected = given.under_motor(20).speed, 60.0 / np.diff(np.append(0.0, turns))[:20]
    np.testing.assert_allclose(found[1:], expected[1:], rtol=2e-4)
    assert found[0] == pytest.approx(expected[0], rel=2e-3)
    for change, told in (
        ((CURVE, line + CURVE), "motor.stall_torque has no meaning beside motor.speeds"),
        (("50, 0 N m", "0 N m"), "motor.speeds has 5 numbers and motor.torques 4"),
        (("0, 500", "10, 500"), "two or more numbers that grow from 0 rpm on"),
        (("50, 0 N m", "50, 5 N m"), "0 N m at the last speed"),
    ):
        with pytest.raises(ParameterError, match=told):
            motored((line, CURVE), change)


def test_it_settles_where_the_motor_gives_what_is_taken(motored):
    """With a large flywheel the settled speed is where the motor's line meets the mean torque of a constant speed."""
    given = with_settings(motored(), {"motor_inertia": 2.0})
    run = given.under_motor()
    assert run.stalled is None
    assert np.ptp([run.lowest[-1], run.highest[-1]]) < 1e-3 * run.speed[-1]
    torque = given.at(run.speed[-1]).drive_torque
    assert 60.0 * (1.0 - run.speed[-1] / 1500.0) == pytest.approx(torque.mean, rel=1e-3)
    assert run.power[-1] == pytest.approx(torque.mean_power, rel=1e-3)


def test_a_weak_motor_stalls_where_the_equation_of_motion_stops(motored):
    """From 300 rpm with a small flywheel the compression stops it, at the same angle to a step of 4 deg."""
    given = with_settings(motored(), {"motor_stall_torque": 2.0})
    run = given.under_motor(50, speed=300.0)
    turns, found = by_hand(2.0, 1500.0 * math.pi / 30.0, 0.02, 50, 300.0 * math.pi / 30.0)
    assert len(run.speed) == len(turns)
    assert run.stalled == pytest.approx(math.degrees(found.y[0, -1]) % 360.0, abs=4.0)
    from_rest = given.under_motor()
    assert "the crank stops at" in from_rest.told
    assert not len(from_rest.speed)
    assert math.isnan(from_rest.swing), "there is no whole cycle"
    assert math.isnan(from_rest.run_up_time)


def test_show_tells_it(motored, tmp_path):
    """Settled speed, swing, power and time of the run-up, or where it stalls, in words and in JSON."""
    given = motored()
    path, run = str(tmp_path / "own.toml"), given.under_motor()
    told = json.loads(CliRunner().invoke(app, ["show", path, "--json"]).stdout)["motor"]
    assert told == run.as_dict()
    turns, _ = by_hand(60.0, 1500.0 * math.pi / 30.0, 0.02, 20)
    assert told["run_up_s"] == pytest.approx(turns[int(np.argmax(run.speed >= 0.99 * run.speed[-1]))], rel=1e-3)
    assert f"motor: settles at {run.speed[-1]:.4g} rpm" in CliRunner().invoke(app, ["show", path]).stdout
    weak = ["show", path, "--set", "motor_stall_torque=2", "--json"]
    stalled = json.loads(CliRunner().invoke(app, weak).stdout)["motor"]
    assert stalled["speed_rpm"] is None
    assert 0.0 <= stalled["stalled_deg"] < 360.0


def test_a_run_up_can_be_simulated(motored):
    """Every cycle runs at its own mean speed to 0.1 %, and a settled motor at one: the same bits as at that speed."""
    given = motored()
    run = given.under_motor(60)
    record = simulate(given, 60, operation=run.operation)
    np.testing.assert_allclose(record.operation["speed"], run.speed, rtol=6e-4)
    settled = run.operation["speed"][-1]
    assert np.all(run.operation["speed"][40:] == settled)
    tail = simulate(given.at(settled), 20, record.section[40])
    np.testing.assert_allclose(tail.peak_force, record.peak_force[40:], rtol=1e-9)


def test_what_a_motor_can_not_tell_is_not_told(motored):
    """A flywheel that takes hours is not called settled; a swing beyond 5 % is told, with what it means for runs."""
    slow = with_settings(motored(), {"motor_inertia": 1e9}).under_motor()
    assert not slow.settled
    assert slow.as_dict()["speed_rpm"] is None
    assert "not settled after 20,000 turns" in slow.told
    light = with_settings(motored(), {"motor_inertia": 0.01}).under_motor()
    assert light.swing > 0.05
    assert "so that runs at a constant speed are far from it" in light.told
    assert "far from it" not in with_settings(motored(), {"motor_inertia": 0.5}).under_motor().told


def test_speeds_of_runs_that_the_motor_does_not_reach_are_told(motored):
    """Above the settled speed, and above that without load; below, and at the settled one to 0.1 %, nothing is said."""
    given = motored()
    settled = given.under_motor().speed[-1]
    assert settled < given.speed
    assert given.notes == (f"runs are at 1450 rpm; under its load the motor settles at {settled:.4g} rpm",)
    assert given.at(1600.0).notes == ("runs are at 1600 rpm; the motor has 1500 rpm without load",)
    assert given.at(1.0005 * settled).notes == given.at(600.0).notes == ()


def test_a_motor_without_losses_gives_no_power(tmp_path):
    """What rounding leaves of the power of a mechanism that takes none is told as 0, in words and in JSON."""
    text = template("slider-crank").replace("[operation]", MOTOR)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    run = chaosgym.read_machine(tmp_path / "own.toml").under_motor()
    assert "gives 0 W" in run.told
    assert run.as_dict()["power_W"] == 0.0


def test_friction_that_the_motor_does_not_feel_is_told(tmp_path):
    """A guide with friction under a motor is noted, so that nobody takes the settled speed for its own."""
    text = template("slider-crank").replace("axis =", "friction = 0.1 #").replace("[operation]", MOTOR)
    (tmp_path / "own.toml").write_text(text, encoding="utf-8")
    given = chaosgym.read_machine(tmp_path / "own.toml")
    assert given.notes == ("the run-up under the motor leaves friction of guide out",)
    assert with_settings(given, {"guide_friction": 0.0}).notes == ()


@pytest.mark.parametrize(
    ("cycles", "speed"), [(0, 0.0), (-1, 0.0), (2.5, 0.0), (3, -50.0), (3, math.nan), (3, math.inf)]
)
def test_a_run_out_of_range_is_refused(cycles, speed, motored):
    """Whole cycles from 1 on, and a speed at the beginning from 0 on."""
    with pytest.raises(ParameterError, match="is out of range; allowed"):
        motored().under_motor(cycles, speed)


def test_what_is_wrong_with_a_motor_is_told(motored, tmp_path):
    """Without a motor there is none to run; without inertia of the links and a flywheel nothing can be told."""
    with pytest.raises(ParameterError, match=r"has no motor; allowed: a file with \[motor\]"):
        chaosgym.read_machine(FOLDER / "compressor.toml").under_motor()
    with pytest.raises(ParameterError, match=r"\[motor\] lacks no_load_speed"):
        motored(('no_load_speed = "1500 rpm"\n', ""))
    with pytest.raises(ParameterError, match="motor_inertia = -1 kg m\\^2 is out of range"):
        motored(("0.02 kg m^2", "-1 kg m^2"))
    with pytest.raises(ParameterError, match=r"curve is so steep .*; allowed: \[motor\] inertia from"):
        with_settings(motored(), {"motor_stall_torque": 1e6}).under_motor()
    yoke = (FOLDER / "scotch-yoke.toml").read_text(encoding="utf-8")
    still = re.sub(r"\n\[operation\]", "\n" + MOTOR.replace("0.02 kg", "0 kg"), yoke)
    (tmp_path / "yoke.toml").write_text(still, encoding="utf-8")
    with pytest.raises(ParameterError, match="nothing that turns has inertia at crank angle 0 deg"):
        chaosgym.read_machine(tmp_path / "yoke.toml").under_motor()
