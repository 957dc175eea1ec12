"""A belief finds the machine that behaves as what was felt, and its plan is the best schedule of what it expects."""

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.belief import HORIZON, LOCAL, SCATTER, SENSES, SpeedBelief
from chaosgym.control.forecast import forecast_of, worth_of_steps
from chaosgym.control.learner_view import LearnerView
from chaosgym.envs.observation import BOUNCING

ENV = "chaosgym/ImpactBeamTolerance-v0"
CALM, WILD = np.array([-1.0, 0.5, 1.0, -0.5, 0.0]), np.array([-9.0, 8.0, 3.0, -7.0, 5.0])
"""Scatter of five peaks [N]."""


@pytest.fixture(scope="module")
def env():
    """Training machines."""
    return gym.make(ENV, pool="training").unwrapped


def _felt(table, place, remaining=1.0):
    """What a machine with a table answers at one of its speeds, as an observation (1, d)."""
    observation = np.zeros((1, 13), np.float32)
    observation[0, 0], observation[0, 2] = table.speeds[place], remaining
    observation[0, 8:] = table.equivalent_force[place] + (WILD if table.type_iii[place] else CALM)
    return observation


def test_the_machine_is_found_by_what_it_does(env):
    """After a sweep over the range, calm and irregular speeds are believed to be those of the machine."""
    table = env.pool.regimes(17)[0]
    belief = SpeedBelief(env.pool, env.task)
    before = belief.start(_felt(table, 0))
    for place in range(1, len(table.speeds), 3):
        after = belief.add(_felt(table, place))
    right = [np.mean((plan.irregular[0] > 0.5) == table.type_iii) for plan in (before, after)]
    assert right[0] < 0.9 < 0.97 < right[1]
    assert before.doubt[0] > 0.5 > after.doubt[0]


def test_a_machine_that_is_known_leaves_no_doubt():
    """On the nominal machine the belief holds that machine alone, whatever is felt."""
    env = gym.make("chaosgym/ImpactBeam-v0").unwrapped
    table = env.pool.regimes(0)[0]
    plan = SpeedBelief(env.pool.possible, env.task).start(_felt(env.pool.sister("training").regimes(17)[0], 40))
    assert plan.doubt[0] == 0.0
    assert np.array_equal(plan.irregular[0, 60:] > 0.5, table.type_iii[60:])


def test_a_worn_machine_is_believed_by_the_tables_of_its_clearance():
    """The same peaks at the same speed, with other damage: what is expected are the tables of that clearance."""
    env = gym.make("chaosgym/ImpactBeamWear-v0", pool="training").unwrapped
    tables = env.pool.regimes(5)
    for damage, table in ((0.0, tables[0]), (0.62, tables[3]), (1.0, tables[5])):
        belief = SpeedBelief(env.pool, env.task)
        plan = belief.start(np.append(_felt(table, 0), [[np.float32(damage)]], axis=1))
        for place in range(1, len(table.speeds), 3):
            plan = belief.add(np.append(_felt(table, place), [[np.float32(damage)]], axis=1))
        assert np.mean((plan.irregular[0] > 0.5) == table.type_iii) > 0.95


def test_a_motion_that_repeats_itself_is_calm(env):
    """Stays at one speed with the same peaks: a share of bouncing that comes back every third step is believed to be
    calm, one that never does to be irregular."""
    calm, irregular = SpeedBelief(env.pool, env.task), SpeedBelief(env.pool, env.task)
    table, place = env.pool.regimes(17)[0], 60
    for step in range(8):
        felt = _felt(table, place)
        add = "add" if step else "start"
        felt[0, BOUNCING] = 0.3 + 0.02 * (step % 3)
        repeated = getattr(calm, add)(felt)
        felt[0, BOUNCING] = 0.3 + 0.02 * step
        changed = getattr(irregular, add)(felt)
    assert repeated.gathered[0, place] < -2.0
    assert changed.gathered[0, place] > 2.0


def test_a_distrusted_speed_is_avoided_until_the_machine_is_known(env):
    """Whatever is felt there, of one job and of the speed alone, and as long as asked; its own table is trusted."""
    table = env.pool.regimes(17)[0]
    place = int(np.flatnonzero(~table.type_iii)[-1])
    belief = SpeedBelief(env.pool, env.task)
    belief.start(np.repeat(_felt(table, place), 2, axis=0))
    belief.distrust(0, [float(table.speeds[place])])
    for _ in range(5):
        plan = belief.add(np.repeat(_felt(table, place), 2, axis=0))
    assert plan.irregular[0, place] > 0.5 > plan.irregular[1, place]
    assert plan.irregular[0, place + 1] == plan.irregular[1, place + 1]
    belief.distrust(0, [])
    plan = belief.add(np.repeat(_felt(table, place), 2, axis=0))
    assert plan.irregular[0, place] == plan.irregular[1, place]
    belief.distrust(0, [float(table.speeds[place])])
    belief.know(0, 17)
    assert belief.add(np.repeat(_felt(table, place), 2, axis=0)).irregular[0, place] < 0.1


def test_a_share_is_compared_within_a_stay_alone(env):
    """Back at a speed after one step elsewhere, the share of the last stay says nothing about this one."""
    table, belief = env.pool.regimes(17)[0], SpeedBelief(env.pool, env.task)
    belief.start(_felt(table, 60))
    before = belief.add(_felt(table, 80)).gathered[0, 60]
    after = belief.add(_felt(table, 60)).gathered[0, 60]
    arriving = np.interp(_felt(table, 60)[0, 8:].std(), SCATTER, SENSES["impact-beam"].moving)
    assert after - before == pytest.approx(LOCAL * arriving, abs=1e-6)


def test_an_excluded_machine_is_not_believed_in(env):
    """Without it, what its twin knows is not known, though everything felt is the same."""
    table = env.pool.regimes(17)[0]
    sure, unsure = SpeedBelief(env.pool, env.task), SpeedBelief(env.pool, env.task)
    sure.start(_felt(table, 0))
    unsure.start(_felt(table, 0), np.array([17]))
    for place in range(1, len(table.speeds), 6):
        known, guessed = sure.add(_felt(table, place)), unsure.add(_felt(table, place))
    wrong = [np.mean((plan.irregular[0] > 0.5) != table.type_iii) for plan in (known, guessed)]
    assert wrong[0] < 0.5 * wrong[1]


def test_jobs_side_by_side_do_not_mix(env):
    """Two jobs together are believed as each alone; one that starts anew forgets."""
    tables = [env.pool.regimes(k)[0] for k in (3, 90)]
    both = SpeedBelief(env.pool, env.task)
    both.start(np.concatenate([_felt(table, 0) for table in tables]))
    for place in (40, 60, 61):
        together = both.add(np.concatenate([_felt(table, place) for table in tables]))
    for job, table in enumerate(tables):
        alone = SpeedBelief(env.pool, env.task)
        alone.start(_felt(table, 0))
        for place in (40, 60, 61):
            plan = alone.add(_felt(table, place))
        np.testing.assert_allclose(together.worth[job], plan.worth[0], rtol=1e-12)
    fresh = both.restart(np.array([False, True]), _felt(tables[1], 0))
    np.testing.assert_allclose(fresh.irregular, SpeedBelief(env.pool, env.task).start(_felt(tables[1], 0)).irregular)


def test_the_plan_is_dynamic_programming_on_the_expected_map(env):
    """Where every machine is the same one, the worth of the last steps is that of its own table."""

    class Copies:
        """A pool of two copies of one machine."""

        drive, nominal, levels, speeds = env.pool.drive, env.pool.nominal, env.pool.levels, env.pool.speeds

        def __len__(self):
            return 2

        def regimes(self, k):
            return env.pool.regimes(17)

    forecast = forecast_of(env.pool, env.pool.regimes(17), env.task)
    left = HORIZON // 2
    plan = SpeedBelief(Copies(), env.task).start(_felt(env.pool.regimes(17)[0], 50, left / forecast.steps))
    expected = worth_of_steps(forecast)[forecast.steps - left][0]
    place = int(plan.target[0])
    within = forecast.within_reach(50)
    assert place in within
    assert expected[place] >= expected[within].max() - 0.02 * left * env.task.type_iii_step


def test_small_corrections_of_a_plan_leave_it_as_it_is():
    """The target is the nearest speed of the map, so that a learner can keep a speed and the motion can settle."""
    view = LearnerView(gym.make(ENV, pool="held-out", job_cycles=100), memory="belief")
    view.reset(seed=3, options={"machine": 2})
    for correction in (0.1, -0.1, 0.12, -0.12, -0.3, 0.0):
        plan = float(view._memory.planned[0, 0])
        *_, info = view.step(np.array([correction], np.float32))
        assert info["speed"] == pytest.approx(plan - (0.25 if correction == -0.3 else 0.0), abs=1e-5)


def test_a_view_with_a_belief_keeps_its_space_and_follows_the_plan():
    """Observations stay within the announced bounds; an action of zero goes where the belief plans to."""
    view = LearnerView(gym.make(ENV, pool="held-out", job_cycles=100), memory="belief")
    observation, _ = view.reset(seed=3, options={"machine": 2})
    for _ in range(20):
        assert view.observation_space.contains(observation)
        planned = float(view._memory.planned[0, 0])
        observation, *_, info = view.step(np.zeros(1, np.float32))
        assert info["speed"] == pytest.approx(planned, abs=1e-5)
