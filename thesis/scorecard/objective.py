r"""The distance of a candidate from the thesis: one number over the statements that a calibration may see.

A statement that is e tolerances off costs e / (1 + e): half at the edge of a hit, less than one however wild the miss,
so that no single statement rules the search. A wrong nature adds to it: 1 - (1 - e/(1+e)) (1 - d), with d how far the
natures are from the printed ones. The objective is the mean, between 0 and 1.

Statements of single runs come first; a candidate that they rule out is not run over whole curves.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from thesis.scorecard.findings import Finding
from thesis.scorecard.observation import QUICK
from thesis.scorecard.scorecard import evaluate
from thesis.scorecard.verdicts import Judged, error_of
from thesis.statements import Comparison, read_comparisons


def calibration_statements(machine: str) -> tuple[tuple[Comparison, ...], ...]:
    """Statements that a calibration may see, in stages: single runs, then curves; contradictory ones left out."""
    seen = [
        one
        for one in read_comparisons().compared
        if one.machine == machine and one.part == "calibration" and not one.contradictory
    ]
    return tuple(one for one in seen if one.along is None), tuple(one for one in seen if one.along is not None)


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


HASTENED: Mapping[str, Mapping[str, Any]] = {"slider-crank": {"matrix_update_interval": 5.0}}
"""Fields by which quick runs differ from thorough ones, by machine: the thesis itself updates every 5 deg (5.2.2)."""


def staged_objective(machine: Machine, *, workers: int | None = None) -> Iterator[float]:
    """Lower bounds of the objective of quick runs, one after each stage; the last one is the objective itself."""
    machine = with_settings(machine, HASTENED.get(machine.name, {}))
    stages = calibration_statements(machine.name)
    count = sum(len(stage) for stage in stages)
    total = 0.0
    for stage in stages:
        judged = evaluate(stage, {machine.name: machine}, efforts=QUICK, workers=workers)
        total += sum(cost(one) for one in judged)
        yield total / count
