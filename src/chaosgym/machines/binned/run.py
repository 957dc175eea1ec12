"""Runs of mechanisms, single or in batches: which kernel moves them, and what it records besides."""

from typing import Any

import numpy as np

from chaosgym.arrays import Array, Indices
from chaosgym.core import status
from chaosgym.core.binned.batch import advance_binned_machines, advance_kicked_machines, advance_taylor_machines
from chaosgym.core.binned.cycle import advance
from chaosgym.core.binned.fixed_step import advance_binned_fixed_step
from chaosgym.core.binned.model import BinnedModel, TaylorModel
from chaosgym.core.binned.taylor import advance as advance_stepped
from chaosgym.core.compilation import call, call_on_threads
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.tangent import Tangents, no_tangents
from chaosgym.machines.batch import CompiledBatch, Cycles, KickedBatch, put, stacked
from chaosgym.machines.binned.equations import STEP_PHASE
from chaosgym.machines.binned.held_machine import HeldMachine
from chaosgym.machines.binned.model import ModelsBySpeed, models_by_speed
from chaosgym.machines.binned.stepped import fastest_rate, stepped_model
from chaosgym.machines.integrators import ExactEvents, Integrator

STEPS_AT_ONCE = 200_000
"""Steps without events in one call of a kernel: some tenths of a second of processor time."""


def run(
    machine: HeldMachine,
    coordinates: Array,
    bouncing: Array,
    arrays: CycleArrays,
    integrator: Integrator,
    tangents: Tangents | None = None,
) -> tuple[int, int]:
    """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
    settings: tuple[Any, ...]
    if isinstance(integrator, ExactEvents):
        model = machine.reduce(integrator.step_phase)
        kernel = advance_stepped if isinstance(model, TaylorModel) else advance
        steps = model.steps * machine.bins
        settings = (integrator.event_tolerance / model.contact_rate, integrator.event_budget)
    else:
        model = stepped_model(machine, STEP_PHASE)
        kernel, steps = advance_binned_fixed_step, integrator.steps_per_cycle
        settings = (steps, fastest_rate(machine, model))
    # a kernel can't be interrupted: many revolutions take many calls
    cycles, at_once, done = len(arrays.section), max(1, STEPS_AT_ONCE // steps), 0
    while done < cycles:
        part = CycleArrays(*(values[done : done + at_once] for values in arrays))
        if kernel is not advance_binned_fixed_step:
            vectors, log_growth = tangents or no_tangents(len(coordinates), cycles)
            part_settings = (*settings, Tangents(vectors, log_growth[done : done + at_once]))
        else:
            part_settings = settings
        outcome, finished = call(kernel, model, coordinates, bouncing, part, *part_settings)
        done += finished
        if outcome != status.OK:
            return outcome, done
    return status.OK, done


SPEED_FIELDS = ("bin_duration", "steps", "order")
"""Fields of a model that change with its speed, apart from the table."""


class BinnedBatch(KickedBatch):
    """Mechanisms that have propagators."""

    def __init__(self, machine: Any, count: int) -> None:
        super().__init__(machine, count)
        model = machine.reduce()
        self._batch = stacked([model._replace(table=0)] * count)
        self._machines = [machine] * count
        self._models = [models_by_speed(machine)] * count
        self._speeds = np.full(count, np.nan)
        # a table lives as long as the batch holds its address
        self._kept: list[BinnedModel | None] = [None] * count

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
        put(self._batch, i, machine.reduce()._replace(table=0))
        self._machines[i] = machine
        self._models[i] = models_by_speed(machine)
        self._speeds[i] = np.nan
        self.set_speeds(np.array([i]), np.array([machine.drive_speed]))

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the drives [rpm]."""
        # machines of one make are often at one speed: each pair is looked up once
        found: dict[tuple[ModelsBySpeed, float], BinnedModel] = {}
        for i, speed in zip(which.tolist(), speeds.tolist(), strict=True):
            if self._speeds[i] == speed:
                continue
            machine = self._machines[i]
            if machine.speed_field not in machine.beside_matrices and machine.drive_speed != speed:
                self._machines[i] = machine.at(speed)
                self._models[i] = models_by_speed(self._machines[i])
            pair = self._models[i], speed
            if pair not in found:
                found[pair] = pair[0].at(speed)
            model = self._kept[i] = found[pair]
            self._speeds[i] = speed
            for name in SPEED_FIELDS:
                getattr(self._batch, name)[i] = getattr(model, name)
            self._batch.table[i] = model.table.ctypes.data

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the monitored joint [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self._machines[i] = self._machines[i].at(clearance=clearance)
            self._batch.gap[i] = self._machines[i].gaps

    def run_kicked(self, which: Indices, kicks: Array) -> Cycles:
        """``kick`` the machines ``which`` (k,) by each of the shares (k, cycles, n_velocities) and run them a cycle."""
        arrays, outcome = self._empty(*kicks.shape[:2])
        given = (self._batch, which, kicks, self._motions, self._scale, arrays, self._settings, outcome)
        call_on_threads(advance_kicked_machines, len(which), *given)
        return self._cycles(arrays, outcome)

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        given = (self._batch, which, self._motions, arrays, self._settings, outcome)
        call_on_threads(advance_binned_machines, len(which), *given)


class TaylorBatch(CompiledBatch):
    """Mechanisms that move by Taylor series."""

    def __init__(self, machine: Any, count: int) -> None:
        super().__init__(machine, count)
        self._machines = [machine] * count
        self._batch = stacked([machine.reduce()] * count)

    def change(self, i: int, machine: Any) -> None:
        """Put another machine into place i, whose motion goes on."""
        self._machines[i] = machine
        put(self._batch, i, machine.reduce())

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Change the speeds of the drives [rpm]."""
        for i, speed in zip(which.tolist(), speeds.tolist(), strict=True):
            if self._machines[i].drive_speed != speed:
                self.change(i, self._machines[i].at(speed))

    def set_clearances(self, which: Indices, clearances: Array) -> None:
        """Change the clearances of the monitored joint [m]."""
        for i, clearance in zip(which.tolist(), clearances.tolist(), strict=True):
            self.change(i, self._machines[i].at(clearance=clearance))

    def _advance(self, which: Indices, arrays: CycleArrays, outcome: Indices) -> None:
        given = (self._batch, which, self._motions, arrays, self._settings, outcome)
        call_on_threads(advance_taylor_machines, len(which), *given)
