"""Quantities of the thesis: one entry for each kind, and how it is computed."""

import math
from collections.abc import Mapping

from chaosgym.machines import ImpactBeam, Machine, SliderCrank
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from thesis.scorecard.beam_quantities import BEAM_QUANTITIES
from thesis.scorecard.crank_quantities import CRANK_QUANTITIES
from thesis.scorecard.findings import Finding, Quantity, Results, no_jobs
from thesis.scorecard.response_quantities import RESPONSE_QUANTITIES
from thesis.statements import Comparison


def clearance_unit(machine: Machine) -> float:
    """Displacement [m] by which the thesis makes a clearance dimensionless.

    The beam's is its static tip deflection under the force amplitude (3.5.1). The crank's is "the magnitude of the
    slider vibration due to a force equal to the slider inertia force, applied perpendicular to the slider guide rod
    axis" (4.5.1), one number at all speeds: a force m r w^2 of the slider's mass m moves the mass M that goes with the
    slider across the guide by r m / M.
    """
    if isinstance(machine, ImpactBeam):
        return static_tip_deflection(machine)
    assert isinstance(machine, SliderCrank)
    return machine.crank_radius * machine.slider_mass / lateral_mass(machine)


def lateral_mass(crank: SliderCrank) -> float:
    """Mass [kg] that goes with a slider across the guide: its own, and that of all that swings about the ball centre.

    Rod, housing and yoke turn with it; their moments of inertia about the ball centre count by the squared rod length.
    """
    length = crank.rod_length
    rod = crank.density * math.pi * crank.rod_diameter**2 / 4.0 * length
    yoke = crank.yoke_inertia + crank.yoke_mass * (length**2 + 2.0 * length * crank.yoke_offset_along)
    swinging = crank.housing_inertia + rod * length**2 / 3.0 + yoke
    return crank.slider_mass + swinging / length**2


def _dimensionless_clearance(machine: Machine, comparison: Comparison, results: Results) -> Finding:
    clearance: float = getattr(machine, machine.clearance_field)
    return Finding(clearance / clearance_unit(machine))


QUANTITIES: Mapping[str, Quantity] = {
    **RESPONSE_QUANTITIES,
    **BEAM_QUANTITIES,
    **CRANK_QUANTITIES,
    "dimensionless_clearance": Quantity(no_jobs, _dimensionless_clearance),
}
"""By name, as in ``reference/comparisons.toml``."""
