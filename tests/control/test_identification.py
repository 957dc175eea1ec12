"""A machine is told from all others within the tolerances by what it does in its first steps."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.belief import SpeedBelief
from chaosgym.control.controllers.belief_programming import BeliefProgramming
from chaosgym.control.controllers.identified_programming import IdentifiedProgramming
from chaosgym.control.identification import (
    EXPERIMENT,
    EXPERIMENTS,
    FROM_REST,
    SETTLING_CYCLES,
    SIDES,
    Identification,
)
from chaosgym.control.learner_view import IdentifiedMemory, LearnerView
from chaosgym.control.machine_search import EQUAL, MachineSearch, Record
from chaosgym.envs.jobs import RUN_IN_CYCLES, bouncing_share, impacts_per_cycle
from chaosgym.envs.observation import BOUNCING, LAST_ACTION, REMAINING, SPEED
from chaosgym.simulation.batch import at_speed, batch_of

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
        for observation in _started(env, machine, FROM_REST[0] - 1):
            assert identification.machines == []
            identification.add(observation)
        assert np.abs(identification.estimate - _deviation(env, machine)).max() < 2e-5
        found = identification.machines[0]
        assert found.clearance == pytest.approx(env.machine.clearance, rel=1e-6)
        assert len(set(identification.machines)) == len(identification.machines) > 1


def test_only_the_machine_itself_repeats_the_record(env):
    """The true parameters repeat every share to the last places of an observation; others within the tolerances not."""
    identification = Identification(env.pool, env.task)
    for observation in _started(env, 5, 5):
        identification.add(observation)
    others = np.random.default_rng(0).uniform(-1.0, 1.0, (16, 3))
    search = MachineSearch(env.pool, env.task, identification._record(0, RUN_IN_CYCLES))
    errors = np.abs(search.errors(np.vstack([_deviation(env, 5), others])))
    assert errors[0].max() < EQUAL < errors[1:].max(axis=1).min()


def test_no_machine_is_named_that_does_not_repeat_the_record(env, monkeypatch):
    """Shares that a sensor with errors of a hundredth would give fit none."""
    monkeypatch.setattr("chaosgym.control.machine_search.GENERATIONS", 2)
    identification, errors = Identification(env.pool, env.task), np.random.default_rng(0)
    for observation in _started(env, 7, FROM_REST[0] - 1):
        observation[BOUNCING] += errors.normal(0.0, 0.01)
        identification.add(observation)
    assert identification.estimate is None


def test_no_machine_is_named_where_all_do_the_same():
    """A beam that never touches its stops bounces for no part of the cycle, whatever its parameters."""
    env = gym.make("chaosgym/ImpactBeamTolerance-v0", pool="training", clearance=5e-3).unwrapped
    speeds, none = np.linspace(4.0, 8.0, FROM_REST[0]), np.zeros(FROM_REST[0])
    record = Record(RUN_IN_CYCLES, none[:1], speeds, np.ones(len(speeds)), none, none)
    assert MachineSearch(env.pool, env.task, record).found() is None


@pytest.fixture(scope="module")
def crank():
    """Training machines."""
    return gym.make("chaosgym/SliderCrankTolerance-v0", pool="training").unwrapped


def test_a_crank_repeats_an_experiment_in_simulation(crank, monkeypatch):
    """What a settled crank does when its speed is changed a little depends on its parameters alone, not on the past."""
    records = []
    monkeypatch.setattr(MachineSearch, "found", lambda self: records.append(self.record))
    controller = IdentifiedProgramming(gym.make("chaosgym/SliderCrankTolerance-v0", pool="training"))
    observation, _ = controller.env.reset(seed=0, options={"machine": 5})
    controller.reset()
    while not records:
        observation = controller.env.step(controller(observation))[0]
    assert len(records[0].shares) == len(EXPERIMENT) + 1
    changes = (records[0].speeds[1:] - records[0].speeds[0]) / (crank.drive.slew_limit / 4.0)
    assert changes == pytest.approx(SIDES[0] * np.array(EXPERIMENT))
    points = _deviation(crank, 5) + np.array([np.zeros(4), [0.01, 0.0, 0.0, 0.0]])
    true, other = np.abs(MachineSearch(crank.pool, crank.task, records[0]).errors(points))
    assert true.max() < EQUAL < np.median(other)


def _told(crank, identification, speed, share, left=1.0):
    """What an identification asks for after an observation of a speed and a share."""
    observation = np.zeros(13, np.float32)
    observation[[SPEED, BOUNCING, REMAINING]] = speed, share, left
    observation[LAST_ACTION] = crank.drive.action_for(speed)
    identification.add(observation)
    return identification.target


def _experimented(crank, monkeypatch, shares, left=1.0):
    """Records that are looked for after a long stay at 200 rpm whose steps have these shares in turn."""
    records = []
    monkeypatch.setattr(MachineSearch, "found", lambda self: records.append(self.record))
    identification, shares = Identification(crank.pool, crank.task), iter(shares)
    for speed in np.arange(50.0, 200.0, 10.0):
        assert _told(crank, identification, speed, next(shares)) is None
    speed = 200.0
    for _ in range(4 * len(EXPERIMENT)):
        speed = _told(crank, identification, speed, next(shares), left) or 200.0
    return records


def test_no_experiment_where_the_motion_does_not_settle_or_the_job_is_nearly_done(crank, monkeypatch):
    """There is nothing to start from, or nothing to gain."""
    assert _experimented(crank, monkeypatch, np.random.default_rng(0).uniform(0.2, 0.4, 100)) == []
    assert _experimented(crank, monkeypatch, [0.3] * 100, left=0.1) == []


@pytest.mark.parametrize("period", [1, 2, 3, 4])
def test_a_record_knows_the_orbit_that_it_begins_on(crank, monkeypatch, period):
    """It holds the shares of the steps after which the motion repeats itself, up to its first observation."""
    shares = 0.3 + 0.01 * np.arange(period)
    for record in _experimented(crank, monkeypatch, np.resize(shares, 100)):
        assert sorted(record.orbit) == pytest.approx(shares)
        assert record.orbit[-1] == record.shares[0]
        assert record.cycles == SETTLING_CYCLES


def _record_of(crank, machine, speed, period, cycles):
    """Record of an experiment below a speed, after some cycles there from rest, on an orbit of ``period`` steps."""
    speeds = speed - crank.drive.slew_limit / 4.0 * np.array([0, *EXPERIMENT])
    batch, which = batch_of(crank.pool[machine], 1), np.array([0])
    batch.start(0, at_speed(crank.pool[machine], speed))
    seen = batch.run(which, cycles)
    orbit = [bouncing_share(seen.until(cycles - 5 * k), 5, crank.machine.period_at(speed))[0] for k in range(period)]
    shares, impacts = [orbit[0]], [impacts_per_cycle(seen, 5)[0]]
    for each in speeds[1:]:
        batch.set_speeds(which, np.array([each]))
        seen = batch.run(which, 5)
        shares.append(bouncing_share(seen, 5, crank.machine.period_at(each))[0])
        impacts.append(impacts_per_cycle(seen, 5)[0])
    return Record(SETTLING_CYCLES, *map(np.array, (orbit[::-1], speeds, np.ones(len(speeds)), shares, impacts)))


@pytest.mark.parametrize(("machine", "speed", "period"), [(13, 120.0, 2), (17, 160.0, 3), (110, 160.0, 4)])
def test_a_longer_orbit_is_left_at_the_phase_that_was_observed(crank, machine, speed, period):
    """However long the machine has run before, the shares before the experiment tell where on the orbit it is."""
    for cycles in range(100, 100 + period):
        record = _record_of(crank, machine, speed, period, cycles)
        for phases, repeats in ((0, True), (1, False)):
            turned = record._replace(orbit=np.roll(record.orbit, phases))
            errors = MachineSearch(crank.pool, crank.task, turned).errors(_deviation(crank, machine)[None])
            assert (np.abs(errors).max() < EQUAL) == repeats


def test_a_share_with_another_number_of_impacts_is_far_off(crank):
    """A motion of another kind may bounce as long by chance, and leads nowhere."""
    record = _record_of(crank, 13, 120.0, 2, 100)
    other = record._replace(impacts=record.impacts + np.eye(len(record.impacts))[3] / 5)
    errors = np.abs(MachineSearch(crank.pool, crank.task, other).errors(_deviation(crank, 13)[None])[0])
    assert np.flatnonzero(errors > EQUAL).tolist() == [3]
    assert errors[3] > 1e4 * EQUAL


def test_the_other_side_is_tried_where_no_machine_repeats_the_first(crank, monkeypatch):
    """A stay a quarter of the slew limit below and one back, and then as much above."""
    searched = [record.speeds.tolist() for record in _experimented(crank, monkeypatch, np.full(100, 0.3))]
    quarter = crank.drive.slew_limit / 4.0 * np.array([0, *EXPERIMENT])
    assert searched == [(200.0 + side * quarter).tolist() for side in SIDES]


def test_an_experiment_stays_within_the_range_of_the_drive(crank, monkeypatch):
    """At the highest speed there is one side only."""
    searched = []
    monkeypatch.setattr(MachineSearch, "found", lambda self: searched.append(self.record.speeds.tolist()))
    identification = Identification(crank.pool, crank.task)
    for speed in np.arange(50.0, 300.0, 10.0):
        assert _told(crank, identification, speed, 0.3) is None
    speed = 300.0
    for _ in range(4 * len(EXPERIMENT)):
        speed = _told(crank, identification, speed, 0.3) or 300.0
    assert [set(speeds) for speeds in searched] == [{300.0, 297.5}]


def test_a_motion_that_has_settled_is_experimented_with_where_no_experiment_has_failed(crank, monkeypatch):
    """A share that repeats itself begins an experiment, once on each side of a speed."""
    searched = []
    monkeypatch.setattr(MachineSearch, "found", lambda self: searched.append(self.record.speeds[0]))
    identification = Identification(crank.pool, crank.task)
    for speed in np.arange(50.0, 200.0, 10.0):
        assert _told(crank, identification, speed, 0.3) is None
    for place in (200.0, 210.0, 220.0, 230.0):
        speed = place
        for _ in range(3 * len(EXPERIMENT)):
            speed = _told(crank, identification, speed, 0.3) or place
    assert searched == np.repeat([200.0, 210.0, 220.0, 230.0], len(SIDES)).tolist()[:EXPERIMENTS]


def test_a_speed_whose_experiments_failed_is_kept_away_from_while_others_are_left(crank, monkeypatch):
    """Both sides have to fail; with the last experiment of the job what was felt counts again."""
    monkeypatch.setattr(MachineSearch, "found", lambda self: None)
    identification, failed = Identification(crank.pool, crank.task), []
    for speed in np.arange(50.0, 200.0, 10.0):
        _told(crank, identification, speed, 0.3)
    for place in 200.0 + 10.0 * np.arange(EXPERIMENTS // len(SIDES)):
        speed = place
        for _ in range(3 * len(EXPERIMENT)):
            speed = _told(crank, identification, speed, 0.3) or place
            if not failed or failed[-1] != identification.failed:
                failed.append(set(identification.failed))
    assert failed == [set(), {200.0}, {200.0, 210.0}, set()]


def test_who_goes_elsewhere_ends_an_experiment(crank, monkeypatch):
    """An identification that only looks on is not led to take a detour for an experiment."""
    monkeypatch.setattr(MachineSearch, "found", lambda self: pytest.fail("there was no experiment"))
    identification = Identification(crank.pool, crank.task)
    for speed in (*np.arange(50.0, 200.0, 10.0), *[200.0] * 20):
        _told(crank, identification, speed, 0.3)


def test_who_knows_the_machine_does_not_look_for_it(monkeypatch):
    """On the nominal machine the plan is that of the belief, which is certain."""
    monkeypatch.setattr(MachineSearch, "found", lambda self: pytest.fail("the machine is known"))
    env = gym.make("chaosgym/SliderCrank-v0")
    observation, _ = env.reset(seed=0)
    controller, plan = IdentifiedProgramming(env), BeliefProgramming(env)
    for each in (controller, plan):
        each.reset()
    for _ in range(30):
        action = controller(observation)
        assert action == plan(observation)
        observation = env.step(action)[0]


def test_a_learner_does_not_look_for_the_nominal_machine(monkeypatch):
    """There is nothing to find out, nor to wait for."""
    monkeypatch.setattr(MachineSearch, "found", lambda self: pytest.fail("the machine is known"))
    view = LearnerView(gym.make("chaosgym/ImpactBeam-v0"), memory="identified")
    view.reset(seed=0)
    for _ in range(FROM_REST[1]):
        view.step(UP)


def test_a_wearing_machine_is_found():
    """Clearances that grow with the damage are simulated as the environment lets them grow."""
    env = gym.make("chaosgym/ImpactBeamWear-v0", pool="training").unwrapped
    identification = Identification(env.pool, env.task)
    for observation in _started(env, 2, FROM_REST[0] - 1):
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
    assert not after.gathered[0].any()
    assert after.gathered[1].any()
    assert np.mean((after.irregular[1] > 0.5)[far] == table[0].type_iii[far]) < 0.95


def test_in_training_the_machine_is_known_after_as_many_observations(env):
    """The learner's view is told of the training machine when an identification would have found it."""
    memory = IdentifiedMemory(env.observation_space, env.pool, env.task)
    observations = _started(env, 4, FROM_REST[0])
    told = [memory.start(observations[:1], np.array([4]))]
    told += [memory.add(observation[None]) for observation in observations[1:]]
    doubt = [float(each[0, -1]) for each in told]
    assert min(doubt[: FROM_REST[0] - 1]) > 0.0
    assert doubt[FROM_REST[0] - 1 :] == [0.0, 0.0]
    again = memory.restart(np.array([True]), observations[:1], np.array([4]))
    assert again[0, -1] > 0.0


@pytest.mark.parametrize("increments", [True, False])
def test_a_learner_makes_the_experiments_too(crank, increments):
    """What it does in between is its own; an experiment is made whatever it says, and tells the machine."""
    view = LearnerView(gym.make("chaosgym/SliderCrankTolerance-v0", pool="training"), "identified", increments)
    seen, _ = view.reset(seed=0, options={"machine": 5})
    held = 0
    while seen[-1] > 0.0:
        planned, is_held = float(view._memory.planned[0, 0]), bool(view._memory.held[0, 0])
        follows = 0.0 if increments else crank.drive.action_for(planned)
        seen, *_, info = view.step(np.array([1.0 if is_held else follows], np.float32))
        held += is_held
        assert info["speed"] == pytest.approx(planned)
    assert held == len(EXPERIMENT)


@pytest.mark.slow
def test_most_beams_are_found_at_the_first_attempt(env):
    """Of 16 training machines at least 13 are known after nine observations."""
    found = 0
    for machine in range(16, 32):
        identification = Identification(env.pool, env.task)
        for observation in _started(env, machine, FROM_REST[0] - 1):
            identification.add(observation)
        found += bool(identification.machines)
    assert found >= 13


@pytest.mark.slow
def test_cranks_are_found_by_experiments(crank):
    """Of three training cranks that settle, two at least are known to a thousandth of their tolerances."""
    found = 0
    for machine in (8, 44, 45):
        controller = IdentifiedProgramming(gym.make("chaosgym/SliderCrankTolerance-v0", pool="training"))
        observation, _ = controller.env.reset(seed=0, options={"machine": machine})
        controller.reset()
        for _ in range(60):
            observation = controller.env.step(controller(observation))[0]
        estimate = controller._identification.estimate
        if estimate is not None:
            # the ball joint of these cranks has no clearance, so that one of the four fields has no effect
            assert np.abs(estimate - _deviation(crank, machine))[[0, 2, 3]].max() < 2e-3
            found += 1
    assert found >= 2


@pytest.mark.slow
def test_who_identifies_the_machine_beats_who_does_not():
    """The plan with the found machine's own tables earns nearly what the true tables earn."""
    from chaosgym.control.controllers.dynamic_programming import DynamicProgramming
    from chaosgym.control.jobs import run_jobs

    env = gym.make("chaosgym/ImpactBeamTolerance-v0", pool="training")
    returns = [
        np.mean([job.job_return for job in run_jobs(env, make, [1, 2, 3], 0)])
        for make in (BeliefProgramming, IdentifiedProgramming, DynamicProgramming)
    ]
    assert returns[0] + 0.1 < returns[1] < returns[2] + 0.1
