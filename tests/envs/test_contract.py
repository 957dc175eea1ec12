"""What every registered environment promises, whatever its machine."""

import inspect
import re
import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import load_env_creator
from gymnasium.utils.env_checker import check_env

from chaosgym.envs import ENVIRONMENTS, machine_env
from chaosgym.envs.machine_env import MachineEnv
from chaosgym.envs.tasks import Status
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.simulation import batch as batch
from chaosgym.simulation import simulate

pytestmark = pytest.mark.parametrize("name", ENVIRONMENTS)

NOMINAL = {"pool": "nominal"}
"""What is promised does not depend on the pool; models and tables of one machine are soon made."""


def _make(name: str, **keywords: Any) -> MachineEnv:
    spec = gym.spec(name)
    assert isinstance(spec.entry_point, str)
    env = load_env_creator(spec.entry_point)(**(spec.kwargs | NOMINAL | keywords))
    assert isinstance(env, MachineEnv)
    return env


def _action(env: MachineEnv, speed: float) -> np.ndarray:
    return np.array([env.drive.action_for(speed)], np.float32)


def _run(env: gym.Env, seed: int, steps: int) -> list[Any]:
    """Observations, rewards and infos of random actions."""
    env.action_space.seed(seed)
    results: list[Any] = [env.reset(seed=seed)]
    for _ in range(steps):
        results.append(env.step(env.action_space.sample()))
    return results


@pytest.mark.parametrize("keywords", [{}, {"cycles_per_step": 1, "sensor_error": 0.0}])
def test_gymnasium_finds_nothing_to_complain_about(
    name: str, keywords: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    """check_env passes without a warning, rendering included."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    check_env(gym.make(name, **(NOMINAL | keywords)).unwrapped)


def test_stable_baselines3_finds_nothing_to_complain_about(name: str) -> None:
    """check_env passes without a warning."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(name, render_mode="rgb_array", **NOMINAL), warn=True, skip_render_check=False)


def test_same_seed_same_bytes(name: str) -> None:
    """Whole trajectories repeat, in a new environment as well as after other jobs in the same one."""
    fresh, used = gym.make(name, **NOMINAL), gym.make(name, **NOMINAL)
    _run(used, seed=99, steps=4)
    for one, other in zip(_run(fresh, 7, 12), _run(used, 7, 12), strict=True):
        assert one[0].tobytes() == other[0].tobytes()
        assert one[1:] == other[1:]


def test_the_motion_goes_on_across_changes_of_speed(name: str) -> None:
    """The motion of a step begins in the state in which the last one ended, whatever the speed and the clearance."""
    env = _make(name, sensor_error=0.0)
    env.reset(seed=0)
    low, slew = env.drive.lowest_speed, env.drive.slew_limit
    state = simulate(env.machine, cycles=20).final_state
    for changes in (0, 1, 2, 2, 1):
        observation, _, _, _, info = env.step(_action(env, low + changes * slew))
        assert info["speed"] == pytest.approx(low + changes * slew, abs=1e-5)
        record = simulate(env.machine, 5, state)
        assert np.array_equal(observation[8:13], record.peak_force[:, 0].astype(np.float32))
        state = record.final_state


def test_speed_is_limited_in_range_and_slew(name: str) -> None:
    """The target is mapped linearly to the drive's range, clipped, and approached by at most the slew limit a step."""
    env = _make(name)
    env.reset(seed=0)
    low, high, slew = env.drive.lowest_speed, env.drive.highest_speed, env.drive.slew_limit
    speeds = [env.step(np.array([5.0], np.float32))[4]["speed"] for _ in range(int((high - low) / slew) + 2)]
    assert np.max(np.diff([low, *speeds])) <= slew * (1.0 + 1e-9)
    assert speeds[-1] == high
    for _ in range(int(0.5 * (high - low) / slew) + 1):
        info = env.step(np.zeros(1, np.float32))[4]
    assert info["speed"] == pytest.approx(0.5 * (low + high))


def test_sensor_error_is_bounded_and_does_not_touch_reward(name: str) -> None:
    """The agent sees +-3 N of error; reward and cost use true peak forces."""
    exact, noisy = _make(name, sensor_error=0.0), _make(name)
    differences = []
    for seed in range(3):
        for (true, reward, *_), (measured, same, *_) in zip(
            _run(exact, seed, 8)[1:], _run(noisy, seed, 8)[1:], strict=True
        ):
            differences.append(measured[8:13] - true[8:13])
            assert reward == same
    error = np.concatenate(differences)
    assert 2.0 < np.abs(error).max() <= 3.0 + 1e-4


def test_the_job_ends_when_it_is_done(name: str) -> None:
    """Time, progress and end of a job at half the top speed come out as the definition says."""
    env = _make(name, job_cycles=50)
    half = 0.5 * env.drive.highest_speed
    env.reset(seed=0, options={"speed": half})
    total, ended, steps = 0.0, False, 0
    while not ended:
        observation, _, ended, truncated, info = env.step(_action(env, half))
        total += info["reward_time"]
        steps += 1
        assert not truncated
    assert steps == 10
    assert observation[2] == 0.0
    assert info["status"] == Status.JOB_DONE
    assert info["is_success"]
    assert total == pytest.approx(-2.0)
    with pytest.raises(gym.error.ResetNeeded):
        env.step(_action(env, half))


def test_a_failed_simulation_ends_the_job(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """step() never raises for the physics; status says what happened, and no value is NaN."""
    env = _make(name)
    env.reset(seed=0)

    def fail(*_: Any, **__: Any) -> None:
        raise SimulationError("the motion grew beyond every bound")

    monkeypatch.setattr(batch, "simulate", fail)
    observation, reward, terminated, truncated, info = env.step(np.zeros(1, np.float32))
    assert (terminated, truncated, info["status"]) == (True, False, Status.SIMULATION_FAILED)
    assert observation in env.observation_space
    assert reward == pytest.approx(info["reward_time"] - 10.0)
    assert np.all(np.isfinite(list(info.values())))


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"clearence": 1e-3}, "clearance"),
        ({"lowest_speed": 300.0, "highest_speed": 300.0}, "highest_speed = 300 is out of range; allowed: above"),
        ({"cycles_per_step": 2.5}, "cycles_per_step = 2.5 is not a whole number"),
        ({"job_cycles": 7}, "job_cycles = 7 is out of range; allowed: multiples of cycles_per_step = 5"),
        ({"pool": "test"}, "pool = 'test' is not one of nominal, training, held-out"),
        ({"sensor_error": float("nan")}, "sensor_error = nan is out of range"),
        ({"force_limit": 0.0}, "force_limit = 0 N is out of range"),
        ({"render_mode": "ansi"}, "render_mode = 'ansi' is not one of"),
    ],
)
def test_bad_keywords_are_named(name: str, keywords: dict[str, Any], message: str) -> None:
    """Errors name the keyword, the value and what is allowed."""
    with pytest.raises(ParameterError, match=re.escape(message)):
        _make(name, **keywords)


def test_the_speed_is_not_a_keyword(name: str) -> None:
    """The agent commands it."""
    field = _make(name).nominal.speed_field
    with pytest.raises(ParameterError, match=f"{field} is what the agent commands"):
        _make(name, **{field: 20.0})


@pytest.mark.parametrize("action", [np.array([np.nan]), np.zeros(2), np.zeros((1, 1))])
def test_bad_actions_are_named(name: str, action: np.ndarray) -> None:
    """An action that is no number is a mistake of the agent and is not hidden."""
    env = _make(name)
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="action"):
        env.step(action)


@pytest.mark.parametrize(
    "options", [{"speed": 3.0}, {"sped": 10.0}, {"machine": 128}, {"machine": -1}, {"machine": 0.5}]
)
def test_bad_options_are_named(name: str, options: dict[str, float]) -> None:
    """A misspelt option is not ignored."""
    with pytest.raises(ParameterError, match="options"):
        _make(name).reset(options=options)


def test_rendering_does_not_touch_the_physics(name: str) -> None:
    """Frames have the size of the figure, change from step to step, and cost no bit of the trajectory."""
    plain, shown = _make(name), _make(name, render_mode="rgb_array")
    for one, other in zip(_run(plain, 1, 2), _run(shown, 1, 2), strict=True):
        assert np.array_equal(one[0], other[0])
    frames = []
    for _ in range(2):
        shown.step(np.zeros(1, np.float32))
        frames.append(shown.render())
    assert frames[0].shape == (640, 960, 3)
    assert frames[0].dtype == np.uint8
    assert np.any(frames[0] != frames[1])
    shown.close()


def test_a_render_mode_alone_costs_nothing(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """stable-baselines3's make_vec_env always asks for pictures; the motion is run again only when one is drawn."""
    env = _make(name, render_mode="rgb_array")
    env.reset(seed=0)
    again: list[Any] = []

    def counted(*arguments: Any, **keywords: Any) -> Any:
        again.append(simulate(*arguments, **keywords))
        return again[-1]

    monkeypatch.setattr(machine_env, "simulate", counted)
    env.step(np.zeros(1, np.float32))
    assert again == []
    env.render()
    assert len(again) == env.task.cycles_per_step


def test_human_mode_runs_without_a_screen(name: str) -> None:
    """On a headless machine human mode draws without opening a window and without a warning."""
    code = (
        f"import chaosgym, gymnasium; env = gymnasium.make('{name}', render_mode='human', pool='nominal');"
        "env.reset(seed=0); env.step(env.action_space.sample()); print(env.render()); env.close();"
        "import matplotlib.pyplot; print(matplotlib.pyplot.get_fignums())"
    )
    run = subprocess.run(
        [sys.executable, "-W", "error", "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env={**_environment(), "MPLBACKEND": "agg"},
    )
    assert run.stdout.split() == ["None", "[]"]
    assert run.stderr == ""


def _environment() -> dict[str, str]:
    import os

    return {name: value for name, value in os.environ.items() if name not in ("DISPLAY", "WAYLAND_DISPLAY")}


def test_observations_stay_in_their_space_and_carry_names(name: str) -> None:
    """Every entry is named and finite, over the whole range of speeds."""
    env = _make(name, cycles_per_step=10)
    assert len(env.observation_names) == env.observation_space.shape[0] == 18 + env.pool.wears
    for observation, *_ in _run(env, 5, 20):
        assert observation in env.observation_space


def test_spawned_workers_run_the_same_job(name: str) -> None:
    """An AsyncVectorEnv of spawned processes gives what single environments give."""
    envs = gym.make_vec(name, num_envs=2, vectorization_mode="async", **NOMINAL, vector_kwargs={"context": "spawn"})
    single = [_make(name) for _ in range(2)]
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
def test_stable_baselines3_workers_run_the_same_job(name: str) -> None:
    """A SubprocVecEnv of spawned processes gives what a single environment gives."""
    vec_env = pytest.importorskip("stable_baselines3.common.vec_env")
    env_util = pytest.importorskip("stable_baselines3.common.env_util")
    envs = env_util.make_vec_env(
        f"chaosgym:{name}",
        n_envs=2,
        seed=4,
        vec_env_cls=vec_env.SubprocVecEnv,
        vec_env_kwargs={"start_method": "spawn"},
        env_kwargs=NOMINAL,
    )
    expected = [_make(name).reset(seed=4 + i)[0] for i in range(2)]
    assert np.array_equal(envs.reset(), expected)
    envs.step(np.zeros((2, 1), np.float32))
    envs.close()


def test_the_docstring_tells_the_defaults(name: str) -> None:
    """The table of arguments agrees with the signature."""
    env_class = type(_make(name))
    described = inspect.getdoc(env_class) or ""
    table = dict(re.findall(r"^\| `(\w+)` +\| \*\*[\w, ]+\*\* +\| `(.+?)` ", described, re.M))
    signature = inspect.signature(env_class).parameters
    assert table == {
        argument: str(p.default) for argument, p in signature.items() if p.default is not inspect.Parameter.empty
    }
