"""What peak forces mean for a bearing: its life, its reliability and its safety (thesis 5.4.2)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.design.criteria import Criteria
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

Array = NDArray[np.float64]


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
