"""A table of training machines finds the clearance from what is felt, and the calm speed for it."""

import numpy as np
import pytest

from chaosgym.control.controllers import Follow, Table, learned_tables
from chaosgym.control.controllers.table import CLASSES
from chaosgym.control.rollout import play
from chaosgym.envs.vector_env import native_envs

BEAM = "chaosgym/ImpactBeamTolerance-v1"


@pytest.fixture(scope="module")
def tables():
    """Of few jobs."""
    return learned_tables(BEAM, jobs=48)


def test_the_clearance_is_found(tables):
    """The likeliest class lies within a tenth of the range of the true clearance on most machines, unlike a guess."""
    rule, machines = Table(tables), range(16)
    play(rule, BEAM, machines, steps=40)
    variants = native_envs(BEAM).settings.variants
    clearance = np.array([variants.held_out(k).clearance for k in machines])
    share = (clearance / 0.127e-3 - 0.8) / 0.4
    found = (rule._fit.argmax(axis=1) + 0.5) / CLASSES
    assert np.median(np.abs(found - share)) < 0.1


def test_it_wins_on_machines_like_those_it_saw(tables):
    """Fewer irregular cycles than following the demand, and a better return, on machines kept for evaluation."""
    rule, follow = (play(player, BEAM, range(16), steps=60) for player in (Table(tables), Follow()))
    assert rule.type_iii_share.mean() < 0.5 * follow.type_iii_share.mean()
    assert rule.returns.mean() > follow.returns.mean() + 2.0


def test_it_stays_within_reach(tables):
    """Never further from a demand than the largest trim, once the drive has got there."""
    played = play(Table(tables), BEAM, range(8))
    settled = (played.demand[2:] == played.demand[1:-1]) & (played.demand[1:-1] == played.demand[:-2])
    assert np.abs(played.speed - played.demand)[2:][settled].max() <= 2.0 + 1e-6


def test_tables_of_the_same_jobs_are_the_same():
    """Jobs have numbers of their own, so that tables can be made again."""
    for one, other in zip(*(learned_tables(BEAM, jobs=2, steps=4) for _ in range(2)), strict=True):
        np.testing.assert_array_equal(one, other)
