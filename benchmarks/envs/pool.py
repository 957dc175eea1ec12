"""Which machines of the family have something to win, and what their rated force is: the file of the pool.

A machine sweeps upwards through its speeds, disturbed as in a job. It is kept if it can be simulated, if a stop is hit
at nine of ten speeds, and if who knows the load at every speed pays 5 % less than who follows the demand, moves being
free.
"""

from collections.abc import Iterator
from itertools import count, islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.envs.pool import REACH, Kept, machine_of, pool_task
from chaosgym.envs.task import LIFE_PRICE
from chaosgym.machines.family import Ranged
from chaosgym.rating_life import LIFE_EXPONENT

SIZES = {"train": 512, "test": 256, "other_machines": 128}
"""Machines of each split."""

TRAINED, OTHER = ("force", "force", "force", "unbalance", "unbalance"), ("base", "gear")
"""Kinds in turn: of the first two splits, and of the last one."""

SETTLING, JUDGED, TOGETHER = 20, 20, 64
"""Cycles at a speed before forces count and while they do, and machines side by side."""

FOLLOWING = 0.28
"""Damage of a job of who follows the demand, as on the beam."""

CONTACT, LEAST_GAIN = 0.9, 0.05


def swept(machines: list[Ranged], rng: np.random.Generator) -> tuple[Array, NDArray[np.bool_]]:
    """Mean load (n, s, sides) [N^10/3] of machines at each speed, and whose simulation failed (n,)."""
    grid, n = pool_task().grid, len(machines)
    batch: Any = machines[0].machine.batch(n)
    every = np.arange(n)
    low, high = (np.array([getattr(one, name) for one in machines]) for name in ("lowest", "highest"))
    for i, one in enumerate(machines):
        batch.start(i, one.machine.at(one.lowest))
    load, failed = np.zeros((n, len(grid), 2)), np.zeros(n, np.bool_)
    for place, share in enumerate(grid):
        speeds = (low + share * (high - low))[:, None] * (1.0 + 0.002 * rng.standard_normal((n, SETTLING + JUDGED)))
        cycles, _ = batch.run_varied(every, speeds)
        failed |= cycles.failed
        load[:, place] = (cycles.peak_force[:, SETTLING:] ** LIFE_EXPONENT).mean(axis=1)
    return load, failed


def gain_of(load: Array) -> float:
    """Share of what following costs that the best speeds within reach save; ``load`` (s,) over that of rated force."""
    task = pool_task()
    price = (
        LIFE_PRICE
        * task.reference_damage
        / task.steps
        / (task.deviation_weight * (task.highest_speed - task.lowest_speed))
    )
    grid = task.grid
    demands = np.flatnonzero(grid > task.lowest_demand - 1e-9)
    offset = np.arange(-REACH, REACH + 1)
    at = demands[:, None] + offset
    cost = np.where((at >= 0) & (at < len(grid)), price * load[at.clip(0, len(grid) - 1)], np.inf)
    best = (cost + np.abs(offset) * task.trim_step).min(axis=1)
    return float(1.0 - best.mean() / (price * load[demands].mean()))


def kept_machines(kinds: tuple[str, ...]) -> Iterator[tuple[str, int, float]]:
    """Kind, number and rated force of the machines that are kept, in the order in which they are drawn."""
    task = pool_task()
    demands = task.grid > task.lowest_demand - 1e-9
    for chunk in count():
        numbers = range(chunk * TOGETHER, (chunk + 1) * TOGETHER)
        names = [kinds[k % len(kinds)] for k in numbers]
        load, failed = swept(
            [machine_of(*one) for one in zip(names, numbers, strict=True)], np.random.default_rng(chunk)
        )
        for kind, number, felt, bad in zip(names, numbers, load, failed, strict=True):
            if bad or (felt.max(axis=1) > 0.0).mean() < CONTACT:
                continue
            usual = felt[demands].mean(axis=0).max()
            rated = (usual * task.reference_damage / FOLLOWING) ** (1.0 / LIFE_EXPONENT)
            if gain_of(felt.max(axis=1) / rated**LIFE_EXPONENT) >= LEAST_GAIN:
                yield kind, number, float(f"{rated:.6g}")


def write_pool(path: Path) -> list[Kept]:
    """Draw, filter and write the pool."""
    found: list[Kept] = []
    bar = tqdm(total=sum(SIZES.values()), unit="machine", leave=False)
    trained, other = kept_machines(TRAINED), kept_machines(OTHER)
    for split, size in SIZES.items():
        for one in islice(other if split == "other_machines" else trained, size):
            found.append(Kept(split, *one))
            bar.update()
    lines = ["split,kind,number,force", *(f"{row.split},{row.kind},{row.number},{row.force:.6g}" for row in found)]
    path.write_text("\n".join(lines) + "\n")
    return found
