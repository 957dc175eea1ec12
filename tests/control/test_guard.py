"""A guard asks a policy where readings are as likely as in its training, and follows the demand elsewhere."""

import json
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import chaosgym
from benchmarks.envs.mismatch import ENV, ROWS, Flawed, lines, mismatch, second_harmonic
from chaosgym.control.controllers import BackOff, Follow
from chaosgym.control.evaluation import policy_of
from chaosgym.control.guard import LEAST_GAIN, GuardedPolicy
from chaosgym.control.policies import TrainedPolicy, shipped_policy
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.policies.shipped import shipped_folder
from chaosgym.control.rollout import play
from chaosgym.control.scores import difference
from chaosgym.control.statistics import paired_difference
from chaosgym.errors import ParameterError
from chaosgym.machines.impact_beam import ImpactBeam
from tests.cli.run import run, run_json

CRANK = "chaosgym/SliderCrankTolerance-v1"
SEEDS = range(24_000_000, 24_000_008)


class Stubborn:
    """A learned map that asks for the largest trim at every step."""

    def __new__(cls):
        """The shipped map with another answer."""
        policy = shipped_policy(ENV)
        policy.speeds = lambda observations: 9.0 + observations[:, 1].astype(float)
        return policy


def test_machines_of_training_are_trusted():
    """On machines like those of training the guard is the policy, but for the first two steps at the demand."""
    guard = GuardedPolicy(shipped_policy(ENV))
    guarded, shipped, follow = (play(one, ENV, seeds=SEEDS) for one in (guard, shipped_policy(ENV), Follow()))
    assert guard.trusted.all()
    np.testing.assert_array_equal(guarded.speed[:2], follow.speed[:2])
    same = (guarded.speed[2:] == shipped.speed[2:]).mean()
    assert same > 0.8
    assert abs(guarded.returns.mean() - shipped.returns.mean()) < 0.2 * (shipped.returns - follow.returns).mean()


@pytest.mark.parametrize("changed", [{"damping_ratio": 0.02}, {"damping_ratio": 0.005}])
def test_foreign_machines_are_followed(changed):
    """With structural damping doubled or halved all are found foreign within ten steps; the demand is followed."""
    guard = GuardedPolicy(shipped_policy(ENV), fleet=False)
    guarded, follow = (play(one, ENV, seeds=SEEDS[:4], **changed) for one in (guard, Follow()))
    assert not guard.trusted.any()
    assert guard.followed.all()
    assert guard.statement() == "this machine is foreign to the policy, so its guard followed the demand"
    np.testing.assert_array_equal(guarded.speed[14:], follow.speed[14:])
    assert guarded.returns.mean() > follow.returns.mean() - 1.0


def test_the_map_of_the_fleet_plays_where_the_policy_is_not_asked():
    """With half of the structural damping it wins over following; it is the shipped map with its least gain."""
    light = {"damping_ratio": 0.005}
    guard = GuardedPolicy(shipped_policy(ENV))
    guarded, follow = (play(one, ENV, seeds=SEEDS, **light) for one in (guard, Follow()))
    assert not guard.trusted.any()
    assert not guard.followed.any()
    assert guard.statement() == "this machine is foreign to the policy, so its guard asked the shipped map of the fleet"
    assert guarded.returns.mean() > follow.returns.mean() + 2.0
    fleet = GuardedPolicy(replace(shipped_policy(ENV, "fleet"), least_gain=LEAST_GAIN, wary=False))
    alone = play(fleet, ENV, seeds=SEEDS, **light)
    assert (alone.speed[30:] == guarded.speed[30:]).mean() > 0.8
    assert not fleet.followed.any()


def test_a_map_leaves_the_demand_for_a_gain_alone():
    """One that must win more than a step can cost follows."""
    timid = replace(shipped_policy(ENV), least_gain=1e3)
    short = {"steps": 30}
    one, other = (play(each, ENV, range(4), **short) for each in (timid, Follow()))
    np.testing.assert_array_equal(one.speed, other.speed)


def test_a_policy_with_a_memory_is_guarded():
    """The PPO of the crank knows what is usual by its memory, and nine in ten of its machines are trusted."""
    guard = GuardedPolicy(shipped_policy(CRANK))
    play(guard, CRANK, seeds=range(24_000_000, 24_000_012), steps=20)
    assert guard.trusted.mean() > 0.9


def test_it_stays_in_the_band():
    """A policy that always asks for more is held at the largest trim."""
    guard = GuardedPolicy(Stubborn(), unlikely=1e9)
    played = play(guard, ENV, range(8), largest_trim=1.0, steps=60)
    off = np.abs(played.speed - played.demand)
    settled = (played.demand[2:] == played.demand[1:-1]) & (played.demand[1:-1] == played.demand[:-2])
    assert off[2:][settled].max() == pytest.approx(1.0)


def test_a_lost_reading_is_not_unlikely():
    """One reading in ten that is no number, or zero, makes no machine of training foreign."""
    for flaw in ("NaN", "zero"):
        guard = GuardedPolicy(shipped_policy(ENV))
        play(Flawed(guard, flaw), ENV, seeds=SEEDS, steps=60)
        assert guard.trusted.all()


def test_jobs_are_kept_and_make_the_table(tmp_path, monkeypatch):
    """More machines are added to those of a file, none is played twice, and a row is the same however it was played."""
    kept, short = tmp_path / "kept.jsonl", {"steps": 12}
    monkeypatch.setattr("benchmarks.envs.mismatch.ROWS", {"a": short, "b": short | {"flaw": "lag"}})
    first = mismatch(2, ["a"], kept)
    assert mismatch(2, ["a"], kept) == first
    both = mismatch(4, ["a", "b"], kept)
    told = [json.loads(line) for line in kept.read_text().splitlines()]
    assert [(part["row"], part["first"], len(part["follow"])) for part in told] == [
        ("a", 0, 2),
        ("a", 2, 2),
        ("b", 0, 4),
    ]
    assert both[0] == mismatch(4, ["a"], tmp_path / "other.jsonl")[0]
    assert len(lines(both)) == 4


@pytest.mark.parametrize("flaw", sorted({row["flaw"] for row in ROWS.values() if "flaw" in row} - {"second harmonic"}))
def test_flaws_are_what_they_are_called(flaw):
    """Of readings alone or of the drive alone, and the same for every policy."""

    class Seen(Follow):
        def speeds(self, observations):
            """The demand."""
            self.seen = observations
            return super().speeds(observations)

    policy = Seen()
    whole, bad = play(Follow(), ENV, range(4), steps=12), play(Flawed(policy, flaw), ENV, range(4), steps=12)
    if flaw in ("lag", "top"):
        assert (bad.speed != whole.speed).any()
        assert flaw == "lag" or bad.speed.max() <= 20.0
    else:
        np.testing.assert_array_equal(bad.speed, whole.speed)
        felt, told = whole.felt[-2], policy.seen[:, 6:]
        changed = (felt != told).any(axis=1)
        assert changed.all() if flaw.startswith(("gain", "noise", "late")) else not changed.all()


def test_a_second_harmonic_drives_the_beam():
    """Twice a cycle, with a fifth of the force; the speeds are the same and the peaks are not."""
    plain = ImpactBeam(clearance=1.0).flexible.drive
    with second_harmonic():
        both = ImpactBeam(clearance=1.0).flexible.drive
    assert both.shape == (2, *plain.shape[1:])
    np.testing.assert_allclose(both, [plain[0], 0.2 * plain[0]])
    follow = play(Follow(), ENV, range(2), steps=12)
    with second_harmonic():
        driven = play(Follow(), ENV, range(2), steps=12)
    np.testing.assert_array_equal(driven.speed, follow.speed)
    assert (driven.column("mean_peak_force") != follow.column("mean_peak_force")).all()


def test_differences_are_paired():
    """Every machine worse by 2: the interval has no width, and all are made worse."""
    backed = np.linspace(-30.0, 0.0, 12)
    told = paired_difference(backed - 2.0, backed, 1.0)
    assert told["interval"] == pytest.approx([-2.0, -2.0])
    assert told["made_worse"] == 1.0
    assert difference(told) == "**-2.0 (-2.0 to -2.0)**"
    assert difference(paired_difference(backed, backed, 1.0)) == "+0.0 (0.0 to 0.0)"


@pytest.mark.parametrize("policy", [BackOff(), policy_of(lambda observation: 0)])
def test_what_it_can_not_guard_is_refused(policy):
    """A rule that was not trained, and a function: neither knows what is usual."""
    with pytest.raises(ParameterError, match="can't be guarded; allowed: a learned map"):
        GuardedPolicy(policy)


def test_a_policy_without_a_memory_is_refused():
    """It does not know what is usual; at a machine it plays alone, and that is said."""
    layer = Dense(np.zeros((6, 14), np.float32), np.zeros(6, np.float32), "none")
    policy = TrainedPolicy(ENV, "trim", Network(None, (layer,)))
    with pytest.raises(ParameterError, match="TrainedPolicy can't be guarded"):
        GuardedPolicy(policy)
    with pytest.warns(UserWarning, match="does not tell whether a machine is foreign"):
        assert chaosgym.Operator(policy, ENV).foreign is None


def test_an_evaluation_guards_if_asked():
    """It plays what the guard plays, which follows until the speed has settled, and not what the policy plays."""
    short = {"steps": 20}
    alone, behind = (
        chaosgym.evaluate(shipped_policy(ENV), ENV, machines=2, guard=one, **short) for one in (False, True)
    )
    guard = play(GuardedPolicy(shipped_policy(ENV)), ENV, range(2), **short)
    np.testing.assert_array_equal(behind.played.speed, guard.speed)
    assert (alone.played.speed != guard.speed).any()


def test_a_trained_policy_at_a_foreign_plant_follows(tmp_path, monkeypatch):
    """``run-agent --plant`` guards it, and says that the machine is foreign to it."""
    (tmp_path / "other.py").write_text(
        "class Rig:\n"
        " def reset(self): pass\n"
        " def run(self, speed, cycles):\n"
        "  return {'peaks': [200.0 + 40.0 * (k % 3) for k in range(cycles)], 'impacts': 2.0, 'bouncing': 0.1}\n"
    )
    monkeypatch.chdir(tmp_path)
    folder = shipped_folder(ENV, "fleet")
    ask = ("run-agent", ENV, "--plant", "other:Rig", "--policy", folder, "--memory", tmp_path / "memory.npz")
    told = run_json(*ask)
    assert (tmp_path / "memory.npz").is_file()
    assert told["agent"] == "LearnedMap"
    assert told["foreign"] is True
    assert told["speed"] == told["follow"]["speed"]
    assert "foreign to the policy" in run(*ask)[1]


def test_an_environment_that_was_made_is_no_id():
    """It is how other libraries are asked; here machines are made of the id, one after the other."""
    with pytest.raises(ParameterError, match="env is no id; give one such as"):
        chaosgym.evaluate(lambda observation: 0, gym.make("chaosgym/ImpactBeam-v1"))
