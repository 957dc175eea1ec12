"""A guard asks a policy where the demand is irregular, and backs off where the policy is wrong."""

import numpy as np
import pytest

from benchmarks.envs.mismatch import ENV, lines, mismatch
from chaosgym.control.controllers import BackOff, Follow
from chaosgym.control.evaluation import policy_of
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.policies import TrainedPolicy, shipped_policy
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.rollout import play
from chaosgym.control.scores import difference
from chaosgym.control.statistics import paired_difference
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.errors import ParameterError

NOISE_FREE = {"sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0}


class Stubborn:
    """Asks for the same move at every step."""

    knows, keywords = "nothing", {"action": "trim"}

    def __init__(self, action):
        self.action = action

    def begin(self, task, count):
        """Begin jobs."""
        self.count = count

    def __call__(self, observations):
        """The move."""
        return np.full(self.count, self.action)


def test_a_calm_demand_is_not_left():
    """On a machine whose demand is calm whatever the policy asks for, the guard follows the demand."""
    given = {"clearance": 0.06e-3, "tolerances": {}, "lowest_demand": 14.0, "highest_demand": 16.0, "steps": 60}
    follow = play(Follow(), ENV, seeds=[1, 2, 3], **given)
    assert follow.type_iii.max() == 0.0
    for action in (1, 4):
        guarded = play(GuardedPolicy(Stubborn(action)), ENV, seeds=[1, 2, 3], **given)
        np.testing.assert_array_equal(guarded.speed, follow.speed)


def test_it_stays_in_the_band():
    """A policy that always asks for more is held at the largest trim."""
    guard = GuardedPolicy(Stubborn(4), strikes=10**6)
    played = play(guard, ENV, range(24), largest_trim=1.0, steps=60)
    off = np.abs(played.speed - played.demand)
    settled = (played.demand[2:] == played.demand[1:-1]) & (played.demand[1:-1] == played.demand[:-2])
    assert off[2:][settled].max() == pytest.approx(1.0)


def test_a_controller_is_guarded_too():
    """One that asks for the demand alone, guarded, follows it until it is distrusted."""
    guard = GuardedPolicy(Follow(), strikes=10**6)
    guarded, follow = (play(player, ENV, range(6), steps=40) for player in (guard, Follow()))
    np.testing.assert_array_equal(guarded.speed, follow.speed)


def test_who_was_wrong_is_not_asked_again():
    """A policy that holds irregular demands is distrusted, and what follows is at least near backing off."""
    machines = range(24)
    guard = GuardedPolicy(Stubborn(0))
    guarded, follow, backed = (play(player, ENV, machines) for player in (guard, Follow(), BackOff()))
    assert 0.0 < 1.0 - guard.trusted.mean() < 1.0
    np.testing.assert_array_equal(guarded.returns[guard.trusted], follow.returns[guard.trusted])
    assert guarded.returns.mean() > 0.5 * (follow.returns + backed.returns).mean()


def test_a_harmful_policy_is_kept_from_harm(monkeypatch):
    """With structural damping doubled a policy that stays 0.5 Hz off loses to following; guarded it does not."""
    weight, bias = np.zeros((6, 14), np.float32), np.zeros(6, np.float32)
    bias[0], bias[4] = 0.5, 0.75  # stay, two steps up
    weight[4, OBSERVATION_NAMES.index("trim")] = -1.0
    off = TrainedPolicy(ENV, "trim", Network(None, (Dense(weight, bias, "none"),)))
    monkeypatch.setattr("benchmarks.envs.mismatch.shipped_policy", lambda *_: off)
    found = mismatch(32, ["structural damping x2"])[0]
    returns = found["returns"]
    assert returns["shipped"] < returns["follow"] - 5.0
    assert returns["guarded"] > returns["follow"] - 1.0
    assert (
        found["shipped"]["against_back_off"]["interval"][1] < 0.0 < found["guarded"]["against_back_off"]["interval"][1]
    )
    assert lines([found])[-1].count("**") == 2


def test_differences_are_paired():
    """Every machine worse by 2: the interval has no width, and all are made worse."""
    backed = np.linspace(-30.0, 0.0, 12)
    told = paired_difference(backed - 2.0, backed, 1.0)
    assert told["interval"] == pytest.approx([-2.0, -2.0])
    assert told["made_worse"] == 1.0
    assert difference(told) == "**-2.0 (-2.0 to -2.0)**"
    assert difference(paired_difference(backed, backed, 1.0)) == "+0.0 (0.0 to 0.0)"


def test_what_it_can_not_guard_is_refused():
    """A function, which may do anything, and an objective in which irregular motion costs nothing."""
    with pytest.raises(ParameterError, match="_Function can't be guarded"):
        play(GuardedPolicy(policy_of(lambda observation: 0)), ENV, [0], steps=2)
    with pytest.raises(ParameterError, match="a guard goes by irregular motion"):
        play(GuardedPolicy(shipped_policy(ENV)), ENV, [0], objective="life", steps=2)


def test_a_guard_asks_for_what_its_policy_observes():
    """A policy that looks at the classifier is given it behind a guard too, in jobs and by an operator."""
    inner = BackOff(classified=True)
    guarded = GuardedPolicy(inner)
    assert guarded.keywords == inner.keywords == {"action": "speed", "classifier": "on"}
    assert play(guarded, ENV, [3], steps=4).speed.shape == (4, 1)
    assert GuardedPolicy(shipped_policy(ENV)).keywords["action"] == "speed"
