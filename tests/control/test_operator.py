"""An operator at a plant sets the speeds that the same policy sets in the environment of the same readings."""

import gymnasium as gym
import numpy as np
import pytest

import chaosgym
from chaosgym.control.controllers import BackOff, Follow, Kriging
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.policies import shipped_policy
from chaosgym.errors import ModelFileError, ParameterError

BEAM = "chaosgym/ImpactBeamTolerance-v1"
IDEAL = {"sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0}


def plant(envs):
    """Readings of the last step, as a rig has them: peaks, impacts a cycle, share of bouncing."""
    jobs, seen = envs.jobs, {}
    run = jobs._run

    def recorded(*given):
        cycles, growth, period = run(*given)
        last = envs.task.cycles_per_step
        seen["peaks"] = envs.nominal.sensed(cycles.peak_force)[0, -last:]
        seen["impacts"] = cycles.impacts[0, -last:].sum() / last
        seen["bounce"] = cycles.bounce_duration[0, -last:]
        return cycles, growth, period

    jobs._run = recorded
    return seen


@pytest.mark.parametrize("policy", [Follow(), BackOff(), Kriging(), GuardedPolicy(shipped_policy(BEAM))])
def test_speeds_are_those_of_the_environment(policy):
    """Forty steps with ideal sensors and a demand that changes: the same speeds to the last bit."""
    given = IDEAL | policy.keywords | {"steps": 40, "shortest_hold": 9, "longest_hold": 12}
    envs = gym.make_vec(BEAM, num_envs=1, **given).unwrapped
    seen = plant(envs)
    observation, info = envs.reset(seed=[5])
    policy.start(envs)
    actions, speeds, readings = [], [float(info["speed"][0])], []
    for _ in range(40):
        readings.append(dict(seen, speed=speeds[-1]))
        actions.append(policy(observation))
        observation, _, _, _, info = envs.step(actions[-1])
        speeds.append(float(info["speed"][0]))
    demands = envs.jobs.demand[0].tolist()
    assert len(set(demands)) > 2

    operator = chaosgym.Operator(policy, BEAM, **(IDEAL | {"steps": 40}))
    assert operator.start(speed=speeds[0], demand=demands[0]) == speeds[0]
    for step, read in enumerate(readings):
        share = 2.0 * read["bounce"].sum() / (read["bounce"].size * envs.nominal.period_at(speeds[step]))
        told = {"demand": demands[step], "impacts": read["impacts"], "bouncing": share}
        assert operator.next(read["peaks"], **told) == speeds[step + 1], step


def test_it_runs_for_longer_than_a_job():
    """A rig has no end of a job: after it, the last step of one goes on."""
    operator = chaosgym.Operator(Kriging(), BEAM, steps=10)
    operator.start(speed=20.0, demand=22.0)
    speeds = [operator.next(np.full(10, 80.0)) for _ in range(30)]
    assert np.isfinite(speeds).all()
    assert abs(operator.next(np.full(6, 80.0), demand=24.0) - 24.0) <= 2.0 + operator.task.largest_trim


@pytest.mark.parametrize(
    ("peaks", "readings", "complaint"),
    [
        ([80.0] * 4, {}, r"peaks of shape \(4,\) are not usable; allowed: 5 or more forces"),
        ("loud", {}, "peaks = 'loud' are no numbers; allowed: 5 or more forces"),
        ([80.0, np.nan, -1.0] * 5, {}, "5 or more forces from 0 N on"),
        ([80.0] * 10, {"demand": 99.0}, "demand = 99 is out of range; allowed: 10 to 24"),
        ([80.0] * 10, {"bouncing": 2.0}, "bouncing = 2 is out of range; allowed: 0 to 1"),
    ],
)
def test_what_is_no_reading_is_refused(peaks, readings, complaint):
    """In one line; the machine stays where it is."""
    operator = chaosgym.Operator(Kriging(), BEAM)
    operator.start(speed=20.0, demand=22.0)
    with pytest.raises(ParameterError, match=complaint):
        operator.next(peaks, **readings)
    assert operator.speed == 20.0


def test_what_a_policy_needs_is_asked_for():
    """A start, impacts and bouncing for a trained policy, and the machine that it was trained on."""
    with pytest.raises(ParameterError, match="call start"):
        chaosgym.Operator(Kriging(), BEAM).next([80.0] * 10)
    operator = chaosgym.Operator(shipped_policy(BEAM), BEAM)
    operator.start(speed=20.0, demand=22.0)
    with pytest.raises(ParameterError, match="looks at impacts and bouncing too"):
        operator.next([80.0] * 10)
    with pytest.raises(ModelFileError, match="was trained on"):
        chaosgym.Operator(shipped_policy(BEAM), "chaosgym/SliderCrank-v1").start(speed=200.0, demand=200.0)


@pytest.mark.parametrize("policy", [BackOff(), Kriging(), shipped_policy(BEAM), lambda observation: [20.0]])
def test_what_is_no_reading_is_skipped(policy):
    """A step without a reading keeps the trim; the third one in a row, and a new demand, go to the demand."""
    keywords = {} if hasattr(policy, "start") else {"action": "speed"}
    operator = chaosgym.Operator(policy, BEAM, **keywords)
    operator.start(speed=20.0, demand=20.0)
    seen = {"impacts": 12.0, "bouncing": 0.6}
    loud = np.tile([60.0, 90.0, 75.0], 4)
    for _ in range(21):
        trim = operator.next(loud, **seen) - operator.demand
    lost = [[np.nan] * 10, [80.0, np.nan] * 5, [1e9] * 10, [0.0] * 10]
    speeds = [operator.next(peaks, **seen) for peaks in lost[:2]]
    assert speeds == [operator.demand + trim] * 2
    with pytest.warns(UserWarning, match=r"no usable reading for 3 steps \(mean peak force 475 N\)"):
        assert operator.next(lost[2], **seen) == operator.demand
    assert operator.next(lost[3], **seen) == operator.demand
    assert operator.lost == 4
    assert operator.next(loud, **seen | {"impacts": np.nan}, demand=22.0) == 22.0
    assert operator.next(loud, **seen | {"impacts": np.inf}) == 22.0
    assert np.isfinite(operator.next(loud, **seen))
    assert operator.lost == 6


def test_the_longest_stretch_of_finite_peaks_is_the_reading():
    """Cycles on both sides of a lost one are not compared: eight that repeat after two cycles look the same alone."""
    operators = [chaosgym.Operator(BackOff(), BEAM) for _ in range(2)]
    for operator in operators:
        operator.start(speed=20.0, demand=20.0)
    alone = [80.0, 95.0] * 4
    assert operators[0].next(alone) == operators[1].next([70.0, np.nan, *alone, np.inf, 70.0])
    for name, values in operators[0].policy.__dict__.items():
        if isinstance(values, np.ndarray):
            np.testing.assert_array_equal(values, getattr(operators[1].policy, name))


def test_the_measured_speed_is_what_a_policy_sees():
    """A drive that stands at 19 Hz: kriging remembers forces at 19 Hz, and set-points go on from the last one."""
    operator = chaosgym.Operator(Kriging(), BEAM)
    operator.start(speed=19.0, demand=22.0)
    speeds = [operator.next([80.0] * 10, speed=19.0) for _ in range(4)]
    grid = operator.task.grid
    assert grid[np.flatnonzero(operator.policy._counts[0])].tolist() == [19.0]
    assert np.abs(np.diff([19.0, *speeds])).max() <= operator.task.slew_limit
    assert max(speeds) > 21.0


def test_speeds_stay_within_the_drive():
    """Whatever a policy asks for: range of speed and change in a step are those of the task."""
    random = np.random.default_rng(5)
    operator = chaosgym.Operator(lambda observation: [random.choice([-1e9, 5.0, 30.0, 1e9])], BEAM, action="speed")
    operator.start(speed=20.0, demand=22.0)
    with pytest.warns(UserWarning, match="actions outside the box are clipped; allowed with action='speed': 10 to 24"):
        speeds = [20.0, *(operator.next([80.0] * 10, impacts=9.0, bouncing=0.5) for _ in range(60))]
    task = operator.task
    assert task.lowest_speed == min(speeds) < max(speeds) == task.highest_speed
    assert np.abs(np.diff(speeds)).max() <= task.slew_limit


def test_a_measured_speed_that_scatters_is_the_speed_that_was_set():
    """Backing off leaves an irregular demand where the tachometer errs by 0.02 Hz, as where it does not."""
    random, speeds = np.random.default_rng(2), []
    for error in (0.0, 0.02):
        operator = chaosgym.Operator(BackOff(), BEAM)
        operator.start(speed=20.0, demand=20.0)
        speeds.append(
            [
                operator.next([60.0, 90.0, 75.0] * 4, speed=operator.speed + error * random.uniform(-1, 1))
                for _ in range(9)
            ]
        )
    assert speeds[0] == speeds[1]
    assert len(set(speeds[0])) > 2


def test_a_trained_policy_is_guarded_unless_it_is_not_to_be():
    """Readings that no machine of training had: guarded, the demand is followed, and the operator says why."""
    for guard in (True, False):
        operator = chaosgym.Operator(shipped_policy(BEAM), BEAM, guard=guard)
        operator.start(speed=20.0, demand=20.0)
        strange = np.tile([150.0, 300.0, 220.0, 90.0], 3)[:10]
        speeds = [operator.next(strange, impacts=2.0, bouncing=0.1) for _ in range(12)]
        assert operator.foreign == (True if guard else None)
        assert isinstance(operator.policy, GuardedPolicy) is guard
        assert speeds[-1] == 20.0 or not guard


def test_a_map_remembers_the_last_job_of_a_machine(tmp_path):
    """What was felt is there again after the next start, with its file alone; without one it is dropped."""
    file = tmp_path / "memory.npz"
    readings = {"impacts": 2.0, "bouncing": 0.1}

    def begun(policy="fleet", **keywords):
        """An operator that was started."""
        operator = chaosgym.Operator(shipped_policy(BEAM, policy), BEAM, guard=False, **keywords)
        operator.start(speed=20.0, demand=20.0)
        return operator

    first = begun(memory=file)
    for _ in range(4):
        first.next(np.linspace(80.0, 90.0, 10), **readings)
    felt = first.policy.memory
    assert (felt[0, :, 0] > 0.0).sum() >= 1
    assert not file.exists()
    first.keep()
    np.testing.assert_array_equal(begun(memory=file).policy.memory, felt)
    assert not begun().policy.memory.any()
    with pytest.raises(ModelFileError, match="is a memory of another policy"):
        begun("clearance", memory=file)
    file.write_bytes(b"no archive")
    with pytest.raises(ModelFileError, match="can't be read as a memory"):
        begun(memory=file)
    with pytest.raises(ParameterError, match="Kriging keeps no memory from job to job; allowed: a learned map"):
        chaosgym.Operator(Kriging(), BEAM, memory=file)


class Away(BackOff):
    """A controller that wants to be 1 Hz above the demand from the third step on."""

    def speeds(self, observations):
        """The demand, and then another speed."""
        self.steps = getattr(self, "steps", 0) + 1
        return observations[:, 1].astype(float) + (1.0 if self.steps > 2 else 0.0)


@pytest.mark.parametrize(("largest", "stays"), [(150.0, True), (400.0, False)])
def test_few_cycles_of_a_large_force_are_seen(largest, stays):
    """One peak in ten that is large wears as the power of 10/3 says, though the mean peak is hardly larger."""
    operator = chaosgym.Operator(Away(), BEAM)
    speed = operator.start(speed=20.0, demand=20.0)
    calm, few = np.full(10, 80.0), np.r_[np.full(9, 60.0), largest]
    assert few.mean() < 1.2 * calm.mean()
    load = np.mean(few ** (10 / 3)) ** 0.3 / 80.0
    assert bool(load < 1.5) is stays
    for _ in range(8):
        speed = operator.next(calm if speed == 20.0 else few)
    assert speed == (21.0 if stays else 20.0)


def test_a_task_without_damage_allows_any_force():
    """Where life costs nothing, a speed of larger force is as good as another."""
    operator = chaosgym.Operator(Away(), BEAM, damage_weight=0.0)
    speed = operator.start(speed=20.0, demand=20.0)
    for _ in range(8):
        speed = operator.next(np.full(10, 80.0 if speed == 20.0 else 400.0))
    assert speed == 21.0
