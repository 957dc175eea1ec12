"""A bearing: its data and what they must suffice for, and what peak forces mean for it (thesis 5.4.2)."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
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
from chaosgym.design.texts import listed
from chaosgym.diagnosis import Tolerance
from chaosgym.errors import ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import by_field, check_parameter, parameter, parameters_of
from chaosgym.numbers import number, shown
from chaosgym.plain import plain

STRENGTH = ("strength", "strength_deviation", "contact_radius", "contact_modulus")
"""Criteria that a reliability rests on."""

NEEDS: Mapping[str, tuple[str, ...]] = {
    "life": ("load_rating", "life"),
    "reliability": ("reliability", *STRENGTH),
    "safety factor": ("safety_factor", "strength", "contact_radius", "contact_modulus"),
}
"""What must be stated so that each is judged."""


def _stated(source: str, unit: str = "-", *, low: float = 0.0, high: float) -> Any:
    """A criterion without a default: what nobody states is not judged."""
    return parameter(None, unit=unit, low=low, high=high, provenance="stated", source=source)


@dataclass(frozen=True, kw_only=True)
class Criteria:
    """Bearing data and what they must suffice for, in SI units except life, which is in millions of cycles.

    None stands for what is not stated; it is not judged.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.

    Examples
    --------
    >>> from chaosgym.design import Criteria
    >>> Criteria(load_rating=500.0).not_judged[0]
    'life: not judged; load_rating (given) is stated; state life too'
    """

    load_rating: float | None = _stated("of the bearing", "N", low=1e-6, high=1e9)
    """Force under which the surface lasts a million cycles [N]; C of thesis eq. 5.2."""
    life: float | None = _stated("that is required", "Mcycles", low=1e-9, high=1e9)
    """Life that is required [10^6 cycles]; where ``hours`` are given, what these are at the machine's speed."""
    hours: float | None = _stated("that are required", "h", high=1e9)
    """Life that is required [h] of operation; None where it is stated in cycles, or not at all."""
    reliability: float | None = _stated("that is required", high=1.0)
    """Probability that the strength exceeds the stress that is required."""
    machines_that_meet: float | None = _stated("that is required", high=1.0)
    """Share of the machines in tolerance that must reach life and reliability by their own statistics."""
    safety_factor: float | None = _stated("that is required", high=100.0)
    """Safety factor SF of eq. 5.6 that responses of Type I and II must have."""
    life_exponent: float = parameter(10.0 / 3.0, low=1.0, high=20.0, provenance="printed", source="thesis eq. 5.2")
    """Exponent p of the life law."""
    contact_radius: float | None = _stated("of the contact", "m", low=1e-5, high=10.0)
    """Radius of the ball that touches the flat surface [m]."""
    contact_modulus: float | None = _stated("of the contact", "Pa", low=1e6, high=1e13)
    """Contact modulus E* of both surfaces [Pa]."""
    strength: float | None = _stated("of the surface", "Pa", low=1.0, high=1e12)
    """Mean Hertzian endurance strength [Pa]; S_e of eq. 5.6."""
    strength_deviation: float | None = _stated("of the surface", "Pa", high=1e12)
    """Standard deviation of the strength [Pa]."""
    fatigue_factor: float = parameter(1.0, low=0.1, high=10.0, provenance="assumed", source="smooth surface")
    """Fatigue factor K_f of eq. 5.6, which multiplies the stress."""
    confidence: float = parameter(0.95, low=0.5, high=0.9999, provenance="assumed", source="usual")
    """Confidence of the intervals; statistics must meet the criteria with their unfavourable end."""
    stated: Mapping[str, str] = field(default_factory=dict, compare=False, repr=False)
    """Who stated each: "brief.toml:31", or the option of a command."""

    def at(self, cycle_period: float) -> "Criteria":
        """Return the criteria of a machine by its cycle [s]: the hours that are required become cycles."""
        return replace(self, life=self.hours / hours_of(1.0, cycle_period)) if self.hours else self

    def __post_init__(self) -> None:
        for name in parameters_of(self):
            value = getattr(self, name)
            if value is not None or getattr(type(self), name) is not None:
                object.__setattr__(self, name, check_parameter(self, name, value))
        if self.reliability is not None:
            number("reliability", self.reliability, 0.0, 1.0, inside=True)

    def missing(self, what: str) -> tuple[str, ...]:
        """What is not stated of the criteria that one of ``NEEDS`` rests on."""
        return self._lacking(NEEDS[what])

    def _lacking(self, names: Iterable[str]) -> tuple[str, ...]:
        return tuple(name for name in names if getattr(self, name) is None and not (name == "life" and self.hours))

    @property
    def judges_machines(self) -> bool:
        """Whether single machines can be judged: by a life or a reliability."""
        return not (self.missing("life") and self.missing("reliability"))

    @property
    def tells_reliability(self) -> bool:
        """Whether strength and contact are stated, which a reliability needs."""
        return not self._lacking(STRENGTH)

    @property
    def asked(self) -> tuple[str, ...]:
        """Names of the criteria that are stated."""
        return tuple(
            name
            for name in parameters_of(self)
            if name in self.stated or getattr(self, name) != getattr(type(self), name)
        )

    def origin(self, name: str) -> str:
        """Who stated a criterion, or where its value comes from."""
        value, about = getattr(self, name), parameters_of(self)[name]
        if value is None:
            return "not stated"
        if name in self.stated:
            return self.stated[name]
        if name == "life" and self.hours is not None:
            return self.origin("hours")
        return "given" if value != getattr(type(self), name) else f"{about.provenance}: {about.source}"

    @property
    def not_judged(self) -> list[str]:
        """One line for each of ``NEEDS`` that is not judged, with what to state."""
        lines = []
        for what, names in NEEDS.items():
            missing = self.missing(what)
            present = [name for name in names if name not in missing]
            if missing == names:
                lines.append(f"{what}: not asked; state {listed(names)}")
            elif missing:
                told = listed([f"{name} ({self.origin(name)})" for name in present])
                verb = "is" if len(present) == 1 else "are"
                lines.append(f"{what}: not judged; {told} {verb} stated; state {listed(missing)} too")
        if self.machines_that_meet is not None and not self.judges_machines:
            told = self.origin("machines_that_meet")
            lines.append(f"machines that meet: not judged; machines_that_meet ({told}) needs a life or a reliability")
        return lines


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
class BearingEvaluation:
    """What forces mean for the bearing; NaN stands for what its criteria do not state.

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

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; an interval is a list of its ends, and None where nothing tells them."""

        def ends(interval: Interval) -> list[float | None] | None:
            return None if all(math.isnan(end) for end in interval) else plain(list(interval))

        intervals = ("life_interval", "reliability_interval")
        return {**plain(vars(self)), **{name: ends(getattr(self, name)) for name in intervals}}

    @property
    def tells_safety(self) -> bool:
        """Whether a safety factor follows from what is stated."""
        return not math.isnan(self.safety_factor)


def evaluate(blocks: list[Array], criteria: Criteria, method: str, seed: int = 0) -> BearingEvaluation:
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
    rating, required = criteria.load_rating, criteria.life
    stressed = None if criteria._lacking(NEEDS["safety factor"][1:]) else _stressed(blocks, criteria, seed)
    return BearingEvaluation(
        method=method,
        force=force,
        largest_force=largest,
        life=math.nan if rating is None else rating_life(force, rating, exponent),
        life_interval=Interval(
            *(math.nan if rating is None else rating_life(end, rating, exponent) for end in (high, low))
        ),
        conservative_life=math.nan if rating is None else conservative_life([largest], rating, exponent),
        required_load_rating=math.nan if required is None else required_load_rating(force, required, exponent),
        **(stressed or _UNSTRESSED),
    )


_UNSTRESSED: Mapping[str, Any] = {
    "reliability": math.nan,
    "reliability_interval": Interval(math.nan, math.nan),
    "normal_reliability": math.nan,
    "safety_factor": math.nan,
}


def _stressed(blocks: list[Array], criteria: Criteria, seed: int) -> Mapping[str, Any]:
    """Safety factor by the stresses of the blocks; reliability too where the scatter of the strength is stated."""
    mean_strength, radius, modulus = criteria.strength, criteria.contact_radius, criteria.contact_modulus
    assert mean_strength is not None
    assert radius is not None
    assert modulus is not None
    stresses = [criteria.fatigue_factor * hertz_pressure(block, radius, modulus) for block in blocks]
    found = {**_UNSTRESSED, "safety_factor": safety_factor(max(float(np.max(one)) for one in stresses), mean_strength)}
    if criteria.strength_deviation is None:
        return found
    strength = Strength(mean_strength, criteria.strength_deviation)
    survival = [strength.exceeds(stress) for stress in stresses]
    mean = float(np.mean([np.mean(stress) for stress in stresses]))
    square = float(np.mean([np.mean((stress - mean) ** 2) for stress in stresses]))
    return found | {
        "reliability": float(np.mean([reliability(stress, strength) for stress in stresses])),
        "reliability_interval": mean_interval(survival, criteria.confidence, seed),
        "normal_reliability": normal_reliability(mean, math.sqrt(square), *strength),
    }
