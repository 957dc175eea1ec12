import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from chaosgym.branches.bifurcation_diagram import SweepPoint
from chaosgym.branches.diagram_search import follow
from chaosgym.branches.route_to_chaos import (
    _intermittent,
    feigenbaum_ratios,
    laminar_phases,
    routes_in_sweep,
    routes_to_chaos,
)
from chaosgym.machines.parameters import with_settings
from chaosgym.series.section_shape import section_shape
from chaosgym.simulation import simulate
from tests.branches.test_branch import SOFT
from tests.plain_modes import HARD_BEAM


def logistic(times):
    """States of x <- r x (1 - x), one in some steps, at r from a state."""

    def states(r, state, steps):
        x, found = 0.3 if state is None else float(state[0]), []
        for _ in range(steps):
            found.append([x])
            for _ in range(times):
                x = r * x * (1.0 - x)
        return np.array(found)

    return states


def test_the_window_of_period_3_of_the_logistic_map_opens_by_intermittency():
    """At r = 1 + sqrt(8) three cycles fold away; below, phases near them are 4 times as long at a 16th of the distance.

    Pomeau and Manneville (1980): their length grows as the distance to the power -1/2.
    """
    fold = 1.0 + math.sqrt(8.0)
    orbit = logistic(3)(fold + 1e-9, None, 100_000)[-1]
    for chaotic in (3.82, 3.825):
        route, because = _intermittent(laminar_phases(logistic(3), orbit, fold, chaotic), "fold")
        assert route == "intermittency", because


def test_a_jump_to_another_motion_is_no_intermittency():
    """x <- x + 0.01 (r + x^2 - x^4) runs away from the fold at r = 0 and never comes back."""

    def states(r, state, steps):
        x, found = 0.0 if state is None else float(state[0]), []
        for _ in range(steps):
            found.append([x])
            x += 0.01 * (r + x**2 - x**4)
        return np.array(found)

    assert _intermittent(laminar_phases(states, np.zeros(1), 0.0, 1.0), "fold")[0] == "not told"


def test_flips_of_the_logistic_map_have_the_ratios_of_feigenbaum():
    """3, 1 + sqrt(6), 3.5440904, 3.5644073, 3.5687594: the last ratio is 4.669 to a thousandth."""
    ratios = feigenbaum_ratios([3.0, 1.0 + math.sqrt(6.0), 3.5440903596, 3.5644072661, 3.5687594195])
    assert ratios[-1] == pytest.approx(4.669, abs=1e-3)


def test_an_impact_oscillator_becomes_chaotic_by_doubling():
    """Five flips of the soft stop, whose distances shrink towards 4.669; motions between them have these periods."""
    diagram = follow(SOFT, "speed", (0.3855, 0.389), sweep=3, workers=1, longest_period=96)
    flips = sorted((one.value, one.period) for one in diagram.bifurcations if one.kind == "flip" and not one.ends)
    assert [period for _, period in flips] == [6, 12, 24, 48, 96]
    assert feigenbaum_ratios([value for value, _ in flips])[-1] == pytest.approx(4.669, rel=0.03)
    for (low, period), (high, _) in pairwise(flips[:4]):
        machine = with_settings(SOFT, {"speed": 0.5 * (low + high)})
        states = simulate(machine, 96, transient=4000).section
        assert np.max(np.abs(states[2 * period :] - states[: -2 * period])) < 1e-6
        assert np.max(np.abs(states[period:] - states[:-period])) > 1e-3
    (onset,) = routes_to_chaos(diagram)
    assert onset.route == "period doubling"


def test_a_sweep_is_asked_between_its_neighbours_only():
    """The soft stop doubles its period from 0.3855 on and is chaotic at 0.389: a calm pair before adds nothing."""
    onsets, crises = routes_in_sweep(SOFT, "speed", (0.385, 0.3855, 0.389), ("periodic", "periodic", "chaotic"))
    assert [(one.periodic, one.chaotic, one.route) for one in onsets] == [(0.3855, 0.389, "period doubling")]
    assert crises == ()


def test_a_torus_is_told_where_the_motion_beyond_is_one():
    """Hard pivot, 30 Hz, from +-0.2 mm down: beyond the Neimark-Sacker bifurcation at 0.1976 mm states fill a curve.

    Were the motion chaotic there, the same bifurcation would tell no route.
    """
    diagram = follow(HARD_BEAM, "clearance", (0.18e-3, 0.2e-3), sweep=2, workers=1, most_unstable=10.0)
    first, last = diagram.sweep
    object.__setattr__(diagram, "sweep", (SweepPoint(first.value, "chaotic", None, first.peaks, first.state), last))
    (onset,) = routes_to_chaos(diagram)
    assert onset.route == "torus"
    near = simulate(replace(HARD_BEAM, clearance=0.1974e-3), 2000, transient=2000)
    assert section_shape(near.section) == "closed curve"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("chaosgym.branches.route_to_chaos._nature_beyond", lambda *_: "chaotic")
        assert [one.route for one in routes_to_chaos(diagram)] == ["not told"]


def test_what_is_beside_a_stable_motion_is_not_told():
    """Chaos next to a periodic point whose branch stays stable up to there and beyond has another origin."""
    diagram = follow(SOFT, "speed", (0.445, 0.45), sweep=2, workers=1)
    first, last = diagram.sweep
    strange = SweepPoint(last.value, "chaotic", None, last.peaks, last.state)
    object.__setattr__(diagram, "sweep", (first, strange))
    (onset,) = routes_to_chaos(diagram)
    assert (onset.route, onset.periodic, onset.chaotic) == ("not told", 0.445, 0.45)
