"""The impact beam environment: the contract of Gymnasium, and the physics behind it."""

import inspect
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import chaosgym  # noqa: F401
from chaosgym.envs import machine_env
from chaosgym.envs.documentation import environments_page
from chaosgym.envs.impact_beam import TOLERANCES, ImpactBeamEnv
from chaosgym.envs.tasks import Status
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.simulation import simulate

ID = "chaosgym/ImpactBeam-v0"


def _action(env: ImpactBeamEnv, speed: float) -> np.ndarray:
    return np.array([env.drive.action_for(speed)], np.float32)


def _run(env: gym.Env, seed: int, steps: int) -> list[Any]:
    """Observations, rewards and infos of random actions."""
    env.action_space.seed(seed)
    results: list[Any] = [env.reset(seed=seed)]
    for _ in range(steps):
        results.append(env.step(env.action_space.sample()))
    return results


@pytest.mark.parametrize("keywords", [{}, {"tolerance": True}, {"cycles_per_step": 1, "sensor_error": 0.0}])
def test_gymnasium_finds_nothing_to_complain_about(keywords: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """check_env passes without a warning, rendering included."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    check_env(gym.make(ID, **keywords).unwrapped)


def test_stable_baselines3_finds_nothing_to_complain_about() -> None:
    """check_env passes without a warning."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(ID, render_mode="rgb_array"), warn=True, skip_render_check=False)


@pytest.mark.parametrize("keywords", [{}, {"tolerance": True}])
def test_same_seed_same_bytes(keywords: dict[str, Any]) -> None:
    """Whole trajectories repeat, in a new environment as well as after other jobs in the same one."""
    fresh, used = gym.make(ID, **keywords), gym.make(ID, **keywords)
    _run(used, seed=99, steps=4)
    for one, other in zip(_run(fresh, 7, 12), _run(used, 7, 12), strict=True):
        assert one[0].tobytes() == other[0].tobytes()
        assert one[1:] == other[1:]


def test_another_seed_is_another_machine() -> None:
    """Machines lie within the tolerances, and differ from job to job."""
    env = ImpactBeamEnv(tolerance=True)
    drawn = []
    for seed in range(20):
        env.reset(seed=seed)
        drawn.append([getattr(env.machine, name) / getattr(ImpactBeam(), name) - 1.0 for name in TOLERANCES])
    shares = np.array(drawn) / list(TOLERANCES.values())
    assert np.all(np.abs(shares) <= 1.0)
    assert np.all(shares.std(axis=0) > 0.3)


def test_the_motion_goes_on_between_steps() -> None:
    """Steps at constant speed are one long simulation, bit for bit."""
    env = ImpactBeamEnv(sensor_error=0.0)
    observation, _ = env.reset(seed=0, options={"speed": 30.0})
    peaks = [observation[8:]]
    for _ in range(6):
        peaks.append(env.step(_action(env, 30.0))[0][8:])
    whole = simulate(ImpactBeam(excitation_frequency=30.0), cycles=50)
    assert np.array_equal(np.concatenate(peaks), whole.peak_force[15:, 0].astype(np.float32))


def test_the_motion_goes_on_across_changes_of_speed() -> None:
    """A change of speed changes the frequency of the force and nothing else."""
    env = ImpactBeamEnv(sensor_error=0.0)
    env.reset(seed=0)
    state = simulate(ImpactBeam(excitation_frequency=4.0), cycles=20).final_state
    for speed in (5.0, 6.0, 6.0, 5.0):
        observation, _, _, _, info = env.step(_action(env, speed))
        assert info["speed"] == pytest.approx(speed, abs=1e-6)
        record = simulate(ImpactBeam(excitation_frequency=info["speed"]), 5, state)
        assert np.array_equal(observation[8:], record.peak_force[:, 0].astype(np.float32))
        state = record.final_state


def test_speed_is_limited_in_range_and_slew() -> None:
    """The target is mapped linearly to 4 to 30 Hz and approached by at most 1 Hz a step."""
    env = ImpactBeamEnv()
    env.reset(seed=0)
    speeds = [env.step(np.array([5.0], np.float32))[4]["speed"] for _ in range(28)]
    assert np.max(np.diff([4.0, *speeds])) <= 1.0 + 1e-9
    assert speeds[-1] == 30.0
    for _ in range(14):
        info = env.step(np.zeros(1, np.float32))[4]
    assert info["speed"] == pytest.approx(17.0)


def test_sensor_error_is_bounded_and_does_not_touch_reward() -> None:
    """The agent sees +-3 N of error; reward and cost use true peak forces."""
    exact, noisy = ImpactBeamEnv(sensor_error=0.0), ImpactBeamEnv()
    differences = []
    for seed in range(5):
        for (true, reward, *_), (measured, same, *_) in zip(
            _run(exact, seed, 5)[1:], _run(noisy, seed, 5)[1:], strict=True
        ):
            differences.append(measured[8:] - true[8:])
            assert reward == same
    error = np.concatenate(differences)
    assert 2.0 < np.abs(error).max() <= 3.0 + 1e-4


def test_the_job_ends_when_it_is_done() -> None:
    """Time, progress and end of a job at constant speed come out as the definition says."""
    env = ImpactBeamEnv(job_cycles=50)
    env.reset(seed=0, options={"speed": 15.0})
    total, ended, steps = 0.0, False, 0
    while not ended:
        observation, _, ended, truncated, info = env.step(_action(env, 15.0))
        total += info["reward_time"]
        steps += 1
        assert not truncated
    assert steps == 10
    assert observation[2] == 0.0
    assert info["status"] == Status.JOB_DONE
    assert info["is_success"]
    assert total == pytest.approx(-2.0)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(_action(env, 15.0))


def test_an_overloaded_joint_breaks() -> None:
    """Five times the force breaks the joint before the job is done, at the price of the failure weight."""
    env = ImpactBeamEnv(force_amplitude=44.5)
    env.reset(seed=0, options={"speed": 25.0})
    for _ in range(200):
        _, _, ended, _, info = env.step(_action(env, 25.0))
        if ended:
            break
    assert info["status"] == Status.FRACTURE
    assert info["damage"] >= 1.0
    assert info["cost_force"] == 1.0
    assert info["reward_failure"] == -10.0
    assert not info["is_success"]


def test_a_failed_simulation_ends_the_job(monkeypatch: pytest.MonkeyPatch) -> None:
    """step() never raises for the physics; status says what happened, and no value is NaN."""
    env = ImpactBeamEnv()
    env.reset(seed=0)

    def fail(*_: Any, **__: Any) -> None:
        raise SimulationError("the motion grew beyond every bound")

    monkeypatch.setattr(machine_env, "simulate", fail)
    observation, reward, terminated, truncated, info = env.step(_action(env, 10.0))
    assert (terminated, truncated, info["status"]) == (True, False, Status.SIMULATION_FAILED)
    assert observation in env.observation_space
    assert reward == pytest.approx(info["reward_time"] - 10.0)
    assert np.all(np.isfinite(list(info.values())))


@pytest.mark.parametrize("speed", [8.0, 16.0, 19.0, 22.5])
def test_periodic_speeds_cost_nothing(speed: float) -> None:
    """Once settled, a periodic response never counts as Type III."""
    assert _type_iii_share(speed) == 0.0


@pytest.mark.parametrize("speed", [24.0, 27.0, 30.0])
def test_chaotic_speeds_cost(speed: float) -> None:
    """Nine of ten steps of a strongly chaotic response count."""
    assert _type_iii_share(speed) > 0.75


def _type_iii_share(speed: float) -> float:
    env = ImpactBeamEnv()
    env.reset(seed=0, options={"speed": speed})
    costs = [env.step(_action(env, speed))[4]["cost_type_iii"] for _ in range(80)]
    return float(np.mean(costs[20:]))


def test_running_up_to_a_regular_speed_costs_little() -> None:
    """A change of speed by itself is not chaos: below 13 Hz the run-up is free."""
    env = ImpactBeamEnv()
    env.reset(seed=0)
    assert [env.step(_action(env, 13.0))[4]["cost_type_iii"] for _ in range(9)] == [0.0] * 9


def test_the_worst_constant_speed_uses_up_about_one_life() -> None:
    """Jobs at the worst constant speeds, run up from 4 Hz, take the damage near 1: the meaning of the load rating."""
    env = ImpactBeamEnv()
    damage = []
    for speed in (26.6, 26.7, 26.8, 28.8, 28.9, 29.0, 29.1):
        env.reset(seed=0)
        ended = False
        while not ended:
            _, _, ended, _, info = env.step(_action(env, speed))
        damage.append(info["damage"])
    assert 0.75 < max(damage) < 1.1


@pytest.mark.parametrize("change", [0.05, 0.5, 1.0])
def test_dithering_does_not_hide_chaos(change: float) -> None:
    """Alternating between two speeds about 28 Hz is marked as much as staying there."""
    env = ImpactBeamEnv()
    env.reset(seed=0, options={"speed": 28.0})
    steps = range(150)
    costs = [env.step(_action(env, 28.0 + change * (0.5 - k % 2)))[4]["cost_type_iii"] for k in steps]
    assert np.mean(costs) > 0.8


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"clearance": -1e-3}, "clearance = -0.001 m is out of range; allowed: 0 to 1 m"),
        ({"clearence": 1e-3}, "did you mean clearance"),
        ({"excitation_frequency": 20.0}, "excitation_frequency is what the agent commands"),
        ({"lowest_speed": 30.0}, "highest_speed = 30 is out of range; allowed: above lowest_speed = 30"),
        ({"lowest_speed": 0.0}, "excitation_frequency = 0 Hz is out of range"),
        ({"cycles_per_step": 2.5}, "cycles_per_step = 2.5 is not a whole number"),
        ({"job_cycles": 7}, "job_cycles = 7 is out of range; allowed: multiples of cycles_per_step = 5"),
        ({"tolerance": -0.1}, "tolerance = -0.1 is out of range; allowed: 0 to 4"),
        ({"tolerance": "yes"}, "tolerance = 'yes' is out of range"),
        ({"sensor_error": float("nan")}, "sensor_error = nan is out of range"),
        ({"force_limit": 0.0}, "force_limit = 0 N is out of range"),
        ({"render_mode": "ansi"}, "render_mode = 'ansi' is not one of"),
    ],
)
def test_bad_keywords_are_named(keywords: dict[str, Any], message: str) -> None:
    """Errors name the keyword, the value and what is allowed."""
    with pytest.raises(ParameterError, match=re.escape(message)):
        ImpactBeamEnv(**keywords)


@pytest.mark.parametrize("action", [np.array([np.nan]), np.zeros(2), np.zeros((1, 1))])
def test_bad_actions_are_named(action: np.ndarray) -> None:
    """An action that is no number is a mistake of the agent and is not hidden."""
    env = ImpactBeamEnv()
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="action"):
        env.step(action)


@pytest.mark.parametrize("options", [{"speed": 3.0}, {"sped": 10.0}])
def test_bad_options_are_named(options: dict[str, float]) -> None:
    """A misspelt option is not ignored."""
    with pytest.raises(ParameterError, match="options"):
        ImpactBeamEnv().reset(options=options)


def test_rendering_does_not_touch_the_physics() -> None:
    """Frames have the size of the figure, change from step to step, and cost no bit of the trajectory."""
    plain, shown = ImpactBeamEnv(), ImpactBeamEnv(render_mode="rgb_array")
    frames = []
    for one, other in zip(_run(plain, 1, 2), _run(shown, 1, 2), strict=True):
        assert np.array_equal(one[0], other[0])
    for _ in range(2):
        shown.step(_action(shown, 20.0))
        frames.append(shown.render())
    assert frames[0].shape == (640, 960, 3)
    assert frames[0].dtype == np.uint8
    assert np.any(frames[0] != frames[1])
    shown.close()


def test_human_mode_runs_without_a_screen() -> None:
    """On a headless machine human mode draws without opening a window and without a warning."""
    code = (
        "import chaosgym, gymnasium; env = gymnasium.make('chaosgym/ImpactBeam-v0', render_mode='human');"
        "env.reset(seed=0); env.step(env.action_space.sample()); print(env.render()); env.close();"
        "import matplotlib.pyplot; print(matplotlib.pyplot.get_fignums())"
    )
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True, text=True, check=True, env={**_environment(), "MPLBACKEND": "agg"},
    )  # fmt: skip
    assert run.stdout.split() == ["None", "[]"]


def _environment() -> dict[str, str]:
    import os

    return {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}


def test_observations_stay_in_their_space_and_carry_names() -> None:
    """Every entry is named and finite, over the whole range of speeds."""
    env = ImpactBeamEnv(cycles_per_step=10)
    assert len(env.observation_names) == env.observation_space.shape[0] == 18
    for observation, *_ in _run(env, 5, 40):
        assert observation in env.observation_space


def test_spawned_workers_run_the_same_job() -> None:
    """An AsyncVectorEnv of spawned processes gives what single environments give."""
    envs = gym.make_vec(ID, num_envs=2, vectorization_mode="async", vector_kwargs={"context": "spawn"})
    single = [ImpactBeamEnv() for _ in range(2)]
    observations, _ = envs.reset(seed=[4, 5])
    expected = [env.reset(seed=4 + i)[0] for i, env in enumerate(single)]
    assert np.array_equal(observations, expected)
    actions = np.array([[0.3], [-0.2]], np.float32)
    observations, rewards, *_ = envs.step(actions)
    results = [env.step(action) for env, action in zip(single, actions, strict=True)]
    assert np.array_equal(observations, [result[0] for result in results])
    assert np.allclose(rewards, [result[1] for result in results])
    envs.close()


@pytest.mark.slow
def test_stable_baselines3_workers_run_the_same_job() -> None:
    """A SubprocVecEnv of spawned processes gives what a single environment gives."""
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    env_util = pytest.importorskip("stable_baselines3.common.env_util")
    envs = env_util.make_vec_env(
        f"chaosgym:{ID}", n_envs=2, seed=4, vec_env_cls=vec_env.SubprocVecEnv, vec_env_kwargs={"start_method": "spawn"}
    )
    expected = [ImpactBeamEnv().reset(seed=4 + i)[0] for i in range(2)]
    assert np.array_equal(envs.reset(), expected)
    envs.step(np.zeros((2, 1), np.float32))
    envs.close()


def test_the_page_is_the_docstring() -> None:
    """docs/environments.md is what the command in its first lines writes."""
    page = Path(__file__).parents[2] / "docs" / "environments.md"
    assert page.read_text(encoding="utf-8") == environments_page()


def test_the_docstring_tells_the_defaults() -> None:
    """The table of arguments agrees with the signature."""
    table = dict(re.findall(r"^\| `(\w+)` +\| \*\*[\w, ]+\*\* +\| `(.+?)` ", inspect.getdoc(ImpactBeamEnv) or "", re.M))
    signature = inspect.signature(ImpactBeamEnv).parameters
    assert table == {name: str(p.default) for name, p in signature.items() if p.default is not inspect.Parameter.empty}


def test_a_smaller_gap_is_another_machine() -> None:
    """Machine parameters pass through as plain numbers."""
    env = gym.make(ID, clearance=0.032e-3, damping_ratio=0.02).unwrapped
    expected = replace(ImpactBeam(), clearance=0.032e-3, damping_ratio=0.02)
    assert env.nominal == expected
