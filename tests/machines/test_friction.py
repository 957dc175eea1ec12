"""Coulomb friction at contacts: another program, closed forms, energy, limits, and small deviations."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit
from scipy.optimize import brentq

import chaosgym
from chaosgym import Drive, Joint, Structure, machine_with_joints, simulate
from chaosgym.core.events import opening
from chaosgym.diagnosis import find_periodic_orbit
from chaosgym.diagnosis.lyapunov import largest_lyapunov_exponent, lyapunov_spectrum
from chaosgym.errors import ParameterError
from chaosgym.machines.integrators import TIGHTEST_EVENTS
from chaosgym.machines.parameters import by_field
from chaosgym.simulation import MotionState
from chaosgym.simulation.run import simulate_with_deviations

from .friction_twin import DOWN, STICKS, UP, Twin

SHAPES = {
    "a": [2.1, -1.9, 1.7],
    "b": [0.9, 1.5, -1.2],
    "c": [-1.1, 0.4, 1.6],
    "along_a": [1.0, 1.2, -0.7],
    "along_b": [-0.6, 1.1, 1.3],
    "drive": [1.2, 0.8, 0.5],
}
"""Mass-normalised shapes of three modes: across and along the surfaces of joints, and at the drive."""

LEFT = Joint("a", 0.15e-3, 2e5, 15.0, tangent="along_a", friction=0.3)
RIGHT = Joint(
    "-b",
    0.10e-3,
    3e5,
    10.0,
    0.04e-3,
    lower_stiffness_factor=0.3,
    lower_damping_factor=4.0,
    tangent="along_b",
    friction=0.5,
    sliding_speed=0.01,
)


def three_modes(joints, frequencies=(9.0, 61.0, 190.0), speed=14.0, force=8.0, damping=0.02, **fields):
    """A structure of three modes with some joints, driven by two harmonics."""
    structure = Structure.of_modes(list(frequencies), damping, SHAPES)
    drives = (Drive.sine("force", "drive", force), Drive.sine("force", "c", 0.3 * force, 2, 0.4))
    return machine_with_joints(structure, joints, drives, speed=speed)(**fields)


@pytest.mark.parametrize(
    ("joints", "frequencies"),
    [
        ({"left": LEFT}, (9.0, 61.0, 190.0)),
        ({"left": LEFT._replace(damping=0.0)}, (9.0, 61.0, 190.0)),
        ({"left": LEFT, "right": RIGHT}, (9.0, 61.0, 190.0)),
        ({"left": LEFT, "right": RIGHT}, (0.0, 61.0, 190.0)),
        ({"left": LEFT._replace(tangent="", friction=0.0), "right": RIGHT}, (9.0, 61.0, 190.0)),
    ],
    ids=["one joint", "without damper", "two, one on a belt", "of a rigid body", "one of two rubs"],
)
def test_displacements_are_those_of_another_program(joints, frequencies):
    """Displacements of all joints and deflections of their springs equal DOP853's to 1e-9 of the gap for a cycle.

    The other program has the same law with events of its own, and counts as many changes of contact and of friction.
    """
    machine = three_modes(joints, frequencies)
    record = simulate(machine, 1, samples_per_cycle=100, integrator=TIGHTEST_EVENTS)
    twin = Twin(machine)
    start = np.zeros(2 * twin.n + twin.m)
    states, events = twin.run(start, np.append(np.arange(100) / 100, 1.0) / machine.speed)
    follows = {event[2] for event in events}
    assert {STICKS, UP, DOWN} & follows
    for j, name in enumerate(machine.joints):
        gap = getattr(machine, f"{name}_clearance")
        missed = record.of_joint(name).history[0, :, 0] - states[:-1, : twin.n] @ twin.rows[j]
        assert np.abs(missed).max() < 1e-9 * gap
    rubbing = [2 * twin.n + machine.joints.index(name) for name in machine.rubbing]
    np.testing.assert_allclose(record.final_state.coordinates[2 * twin.n :], states[-1, rubbing], atol=1e-9 * gap)


def rests_on_surface(mass, spring, normal, friction, force=0.0, speed=1.0, stiffness=1e6):
    """A mass on a spring along a surface, on which a constant force presses it, and its state without motion.

    Two modes, across and along the surface; the joint "along" is never reached, and shows the motion.
    """
    scale = 1.0 / math.sqrt(mass)
    shapes = {"across": [scale, 0.0], "along": [0.0, scale]}
    structure = Structure.of_modes([0.0, math.sqrt(spring / mass) / (2.0 * math.pi)], 0.0, shapes)
    joints = {
        "surface": Joint(
            "across", 1e-4, stiffness, 0.0, stops="one", preload=normal, tangent="along", friction=friction
        ),
        "watched": Joint("along", 9.0, 1.0, 0.0),
    }
    drives = (Drive.sine("force", "along", force),) if force else ()
    machine = machine_with_joints(structure, joints, drives, speed=speed)()
    rest = np.zeros(machine.n_states)
    rest[0] = (1e-4 + normal / stiffness) / scale
    return machine, rest


def turning_points(record):
    """Displacements where the velocity of the joint "watched" changes its sign, by the cubics between samples."""
    shown = np.concatenate(record.of_joint("watched").history)
    x, v, h = shown[:, 0], shown[:, 1], record.machine.cycle_period / record.history.shape[1]
    found = []
    for i in np.flatnonzero(v[:-1] * v[1:] < 0.0):
        b, c = 3.0 * (x[i + 1] - x[i]) - h * (2.0 * v[i] + v[i + 1]), 2.0 * (x[i] - x[i + 1]) + h * (v[i] + v[i + 1])
        roots = np.roots([3.0 * c, 2.0 * b, h * v[i]])
        (s,) = roots[(roots > 0.0) & (roots < 1.0)].real
        found.append(x[i] + s * (h * v[i] + s * (b + s * c)))
    return np.array(found)


def test_a_rubbing_oscillator_loses_the_textbook_amplitude():
    """Free amplitudes fall by 4 mu N / k a cycle, but for the elastic slip d = 2 mu N / k_t: to 1e-8.

    From a turning point A with the spring at its limit to the next one, k (A^2 - B^2) / 2 = mu N (A + B - d).
    """
    mass, spring, normal, friction = 2.0, 5e3, 40.0, 0.25
    machine, start = rests_on_surface(mass, spring, normal, friction, speed=5.0, stiffness=1e7)
    tangential = machine.surface_tangential_factor * 1e7
    start[1] = 0.03 * math.sqrt(mass)
    record = simulate(machine, 6, start, samples_per_cycle=4000, integrator=TIGHTEST_EVENTS)
    peaks = np.abs(turning_points(record))
    limit = friction * normal
    assert len(peaks) > 5
    for before, after in pairwise(peaks[:6]):
        lost = 0.5 * spring * (before**2 - after**2)
        assert lost == pytest.approx(limit * (before + after - 2.0 * limit / tangential), rel=1e-8)
    np.testing.assert_allclose(peaks[:4] - peaks[2:6], 4.0 * limit / spring, rtol=1e-3)
    # where the spring is too weak to move it, it sticks and swings on the tangential spring
    assert np.abs(turning_points(simulate(machine, 6, record.final_state, 20, samples_per_cycle=400))).max() <= (
        limit / spring + limit / tangential
    )


def test_a_driven_element_dissipates_the_area_of_griffins_loop():
    """Work of the force in a cycle is 4 mu N (A - mu N / k_t), A being half of the way (Griffin 1980), to 1e-6."""
    machine, start = rests_on_surface(2.0, 5e3, 40.0, 0.25, force=30.0, speed=5.0, stiffness=2e4)
    tangential, limit = machine.surface_tangential_factor * 2e4, 0.25 * 40.0
    record = simulate(machine, 1, start, transient=400, samples_per_cycle=20_000, integrator=TIGHTEST_EVENTS)
    np.testing.assert_allclose(record.final_state.coordinates, record.section[0], rtol=1e-9, atol=1e-12)
    x, v = record.of_joint("watched").history[0, :, :2].T
    phase = 2.0 * math.pi * np.arange(len(x)) / len(x)
    work = float(np.mean(30.0 * np.sin(phase) * v)) / 5.0
    assert work == pytest.approx(4.0 * limit * (0.5 * np.ptp(x) - limit / tangential), rel=1e-6)
    assert 0.5 * np.ptp(x) > 1.5 * limit / tangential


def test_a_block_on_a_belt_is_carried_along_until_its_spring_pulls_it_back():
    """A block that rests is accelerated by mu N, sticks at the belt's speed, and slips at mu N / k: times to 1e-6."""
    mass, spring, normal, friction, belt = 2.0, 50.0, 40.0, 0.25, 0.2
    machine, start = rests_on_surface(mass, spring, normal, friction, speed=0.5, stiffness=1e9)
    machine = replace(machine, surface_sliding_speed=belt)
    limit, rate = friction * normal, math.sqrt(spring / mass)
    record = simulate(machine, 1, start, samples_per_cycle=20_000)
    x, v = record.of_joint("watched").history[0, :, :2].T
    t = np.arange(len(x)) / len(x) * machine.cycle_period
    # under mu N and its own spring, x = mu N / k (1 - cos w t) until x' = V
    sticks = math.asin(belt * spring / (limit * rate)) / rate
    slips = sticks + (limit / spring - limit / spring * (1.0 - math.cos(rate * sticks))) / belt
    np.testing.assert_allclose(x[t < sticks], limit / spring * (1.0 - np.cos(rate * t[t < sticks])), atol=2e-8)
    carried = (t > sticks + 1e-3) & (t < slips - 1e-3)
    assert carried.sum() > 1000
    np.testing.assert_allclose(v[carried], belt, rtol=2e-3)
    later = (t > slips) & (t < slips + 6.0 / rate) & (t < machine.cycle_period)
    expected = limit / spring + belt / rate * np.sin(rate * (t[later] - slips))
    np.testing.assert_allclose(x[later], expected, atol=1e-5)


def energy_of(machine, state):
    """Energy of modes, stops and tangential springs [J]."""
    n = len(machine.modes.angular_frequency)
    rates = machine.modes.angular_frequency
    energy = 0.5 * np.sum(state[n : 2 * n] ** 2 + (rates * state[:n]) ** 2)
    x = machine.joint_shapes @ state[:n]
    upper, lower = machine.stops.T
    factor = machine.of_joints("lower_stiffness_factor")
    stiffness = machine.of_joints("stiffness")
    energy += 0.5 * np.sum(stiffness * np.maximum(x - upper, 0.0) ** 2)
    energy += 0.5 * np.sum(stiffness * factor * np.maximum(lower - x, 0.0) ** 2)
    for c, name in enumerate(machine.rubbing):
        j = machine.joints.index(name)
        spring = stiffness[j] * getattr(machine, f"{name}_tangential_factor") * (factor[j] if x[j] < lower[j] else 1.0)
        energy += 0.5 * spring * state[2 * n + c] ** 2
    return energy


def some_machine(seed, count, stiffness, friction, factor, damping, rigid):
    """A structure of four random modes with joints at random places, without a drive, and a state that moves."""
    generator = np.random.default_rng(seed)
    shapes = {name + str(j): generator.normal(size=4) for j in range(count) for name in ("p", "t")}
    frequencies = np.sort(generator.uniform(5.0, 200.0, 4))
    if rigid:
        frequencies[0] = 0.0
    structure = Structure.of_modes(frequencies, 0.0, shapes)
    joints = {
        f"j{j}": Joint(
            f"p{j}",
            1e-4 * (1 + j),
            stiffness,
            damping * generator.uniform(),
            lower_stiffness_factor=generator.choice([1.0, 0.2]),
            tangent=f"t{j}",
            friction=friction * generator.uniform(0.5, 2.0),
            tangential_factor=factor,
        )
        for j in range(count)
    }
    machine = machine_with_joints(structure, joints, speed=50.0)()
    start = np.zeros(machine.n_states)
    start[4:8] = 0.05 * generator.normal(size=4)
    return machine, start


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(1, 3),
    stiffness=st.sampled_from([1e3, 1e5, 1e7]),
    friction=st.sampled_from([1e-6, 0.05, 0.5, 3.0, 30.0]),
    factor=st.sampled_from([1e-3, 0.8, 1e3]),
    damping=st.sampled_from([0.0, 10.0, 300.0]),
    rigid=st.booleans(),
)
def test_energy_never_grows(seed, count, stiffness, friction, factor, damping, rigid):
    """Nothing drives: energy of modes, stops and tangential springs falls from cycle to cycle, to 1e-9 of the first."""
    machine, start = some_machine(seed, count, stiffness, friction, factor, damping, rigid)
    record = simulate(machine, 15, start)
    states = [*record.section, record.final_state.coordinates]
    energies = np.array([energy_of(machine, state) for state in states])
    assert (np.diff(energies) <= 1e-9 * energies[0]).all()
    if record.impacts.any() and friction >= 0.05:
        assert energies[-1] < energies[0]


def test_no_friction_is_the_machine_without_it():
    """A coefficient of 0 changes no bit; one of 1e-12 nothing but rounding, to 1e-9 of the gap."""
    plain = {"left": LEFT._replace(tangent="", friction=0.0)}
    expected = simulate(three_modes(plain), 10)
    found = simulate(three_modes({"left": LEFT}, left_friction=0.0), 10)
    for name in ("section", "peak_force", "impacts", "contact_fraction"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    tiny = simulate(three_modes({"left": LEFT}, left_friction=1e-12), 3)
    np.testing.assert_allclose(tiny.section[:, :6], expected.section[:3], atol=1e-9 * 0.15e-3 * 200.0)
    np.testing.assert_array_equal(tiny.impacts, expected.impacts[:3])


def test_much_friction_is_a_spring():
    """A preloaded contact that can't slide holds its mass by k_t: it moves as the stiffer oscillator, to 1e-9."""
    machine, start = rests_on_surface(2.0, 5e3, 40.0, 100.0, speed=7.0, stiffness=1e5)
    start[3] = 0.05 * math.sqrt(2.0)
    record = simulate(machine, 4, start, samples_per_cycle=50)
    rate = math.sqrt((5e3 + machine.surface_tangential_factor * 1e5) / 2.0)
    t = np.arange(200) / 350.0
    shown = np.concatenate(record.of_joint("watched").history)[:, 0]
    np.testing.assert_allclose(shown, 0.05 / rate * np.sin(rate * t), atol=1e-9 * 0.05 / rate)


def test_split_repeated_and_sampled_runs_are_equal_bit_for_bit():
    """A run in two parts, once more, and with a history: the same bytes, with joints that stick and slide."""
    machine = three_modes({"left": LEFT, "right": RIGHT})
    whole = simulate(machine, 40)
    first = simulate(machine, 17)
    parts = first.followed_by(simulate(machine, 23, first.final_state))
    sampled = simulate(three_modes({"left": LEFT, "right": RIGHT}), 40, samples_per_cycle=13)
    for name in ("section", "peak_force", "impacts", "contact_fraction"):
        np.testing.assert_array_equal(getattr(parts, name), getattr(whole, name))
        np.testing.assert_array_equal(getattr(sampled, name), getattr(whole, name))


@pytest.mark.parametrize("damping", [15.0, 0.0])
def test_deviations_are_those_of_two_nearby_runs(damping):
    """The derivative of a cycle's end by its beginning is a central difference of two runs, to 1e-5, cycle by cycle."""
    machine = three_modes({"left": LEFT._replace(damping=damping), "right": RIGHT})
    state, seen = simulate(machine, 20).final_state, 0
    for _ in range(12):
        record, ends, _ = simulate_with_deviations(
            machine,
            1,
            state,
            deviations=np.eye(machine.n_states),
            orthonormal=False,
            integrator=TIGHTEST_EVENTS,
        )
        steps = np.array([1e-11] * 3 + [1e-9] * 3 + [1e-12] * 2)
        moved = []
        for i, step in enumerate(steps):
            pair = []
            for sign in (1.0, -1.0):
                coordinates = state.coordinates.copy()
                coordinates[i] += sign * step
                other = simulate(machine, 1, MotionState(coordinates, state.bouncing), integrator=TIGHTEST_EVENTS)
                pair.append(other.final_state.coordinates)
            moved.append((pair[0] - pair[1]) / (2.0 * step))
        scale = machine.state_weights(state.coordinates)
        found, expected = (np.asarray(each) * scale / scale[:, None] for each in (ends, moved))
        np.testing.assert_allclose(found, expected, atol=1e-5 * np.abs(expected).max())
        seen += int(record.impacts.sum())
        state = record.final_state
    assert seen > 10


BLADE = """
[structure]
frequencies = "9, 61, 190 Hz"
damping_ratios = "2 %"
[structure.shapes]
tip = "2.1, -1.9, 1.7 kg^-1/2"
side = "1.0, 1.2, -0.7 kg^-1/2"
drive = "1.2, 0.8, 0.5 kg^-1/2"
[joint]
at = "tip"
clearance = "0.15 mm"
stiffness = "0.2 N/um"
damping = "15 N s/m"
friction = 0.3
tangent = "side"
[[drive]]
at = "drive"
force = "8 N"
[operation]
speed = "14 Hz"
speed_range = "8 to 20 Hz"
clearance_range = "0.05 to 0.3 mm"
"""


def read(folder, *changes):
    """The file of a blade that rubs, with changes (old, new)."""
    text = BLADE
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    file = folder / "blade.toml"
    file.write_text(text)
    return chaosgym.read_machine(file)


def test_a_file_states_what_sticks_and_slides(tmp_path):
    """A tangential spring is Mindlin's share of the stop's if none is stated; fields go by the names of one joint."""
    blade = read(tmp_path)
    assert blade.joints == blade.rubbing == ("joint",)
    assert blade.joint_tangential_factor == pytest.approx(1.4 / 1.7)
    stated = 'tangent = "-side"\ntangential_stiffness = "50 N/mm"\nsliding_speed = "20 mm/s"'
    belt = read(tmp_path, ('tangent = "side"', stated))
    assert (belt.joint_tangential_factor, belt.joint_sliding_speed, belt.tangents["joint"]) == (0.25, 0.02, "-side")
    assert any("sticks and slides along '-side'" in note for note in belt.notes)
    named = {"clearance": 1e-4, "joint.friction": 0.1}
    assert by_field(blade, named) == {"joint_clearance": 1e-4, "joint_friction": 0.1}


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("friction = 0.3", "friction = -0.3", "joint_friction = -0.3 is out of range; allowed: 0 to 100"),
        ('tangent = "side"', "", "joint.friction needs joint.tangent"),
        ("friction = 0.3", "", "joint.tangent has no meaning without joint.friction"),
        ('tangent = "side"', 'slides = "side"\nsliding_speed = "1 m/s"', "joint.sliding_speed has no meaning without"),
        ("friction = 0.3", 'friction = 0.3\nslides = "side"', "joint.slides does not go with joint.tangent"),
        ('"side"', '""', "joint.tangent = '' is no point that moves along the surfaces"),
        ('"side"', '"-tip"', "joint.tangent = '-tip' is no point that moves along the surfaces; allowed: another one"),
        ('"side"', '"sid"', "no point 'sid'; did you mean side"),
        ('tangent = "side"', 'tangent = "side"\ntangential_stiffness = "0 N/m"', "allowed: above 0"),
        ('tangent = "side"', 'tangent = "side"\ntangential_stiffness = "1 N"', "unknown unit 'N'"),
        ('"0.2 N/um"', '"0.2, 0.3, 0.1 N/um"', "over the cycle does not go with joint.tangent"),
        ("1.0, 1.2, -0.7", "0, 0, 0", "joint.tangent = 'side' never moves"),
        ('tangent = "side"', 'tangent = "side"\nmu = 0.1', "tangent the point that sticks and slides"),
    ],
)
def test_bad_friction_is_told_in_a_line(tmp_path, old, new, told):
    """What has no meaning, or contradicts itself, is refused in one line."""
    with pytest.raises(ParameterError) as error:
        read(tmp_path, (old, new))
    assert told in str(error.value)
    assert "\n" not in str(error.value)


def test_a_fast_belt_is_what_slides_all_the_time(tmp_path):
    """Surfaces that move at 10 m/s never stick: the motion is that of ``slides`` by another kernel, to 1e-6 of the gap.

    A point that slides to where it grows is one whose surfaces move to where it falls.
    """
    one_way = read(tmp_path, ('tangent = "side"', 'slides = "side"'))
    stated = 'tangent = "side"\nsliding_speed = "-10 m/s"\ntangential_stiffness = "10 N/um"'
    belt = read(tmp_path, ('tangent = "side"', stated))
    runs = [simulate(machine, 1, samples_per_cycle=60).history[0, :, 0] for machine in (one_way, belt)]
    assert np.abs(runs[0] - runs[1]).max() < 1e-6 * 0.15e-3


def test_a_batch_moves_each_machine_as_alone(tmp_path):
    """Machines side by side, at speeds and clearances of their own, have the peaks of single runs bit for bit."""
    blade = read(tmp_path)
    batch, which = blade.batch(3), np.arange(3)
    for i in range(3):
        batch.start(i, blade)
    places = [(12.0, 1e-4), (14.0, 1.5e-4), (17.0, 2e-4)]
    batch.set_speeds(which, np.array([speed for speed, _ in places]))
    batch.set_clearances(which, np.array([gap for _, gap in places]))
    cycles = batch.run(which, 10)
    for i, place in enumerate(places):
        np.testing.assert_array_equal(cycles.peak_force[i], simulate(blade.at(*place), 10).peak_force)
    batch.kick(which, np.ones((3, blade.n_velocities)))
    with pytest.raises(ParameterError, match="allowed: the same ones"):
        batch.change(0, replace(blade, joint_friction=0.0))


def test_the_exponent_of_a_proven_orbit_is_that_of_its_multipliers(tmp_path):
    """The multipliers of a proven orbit that sticks and slides tell how fast a nearby run comes back."""
    blade = read(tmp_path)
    orbit = find_periodic_orbit(blade, simulate(blade, 1, transient=200).final_state.coordinates, 1)
    largest = float(np.abs(orbit.multipliers).max())
    assert 0.0 < largest < 1.0
    exponents, demanded = lyapunov_spectrum(blade, 100)
    assert exponents[0] == pytest.approx(math.log(largest), abs=0.01)
    assert demanded == -math.inf


@pytest.mark.parametrize(("friction", "speed", "chaotic"), [(0.1, 16.0, True), (0.2, 12.0, False)])
def test_the_exponent_is_that_of_two_nearby_runs(tmp_path, friction, speed, chaotic):
    """Two runs that are drawn together again after each cycle part as the deviation grows, in chaos and out of it.

    Over the same cycles, as the mean over others differs by chance. Two directions take a few cycles to become one.
    """
    blade = replace(read(tmp_path), joint_friction=friction, speed=speed)
    state = simulate(blade, 1, transient=300).final_state
    weights = blade.state_weights(state.coordinates)
    direction, growth, apart = np.cos(1.0 + np.arange(len(weights))) / weights, 0.0, 1e-9
    for _ in range(500):
        near = MotionState(state.coordinates + apart * direction, state.bouncing)
        state, other = simulate(blade, 1, state).final_state, simulate(blade, 1, near).final_state
        moved = other.coordinates - state.coordinates
        size = float(np.linalg.norm(moved * weights))
        growth += math.log(size / apart) / 500
        direction = moved / size
    found = largest_lyapunov_exponent(blade, 500, transient=300)
    assert found.per_cycle == pytest.approx(growth, abs=0.02)
    assert (growth > 0.5) == chaotic


@njit
def end_of_a_stick(series, tolerance):
    """First zero of a margin that opens within a second."""
    return opening(series, 0, 1, 5, 1.0, 4.4, 0.0, 0.0, 1.0, tolerance, 2.0)


@pytest.mark.parametrize("tolerance", [1e-9, 1e-13, 1e-15])
def test_the_end_of_a_short_stick_is_found_however_closely_events_are_placed(tolerance):
    """A margin that begins at its limit without a slope, t^2 - 1.5 t^3 in rounding of 4.4, ends at t = 2 / 3."""
    series = np.array([4.4, 0.0, 1.0, -1.5, 0.0, 0.0])
    assert end_of_a_stick(series, tolerance) == pytest.approx(2.0 / 3.0, abs=1e-8)


def harmonic_balance(load, stiffness, limit, mass, spring, damping, rate):
    """Amplitude of a mass under a sine on the element of Jenkins, by its first harmonic (Griffin 1980)."""

    def missing(amplitude):
        held, lost, slip = stiffness, 0.0, limit / stiffness
        if amplitude > slip:
            angle = math.acos(1.0 - 2.0 * slip / amplitude)
            held = stiffness / math.pi * (angle - 0.5 * math.sin(2.0 * angle))
            lost = 4.0 * limit / (math.pi * amplitude) * (1.0 - slip / amplitude)
        reaction = complex(spring + held - mass * rate**2, mass * damping * rate + lost)
        return amplitude * abs(reaction) - load

    return brentq(missing, 1e-9, 1.0)


@pytest.mark.parametrize("speed", [190.0, 200.0, 207.0, 215.0, 230.0])
@pytest.mark.parametrize("preload", [5.0, 40.0, 400.0])
def test_the_blade_of_the_example_swings_as_griffin_says(speed, preload):
    """Amplitudes of the first harmonic agree within 1 %, where the damper sticks, slides, or does both."""
    blade = chaosgym.read_machine("docs/machines/friction-damper.toml")
    blade = replace(blade, speed=speed, joint_preload=preload)
    q, v = simulate(blade, 1, transient=1500).final_state.coordinates[[0, 2]] / math.sqrt(0.1)
    rate = 2.0 * math.pi * speed
    spring = 0.1 * (400.0 * math.pi) ** 2
    expected = harmonic_balance(20.0, 5e4, 0.3 * preload, 0.1, spring, 5.0, rate)
    assert math.hypot(q, v / rate) == pytest.approx(expected, rel=0.01)
