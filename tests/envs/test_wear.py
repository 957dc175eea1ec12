"""Wear: the clearance grows with the damage, and the table in force with it."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.machine_env import MachineEnv
from chaosgym.envs.pools import worn
from chaosgym.simulation import simulate
from chaosgym.simulation.batch import at_speed, batch_of

RANGES = {"chaosgym/ImpactBeamWear-v0": (29.5, 30.0), "chaosgym/SliderCrankWear-v0": (290.0, 300.0)}
"""Range of the drive in which the tables of the nominal machine are soon known."""


def _env(name: str, **keywords: object) -> MachineEnv:
    low, high = RANGES[name]
    env = gym.make(name, pool="nominal", lowest_speed=low, highest_speed=high, **keywords).unwrapped
    assert isinstance(env, MachineEnv)
    return env


@pytest.mark.parametrize("name", [name for name in ENVIRONMENTS if "Wear" in name])
def test_clearance_is_the_new_one_times_one_plus_damage(name: str) -> None:
    """A step runs with the damage at its start; the agent sees the damage at its end, and the table goes along."""
    env = _env(name)
    object.__setattr__(env.task, "damage_acceleration", 2e4)
    field = env.nominal.clearance_field
    new = getattr(env.nominal, field)
    _, info = env.reset(seed=0)
    levels = set()
    while info["damage"] < 0.9:
        before = info["damage"]
        observation, *_, info = env.step(np.ones(1, np.float32))
        assert getattr(env.machine, field) == pytest.approx(new * (1.0 + before), rel=1e-12)
        assert observation[env.observation_names.index("damage")] == pytest.approx(min(info["damage"], 1.0))
        nearest = round(5.0 * min(info["damage"], 1.0))
        assert env.regimes is env.pool.regimes(0)[nearest]
        levels.add(nearest)
    assert len(levels) > 3


@pytest.mark.parametrize("name", RANGES)
def test_the_motion_of_a_fleet_goes_on_when_a_machine_changes(name: str) -> None:
    """Another clearance in place of the old one changes no coordinate: the next cycle is that of ``simulate``."""
    machine = at_speed(_env(name).nominal, RANGES[name][0])
    batch = batch_of(machine, 1)
    batch.start(0, machine)
    batch.run(np.zeros(1, np.int64), 5)
    batch.change(0, worn(machine, 1.3))
    after = batch.run(np.zeros(1, np.int64), 3)
    record = simulate(worn(machine, 1.3), 3, simulate(machine, 5).final_state)
    assert np.array_equal(after.peak_force[0], record.peak_force)
