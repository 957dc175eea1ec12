"""A plan by the table is the best plan that there is, and its worth is what the plan earns."""

from itertools import product

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chaosgym.control.forecast import Forecast, constant_returns, worth_of_steps


def _forecast(reward, wear, *, moves=1, steps=3, levels=201):
    reward, wear = np.asarray(reward, dtype=float), np.asarray(wear, dtype=float)
    return Forecast(
        speeds=np.arange(len(reward), dtype=float),
        damage=np.linspace(0.0, 1.0, levels),
        time=reward,
        type_iii=np.zeros((levels, len(reward))),
        wear=np.tile(wear, (levels, 1)),
        damage_weight=1.0,
        moves=moves,
        steps=steps,
        fracture=-10.0,
    )


def _earned(forecast, plan):
    """Reward of a plan, a place for each step, from place 0 and no damage."""
    at, damage, total = 0, 0.0, 0.0
    for place in plan:
        if abs(place - at) > forecast.moves:
            return -np.inf
        at, damage = place, damage + forecast.wear[0, place]
        total += forecast.time[place] - forecast.damage_weight * forecast.wear[0, place]
        if damage >= 1.0:
            return total + forecast.fracture
    return total


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(-1.0, 0.0), min_size=4, max_size=4), st.integers(1, 3))
def test_no_plan_earns_more_than_dynamic_programming_promises(reward, moves):
    """Of all plans of a small job, the best earns what the first step is worth."""
    forecast = _forecast(reward, np.zeros(4), moves=moves)
    best = max(_earned(forecast, plan) for plan in product(range(4), repeat=3))
    promised = worth_of_steps(forecast)[0][0][forecast.within_reach(0)].max()
    assert np.isclose(promised, best)


def test_a_plan_that_would_break_the_joint_is_avoided():
    """The faster place earns more in each step, but two steps there are a fracture: the plan stays there for one."""
    forecast = _forecast([-0.5, -0.1], [0.0, 0.5], steps=3)
    best = max(_earned(forecast, plan) for plan in product(range(2), repeat=3))
    promised = worth_of_steps(forecast)[0][0].max()
    assert np.isclose(promised, best)
    assert promised > -2.0


def test_a_constant_plan_ramps_and_stays():
    """The return of each constant speed is that of going there by one place a step."""
    forecast = _forecast([-3.0, -2.0, -1.0, -5.0], [0.0, 0.1, 0.2, 0.0], steps=4)
    plans = [(0, 0, 0, 0), (1, 1, 1, 1), (1, 2, 2, 2), (1, 2, 3, 3)]
    assert np.allclose(constant_returns(forecast, 0), [_earned(forecast, plan) for plan in plans])


def test_a_constant_speed_that_breaks_the_joint_is_charged_once():
    """Fracture ends the job: its reward counts once, and nothing after it."""
    forecast = _forecast([-0.1, -0.1], [0.0, 0.6], steps=5)
    assert np.isclose(constant_returns(forecast, 0)[1], 2 * (-0.1 - 0.6) - 10.0)
