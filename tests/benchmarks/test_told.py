"""A map that is told what was charged, and one that remembers the earlier jobs of its machines."""

import numpy as np

from benchmarks.envs import job_memory, risk
from benchmarks.envs.job_memory import ENV, FLEET, Keeping
from benchmarks.envs.told import MIXED, Mixed, Sensed, Told, Watched, _mixed
from chaosgym.control.controllers.controller import added, place_of, seen
from chaosgym.control.policies import TrainedPolicy, load_policy, save_policy, shipped_policy
from chaosgym.control.policies.network import Dense, Lstm, Network
from chaosgym.envs.vector_env import native_envs


def test_what_was_charged_stands_where_it_was_charged():
    """After a held step a map that is told has two thirds of the label at this speed; elsewhere nothing changes."""
    shares = {}
    for player in (Watched(), Told(), Sensed(), Mixed()):
        envs = native_envs(ENV, 2, **FLEET, **player.keywords)
        observations, _ = envs.reset(seed=[1, 2])
        player.start(envs)
        player(observations)
        held = seen(observations, "speed")[:, None].astype(np.float32)
        observations, *_ = envs.step(held)
        player.paid = np.array([1.0, 0.0])
        shares[type(player)], _ = player.predicted(observations)
        assert len(player.rows[0][0]) == 2
    every, at = np.arange(2), place_of(seen(observations, "speed"), envs.task)
    own, told = shares[Watched], shares[Told]
    np.testing.assert_allclose(told[every, at], (0.5 * own[every, at] + [1.0, 0.0]) / 1.5)
    sensed = added(observations, envs.task, "irregular_probability")
    np.testing.assert_array_equal(player.rows[0][3], sensed)
    np.testing.assert_allclose(shares[Sensed][every, at], (0.5 * own[every, at] + sensed) / 1.5)
    mixed = np.array([0.5, 0.8]), np.array([0.5, 0.1])
    odds = np.exp(MIXED[0]) * np.array([1.0, 4.0 ** MIXED[1] * (1.0 / 9.0) ** MIXED[2]])
    np.testing.assert_allclose(_mixed(*mixed), odds / (1.0 + odds))
    assert (shares[Mixed][every, at] != shares[Sensed][every, at]).all()
    others = np.ones(own.shape, np.bool_)
    others[every, at] = False
    np.testing.assert_array_equal(told[others], own[others])


def test_a_map_that_remembers_begins_where_it_ended():
    """Its second jobs begin with what was felt in the first ones, those of the map itself with nothing."""
    envs = native_envs(ENV, 2, **FLEET, action="speed")
    observations, _ = envs.reset(seed=[1, 2])
    policy = shipped_policy(ENV, "fleet")
    player = Keeping(policy)
    player.start(envs)
    assert not policy.memory.any()
    player(observations)
    felt = policy.memory
    assert felt.any()
    player.start(envs)
    np.testing.assert_array_equal(policy.memory, felt)
    policy.start(envs)
    assert not policy.memory.any()


def test_a_recurrent_policy_remembers_and_is_compared(monkeypatch, tmp_path):
    """Its state goes on into the next job, and its returns are compared as those of the map are."""
    units = 2
    gates = (
        np.ones((4 * units, 14), np.float32),
        np.ones((4 * units, units), np.float32),
        np.ones(4 * units, np.float32),
    )
    layer = Dense(np.eye(6, units, dtype=np.float32), np.zeros(6, np.float32), "none")
    save_policy(TrainedPolicy(ENV, "trim", Network(Lstm(*gates), (layer,))), tmp_path)
    envs = native_envs(ENV, 2, **FLEET)
    observations, _ = envs.reset(seed=[1, 2])
    player = Keeping(load_policy(tmp_path))
    player.start(envs)
    player(observations)
    felt = player.policy._state
    player.start(envs)
    assert player.policy._state is felt
    monkeypatch.setattr(job_memory, "FLEET", FLEET | {"steps": 6})
    assert len(job_memory.job_memory(2, 2, None, tmp_path)) == 2


def test_jobs_are_compared_in_pairs(monkeypatch, tmp_path):
    """In the first job nothing is remembered, so there is no difference; the last row is over the later jobs."""
    monkeypatch.setattr(job_memory, "FLEET", FLEET | {"steps": 6})
    first, *_, later = job_memory.job_memory(2, 3, tmp_path / "kept.jsonl")
    assert first["gain"]["more"] == 0.0
    assert later["job"] == "2 to 3"
    assert len((tmp_path / "kept.jsonl").read_text().splitlines()) == 3
    assert len(job_memory.lines([first, later])) == 4


def test_rules_are_compared_in_pairs(monkeypatch):
    """The first one is the reference, another is not it, and one that goes for no gain follows."""
    monkeypatch.setattr(risk, "FLEET", risk.FLEET | {"steps": 8})
    monkeypatch.setattr(risk, "RULES", [(False, 0.0), (True, 0.05), (False, 1e3)])
    rows = risk.risk(4)
    first, wary, never = (row["less_follow"]["more"] for row in rows)
    assert never == 0.0
    assert rows[0]["less_first"]["more"] == 0.0
    assert len({first, wary, never}) == 3
    assert len(risk.lines(rows)) == 5
