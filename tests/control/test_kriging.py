"""Kriging learns the load over speed of a machine within its job, and goes where life is longest for the distance."""

import numpy as np
import pytest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import ConstantKernel, DotProduct, Matern, WhiteKernel

from chaosgym.control.controllers import Follow, Kriging, MapFollower
from chaosgym.control.controllers.kriging import CONSTANT, HORIZON, POWER, _values
from chaosgym.control.maps import maps_of
from chaosgym.control.rollout import play
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.task import Task

BEAM = "chaosgym/ImpactBeamTolerance-v1"


class Envs:
    """What a controller asks of a vector environment."""

    def __init__(self, count, **fields):
        self.task, self.num_envs = Task(**fields), count


def observation(speed, demand, force):
    """Observations (n, 14) that tell speed, demand and mean peak force."""
    seen = np.zeros((np.size(speed), 14), np.float32)
    for name, value in (("speed", speed), ("demand", demand), ("mean_peak_force", force)):
        seen[:, OBSERVATION_NAMES.index(name)] = value
    return seen


def test_estimates_are_those_of_scikit_learn():
    """Mean and deviation at every speed, by another program, with the length, size and error that were chosen."""
    rule, rng = Kriging(), np.random.default_rng(3)
    rule.start(Envs(1))
    grid = rule.task.grid
    at = rng.choice(len(grid), 12, replace=False)
    force = 80.0 * (grid[at] / 20.0) ** 1.3 * np.exp(rng.normal(0.0, 0.1, 12))
    for place, felt in zip(at, force, strict=True):
        rule.speeds(observation(grid[place], 20.0, felt))
    mean, deviation = rule.estimate()
    prior = rule._chosen[0]
    u = np.log(grid / grid[0])[:, None]
    share = (grid / (grid[-1] - grid[0]))[:, None]
    smooth = CONSTANT**2 + POWER**2 * u @ u.T
    size = np.sqrt(prior.covariance[0, 0] - smooth[0, 0])
    length = -(share[1, 0] - share[0, 0]) / np.log((prior.covariance[0, 1] - smooth[0, 1]) / size**2)

    def columns(kernel, place):
        """A kernel of one column of two."""

        class Column(type(kernel)):
            def __call__(self, X, Y=None, eval_gradient=False):
                return super().__call__(X[:, [place]], None if Y is None else Y[:, [place]])

            def diag(self, X):
                return super().diag(X[:, [place]])

        kernel.__class__ = Column
        return kernel

    kernel = (
        ConstantKernel(CONSTANT**2)
        + ConstantKernel(POWER**2) * columns(DotProduct(1e-9), 0)
        + ConstantKernel(size**2) * columns(Matern(length, nu=0.5), 1)
        + WhiteKernel(prior.error**2)
    )
    both = np.hstack([u, share])
    y = np.log(np.float32(force)).astype(float)
    other = GaussianProcessRegressor(kernel, optimizer=None, alpha=0.0).fit(both[at], y - y.mean())
    expected, spread = other.predict(both, return_std=True)
    assert mean[0] == pytest.approx(expected + y.mean(), abs=1e-5)
    assert deviation[0] == pytest.approx(np.sqrt(np.maximum(spread**2 - prior.error**2, 0.0)), abs=1e-4)


def test_a_known_resonance_is_left_as_far_as_it_pays():
    """Load has a peak at the demand; the rule stands off to the better side, within reach, and further for more."""

    def load(speed):
        return 50.0 * (1.0 + 2.0 * np.exp(-0.5 * ((speed - 24.0) / 1.0) ** 2)) * (speed / 24.0)

    distances = []
    for price in (0.02, 2.0 / 3.0):
        rule = Kriging(price=price)
        rule.start(Envs(1))
        speed = 22.0
        for _ in range(60):
            speed = float(rule.speeds(observation(speed, 24.0, load(speed)))[0])
        distances.append(abs(speed - 24.0))
        assert speed <= 24.0
    assert distances[0] < distances[1] <= rule.task.largest_trim + 1e-9


def test_life_is_won_on_fresh_beams():
    """Under the objective of life it returns more than following, and less than the machine's own map of load."""
    seeds = range(51_000, 51_004)
    follow, rule = (play(one, BEAM, seeds=seeds, objective="life") for one in (Follow(), Kriging()))
    own = play(MapFollower([maps_of(BEAM, seeds=seeds)]), BEAM, seeds=seeds, objective="life")
    assert np.log(follow.damage / rule.damage).mean() > np.log(1.1)
    assert follow.returns.mean() < rule.returns.mean() < own.returns.mean()


def test_what_a_try_may_save_is_that_of_many_draws():
    """Expected cost and expected improvement of log-normal costs, by drawing them."""
    rng = np.random.default_rng(0)
    distance, log_price, deviation = np.array([0.0, 0.1, 0.2]), np.array([-0.4, -1.0, -0.2]), np.array([0.1, 0.6, 1.2])
    expected, value = _values(distance[None], log_price[None], deviation[None], np.zeros((1, 3), bool))
    costs = distance + np.exp(log_price + deviation * rng.standard_normal((400_000, 3)))
    saved = np.maximum(costs.mean(axis=0).min() - costs, 0.0).mean(axis=0)
    assert expected[0] == pytest.approx(costs.mean(axis=0), rel=0.01)
    assert value[0] == pytest.approx(costs.mean(axis=0) - HORIZON * saved, abs=0.06)


def test_the_demand_is_felt_before_it_is_left():
    """Four beams: the first step is at the demand; later ones are not."""
    played = play(Kriging(), BEAM, seeds=range(52_000, 52_004), objective="life")
    first = np.abs(played.speed[0] - played.demand[0])
    assert first.max() < 1e-4
    assert np.abs(played.speed - played.demand)[6:].mean() > 0.2


def test_life_without_a_price_is_not_played_for():
    """The task's own price under the objective irregular is next to nothing: all speeds are those demanded."""
    seeds = range(53_000, 53_002)
    rule, follow = (play(one, BEAM, seeds=seeds) for one in (Kriging(price=None), Follow()))
    np.testing.assert_array_equal(rule.speed, follow.speed)


def test_a_sensor_that_tells_nothing_holds_nobody():
    """Forces of zero, and a speed that was never felt, give finite speeds of the grid."""
    rule = Kriging()
    rule.start(Envs(2))
    speeds = rule.speeds(observation([16.0, 30.0], [18.0, 29.0], [0.0, 0.0]))
    assert np.isfinite(speeds).all()
    assert set(speeds) <= set(rule.task.grid)
