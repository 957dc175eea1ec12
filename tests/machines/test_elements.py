"""Elements of gap files: ratios, stops at one point, loads, springs and free motion, against SciPy with events."""

import math

import numpy as np
import pytest
from click.testing import CliRunner

import chaosgym
from chaosgym.cli import app
from chaosgym.errors import ParameterError
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.machines.modal_machine.varying import means
from chaosgym.machines.parameters import origin_of, with_settings
from tests.machines.bodies import Bodies, Surface

ARCMIN = math.pi / 10_800.0

GEARED = """
[structure]
frequencies = "0, 0 Hz"
modal_damping = ["0, 0 1/s", "0, 0 1/s"]
modal_masses = ["0.8 kg cm^2", "30 kg cm^2"]

[structure.shapes]
motor = "1, 0"
wheel = "0, 1"

[joint]
at = "motor - 3 wheel"
clearance = "10 arcmin"
stiffness = "400 N m/rad"
damping = "0.02 N m s/rad"

[[spring]]
at = "wheel"
stiffness = "25 N m/rad"
damping = "0.01 N m s/rad"

[[load]]
at = "wheel"
force = "-0.4 N m"

[[drive]]
at = "motor"
force = "0.5 N m"

[operation]
speed = "7 Hz"
speed_range = "4 to 20 Hz"
clearance_range = "1 to 20 arcmin"
"""


def read(folder, text, *changes):
    """Machine of a file's text with some parts replaced."""
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "machine.toml").write_text(text)
    return chaosgym.read_machine(folder / "machine.toml")


def in_bodies(machine, points, section):
    """States (k, 2n) of the bodies at some points, of modal coordinates (k, 2n)."""
    shapes = np.array([machine.modes.shape(point) for point in points])
    q, v = np.split(np.atleast_2d(section), 2, axis=1)
    return np.hstack([q @ shapes.T, v @ shapes.T])


def follows(machine, points, bodies, gap, cycles=1, start=None, tolerance=1e-6):
    """The machine's bodies at the ends of some cycles are those of SciPy to a share of the gap; returns the record."""
    record = chaosgym.simulate(machine, cycles + 1, integrator=TIGHTEST_EVENTS)
    own = in_bodies(machine, points, record.section)
    instants = np.arange(cycles + 1) * machine.cycle_period
    expected = bodies.motion(np.zeros(2 * len(points)) if start is None else start, instants)
    assert record.impacts[:cycles].sum() > 0
    assert np.abs(own - expected)[:, : len(points)].max() < tolerance * gap
    return record


def test_a_ratio_at_the_gap_is_that_of_scipy(tmp_path):
    """A gear pair of ratio 3 with backlash, drag and a spring: both angles are SciPy's to 1e-6 of the backlash."""
    machine = read(tmp_path, GEARED)
    row, wheel = np.array([1.0, -3.0]), np.array([0.0, 1.0])
    omega = 2.0 * math.pi * 7.0
    bodies = Bodies(
        np.diag([0.8e-4, 30e-4]),
        0.01 * np.outer(wheel, wheel),
        25.0 * np.outer(wheel, wheel),
        lambda t: np.array([0.5 * math.sin(omega * t), -0.4]),
        [Surface(sign * row, 10.0 * ARCMIN, 400.0, 0.02) for sign in (1.0, -1.0)],
    )
    record = follows(machine, ("motor", "wheel"), bodies, 10.0 * ARCMIN)
    assert record.impacts.sum() > 3


def test_a_radius_at_the_gap_makes_turns_a_path(tmp_path):
    """``20 mm motor - 60 mm wheel`` in m and N is ``motor - 3 wheel`` in rad and N m, to 1e-9 of the force."""
    turns = read(tmp_path, GEARED)
    path = (
        ("motor - 3 wheel", "20 mm motor - 60 mm wheel"),
        ('"10 arcmin"', f'"{20.0 * 10.0 * ARCMIN} mm"'),
        ('"400 N m/rad"', '"1e6 N/m"'),
        ('"0.02 N m s/rad"\n\n[[spring', '"50 N s/m"\n\n[[spring'),
        ('"1 to 20 arcmin"', '"0.01 to 0.1 mm"'),
    )
    slides = read(tmp_path, GEARED, *path)
    both = [chaosgym.simulate(machine, 2).peak_force for machine in (turns, slides)]
    np.testing.assert_allclose(both[0], 0.02 * both[1], rtol=1e-9)


SOFT_THEN_HARD = """
[structure]
frequencies = "5 Hz"
damping_ratios = "1 %"
modal_masses = "2 kg"

[structure.shapes]
mass = "1"

[[joint]]
name = "rubber"
at = "mass"
clearance = "1 mm"
stops = "one"
stiffness = "20 N/mm"
damping = "15 N s/m"

[[joint]]
name = "steel"
at = "mass"
clearance = "1.5 mm"
stops = "one"
stiffness = "2 N/um"
restitution = 0.6

[[joint]]
name = "other_side"
at = "-mass"
clearance = "1 mm"
stops = "one"
stiffness = "100 N/mm"
damping = "0 N s/m"

[[load]]
at = "mass"
force = "-19.6133 N"

[[drive]]
at = "mass"
force = "20 N"

[operation]
speed = "6.5 Hz"
speed_range = "4 to 10 Hz"
clearance_range = "0.5 to 2 mm"
"""


def test_a_soft_and_a_hard_stop_at_one_point(tmp_path):
    """One mass, its weight, rubber and behind it steel, and a third stop: SciPy's motion to 1e-6 of the gap."""
    machine = read(tmp_path, SOFT_THEN_HARD)
    omega, rate = 2.0 * math.pi * 6.5, 2.0 * math.pi * 5.0
    steel = machine.steel_damping
    up, down = np.array([1.0]), np.array([-1.0])
    bodies = Bodies(
        np.array([[2.0]]),
        np.array([[2.0 * 2.0 * 0.01 * rate]]),
        np.array([[2.0 * rate**2]]),
        lambda t: np.array([20.0 * math.sin(omega * t) - 19.6133]),
        [Surface(up, 1e-3, 2e4, 15.0), Surface(up, 1.5e-3, 2e6, steel), Surface(down, 1e-3, 1e5)],
    )
    record = follows(machine, ("mass",), bodies, 1e-3, cycles=3)
    impacts = dict(zip(machine.sides, record.impacts.sum(axis=0), strict=True))
    assert min(impacts[f"{name} upper"] for name in machine.joints) > 0
    assert machine.surfaces.keys() == {"rubber upper", "steel upper", "other_side upper"}


HERTZIAN = """
[structure]
frequencies = "0 Hz"
modal_damping = ["4 1/s"]
modal_masses = "0.5 kg"

[structure.shapes]
ball = "1"

[[joint]]
name = "floor"
at = "-ball"
clearance = "0.5 mm"
stops = "one"
hertz_stiffness = "{stiffness} N/m^{exponent}"
exponent = {exponent}
{loss}

[[joint]]
name = "roof"
at = "ball"
clearance = "0.4 mm"
stops = "one"
stiffness = "1 N/um"
damping = "40 N s/m"

[[spring]]
at = "ball"
stiffness = "0.5, 0.7, 0.9, 0.7, 0.5, 0.3, 0.1, 0.3 N/mm"

[[load]]
at = "ball"
force = "-4.9 N"

[[drive]]
at = "ball"
force = "9 N"

[operation]
speed = "22 Hz"
speed_range = "10 to 40 Hz"
clearance_range = "0.2 to 1 mm"
monitored = "floor"
"""


@pytest.mark.parametrize(
    ("exponent", "stiffness", "loss", "chi"),
    [
        (1.5, 3e8, 'hertz_damping = "0.8 s/m"', 0.8),
        (10.0 / 9.0, 8e6, 'restitution = 0.6\nimpact_speed = "0.2 m/s"\nlaw = "flores"', 1.6 * 0.4 / 0.6 / 0.2),
        (2.0, 1e10, 'restitution = 0.8\nimpact_speed = "0.2 m/s"\nlaw = "lankarani-nikravesh"', 0.75 * 0.36 / 0.2),
    ],
    ids=["Hertz", "an exponent of 10/9", "an exponent of 2"],
)
def test_hertzian_stops_of_any_exponent(tmp_path, exponent, stiffness, loss, chi):
    """A ball on a Hertzian floor, below a linear roof, on a spring over the cycle: SciPy's motion to 1e-6 of the gap.

    The spring is held over parts of a quarter of a degree on both sides.
    """
    text = HERTZIAN.format(exponent=repr(exponent), stiffness=stiffness, loss=loss)
    machine = with_settings(read(tmp_path, text), {"fidelity": "reference"})
    assert machine.moving.how.startswith("Taylor series")
    values = means(1e3 * np.array([0.5, 0.7, 0.9, 0.7, 0.5, 0.3, 0.1, 0.3]), machine.bins)
    omega, one, period = 44.0 * math.pi, np.array([1.0]), 1.0 / 22.0
    surfaces = [Surface(-one, 0.5e-3, stiffness, exponent=exponent, loss=chi), Surface(one, 0.4e-3, 1e6, 40.0)]
    state, instants = np.zeros(2), np.arange(machine.bins + 1) * period / machine.bins
    for begin, end, spring in zip(instants, instants[1:], values, strict=False):
        bodies = Bodies(
            np.array([[0.5]]), np.array([[0.5 * 4.0]]), np.array([[spring]]),
            lambda t: np.array([9.0 * math.sin(omega * t) - 4.9]), surfaces,
        )  # fmt: skip
        state = bodies.motion(state, [begin, end], steps=1)[-1]
    record = chaosgym.simulate(machine, 2, integrator=TIGHTEST_EVENTS)
    own = in_bodies(machine, ("ball",), record.section)[1]
    assert record.impacts[0].sum() > 0
    assert np.abs(own[0] - state[0]) < 1e-6 * 0.5e-3


RUBBED = """
[structure]
frequencies = "6, 9 Hz"
damping_ratios = "1 %"
modal_masses = "1, 2 kg"
shapes = { block = "1, 0", belt = "0, 1" }

[[joint]]
name = "stop"
at = "block"
clearance = "1 mm"
hertz_stiffness = "4e6 N/m^1.5"
hertz_damping = "1 s/m"
friction = 0.4
slides = "belt"

[[joint]]
name = "other"
at = "belt"
clearance = "1.5 mm"
stiffness = "20 N/mm"
damping = "20 N s/m"
friction = 0.3
slides = "-block"

[[drive]]
at = "block"
force = "6 N"

[operation]
speed = "5 Hz"
speed_range = "4 to 20 Hz"
clearance_range = "0.1 to 2 mm"
"""


def test_two_joints_that_slide_one_way_rub_beside_hertzian_stops(tmp_path):
    """Each newton on a stop pulls the stated point back by its coefficient: SciPy's motion to 1e-6 of the gap."""
    machine = with_settings(read(tmp_path, RUBBED), {"fidelity": "fine"})
    mass, omega = np.array([1.0, 2.0]), 2.0 * math.pi * np.array([6.0, 9.0])
    block, belt = np.eye(2)

    def surfaces(row, gap, pulled, **law):
        return [Surface(side * row, gap, **law, drag=lambda t: pulled) for side in (1.0, -1.0)]

    bodies = Bodies(
        np.diag(mass), np.diag(0.02 * omega * mass), np.diag(omega**2 * mass),
        lambda t: 6.0 * math.sin(10.0 * math.pi * t) * block,
        [
            *surfaces(block, 1e-3, 0.4 * belt, stiffness=4e6, exponent=1.5, loss=1.0),
            *surfaces(belt, 1.5e-3, -0.3 * block, stiffness=2e4, damping=20.0),
        ],
    )  # fmt: skip
    record = chaosgym.simulate(machine, 2, integrator=TIGHTEST_EVENTS)
    expected = bodies.motion(np.zeros(4), [0.0, 0.4])[1]
    shapes = np.array([machine.modes.shape(name) for name in ("block", "belt")])
    found = shapes @ record.final_state.coordinates[:2]
    assert record.impacts.sum() > 2
    assert np.abs(found - expected[:2]).max() < 1e-6 * 1e-3


WEIGHED = """
[structure]
frequencies = "20 Hz"
damping_ratios = "2 %"
modal_masses = "2 kg"
shapes = { x = "1", base = "2 kg" }

[joint]
at = "x"
clearance = "0.5 mm"
stiffness = "500 N/mm"
damping = "100 N s/m"

[[load]]
acceleration = "9.81 m/s^2"

[[drive]]
at = "x"
force = "60 N"

[operation]
speed = "15 Hz"
speed_range = "8 to 30 Hz"
clearance_range = "0.05 to 1 mm"
"""


def test_the_weight_is_mass_times_gravity_in_every_scale_of_the_shapes(tmp_path):
    """A body of 2 kg weighs 19.62 N, whether its shape is 1, 1/2, or mass-normalised."""
    weight = ('acceleration = "9.81 m/s^2"', 'at = "x"\nforce = "-19.62 N"')
    expected = chaosgym.simulate(read(tmp_path, WEIGHED, weight), 5).peak_force
    half = ('modal_masses = "2 kg"', 'modal_masses = "0.5 kg"'), ('x = "1", base = "2 kg"', 'x = "0.5", base = "1 kg"')
    normalised = ('modal_masses = "2 kg"\n', ""), ('"1"', f'"{0.5**0.5} kg^-1/2"'), ('"2 kg"', f'"{2.0**0.5} kg^1/2"')
    for changes in ((), half, normalised):
        found = chaosgym.simulate(read(tmp_path, WEIGHED, *changes), 5).peak_force
        np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_a_pendulum_on_a_moving_pivot_takes_the_moment_of_its_mass_along(tmp_path):
    """Of 2 kg at 0.5 m: an acceleration of its pivot is a torque of mass times arm times it."""
    arm = (
        ('"2 kg"\nshapes', '"0.5 kg m^2"\nshapes'),
        ('base = "2 kg"', 'base = "1 kg m"'),
        ("0.5 mm", "0.5 mrad"),
        ("500 N/mm", "5e5 N m/rad"),
        ("100 N s/m", "100 N m s/rad"),
        ("60 N", "60 N m"),
        ("0.05 to 1 mm", "0.05 to 1 mrad"),
    )
    found = chaosgym.simulate(read(tmp_path, WEIGHED, *arm), 5).peak_force
    torque = ('acceleration = "9.81 m/s^2"', 'at = "x"\nforce = "-9.81 N m"')
    expected = chaosgym.simulate(read(tmp_path, WEIGHED, *arm, torque), 5).peak_force
    np.testing.assert_allclose(found, expected, rtol=1e-12)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('"2 kg" }', '"1" }', "base = '1' has no unit of a mass; .* write it in kg, or in kg m if the base turns"),
        ('"2 kg" }', '"2 kg m^2" }', "write it in kg, or in kg m if the base turns"),
        ('"2 kg" }', '"1.414 kg^1/2" }', "mass-normalised, .*; allowed: a mass, or no modal_masses"),
        ('x = "1"', 'x = "0.7 kg^-1/2"', "shapes.x = '0.7 kg.-1/2' is mass-normalised, .*; allowed: no unit"),
        (
            'modal_masses = "2 kg"\nshapes = { x = "1"',
            'shapes = { x = "1 kg^-1/2"',
            "base = '2 kg' has no unit; .*kg.1/2",
        ),
    ],
)
def test_shapes_of_another_scale_than_stated_are_refused(tmp_path, old, new, message):
    """A participation or a shape in a unit that the modal masses do not go with changes no force unsaid."""
    with pytest.raises(ParameterError, match=message):
        read(tmp_path, WEIGHED, (old, new))


COUPLED = GEARED.replace('at = "wheel"\nstiffness', 'at = "motor - 2 wheel"\nstiffness')


def test_a_start_with_units_is_that_of_the_shapes_as_written(tmp_path):
    """Angles and rates of both bodies, in any scale of the modes and with a spring that changes the modes."""
    start = '[operation]\ninitial_state = "4, -1 mrad, 0.2, 300 deg/s"'
    machine = read(tmp_path, COUPLED, ("[operation]", start.replace("300 deg/s", "0.1 rad/s")))
    expected = [[4e-3, -1e-3, 0.2, 0.1]]
    np.testing.assert_allclose(in_bodies(machine, ("motor", "wheel"), machine.initial_state), expected, rtol=1e-12)
    assert chaosgym.simulate(machine, 1).section[0].tolist() == list(machine.initial_state)
    own = read(tmp_path, COUPLED, ("[operation]", start)).initial_state
    assert in_bodies(machine, ("wheel",), own)[0, 1] == pytest.approx(math.radians(300.0))
    normalised = ('modal_masses = "2 kg"\n', ""), ('"1"', '"1 kg^-1/2"'), ("2 kg", "1 kg^1/2")
    kept = read(tmp_path, WEIGHED, *normalised, ("[operation]", '[operation]\ninitial_state = "1e-3, 0.5"'))
    assert kept.initial_state == (1e-3, 0.5), "numbers alone are of the modes, where these are the shapes' own"


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ("1e-3, 0", "has no units; .* such as '1e-3 m, 0 m/s'"),
        ("1 mm, 0", "'0' has no unit .allowed: m/s, mm/s"),
        ("1 mrad, 0 m/s", "unknown unit 'mrad'"),
        ("1 mm, 0 m/s, 0 m/s", "has 3 numbers; allowed: 2, displacements, then velocities"),
    ],
)
def test_a_start_of_unknown_scale_is_refused(tmp_path, given, message):
    """Beside modal masses a number alone could be of the mode or of the shape."""
    with pytest.raises(ParameterError, match=message):
        read(tmp_path, WEIGHED, ("[operation]", f'[operation]\ninitial_state = "{given}"'))


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('at = "x"\nclearance', 'at = "x/3"\nclearance', "no point 'x/3'; a factor stands before its point: 1/3 x"),
        (
            ', base = "2 kg"',
            "",
            r"no point 'base'; a base that moves needs base in \[structure.shapes\], or",
        ),
        (
            'speed_range = "8 to 30 Hz"\nclearance_range = "0.05 to 1 mm"',
            "",
            r"\[operation\] lacks speed_range and clearance_range",
        ),
    ],
)
def test_a_line_says_what_to_write(tmp_path, old, new, message):
    """Where a factor stands, where the base stands, and every key that is missing."""
    with pytest.raises(ParameterError, match=message):
        read(tmp_path, WEIGHED, (old, new))


@pytest.mark.parametrize("unit", ["N/m^(10/9)", "N/m^1.1111111111111112", "N/m^1.11"])
def test_an_exponent_may_be_a_ratio(tmp_path, unit):
    """10/9 as a text is that number, and the unit of K may round it."""
    surface = 'stiffness = "500 N/mm"\ndamping = "100 N s/m"'
    law = f'hertz_stiffness = "1e6 {unit}"\nhertz_damping = "1 s/m"\nexponent = '
    ratio, decimal = (read(tmp_path, WEIGHED, (surface, law + power)) for power in ('"10/9"', "1.1111111111111112"))
    assert ratio.joint_stiffness == decimal.joint_stiffness == 1e6
    np.testing.assert_array_equal(chaosgym.simulate(ratio, 2).peak_force, chaosgym.simulate(decimal, 2).peak_force)
    for wrong, message in (('"ten"', "exponent = 'ten' is no exponent; allowed: such as"), ("1.2", "does not go with")):
        with pytest.raises(ParameterError, match=message):
            read(tmp_path, WEIGHED, (surface, law + wrong))


def test_what_a_file_leaves_out_is_no_statement_of_it(tmp_path):
    """Of several joints: an offset of 0 that no line states is the default, a stated gap the file's."""
    machine = read(tmp_path, SOFT_THEN_HARD)
    origins = {what: origin_of(machine, f"steel_{what}")[0] for what in ("offset", "preload", "clearance", "stops")}
    assert origins == {"offset": "assumed", "preload": "assumed", "clearance": "stated", "stops": "stated"}


def test_a_joint_of_several_is_named_where_its_sides_are_not(tmp_path):
    """With a spring over the cycle results are those of one joint: `simulate` says of which."""
    spring = '[[spring]]\nat = "mass"\nstiffness = "900, 1000, 1100 N/m"\n\n[operation]\nmonitored = "steel"'
    read(tmp_path, SOFT_THEN_HARD, ("[operation]", spring))
    told = CliRunner().invoke(app, ["simulate", str(tmp_path / "machine.toml"), "--cycles", "2"]).stdout
    assert "monitored joint           steel\n" in told
    read(tmp_path, SOFT_THEN_HARD)
    assert "monitored" not in CliRunner().invoke(app, ["simulate", str(tmp_path / "machine.toml")]).stdout
