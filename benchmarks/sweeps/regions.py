"""How often the type that a dataset's cross tells is that of the whole region of tolerances around its centre.

A cross has one point on each side of its centre; a region has every combination of speed and clearance at half a
tolerance and a whole one (``diagnosis.response_type``). Both are judged by the rule of thesis 5.5.1.
"""

from collections import Counter
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from chaosgym.diagnosis import ResponseType, diagnose, response_type
from chaosgym.errors import DatasetError
from chaosgym.machines import Machine
from chaosgym.series import TYPES
from chaosgym.series.verdict import Definition
from chaosgym.simulation.parallel import parallel_map
from chaosgym.sweeps.dataset import LabelledSweep
from chaosgym.sweeps.label import RETRY


@dataclass(frozen=True)
class RegionTypes:
    """Types of centres of crosses: ``pairs`` counts (cross, region), ``periodic`` those of Type III that are."""

    pairs: Counter[tuple[str, str]]
    periodic: int

    @property
    def points(self) -> int:
        """Number of centres."""
        return self.pairs.total()

    @property
    def moved(self) -> int:
        """Centres of which cross and region tell different types."""
        return sum(count for (cross, region), count in self.pairs.items() if cross != region)

    @property
    def irregular(self) -> int:
        """Centres of Type III."""
        return sum(count for (_, region), count in self.pairs.items() if region == "III")

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "points": self.points,
            "moved": self.moved,
            "pairs": {f"{cross} to {region}": count for (cross, region), count in sorted(self.pairs.items())},
            "type_iii": self.irregular,
            "type_iii_periodic": self.periodic,
        }

    def lines(self) -> list[str]:
        """Say it for people."""
        rows = [f"{self.points} centres, {self.moved} ({self.moved / self.points:.1%}) of another type over the region"]
        rows += ["cross    " + "".join(f"{kind:>14s}" for kind in TYPES) + "   over the region"]
        rows += [f"{cross:9s}" + "".join(f"{self.pairs[cross, kind]:14d}" for kind in TYPES) for cross in TYPES]
        share = f" ({self.periodic / self.irregular:.1%})" if self.irregular else ""
        return [*rows, f"{self.irregular} are Type III, {self.periodic}{share} of them periodic windows"]


def region_types(sweep: LabelledSweep, points: int, seed: int = 0, progress: bool = False) -> RegionTypes:
    """Judge random centres of a dataset of crosses over their regions of speed and clearance, with its budget.

    Raises
    ------
    DatasetError
        If the dataset is not one of crosses.
    """
    if sweep.plan.sampling != "crosses":
        raise DatasetError(
            f"sampling = {sweep.plan.sampling!r} has no crosses; needed: a sweep with --sampling crosses:N"
        )
    told = sweep.column("response_type")
    centres = np.flatnonzero([kind is not None for kind in told])
    rows = np.random.default_rng(seed).permutation(centres)[:points]
    machines = [
        sweep.plan.machine_at({name: float(sweep.column(name)[row]) for name in sweep.plan.fields}) for row in rows
    ]
    judge = partial(_judge, budget=sweep.plan.budget, definition=sweep.plan.definition)
    found = parallel_map(judge, machines, progress="regions" if progress else None)
    pairs = Counter((str(told[row]), one.type) for row, one in zip(rows, found, strict=True))
    return RegionTypes(pairs, sum(one.type == "III" and one.centre.nature == "periodic" for one in found))


def _judge(machine: Machine, budget: int, definition: Definition) -> ResponseType:
    centre = diagnose(machine, budget=budget)
    if centre.nature == "undetermined":
        centre = diagnose(machine, budget=RETRY * budget)
    return response_type(
        machine,
        window="speed-clearance",
        initial_states=1,
        budget=budget,
        definition=definition,
        centre=centre,
        workers=1,
    )
