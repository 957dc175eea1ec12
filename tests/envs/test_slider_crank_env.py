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

NARROW = {"lowest_speed": 190.0, "highest_speed": 200.0}
"""Range of a drive in which the regimes of an unusual crank are soon known."""


def _action(env: SliderCrankEnv, speed: float) -> np.ndarray:
    return np.array([env.drive.action_for(speed)], np.float32)


def test_the_machine_is_that_of_the_thesis_but_for_clearance_and_contact_damping() -> None:
    """Plain numbers pass through; what the environment changes are its own arguments."""
    env = gym.make(ID, rod_diameter=3.175e-3, friction_coefficient=0.1).unwrapped
    assert env.nominal == replace(
        THESIS_SLIDER_CRANK,
        slider_clearance=0.254e-3,
        contact_damping_ratio=0.13,
        matrix_update_interval=5.0,
        rod_diameter=3.175e-3,
        friction_coefficient=0.1,
    )


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
    env = SliderCrankEnv(render_mode="rgb_array", **NARROW, **keywords)
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
    check_env(gym.make(ID, **NARROW, **keywords).unwrapped, skip_render_check=True)
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    checker.check_env(gym.make(ID, **NARROW, **keywords), warn=True)


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
