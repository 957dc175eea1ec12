"""A joint that rubs and stiffness that varies over the cycle, held against SciPy's DOP853 and closed forms."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import chaosgym
from chaosgym.cli import app
from chaosgym.design.bent_section import Bending, Section, fibres
from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.varying import HeldSpring, means
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation.run import simulate_with_deviations

MACHINES = Path(__file__).parents[2] / "docs" / "machines"

STRUCTURE = chaosgym.Structure.of_modes([9.0, 61.0], 0.02, {"tip": [2.1, -1.9], "side": [0.7, 1.5]})
DRIVES = chaosgym.Drive.sine("force", "tip", 8.9), chaosgym.Drive.sine("unbalance", "side", 2e-4, 2, 0.4)
JOINT = {"clearance": 1e-4, "stiffness": 1e6, "damping": 20.0, "offset": 2e-5, "lower_stiffness_factor": 0.7}


def built(structure=STRUCTURE, drives=DRIVES, springs=(), speed=19.0, at="tip", operation=None, **joint):
    """Machine whose only joint, "joint", is ``JOINT`` with some changes."""
    joints = {"joint": chaosgym.Joint(at, **{**JOINT, **joint})}
    return chaosgym.machine_with_joints(structure, joints, drives, springs=springs)(speed=speed, **(operation or {}))


MESH = tuple(float(value) for value in 1.0 + 0.4 * np.cos(np.arange(24) * math.pi / 12.0) + 0.1 * (np.arange(24) > 9))
HOLDING = HeldSpring("side", tuple(2e4 * (1.0 + np.sin(np.arange(40) * math.pi / 20.0))))


def dop853(machine, cycles, held=True):
    """States (cycles + 1, 2n) by DOP853 with events, from the equations in the docstring of ``held_joints``.

    Stiffness is held as the machine holds it, or continuous: the straight lines between its samples.
    """
    n, rate, bins = machine.n_states // 2, 2.0 * math.pi * machine.speed, machine.bins
    phi, tau = machine.display, np.zeros(n)
    if machine.slides:
        tau = machine.joint_friction * machine.modes.shape(machine.slides["joint"])
    squares, damping = machine.modes.angular_frequency**2, machine.modes.damping
    k = np.array([1.0, machine.joint_lower_stiffness_factor]) * machine.joint_stiffness
    d = np.array([1.0, machine.joint_lower_damping_factor]) * machine.joint_damping
    gaps = machine.joint_clearance + np.array([1.0, -1.0]) * machine.joint_offset
    sides = (1.0, -1.0) if machine.joint_stops == "two" else (1.0,)

    def over_cycle(values):
        values = np.mean(values) + machine.variation * (np.asarray(values) - np.mean(values))
        if held:
            return lambda t, b: means(values, bins)[b]
        closed, steps = np.append(values, values[0]), np.arange(len(values) + 1) / len(values)
        return lambda t, b: np.interp(t * machine.speed % 1.0, steps, closed)

    samples = np.array(machine.samples.get("joint", [1.0]))
    mesh = over_cycle(samples / np.mean(samples)) if len(samples) > 1 else lambda t, b: 1.0
    springs = [(machine.modes.shape(s.at), over_cycle(s.values)) for s in machine.springs]

    def load(t):
        total = machine.joint_preload * phi
        for drive in machine.drives:
            for order, cosine, sine in drive.harmonics:
                grows = (order * rate) ** 2 if drive.kind == "unbalance" else 1.0
                wave = cosine * math.cos(order * rate * t) + sine * math.sin(order * rate * t)
                total = total + grows * wave * machine.modes.shape(drive.at)
        return machine.drive_level * total

    def contact(s, z):
        depth = sides[s] * (phi @ z[:n]) - gaps[s]
        return depth, k[s] * depth + d[s] * sides[s] * (phi @ z[n:])

    def motion(b, pressed):
        def slope(t, z):
            force = load(t) - damping @ z[n:] - squares * z[:n]
            for shape, values in springs:
                force = force - values(t, b) * (shape @ z[:n]) * shape
            for s in range(len(sides)):
                if pressed[s]:
                    force = force - mesh(t, b) * contact(s, z)[1] * (sides[s] * phi + tau)
            return np.concatenate([z[n:], force])

        return slope

    def leaving(s, pressed):
        def reading(t, z):
            return contact(s, z)[1] if pressed else min(contact(s, z))

        reading.terminal, reading.direction = True, -1.0 if pressed else 1.0
        return reading

    z, states = np.zeros(2 * n), [np.zeros(2 * n)]
    pressed = [min(contact(s, z)) > 0.0 for s in range(len(sides))]
    for cycle in range(cycles):
        for b in range(bins):
            t, end = (cycle + b / bins) / machine.speed, (cycle + (b + 1) / bins) / machine.speed
            while t < end:
                events = [leaving(s, pressed[s]) for s in range(len(sides))]
                run = solve_ivp(motion(b, pressed), (t, end), z, "DOP853", events=events, rtol=1e-12, atol=1e-15)
                t, z = run.t[-1], run.y[:, -1]
                for s in range(len(sides)):
                    if run.status == 1 and len(run.t_events[s]):
                        pressed[s] = not pressed[s]
        states.append(z)
    return np.array(states)


def off(machine, states):
    """Largest difference of the joint's place and of the whole state in a run, as a share of gap and state."""
    record = chaosgym.simulate(machine, len(states) - 1)
    found = np.vstack([record.section, record.final_state.coordinates])
    phi = machine.display
    place = np.max(np.abs((found - states)[:, : len(phi)] @ phi)) / machine.joint_clearance
    return place, np.max(np.abs(found - states) / np.max(np.abs(states), axis=0)), int(record.impacts.sum())


CASES = {
    "friction": built(friction=0.3, slides="side"),
    "friction the other way, one stop": built(friction=0.5, slides="-side", stops="one"),
    "mesh": built(samples=MESH),
    "spring": built(springs=(HOLDING,)),
    "spring, both stops alike": built(springs=(HOLDING,), offset=0.0, lower_stiffness_factor=1.0),
    "all": built(samples=MESH, springs=(HOLDING,), friction=0.2, slides="side", preload=3.0),
}


@pytest.mark.parametrize("case", CASES)
def test_motion_is_that_of_dop853(case):
    """Two cycles with several impacts: the joint is where DOP853 has it, to 1e-7 of the gap."""
    place, state, impacts = off(CASES[case], dop853(CASES[case], 2))
    assert impacts > 5
    assert place < 1e-7
    assert state < 1e-6


def test_held_stiffness_converges_to_the_continuous_one():
    """Stiffness held over bins leaves an error that falls with their square, at 1 deg some 3e-4 of the gap."""
    errors = []
    for interval in (4.0, 1.0, 0.25):
        machine = replace(CASES["mesh"], matrix_update_interval=interval)
        errors.append(off(machine, dop853(machine, 1, held=False))[0])
    assert errors[1] < 1e-3
    assert errors[2] < errors[0] / 50.0


def test_without_friction_and_variation_it_is_the_modal_machine():
    """Two kernels, one machine: forces and impacts of the machine of constant stiffness without friction."""
    names = {"stiffness": "contact_stiffness", "damping": "contact_damping"}
    of_joint = {names.get(name, name): value for name, value in JOINT.items()}
    modal = chaosgym.simulate(
        chaosgym.ModalMachine(modes=STRUCTURE, joint="tip", drives=DRIVES, speed=19.0, **of_joint), 3
    )
    for machine in (replace(CASES["mesh"], variation=0.0), built(slides="side")):
        found = chaosgym.simulate(machine, 3)
        np.testing.assert_allclose(found.peak_force, modal.peak_force, rtol=1e-8)
        np.testing.assert_array_equal(found.impacts, modal.impacts)
        np.testing.assert_allclose(found.contact_fraction, modal.contact_fraction, rtol=1e-6)


def test_peaks_are_those_of_the_time_history():
    """Largest forces are at least those of 20,000 samples of a cycle, and no more than the steepest rise above them."""
    for case in ("mesh", "all"):
        record = chaosgym.simulate(CASES[case], 3, samples_per_cycle=20_000)
        sampled = record.surface_force.max(axis=1)
        assert np.all(record.peak_force >= sampled)
        np.testing.assert_allclose(record.peak_force, sampled, rtol=2e-3)


def test_steady_sliding_rests_where_statics_puts_it():
    """Pressed on a surface that slides past: (W^2 + k (phi + mu tau) phi') q = F phi + k c (phi + mu tau)."""
    operation = {"drive_level": 0.0, "damping_factor": 50.0}
    machine = built(preload=50.0, friction=0.4, slides="side", operation=operation)
    phi, tau = STRUCTURE.shape("tip"), STRUCTURE.shape("side")
    push, k = phi + 0.4 * tau, machine.joint_stiffness
    matrix = np.diag(STRUCTURE.angular_frequency**2) + k * np.outer(push, phi)
    rest = np.linalg.solve(matrix, 50.0 * phi + k * 1.2e-4 * push)
    found = chaosgym.simulate(machine, 5, transient=400)
    np.testing.assert_allclose(found.final_state.coordinates[:2], rest, rtol=1e-9)
    np.testing.assert_allclose(found.peak_force[-1, 0], k * (phi @ rest - 1.2e-4), rtol=1e-9)


def test_friction_couples_modes_to_flutter():
    """Mode coupling (Hoffmann et al. 2002): in contact, friction lets a motion grow at the eigenvalue's rate."""
    structure = chaosgym.Structure.of_modes([20.0, 21.0], 0.0, {"tip": [1.1, 0.2], "side": [-0.3, 1.1]})
    phi, tau = structure.shape("tip"), structure.shape("side")
    rates = []
    for friction in (0.0, 0.6, 1.5):
        stop = {"clearance": 0.0, "offset": 0.0, "stiffness": 1e3, "damping": 0.0, "stops": "one", "preload": 100.0}
        machine = built(structure, (), speed=20.0, friction=friction, slides="-side", **stop)
        matrix = np.diag(structure.angular_frequency**2) + 1e3 * np.outer(phi - friction * tau, phi)
        rates.append(np.max(np.sqrt(-np.linalg.eigvals(matrix).astype(complex)).real))
        start = np.concatenate([np.linalg.solve(matrix, 100.0 * phi), [0.0, 0.0]])
        record, _, growth = simulate_with_deviations(machine, 400, start, deviations=np.array([[1.0, 0.3, 0.0, 0.0]]))
        assert record.impacts.sum() == 0
        assert growth[200:].mean() * 20.0 == pytest.approx(rates[-1], rel=1e-3, abs=0.2)
    assert rates[0] == pytest.approx(0.0, abs=1e-6)
    assert rates[-1] > 1.0


@pytest.mark.parametrize(("a", "trace"), [(25.54997175, -2.0), (25.51081605, -2.0), (36.35886685, 2.0)])
def test_mathieus_equation(a, trace):
    """At Mathieu's characteristic values for q = 5, Abramowitz and Stegun table 20.1, a motion just keeps its size."""
    speed, count = 7.0, 3600
    angle = 2.0 * math.pi * np.arange(count) / count
    values = (math.pi * speed) ** 2 * (a - 10.0 * np.cos(angle))
    structure, springs = (
        chaosgym.Structure.of_modes([0.0], [[0.0]], {"mass": [1.0]}),
        (HeldSpring("mass", tuple(values)),),
    )
    fine = {"matrix_update_interval": 0.25}
    machine = built(structure, (), springs, speed, "mass", fine, clearance=1.0)
    columns = [
        chaosgym.simulate(machine, 1, initial_state=np.array(s)).final_state.coordinates for s in np.eye(2) * 1e-4
    ]
    matrix = np.array(columns).T / 1e-4
    assert np.linalg.det(matrix) == pytest.approx(1.0, abs=1e-9)
    assert np.trace(matrix) == pytest.approx(trace, abs=2e-6)


def test_a_run_may_be_split_and_batched():
    """Splitting a run or moving in a batch changes no bit."""
    machine = CASES["all"]
    whole = chaosgym.simulate(machine, 6)
    first = chaosgym.simulate(machine, 2)
    rest = chaosgym.simulate(machine, 4, first.final_state)
    np.testing.assert_array_equal(whole.section[2:], rest.section)
    batch = machine.batch(3)
    for i, speed in enumerate((19.0, 21.0, 19.0)):
        batch.start(i, machine.at(speed))
    found = batch.run(np.arange(3), 6)
    for i, speed in enumerate((19.0, 21.0, 19.0)):
        np.testing.assert_array_equal(found.peak_force[i], chaosgym.simulate(machine.at(speed), 6).peak_force)


def test_deviations_are_those_of_two_runs():
    """A small deviation grows through contacts, friction and steps of stiffness as the difference of two runs does."""
    machine, start = CASES["all"], chaosgym.simulate(CASES["all"], 1).final_state
    for i in range(4):
        step = np.zeros(4)
        step[i] = 1e-9 if i < 2 else 1e-7
        up, down = (
            chaosgym.simulate(machine, 1, start._replace(coordinates=start.coordinates + s * step)) for s in (1.0, -1.0)
        )
        difference = (up.final_state.coordinates - down.final_state.coordinates) / (2.0 * np.linalg.norm(step))
        _, vectors, growth = simulate_with_deviations(machine, 1, start, deviations=np.eye(4)[i : i + 1])
        weights = machine.state_weights(start.coordinates)
        size = np.exp(growth[0, 0])
        carried = vectors[0] * np.linalg.norm(difference * weights) / np.linalg.norm(vectors[0] * weights)
        np.testing.assert_allclose(carried, difference, rtol=1e-3, atol=1e-3 * np.max(np.abs(difference)))
        assert size > 0.0


FILE = """
[structure]
frequencies = "9, 61 Hz"
damping_ratios = "2 %"
[structure.shapes]
tip = "2.1, -1.9 kg^-1/2"
side = "0.7, 1.5 kg^-1/2"
[joint]
at = "tip"
clearance = "0.1 mm"
stiffness = "1 N/um"
damping = "20 N s/m"
[[drive]]
at = "tip"
force = "8.9 N"
[operation]
speed = "19 Hz"
speed_range = "4 to 30 Hz"
clearance_range = "0.05 to 0.2 mm"
"""


def read(folder, *changes):
    """Machine of a file with some texts replaced."""
    text = FILE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / "machine.toml").write_text(text)
    return chaosgym.read_machine(folder / "machine.toml")


def test_a_file_states_friction_and_samples(tmp_path):
    """Keys of a file are fields of the machine; a CSV file and samples that are written out are one."""
    rubs = read(tmp_path, ("damping = ", 'friction = 0.2\nslides = "-side"\ndamping = '))
    assert (rubs.joint_friction, rubs.slides, rubs.samples) == (0.2, {"joint": "-side"}, {})
    assert any("friction always pulls '-side'" in note for note in rubs.notes)
    varies = read(tmp_path, ('"1 N/um"', '"1, 1.5, 0.5, 1 N/um"'))
    assert varies.joint_stiffness == pytest.approx(1e6)
    (tmp_path / "mesh.csv").write_text("angle [deg],k [N/um]\n0,1\n90,1.5\n180,0.5\n270,1\n")
    from_csv = read(tmp_path, ('"1 N/um"', '"mesh.csv"'))
    assert from_csv.samples == varies.samples
    spring = '[[spring]]\nat = "side"\nstiffness = "10, 20, 30 N/mm"\n[[drive]]'
    held = read(tmp_path, ("[[drive]]", spring))
    assert held.springs == (HeldSpring("side", (1e4, 2e4, 3e4)),)
    assert type(read(tmp_path)).__mro__[1] is chaosgym.ModalMachine


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "damping = ",
            'friction = -0.1\nslides = "side"\ndamping = ',
            "friction = -0.1 is out of range; allowed: 0 to",
        ),
        ("damping = ", "friction = 0.1\ndamping = ", "joint.friction needs joint.tangent"),
        ("damping = ", 'slides = "side"\ndamping = ', "joint.slides has no meaning without joint.friction"),
        ("damping = ", 'friction = 0.1\nslides = "sid"\ndamping = ', "no point 'sid'; did you mean side"),
        (
            "damping = ",
            'friction = "0.1 N"\nslides = "side"\ndamping = ',
            "friction = '0.1 N' has the unknown unit 'N'",
        ),
        ('"1 N/um"', '"1, -0.5, 2 N/um"', "out of range"),
        ('"1 N/um"', '"1, 2 N/um"', "joint.stiffness has 2 samples of a cycle; allowed: 1, or 3 to 3600"),
        ('"1 N/um"', '"0, 0, 3, 0 N/um"', "stiffness of joint is 0 somewhere"),
        ('"1 N/um"', '"mesh.csv"', "mesh.csv"),
        ('"1 N/um"\ndamping = "20 N s/m"', '"1, 2, 1 N/um"\nrestitution = 0.8', "restitution needs one stiffness"),
        ("[[drive]]", '[[spring]]\nat = "side"\nstiffness = "-1 N/mm"\n[[drive]]', "spring.stiffness"),
        ("[[drive]]", '[[spring]]\nstiffness = "1 N/mm"\n[[drive]]', "[spring] lacks at"),
        ("[[drive]]", '[[spring]]\nat = "sde"\nstiffness = "1 N/mm"\n[[drive]]', "no point 'sde'"),
        ("[[drive]]", '[[spring]]\nat = "side"\nstiffness = "1 N m/rad"\n[[drive]]', "spring at 'side' turns"),
        (
            "[[drive]]",
            '[[spring]]\nat = "side"\nstiffness = "1 N/mm"\ncolumn = "k"\n[[drive]]',
            "spring.column has no meaning",
        ),
    ],
)
def test_bad_input_is_told_in_a_line(tmp_path, old, new, told):
    """Friction or samples that can't be are refused in one line that says what is allowed."""
    with pytest.raises(ParameterError) as error:
        read(tmp_path, (old, new))
    assert told in str(error.value)
    assert "\n" not in str(error.value)


def test_several_joints_may_slide_or_vary(tmp_path):
    """Beside a joint that is out of reach, friction, samples and springs give the forces of the one joint to 1e-9."""
    two = '[[joint]]\nname = "b"\nat = "side"\nclearance = "9 mm"\nstiffness = "1 N/um"\ndamping = "1 N s/m"\n'
    for change in (
        ("clearance = ", 'friction = 0.1\nslides = "side"\nclearance = '),
        ('stiffness = "1 N/um"\ndamping = "20', 'stiffness = "1, 2, 3 N/um"\ndamping = "20'),
        ("[operation]", '[[spring]]\nat = "tip"\nstiffness = "1, 2, 3 N/mm"\n[operation]'),
    ):
        alone = read(tmp_path, change)
        both = read(tmp_path, ("[joint]", "[[joint]]"), change, ("[operation]", two + "[operation]"))
        assert both.moving.how == alone.moving.how
        forces = [chaosgym.simulate(machine, 5).peak_force for machine in (alone, both)]
        np.testing.assert_allclose(forces[0], forces[1], rtol=1e-9)


def test_what_does_not_go_together_is_told(tmp_path):
    """Friction that sticks beside samples, a variation that turns the stiffness over, fixed steps: a line for each."""
    both = ("damping = ", 'friction = 0.1\ntangent = "side"\ndamping = ')
    with pytest.raises(ParameterError, match=r"joint.stiffness over the cycle does not go with joint.tangent"):
        read(tmp_path, ('"1 N/um"', '"1, 2, 3 N/um"'), both)
    varies = read(tmp_path, ('"1 N/um"', '"1, 1.5, 0.5, 1 N/um"'))
    with pytest.raises(ParameterError, match="with variation = 3; allowed: 0 or more"):
        replace(varies, variation=3.0)
    with pytest.raises(ParameterError, match="ExactEvents"):
        chaosgym.simulate(varies, 1, integrator=chaosgym.RungeKutta4(2000))


def monodromy(machine, speed):
    """Matrix over a cycle of the gear pair whose teeth stay in mesh, by DOP853."""
    samples = machine.samples["joint"]
    closed = np.append(samples, samples[0])

    def slope(t, z):
        stiffness = np.interp(t * speed % 1.0, np.linspace(0.0, 1.0, len(closed)), closed)
        return [z[1], -628.3185 * z[1] - stiffness / 0.1 * z[0]]

    ends = [solve_ivp(slope, (0.0, 1.0 / speed), z, "DOP853", rtol=1e-11, atol=1e-14).y[:, -1] for z in np.eye(2)]
    return np.array(ends).T


@pytest.mark.parametrize(("speed", "parts"), [(1900.0, True), (2000.0, True), (2100.0, True), (2125.0, False)])
def test_gears_lose_mesh_in_mathieus_zone(speed, parts):
    """Where a multiplier of the pressed mesh is beyond 1 teeth separate, every second cycle; else they stay."""
    gears = chaosgym.read_machine(MACHINES / "kahraman-singh-1991.toml")
    assert (np.max(np.abs(np.linalg.eigvals(monodromy(gears, speed)))) > 1.0) == parts
    record = chaosgym.simulate(gears.at(speed), 50, transient=1000)
    assert record.impacts.sum() == (25 if parts else 0)
    assert chaosgym.diagnose(gears.at(speed), budget=800).period == (2 if parts else 1)


def test_lightly_loaded_gears_are_chaotic():
    """Varying mesh and little load: chaos at 1200 and 1500 Hz where the full load has one impact a cycle, or two."""
    gears = chaosgym.read_machine(MACHINES / "kahraman-singh-1991.toml")
    for speed in (1200.0, 1500.0):
        assert chaosgym.diagnose(with_settings(gears, {"preload": 10.0}).at(speed), budget=800).nature == "chaotic"
        assert chaosgym.diagnose(gears.at(speed), budget=800).nature == "periodic"


def test_gears_that_stay_in_mesh_do_not_lack_contact(tmp_path):
    """A sweep over settled motions that press all the time, without an impact, does not tell of no contact at all."""
    given = [
        str(MACHINES / "kahraman-singh-1991.toml"),
        "--axis",
        "speed=2125Hz:2200Hz:2",
        "--out",
        str(tmp_path / "sweep"),
        *("--label", "full-types=0"),
    ]
    result = CliRunner().invoke(app, ["sweep", *given], catch_exceptions=False)
    assert "periodic 2" in result.output
    assert "no contact" not in result.output


def test_bending_of_a_joint_that_rubs_is_refused(tmp_path):
    """Fatigue of the flexible part follows from forces along the joint alone; with friction a line refuses it."""
    rubs = read(tmp_path, ("damping = ", 'friction = 0.2\nslides = "side"\ndamping = '))
    section = Section(curvatures=(0.7, 4.2))
    with pytest.raises(ParameterError, match="constant stiffness and without friction"):
        fibres(rubs, Bending(section=section))
