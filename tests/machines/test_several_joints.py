"""Machines with several joints: exact against another program, and the same whichever way they are run."""

import json
import math
import pickle
from dataclasses import replace
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

import chaosgym
from chaosgym import Drive, ImpactBeam, RungeKutta4, Structure, simulate
from chaosgym.cli import app
from chaosgym.diagnosis.lyapunov import lyapunov_spectrum
from chaosgym.errors import ChaosgymError, ParameterError
from chaosgym.machines import joint_tables
from chaosgym.machines.impact_beam.modes import modal_analysis
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.machines.modal_machine import jointed
from chaosgym.machines.modal_machine.machine_class import Joint, machine_with_joints
from chaosgym.simulation.run import simulate_with_deviations

FIELDS = ("section", "peak_force", "impacts", "contact_fraction", "bounce_duration")
PIPE = Path("docs/machines/pipe-in-two-supports.toml")

SHAPES = {"a": [2.1, -1.9, 1.7], "b": [0.9, 1.5, -1.2], "c": [-1.1, 0.4, 1.6], "drive": [1.2, 0.8, 0.5]}
"""Mass-normalised shapes of three modes at three joints and at the drive."""

PLAIN = {"left": Joint("a", 0.15e-3, 2e5, 15.0), "right": Joint("b", 0.10e-3, 3e5, 10.0)}
UNEVEN = {
    "one_sided": Joint("a", 0.15e-3, 2e5, 15.0, stops="one", preload=2.0),
    "off_centre": Joint("-b", 0.10e-3, 3e5, 10.0, 0.04e-3, lower_stiffness_factor=0.3, lower_damping_factor=4.0),
    "loose": Joint("c", 0.12e-3, 1e5, 0.0),
}


def three_modes(joints, frequencies=(9.0, 61.0, 190.0), force=8.0, speed=14.0, **fields):
    """A structure of three modes with some joints, driven by a sine."""
    structure = Structure.of_modes(list(frequencies), 0.02, SHAPES)
    drives = (Drive.sine("force", "drive", force), Drive.sine("force", "c", 0.3 * force, 2, 0.4))
    return machine_with_joints(structure, joints, drives, speed=speed)(**fields)


def reference(machine, cycles, samples):
    """Displacements (m, n) and forces of all joints by DOP853, from the joints' definitions alone."""
    rates, damping = machine.modes.angular_frequency, machine.modes.damping
    rows = np.array([machine.modes.shape(machine.places[name]) for name in machine.joints])
    parts = {what: machine.of_joints(what) for what in ("clearance", "offset", "stiffness", "damping", "preload")}
    factors = machine.of_joints("lower_stiffness_factor"), machine.of_joints("lower_damping_factor")
    lower = machine.of_joints("stops") == "two"
    drive = [(machine.modes.shape(d.at), d.harmonics[0], d.mean) for d in machine.drives]
    omega = 2.0 * math.pi * machine.speed

    def forces(q, v):
        x, speed = rows @ q - parts["offset"], rows @ v
        up, down = x - parts["clearance"], -x - parts["clearance"]
        above = np.maximum(0.0, parts["stiffness"] * up + parts["damping"] * speed) * (up > 0.0)
        below = np.maximum(0.0, factors[0] * parts["stiffness"] * down - factors[1] * parts["damping"] * speed)
        return above - below * (down > 0.0) * lower

    def slope(t, y):
        q, v = np.split(y, 2)
        load = sum(
            shape * (mean + c * math.cos(k * omega * t) + s * math.sin(k * omega * t))
            for shape, (k, c, s), mean in drive
        )
        load = load + rows.T @ (parts["preload"] - forces(q, v))
        return np.concatenate([v, load - rates**2 * q - damping @ v])

    instants = np.arange(cycles * samples) / samples / machine.speed
    found = solve_ivp(
        slope,
        (0.0, instants[-1]),
        np.zeros(2 * len(rates)),
        "DOP853",
        instants,
        rtol=1e-10,
        atol=1e-15,
        max_step=1e-3 / machine.speed,
    )
    q, v = np.split(found.y, 2)
    return rows @ q, np.array([forces(a, b) for a, b in zip(q.T, v.T, strict=True)]).T


@pytest.mark.parametrize(
    ("joints", "frequencies"),
    [(PLAIN, (9.0, 61.0, 190.0)), (UNEVEN, (9.0, 61.0, 190.0)), (UNEVEN, (0.0, 61.0, 190.0))],
    ids=["two joints", "three uneven joints", "three, of a rigid body"],
)
def test_displacements_and_forces_are_those_of_another_program(joints, frequencies):
    """Displacements of all joints equal DOP853's to 1e-7 of the gap for a cycle, forces to 1e-6 of the largest.

    Offsets, preload, a missing stop, stops that differ and a mode of 0 Hz under a constant force are among them.
    """
    machine = three_modes(joints, frequencies, **({"loose_preload": 1.0} if "loose" in joints else {}))
    record = simulate(machine, 1, samples_per_cycle=100, integrator=TIGHTEST_EVENTS)
    displacement, force = reference(machine, 1, 100)
    assert (record.impacts.reshape(-1, 2).sum(axis=1) > 0).all()
    for j, name in enumerate(machine.joints):
        shown = record.of_joint(name).history[0]
        gap = getattr(machine, f"{name}_clearance")
        assert np.abs(shown[:, 0] - displacement[j]).max() < 1e-7 * gap
        assert np.abs(shown[:, 2] - force[j]).max() < 1e-6 * np.abs(force).max()


def test_one_joint_is_the_machine_with_one_joint():
    """The impact beam as a machine with a single joint in the list has the same peaks to 1e-8, and as many impacts."""
    beam = ImpactBeam(excitation_frequency=19.0)
    modes = modal_analysis(beam)
    structure = Structure(modes.angular_frequency, modes.damping, {"tip": modes.tip_shape, "shaker": modes.force_shape})
    joint = Joint("tip", beam.clearance, beam.contact_stiffness, beam.contact_damping)
    drives = (Drive.sine("force", "shaker", beam.force_amplitude),)
    own = machine_with_joints(structure, {"only": joint}, drives, speed=19.0)()
    expected, found = (simulate(each, 3) for each in (beam, own))
    np.testing.assert_array_equal(found.impacts, expected.impacts)
    np.testing.assert_allclose(found.peak_force, expected.peak_force, rtol=1e-8)
    np.testing.assert_allclose(found.contact_fraction, expected.contact_fraction, rtol=1e-8)


@pytest.mark.parametrize("count", range(1, 7))
def test_energy_stays_without_damping(count):
    """Nothing drives and nothing dampens: modes and springs keep their energy to 1e-9, with one to six joints."""
    generator = np.random.default_rng(count)
    shapes = {f"p{j}": generator.normal(size=6) for j in range(count)}
    structure = Structure.of_modes([7.0, 21.0, 48.0, 83.0, 131.0, 190.0], 0.0, shapes)
    joints = {f"j{j}": Joint(f"p{j}", 1e-4 * (1 + j), 1e5 * (1 + j), 0.0) for j in range(count)}
    machine = machine_with_joints(structure, joints, speed=10.0)()
    rates, sets = structure.angular_frequency, machine.sets
    start = np.concatenate([np.zeros(6), 0.02 * generator.normal(size=6)])
    record = simulate(machine, 20, start)

    def energy(state):
        x = sets.shape @ state[:6]
        depth = np.maximum(np.abs(x) - machine.of_joints("clearance"), 0.0)
        return np.sum(state[6:] ** 2 + (rates * state[:6]) ** 2) + np.sum(sets.springs[:, 0] * depth**2)

    energies = [energy(state) for state in record.section]
    assert record.impacts.sum(axis=0).reshape(-1, 2).sum(axis=1).max() > 10
    np.testing.assert_allclose(energies, energies[0], rtol=1e-9)


def test_the_exponents_sum_to_what_all_dampers_take():
    """The sum of all Lyapunov exponents is -tr(D) T - sum d |phi|^2 t_contact over all surfaces, to 1e-9."""
    exponents, trace = lyapunov_spectrum(three_modes(UNEVEN), 60, transient=20)
    assert exponents.sum() == pytest.approx(trace, rel=1e-9)


def test_split_repeated_and_sampled_runs_are_equal_bit_for_bit():
    """A run in two parts, once more, with a history, and beside another machine: the same bytes."""
    machine = three_modes(UNEVEN)
    whole = simulate(machine, 40)
    first = simulate(machine, 17)
    second = simulate(machine, 23, first.final_state)
    sampled = simulate(machine, 40, samples_per_cycle=13)
    simulate(three_modes(UNEVEN, loose_clearance=1e-5), 5)
    again = simulate(three_modes(UNEVEN), 40)
    for name in FIELDS:
        expected = getattr(whole, name)
        np.testing.assert_array_equal(getattr(first.followed_by(second), name), expected)
        np.testing.assert_array_equal(getattr(sampled, name), expected)
        np.testing.assert_array_equal(getattr(again, name), expected)


def variants():
    """Machines that differ in speed, gaps, offset, drive, springs and in whether their surfaces differ."""
    return [
        three_modes(UNEVEN),
        three_modes(UNEVEN, speed=11.0, loose_clearance=3e-5, off_centre_offset=0.0, drive_level=1.7),
        three_modes(UNEVEN, speed=17.0, off_centre_lower_stiffness_factor=1.0, off_centre_lower_damping_factor=1.0),
        three_modes(UNEVEN, speed=23.0, one_sided_stops="two", loose_stiffness=4e5, damping_factor=3.0),
        three_modes(UNEVEN, speed=14.0, frequency_factor=0.7, one_sided_preload=-5.0),
    ]


def started(machines):
    """A batch of machines at rest."""
    batch = machines[0].batch(len(machines))
    for i, machine in enumerate(machines):
        batch.start(i, machine)
    return batch


def test_a_batch_moves_each_machine_as_alone():
    """Forces, impacts, bouncing and final states of a batch are those of single runs bit for bit.

    So they are in two parts, and beside others in another order.
    """
    machines, which = variants(), np.arange(5)
    whole, parts, some = started(machines), started(machines), started(machines)
    found, first = whole.run(which, 30), parts.run(which, 11)
    second = parts.run(which, 19)
    assert not found.failed.any()
    few = some.run(np.array([3, 1]), 30)
    for i, machine in enumerate(machines):
        alone = simulate(machine, 30)
        expected = alone.peak_force, alone.impacts, alone.bounce_duration
        for k, values in enumerate(expected, start=1):
            np.testing.assert_array_equal(found[k][i], values)
            np.testing.assert_array_equal(np.concatenate([first[k][i], second[k][i]]), values)
        for values, final in zip(whole.motion(i), alone.final_state, strict=True):
            np.testing.assert_array_equal(values, final)
    np.testing.assert_array_equal(few.peak_force, found.peak_force[[3, 1]])
    np.testing.assert_array_equal(machines[0].sensed(found.peak_force), found.peak_force.max(axis=2))


@pytest.mark.parametrize("kind", ["three uneven joints", "a rigid body", "twelve harmonics of an unbalance"])
def test_speeds_and_gaps_that_change_from_cycle_to_cycle_in_a_batch(kind):
    """A batch whose speeds vary and whose gap wears moves as single runs do, and so do its deviations, bit for bit.

    Where the highest harmonic turns faster than the fastest mode, intervals depend on the speed.
    """
    if kind == "twelve harmonics of an unbalance":
        wave = 40.0 * np.sin(2.0 * np.pi * np.arange(64) / 64) ** 3
        drives = (Drive.sampled("force", "c", wave, 12), Drive.sine("unbalance", "drive", 2e-3))
        machine = machine_with_joints(Structure.of_modes([9.0, 31.0, 60.0], 0.02, SHAPES), PLAIN, drives, speed=14.0)()
    else:
        machine = three_modes(UNEVEN, (0.0 if kind == "a rigid body" else 9.0, 61.0, 190.0))
    speeds = np.random.default_rng(0).choice([0.3, 6.0, 13.0, 14.0, 31.0], (3, 8))
    worn = np.array([1.2e-4, 1.6e-4, 3e-4])
    batch, which = started([machine] * 3), np.arange(3)
    batch.set_clearances(which, worn)
    cycles, growth = batch.run_varied(which, speeds)
    batch.set_speeds(which, np.array([9.0, 14.0, 20.0]))
    later = batch.run(which, 3)
    for i, clearance in enumerate(worn.tolist()):
        state, deviation = None, np.cos(1.0 + np.arange(machine.n_states))[None]
        for k, speed in enumerate(speeds[i].tolist()):
            each = machine.at(speed, clearance)
            record, deviation, grown = simulate_with_deviations(each, 1, state, deviations=deviation)
            state = record.final_state
            np.testing.assert_array_equal(cycles.peak_force[i, k], record.peak_force[0])
            assert growth[i, k] == grown[0, 0]
        last = simulate(machine.at((9.0, 14.0, 20.0)[i], clearance), 3, state)
        np.testing.assert_array_equal(later.peak_force[i], last.peak_force)
    assert cycles.impacts.sum() > 20


def test_machines_that_fail_are_told_and_the_others_move_on(monkeypatch):
    """Too little memory for one machine's sets, and a state that is no number: both by their places, at once."""
    machines = variants()
    batch, which = started(machines), np.arange(5)
    monkeypatch.setattr(joint_tables, "MOST_BYTES", 1)
    batch.start(1, machines[1])
    monkeypatch.undo()
    batch.kick(np.array([4]), np.full((1, 3), math.nan))
    found = batch.run(which, 12)
    assert found.failed.tolist() == [False, True, False, False, True]
    for i in (0, 2, 3):
        np.testing.assert_array_equal(found.peak_force[i], simulate(machines[i], 12).peak_force)
    assert not found.peak_force[[1, 4]].any()
    batch.start(1, machines[1])
    batch.start(4, machines[4])
    again = batch.run(np.array([1, 4]), 12)
    np.testing.assert_array_equal(again.peak_force[1], simulate(machines[4], 12).peak_force)


def test_environments_of_several_joints_are_judged_by_their_exponent():
    """Side by side, pickled between, jobs on a pipe in two supports are those of one environment each, bit for bit."""
    envs = gym.make_vec("chaosgym/MachineWear-v0", num_envs=3, machine=str(PIPE))
    alone = [gym.make("chaosgym/MachineWear-v0", machine=str(PIPE)) for _ in range(3)]
    first, _ = envs.reset(seed=4)
    for i, env in enumerate(alone):
        np.testing.assert_array_equal(env.reset(seed=4 + i)[0], first[i])
    for k in range(6):
        envs = pickle.loads(pickle.dumps(envs)) if k == 3 else envs
        seen, reward, *_, info = envs.step(np.full(3, k % 3))
        for i, env in enumerate(alone):
            mine = env.step(k % 3)
            np.testing.assert_array_equal(mine[0], seen[i])
            assert (mine[1], mine[-1]["irregularity"]) == (reward[i], info["irregularity"][i])
    assert (np.abs(info["irregularity"]) > 0.0).all()


def test_twelve_joints_and_forty_modes():
    """A pinned beam of forty modes in twelve supports runs; memory that holds few sets changes no byte."""
    places = np.linspace(0.06, 0.93, 12)
    modes = np.arange(1, 41)
    shapes = {f"p{j}": 1.5 * np.sin(modes * math.pi * x) for j, x in enumerate(places)}
    shapes["drive"] = 1.5 * np.sin(modes * math.pi * 0.37)
    structure = Structure.of_modes(4.0 * modes**2, 0.02, shapes)
    joints = {f"s{j}": Joint(f"p{j}", 2e-4 + 2e-5 * j, 1e6, 30.0) for j in range(12)}
    machine = machine_with_joints(structure, joints, (Drive.sine("force", "drive", 60.0),), speed=9.0)()
    record = simulate(machine, 2)
    assert np.isfinite(record.section).all()
    assert (record.impacts.sum(axis=0).reshape(-1, 2).sum(axis=1) > 0).sum() >= 8


def test_little_memory_changes_no_byte(monkeypatch):
    """Where sets are forgotten and made anew a run is the same; where a cycle needs more than fit, one line says so."""
    expected = simulate(three_modes(UNEVEN), 12)
    for speed, bytes_ in ((14.0, 800_000), (13.0, 1)):
        monkeypatch.setattr(joint_tables, "MOST_BYTES", bytes_)
        jointed._tables.cache_clear()
        if bytes_ > 1:
            np.testing.assert_array_equal(simulate(three_modes(UNEVEN), 12).section, expected.section)
        else:
            with pytest.raises(ChaosgymError, match="more sets of pressed surfaces than the memory holds"):
                simulate(three_modes(UNEVEN, speed=speed), 12)
    jointed._tables.cache_clear()


def test_a_joint_that_is_never_reached_changes_nothing_but_rounding():
    """A second gap of a metre leaves the first's peak forces as they are, to 1e-9 in three cycles."""
    alone = three_modes({"left": PLAIN["left"]})
    both = three_modes({"left": PLAIN["left"], "right": PLAIN["right"]._replace(clearance=1.0)})
    expected, found = simulate(alone, 3), simulate(both, 3)
    np.testing.assert_allclose(found.peak_force[:, :2], expected.peak_force, rtol=1e-9)
    assert not found.peak_force[:, 2:].any()
    np.testing.assert_array_equal(found.impacts[:, :2], expected.impacts)


def test_the_joint_with_the_largest_force_is_shown_unless_one_is_monitored():
    """Displacement and history are those of the joint with the largest force, of the one monitored, or of one asked."""
    machine = three_modes(PLAIN)
    record = simulate(machine, 10, samples_per_cycle=5)
    largest = int(np.argmax(record.peak_force.max(axis=0))) // 2
    assert record.joint == largest
    np.testing.assert_array_equal(record.displacement, record.motions[:, 2 * largest])
    other = machine.joints[1 - largest]
    chosen = simulate(three_modes(PLAIN, monitored=other), 10, samples_per_cycle=5)
    asked = record.of_joint(other).after(2).after(1)
    assert chosen.joint == asked.joint == 1 - largest
    np.testing.assert_array_equal(chosen.history[3:], asked.history)
    with pytest.raises(ParameterError, match="did you mean left"):
        record.of_joint("leftt")


def test_it_refuses_fixed_steps_in_one_line():
    """A machine with several joints is run exactly only, and says so."""
    with pytest.raises(ParameterError, match="allowed: ExactEvents"):
        simulate(three_modes(PLAIN), 1, integrator=RungeKutta4())


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        ({}, "no joint"),
        ({"a": Joint("still", 1e-4, 1e5, 1.0)}, "never moves"),
        ({"a": Joint("aa", 1e-4, 1e5, 1.0)}, "no point 'aa'"),
        ({"left stop": Joint("a", 1e-4, 1e5, 1.0)}, "allowed: letters, digits"),
        ({"a": Joint("a", -1e-4, 1e5, 1.0)}, "a_clearance = -0.0001 m is out of range"),
        ({"a": Joint("a", 1e-4, 0.0, 1.0)}, "a_stiffness = 0 N/m is out of range"),
        ({"a": Joint("a", 1e-4, 1e5, -1.0)}, "a_damping = -1 N s/m is out of range"),
        ({"a": Joint("a", 1e-4, 1e5, 1.0, stops="three")}, "a_stops = 'three' is not one of two, one"),
    ],
)
def test_bad_joints_are_refused_in_one_line(joints, message):
    """No joint, a row of zeros, no such point, a negative gap or damper: field, value, range."""
    structure = Structure.of_modes([9.0, 61.0], 0.02, {"a": [1.0, 2.0], "still": [0.0, 0.0]})
    with pytest.raises(ParameterError, match=message) as error:
        machine_with_joints(structure, joints)
    assert "\n" not in str(error.value)


def test_too_many_sets_are_refused_in_one_line():
    """Twenty-one joints have more sets of pressed surfaces than are numbered; the message says how many are."""
    generator = np.random.default_rng(1)
    shapes = {f"p{j}": generator.normal(size=24) for j in range(21)}
    structure = Structure.of_modes(np.arange(1.0, 25.0), 0.02, shapes)
    kind = machine_with_joints(structure, {f"j{j}": Joint(f"p{j}", 1e-4, 1e5, 1.0) for j in range(21)})
    with pytest.raises(ChaosgymError, match=r"21 joints have 2,097,152 sets .* allowed: 1,000,000"):
        simulate(kind(), 1)


def test_the_file_of_a_pipe_in_two_supports():
    """The example's fields, tolerances and operating point are what its file states; a pickle is the same machine."""
    import pickle

    pipe = chaosgym.read_machine(PIPE)
    assert pipe.joints == ("guide", "saddle")
    assert pipe.sides == ("guide upper", "guide lower", "saddle upper", "saddle lower")
    np.testing.assert_allclose(pipe.stops, [[0.15e-3, -0.15e-3], [0.35e-3, -0.15e-3]])
    assert pipe.saddle_lower_stiffness_factor == 0.25
    assert pipe.tolerances["saddle_clearance"] == (0.1, True)
    assert pipe.at(30.0, 1e-4).guide_clearance == 1e-4
    assert pickle.loads(pickle.dumps(pipe.at(30.0))) == pipe.at(30.0)
    record = simulate(pipe, 60, transient=20)
    assert (record.peak_force.max(axis=0).reshape(-1, 2).max(axis=1) > 1.0).all()


@pytest.mark.parametrize("restitution", [0.9, 0.5])
def test_a_stated_restitution_is_what_an_impact_leaves(tmp_path, restitution):
    """A free mass of 2 kg leaves a stop with the share of its speed that the file states, to 1e-6."""
    file = tmp_path / "mass.toml"
    file.write_text(
        f"""
        [structure]
        frequencies = "0 Hz"
        damping_ratios = "0 %"
        [structure.shapes]
        mass = "{0.5**0.5:.12f} kg^-1/2"
        [joint]
        at = "mass"
        clearance = "1 mm"
        stiffness = "1 N/um"
        restitution = {restitution}
        [[drive]]
        at = "mass"
        force = "1e-9 N"
        [operation]
        speed = "1 Hz"
        speed_range = "1 to 2 Hz"
        clearance_range = "0.1 to 1 mm"
        """
    )
    machine = chaosgym.read_machine(file)
    record = simulate(machine, 1, np.array([0.0, 0.0015 / 0.5**0.5]))
    assert record.impacts.sum() == 1
    assert -record.final_state.coordinates[1] * 0.5**0.5 == pytest.approx(0.0015 * restitution, rel=1e-6)
    text = file.read_text()
    for old, new, message in (
        (f"restitution = {restitution}", "restitution = 1.5", "allowed: 0.001 to 1"),
        ("restitution", 'damping = "1 N s/m"\nrestitution', "allowed: one of them"),
    ):
        file.write_text(text.replace(old, new, 1))
        with pytest.raises(ParameterError, match=message):
            chaosgym.read_machine(file)


def test_commands_know_every_surface(tmp_path):
    """simulate and diagnose tell what each surface takes; axes, settings and series name a joint and its fields."""
    runner = CliRunner()

    def answer(*words):
        done = runner.invoke(app, [*map(str, words), "--json"], catch_exceptions=False)
        assert done.exit_code == 0, done.output
        return json.loads(done.stdout)

    series = tmp_path / "series.csv"
    told = answer("simulate", PIPE, "--cycles", 20, "--set", "guide.clearance=0.1 mm", "--series-out", series)
    pipe = replace(chaosgym.read_machine(PIPE), guide_clearance=1e-4)
    record = simulate(pipe, 20)
    assert list(told["surfaces_peak_force_N"]) == list(pipe.sides)
    assert told["worst_surface"] == pipe.sides[int(np.argmax(record.peak_force.max(axis=0)))]
    assert told["peak_force_N"] == record.peaks.tolist()
    header = series.read_text().splitlines()[0]
    assert "guide displacement [m]" in header
    assert "saddle force [N]" in header
    watched = answer("simulate", PIPE, "--cycles", 5, "--set", "monitored=guide")
    assert watched["worst_surface"].startswith("guide")
    lines = runner.invoke(app, ["diagnose", str(PIPE), "--set", "monitored=guide", "--budget", "200"]).output
    assert "monitored: guide upper; the largest force is on saddle upper" in lines
    plan = tmp_path / "sweep"
    axis = "saddle.clearance=0.2mm:0.3mm:2"
    assert answer("sweep", PIPE, "--axis", axis, "--budget", 100, "--out", plan)["points"] == 2


def test_an_environment_senses_the_largest_force_of_all_joints():
    """Mean peak force of an observation, without errors, is the mean over the cycles of the largest on any surface."""
    env = gym.make("chaosgym/Machine-v0", machine=str(PIPE), sensor_error=0.0, speed_ripple=0.0, cycles_per_step=5)
    env.reset(seed=3)
    env.unwrapped._job.traced = 1
    observation = env.step(env.action_space.sample())[0]
    (piece,) = env.unwrapped._job.segments[0]
    record = simulate(piece.machine, 5, chaosgym.simulation.MotionState(piece.coordinates, piece.bouncing))
    found = record.peak_force.max(axis=1)[-5:]
    assert observation[6] == pytest.approx(found.mean(), rel=1e-5)
    assert observation[8] == pytest.approx(found.max(), rel=1e-5)
