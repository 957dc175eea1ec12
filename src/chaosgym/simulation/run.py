"""Runs of a machine: whole operating cycles in, one row of results per cycle out.

record = simulate(ImpactBeam(excitation_frequency=19.0), cycles=100, transient=200)
record.peak_force          # (100, 2) newton, upper and lower surface
"""

import time
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.core import status
from chaosgym.core.cycle import CycleArrays
from chaosgym.core.tangent import Tangents
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import field_named, parameters_of, with_settings
from chaosgym.numbers import whole
from chaosgym.simulation.record import CycleRecord, MotionState, joined

FIRST_SLICE, MAX_GROWTH = 16, 8.0
"""Cycles of the first call of a kernel, and how much longer than the last one a call may be."""

MOST_RECORDED = 10**8
"""Cycles, or samples of a history, that one record may hold: some ten gigabytes."""

PATIENCE = 2.0
"""Seconds after which a progress bar appears."""

SLICE_SECONDS = 0.2
"""Duration that calls of a kernel aim at."""


def _run(
    machine: Machine,
    state: MotionState,
    cycles: int,
    samples: int,
    integrator: Integrator,
    tangents: Tangents | None = None,
    bar: Any = None,
) -> tuple[int, int, CycleRecord]:
    """Status of the kernel, number of cycles that it finished, and the record."""
    if not (isinstance(integrator, ExactEvents) or machine.moving.fixed_steps):
        raise ParameterError(f"integrator = {integrator} does not run {machine.name}; allowed: ExactEvents(...)")
    arrays = machine.arrays(cycles, samples)
    final = MotionState(state.coordinates.copy(), state.bouncing.copy())
    outcome, done = _in_slices(machine, final, arrays, integrator, tangents, bar)
    record = CycleRecord(
        machine=machine,
        section=arrays.section,
        displacement=arrays.tip[:, 0],
        velocity=arrays.tip[:, 1],
        peak_force=arrays.peak_force,
        impacts=arrays.impacts,
        contact_fraction=arrays.contact_time / machine.cycle_period,
        bounce_duration=arrays.bounce_time,
        final_state=final,
        history=arrays.history if samples else None,
        **machine.further_results(arrays),
    )
    return outcome, done, record.of_joint()


def _in_slices(
    machine: Machine,
    motion: MotionState,
    arrays: CycleArrays,
    integrator: Integrator,
    tangents: Tangents | None,
    bar: Any,
) -> tuple[int, int]:
    """Run a machine by short calls of its kernel, between which Ctrl-C takes effect; see ``Machine.run``."""
    cycles, done, count, outcome = len(arrays.section), 0, FIRST_SLICE, status.OK
    while done < cycles and outcome == status.OK:
        part = slice(done, done + count)
        along = None if tangents is None else tangents._replace(log_growth=tangents.log_growth[part])
        began = time.perf_counter()
        rows = CycleArrays(*(array[part] for array in arrays))
        outcome, finished = machine.run(*motion, rows, integrator, along)
        spent = max(time.perf_counter() - began, 1e-9)
        done += finished
        if bar is not None:
            bar.update(finished)
        count = max(1, int(count * min(MAX_GROWTH, SLICE_SECONDS / spent)))
    return outcome, done


def rest_state(machine: Machine) -> MotionState:
    """Return the state of rest in the middle of the gap.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam()
    >>> chaosgym.simulate(beam, 1, chaosgym.simulation.rest_state(beam)).section[0]
    array([0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0., 0.])
    """
    return MotionState(np.zeros(machine.n_states), np.zeros(3 * max(1, len(machine.joints))))


def begin_state(machine: Machine) -> MotionState:
    """Return the state from which a machine runs where no other is given: its own, or rest.

    Raises
    ------
    ParameterError
        If its own has another length than its states.
    """
    return _initial(machine, None)


def _initial(machine: Machine, given: MotionState | ArrayLike | None) -> MotionState:
    rest = rest_state(machine)
    if given is None and not machine.initial_state:
        return rest
    given = machine.initial_state if given is None else given
    state = given if isinstance(given, MotionState) else MotionState(np.array(given, dtype=float), rest.bouncing)
    if state.coordinates.shape != rest.coordinates.shape or not np.all(np.isfinite(state.coordinates)):
        raise ParameterError(
            f"initial_state has shape {state.coordinates.shape}; allowed: {rest.coordinates.shape}, all values finite"
        )
    return state


def simulate(
    machine: Machine,
    cycles: int,
    initial_state: MotionState | ArrayLike | None = None,
    transient: int = 0,
    *,
    samples_per_cycle: int = 0,
    integrator: Integrator | None = None,
    operation: Mapping[str, ArrayLike] | None = None,
    progress: bool = False,
) -> CycleRecord:
    """Run a machine for whole operating cycles.

    Same input, same bytes. A run of 100 cycles equals two runs of 50 of which the second starts from the
    ``final_state`` of the first.

    Parameters
    ----------
    machine
        What to run.
    cycles
        Number of cycles to record.
    initial_state
        A ``MotionState``, an array (n_states,), or None for the machine's own, which is rest in the middle of the gap
        unless it states another.
    transient
        Number of cycles to run first and not to record.
    samples_per_cycle
        Samples of the time history to keep in each cycle.
    integrator
        ``ExactEvents()`` by default, or ``RungeKutta4(...)``.
    operation
        Values (cycles,) of some of the machine's ``operating_fields``, one for each recorded cycle: noise or drift of
        the speed, the force or a gap. State and phase of the drive go on where the cycle before ended. The transient
        runs at the first values.
    progress
        Show a progress bar on standard error if it takes more than two seconds.

    Raises
    ------
    ParameterError
        If a count, the initial state or the operation is not usable.
    SimulationError
        If the motion diverges, a cycle exhausts the event budget, or a fixed step is too coarse; names the machine's
        parameters.

    Examples
    --------
    >>> record = chaosgym.simulate(chaosgym.ImpactBeam(excitation_frequency=12.0), cycles=50, transient=200)
    >>> float(record.peak_force.max().round(1))
    32.4

    The speed drifts from 18 to 20 Hz:

    >>> drift = {"excitation_frequency": np.linspace(18.0, 20.0, 100)}
    >>> drifted = chaosgym.simulate(chaosgym.ImpactBeam(), 100, operation=drift)
    >>> float(drifted.operation["excitation_frequency"][-1])
    20.0
    """
    cycles, transient = whole("cycles", cycles, 1, MOST_RECORDED), whole("transient", transient, 0)
    samples_per_cycle = whole("samples_per_cycle", samples_per_cycle, 0, MOST_RECORDED // cycles)
    integrator = integrator or machine.default_integrator
    state, first = _initial(machine, initial_state), 0
    table = _operation(machine, operation, cycles) if operation else None
    stretches = [(machine, cycles)] if table is None else _stretches(machine, table)
    records: list[CycleRecord] = []
    # even a bar that is never shown takes as long as a cycle
    shown = tqdm(total=transient + cycles, desc="simulate", unit="cycle", delay=PATIENCE) if progress else nullcontext()
    with shown as bar:
        for number, (each, count, samples) in enumerate(
            [(stretches[0][0], transient, 0), *((*stretch, samples_per_cycle) for stretch in stretches)]
        ):
            if count:
                outcome, done, record = _run(each, state, count, samples, integrator, bar=bar)
                if outcome != status.OK:
                    raise _failure(each, outcome, first + done, integrator)
                state = record.final_state
                first += count
                if number:
                    records.append(record)
    record = joined(records) if len(records) > 1 else records[0]
    return record if table is None else replace(record, operation=table)


def _operation(machine: Machine, given: Mapping[str, ArrayLike], cycles: int) -> NDArray[Any]:
    """Table (cycles,) of what changes from cycle to cycle, a column for each field."""
    columns = {}
    for name, values in given.items():
        field, known = field_named(machine, name), machine.operating_fields
        if field not in known:
            raise ParameterError(
                f"operation has {name!r}, which can't change while {machine.name} runs; allowed: " + ", ".join(known)
            )
        try:
            columns[field] = np.asarray(values, dtype=float)
        except (TypeError, ValueError):
            raise ParameterError(f"operation[{name!r}] is no array; allowed: a number for each cycle") from None
        if columns[field].shape != (cycles,):
            raise ParameterError(
                f"operation[{name!r}] has shape {columns[field].shape}; allowed: ({cycles},), a value for each cycle"
            )
    table = np.empty(cycles, [(field, float) for field in columns])
    for field, values in columns.items():
        table[field] = values
    return table


def _stretches(machine: Machine, table: NDArray[Any]) -> list[tuple[Machine, int]]:
    """Machines that follow each other, and for how many cycles each runs, by a table of ``_operation``."""
    fields = table.dtype.names or ()
    changes = np.any([np.diff(table[field]) != 0.0 for field in fields], axis=0)
    bounds = [0, *(1 + np.flatnonzero(changes)).tolist(), len(table)]
    # a machine whose values come again is built once
    kept = {
        row: with_settings(machine, dict(zip(fields, row, strict=True))) for row in set(table[bounds[:-1]].tolist())
    }
    return [(kept[table[begin].item()], end - begin) for begin, end in pairwise(bounds)]


def simulate_with_deviations(
    machine: Machine,
    cycles: int,
    initial_state: MotionState | ArrayLike | None = None,
    *,
    deviations: ArrayLike,
    orthonormal: bool = True,
    integrator: ExactEvents | None = None,
) -> tuple[CycleRecord, Array, Array]:
    """Run a machine whose ``moving`` has deviations and take small ones of its state through every contact, exactly.

    Parameters
    ----------
    machine, cycles, initial_state, integrator
        As for ``simulate``.
    deviations : (m, n_states)
        Initial deviations of the state.
    orthonormal
        Make them orthonormal in energy after each cycle; otherwise they grow as they are.

    Returns
    -------
    (record, deviations, log_growth)
        The run; the deviations at its end, (m, n_states); the logarithm of the growth of each in each cycle,
        (cycles, m), or (cycles, 0) if they are not made orthonormal.

    Raises
    ------
    ParameterError, SimulationError
        As ``simulate``.
    """
    cycles = whole("cycles", cycles, 1, MOST_RECORDED)
    state = _initial(machine, initial_state)
    vectors = np.array(deviations, dtype=float, ndmin=2)
    if vectors.shape[1] != len(state.coordinates) or not np.all(np.isfinite(vectors)):
        raise ParameterError(
            f"deviations have shape {vectors.shape}; allowed: (m, {len(state.coordinates)}), all values finite"
        )
    log_growth = np.empty((cycles, len(vectors) if orthonormal else 0))
    integrator = integrator or machine.default_integrator
    outcome, done, record = _run(machine, state, cycles, 0, integrator, Tangents(vectors, log_growth))
    if outcome != status.OK:
        raise _failure(machine, outcome, done, integrator)
    return record, vectors, log_growth


def _failure(machine: Machine, outcome: int, cycle: int, integrator: Integrator) -> SimulationError:
    settings = ", ".join(f"{name}={getattr(machine, name)!r}" for name in parameters_of(machine))
    known = machine.instabilities if outcome == status.DIVERGED else ()
    told = f"{status.MESSAGES[outcome]} in cycle {cycle} with {integrator}"
    return SimulationError("; ".join([*known, told, f"{type(machine).__name__}({settings})"]))
