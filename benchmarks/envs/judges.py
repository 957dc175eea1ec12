"""How far do the judges of running motion agree with the diagnosis from rest, and with each other?

Machines of the Tolerance task are held at speeds from the lowest demand to the highest. Both judges see the same
settled motion, with the disturbance of the task and without; a machine without deviations has the recurrence alone.
"""

from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import trange

from chaosgym.arrays import Array
from chaosgym.diagnosis import diagnose
from chaosgym.envs.judge import ExponentJudge, RecurrenceJudge
from chaosgym.machines.batch import VaryingBatch

SETTLING, JUDGED = 40, 40
"""Cycles at a speed that are not judged, and that are."""

BUDGET = 400
"""Cycles of the diagnosis from rest."""


def judges(env: str, machines: int = 16, speeds: int = 23, seed: int = 0) -> dict[str, float]:
    """Shares of the points at which verdicts agree, by name; a verdict is the majority of the judged cycles."""
    made: Any = gym.make(env).unwrapped
    task, generator = made.task, np.random.default_rng(seed)
    grid = np.linspace(task.lowest_demand, task.highest_demand, speeds)
    if task.speed_grid:
        grid = task.speed_grid * np.rint(grid / task.speed_grid)
    drawn = [made.settings.variants.held_out(k) for k in range(machines)]
    wild = np.array(
        [
            [diagnose(drawn[i].at(float(speed)), budget=BUDGET).nature != "periodic" for speed in grid]
            for i in trange(machines, desc="diagnose", unit="machine")
        ]
    )
    found = {"irregular by diagnosis": float(wild.mean())}
    for name, share in (("undisturbed", 0.0), ("disturbed", 1.0)):
        verdicts = _verdicts(drawn, grid, task, share, generator)
        for judge, verdict in verdicts.items():
            found[f"{name}: {judge} as the diagnosis"] = float(np.mean(verdict == wild))
            found[f"{name}: irregular by {judge}"] = float(np.mean(verdict))
        if len(verdicts) == 2:
            first, second = verdicts.values()
            found[f"{name}: both judges alike"] = float(np.mean(first == second))
    return found


def _verdicts(drawn: list[Any], grid: Array, task: Any, share: float, generator: np.random.Generator) -> dict[str, Any]:
    """Verdicts (machines, speeds) of each judge, machines swept upwards."""
    batch, every = drawn[0].batch(len(drawn)), np.arange(len(drawn))
    for i, machine in enumerate(drawn):
        batch.start(i, machine.at(float(grid[0])))
    carries = isinstance(batch, VaryingBatch)
    exponent, recurrence = ExponentJudge(len(drawn)), RecurrenceJudge(len(drawn))
    result: dict[str, Any] = {"recurrence": np.zeros((len(drawn), len(grid)), np.bool_)}
    if carries:
        result["exponent"] = np.zeros((len(drawn), len(grid)), np.bool_)
    for column, speed in enumerate(grid):
        peaks, growth = _run(batch, every, float(speed), task, share, generator)
        exponent.verdict(every, growth[:, :SETTLING], peaks)
        if carries:
            result["exponent"][:, column] = exponent.verdict(every, growth[:, SETTLING:], peaks)[0] > 0.5
        halves = [peaks[:, SETTLING + k : SETTLING + k + 20] for k in (0, JUDGED - 20)]
        votes = [recurrence.verdict(every, growth, half)[0] for half in halves]
        result["recurrence"][:, column] = np.mean(votes, axis=0) >= 0.5
    return result


def _run(batch: Any, every: Any, speed: float, task: Any, share: float, generator: Any) -> tuple[Array, Array]:
    """Peak forces and growth (machines, cycles) at a speed."""
    count, cycles = len(every), SETTLING + JUDGED
    if isinstance(batch, VaryingBatch):
        speeds = speed * (1.0 + share * task.speed_ripple * generator.standard_normal((count, cycles)))
        done, growth = batch.run_varied(every, speeds)
        return done.peak_force[:, :, 0], growth
    batch.set_speeds(every, np.full(count, speed))
    half = len(batch.motion(0)[0]) // 2
    parts = []
    for _ in range(cycles):
        batch.kick(every, share * task.kick * generator.standard_normal((count, half)))
        parts.append(batch.run(every, 1).peak_force[:, :, 0])
    return np.concatenate(parts, axis=1), np.zeros((count, cycles))
