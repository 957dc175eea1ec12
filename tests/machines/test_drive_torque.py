"""Torque and power of the drive of a mechanism, against virtual work, closed forms and the nonlinear linkage."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.machines.drive_torque import DriveTorque
from chaosgym.machines.machine_file import template
from chaosgym.machines.parameters import with_settings
from tests.machines import linkage_twins
from tests.machines.test_linkages import GUIDE, WRIST

FOLDER = Path(__file__).parents[2] / "docs" / "machines"
CRANK, ROD, AHEAD = 0.025, 0.11, 0.038
ROD_MASS, ROD_INERTIA, PISTON = 0.2, 4e-4, 0.25


def compressor(**settings):
    """The compressor of docs/machines with other settings."""
    return with_settings(chaosgym.read_machine(FOLDER / "compressor.toml"), settings)


def by_virtual_work(theta, rate, pressure_force):
    """Torque on the tight compressor: change of its kinetic and potential energy, less the work of the gas, by angle.

    ``pressure_force`` gives the force on the piston at its places. Derivatives are differences of closed forms.
    """

    def place(angle):
        return CRANK * np.cos(angle) + np.sqrt(ROD**2 - (CRANK * np.sin(angle)) ** 2)

    def rod(angle):
        swing = -np.arcsin(CRANK / ROD * np.sin(angle))
        x, y = CRANK * np.cos(angle) + AHEAD * np.cos(swing), CRANK * np.sin(angle) + AHEAD * np.sin(swing)
        return x, y, swing

    step = 1e-5

    def rates(angle):
        ahead, back = rod(angle + step), rod(angle - step)
        centre = [(a - b) / (2.0 * step) for a, b in zip(ahead, back, strict=True)]
        return *centre, (place(angle + step) - place(angle - step)) / (2.0 * step)

    def energy(angle):
        x, y, turn, slide = rates(angle)
        inertia = ROD_MASS * (x**2 + y**2) + ROD_INERTIA * turn**2 + PISTON * slide**2
        return 0.5 * inertia * rate**2 + 9.81 * (ROD_MASS * rod(angle)[0] + PISTON * place(angle))

    step_wide = 1e-4
    change = (energy(theta + step_wide) - energy(theta - step_wide)) / (2.0 * step_wide)
    return change - pressure_force(place(theta)) * rates(theta)[3]


def test_torque_is_that_of_virtual_work():
    """At every crank angle the compressor's torque is the change of energy less the work of the gas: to 0.1 %."""
    given = compressor()
    theta = np.arange(720) * 2.0 * math.pi / 720
    area, top, swept = math.pi / 4.0 * 0.06**2, CRANK + ROD, 2.0 * CRANK

    def gas(place):
        """Valves and polytropic changes, by the side of the stroke."""
        volume, dead = (top - place) / swept + 0.08, 0.08
        compressed = 1e5 * ((1.0 + dead) / volume) ** 1.3
        expanded = 5e5 * (dead / volume) ** 1.3
        rising = np.sin(theta) < 0.0
        return -(np.where(rising, np.minimum(compressed, 5e5), np.maximum(expanded, 1e5)) - 1e5) * area

    expected = by_virtual_work(theta, given.crank_rate, gas)
    np.testing.assert_allclose(given.drive_torque.torque, expected, atol=1e-3 * np.abs(expected).max())


def test_mean_power_is_the_work_of_the_gas():
    """Inertia and weight take none of it: the same work at any speed and with any mass, half under half load."""
    work = compressor().drive_torque.mean
    for settings in ({"speed": 3000.0}, {"rod_mass_factor": 5.0}, {"gravity_factor": 0.0}):
        assert compressor(**settings).drive_torque.mean == pytest.approx(work, rel=1e-9)
    assert compressor(load_factor=0.5).drive_torque.mean == pytest.approx(work / 2.0, rel=1e-9)
    fast = compressor(speed=3000.0).drive_torque
    assert fast.mean_power == pytest.approx(100.0 * math.pi * work, rel=1e-9)


def test_a_flywheel_takes_up_the_work_of_a_sine():
    """A torque of 3 N m and a sine of 2 N m: 4 J above the mean, and 6 N m times 10 rad/s at the peak."""
    drive = DriveTorque(3.0 + 2.0 * np.sin(2.0 * np.pi * np.arange(3600) / 3600), 10.0)
    assert drive.energy_swing == pytest.approx(4.0, rel=1e-5)
    assert drive.flywheel(0.02) == pytest.approx(4.0 / (0.02 * 100.0), rel=1e-5)
    told = drive.as_dict()
    assert told["mean_power_W"] == pytest.approx(30.0)
    assert told["largest_power_W"] == pytest.approx(50.0)


@pytest.mark.slow
def test_a_flywheel_holds_the_speed_as_told():
    """A crank with its flywheel turns under the mean torque, by DOP853: its speed swings by the 1 % asked for.

    The work taken up is that of a constant speed, so that it holds to the order of the swing itself.
    """
    from scipy.integrate import solve_ivp

    drive = compressor().drive_torque
    inertia, theta = drive.flywheel(0.01), np.arange(720) * 2.0 * math.pi / 720

    def slope(_, state):
        resisted = np.interp(state[0], theta, drive.torque, period=2.0 * math.pi)
        return [state[1], (drive.mean - resisted) / inertia]

    period = 2.0 * math.pi / drive.rate
    found = solve_ivp(slope, (0.0, period), [0.0, drive.rate], "DOP853", max_step=period / 500, rtol=1e-9)
    assert np.ptp(found.y[1]) / found.y[1].mean() == pytest.approx(0.01, rel=0.02)


def torque_of_the_loose_linkage(given, cycles, samples):
    """Torque (cycles, samples) that holds the crank's speed in the nonlinear twin of the loose wrist pin."""
    rate, gap, damping = given.crank_rate, given.wrist_clearance, given.wrist_damping
    crank, rod, mass = WRIST["crank"], WRIST["rod"], WRIST["rod_mass"]
    _, states = linkage_twins.wrist_pin(rate, gap, given.wrist_stiffness, damping, cycles, samples, **WRIST)
    time = np.arange(cycles * samples) * given.cycle_period / samples
    (swing, place, turn, speed), found = states.T, []
    for t, phi, spin, x, v, bent in zip(time, swing, turn, place, speed, np.gradient(turn, time), strict=True):
        along, across = np.array([math.cos(phi), math.sin(phi)]), np.array([-math.sin(phi), math.cos(phi)])
        out, ahead = (
            np.array([math.cos(rate * t), math.sin(rate * t)]),
            np.array([-math.sin(rate * t), math.cos(rate * t)]),
        )
        centre = -crank * rate**2 * out + 0.5 * rod * (bent * across - spin**2 * along)
        apart = np.array([x, 0.0]) - crank * out - rod * along
        drift = np.array([v, 0.0]) - crank * rate * ahead - rod * spin * across
        force = linkage_twins.pressed(apart, drift, gap, given.wrist_stiffness, damping)
        found.append(crank * float(ahead @ (mass * (centre + np.array([0.0, 9.81])) + force)))
    return np.reshape(found, (cycles, samples))


@pytest.mark.slow
def test_what_knocks_add_to_the_torque():
    """Where contact is well damped and the gap 0.1 % of the rod, the largest torque is right to 3 %; hard knocks add.

    With 0.5 mm and weak damping at 5,000 rpm the first knock takes more than twice the largest torque.
    """
    file = chaosgym.read_machine(FOLDER / "slider-crank-flores-wrist.toml")
    calm = with_settings(file, {"wrist_clearance": 1e-4, "wrist_damping": 1400.0})
    largest, (_, second) = calm.drive_torque.torque.max(), torque_of_the_loose_linkage(calm, 2, 3600)
    assert second.max() == pytest.approx(largest, rel=0.03)
    assert 0.0 < second.mean() < 1e-3 * largest
    (first,) = torque_of_the_loose_linkage(file, 1, 3600)
    assert first.max() > 2.0 * file.drive_torque.torque.max()


def test_friction_takes_its_torque(tmp_path):
    """A slider of 0.45 kg on a massless rod: m x'' = F (c - mu s |sin|), the torque F times its arm, at each angle."""
    text = template("slider-crank").replace('stations = "-40, 40 mm"', "friction = 0.3")
    for gone in ("[[link.rod.body]]", 'mass = "0.30 kg"', 'centre = "118, 0 mm"', 'inertia = "1.4e-3 kg m^2"'):
        text = text.replace(gone, "#", 1)
    (tmp_path / "own.toml").write_text(text.replace('gravity = "9.81 m/s^2"', 'gravity = "0 m/s^2"'))
    given = chaosgym.read_machine(tmp_path / "own.toml")
    theta, crank, rod = np.arange(720) * math.pi / 360.0, 0.05, 0.235
    low = np.sqrt(rod**2 - (crank * np.sin(theta)) ** 2)
    rate = -crank * np.sin(theta) - crank**2 * np.sin(theta) * np.cos(theta) / low
    second = np.fft.irfft(-(np.arange(361) ** 2) * np.fft.rfft(crank * np.cos(theta) + low), 720)
    along, across = low / rod, -crank * np.sin(theta) / rod
    rubbed = 0.3 * np.clip(rate / (0.02 * np.abs(rate).max()), -1.0, 1.0)
    inertia = 0.45 * given.crank_rate**2 * second
    force = inertia / (along - rubbed * np.abs(across) * np.sign(inertia))
    expected = force * crank * (np.cos(theta) * across - np.sin(theta) * along)
    np.testing.assert_allclose(given.drive_torque.torque, expected, atol=1e-6 * np.abs(expected).max())
    assert given.drive_torque.mean > 0.01 * np.abs(expected).max()


def test_friction_that_locks_is_told(tmp_path):
    """With a rod hardly longer than the crank, friction times the slope of the rod passes 1: no torque turns it."""
    text = template("slider-crank").replace('stations = "-40, 40 mm"', "friction = 0.5")
    for length, locks in ((60, False), (54, True)):
        (tmp_path / "own.toml").write_text(text.replace("235, 0 mm", f"{length}, 0 mm"))
        given = chaosgym.read_machine(tmp_path / "own.toml")
        assert (0.5 * 0.05 / math.sqrt((1e-3 * length) ** 2 - 0.05**2) > 1.0) == locks
        if not locks:
            assert given.drive_torque.mean > 0.0
            continue
        with pytest.raises(ParameterError, match=r"guide_friction = 0.5 locks the mechanism at crank angle \d+ deg"):
            _ = given.drive_torque


def test_friction_of_a_tilting_slider_takes_what_the_nonlinear_linkage_loses(tmp_path):
    """Mean torque with friction of 0.1 is what the surfaces of the twin take by friction in a cycle, to 3 %."""
    text = (FOLDER / "slider-crank-flores-guide.toml").read_text(encoding="utf-8")
    (tmp_path / "own.toml").write_text(text.replace("stations", "friction = 0.1\nstations"))
    given = with_settings(chaosgym.read_machine(tmp_path / "own.toml"), {"guide_clearance": 2e-5})
    surfaces = given.guide_clearance, given.guide_stiffness, 400.0
    force, states = linkage_twins.guide(given.crank_rate, *surfaces, 2, 1800, **GUIDE, friction=0.1)
    time = np.arange(3600) * given.cycle_period / 1800
    slid = GUIDE["crank"] * given.crank_rate * np.sin(given.crank_rate * time)
    slid = np.abs(slid + GUIDE["rod"] * states[:, 2] * np.sin(states[:, 0]))
    power = 0.1 * (force * slid)[1800:].mean()
    assert given.drive_torque.mean_power == pytest.approx(power, rel=0.03)


@pytest.mark.parametrize("swing", [0.0, -0.01, math.nan, math.inf, "1 %"])
def test_a_flywheel_needs_a_swing(swing):
    """None holds the speed still, and a swing is a share of it above zero."""
    with pytest.raises(ParameterError, match=r"swing = .* is out of range"):
        DriveTorque(np.sin(np.arange(12) * np.pi / 6.0), 10.0).flywheel(swing)


def test_a_constant_torque_needs_no_flywheel():
    """Nothing is taken up and given back."""
    assert DriveTorque(np.full(360, 3.0), 50.0).energy_swing == pytest.approx(0.0, abs=1e-12)


def test_commands_tell_it():
    """Show and simulate give torque and power in JSON and in words; a machine without crank says nothing."""
    expected = compressor(speed=1000.0).drive_torque.as_dict()
    where = str(FOLDER / "compressor.toml")
    for command in (["show"], ["simulate", "--cycles", "1"]):
        given = [*command, where, "--speed-rpm", "1000"]
        assert json.loads(CliRunner().invoke(app, [*given, "--json"]).stdout)["drive"] == expected
        assert "power 369.3 W on average" in CliRunner().invoke(app, given).stdout
    assert "drive" not in json.loads(CliRunner().invoke(app, ["show", "impact-beam", "--json"]).stdout)
