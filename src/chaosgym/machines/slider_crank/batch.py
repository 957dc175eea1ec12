"""Batches of slider cranks: with propagators, whose tables machines at one speed share, or by the stepper."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays
from chaosgym.machines.batch import CompiledBatch, Cycles, one_call_at_a_time, put, stacked
from chaosgym.machines.slider_crank.joints import gaps_of
from chaosgym.machines.slider_crank.kernels.batch import (
    advance_cranks,
    advance_kicked_cranks,
    advance_stepped_cranks,
)
from chaosgym.machines.slider_crank.model import TABLES, KeptModel, ModelsBySpeed, models_by_speed

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

SPEED_FIELDS = ("bin_duration", "steps", "order")
"""Fields of a slider crank's model that change with its speed, apart from the tables."""


class CrankBatch(CompiledBatch):
    """Slider cranks that ``has_propagators``."""

    def __init__(self, machine: Any, count: int) -> None:
        super().__init__(machine, count)
        model = machine.reduce()
        self._bins = model.acceleration.shape[1]
        self._batch = stacked([model._replace(**dict.fromkeys(TABLES, 0))] * count)
        self._machines = [machine] * count
        self._models = [models_by_speed(machine)] * count
        self._speeds = np.full(count, np.nan)
        # the tables live as long as the batch holds their addresses
        self._kept: list[KeptModel | None] = [None] * count

    def __getstate__(self) -> dict[str, Any]:
        """State without models: addresses mean nothing in another process."""
        return {name: value for name, value in vars(self).items() if name not in ("_models", "_kept")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Take over a state, and look the models up anew."""
        vars(self).update(state)
        self._models = [models_by_speed(machine) for machine in self._machines]
        self._kept = [None] * len(self._machines)
        started, speeds = np.flatnonzero(np.isfinite(self._speeds)), self._speeds.copy()
        self._speeds[:] = np.nan
        self.set_speeds(started, speeds[started])

    def change(self, i: int, machine: Any) -> None:
        """Put another machine into place i, whose motion goes on."""
        put(self._batch, i, machine.reduce()._replace(**dict.fromkeys(TABLES, 0)))
        self._machines[i] = machine
        self._models[i] = models_by_speed(machine)
        self._speeds[i] = np.nan
        self.set_speeds(np.array([i]), np.array([machine.crank_speed]))

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the cranks [rpm]."""
        changed = self._speeds[which] != speeds
        if not changed.any():
            return
        which, speeds = which[changed], speeds[changed]
        self._speeds[which] = speeds
        # machines of one make are often at one speed: each pair is looked up once
        distinct: dict[tuple[ModelsBySpeed, float], int] = {}
        pairs = zip(which.tolist(), speeds.tolist(), strict=True)
        row = [distinct.setdefault((self._models[i], speed), len(distinct)) for i, speed in pairs]
        kept = [models.at(speed) for models, speed in distinct]
        for name in SPEED_FIELDS:
            getattr(self._batch, name)[which] = np.array([getattr(each.model, name) for each in kept])[row]
        for k, name in enumerate(TABLES):
            getattr(self._batch, name)[which] = np.array([each.addresses[k] for each in kept])[row]
        for i, place in zip(which.tolist(), row, strict=True):
            self._kept[i] = kept[place]

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the monitored joint [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self._machines[i] = self._machines[i].at(clearance=clearance)
            self._batch.gap[i] = gaps_of(self._machines[i])

    def run_kicked(self, which: Indices, kicks: Array) -> Cycles:
        """``kick`` the machines ``which`` (k,) by each of the shares (k, cycles, n_states / 2) and run them a cycle."""
        arrays, outcome = self._empty(*kicks.shape[:2])
        given = (self._batch, self._bins, which, kicks, self._motions, self._scale, arrays, self._settings, outcome)
        with one_call_at_a_time:
            call(advance_kicked_cranks, *given)
        return self._cycles(arrays, outcome)

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        call(advance_cranks, self._batch, self._bins, which, self._motions, arrays, self._settings, outcome)


class SteppedCrankBatch(CompiledBatch):
    """Slider cranks that need the stepper."""

    def __init__(self, machine: Any, count: int) -> None:
        super().__init__(machine, count)
        self._machines = [machine] * count
        self._batch = stacked([machine.reduce()] * count)

    def change(self, i: int, machine: Any) -> None:
        """Put another machine into place i, whose motion goes on."""
        self._machines[i] = machine
        put(self._batch, i, machine.reduce())

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the cranks [rpm]."""
        for i, speed in zip(which.tolist(), speeds.tolist(), strict=True):
            if self._machines[i].crank_speed != speed:
                self.change(i, self._machines[i].at(speed))

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the monitored joint [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self.change(i, self._machines[i].at(clearance=clearance))

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        call(advance_stepped_cranks, self._batch, which, self._motions, arrays, self._settings, outcome)
