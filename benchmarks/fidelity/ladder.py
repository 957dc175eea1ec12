"""Error against cost of every model of a machine's ladder, over random machines of its kind.

Errors are those of the mean peak force of settled cycles against the rung ``reference``, at points where both motions
are periodic with the same period; cost is processor time of a cycle there.
"""

import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from benchmarks.fidelity.accuracy import CYCLES, TRANSIENT, machine_of
from chaosgym.errors import ChaosgymError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings
from chaosgym.series.two_step import two_step_test
from chaosgym.simulation import simulate

MOST_SECONDS = 0.05
"""Processor time of a cycle of the reference beyond which a machine is left out."""


class Settled(NamedTuple):
    """What a model finds at a point: nature with period, mean peak force [N], and microseconds a cycle."""

    nature: tuple[str, int | None]
    peak: float
    microseconds: float


def models_of(machine: Machine) -> dict[str, Machine]:
    """Every rung by its name, and every other model that a tolerance may choose by its numbers."""
    rungs = {rung: with_settings(machine, {"fidelity": rung}) for rung in machine.fidelity_ladder}
    own = list(rungs.values())
    others = [model for model in machine.models if all(model != one for one in own)]
    return rungs | {" ".join(f"{value:g}" for value in model.model_numbers.values()): model for model in others}


def _settled(machine: Machine) -> Settled:
    began = time.process_time()
    record = simulate(machine, CYCLES, transient=TRANSIENT)
    spent = 1e6 * (time.process_time() - began) / (CYCLES + TRANSIENT)
    verdict = two_step_test(record)
    return Settled((verdict.nature, verdict.period), float(record.peak_force.max(axis=1).mean()), spent)


def _cheap(machine: Machine) -> bool:
    began = time.process_time()
    simulate(machine, 2)
    return (time.process_time() - began) / 2.0 < MOST_SECONDS


def measured(kind: str, count: int, seed: int) -> Iterator[dict[str, Settled]]:
    """What every model finds of each of ``count`` random machines whose motion repeats by the reference."""
    index, found = 0, 0
    while found < count:
        models = models_of(machine_of(index, kind, seed))
        index += 1
        reference = models.pop("reference")
        try:
            if not _cheap(reference):
                continue
            true = _settled(reference)
            if true.nature[0] != "periodic" or not true.peak:
                continue
            # models finer than the reference have no error here
            yield {"reference": true} | {name: _settled(model) for name, model in models.items() if _cheap(model)}
        except (ChaosgymError, np.linalg.LinAlgError):
            continue
        found += 1


def ladder(kind: str, count: int, seed: int) -> list[dict[str, Any]]:
    """Rows by model: errors, cost, and the share of the machines whose nature and period are the reference's."""
    errors: dict[str, list[float]] = {}
    costs: dict[str, list[float]] = {}
    natures: dict[str, list[bool]] = {}
    for found in measured(kind, count, seed):
        true = found["reference"]
        for name, one in found.items():
            costs.setdefault(name, []).append(one.microseconds)
            natures.setdefault(name, []).append(one.nature == true.nature)
            if one.nature == true.nature:
                errors.setdefault(name, []).append(abs(one.peak / true.peak - 1.0))
    rows = [_row(name, np.array(errors.get(name, [np.nan])), costs[name], natures[name]) for name in costs]
    return sorted(rows, key=lambda row: -row["mean"])


def _row(name: str, errors: Any, costs: list[float], natures: list[bool]) -> dict[str, Any]:
    shares = {"mean": errors.mean(), "median": np.median(errors), "nine_of_ten": np.percentile(errors, 90)}
    return {
        "model": name,
        "us_a_cycle": float(np.mean(costs)),
        **{name: float(value) for name, value in shares.items()},
        "largest": float(errors.max()),
        "same_motion": float(np.mean(natures)),
    }
