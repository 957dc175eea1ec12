"""The native vector environment does what single environments do, bit for bit."""

import pickle
import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from chaosgym.core import status
from chaosgym.core.compilation import call
from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.tasks import Status
from chaosgym.errors import ParameterError
from chaosgym.simulation import batch as batch

BEAM, CRANK = "chaosgym/ImpactBeam-v0", "chaosgym/SliderCrank-v0"
BEAMS = "chaosgym/ImpactBeamTolerance-v0"

NARROW = {"lowest_speed": 195.0, "highest_speed": 200.0}
"""Range of a drive in which the regimes of an unusual crank are soon known."""


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
    actions = np.random.default_rng(seed).uniform(-1.2, 1.2, (steps, envs[0].num_envs, 1)).astype(np.float32)
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
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_whole_episodes_equal_those_of_single_environments(name: str, mode: AutoresetMode) -> None:
    """Observations, rewards, ends and infos agree to the last bit, on machines drawn anew in every job of the beams."""
    envs = _pair(name, mode, job_cycles=15, pool="training" if name == BEAMS else "nominal")
    assert _assert_same_episodes(envs, 8) >= 6
    assert envs[0].metadata["autoreset_mode"] is mode


@pytest.mark.parametrize("mode", AutoresetMode)
def test_sub_environments_that_end_apart_start_anew_by_themselves(mode: AutoresetMode) -> None:
    """Fracture ends some jobs earlier than others; the limit of steps truncates the rest."""
    envs = _pair(BEAMS, mode, count=4, lowest_speed=24.0, job_cycles=500, max_episode_steps=4)
    for env in (envs[0]._single, *(single.unwrapped for single in envs[1].envs)):
        task = env.task
        object.__setattr__(task, "damage_acceleration", 5e4)
    assert _assert_same_episodes(envs, 12, seed=2) >= 8


@pytest.mark.parametrize("cycles", [1, 3, 25])
def test_any_number_of_cycles_in_a_step(cycles: int) -> None:
    """Sums run in the same order, whatever the shape of the arrays."""
    envs = _pair(BEAM, AutoresetMode.SAME_STEP, cycles_per_step=cycles, job_cycles=4 * cycles, lowest_speed=15.0)
    assert _assert_same_episodes(envs, 9) == 6


@pytest.mark.parametrize(
    "keywords",
    [
        {"contact_law": "hertz", "rod": "rigid", "matrix_update_interval": 15.0},
        {"friction_coefficient": 0.1, "slider_joint": "instrumented", "matrix_update_interval": 15.0},
        {"speed_grid": 0.0, "rod": "rigid", "ball_joint": "instrumented", "matrix_update_interval": 15.0},
    ],
)
def test_every_kind_of_slider_crank(keywords: dict[str, Any]) -> None:
    """The scenes that need other kernels or larger tables run side by side too."""
    envs = _pair(CRANK, AutoresetMode.NEXT_STEP, job_cycles=10, **NARROW, **keywords)
    assert _assert_same_episodes(envs, 4) >= 3


def test_a_beam_whose_impacts_take_no_time() -> None:
    """The cheapest rung of the ladder of fidelity runs side by side too."""
    envs = _pair(
        BEAM,
        AutoresetMode.SAME_STEP,
        contact_law="restitution",
        n_modes=1,
        fitted_modes=0,
        job_cycles=20,
        lowest_speed=29.0,
    )
    assert _assert_same_episodes(envs, 9) == 6


@pytest.mark.slow
@pytest.mark.parametrize("name", ENVIRONMENTS)
def test_whole_jobs_equal_those_of_single_environments(name: str) -> None:
    """Jobs of 1000 cycles, to the last bit."""
    envs = _pair(name, AutoresetMode.SAME_STEP, count=4, pool="nominal")
    assert _assert_same_episodes(envs, 401) == 8


def test_each_sub_environment_has_a_generator_of_its_own() -> None:
    """What one does changes no random number of another; without seeds generators go on."""
    one = gym.make_vec(BEAM, num_envs=2, job_cycles=10, lowest_speed=15.0, autoreset_mode="SameStep")
    other = gym.make_vec(BEAM, num_envs=3, job_cycles=10, lowest_speed=15.0, autoreset_mode="SameStep")
    first, second = one.reset(seed=[8, 9])[0], other.reset(seed=[7, 9, 8])[0]
    assert np.array_equal(first, second[[2, 1]])
    assert not np.array_equal(one.reset()[0], first)


def test_a_failed_simulation_ends_its_job_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """The others go on; the failed one reports what happened and holds no NaN."""
    envs = gym.make_vec(BEAM, num_envs=3, lowest_speed=15.0)
    envs.reset(seed=0)

    def fail_second(*arguments: Any) -> None:
        call(*arguments)
        arguments[5].peak_force[1] = np.nan
        arguments[-1][1] = status.DIVERGED

    monkeypatch.setattr(batch, "call", fail_second)
    observation, reward, terminated, truncated, infos = envs.step(np.zeros((3, 1), np.float32))
    assert terminated.tolist() == [False, True, False]
    assert infos["status"].tolist() == [Status.RUNNING, Status.SIMULATION_FAILED, Status.RUNNING]
    assert infos["reward_failure"].tolist() == [0.0, -10.0, 0.0]
    assert not truncated.any()
    assert observation in envs.observation_space
    assert np.all(np.isfinite(reward))


def test_results_belong_to_the_caller() -> None:
    """Writing into what a step returned changes nothing."""
    envs = [gym.make_vec(BEAM, num_envs=2, lowest_speed=15.0) for _ in range(2)]
    for env in envs:
        observation, infos = env.reset(seed=1)
        if env is envs[0]:
            observation[:] = -1.0
            for values in infos.values():
                values[:] = 0
    action = np.zeros((2, 1), np.float32)
    first = envs[0].step(action)
    for values in first[4].values():
        values[:] = 0
    envs[1].step(action)
    _assert_equal(*(env.step(action) for env in envs))


def test_sub_environments_can_be_asked() -> None:
    """Own attributes come one each, common ones as often as there are sub-environments."""
    envs = gym.make_vec(BEAMS, num_envs=2, lowest_speed=15.0).unwrapped
    envs.reset(seed=1, options={"speed": 20.0, "machine": np.array([4, 9])})
    assert envs.get_attr("speed") == (20.0, 20.0)
    assert envs.get_attr("damage") == (0.0, 0.0)
    machines = envs.get_attr("machine")
    assert [machine.excitation_frequency for machine in machines] == [20.0, 20.0]
    assert [machine.clearance for machine in machines] == [envs.get_attr("pool")[0][k].clearance for k in (4, 9)]
    assert envs.get_attr("regimes")[1].speeds[0] == 15.0
    assert envs.get_attr("drive")[1].highest_speed == 30.0
    with pytest.raises(AttributeError, match="no attribute 'sped'; known: speed"):
        envs.get_attr("sped")


def test_the_spec_makes_the_same_environment_again() -> None:
    """Keywords survive in the spec, which can be pickled."""
    envs = gym.make_vec(BEAM, num_envs=2, lowest_speed=15.0, max_episode_steps=7)
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
        ({"render_mode": "rgb_array"}, "render_mode = 'rgb_array' is not one of None"),
        ({"clearence": 1e-3}, "did you mean clearance"),
    ],
)
def test_bad_keywords_are_named(keywords: dict[str, Any], message: str) -> None:
    """Errors name the keyword, the value and what is allowed."""
    with pytest.raises(ParameterError, match=re.escape(message)):
        gym.make_vec(BEAM, **({"num_envs": 2} | keywords))


def test_bad_calls_are_named() -> None:
    """Actions, seeds, masks and options are checked, and a job that is over needs a reset."""
    envs = gym.make_vec(BEAM, num_envs=2, lowest_speed=15.0, job_cycles=5, autoreset_mode="Disabled")
    action = np.zeros((2, 1), np.float32)
    with pytest.raises(gym.error.ResetNeeded, match="call reset"):
        envs.step(action)
    with pytest.raises(ParameterError, match="leaves sub-environments without a job"):
        envs.reset(options={"reset_mask": np.array([True, False])})
    envs.reset(seed=0)
    for bad in (np.zeros(2), np.zeros((3, 1)), np.full((2, 1), np.nan)):
        with pytest.raises(ParameterError, match="action"):
            envs.step(bad)
    for options in (
        {"reset_mask": [True, False]},
        {"reset_mask": np.zeros(2, bool)},
        {"sped": 1.0},
        {"speed": 3.0},
        {"machine": 1},
    ):
        with pytest.raises(ParameterError, match="options"):
            envs.reset(options=options)
    with pytest.raises(ParameterError, match="seed has 3 entries"):
        envs.reset(seed=[1, 2, 3])
    assert envs.step(action)[2].all()
    with pytest.raises(gym.error.ResetNeeded, match=re.escape("[0, 1]")):
        envs.step(action)


def test_clearance_grows_side_by_side_as_alone() -> None:
    """On machines that wear fast, steps agree to the last bit, and so do the worn machines."""
    envs = _pair("chaosgym/ImpactBeamWear-v0", AutoresetMode.SAME_STEP, count=2, lowest_speed=28.0, pool="nominal")
    for env in (envs[0]._single, *(single.unwrapped for single in envs[1].envs)):
        object.__setattr__(env.task, "damage_acceleration", 1e4)
    assert _assert_same_episodes(envs, 12) == 0
    worn, same = (env.unwrapped.get_attr("machine") for env in envs)
    assert worn == same
    new = [envs[0].unwrapped.get_attr("pool")[0][int(k)] for k in envs[0].unwrapped._jobs.chosen]
    assert all(old.clearance > 1.1 * machine.clearance for old, machine in zip(worn, new, strict=True))
