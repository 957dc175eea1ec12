"""Runs of a slider crank: which kernel moves it, what it records besides, and the force that it can't exceed."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.core import status
from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays, Episode, cycle_arrays
from chaosgym.core.tangent import Tangents, no_tangents
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.slider_crank.joints import gaps_of, sensor_peaks
from chaosgym.machines.slider_crank.kernels.exact import advance
from chaosgym.machines.slider_crank.kernels.fixed_step import advance_crank_fixed_step
from chaosgym.machines.slider_crank.kernels.stepped import SteppedCrankModel
from chaosgym.machines.slider_crank.kernels.stepped import advance as advance_stepped
from chaosgym.machines.slider_crank.model import STEP_PHASE, fastest_rate, stepped_model

if TYPE_CHECKING:
    from chaosgym.machines.slider_crank.parameters import SliderCrank

Array = NDArray[np.float64]

STEPS_AT_ONCE = 200_000
"""Steps without events in one call of a kernel: some tenths of a second of processor time."""


def arrays_of(crank: "SliderCrank", cycles: int, samples: int) -> CycleArrays:
    """Arrays for the cycles of a crank: contact travels along the bearing, and sensors have channels."""
    channels = len(gaps_of(crank)) if crank.sensors else 0
    return cycle_arrays(cycles, crank.n_states, samples, travels=True, channels=channels)


def run(
    crank: "SliderCrank",
    coordinates: Array,
    bouncing: Array,
    arrays: CycleArrays,
    integrator: Integrator,
    tangents: Tangents | None = None,
) -> tuple[int, int]:
    """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
    episode = Episode(side=bouncing[:1], touch=bouncing[1:])
    settings: tuple[Any, ...]
    if isinstance(integrator, ExactEvents):
        model = crank.reduce(integrator.step_phase)
        kernel = advance_stepped if isinstance(model, SteppedCrankModel) else advance
        steps = model.steps * round(360.0 / crank.matrix_update_interval)
        settings = (integrator.event_tolerance / model.contact_rate, integrator.event_budget)
    else:
        model = stepped_model(crank, STEP_PHASE)
        kernel, steps = advance_crank_fixed_step, integrator.steps_per_cycle
        settings = (steps, fastest_rate(crank, model))
    # a kernel can't be interrupted: many revolutions take many calls
    cycles, at_once, done = len(arrays.section), max(1, STEPS_AT_ONCE // steps), 0
    while done < cycles:
        part = CycleArrays(*(values[done : done + at_once] for values in arrays))
        if kernel is advance:
            vectors, log_growth = tangents or no_tangents(len(coordinates), cycles)
            part_settings = (*settings, Tangents(vectors, log_growth[done : done + at_once]))
        else:
            part_settings = settings
        outcome, finished = call(kernel, model, coordinates, episode, part, *part_settings)
        done += finished
        if outcome != status.OK:
            return outcome, done
    return status.OK, done


def further_results(crank: "SliderCrank", arrays: CycleArrays) -> dict[str, Any]:
    """Phase and components of each peak force, and the peaks of the sensors."""
    return {
        "peak_phase": arrays.peak_instant * crank.crank_rate,
        "peak_vector": arrays.peak_vector,
        "sensor_peak": sensor_peaks(crank, arrays.channel_peak) if crank.sensors else None,
    }


def force_bound(crank: "SliderCrank") -> float:
    """Force [N] of an impact of all moving masses at ten times the speed of the crank pin.

    The motor may give any power, so that there is no bound of energy. What turns with the rod counts as the mass at its
    end that has the same inertia.
    """
    rod = crank.density * crank.rod_length * math.pi / 4.0 * crank.rod_diameter**2
    turning = (crank.yoke_inertia + crank.housing_inertia) / crank.rod_length**2
    mass = crank.slider_mass + crank.yoke_mass + crank.housing_mass + rod + turning
    speed = 10.0 * (crank.crank_radius * crank.crank_rate + math.sqrt(crank.gravity * crank.rod_length))
    damping = crank.contact_damping * math.sqrt(mass / (crank.slider_mass + crank.yoke_mass))
    bound = (math.sqrt(crank.contact_stiffness * mass) + damping) * speed
    if crank.contact_law == "hertz":
        # k of the secant at the reference force; stiffer in proportion to the cube root of a larger force
        bound *= max(1.0, bound / crank.hertz_reference_force) ** 0.2
    return bound
