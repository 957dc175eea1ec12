"""A machine is told from all others within the tolerances by what it does in its first steps."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.controllers.identified_programming import IdentifiedProgramming
from chaosgym.envs.belief import SpeedBelief
from chaosgym.envs.identification import ATTEMPTS, EQUAL, SEARCHED, Identification
from chaosgym.envs.learning import IdentifiedMemory

UP = np.array([1.0], np.float32)


@pytest.fixture(scope="module")
def env():
    """Training machines."""
    return gym.make("chaosgym/ImpactBeamTolerance-v0", pool="training").unwrapped


def _started(env, machine, steps):
    """First observations of a job at full acceleration, (1 + steps, d)."""
    observations = [env.reset(seed=machine, options={"machine": machine})[0]]
    return np.array(observations + [env.step(UP)[0] for _ in range(steps)])


def _deviation(env, machine):
    """Deviation of the fields of a machine, in tolerances."""
    return (env.pool.drawn[machine] - 1.0) / np.array(list(env.pool.tolerances.values()))


def test_a_beam_is_found_to_millionths_of_its_tolerances(env):
    """Nine observations are enough to know clearance, damping and length."""
    for machine in (0, 1):
        identification = Identification(env.pool, env.task)
        for observation in _started(env, machine, ATTEMPTS[0] - 1):
            assert identification.machines == []
            identification.add(observation)
        assert np.abs(identification.estimate - _deviation(env, machine)).max() < 2e-5
        found = identification.machines[0]
        assert found.clearance == pytest.approx(env.machine.clearance, rel=1e-6)
        assert len(set(identification.machines)) == len(identification.machines) > 1


def test_only_the_machine_itself_repeats_the_record(env):
    """The true parameters repeat every share to the last places of an observation; others within the tolerances not."""
    identification = Identification(env.pool, env.task)
    for observation in _started(env, 5, SEARCHED):
        identification.add(observation)
    others = np.random.default_rng(0).uniform(-1.0, 1.0, (16, 3))
    errors = np.abs(identification._errors(np.vstack([_deviation(env, 5), others])))
    assert errors[0].max() < EQUAL < errors[1:].max(axis=1).min()


def test_no_machine_is_named_that_does_not_repeat_the_record(env, monkeypatch):
    """Shares that a sensor with errors would give fit none."""
    monkeypatch.setattr("chaosgym.envs.identification.ITERATIONS", 4)
    identification = Identification(env.pool, env.task)
    for observation in _started(env, 7, ATTEMPTS[0] - 1):
        observation[7] += np.random.default_rng(0).normal(0.0, 0.01)
        identification.add(observation)
    assert identification.estimate is None


def test_a_wearing_machine_is_found():
    """Clearances that grow with the damage are simulated as the environment lets them grow."""
    env = gym.make("chaosgym/ImpactBeamWear-v0", pool="training").unwrapped
    identification = Identification(env.pool, env.task)
    for observation in _started(env, 2, ATTEMPTS[0] - 1):
        identification.add(observation)
    assert np.abs(identification.estimate - _deviation(env, 2)).max() < 2e-5


def test_what_is_known_of_a_machine_replaces_what_is_believed(env):
    """From then on the map of a job is that of the machine, and the other jobs are as before."""
    belief, table = SpeedBelief(env.pool, env.task), env.pool.regimes(17)
    first = np.tile(_started(env, 17, 0), (2, 1))
    before = belief.start(first)
    belief.know_tables(0, table)
    after = belief.add(first)
    far = np.abs(table[0].speeds - env.drive.lowest_speed) > 1.0
    assert np.array_equal((after.irregular[0] > 0.5)[far], table[0].type_iii[far])
    assert after.doubt[0] == 0.0 < before.doubt[1]
    assert np.mean((after.irregular[1] > 0.5)[far] == table[0].type_iii[far]) < 0.95


def test_in_training_the_machine_is_known_after_as_many_observations(env):
    """The learner's view is told of the training machine when an identification would have found it."""
    memory = IdentifiedMemory(env.observation_space, env.pool, env.task)
    observations = _started(env, 4, ATTEMPTS[0])
    told = [memory.start(observations[:1], np.array([4]))]
    told += [memory.add(observation[None]) for observation in observations[1:]]
    doubt = [float(each[0, -1]) for each in told]
    assert min(doubt[: ATTEMPTS[0] - 1]) > 0.0
    assert doubt[ATTEMPTS[0] - 1 :] == [0.0, 0.0]
    again = memory.restart(np.array([True]), observations[:1], np.array([4]))
    assert again[0, -1] > 0.0


@pytest.mark.slow
def test_most_beams_are_found_at_the_first_attempt(env):
    """Of 16 training machines at least 13 are known after nine observations."""
    found = 0
    for machine in range(16, 32):
        identification = Identification(env.pool, env.task)
        for observation in _started(env, machine, ATTEMPTS[0] - 1):
            identification.add(observation)
        found += bool(identification.machines)
    assert found >= 13


@pytest.mark.slow
def test_who_identifies_the_machine_beats_who_does_not():
    """The plan with the found machine's own tables earns nearly what the true tables earn."""
    from chaosgym.controllers.belief_programming import BeliefProgramming
    from chaosgym.controllers.dynamic_programming import DynamicProgramming
    from chaosgym.evaluation.jobs import run_jobs

    env = gym.make("chaosgym/ImpactBeamTolerance-v0", pool="training")
    returns = [
        np.mean([job.job_return for job in run_jobs(env, make, [1, 2, 3], 0)])
        for make in (BeliefProgramming, IdentifiedProgramming, DynamicProgramming)
    ]
    assert returns[0] + 0.1 < returns[1] < returns[2] + 0.1
