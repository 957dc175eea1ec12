"""At which speeds is a machine calm that is known but for the last digits? Where all machines are that may be the one.

At the edge of chaos a millionth of a tolerance decides what a table says of a speed, and a plan goes where a table
promises most: to just those speeds at which it errs. So the speeds that a plan would choose are looked at once more.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from chaosgym.control.forecast import forecast_of
from chaosgym.envs.pools import Pool, worn
from chaosgym.envs.regimes import PERIODIC, RegimeTable, diagnosed
from chaosgym.envs.tasks import Task
from chaosgym.machines.machine import Machine
from chaosgym.simulation.batch import at_speed

CALM_ENOUGH = 4
"""Speeds that have to be found calm on all machines, the best ones; worse ones need not be looked at;
assumed."""


def robust_regimes(pool: Pool, task: Task, machines: Sequence[Machine]) -> tuple[RegimeTable, ...]:
    """Return tables of the first machine, one for each clearance of a pool, irregular where another one is.

    Speeds are looked at from the one on whose calm steps would earn most, until enough are calm on all ``machines``.
    """
    tables = pool.regimes_of(machines[0])
    forecast = forecast_of(pool, tables, task)
    levels = forecast.level_of(pool.levels - 1.0)
    earned = forecast.time - forecast.damage_weight * forecast.wear[levels]
    others = [[worn(machine, ratio) for machine in machines[1:]] for ratio in pool.levels.tolist()]
    return tuple(_robust(*each) for each in zip(tables, earned, others, strict=True))


def _robust(table: RegimeTable, earned: NDArray[np.float64], others: Sequence[Machine]) -> RegimeTable:
    """Return the table of a machine, as irregular as any of the others at its best speeds."""
    calm = 0
    for place in np.argsort(-earned, kind="stable").tolist():
        if calm == CALM_ENOUGH:
            break
        if table.type_iii[place]:
            continue
        natures = diagnosed([at_speed(machine, float(table.speeds[place])) for machine in others])[:, 0]
        calm += int((natures == PERIODIC).all())
        worst = np.append(table.nature[place], natures).max()
        nature = np.where(np.arange(len(table.speeds)) == place, worst, table.nature)
        table = replace(table, nature=nature.astype(np.int8))
    return table
