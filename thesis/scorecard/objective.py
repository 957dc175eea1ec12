r"""The distance of a candidate from the thesis: one number over all statements about its machine.

A statement that is e tolerances off costs e / (1 + e): half at the edge of a hit, less than one however wild the miss,
so that no single statement rules the search. A wrong nature adds to it: 1 - (1 - e/(1+e)) (1 - d), with d how far the
natures are from the printed ones. The objective is the mean, between 0 and 1.

The few statements of ``SCREEN`` come first, then those of single runs; a candidate that they rule out is not run over
curves, and counts what it is not run for as wholly missed. Curves and maps are thinned: a boundary is sought near where
it is printed.
"""

import math
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from thesis.scorecard.evaluation import evaluate
from thesis.scorecard.findings import Finding
from thesis.scorecard.neighbours import HASTENED, neighbour_of
from thesis.scorecard.observation import QUICK
from thesis.scorecard.verdicts import Judged, error_of
from thesis.statements import Comparison, read_comparisons
from thesis.statements.comparisons import Axis

WITHOUT_A_SLOPE = frozenset(
    (
        "irregular_cycles",
        "chaotic_cycles",
        "final_period",
        "settling",
        "irregular_settling",
        "update_transient",
        "update_test",
        "statistics_cycles",
        "longest_bouncing",
    )
)
"""Quantities that one trajectory decides, so that no search can follow them; the scorecard judges them all the same."""

SCREEN: Mapping[str, tuple[str, ...]] = {"impact-beam": ("IBS-024", "IBS-025", "IBS-026")}
"""By machine: statements of which hardly a candidate hits all, and that cost a few runs; the valley of figure 3.8."""

BEYOND = 2.0
"""Steps beyond a printed boundary up to which a quick run looks for it."""

FULL_CURVES = frozenset(("smooth_end", "chaos_begin", "periodic_end", "chaos_run", "chaos_present"))
"""Quantities whose whole curve decides; many of them share one."""


class Stages(NamedTuple):
    """Statements of a search: those that screen, other single runs, full curves, then maps and other sweeps."""

    screen: tuple[Comparison, ...]
    points: tuple[Comparison, ...]
    curves: tuple[Comparison, ...]
    maps: tuple[Comparison, ...]

    def without(self, ids: frozenset[str]) -> "Stages":
        """Return the stages without some statements."""
        return Stages(*(tuple(one for one in stage if one.id not in ids) for stage in self))

    @property
    def ids(self) -> tuple[str, ...]:
        """Names of all statements."""
        return tuple(one.id for stage in self for one in stage)


def searched_statements(machine: str, joint: str | None = None) -> Stages:
    """Statements that a search of a machine follows; of those with clearance in one ``joint`` if it is named."""
    seen = [_thinned(one) for one in statements_of(machine, joint) if one.quantity not in WITHOUT_A_SLOPE]
    screen = tuple(one for one in seen if one.id in SCREEN.get(machine, ()))
    points = tuple(one for one in seen if one.along is None and one not in screen)
    curves = tuple(one for one in seen if one.along is not None and one.quantity in FULL_CURVES)
    return Stages(screen, points, curves, tuple(one for one in seen if one not in (*screen, *points, *curves)))


def statements_of(machine: str, joint: str | None = None) -> tuple[Comparison, ...]:
    """All statements about a machine but contradictory ones; those with clearance in one ``joint`` if it is named."""
    return tuple(
        one
        for one in read_comparisons().compared
        if one.machine == machine
        and not one.contradictory
        and joint in (None, "ball" if "ball_joint" in one.at[0] else "slider")
    )


def _thinned(one: Comparison) -> Comparison:
    """The statement on shorter or coarser axes, where that leaves what is asked."""
    if one.quantity == "map_clearance" and one.across is not None and one.along is not None:
        return replace(one, across=_cut(one.across, one.printed), along=_coarse(one.along, 2))
    if one.quantity == "map_speed" and one.along is not None:
        return replace(one, along=_cut(one.along, one.printed))
    if one.quantity == "spread_trend" and one.along is not None:
        return replace(one, along=_coarse(one.along, 4))
    if one.quantity in ("resonance_speed", "largest_force") and one.along is not None:
        return replace(one, along=_coarse(one.along, 3))
    return one


def _cut(axis: Axis, printed: Any) -> Axis:
    return axis._replace(high=min(axis.high, printed * axis.unit + BEYOND * axis.step))


def _coarse(axis: Axis, times: int) -> Axis:
    count = round((axis.high - axis.low) / axis.step) // times
    return axis._replace(step=(axis.high - axis.low) / count)


def cost(judged: Judged) -> float:
    """What one statement adds to the objective, 0 to 1; the worst of its conditions counts half, their mean half."""
    costs = [_cost(judged.comparison, finding) for finding in judged.findings]
    return 0.5 * (max(costs) + float(np.mean(costs))) if costs else 1.0


def _cost(comparison: Comparison, finding: Finding) -> float:
    error = error_of(comparison, finding._replace(agrees=True))
    off = error / (1.0 + error) if math.isfinite(error) else 1.0
    deviation = finding.deviation if finding.agrees else max(finding.deviation, 0.5)
    return 1.0 - (1.0 - off) * (1.0 - deviation)


def objective(judged: Sequence[Judged]) -> float:
    """Mean cost of statements."""
    return float(np.mean([cost(one) for one in judged]))


class Objective(NamedTuple):
    """What a search makes small: the mean cost of its statements, in stages.

    With ``neighbours``, so many of them are judged instead of the machine itself. A statement that one hits costs
    nothing there, and statements about one figure share the weight of one, so that a lucky point wins nothing: the
    objective follows the misses that are to be expected.
    """

    stages: Stages
    neighbours: int = 0

    @property
    def weights(self) -> Mapping[str, float]:
        """Weight of each statement."""
        asked = [one for stage in self.stages for one in stage]
        if not self.neighbours:
            return {one.id: 1.0 for one in asked}
        figures = Counter(one.statement.figure or one.id for one in asked)
        return {one.id: 1.0 / figures[one.statement.figure or one.id] for one in asked}

    def value(self, costs: Mapping[str, float]) -> float:
        """The objective, 0 to 1, by the costs of statements; one that was not run counts as wholly missed."""
        weights = self.weights
        return sum(weight * costs.get(name, 1.0) for name, weight in weights.items()) / sum(weights.values())

    def staged_costs(
        self, machine: Machine, unprinted: Mapping[str, float], *, workers: int | None = None
    ) -> Iterator[dict[str, float]]:
        """Costs of the statements of one stage after the other, by quick runs."""
        nearby = [neighbour_of(machine, k) for k in range(self.neighbours)]
        hasty = with_settings(machine, HASTENED.get(machine.name, {}))
        for stage in filter(None, self.stages):
            if not nearby:
                judged = evaluate(stage, {hasty.name: hasty}, efforts=QUICK, workers=workers, unprinted=unprinted)
                yield {one.comparison.id: cost(one) for one in judged}
                continue
            shares = [one.judge(stage, workers=workers, unprinted=unprinted) for one in nearby]
            yield {
                same[0].comparison.id: float(np.mean([0.0 if one.verdict == "hit" else cost(one) for one in same]))
                for same in zip(*shares, strict=True)
            }
