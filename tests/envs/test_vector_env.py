"""The native vector environment does what single environments do, bit for bit."""

import pickle
import re
import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Discrete
from gymnasium.vector import AutoresetMode

from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.task import Status
from chaosgym.errors import ParameterError

BEAM, CRANK = "chaosgym/ImpactBeamTolerance-v1", "chaosgym/SliderCrankTolerance-v1"


def _pair(name: str, mode: AutoresetMode, count: int = 3, **keywords: Any) -> tuple[gym.vector.VectorEnv, ...]:
    """The native vector environment, and single ones behind Gymnasium's own."""
    native = gym.make_vec(name, num_envs=count, autoreset_mode=mode, **keywords)
    sync = gym.make_vec(
        name, num_envs=count, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode}, **keywords
    )
    return native, sync


def _assert_equal(one: Any, other: Any) -> None:
    """Same types, same bytes, all the way down."""
    assert type(one) is type(other)
    if isinstance(one, dict):
        assert one.keys() == other.keys()
        for name in one:
            _assert_equal(one[name], other[name])
    elif isinstance(one, tuple):
        for a, b in zip(one, other, strict=True):
            _assert_equal(a, b)
    elif isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        if one.dtype == object:
            for a, b in zip(one, other, strict=True):
                _assert_equal(a, b)
        else:
            assert one.tobytes() == other.tobytes()
    else:
        assert one == other


def _assert_same_episodes(envs: tuple[gym.vector.VectorEnv, ...], steps: int, seed: int = 5) -> int:
    """Run random actions in both; how many episodes ended."""
    drawn = np.random.default_rng(seed)
    if isinstance(envs[0].single_action_space, Discrete):
        actions = drawn.integers(0, 6, (steps, envs[0].num_envs))
    else:
        low, high = envs[0].single_action_space.low, envs[0].single_action_space.high
        actions = drawn.uniform(low, high, (steps, envs[0].num_envs, len(low))).astype(np.float32)
    _assert_equal(*(env.reset(seed=seed) for env in envs))
    ended = 0
    for action in actions:
        results = [env.step(action) for env in envs]
        _assert_equal(*results)
        over = results[0][2] | results[0][3]
        ended += int(over.sum())
        if envs[0].autoreset_mode is AutoresetMode.DISABLED and over.any():
            _assert_equal(*(env.reset(options={"reset_mask": over.copy()}) for env in envs))
    return ended


@pytest.mark.parametrize("mode", AutoresetMode)
@pytest.mark.parametrize("name", [BEAM, CRANK, "chaosgym/ImpactBeamWear-v1"])
def test_steps_equal_those_of_single_environments(name: str, mode: AutoresetMode) -> None:
    """Observations, rewards, ends and infos agree to the last bit, over the ends of jobs and their new machines."""
    envs = _pair(name, mode, steps=4)
    assert _assert_same_episodes(envs, 9) >= 5


@pytest.mark.parametrize("action", ["continuous", "speed"])
def test_every_kind_of_action(action: str) -> None:
    """Continuous trims and speeds run side by side too."""
    envs = _pair(BEAM, AutoresetMode.SAME_STEP, steps=4, action=action)
    assert _assert_same_episodes(envs, 9) == 6


def test_jobs_that_end_apart_start_anew_by_themselves() -> None:
    """Fracture ends some jobs earlier than others; the limit of steps truncates the rest."""
    envs = _pair(BEAM, AutoresetMode.NEXT_STEP, count=4, reference_force=20.0, max_episode_steps=6)
    assert _assert_same_episodes(envs, 16, seed=2) >= 6


@pytest.mark.parametrize("cycles", [1, 3, 25])
def test_any_number_of_cycles_in_a_step(cycles: int) -> None:
    """Sums run in the same order, whatever the shape of the arrays."""
    envs = _pair(BEAM, AutoresetMode.SAME_STEP, cycles_per_step=cycles, steps=4)
    assert _assert_same_episodes(envs, 9) == 6


@pytest.mark.parametrize(
    ("name", "keywords"),
    [
        (BEAM, {"n_modes": 1, "fitted_modes": 0}),
        (CRANK, {"contact_law": "hertz", "rod": "rigid", "matrix_update_interval": 15.0}),
        (CRANK, {"ball_joint": "instrumented", "rod": "rigid", "matrix_update_interval": 15.0}),
    ],
)
def test_every_kind_of_kernel(name: str, keywords: dict[str, Any]) -> None:
    """Machines that need other kernels run side by side too."""
    envs = _pair(name, AutoresetMode.NEXT_STEP, count=2, steps=2, **keywords)
    assert _assert_same_episodes(envs, 4) >= 2


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_whole_jobs_equal_those_of_single_environments(name: str) -> None:
    """Jobs of 120 steps, to the last bit."""
    assert _assert_same_episodes(_pair(name, AutoresetMode.SAME_STEP, count=4), 241) == 8


def test_each_sub_environment_has_a_generator_of_its_own() -> None:
    """What one does changes no random number of another; without seeds generators go on."""
    one, other = (gym.make_vec(BEAM, num_envs=count, autoreset_mode="SameStep") for count in (2, 3))
    first, second = one.reset(seed=[8, 9])[0], other.reset(seed=[7, 9, 8])[0]
    assert np.array_equal(first, second[[2, 1]])
    assert not np.array_equal(one.reset()[0], first)


def test_a_failed_simulation_ends_its_job_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others go on; the failed one reports what happened and holds no NaN."""
    envs: Any = gym.make_vec(BEAM, num_envs=3)
    envs.reset(seed=0)
    run = envs.unwrapped.jobs._run

    def fail_second(*arguments: Any) -> Any:
        cycles, growth, period = run(*arguments)
        cycles.failed[1] = True
        for values in (*cycles[1:], growth):
            values[1] = 0
        return cycles, growth, period

    monkeypatch.setattr(envs.unwrapped.jobs, "_run", fail_second)
    observation, reward, terminated, truncated, infos = envs.step(np.zeros(3, int))
    assert terminated.tolist() == [False, True, False]
    assert infos["status"].tolist() == [Status.RUNNING, Status.SIMULATION_FAILED, Status.RUNNING]
    assert infos["reward_failure"].tolist() == [0.0, -240.0, 0.0]
    assert not truncated.any()
    assert observation in envs.observation_space
    assert np.all(np.isfinite(reward))


def test_results_belong_to_the_caller() -> None:
    """Writing into what a step returned changes nothing."""
    envs = [gym.make_vec(BEAM, num_envs=2) for _ in range(2)]
    for env in envs:
        observation, infos = env.reset(seed=1)
        if env is envs[0]:
            observation[:] = -1.0
            for values in infos.values():
                values[:] = 0
    action = np.zeros(2, int)
    first = envs[0].step(action)
    for values in first[4].values():
        values[:] = 0
    envs[1].step(action)
    _assert_equal(*(env.step(action) for env in envs))


def test_sub_environments_can_be_asked() -> None:
    """Own attributes come one each, common ones as often as there are sub-environments."""
    envs: Any = gym.make_vec(BEAM, num_envs=2).unwrapped
    envs.reset(seed=1, options={"speed": 20.0, "machine": np.array([4, 9])})
    assert envs.get_attr("speed") == (20.0, 20.0)
    machines = envs.get_attr("machine")
    assert [machine.excitation_frequency for machine in machines] == [20.0, 20.0]
    kept = [envs.settings.variants.held_out(k).clearance for k in (4, 9)]
    assert [machine.clearance for machine in machines] == kept
    assert envs.get_attr("task")[1].highest_speed == 24.0
    with pytest.raises(AttributeError, match="no attribute 'sped'; known: speed"):
        envs.get_attr("sped")


def test_a_copy_in_another_process_goes_on_alike() -> None:
    """A pickled vector of cranks holds no address: where the process that made it has ended, it steps as it would have.

    That is how a training run goes on from its checkpoint.
    """
    envs: Any = gym.make_vec(CRANK, num_envs=2, fidelity="draft").unwrapped
    envs.reset(seed=3)
    actions = np.array([0, 0])  # at the demand by the first step, and held: no speed is looked up anew
    envs.step(actions)
    script = (
        "import pickle, sys, chaosgym; envs = pickle.load(sys.stdin.buffer);"
        "sys.stdout.buffer.write(pickle.dumps([envs.step(actions)[:2] for actions in pickle.load(sys.stdin.buffer)]))"
    )
    sent = pickle.dumps(envs) + pickle.dumps([actions, actions])
    done = subprocess.run([sys.executable, "-c", script], input=sent, capture_output=True, check=True)
    for (there, reward_there), (here, reward, *_) in zip(
        pickle.loads(done.stdout), (envs.step(actions), envs.step(actions)), strict=True
    ):
        np.testing.assert_array_equal(there, here)
        np.testing.assert_array_equal(reward_there, reward)


def test_the_spec_makes_the_same_environment_again() -> None:
    """Keywords survive in the spec, which can be pickled."""
    envs = gym.make_vec(BEAM, num_envs=2, steps=9, max_episode_steps=7)
    assert envs.spec is not None
    again = gym.make_vec(pickle.loads(pickle.dumps(envs.spec)))
    assert again.num_envs == 2
    assert np.array_equal(envs.reset(seed=4)[0], again.reset(seed=4)[0])


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"num_envs": 0}, "num_envs = 0 is out of range"),
        ({"max_episode_steps": 0}, "max_episode_steps = 0 is out of range"),
        ({"autoreset_mode": "never"}, "autoreset_mode = 'never' is not one of NextStep, SameStep, Disabled"),
        ({"render_mode": "human"}, "render_mode = 'human' is not one of None, rgb_array"),
        ({"clearence": 1e-3}, "did you mean clearance"),
    ],
)
def test_bad_keywords_are_named(keywords: dict[str, Any], message: str) -> None:
    """Errors name the keyword, the value and what is allowed."""
    with pytest.raises(ParameterError, match=re.escape(message)):
        gym.make_vec(BEAM, **({"num_envs": 2} | keywords))


def test_the_first_few_machines_are_drawn() -> None:
    """A picture for each, as recorders expect; the first one is that of a single environment, bit for bit."""
    envs, env = gym.make_vec(BEAM, num_envs=6, render_mode="rgb_array"), gym.make(BEAM, render_mode="rgb_array")
    plain = gym.make_vec(BEAM, num_envs=6)
    for each in (envs, env, plain):
        each.reset(seed=3)
    action = np.ones(6, int)
    seen, unseen = envs.step(action), plain.step(action)
    env.step(1)
    assert np.array_equal(seen[0], unseen[0])
    frames = envs.render()
    assert [frame.shape for frame in frames] == 6 * [(640, 960, 3)]
    assert np.array_equal(frames[0], env.render())
    assert [bool((frame < 255).any()) for frame in frames] == [True] * 4 + [False] * 2
    assert not np.array_equal(frames[1], frames[2])


def test_bad_calls_are_named() -> None:
    """Actions, seeds, masks and options are checked, and a job that is over needs a reset."""
    envs = gym.make_vec(BEAM, num_envs=2, steps=1, autoreset_mode="Disabled")
    action = np.zeros(2, int)
    with pytest.raises(gym.error.ResetNeeded, match="call reset"):
        envs.step(action)
    with pytest.raises(ParameterError, match="leaves sub-environments without a job"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.reset(seed=0)
    for bad in (np.full(2, 0.5), np.zeros(3, int), np.full(2, 7)):
        with pytest.raises(ParameterError, match=r"action = .* is not usable; allowed: 2 whole numbers from 0 to 5"):
            envs.step(bad)
    for options in (
        {"reset_mask": [True, False]},
        {"reset_mask": np.zeros(2, bool)},
        {"sped": 1.0},
        {"speed": 3.0},
        {"machine": np.arange(3)},
    ):
        with pytest.raises(ParameterError, match="options"):
            envs.reset(options=options)
    with pytest.raises(ParameterError) as refused:
        envs.reset(options={"machine": np.arange(1000)})
    assert len(str(refused.value)) < 200
    with pytest.raises(ParameterError, match=r"seed = .* is not usable; allowed: one whole number, or "):
        envs.reset(seed=[1, 2, 3])
    assert envs.step(action)[2].all()
    with pytest.raises(gym.error.ResetNeeded, match=re.escape("[0, 1]")):
        envs.step(action)


def test_what_is_lost_or_clipped_is_said():
    """Options after an autoreset, actions outside the box, and a seed that is none; each in one line."""
    envs = gym.make_vec(BEAM, num_envs=2, steps=2, action="continuous", autoreset_mode="SameStep").unwrapped
    with pytest.raises(
        ParameterError, match=r"seed = 7.0 is not usable; allowed: one whole number, or 2 whole numbers"
    ):
        envs.reset(seed=7.0)
    _, info = envs.reset(seed=7, options={"machine": 5})
    assert info["machine"].tolist() == [5, 5]
    inside = np.zeros((2, 2), np.float32)
    envs.step(inside)
    with pytest.warns(UserWarning, match="options machine held for the jobs that reset"):
        _, _, ended, _, info = envs.step(inside)
    assert ended.all()
    assert info["machine"].tolist() == [-1, -1]
    with pytest.warns(
        UserWarning, match="actions outside the box are clipped; allowed with action='continuous': -1 to 1"
    ):
        envs.step(3.0 * np.ones((2, 2), np.float32))
    for _ in range(4):
        envs.step(inside)


def test_the_specification_keeps_what_it_was_given():
    """A dictionary that the caller changes after ``make`` changes no specification."""
    tolerances = {"clearance": 0.1}
    made = gym.make(BEAM, tolerances=tolerances), gym.make_vec(BEAM, num_envs=1, tolerances=tolerances)
    tolerances["clearance"] = 0.5
    for env in made:
        assert env.spec.kwargs["tolerances"] == {"clearance": 0.1}
        assert env.unwrapped.spec.kwargs["tolerances"] == {"clearance": 0.1}
