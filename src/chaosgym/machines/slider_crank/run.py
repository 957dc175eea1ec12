"""Runs of a slider crank: which kernel moves it, what it records besides, and the force that it can't exceed."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.compilation import call
from chaosgym.core.cycle import CycleArrays, Episode, cycle_arrays
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


def arrays_of(crank: "SliderCrank", cycles: int, samples: int) -> CycleArrays:
    """Arrays for the cycles of a crank: contact travels along the bearing, and sensors have channels."""
    channels = len(gaps_of(crank)) if crank.sensors else 0
    return cycle_arrays(cycles, crank.n_states, samples, travels=True, channels=channels)


def run(
    crank: "SliderCrank", coordinates: Array, bouncing: Array, arrays: CycleArrays, integrator: Integrator
) -> tuple[int, int]:
    """Run as many cycles as ``arrays`` has rows; see ``Machine.run``."""
    motion = (coordinates, Episode(side=bouncing[:1], touch=bouncing[1:]), arrays)
    if isinstance(integrator, ExactEvents):
        model = crank.reduce(integrator.step_phase)
        kernel = advance_stepped if isinstance(model, SteppedCrankModel) else advance
        tolerance = integrator.event_tolerance / model.contact_rate
        outcome = call(kernel, model, *motion, tolerance, integrator.event_budget)
    else:
        stepped = stepped_model(crank, STEP_PHASE)
        fastest = fastest_rate(crank, stepped)
        outcome = call(advance_crank_fixed_step, stepped, *motion, integrator.steps_per_cycle, fastest)
    status, done = outcome
    return status, done


def further_results(crank: "SliderCrank", arrays: CycleArrays) -> dict[str, Any]:
    """Phase and components of each peak force, and the peaks of the sensors."""
    return {
        "peak_phase": arrays.peak_instant * crank.crank_rate,
        "peak_vector": arrays.peak_vector,
        "sensor_peak": sensor_peaks(crank, arrays.channel_peak) if crank.sensors else None,
    }


def force_bound(crank: "SliderCrank") -> float:
    """Force [N] of an impact of all moving masses at ten times the speed of the crank pin.

    The motor may give any power, so that there is no bound of energy.
    """
    rod = crank.density * crank.rod_length * math.pi / 4.0 * crank.rod_diameter**2
    mass = crank.slider_mass + crank.yoke_mass + crank.housing_mass + rod
    speed = 10.0 * (crank.crank_radius * crank.crank_rate + math.sqrt(crank.gravity * crank.rod_length))
    damping = crank.contact_damping * math.sqrt(mass / (crank.slider_mass + crank.yoke_mass))
    bound = (math.sqrt(crank.contact_stiffness * mass) + damping) * speed
    if crank.contact_law == "hertz":
        # k of the secant at the reference force; stiffer in proportion to the cube root of a larger force
        bound *= max(1.0, bound / crank.hertz_reference_force) ** 0.2
    return bound
