"""Controllers finish their jobs, look only at what they say, and do what their names promise."""

import gymnasium as gym
import numpy as np
import pytest

import chaosgym  # noqa: F401  (registers the environments)
from chaosgym.control.controllers import (
    ClairvoyantHorizon,
    ConstantSpeed,
    DynamicProgramming,
    GreedyClassifier,
    NominalProgramming,
    RecedingHorizon,
    SafeConstant,
)
from chaosgym.control.controllers.ladder import LADDER, each_cycle_keywords
from chaosgym.control.forecast import constant_returns, training_forecasts
from chaosgym.control.jobs import run_job
from chaosgym.errors import ParameterError


@pytest.fixture(scope="module")
def env():
    """Held-out beams and a short job."""
    return gym.make("chaosgym/ImpactBeamTolerance-v0", pool="held-out", job_cycles=150)


def _actions(env, controller, machine, steps, seed=5):
    observation, _ = env.reset(seed=seed, options={"machine": machine})
    controller.reset()
    taken = []
    for _ in range(steps):
        taken.append(controller(observation))
        observation = env.step(taken[-1])[0]
    return np.array(taken)


@pytest.mark.parametrize("name", LADDER)
def test_every_rung_runs_a_job_to_its_end_with_valid_actions(env, name):
    """Each controller of the ladder drives a machine through a job within the action space."""
    rung = LADDER[name]
    own = env
    if rung.each_cycle:
        own = gym.make("chaosgym/ImpactBeamTolerance-v0", pool="held-out", job_cycles=60, **each_cycle_keywords(env))
    controller = rung.make(own)
    assert controller.knows == rung.knows

    class Checked:
        def reset(self):
            controller.reset()

        def __call__(self, observation):
            action = controller(observation)
            assert own.action_space.contains(action)
            return action

    row = run_job(own, Checked(), 1, 3)
    assert row.cycles == own.unwrapped.task.job_cycles
    assert not row.failed


@pytest.mark.parametrize("kind", [NominalProgramming, RecedingHorizon])
def test_a_nominal_planner_can_not_tell_machines_apart(env, kind):
    """What it plans on is the nominal machine: its actions are the same on any other."""
    controller = kind(env)
    assert np.array_equal(_actions(env, controller, 0, 15), _actions(env, controller, 4, 15, seed=8))


def test_the_copy_of_the_clairvoyant_search_moves_as_the_machine_does(env):
    """After some steps the copy has worn exactly as much as the machine, to the last bit; the nominal one has not."""
    for kind, same in ((ClairvoyantHorizon, True), (RecedingHorizon, False)):
        controller = kind(env, horizon=2)
        observation, _ = env.reset(seed=1, options={"machine": 2})
        controller.reset()
        for _ in range(20):
            observation = env.step(controller(observation))[0]
        controller(observation)
        assert (controller._damage.max() == env.unwrapped.damage) == same


def test_the_copy_wears_as_the_machine_does():
    """With a clearance that grows the copy still moves as the machine, to the last bit."""
    env = gym.make("chaosgym/ImpactBeamWear-v0", pool="held-out", lowest_speed=17.0, highest_speed=19.0)
    controller = ClairvoyantHorizon(env, horizon=2, every=20)
    observation, _ = env.reset(seed=1, options={"machine": 0})
    controller.reset()
    for _ in range(60):
        observation = env.step(controller(observation))[0]
    controller(observation)
    assert controller._damage.max() == env.unwrapped.damage > 0.0


def test_the_safe_constant_is_the_best_mean_over_the_training_pool(env):
    """No other speed of the table has a better mean return by the tables of the training machines."""
    safe = SafeConstant(env)
    forecasts = training_forecasts(env.unwrapped)
    mean = np.mean([constant_returns(forecast, 0) for forecast in forecasts], axis=0)
    assert len(forecasts) == 128
    assert mean[forecasts[0].place_of(safe.speed)] == mean.max()


def test_the_reference_beats_the_extreme_constants(env):
    """Dynamic programming on the machine's own table returns more than the lowest and the highest speed do."""
    best = run_job(env, DynamicProgramming(env), 3, 0).job_return
    for speed in (4.0, 30.0):
        assert best > run_job(env, ConstantSpeed(env, speed), 3, 0).job_return


def test_greedy_avoids_what_the_record_says_is_irregular(env):
    """A speed whose measured peaks scatter gets a high chance of being irregular, one whose peaks repeat a low one."""
    controller = GreedyClassifier(env)
    env.reset(seed=0, options={"machine": 0})
    controller.reset()
    generator = np.random.default_rng(0)
    for _ in range(4):
        controller._note(70, 50.0 + generator.uniform(-25.0, 25.0, 5))
    for _ in range(4):
        controller._note(20, np.full(5, 40.0))
    assert controller._chance[70] > 0.5 > controller._chance[20]


def test_controllers_that_act_each_cycle_refuse_longer_steps(env):
    """OGY and delayed feedback say which environment they need."""
    for name in ("OGY", "delayed feedback"):
        with pytest.raises(ParameterError, match="cycles_per_step=1"):
            LADDER[name].make(env)


def test_a_vector_environment_is_refused():
    """A controller drives one machine."""
    envs = gym.make_vec("chaosgym/ImpactBeam-v0", num_envs=2)
    with pytest.raises(ParameterError, match="one machine"):
        LADDER["lowest"].make(envs)


@pytest.mark.parametrize("speed", [3.9, 30.1, float("nan")])
def test_a_constant_speed_beyond_the_drive_is_refused(env, speed):
    """The message names the range."""
    with pytest.raises(ParameterError, match="4 to 30"):
        ConstantSpeed(env, speed)
