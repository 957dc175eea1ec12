"""How does a machine run? Whole operating cycles in, one row of results per cycle out.

record = simulate(ImpactBeam(excitation_frequency=19.0), cycles=100, transient=200)
record.peak_force          # (100, 2) newton, upper and lower surface
"""

import os
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from tqdm import tqdm

from chaosgym.core import status
from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays, Episode, cycle_arrays
from chaosgym.core.fixed_step import advance_fixed_step
from chaosgym.core.modal_impact import ModalImpactModel, advance
from chaosgym.core.restitution import advance_restitution
from chaosgym.core.tangent import Tangents
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.impact_beam.parameters import ImpactBeam
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.machines.slider_crank.joints import sensor_peaks
from chaosgym.machines.slider_crank.kernels.exact import advance as advance_slider_crank
from chaosgym.machines.slider_crank.kernels.fixed_step import advance_crank_fixed_step
from chaosgym.machines.slider_crank.kernels.stepped import SteppedCrankModel
from chaosgym.machines.slider_crank.kernels.stepped import advance as advance_stepped_crank
from chaosgym.machines.slider_crank.model import STEP_PHASE, fastest_rate, stepped_model
from chaosgym.machines.slider_crank.parameters import SliderCrank
from chaosgym.simulation.integrators import ExactEvents, Integrator, RungeKutta4, default_integrator
from chaosgym.simulation.record import CycleRecord, MotionState

__all__ = [
    "CycleRecord",
    "ExactEvents",
    "Integrator",
    "MotionState",
    "RungeKutta4",
    "batch_arrays",
    "default_integrator",
    "parallel_map",
    "rest_state",
    "simulate",
    "simulate_many",
    "simulate_with_deviations",
]

Array = NDArray[np.float64]


def _arrays(machine: Machine, model: Any, cycles: int, samples: int = 0) -> CycleArrays:
    """Return the arrays into which the kernels write what a machine does."""
    if isinstance(machine, SliderCrank):
        channels = len(model.gap) if machine.sensors else 0
        return cycle_arrays(cycles, _states(machine), samples, travels=True, channels=channels)
    return cycle_arrays(cycles, _states(machine), samples)


def batch_arrays(machine: Machine, count: int, cycles: int) -> CycleArrays:
    """Return arrays for ``count`` variants of a machine: those of one, with one more axis, the machines, in front."""
    one = _arrays(machine, machine.reduce(), cycles)
    return CycleArrays(*(np.empty((count, *array.shape), array.dtype) for array in one))


def _record(machine: Machine, arrays: CycleArrays, final_state: MotionState) -> CycleRecord:
    return CycleRecord(
        machine=machine,
        section=arrays.section,
        displacement=arrays.tip[:, 0],
        velocity=arrays.tip[:, 1],
        peak_force=arrays.peak_force,
        impacts=arrays.impacts,
        contact_fraction=arrays.contact_time / machine.cycle_period,
        bounce_duration=arrays.bounce_time,
        final_state=final_state,
        history=arrays.history if arrays.history.shape[1] else None,
    )


def _run_impact_beam(
    beam: ImpactBeam,
    state: MotionState,
    cycles: int,
    samples: int,
    integrator: Integrator,
    tangents: Tangents | None = None,
) -> tuple[int, int, CycleRecord]:
    model = beam.reduce()
    arrays = _arrays(beam, model, cycles, samples)
    coordinates, bouncing = state.coordinates.copy(), state.bouncing.copy()
    episode = Episode(side=bouncing[:1], touch=bouncing[1:])
    along = () if tangents is None else (tangents,)
    motion = (model, coordinates, episode, arrays)
    if isinstance(integrator, ExactEvents):
        settings = (integrator.step_phase, integrator.event_tolerance, integrator.event_budget)
        if isinstance(model, ModalImpactModel):
            outcome, done = call(advance, *motion, *settings, *along)
        else:
            outcome, done = call(advance_restitution, *motion, integrator.step_phase, integrator.event_budget, *along)
    elif isinstance(model, ModalImpactModel):
        outcome, done = call(advance_fixed_step, *motion, integrator.steps_per_cycle)
    else:
        raise ParameterError(
            f"integrator = {integrator} does not run contact_law = 'restitution'; allowed: ExactEvents(...)"
        )
    return outcome, done, _record(beam, arrays, MotionState(coordinates, bouncing))


def _run_slider_crank(
    crank: SliderCrank, state: MotionState, cycles: int, samples: int, integrator: Integrator
) -> tuple[int, int, CycleRecord]:
    coordinates, bouncing = state.coordinates.copy(), state.bouncing.copy()
    episode = Episode(side=bouncing[:1], touch=bouncing[1:])
    if isinstance(integrator, ExactEvents):
        # its peaks and events are refined on the exact motion, so its steps may be twice as long as the beam's
        model = crank.reduce(2.0 * integrator.step_phase)
        arrays = _arrays(crank, model, cycles, samples)
        kernel = advance_stepped_crank if isinstance(model, SteppedCrankModel) else advance_slider_crank
        tolerance, budget = integrator.event_tolerance / model.contact_rate, integrator.event_budget
        outcome, done = call(kernel, model, coordinates, episode, arrays, tolerance, budget)
    else:
        stepped = stepped_model(crank, STEP_PHASE)
        arrays = _arrays(crank, stepped, cycles, samples)
        fastest, steps = fastest_rate(crank, stepped), integrator.steps_per_cycle
        outcome, done = call(advance_crank_fixed_step, stepped, coordinates, episode, arrays, steps, fastest)
    record = replace(
        _record(crank, arrays, MotionState(coordinates, bouncing)),
        peak_phase=arrays.peak_instant * crank.crank_rate,
        peak_vector=arrays.peak_vector,
        sensor_peak=sensor_peaks(crank, arrays.channel_peak) if crank.sensors else None,
    )
    return outcome, done, record


_Run = Callable[[Any, MotionState, int, int, Integrator], tuple[int, int, CycleRecord]]
_RUNS: dict[str, tuple[_Run, Callable[[Any], int]]] = {
    ImpactBeam.name: (_run_impact_beam, lambda beam: 2 * beam.n_modes),
    SliderCrank.name: (_run_slider_crank, lambda crank: 2 * len(crank.degrees_of_freedom)),
}
"""By machine: what runs it, and its number of states. A new machine adds one line."""


def rest_state(machine: Machine) -> MotionState:
    """Return the state of rest in the middle of the gap."""
    return MotionState(np.zeros(_states(machine)), np.zeros(3))


def _states(machine: Machine) -> int:
    return _RUNS[machine.name][1](machine)


def _initial(machine: Machine, given: MotionState | ArrayLike | None) -> MotionState:
    rest = rest_state(machine)
    if given is None:
        return rest
    state = given if isinstance(given, MotionState) else MotionState(np.array(given, dtype=float), rest.bouncing)
    if state.coordinates.shape != rest.coordinates.shape or not np.all(np.isfinite(state.coordinates)):
        raise ParameterError(
            f"initial_state has shape {state.coordinates.shape}; allowed: {rest.coordinates.shape}, all values finite"
        )
    return state


def _count(name: str, value: int, low: int) -> int:
    if isinstance(value, bool) or int(value) != value or value < low:
        raise ParameterError(f"{name} = {value!r} is out of range; allowed: whole numbers from {low} on")
    return int(value)


def simulate(
    machine: Machine,
    cycles: int,
    initial_state: MotionState | ArrayLike | None = None,
    transient: int = 0,
    *,
    samples_per_cycle: int = 0,
    integrator: Integrator | None = None,
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
        A ``MotionState``, an array (n_states,), or None for rest in the middle of the gap.
    transient
        Number of cycles to run first and not to record.
    samples_per_cycle
        Samples of the time history to keep in each cycle.
    integrator
        ``ExactEvents()`` by default, or ``RungeKutta4(...)``.

    Raises
    ------
    ParameterError
        If a count or the initial state is not usable.
    SimulationError
        If the motion diverges, a cycle exhausts the event budget, or a fixed step is too coarse; names the machine's
        parameters.
    """
    cycles = _count("cycles", cycles, 1)
    transient = _count("transient", transient, 0)
    samples_per_cycle = _count("samples_per_cycle", samples_per_cycle, 0)
    integrator = integrator or default_integrator(machine)
    state = _initial(machine, initial_state)
    run, _ = _RUNS[machine.name]
    first = 0
    for count, samples in ((transient, 0), (cycles, samples_per_cycle)):
        if count:
            outcome, done, record = run(machine, state, count, samples, integrator)
            if outcome != status.OK:
                raise _failure(machine, outcome, first + done, integrator)
            state = record.final_state
            first += count
    return record


def simulate_with_deviations(
    machine: ImpactBeam,
    cycles: int,
    initial_state: MotionState | ArrayLike | None = None,
    *,
    deviations: ArrayLike,
    orthonormal: bool = True,
    integrator: ExactEvents | None = None,
) -> tuple[CycleRecord, Array, Array]:
    """Run an impact beam and carry small deviations of its state through every contact, exactly.

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
    cycles = _count("cycles", cycles, 1)
    state = _initial(machine, initial_state)
    vectors = np.array(deviations, dtype=float, ndmin=2)
    if vectors.shape[1] != len(state.coordinates) or not np.all(np.isfinite(vectors)):
        raise ParameterError(
            f"deviations have shape {vectors.shape}; allowed: (m, {len(state.coordinates)}), all values finite"
        )
    log_growth = np.empty((cycles, len(vectors) if orthonormal else 0))
    integrator = integrator or default_integrator(machine)
    outcome, done, record = _run_impact_beam(machine, state, cycles, 0, integrator, Tangents(vectors, log_growth))
    if outcome != status.OK:
        raise _failure(machine, outcome, done, integrator)
    return record, vectors, log_growth


def _failure(machine: Machine, outcome: int, cycle: int, integrator: Integrator) -> SimulationError:
    settings = ", ".join(f"{name}={getattr(machine, name)!r}" for name in parameters_of(machine))
    return SimulationError(
        f"{status.MESSAGES[outcome]} in cycle {cycle} with {integrator}; {type(machine).__name__}({settings})"
    )


def simulate_many(
    machines: Sequence[Machine],
    cycles: int,
    *,
    transient: int = 0,
    integrator: Integrator | None = None,
    workers: int | None = None,
    progress: bool = False,
) -> list[CycleRecord]:
    """Run many machines side by side on threads: the kernels release the interpreter lock.

    Parameters
    ----------
    machines
        What to run, each from rest.
    cycles, transient, integrator
        As for ``simulate``.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Returns
    -------
    list of CycleRecord, in the order of ``machines``.
    """

    def one(machine: Machine) -> CycleRecord:
        return simulate(machine, cycles, transient=transient, integrator=integrator)

    return parallel_map(one, machines, workers=workers, progress="simulate" if progress else None)


def parallel_map(
    function: Callable[[Any], Any], items: Iterable[Any], *, workers: int | None = None, progress: str | None = None
) -> list[Any]:
    """Apply a function that spends its time in kernels to every item, on threads; results in order.

    ``progress`` names a progress bar on standard error; None shows none.
    """
    items = list(items)
    with ThreadPoolExecutor(max_workers=workers or os.cpu_count() or 1) as pool:
        results = pool.map(function, items)
        return list(tqdm(results, total=len(items), desc=progress, disable=progress is None, unit="machine"))
