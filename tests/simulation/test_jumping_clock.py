"""A clock that is set while the program runs, back or forth, changes no result."""

import random
import time
from itertools import accumulate

import gymnasium as gym
import numpy as np
import pytest
import tqdm.std

import chaosgym
from chaosgym.sweeps import Axis, SweepPlan, read_sweep, run_sweep

PLAN = SweepPlan(chaosgym.ImpactBeam(), (Axis("excitation_frequency", 15.0, 25.0, 3),), budget=100)


@pytest.fixture
def clock(monkeypatch):
    """Clocks that jump by up to a day at each look, and how often they were looked at."""
    draw, looks = random.Random(0), []
    readings = accumulate(iter(lambda: draw.choice((0.0, 1e-9, 1.0, -1.0, 86_400.0, -86_400.0)), None), initial=1e9)

    def look():
        looks.append(next(readings))
        return looks[-1]

    def jump():
        for name in ("time", "perf_counter", "monotonic"):
            monkeypatch.setattr(time, name, look)
        monkeypatch.setattr(tqdm.std, "time", look)
        return looks

    return jump


def test_a_run_is_the_same_by_any_clock(clock):
    """Slices of a run, which aim at a duration, and its bar: every number of the record."""
    calm = chaosgym.simulate(chaosgym.ImpactBeam(), 500)
    looks = clock()
    record = chaosgym.simulate(chaosgym.ImpactBeam(), 500, progress=True)
    assert len(looks) > 10
    assert min(np.diff(looks)) < -80_000.0
    for name in ("section", "peak_force", "impacts", "contact_fraction"):
        np.testing.assert_array_equal(getattr(record, name), getattr(calm, name))


def test_a_sweep_is_the_same_by_any_clock(clock, tmp_path):
    """Every row, with a bar; the folder is held and let go."""
    run_sweep(PLAN, tmp_path / "calm", workers=1)
    looks = clock()
    run_sweep(PLAN, tmp_path / "jumping", workers=1, progress=True)
    assert len(looks) > 10
    calm, jumping = (read_sweep(tmp_path / name) for name in ("calm", "jumping"))
    assert jumping.table.equals(calm.table)


def test_a_batch_of_machines_is_the_same_by_any_clock(clock):
    """Calls of a kernel over machines side by side, which aim at a duration as well."""

    def rewards():
        envs = gym.make_vec("chaosgym/ImpactBeamTolerance-v1", num_envs=3)
        envs.reset(seed=3)
        return [envs.step(np.array([action, 5, 0]))[:2] for action in (5, 0, 3)]

    calm = rewards()
    assert clock() == []
    jumping = rewards()
    for one, other in zip(calm, jumping, strict=True):
        for expected, value in zip(one, other, strict=True):
            np.testing.assert_array_equal(value, expected)
