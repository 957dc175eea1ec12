"""A bearing: its data and what they must suffice for, and what peak forces mean for it (thesis 5.4.2)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from chaosgym.arrays import Array
from chaosgym.design.fatigue import conservative_life, equivalent_force, rating_life, required_load_rating
from chaosgym.design.reliability import (
    Interval,
    Strength,
    hertz_pressure,
    mean_interval,
    normal_reliability,
    reliability,
    safety_factor,
)
from chaosgym.diagnosis import Tolerance
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import by_field, parameter, validate
from chaosgym.numbers import shown

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
    """Life that is required [10^6 cycles]; where ``hours`` are given, what these are at the machine's speed."""
    hours: float = parameter(0.0, unit="h", low=0.0, high=1e9, provenance="assumed", source="0: the life is in cycles")
    """Life that is required [h] of operation; 0 where it is stated in cycles."""
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

    def at(self, cycle_period: float) -> "Criteria":
        """Return the criteria of a machine by its cycle [s]: the hours that are required become cycles."""
        return replace(self, life=self.hours / hours_of(1.0, cycle_period)) if self.hours else self

    def __post_init__(self) -> None:
        validate(self)
        if not 0.0 < self.reliability < 1.0:
            raise ParameterError(f"reliability = {self.reliability:g} is out of range; allowed: above 0, below 1")


def hours_of(life: float, cycle_period: float) -> float:
    """Hours of operation that a life [10^6 cycles] takes.

    Examples
    --------
    >>> hours_of(3.6, 1.0)
    1000.0
    """
    return life * 1e6 * cycle_period / 3600.0


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

    Examples
    --------
    >>> from chaosgym.design import variation_region
    >>> from chaosgym.diagnosis import Tolerance
    >>> variation_region(chaosgym.ImpactBeam(), {"clearance": Tolerance(0.1)}, region=2)
    {'clearance': Tolerance(value=0.2100000000000002, relative=True)}
    """
    if region not in (1, 2):
        raise ParameterError(f"region = {shown(region)} is out of range; allowed: 1 or 2 tolerances")
    tolerances = by_field(machine, tolerances)
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


@dataclass(frozen=True, kw_only=True)
class Evaluation:
    """What forces mean for the bearing.

    Attributes
    ----------
    method
        How the force was chosen, in words.
    force
        Equivalent peak force [N].
    largest_force
        Largest peak force [N].
    life, life_interval
        By Palmgren-Miner [10^6 cycles], and its interval (degenerate for single values).
    conservative_life
        Under the largest force throughout [10^6 cycles].
    required_load_rating
        For the required life, eq. 5.5 [N].
    reliability, reliability_interval
        Eq. 5.8.
    normal_reliability
        Eq. 5.9 with the same mean and deviation of stress.
    safety_factor
        Eq. 5.6 at the largest stress.
    """

    method: str
    force: float
    largest_force: float
    life: float
    life_interval: Interval
    conservative_life: float
    required_load_rating: float
    reliability: float
    reliability_interval: Interval
    normal_reliability: float
    safety_factor: float


def evaluate(blocks: list[Array], criteria: Criteria, method: str, seed: int = 0) -> Evaluation:
    """Evaluate life and reliability over peak forces (thesis 5.4.2).

    Parameters
    ----------
    blocks
        Peak forces [N] in blocks that are independent of each other and weigh the same: stretches of one record, or
        machines of a series. A single force is the classical case.
    criteria
        Bearing data.
    method
        How the forces were chosen, in words.
    seed
        Of the bootstrap.
    """
    exponent, confidence = criteria.life_exponent, criteria.confidence
    force = equivalent_force([equivalent_force(block, exponent) for block in blocks], exponent)
    largest = max(float(np.max(block)) for block in blocks)
    scale = largest or 1.0
    damage = mean_interval([(block / scale) ** exponent for block in blocks], confidence, seed)
    low, high = (scale * value ** (1.0 / exponent) for value in damage)
    strength = Strength(criteria.strength, criteria.strength_deviation)
    stresses = [
        criteria.fatigue_factor * hertz_pressure(block, criteria.contact_radius, criteria.contact_modulus)
        for block in blocks
    ]
    survival = [strength.exceeds(stress) for stress in stresses]
    mean = float(np.mean([np.mean(stress) for stress in stresses]))
    square = float(np.mean([np.mean((stress - mean) ** 2) for stress in stresses]))
    largest_stress = max(float(np.max(stress)) for stress in stresses)
    return Evaluation(
        method=method,
        force=force,
        largest_force=largest,
        life=rating_life(force, criteria.load_rating, exponent),
        life_interval=Interval(*(rating_life(end, criteria.load_rating, exponent) for end in (high, low))),
        conservative_life=conservative_life([largest], criteria.load_rating, exponent),
        required_load_rating=required_load_rating(force, criteria.life, exponent),
        reliability=float(np.mean([reliability(stress, strength) for stress in stresses])),
        reliability_interval=mean_interval(survival, confidence, seed),
        normal_reliability=normal_reliability(mean, math.sqrt(square), *strength),
        safety_factor=safety_factor(largest_stress, criteria.strength),
    )


def plain(values: Mapping[str, Any]) -> dict[str, Any]:
    """Replace infinite numbers by None, and tuples by lists."""

    def one(value: Any) -> Any:
        if isinstance(value, tuple):
            return [one(each) for each in value]
        return None if isinstance(value, float) and not math.isfinite(value) else value

    return {name: one(value) for name, value in values.items()}
