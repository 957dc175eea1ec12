"""A motor in the environments: the agent gives its set-point, the speed follows as the equation of motion says."""

import math
import pickle
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import chaosgym
from chaosgym.control.controllers import Follow
from chaosgym.control.policies import TrainedPolicy, load_policy, save_policy
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.rollout import play
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.task import Status
from chaosgym.errors import ModelFileError, ParameterError, SimulationError
from tests.envs.test_vector_env import _assert_same_episodes
from tests.machines.test_motor import FOLDER, by_hand

STALL, FULL, WHEEL = 60.0, 1500.0, 0.1
"""Torque at rest [N m], speed without load [rpm] and flywheel [kg m^2] of the motor."""

MOTOR = f'[motor]\nstall_torque = "{STALL} N m"\nno_load_speed = "{FULL} rpm"\ninertia = "{WHEEL} kg m^2"\n'
LOSSY = '[[spring]]\nbetween = ["ground.shaft", "piston.pin"]\nstiffness = "100 N/m"\nfree_length = "0.1 m"\n'
RANGE = {"lowest_speed": 600.0, "highest_speed": 1500.0, "lowest_demand": 700.0, "highest_demand": 1350.0}
EASY = {**RANGE, "drive": "motor", "reference_force": 1e5, "shortest_hold": 4, "longest_hold": 8}


@pytest.fixture(scope="module")
def motored(tmp_path_factory):
    """File of the compressor of ``tests.machines.test_motor`` with a motor, or with another text of it."""

    def written(motor=MOTOR):
        text = (FOLDER / "compressor.toml").read_text(encoding="utf-8")
        text = text.replace("[operation]", f'{LOSSY}damping = "40 N s/m"\n\n{motor}\n[operation]', 1)
        path = Path(tmp_path_factory.mktemp("motored")) / "own.toml"
        path.write_text(text, encoding="utf-8")
        return str(path)

    return written


def make(machine, task="Tolerance", **keywords):
    """Environment of a file with a motor."""
    return gym.make(f"chaosgym/Machine{task}-v0", machine=machine, **{**EASY, **keywords})


def test_the_speed_follows_as_the_equation_of_motion_says(motored):
    """Mean speed, torque and power of each of eight steps to 0.1, 1 and 1 % of those by LSODA, up and down."""
    env = make(motored(), "", action="speed", slew_limit=400.0)
    _, info = env.reset(seed=1, options={"speed": 1400.0})
    cycles, run_in = env.unwrapped.task.cycles_per_step, env.unwrapped.task.run_in_cycles
    rate = 1400.0 * math.pi / 30.0
    _, found = by_hand(STALL * 1400.0 / FULL, rate, WHEEL, run_in, rate)
    rate = found.y_events[0][-1][1]
    for wanted in (1400.0, 1400.0, 1100.0, 800.0, 800.0, 1200.0, 1500.0, 900.0):
        observation, _, _, _, info = env.step([wanted])
        set_point = wanted if wanted != 900.0 else 1100.0
        assert info["set_point"] == set_point, "within the slew limit"
        no_load = set_point * math.pi / 30.0
        turns, found = by_hand(STALL * set_point / FULL, no_load, WHEEL, cycles, rate)
        time, rate = turns[cycles - 1], found.y_events[0][-1][1]
        assert len(turns) == cycles
        assert info["speed"] == pytest.approx(60.0 * cycles / time, rel=1e-3)
        done = found.t <= time
        torque = STALL / FULL * (set_point - found.y[1][done] * 30.0 / math.pi)
        work = np.trapezoid(torque, found.y[0][done])
        assert info["motor_torque"] == pytest.approx(work / found.y[0][done][-1], rel=1e-2, abs=0.1)
        assert info["motor_power"] == pytest.approx(work / time, rel=1e-2, abs=10.0)
        seen = dict(zip(env.unwrapped.observation_names, observation, strict=True))
        assert seen["speed"] == pytest.approx(info["speed"], rel=1e-6)
        assert seen["set_point"] == set_point
        assert seen["offset"] == pytest.approx(info["speed"] - seen["demand"], rel=1e-5)
        weight = env.unwrapped.task.deviation_weight
        assert info["reward_deviation"] == pytest.approx(-weight * abs(info["speed"] - info["demand"]))
        assert env.unwrapped.speed == info["speed"]
        assert env.unwrapped.machine.speed == info["speed"]


def test_a_cycle_runs_at_its_speed_to_a_thousandth(motored):
    """The gap moves as ``simulate`` has it at the rounded speeds of ``under_motor``."""
    env = make(motored(), "", action="speed", sensor_error=0.0, steps=4)
    env.reset(seed=1, options={"speed": 1500.0})
    task, run = env.unwrapped.task, env.unwrapped.nominal.under_motor(40, 1500.0)
    record = chaosgym.simulate(env.unwrapped.nominal, 40, operation=run.operation)
    observation, *_, info = env.step([1500.0])
    seen = dict(zip(env.unwrapped.observation_names, observation, strict=True))
    assert seen["mean_peak_force"] == pytest.approx(
        record.peak_force.max(axis=1)[-task.cycles_per_step :].mean(), rel=1e-6
    )
    assert info["speed"] == pytest.approx(task.cycles_per_step / np.sum(1.0 / run.speed[-task.cycles_per_step :]))


@pytest.mark.parametrize("action", ["trim", "continuous"])
def test_gymnasium_finds_nothing_to_complain_about(action, motored):
    """check_env passes without a warning."""
    env = make(motored(), action=action, steps=12).unwrapped
    check_env(env, skip_render_check=True)


@pytest.mark.parametrize("disturbed", [{}, {"speed_ripple": 0.002, "kick": 1e-4, "wear": 0.1}])
def test_side_by_side_gives_the_same_bytes(disturbed, motored):
    """Native and single environments: observations, rewards and infos, ends of jobs included."""
    keywords = {"machine": motored(), **EASY, "steps": 5, **disturbed}
    mode = AutoresetMode.NEXT_STEP
    native = gym.make_vec("chaosgym/MachineTolerance-v0", num_envs=2, autoreset_mode=mode, **keywords)
    sync = gym.make_vec(
        "chaosgym/MachineTolerance-v0",
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **keywords,
    )
    assert _assert_same_episodes((native, sync), 12) > 3
    again = pickle.loads(pickle.dumps(native.unwrapped.jobs._drive))
    np.testing.assert_array_equal(again._step, native.unwrapped.jobs._drive._step)


def test_a_motor_that_stalls_ends_the_job(motored):
    """With 10 N m at rest it can't compress at a low set-point: terminated, at rest, and the steps left cost."""
    path = motored(MOTOR.replace(f"{STALL} N m", "10 N m"))
    env = make(path, "", action="speed", slew_limit=900.0, type_iii_weight=0.0)
    env.reset(seed=1, options={"speed": 1500.0})
    assert env.step([1500.0])[4]["status"] == Status.RUNNING
    ended = False
    while not ended:
        observation, reward, ended, truncated, info = env.step([600.0])
    assert (info["status"], info["is_success"], truncated) == (Status.STALLED, False, False)
    assert (info["speed"], info["motor_power"]) == (0.0, 0.0)
    assert info["motor_torque"] == pytest.approx(10.0 * 600.0 / FULL)
    assert info["reward_failure"] < -2.0 * 100
    assert math.isfinite(reward)
    assert env.observation_space.contains(observation)
    assert observation[PLACE.speed] == 0.0
    assert env.unwrapped.machine.speed == env.unwrapped.nominal.speed
    with pytest.raises(gym.error.ResetNeeded):
        env.step([1500.0])
    with pytest.raises(SimulationError, match="the motor stalls at a set-point of 600 rpm"):
        env.reset(seed=1, options={"speed": 600.0})
    envs = gym.make_vec(
        "chaosgym/Machine-v0", num_envs=2, machine=path, **EASY, action="speed", slew_limit=900.0, start_below=0.0
    )
    envs.reset(seed=1, options={"speed": 1500.0})
    for _ in range(6):
        _, _, over, _, infos = envs.step(np.array([[600.0], [1500.0]], np.float32))
        if over.any():
            break
    assert infos["status"].tolist() == [Status.STALLED, Status.RUNNING]


def test_what_controllers_set_makes_up_for_the_slip(motored):
    """Following the demand ends at the demand, more than 50 rpm below the set-point."""
    keywords = {**RANGE, "drive": "motor", "reference_force": 1e5, "action": "speed"}
    envs = gym.make_vec("chaosgym/Machine-v0", num_envs=1, machine=motored(), **keywords, steps=60)
    observation, _ = envs.reset(seed=1)
    policy, missed, slip = Follow(), [], []
    policy.start(envs.unwrapped)
    held = 0
    for _ in range(59):
        observation, _, _, _, info = envs.step(policy(observation))
        held = held + 1 if observation[0, PLACE.demand] == info["demand"][0] else 0
        if held > 12:
            missed.append(info["deviation"][0])
            slip.append(info["set_point"][0] - info["speed"][0])
    assert len(missed) > 10
    assert max(missed) < 1.0
    assert min(slip) > 50.0


def test_a_policy_knows_that_it_sets_a_motor(motored, tmp_path):
    """It is kept with the set-point that it sees, plays with a motor by itself, and is refused without one."""
    path, layer = motored(), Dense(np.zeros((6, 15), np.float32), np.eye(6, dtype=np.float32)[5], "none")
    own = chaosgym.read_machine(path).definition
    observes = (*OBSERVATION_NAMES, "set_point")
    save_policy(TrainedPolicy(path, "trim", Network(None, (layer,)), machine=own, observes=observes), tmp_path)
    policy = load_policy(tmp_path)
    assert policy.keywords == {"action": "trim", "drive": "motor"}
    speeds = {name: value for name, value in EASY.items() if name != "drive"}
    assert np.nanmin(play(policy, path, [0], **speeds, steps=3).speed) > 0.0
    envs = gym.make_vec("chaosgym/Machine-v0", num_envs=1, machine=path, **speeds)
    envs.reset(seed=0)
    with pytest.raises(ModelFileError, match="sees set_point, and the environment gives speed, demand"):
        policy.start(envs.unwrapped)


def test_a_machine_of_a_fleet_that_can_not_start_is_drawn_anew(motored):
    """Of motors of 6 to 14 N m many stall at 700 rpm: jobs begin on those that do not, the same for the same seed."""
    path = motored(MOTOR.replace(f"{STALL} N m", "10 N m"))
    started = {"options": {"speed": 700.0}}
    env = make(path, "", tolerances={"motor_stall_torque": 0.4})
    jobs = []
    for seed in (*range(5), 0):
        _, info = env.reset(seed=seed, **started)
        assert info["status"] == Status.RUNNING
        jobs.append((env.unwrapped.machine.motor_stall_torque, info["speed"], info["demand"]))
    assert jobs[0] == jobs[-1]
    envs = gym.make_vec("chaosgym/Machine-v0", num_envs=2, machine=path, **EASY, tolerances={"motor_stall_torque": 0.4})
    envs.reset(seed=0, **started)
    with pytest.raises(SimulationError, match="at a set-point of 600 rpm, on 20 other machines drawn too"):
        make(path, "", tolerances={"motor_stall_torque": 0.01}).reset(seed=0, options={"speed": 600.0})


def test_where_there_is_no_motor_it_is_refused(motored):
    """Built-in machines, those without [motor], set-points beyond its speed without load; one line says what to do."""
    for name in ("ImpactBeam-v1", "SliderCrank-v1", "AnyMachine-v0"):
        with pytest.raises(ParameterError, match=r"has none; allowed: 'constant', or the file of a mechanism with"):
            gym.make(f"chaosgym/{name}", drive="motor")
    with pytest.raises(ParameterError, match=r"with \[motor\]: stall_torque, no_load_speed and inertia"):
        make(str(FOLDER / "compressor.toml"))
    with pytest.raises(ParameterError, match="up to no_load_speed = 1500 rpm"):
        make(motored(), highest_speed=1600.0)
    with pytest.raises(ParameterError, match="drive = 'servo' is not one of constant, motor"):
        make(motored(), drive="servo")
    with pytest.raises(ParameterError, match="not the speed to which a motor slips; allowed: drive = 'constant'"):
        chaosgym.Operator(Follow(), motored(), **EASY)
    plain = make(motored(), drive="constant")
    plain.reset(seed=0)
    assert not {"set_point", "motor_torque", "motor_power"} & set(plain.step(0)[4])
