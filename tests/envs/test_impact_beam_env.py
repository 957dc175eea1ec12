"""The impact beam environment: what its rewards and costs say about the beam."""

from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.envs.impact_beam import ImpactBeamEnv
from chaosgym.envs.tasks import Status
from chaosgym.errors import ParameterError
from chaosgym.machines.impact_beam import ImpactBeam

ID = "chaosgym/ImpactBeam-v0"


def _action(env: ImpactBeamEnv, speed: float) -> np.ndarray:
    return np.array([env.drive.action_for(speed)], np.float32)


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


@pytest.mark.parametrize("change", [0.05, 0.5, 1.0])
def test_dithering_does_not_hide_chaos(change: float) -> None:
    """Alternating between two speeds about 28 Hz is marked as much as staying there."""
    env = ImpactBeamEnv()
    env.reset(seed=0, options={"speed": 28.0})
    steps = range(150)
    costs = [env.step(_action(env, 28.0 + change * (0.5 - k % 2)))[4]["cost_type_iii"] for k in steps]
    assert np.mean(costs) > 0.8


def test_a_smaller_gap_is_another_machine() -> None:
    """Machine parameters pass through as plain numbers."""
    env = gym.make(ID, clearance=0.032e-3, damping_ratio=0.02).unwrapped
    expected = replace(ImpactBeam(), clearance=0.032e-3, damping_ratio=0.02)
    assert env.nominal == expected


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"clearance": -1e-3}, "clearance = -0.001 m is out of range; allowed: 0 to 1 m"),
        ({"lowest_speed": 0.0}, "excitation_frequency = 0 Hz is out of range"),
    ],
)
def test_bad_parameters_are_named(keywords: dict[str, float], message: str) -> None:
    """The machine's own errors come through, with the unit."""
    with pytest.raises(ParameterError, match=message):
        ImpactBeamEnv(**keywords)
