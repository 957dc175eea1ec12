"""The slider crank environment: what its rewards and costs say about the mechanism."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from chaosgym.envs.slider_crank import SliderCrankEnv
from chaosgym.errors import ParameterError
from chaosgym.machines.slider_crank import THESIS_SLIDER_CRANK

ID = "chaosgym/SliderCrank-v0"


def _action(env: SliderCrankEnv, speed: float) -> np.ndarray:
    return np.array([env.drive.action_for(speed)], np.float32)


def _type_iii_share(env: SliderCrankEnv, speed: float, steps: int) -> float:
    """Share of the steps at constant speed that count, the first 20 left out."""
    env.reset(seed=0, options={"speed": speed})
    costs = [env.step(_action(env, speed))[4]["cost_type_iii"] for _ in range(20 + steps)]
    return float(np.mean(costs[20:]))


def test_the_machine_is_that_of_the_thesis_but_for_contact_damping() -> None:
    """Plain numbers pass through; what the environment changes are two of its own arguments."""
    env = gym.make(ID, rod_diameter=3.175e-3, friction_coefficient=0.1).unwrapped
    assert env.nominal == replace(
        THESIS_SLIDER_CRANK,
        contact_damping_ratio=0.075, matrix_update_interval=5.0, rod_diameter=3.175e-3, friction_coefficient=0.1,
    )  # fmt: skip


def test_speeds_lie_on_the_grid_and_are_remembered() -> None:
    """Random commands visit multiples of 2.5 rpm alone, and a speed that was seen before shares its propagators."""
    env = SliderCrankEnv()
    env.action_space.seed(1)
    env.reset(seed=0)
    tables: dict[float, Any] = {}
    for _ in range(60):
        speed = env.step(env.action_space.sample())[4]["speed"]
        assert speed % 2.5 == 0.0
        table = env.machine.reduce(1.0).propagator
        assert tables.setdefault(speed, table) is table


@pytest.mark.parametrize("speed", [82.5, 160.0, 215.0, 247.5])
def test_periodic_speeds_cost_nothing(speed: float) -> None:
    """In the calm windows between irregular speeds no settled step counts as Type III."""
    assert _type_iii_share(SliderCrankEnv(), speed, 40) == 0.0


@pytest.mark.parametrize("speed", [57.5, 200.0, 222.5])
def test_chaotic_speeds_cost(speed: float) -> None:
    """Most steps of an irregular response count."""
    assert _type_iii_share(SliderCrankEnv(), speed, 60) > 0.45


@pytest.mark.slow
def test_about_half_of_the_speed_range_is_irregular() -> None:
    """From 50 to 300 rpm 20 to 60 % of the steps at constant speed count as Type III, in bands with calm windows."""
    env = SliderCrankEnv()
    shares = np.array([_type_iii_share(env, speed, 30) for speed in np.arange(50.0, 300.1, 5.0)])
    assert 0.2 < shares.mean() < 0.6
    assert np.mean(shares < 0.05) > 0.05


@pytest.mark.parametrize("change", [2.5, 5.0, 10.0])
def test_dithering_does_not_hide_chaos(change: float) -> None:
    """Alternating between two speeds about 150 rpm is marked at least nearly as much as staying there."""
    env = SliderCrankEnv()
    env.reset(seed=0, options={"speed": 150.0})
    costs = [env.step(_action(env, 150.0 - change * (k % 2)))[4]["cost_type_iii"] for k in range(80)]
    assert np.mean(costs) > 0.45


def test_the_force_limit_counts_above_240_rpm() -> None:
    """Peaks grow with speed and pass 120 N near 240 rpm."""
    env = SliderCrankEnv()
    shares = []
    for speed in (225.0, 260.0):
        env.reset(seed=0, options={"speed": speed})
        shares.append(np.mean([env.step(_action(env, speed))[4]["cost_force"] for _ in range(20)]))
    assert shares[0] < 0.1
    assert shares[1] > 0.9


@pytest.mark.parametrize(
    "keywords",
    [
        {"rod": "rigid"},
        {"slider_joint": "instrumented"},
        {"slider_joint": "ideal", "ball_joint": "instrumented", "gravity": 9.81},
        {"ball_joint": "instrumented"},
        {"motor_angle": 25.0},
        pytest.param(
            {"motor_angle": 25.0, "slider_joint": "instrumented", "geometric_stiffness": "on"}, marks=pytest.mark.slow
        ),
    ],
)
def test_every_joint_can_be_operated_and_shown(keywords: dict[str, Any]) -> None:
    """Scenes with other joints, a rigid rod and a turned motor run, with finite observations, and have a picture."""
    env = SliderCrankEnv(render_mode="rgb_array", tolerance=True, **keywords)
    env.reset(seed=0)
    observation, reward, *_ = env.step(np.zeros(1, np.float32))
    assert observation in env.observation_space
    assert np.isfinite(reward)
    assert np.ptp(env.render()) > 0
    env.close()


@pytest.mark.parametrize(
    "keywords",
    [
        {"motor_angle": 25.0},
        pytest.param({"motor_angle": 25.0, "slider_joint": "instrumented"}, marks=pytest.mark.slow),
        pytest.param({"motor_angle": 10.0, "ball_joint": "spherical", "rod": "rigid"}, marks=pytest.mark.slow),
    ],
)
def test_checkers_find_nothing_to_complain_about_in_space(keywords: dict[str, Any]) -> None:
    """check_env of Gymnasium and Stable-Baselines3 pass without a warning with other joints and angles too."""
    check_env(gym.make(ID, **keywords).unwrapped, skip_render_check=True)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(ID, **keywords), warn=True)


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"rod_length": 0.03}, "rod_length = 0.03 m is out of range"),
        ({"motor_angle": 30.0}, "motor_angle = 30 deg is out of range"),
        ({"slider_clearance": 5e-2}, "slider_clearance = 0.05 m is out of range"),
        ({"matrix_update_interval": 7.0}, "matrix_update_interval = 7 deg is out of range"),
        ({"speed_grid": 20.0}, "speed_grid = 20 is out of range"),
    ],
)
def test_bad_parameters_are_named(keywords: dict[str, float], message: str) -> None:
    """The mechanism's own errors come through, with the unit."""
    with pytest.raises(ParameterError, match=message):
        SliderCrankEnv(**keywords)
