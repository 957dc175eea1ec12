"""Elements of mechanisms: gears, moments, springs, dampers and prescribed motions, against SciPy with events."""

import math
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym.errors import ParameterError
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.machines.mechanism.equations import assembled
from chaosgym.machines.mechanism.friction import tight_load
from chaosgym.machines.parameters import with_settings
from tests.machines.bodies import Bodies, Surface
from tests.machines.mechanisms import joint, surface

GEARS = f"""
[ground]
[ground.points]
shaft = "0, 0 mm"
axle = "80, 0 mm"

[link.wheel]
points = {{ centre = "0, 0 mm" }}

[link.pinion]
points = {{ centre = "0, 0 mm" }}
[[link.pinion.body]]
mass = "0.4 kg"
inertia = "1.6e-4 kg m^2"

{joint("drive", "revolute", "ground.shaft", "wheel.centre", "driven = true")}
{joint("bearing", "revolute", "ground.axle", "pinion.centre")}
{joint("mesh", "gear", "wheel.centre", "pinion.centre", surface("0.05 mm", "2 N/um", "30 N s/m"))}
radii = "60, 20 mm"
[[moment]]
at = "pinion.centre"
moment = "0.3 N m"

[[moment]]
at = "pinion.centre"
moment = "1.2 N m"
harmonic = 2
angle = "40 deg"

[[moment]]
at = "pinion.centre"
moment = "0, 0.2, 0.5, 0.2, 0, -0.3, -0.2 N m"

[[torsion_spring]]
between = ["ground.axle", "pinion.centre"]
damping = "2e-3 N m s/rad"

[operation]
speed = "600 rpm"
speed_range = "100 to 900 rpm"
clearance_range = "0.02 to 0.2 mm"
"""


def read(folder, text, *changes):
    """Machine of a file's text with some parts replaced."""
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    (folder / "machine.toml").write_text(text)
    return chaosgym.read_machine(folder / "machine.toml")


def sampled(values, angle):
    """The sum of harmonics through samples of a cycle."""
    values, count = np.asarray(values), len(values)
    parts = np.fft.fft(values) / count
    orders = np.fft.fftfreq(count, 1.0 / count)
    return float(np.real(np.sum(parts * np.exp(1j * orders * angle))))


def test_a_loose_gear_pair_is_that_of_scipy(tmp_path):
    """Backlash, three moments and a damper on the pinion: the path in the gap is SciPy's to 1e-6 of it.

    The wheel turns steadily, so that the pinion's turn from the nominal one is the only motion, and exact.
    """
    machine = read(tmp_path, GEARS)
    assert machine.degrees_of_freedom == ("mesh turn",)
    rate, radius, inertia, damper = 20.0 * math.pi, 0.02, 1.6e-4, 2e-3

    def pull(t):
        moment = 0.3 + 1.2 * math.sin(2.0 * rate * t + math.radians(40.0))
        moment += sampled([0.0, 0.2, 0.5, 0.2, 0.0, -0.3, -0.2], rate * t)
        return np.array([moment / radius + damper * 3.0 * rate / radius])

    one = np.array([1.0])
    bodies = Bodies(
        np.array([[inertia / radius**2]]),
        np.array([[damper / radius**2]]),
        np.zeros((1, 1)),
        pull,
        [Surface(sign * one, 0.05e-3, 2e6, 30.0) for sign in (1.0, -1.0)],
    )
    fine = with_settings(machine, {"fidelity": "fine"})
    record = chaosgym.simulate(fine, 2, integrator=TIGHTEST_EVENTS)
    expected = bodies.motion(np.zeros(2), [0.0, 0.1])
    assert record.impacts[0].sum() > 3
    assert np.abs(record.section[1, 0] - expected[1, 0]) < 1e-6 * 0.05e-3


def test_gears_and_belts_turn_by_their_radii(tmp_path):
    """A wheel of 60 mm turns a pinion of 20 mm three times against itself, an inner gear or a belt with itself."""
    for kind, radii, turns in (("gear", "60, 20 mm", -3.0), ("gear", "-60, 20 mm", 3.0), ("belt", "60, 20 mm", 3.0)):
        tight = ('clearance = "0.05 mm"\nstiffness = "2 N/um"\ndamping = "30 N s/m"\n', "")
        bearing = 'between = ["ground.axle", "pinion.centre"]\n[[joint]]'
        loose = bearing, bearing.replace("[[", surface("0.1 mm", "2 N/um", "30 N s/m") + "\n[[")
        machine = read(
            tmp_path, GEARS, tight, loose, ('kind = "gear"', f'kind = "{kind}"'), ('"60, 20 mm"', f'"{radii}"')
        )
        places = machine.nominal_places(np.array([0.0, 1.0]))
        spin = machine.mechanism.spin("pinion")
        assert places[1, spin] - places[0, spin] == pytest.approx(turns)
    with pytest.raises(ParameterError, match=r"by a part of a turn .let its slow shaft be driven.; allowed"):
        read(tmp_path, GEARS, tight, loose, ('"60, 20 mm"', '"20, 60 mm"'))


PRESS = f"""
[ground]
gravity = "9.81 m/s^2"
[ground.points]
foot = "0, 0 mm"
frame = "0, 400 mm"

[link.cam]
points = {{ top = "0, 0 mm" }}

[link.ram]
points = {{ roller = "0, 0 mm", head = "0, 150 mm" }}
[[link.ram.body]]
mass = "1.5 kg"
inertia = "1e-3 kg m^2"

{joint("lift", "prismatic", "ground.foot", "cam.top", 'axis = "90 deg"', 'turn = "0 deg"')}
{joint("guide", "prismatic", "ground.foot", "ram.roller", 'axis = "90 deg"')}
{joint("roller", "slot", "cam.top", "ram.roller", surface("0.1 mm", "3 N/um", "200 N s/m"))}
[[motion]]
joint = "lift"
displacement = "0, 1, 4, 7, 8, 7, 4, 1 mm"

[[spring]]
between = ["ground.frame", "ram.head"]
stiffness = "8 N/mm"
free_length = "270 mm"
preload = "-25 N"

[[damper]]
between = ["ground.frame", "ram.head"]
damping = "6 N s/m"

[operation]
speed = "700 rpm"
speed_range = "100 to 900 rpm"
clearance_range = "0.02 to 0.2 mm"
"""


HERTZ = (
    'stiffness = "3 N/um"\ndamping = "200 N s/m"',
    'hertz_stiffness = "8e7 N/m^1.2"\nexponent = 1.2\nrestitution = 0.7\nimpact_speed = "0.1 m/s"\n'
    'law = "lankarani-nikravesh"',
)


@pytest.mark.parametrize(
    ("changes", "surface"),
    [([], {"stiffness": 3e6, "damping": 200.0}), ([HERTZ], {"stiffness": 8e7, "exponent": 1.2, "loss": 0.75 * 5.1})],
    ids=["linear", "a law of Lankarani and Nikravesh, exponent 1.2"],
)
def test_a_prescribed_lift_is_that_of_scipy(tmp_path, changes, surface):
    """A ram with weight, preloaded spring and damper on a cam of prescribed rise: the gap is SciPy's to 1e-6 of it."""
    machine = with_settings(read(tmp_path, PRESS, *changes), {"fidelity": "fine"})
    assert machine.degrees_of_freedom == ("roller across",)
    rate, mass, rise = 700.0 * math.pi / 30.0, 1.5, 1e-3 * np.array([0, 1, 4, 7, 8, 7, 4, 1])

    def lift(angle):
        parts, orders = np.fft.fft(rise) / 8, np.fft.fftfreq(8, 1.0 / 8)
        turned = parts * np.exp(1j * orders * angle)
        return (float(np.real(np.sum(turned * (1j * orders) ** k))) for k in range(3))

    def pull(t):
        height, slope, bend = lift(rate * t)
        # the spring is 400 - 150 mm long less the lift, and pushes as it is shorter than without force
        tension = 8e3 * (0.25 - height - 0.27) - 25.0
        return np.array([tension - mass * 9.81 - 6.0 * rate * slope - mass * rate**2 * bend])

    one = np.array([1.0])
    bodies = Bodies(
        np.array([[mass]]), np.array([[6.0]]), np.array([[8e3]]), pull,
        [Surface(sign * one, 0.1e-3, **surface) for sign in (1.0, -1.0)],
    )  # fmt: skip
    record = chaosgym.simulate(machine, 2, integrator=TIGHTEST_EVENTS)
    expected = bodies.motion(np.zeros(2), [0.0, 60.0 / 700.0])
    assert record.impacts[0].sum() > 1
    assert np.abs(record.section[1, 0] - expected[1, 0]) < 1e-6 * 0.1e-3
    with pytest.raises(ParameterError, match=r"driven and prismatic; allowed: revolute, or a \[\[motion\]\]"):
        read(tmp_path, PRESS, ('name = "guide"', 'driven = true\nname = "guide"'))


def test_a_restitution_is_that_of_an_impact(tmp_path):
    """The damper of the stated 0.6 makes the ram leave a stop with 0.6 of its speed, by SciPy, to 1e-4."""
    changes = ('damping = "200 N s/m"', "restitution = 0.6"), ('gravity = "9.81 m/s^2"', 'gravity = "0 m/s^2"')
    damper = read(tmp_path, PRESS, *changes).roller_damping
    one = np.array([1.0])
    impact = Bodies(
        np.array([[1.5]]), np.zeros((1, 1)), np.zeros((1, 1)), lambda t: np.zeros(1), [Surface(one, 0.0, 3e6, damper)]
    )
    left = impact.motion(np.array([0.0, 0.2]), [0.0, 0.01])[-1]
    assert -left[1] == pytest.approx(0.6 * 0.2, rel=1e-4)


def test_the_drive_takes_the_work_of_a_prescribed_motion(tmp_path):
    """The power at constant speed is that of weight, inertia, spring and damper along the lift, to 1e-9."""
    machine = read(tmp_path, PRESS)
    rate, theta = machine.crank_rate, np.arange(720) * 2.0 * math.pi / 720
    rise = np.fft.fft(1e-3 * np.array([0, 1, 4, 7, 8, 7, 4, 1])) / 8
    orders = np.fft.fftfreq(8, 1.0 / 8)
    rise[4] = 0.0
    height, slope, bend = (
        np.real(np.exp(1j * np.outer(theta, orders)) @ (rise * (1j * orders) ** k)) for k in range(3)
    )
    force = 1.5 * (9.81 + rate**2 * bend) - (8e3 * (-0.02 - height) - 25.0) + 6.0 * rate * slope
    np.testing.assert_allclose(machine.drive_torque.torque, force * slope, atol=1e-9 * np.abs(force * slope).max())


FLORES = Path(__file__).parents[2] / "docs" / "machines" / "slider-crank-flores-wrist.toml"


def with_tight_friction(folder, guide=0.2, pin=0.3, radius=0.01):
    """The slider crank with a loose wrist pin, friction in its tight guide and around its tight crank pin."""
    text = FLORES.read_text(encoding="utf-8")
    for name, more in (("guide", f"friction = {guide}"), ("pin", f'friction = {pin}\nradius = "{radius} m"')):
        assert f'name = "{name}"' in text
        text = text.replace(f'name = "{name}"', f'name = "{name}"\n{more}')
    return read(folder, text)


def forces_by_newton(theta, rate, guide, pin, radius):
    """Torque of the crank, and force of the wrist pin on the slider (2, B), of rod and slider by Newton's laws."""
    crank, rod, mass, inertia, slider, small = 0.05, 0.12, 0.21, 2.5e-4, 0.14, 1e-4

    def place(angle):
        phi = -np.arcsin(crank / rod * np.sin(angle))
        start = crank * np.array([np.cos(angle), np.sin(angle)])
        along = np.array([np.cos(phi), np.sin(phi)])
        return start + 0.5 * rod * along, (start + rod * along)[0], phi

    def second(of):
        return rate**2 * (of(theta + small) - 2.0 * of(theta) + of(theta - small)) / small**2

    phi = place(theta)[2]
    middle, travel, turn = (second(lambda angle, k=k: place(angle)[k]) for k in range(3))
    slope = (place(theta + small)[1] - place(theta - small)[1]) / (2.0 * small)
    spin = (place(theta + small)[2] - place(theta - small)[2]) / (2.0 * small) - 1.0
    faded = [np.clip(each / (0.02 * np.abs(each).max()), -1.0, 1.0) for each in (slope, spin)]
    across = np.array([-np.sin(phi), np.cos(phi)])
    push, moment = np.zeros_like(theta), np.zeros_like(theta)
    for _ in range(200):
        # force of the wrist on the slider, from the slider along x and from the rod's turn about its middle
        x = slider * travel + push
        # start + end = mass a, and end x rod/2 - start x rod/2 + moment = inertia turn, of forces on the rod
        total = mass * (middle + np.array([np.zeros_like(theta), np.full_like(theta, 9.81)]))
        # end = (-x, -y); across . (end - start) rod / 2 + moment = inertia turn
        needed = (inertia * turn + moment) / (0.5 * rod) + (across * total).sum(axis=0)
        y = -(needed / 2.0 + across[0] * x) / across[1]
        start = total + np.array([x, y])
        normal = slider * 9.81 - y
        push = guide * np.abs(normal) * faded[0]
        # the pin's force is that of its hole and of friction along it
        moment = pin * radius * np.hypot(*start) / np.hypot(1.0, pin * faded[1]) * faded[1]
    pulled = start[0] * -crank * np.sin(theta) + start[1] * crank * np.cos(theta)
    return pulled - moment, np.array([x, y])


def test_a_tight_pin_rubs_as_a_loose_one(tmp_path):
    """The torque that friction of wrist and guide takes from the drive is the same, whichever of them has the gap."""
    surface = 'clearance = "0.1 mm"\nstiffness = "3 N/um"\ndamping = "1400 N s/m"'
    wrist, guide = 'friction = 0.3\nradius = "10 mm"', "friction = 0.2"
    text = FLORES.read_text(encoding="utf-8")
    tight = "\n".join(line for line in text.splitlines() if not line.startswith(("clearance =", "stiff", "damping")))
    torques = []
    for first, second in ((f"{wrist}\n{surface}", guide), (wrist, f"{guide}\n{surface}")):
        changes = ('name = "wrist"', f'name = "wrist"\n{first}'), ('name = "guide"', f'name = "guide"\n{second}')
        torques.append(read(tmp_path, tight, *changes).drive_torque.torque)
    np.testing.assert_allclose(*torques, rtol=1e-8)


def test_friction_in_tight_joints_is_that_of_newtons_laws(tmp_path):
    """Torque of the drive and force in the loose pin with friction in guide and crank pin, to 1e-5 of the largest."""
    machine = with_tight_friction(tmp_path)
    theta = np.arange(720) * 2.0 * math.pi / 720
    torque, force = forces_by_newton(theta, machine.crank_rate, 0.2, 0.3, 0.01)
    found = machine.drive_torque.torque
    assert np.abs(found - torque).max() < 1e-5 * np.abs(torque).max()
    free = with_tight_friction(tmp_path, 0.0, 0.0).drive_torque.torque
    assert np.abs(found - free).max() > 0.02 * np.abs(torque).max()
    whole = assembled(machine.scaled(), machine.revolution, matrices=False, rubbing=machine.rubs)
    load = np.tensordot(machine.crank_rate ** np.arange(3), whole.load_at(theta), 1) + tight_load(machine, whole, theta)
    assert np.abs(np.hypot(*load.T) - np.hypot(*force)).max() < 1e-5 * np.hypot(*force).max()
    assert any("friction in" in note and "nominal motion" in note for note in machine.notes)
    record = chaosgym.simulate(with_settings(machine, {"wrist_damping": 1400.0}), 1, transient=1)
    assert np.isfinite(record.peak_force).all()


WEDGE = f"""
[ground]
gravity = "9.81 m/s^2"
points = {{ foot = "0, 0 mm" }}

[link.wedge]
points = {{ top = "0, 0 mm" }}

[link.ram]
points = {{ roller = "0, 0 mm" }}
body = [{{ mass = "1.5 kg", inertia = "1e-3 kg m^2" }}]

{joint("lift", "prismatic", "ground.foot", "wedge.top", 'axis = "90 deg"')}
{joint("guide", "prismatic", "ground.foot", "ram.roller", 'axis = "60 deg"', surface("0.05 mm", "2 N/um", "900 N s/m"))}
friction = 0.2
static_friction = 0.5
stribeck_speed = "0.1 m/s"
regularisation_speed = "0.04 m/s"
{joint("roller", "slot", "wedge.top", "ram.roller", surface("0.1 mm", "3 N/um", "1200 N s/m"))}
friction = 0.3
regularisation_speed = "0.02 m/s"
[[motion]]
joint = "lift"
displacement = "8 mm"

[operation]
speed = "500 rpm"
speed_range = "100 to 900 rpm"
clearance_range = "0.02 to 0.2 mm"
"""

HERTZIAN = (
    ('stiffness = "2 N/um"\ndamping = "900 N s/m"', 'hertz_stiffness = "2e8 N/m^1.5"\nhertz_damping = "20 s/m"'),
    ('stiffness = "3 N/um"\ndamping = "1200 N s/m"', 'hertz_stiffness = "3e8 N/m^1.5"\nhertz_damping = "20 s/m"'),
)


def wedge_in_scipy(laws):
    """The ram on its wedge in coordinates of the ground, by its own laws of contact and friction."""
    rate, lift, mass, slope = 500.0 * math.pi / 30.0, 8e-3, 1.5, math.radians(60.0)
    along, across = np.array([math.cos(slope), math.sin(slope)]), np.array([-math.sin(slope), math.cos(slope)])
    to_guide, level, up = lift * rate / math.sin(slope), np.array([1.0, 0.0]), np.array([0.0, 1.0])
    to_wedge = lift * rate / math.tan(slope)

    def in_guide(t):
        speed = to_guide * math.cos(rate * t)
        fall = 0.3 * math.exp(-((speed / 0.1) ** 2))
        return (0.2 + fall) * min(1.0, max(-1.0, speed / 0.04)) * along

    def on_wedge(t):
        return 0.3 * min(1.0, max(-1.0, to_wedge * math.cos(rate * t) / 0.02)) * level

    def pull(t):
        bend = -lift * rate**2 * math.sin(rate * t)
        return -mass * np.array([bend / math.tan(slope), bend + 9.81])

    surfaces = [Surface(side * across, 0.05e-3, **laws[0], drag=in_guide) for side in (1.0, -1.0)]
    surfaces += [Surface(side * up, 0.1e-3, **laws[1], drag=on_wedge) for side in (1.0, -1.0)]
    return Bodies(mass * np.eye(2), np.zeros((2, 2)), np.zeros((2, 2)), pull, surfaces), np.array([across, up])


@pytest.mark.parametrize(
    ("changes", "laws"),
    [
        ((), [{"stiffness": 2e6, "damping": 900.0}, {"stiffness": 3e6, "damping": 1200.0}]),
        (HERTZIAN, [{"stiffness": stiff, "exponent": 1.5, "loss": 20.0} for stiff in (2e8, 3e8)]),
    ],
    ids=["linear", "Hertzian"],
)
def test_two_loose_joints_rub_as_in_scipy(tmp_path, changes, laws):
    """A ram whose guide and wedge rub, one by Stribeck's law: SciPy's motion to 2e-4 of the gap, to 2e-5 in finer bins.

    Friction is held over each bin.
    """
    bodies, gaps = wedge_in_scipy(laws)
    expected = gaps @ bodies.motion(np.zeros(4), [0.0, 0.12])[1, :2]

    def error(**settings):
        machine = with_settings(read(tmp_path, WEDGE, *changes), settings)
        assert machine.degrees_of_freedom == ("guide across", "roller across")
        record = chaosgym.simulate(machine, 1, integrator=TIGHTEST_EVENTS)
        return np.abs(record.final_state.coordinates[:2] - expected).max() / 0.1e-3

    assert error() < 2e-4
    assert error(matrix_update_interval=0.5) < 2e-5
    for field, value in (("guide_friction", 0.19), ("guide_static_friction", 0.4), ("roller_friction", 0.29)):
        assert error(**{field: value}) > 5e-4, field
