"""Pools of machines: fixed, disjoint, within tolerances, and with the tables of their own machines."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.diagnosis.diagnose import diagnosed_run
from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.pools import Pool, shipped, worn
from chaosgym.envs.regimes import HORIZON
from chaosgym.simulation.batch import at_speed

POOLS = [name for name in ENVIRONMENTS if "Tolerance" in name or "Wear" in name]


def _pool(name: str, pool: str) -> Pool:
    return gym.make(name, pool=pool).unwrapped.pool


@pytest.mark.parametrize("name", POOLS)
def test_machines_lie_within_the_tolerances_and_no_pool_holds_one_of_another(name: str) -> None:
    """Every machine differs from every other one, by up to the tolerances in each field."""
    training, held_out = _pool(name, "training"), _pool(name, "held-out")
    machines = [*(training[k] for k in range(len(training))), *(held_out[k] for k in range(len(held_out)))]
    assert (len(training), len(held_out)) == ((128, 32) if "Tolerance" in name else (32, 16))
    assert len(set(machines)) == len(machines)
    varied = [field for field in training.tolerances if getattr(training.nominal, field) > 0.0]
    shares = np.array(
        [[getattr(m, field) / getattr(training.nominal, field) - 1.0 for field in varied] for m in machines]
    )
    shares /= [training.tolerances[field] for field in varied]
    assert np.all(np.abs(shares) <= 1.0 + 1e-9)
    assert np.all(shares.std(axis=0) > 0.4)


@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_tables_are_shipped(name: str) -> None:
    """Tables of every environment as it is made by its id come with the package, and load without a pickle."""
    pool = gym.make(name).unwrapped.pool
    file = shipped(pool.nominal.name, pool.task)
    assert file is not None
    assert np.array_equal(pool.speeds, file.speeds)
    assert file.nature.shape[1:] == (len(pool.levels), len(file.speeds))
    assert len(file.nature) == len(pool.factors)


@pytest.mark.parametrize("name", POOLS)
def test_the_shipped_tables_are_those_of_the_machines(name: str) -> None:
    """A few entries computed again agree in nature, and in force where the response is periodic."""
    pool = _pool(name, "held-out")
    generator = np.random.default_rng(3)
    agreed = 0
    for k in generator.integers(len(pool), size=6).tolist():
        level, place = int(generator.integers(len(pool.levels))), int(generator.integers(len(pool.speeds)))
        machine = at_speed(worn(pool[k], float(pool.levels[level])), float(pool.speeds[place]))
        verdict, record = diagnosed_run(machine, budget=HORIZON)
        table = pool.regimes(k)[level]
        agreed += (verdict.nature == "periodic") == table.periodic[place]
        if verdict.nature == "periodic" and table.periodic[place]:
            assert record.peak_force[len(record) // 2 :].max() == pytest.approx(table.peak_force[place], rel=1e-3)
    assert agreed >= 5


def test_a_job_takes_the_machine_that_it_is_told() -> None:
    """``options["machine"]`` and ``info["machine"]`` are the number in the pool; without it seeds draw all over it."""
    env = gym.make("chaosgym/ImpactBeamTolerance-v0", pool="held-out").unwrapped
    info = env.reset(seed=0, options={"machine": 7})[1]
    assert info["machine"] == 7
    assert env.machine.clearance == env.pool[7].clearance
    assert np.array_equal(env.regimes.nature, env.pool.regimes(7)[0].nature)
    assert env.step(env.action_space.sample())[4]["machine"] == 7
    drawn = {env.reset(seed=seed)[1]["machine"] for seed in range(60)}
    assert len(drawn) > 20


def test_another_nominal_machine_gets_its_own_tables() -> None:
    """Where a field is changed the shipped tables do not hold, and those of the changed machine are computed."""
    env = gym.make("chaosgym/ImpactBeam-v0", clearance=0.1e-3, lowest_speed=29.5).unwrapped
    env.reset(seed=0)
    assert env.regimes.speeds.tolist() == [29.5, 29.75, 30.0]
    assert env.regimes is env.nominal_regimes


@pytest.mark.parametrize("name", [name for name in ENVIRONMENTS if name not in POOLS])
def test_the_worst_constant_speed_uses_up_one_life(name: str) -> None:
    """A job at the speed with the largest equivalent force of the nominal machine takes the damage to 1."""
    env = gym.make(name).unwrapped
    job = np.full((env.task.job_cycles, 1), env.nominal_regimes.equivalent_force.max())
    assert env.task.damage(job) == pytest.approx(1.0, abs=0.01)
