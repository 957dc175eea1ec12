"""Observations are addressed by name: one more entry at the end changes no job of anybody who plays without it."""

import json
from dataclasses import dataclass
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest

from chaosgym.control.controllers import (
    BackOff,
    Bandit,
    Belief,
    BestFelt,
    CommonSchedule,
    ConstantTrim,
    Follow,
    Kriging,
    MapFollower,
    RecedingHorizon,
    Schedule,
    SkipBands,
    Table,
)
from chaosgym.control.controllers.table import CLASSES, LearnedTables
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.maps import Maps
from chaosgym.control.policies import TrainedPolicy, load_policy, save_policy, shipped_policy
from chaosgym.control.policies.network import Dense, Network
from chaosgym.control.rollout import play
from chaosgym.envs.entries import Entry, adds
from chaosgym.envs.memory import SpeedMemory, VisitedSpeeds
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.task import Task
from chaosgym.errors import ModelFileError

BEAM = "chaosgym/ImpactBeamTolerance-v1"
GRID = Task().grid


class Smallest(Entry):
    """The least measured peak of a step."""

    name, meaning = "min_peak_force", "the least of the measured peaks [N]"

    @staticmethod
    def bounds(task):
        """Those of any force."""
        return 0.0, 5.0 * task.reference_force

    def values(self, which, peaks, jobs, seen):
        """Least peak of each."""
        return peaks.min(axis=1)


@dataclass(frozen=True, kw_only=True)
class WiderTask(Task):
    """A task with one more entry, which follows the classifier's."""

    smallest: str = adds(Smallest, "whether the least peak is observed too")


@pytest.fixture(autouse=True)
def wider(monkeypatch):
    """All environments have the wider task."""
    monkeypatch.setattr("chaosgym.envs.levels.Task", WiderTask)


def _maps():
    share = np.clip(np.sin(0.7 * GRID) + np.array([[0.0], [0.2], [0.4]]), 0.0, 1.0)
    return Maps(GRID, share, 40.0 + 2.0 * GRID + 0.0 * share)


def _tables():
    shape = (len(GRID), CLASSES)
    share = np.tile(_maps().share[:1].T, shape[1])
    mean = np.broadcast_to(np.linspace(0.0, 4.0, CLASSES)[:, None], (*shape, 5))
    return LearnedTables(share, 50.0 + 0.0 * share, mean, np.ones((*shape, 5)))


def _policy(**changes):
    """A linear policy of seeded weights."""
    names = changes.get("observes", OBSERVATION_NAMES)
    weight = np.random.default_rng(0).normal(size=(6, len(names))).astype(np.float32)
    return TrainedPolicy(BEAM, "trim", Network(None, (Dense(weight, np.zeros(6, np.float32), "none"),)), **changes)


SEES_THE_CLASSIFIER = (*OBSERVATION_NAMES[::-1], "irregular_probability")
PLAYERS = {
    "follow": Follow,
    "back off": BackOff,
    "back off by the classifier": lambda: BackOff(classified=True),
    "best felt": BestFelt,
    "bandit": lambda: Bandit(_maps()),
    "belief": lambda: Belief(_maps()),
    "constant trim": lambda: ConstantTrim(_maps()),
    "skip bands": lambda: SkipBands(_maps()),
    "own map": lambda: MapFollower([_maps()]),
    "schedule": lambda: Schedule([_maps()]),
    "common schedule": lambda: CommonSchedule(_maps()),
    "looking ahead": RecedingHorizon,
    "kriging": Kriging,
    "table": lambda: Table(_tables()),
    "trained": _policy,
    "trained, sees the classifier": lambda: _policy(observes=SEES_THE_CLASSIFIER),
    "shipped": lambda: shipped_policy(BEAM),
    "learned map": lambda: shipped_policy(BEAM, "fleet"),
    "guarded map": lambda: GuardedPolicy(shipped_policy(BEAM, "fleet")),
}


@pytest.mark.parametrize("name", PLAYERS)
def test_an_entry_at_the_end_changes_no_job(name):
    """Speeds, verdicts of the judge, sensors and rewards of twelve steps are the same to the bit."""
    keywords = {"steps": 12, "monitor": "on", "classifier": "on", "shortest_hold": 4, "longest_hold": 6}
    machines = range(3)
    plain = play(PLAYERS[name](), BEAM, machines, **keywords)
    wider = play(PLAYERS[name](), BEAM, machines, **keywords, smallest="on")
    for what in ("speed", "type_iii", "felt", "reward", "damage"):
        np.testing.assert_array_equal(getattr(wider, what), getattr(plain, what), err_msg=what)


def test_the_entry_is_the_last_one_and_within_its_bounds():
    """It follows the classifier's, lies between nothing and the mean peak, and the others keep their values."""
    rows = []
    for keywords in ({}, {"smallest": "on"}):
        env = gym.make(BEAM, monitor="on", classifier="on", **keywords)
        observation, _ = env.reset(seed=2)
        assert observation in env.observation_space
        rows.append(dict(zip(env.unwrapped.observation_names, observation.tolist(), strict=True)))
    assert tuple(rows[1])[-2:] == ("irregular_probability", "min_peak_force")
    assert 0.0 < rows[1].pop("min_peak_force") < rows[1]["mean_peak_force"]
    assert rows[0] == rows[1]


def test_what_is_remembered_follows_all_entries():
    """A memory of visited speeds has the same values under the same names, whatever else is observed."""
    rows = []
    for keywords in ({}, {"classifier": "on", "smallest": "on"}):
        env = VisitedSpeeds(gym.make(BEAM, **keywords))
        env.reset(seed=2)
        for action in (0, 2, 4):
            observation, *_ = env.step(action)
        assert env.observation_space.contains(observation)
        rows.append(dict(zip(env.observation_names, observation.tolist(), strict=True)))
    names = SpeedMemory.names()
    assert [rows[0][name] for name in names] == [rows[1][name] for name in names]
    assert sum(rows[0][name] != 0.0 for name in names) > len(names) / 4


def test_a_controller_adds_what_the_motor_slipped():
    """The set-point is read by its name: following a demand of 20 from 3 below a set-point asks for 23."""
    task = WiderTask(drive="motor", classifier="on", smallest="on")
    controller = Follow()
    controller.start(SimpleNamespace(task=task, num_envs=1))
    row = dict.fromkeys(task.places, -1.0) | {"mean_peak_force": 80.0, "demand": 20.0, "speed": 17.0, "set_point": 20.0}
    assert controller(np.array([[row[name] for name in task.places]], np.float32)) == 23.0


def test_a_policy_sees_the_entry_that_it_names():
    """One that sees the classifier's answer alone goes back to the demand where that is above a half, else it holds."""
    bias = np.array([0.5, -1.0, -1.0, -1.0, -1.0, 0.0], np.float32)
    layer = Dense(np.eye(6, dtype=np.float32)[:, 5:], bias, "none")
    policy = TrainedPolicy(BEAM, "trim", Network(None, (layer,)), observes=("irregular_probability",))
    task = WiderTask(monitor="on", classifier="on", smallest="on")
    policy.begin(task, 50)
    observations = np.random.default_rng(1).uniform(0.0, 1.0, (50, len(task.places))).astype(np.float32)
    irregular = observations[:, list(task.places).index("irregular_probability")] > 0.5
    assert policy(observations).tolist() == np.where(irregular, 5, 0).tolist()


def test_a_policy_that_sees_no_motor_sets_none():
    """Of a motor the set-point is not the speed: a policy that does not see it is refused."""
    with pytest.raises(ModelFileError, match="does not see the set_point of a motor"):
        _policy().begin(Task(drive="motor"), 1)


def test_a_stored_policy_keeps_the_names_of_what_it_sees(tmp_path):
    """Read back it asks for the classifier; a file of keywords instead of names means their entries."""
    policy = _policy(observes=SEES_THE_CLASSIFIER)
    save_policy(policy, tmp_path)
    assert load_policy(tmp_path).observes == SEES_THE_CLASSIFIER
    assert load_policy(tmp_path).keywords == {"action": "trim", "classifier": "on"}
    file = tmp_path / "policy.json"
    text = json.loads(file.read_text())
    del text["observes"]
    file.write_text(json.dumps(text | {"asked": ["classifier"]}))
    assert load_policy(tmp_path).observes == (*OBSERVATION_NAMES, "irregular_probability")
