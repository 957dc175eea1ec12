"""What every registered environment promises, whatever its machine."""

import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from chaosgym.envs import ENVIRONMENTS
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.machine_env import MachineEnv
from chaosgym.envs.observation import MEANINGS
from chaosgym.envs.task import Status, Task, UnknownKeywordError
from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import MotionState, simulate

pytestmark = pytest.mark.parametrize("name", ENVIRONMENTS)

EXACT = {"sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0, "speed_ripple": 0.0, "kick": 0.0}
"""Keywords of an undisturbed machine with perfect sensors."""


def _make(name: str, **keywords: Any) -> MachineEnv:
    env = gym.make(name, **keywords).unwrapped
    assert isinstance(env, MachineEnv)
    return env


def _run(env: gym.Env, seed: int, steps: int) -> list[Any]:
    """Observations, rewards and infos of random actions."""
    env.action_space.seed(seed)
    results: list[Any] = [env.reset(seed=seed)]
    for _ in range(steps):
        results.append(env.step(env.action_space.sample()))
    return results


@pytest.mark.parametrize("action", ["trim", "continuous"])
def test_gymnasium_finds_nothing_to_complain_about(name: str, action: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """check_env passes without a warning, rendering included."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    check_env(_make(name, action=action), skip_render_check=action != "trim")


@pytest.mark.parametrize("action", ["trim", "continuous"])
def test_stable_baselines3_finds_nothing_to_complain_about(name: str, action: str) -> None:
    """check_env passes without a warning."""
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gym.make(name, render_mode="rgb_array", action=action)
    checker.check_env(env, warn=True, skip_render_check=action != "trim")


def test_same_seed_same_bytes(name: str) -> None:
    """Whole trajectories repeat, in a new environment as well as after other jobs in the same one."""
    fresh, used = gym.make(name), gym.make(name)
    _run(used, seed=99, steps=4)
    for one, other in zip(_run(fresh, 7, 12), _run(used, 7, 12), strict=True):
        assert one[0].tobytes() == other[0].tobytes()
        assert one[1:] == other[1:]


def test_the_motion_goes_on_across_changes_of_speed(name: str) -> None:
    """The motion of a step begins in the state in which the last one ended, as ``simulate`` runs it."""
    env = _make(name, action="speed", wear=0.0, **EXACT)
    env.reset(seed=0, options={"speed": env.task.lowest_speed})
    state: MotionState | None = simulate(env.machine, env.task.run_in_cycles).final_state
    place = list(env.observation_names).index("mean_peak_force")
    for changes in (0, 1, 2, 2, 1):
        speed = env.task.lowest_speed + changes * 0.5 * env.task.slew_limit
        observation, _, _, _, info = env.step(np.array([speed], np.float32))
        assert info["speed"] == pytest.approx(speed, rel=1e-6)
        record = simulate(env.machine, env.task.cycles_per_step, state)
        assert observation[place] == pytest.approx(record.peak_force[:, 0].mean(), rel=1e-6)
        state = record.final_state


def test_the_trim_holds_moves_and_goes_back(name: str) -> None:
    """Speed is demand and trim; the trim stays when the demand changes, and one action ends it."""
    env = _make(name)
    env.reset(seed=2, options={"speed": env.task.lowest_demand})
    step = env.task.trim_step
    speeds = []
    for action in (5, 5, 5, 5, 5, 5, 5, 1, 0, 3, 2, 5):
        observation, _, _, _, info = env.step(action)
        speeds.append(info["speed"] - info["demand"])
        assert abs(observation[PLACE.trim]) <= env.task.largest_trim
    assert speeds[6:] == pytest.approx([0.0, -step, -step, -3 * step, -2 * step, 0.0])


def test_a_small_continuous_action_holds_the_speed(name: str) -> None:
    """Within the dead band nothing changes; the second number goes back to the demand."""
    env = _make(name, action="continuous")
    env.reset(seed=2)
    moves = ([0.0, 1.0], [-1.0, -1.0], [0.39, 0.4], [0.0, 1.0])
    trims = [float(env.step(np.array(move, np.float32))[0][2]) for move in moves]
    assert trims == pytest.approx([0.0, -2 * env.task.trim_step, -2 * env.task.trim_step, 0.0])


def test_the_reward_is_the_sum_of_its_terms_and_never_positive(name: str) -> None:
    """Every term is in info; there is nothing to farm, and giving up costs more than going on."""
    env = _make(name)
    worst = env.task.type_iii_weight + env.task.deviation_weight * env.task.largest_trim
    assert env.task.failure_weight > worst
    for _, reward, _, _, info in _run(env, 3, 15)[1:]:
        terms = [info[term] for term in info if term.startswith("reward_")]
        assert len(terms) == 5
        assert reward == pytest.approx(sum(terms))
        assert max(terms) <= 0.0
        assert 0.0 <= info["type_iii"] <= 1.0
        assert info["reward_type_iii"] == pytest.approx(-env.task.type_iii_weight * info["type_iii"])


def test_sensors_err_and_the_reward_does_not_know(name: str) -> None:
    """Peaks, bouncing and impacts are measured with errors; the motion and its reward are the same without them."""
    sensors = {name: 0.0 for name in ("sensor_error", "bouncing_error", "missed_impacts")}
    exact, noisy = _make(name, **sensors), _make(name)
    true, same = exact.reset(seed=4)[0], noisy.reset(seed=4)[0]
    assert np.array_equal(true[:6], same[:6])
    differs = np.array([value != other for value, other in zip(true[6:], same[6:], strict=True)])
    assert differs.all()
    peak = list(exact.observation_names).index("max_peak_force")
    assert abs(true[peak] - same[peak]) <= noisy.task.sensor_error


def test_the_demand_changes_as_the_task_says(name: str) -> None:
    """Demands lie on their grid within the range, hold for as long as they should, and change by as much."""
    env = _make(name)
    task = env.task
    for seed in range(10):
        env.reset(seed=seed)
        demand = env._job.demand[0]
        assert task.lowest_demand <= demand.min() <= demand.max() <= task.highest_demand
        np.testing.assert_allclose((demand - task.lowest_demand) % task.trim_step, 0.0, atol=1e-9)
        changes = np.flatnonzero(np.diff(demand))
        assert np.all(np.diff(changes) >= task.shortest_hold)
        assert np.abs(np.diff(demand)).max() <= task.largest_change + task.trim_step
        assert len(changes) >= 2


def test_a_failed_simulation_ends_the_job(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """step() never raises for the physics; every step that is left costs, and no value is NaN."""
    env = _make(name)
    env.reset(seed=0)
    run = env._job._run

    def failing(*arguments: Any) -> Any:
        cycles, growth, period = run(*arguments)
        cycles.failed[:] = True
        for values in (*cycles[1:], growth):
            values[:] = 0
        return cycles, growth, period

    monkeypatch.setattr(env._job, "_run", failing)
    observation, _, terminated, truncated, info = env.step(env.action_space.sample())
    assert (terminated, truncated, info["status"]) == (True, False, Status.SIMULATION_FAILED)
    assert observation in env.observation_space
    assert info["reward_failure"] == -env.task.failure_weight * env.task.steps
    assert np.all(np.isfinite(list(info.values())))
    with pytest.raises(gym.error.ResetNeeded):
        env.step(0)


def test_the_job_ends_when_it_is_done(name: str) -> None:
    """After as many steps as it has, and no earlier."""
    env = _make(name, steps=4)
    results = _run(env, 0, 4)[1:]
    assert [result[2] for result in results] == [False, False, False, True]
    assert results[-1][4]["is_success"]
    assert results[-1][0][4] == 0.0


@pytest.mark.parametrize(
    ("keywords", "message"),
    [
        ({"lowest_speed": 0.0}, "lowest_speed: "),
        ({"lowest_speed": 300.0, "highest_speed": 200.0}, "lowest_speed = 300 is out of range; allowed: up to"),
        ({"cycles_per_step": 2.5}, "cycles_per_step = 2.5 is out of range; allowed: whole numbers from"),
        ({"type_iii_weight": -1.0}, "type_iii_weight = -1 is out of range"),
        ({"highest_demand": 1e6}, "highest_demand = 1e+06 is out of range"),
        ({"action": "jump"}, "action = 'jump' is not one of trim, continuous, speed"),
        ({"sensor_error": float("nan")}, "sensor_error = nan N is out of range"),
        ({"tolerances": {"clearence": 0.1}}, "has no field 'clearence'"),
    ],
)
def test_bad_keywords_are_named(name: str, keywords: dict[str, Any], message: str) -> None:
    """Errors name the keyword, the value and what is allowed."""
    with pytest.raises(ParameterError, match=re.escape(message)):
        _make(name, **keywords)


def test_an_unknown_keyword_is_a_type_error_too(name: str) -> None:
    """TorchRL tries frameskip, and looks for Python's own words in the answer."""
    with pytest.raises(UnknownKeywordError, match="unexpected keyword argument 'frameskip'") as refusal:
        _make(name, frameskip=1)
    assert isinstance(refusal.value, TypeError)
    with pytest.raises(TypeError, match="did you mean cycles_per_step"):
        _make(name, cycles_per_steps=5)


def test_the_speed_is_not_a_keyword(name: str) -> None:
    """The agent sets it."""
    field = _make(name).nominal.speed_field
    with pytest.raises(ParameterError, match=f"{field} is what the agent sets"):
        _make(name, **{field: 20.0})


@pytest.mark.parametrize("action", [np.nan, 6, -1, np.zeros(2), 0.5])
def test_bad_actions_are_named(name: str, action: Any) -> None:
    """An action that is none is a mistake of the agent and is not hidden."""
    env = _make(name)
    env.reset(seed=0)
    with pytest.raises(ParameterError, match="action"):
        env.step(action)


@pytest.mark.parametrize(
    "options", [{"speed": 3.0}, {"sped": 10.0}, {"machine": 256}, {"machine": -1}, {"machine": 0.5}]
)
def test_bad_options_are_named(name: str, options: dict[str, float]) -> None:
    """A misspelt option is not ignored."""
    with pytest.raises(ParameterError, match="options"):
        _make(name).reset(options=options)


def test_machines_are_drawn_afresh_and_kept_ones_stay(name: str) -> None:
    """Each reset draws another machine within the tolerances; machine k of an evaluation is always the same."""
    env = _make(name)
    drawn = [env.reset(seed=seed)[1]["clearance"] for seed in range(5)]
    kept = [env.reset(seed=seed, options={"machine": 7})[1]["clearance"] for seed in (1, 2)]
    assert kept[0] == kept[1]
    nominal = getattr(env.nominal, env.nominal.clearance_field)
    width = env.settings.variants.tolerances.get(env.nominal.clearance_field, 0.0)
    assert len(set(drawn)) == (5 if width else 1)
    assert all(abs(value / nominal - 1.0) <= width for value in [*drawn, *kept])


def test_wear_opens_the_clearance_over_the_job(name: str) -> None:
    """It grows by the share that the task says, step by step, in the machine that is simulated."""
    env = _make(name, wear=0.5, steps=4)
    _, info = env.reset(seed=0)
    new = info["clearance"]
    values = [env.step(0)[4]["clearance"] / new for _ in range(4)]
    assert values == pytest.approx([1.125, 1.25, 1.375, 1.5])


def test_the_model_is_not_the_machine(name: str) -> None:
    """Controllers may use a coarser model than the machine's, whatever its rung, and either can be chosen."""
    env = _make(name)
    rungs = list(type(env.nominal).fidelity_ladder)
    assert env.model.n_modes + env.model.fitted_modes < env.nominal.n_modes + env.nominal.fitted_modes
    assert _make(name, fidelity=rungs[1]).model == env.model
    same = _make(name, fidelity=rungs[1], model_fidelity=rungs[1])
    assert same.model == same.nominal
    assert _make(name, fidelity=rungs[1]).nominal.rung == rungs[1]


def test_rendering_does_not_touch_the_physics(name: str) -> None:
    """Frames have the size of the figure, change from step to step, cost no bit of it, and show what happened."""
    plain, shown = _make(name), _make(name, render_mode="rgb_array")
    for one, other in zip(_run(plain, 1, 2), _run(shown, 1, 2), strict=True):
        assert np.array_equal(one[0], other[0])
    frames = []
    for _ in range(2):
        info = shown.step(1)[4]
        frames.append(shown.render())
        assert shown._shown().peak_force.max() == info["largest_force"]
    assert frames[0].shape == (640, 960, 3)
    assert np.any(frames[0] != frames[1])
    shown.close()


def test_observations_are_named_finite_and_explained(name: str) -> None:
    """Every entry has a name and a meaning, and stays within finite bounds."""
    env = _make(name)
    assert tuple(MEANINGS) == env.observation_names
    assert env.observation_space.shape == (len(env.observation_names),)
    assert np.isfinite(env.observation_space.low).all()
    assert np.isfinite(env.observation_space.high).all()
    for observation, *_ in _run(env, 5, 20):
        assert observation in env.observation_space


def test_every_number_of_the_task_is_explained(name: str) -> None:
    """The table of keywords is written from what each field says of itself."""
    assert all(about.source for about in parameters_of(Task).values())


@pytest.mark.slow
def test_spawned_workers_run_the_same_job(name: str) -> None:
    """An AsyncVectorEnv of spawned processes gives what single environments give."""
    envs = gym.make_vec(name, num_envs=2, vectorization_mode="async", vector_kwargs={"context": "spawn"})
    observations, _ = envs.reset(seed=[4, 5])
    expected = [_make(name).reset(seed=4 + i)[0] for i in range(2)]
    assert np.array_equal(observations, expected)
    envs.close()
