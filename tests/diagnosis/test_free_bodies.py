"""A machine whose bodies turn freely is judged by what its forces depend on, and not by how far it has turned."""

import gymnasium
import numpy as np
import pytest

from chaosgym import read_machine, simulate
from chaosgym.diagnosis import attractors, diagnose, largest_lyapunov_exponent
from chaosgym.machines.ignorable import ignorable, relative

MOTOR, LOAD, RATIO = 0.002, 0.03, 3.0
"""Moments of inertia [kg m^2] of both ends of a gear pair, and its ratio."""

REDUCED = 1.0 / (1.0 / (RATIO**2 * MOTOR) + 1.0 / LOAD)
"""Inertia of the path in the gap, at the load: a torque T in the mesh moves it by T / REDUCED."""

JOINT = """
[joint]
at = "{at}"
clearance = "0.075 deg"
stiffness = "20000 N m/rad"
damping = "5 N m s/rad"
"""

OPERATION = """
[operation]
speed = "25 Hz"
speed_range = "10 to 60 Hz"
clearance_range = "0.02 to 0.3 deg"
"""


def gear_pair(tmp_path, *, damper=0.0, drag=0.0, torque=0.0, more=""):
    """A motor of 2 N m at 25 Hz and a load in absolute angles; both turn freely."""
    text = f"""
[structure]
frequencies = "0, 0 Hz"
damping_ratios = "0 %"
modal_masses = ["{MOTOR} kg m^2", "{LOAD} kg m^2"]

[structure.shapes]
motor = "1, 0"
load = "0, 1"
{JOINT.format(at="1/3 motor - load")}
[[spring]]
at = "load"
damping = "{damper} N m s/rad"

[[load]]
at = "load"
force = "{-drag} N m"

[[load]]
at = "motor"
force = "{torque} N m"

[[drive]]
at = "motor"
force = "2 N m"
{more}{OPERATION}"""
    (tmp_path / "pair.toml").write_text(text)
    return read_machine(tmp_path / "pair.toml")


def path_in_the_gap(tmp_path, *, drag, torque):
    """The same pair without damper as one coordinate, the path between its teeth at the load."""
    accelerates = 1.0 / (RATIO * MOTOR)  # by a newton metre at the motor
    text = f"""
[structure]
frequencies = "0 Hz"
damping_ratios = "0 %"
modal_masses = ["{REDUCED} kg m^2"]

[structure.shapes]
path = "1"
{JOINT.format(at="path")}
[[load]]
at = "path"
force = "{REDUCED * (torque * accelerates + drag / LOAD)} N m"

[[drive]]
at = "path"
force = "{2.0 * REDUCED * accelerates} N m"
{OPERATION}"""
    (tmp_path / "path.toml").write_text(text)
    return read_machine(tmp_path / "path.toml")


@pytest.mark.parametrize(("drag", "torque"), [(0.0, 0.0), (3.0, 1.0), (3.0, 0.0)])
def test_a_free_pair_has_the_orbit_of_the_path_in_its_gap(tmp_path, drag, torque):
    """Balanced, and speeding up without end: the orbit, its multipliers and peaks are those of the relative motion."""
    pair, path = gear_pair(tmp_path, drag=drag, torque=torque), path_in_the_gap(tmp_path, drag=drag, torque=torque)
    found, wanted = diagnose(pair), diagnose(path)
    assert (found.nature, found.period, found.status) == ("periodic", wanted.period, "certified")
    np.testing.assert_allclose(found.evidence["largest_peak"], wanted.evidence["largest_peak"], rtol=1e-9)
    np.testing.assert_allclose(np.abs(found.orbit.multipliers[:2]), np.abs(wanted.orbit.multipliers), rtol=1e-6)
    np.testing.assert_allclose(np.abs(found.orbit.multipliers[2:]), 0.0, atol=1e-9)


def test_a_pair_that_drifts_is_periodic_and_its_starts_come_back(tmp_path):
    """A drag turns the load for ever against its damper; each of 16 starts settles on the one motion."""
    pair = gear_pair(tmp_path, damper=0.3, drag=3.0)
    record = simulate(pair, 50, transient=400)
    assert np.ptp(record.section[:, 0]) > 1e-3  # its angles drift
    assert np.ptp(record.peak_force) < 1e-9 * record.peak_force.max()
    assert np.ptp(record.states, axis=0).max() < 1e-9
    found = diagnose(pair)
    assert (found.words, found.status) == ("periodic, period 1", "certified")
    exponent = largest_lyapunov_exponent(pair, cycles=100).per_cycle
    assert exponent == pytest.approx(np.log(found.orbit.largest_multiplier), abs=0.05)
    search = attractors(pair, starts=16, budget=400)
    assert len(search.motions) == 1


def test_a_spring_over_the_cycle_between_free_bodies(tmp_path):
    """Where the stiffness varies over the cycle the angles drift too, and the verdict is certified."""
    more = '\n[[spring]]\nat = "1/3 motor - load"\nstiffness = "100, 300, 100, 50 N m/rad"\n'
    found = diagnose(gear_pair(tmp_path, damper=0.3, drag=3.0, more=more))
    assert (found.words, found.status) == ("periodic, period 1", "certified")


def test_what_is_ignorable(tmp_path):
    """A turn of both moves no joint; its velocity counts where a damper holds it, and all counts beside a spring."""
    turn = np.array([RATIO * np.sqrt(MOTOR), np.sqrt(LOAD)])  # of mass-normalised modes
    turn /= np.linalg.norm(turn)
    free, damped = ignorable(gear_pair(tmp_path)), ignorable(gear_pair(tmp_path, damper=0.3))
    np.testing.assert_allclose(np.abs(free), [[*turn, 0.0, 0.0], [0.0, 0.0, *turn]], atol=1e-14)
    np.testing.assert_allclose(np.abs(damped), [[*turn, 0.0, 0.0]], atol=1e-14)
    held = gear_pair(tmp_path, more='\n[[spring]]\nat = "motor"\nstiffness = "1 N m/rad"\n')
    assert ignorable(held) is None
    states = np.random.default_rng(0).normal(size=(5, 4))
    assert relative(held, states) is states
    assert np.abs(relative(gear_pair(tmp_path), states) @ free.T).max() < 1e-14


def test_an_environment_calls_a_pair_calm_that_drifts(tmp_path):
    """Once it has settled, each step repeats: none is irregular, though its angles go on and on."""
    gear_pair(tmp_path, damper=0.3, drag=3.0)
    speeds = {"lowest_speed": 24.0, "highest_speed": 26.0, "lowest_demand": 24.5, "highest_demand": 25.5}
    env = gymnasium.make("chaosgym/Machine-v0", machine=str(tmp_path / "pair.toml"), **speeds)
    env.reset(seed=0)
    steps = [env.step(0)[-1] for _ in range(30)]
    assert steps[-1]["largest_force"] > 1.0
    assert np.mean([step["type_iii"] for step in steps[5:]]) < 0.1
