"""The criteria: a bearing, its strength, and the life and reliability that it must reach."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from chaosgym.diagnosis import Tolerance
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameter, validate

_STEEL = "hardened steel, surface endurance strength 2.76 HB - 70 MPa at 600 HB (Shigley)"


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """Bearing data and what they must suffice for, in SI units except life, which is in millions of cycles.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.
    """

    load_rating: float = parameter(
        500.0, unit="N", low=1e-6, high=1e9, provenance="assumed", source="ten times the beam's forces"
    )
    """Force under which the surface lasts a million cycles [N]; C of thesis eq. 5.2."""
    life: float = parameter(1.0, unit="Mcycles", low=1e-9, high=1e9, provenance="assumed", source="an example")
    """Life that is required [10^6 cycles]."""
    reliability: float = parameter(0.99, low=0.0, high=1.0, provenance="assumed", source="thesis 5.4.2: high")
    """Probability that the strength exceeds the stress that is required."""
    machines_that_meet: float = parameter(
        0.9, low=0.0, high=1.0, provenance="assumed", source="as the survivors of the rating life, ISO 281"
    )
    """Share of the machines in tolerance that must reach life and reliability by their own statistics."""
    safety_factor: float = parameter(1.0, low=0.0, high=100.0, provenance="assumed", source="scatter is in reliability")
    """Safety factor SF of eq. 5.6 that responses of Type I and II must have."""
    life_exponent: float = parameter(10.0 / 3.0, low=1.0, high=20.0, provenance="printed", source="thesis eq. 5.2")
    """Exponent p of the life law."""
    contact_radius: float = parameter(8e-3, unit="m", low=1e-5, high=10.0, provenance="assumed", source="an example")
    """Radius of the ball that touches the flat surface [m]."""
    contact_modulus: float = parameter(
        1.15e11, unit="Pa", low=1e6, high=1e13, provenance="assumed", source="steel on steel, E = 210 GPa, nu = 0.3"
    )
    """Contact modulus E* of both surfaces [Pa]."""
    strength: float = parameter(1.6e9, unit="Pa", low=1.0, high=1e12, provenance="assumed", source=_STEEL)
    """Mean Hertzian endurance strength [Pa]; S_e of eq. 5.6."""
    strength_deviation: float = parameter(
        0.1e9, unit="Pa", low=0.0, high=1e12, provenance="assumed", source="6 % scatter"
    )
    """Standard deviation of the strength [Pa]."""
    fatigue_factor: float = parameter(1.0, low=0.1, high=10.0, provenance="assumed", source="smooth surface")
    """Fatigue factor K_f of eq. 5.6, which multiplies the stress."""
    confidence: float = parameter(0.95, low=0.5, high=0.9999, provenance="assumed", source="usual")
    """Confidence of the intervals; statistics must meet the criteria with their unfavourable end."""

    def __post_init__(self) -> None:
        validate(self)
        if not 0.0 < self.reliability < 1.0:
            raise ParameterError(f"reliability = {self.reliability:g} is out of range; allowed: above 0, below 1")


def variation_region(
    machine: Machine, tolerances: Mapping[str, Tolerance], region: Literal[1, 2] = 1, wear: bool = False
) -> dict[str, Tolerance]:
    """Region over which the parameters vary (thesis 5.5.2).

    Parameters
    ----------
    machine
        The nominal machine.
    tolerances
        By field.
    region
        1 or 2 tolerances on either side.
    wear
        Give the clearance two tolerances whatever the region, because bearings wear.

    Raises
    ------
    ParameterError
        If ``region`` is not 1 or 2, or wear is to be considered and the clearance has no tolerance.
    """
    if region not in (1, 2):
        raise ParameterError(f"region = {region!r} is out of range; allowed: 1 or 2 tolerances")
    if wear and machine.clearance_field not in tolerances:
        raise ParameterError(f"wear needs a tolerance of {machine.clearance_field}")
    factors = {name: 2 if wear and name == machine.clearance_field else region for name in tolerances}
    return {name: _widened(tolerance, factors[name]) for name, tolerance in tolerances.items()}


def _widened(tolerance: Tolerance, factor: int) -> Tolerance:
    if factor == 1:
        return tolerance
    if tolerance.relative:
        return Tolerance((1.0 + tolerance.value) ** factor - 1.0)
    return Tolerance(factor * tolerance.value, relative=False)
