r"""Wear of the joint by Archard's law: growth of the clearance, and hours until its limit (thesis 5.5.2, wear).

    h = K W s / (H A)                      depth h of a surface of area A under the load W along the sliding distance s

with the wear coefficient K and the hardness H of the softer surface. Each surface carries the mean of its contact force
over the cycle while the parts slide by each other. Half the gap grows by half of what both surfaces lose; its rate is
computed anew on a row of clearances up to the limit, from the response at each. Sliding is an input, since the models
hold the motion across the gap alone; what impacts remove without sliding is left out.

K is known to a factor at best, which the times are divided and multiplied by.

References
----------
J. F. Archard, Contact and rubbing of flat surfaces, Journal of Applied Physics 24 (1953), 981-988.
R. G. Budynas, J. K. Nisbett, Shigley's Mechanical Engineering Design, 10th ed., section 12-15.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.design.runs import DIAGNOSIS_BUDGET
from chaosgym.design.texts import hours_text, life_text
from chaosgym.design.trends import HISTORY_SAMPLES
from chaosgym.diagnosis import diagnose
from chaosgym.errors import DesignError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameter, parameters_of, validate, with_settings
from chaosgym.numbers import number
from chaosgym.plain import Result
from chaosgym.series import Nature
from chaosgym.simulation import MotionState, rest_state, simulate
from chaosgym.simulation.parallel import parallel_map

STEPS = 12
"""Steps of the clearance from nominal to the limit."""

CYCLES = 40
"""Cycles over which the mean force of a response is taken that does not repeat."""


@dataclass(frozen=True, kw_only=True)
class Wear:
    """Data of Archard's law, in SI units.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range.
    """

    limit: float = parameter(1e-3, unit="m", low=0.0, high=1.0, provenance="assumed", source="an example")
    """Clearance at which the joint is worn out [m], half the gap as the machine's own."""
    sliding: float = parameter(1e-3, unit="m", low=0.0, high=1e3, provenance="assumed", source="an example")
    """Sliding of the parts by each other in a cycle [m]."""
    area: float = parameter(1e-5, unit="m^2", low=1e-12, high=1e2, provenance="assumed", source="an example")
    """Area of a surface over which wear spreads [m^2]."""
    hardness: float = parameter(2e9, unit="Pa", low=1e5, high=1e12, provenance="assumed", source="soft steel, 200 HB")
    """Hardness of the softer surface [Pa]."""
    coefficient: float = parameter(1e-5, low=1e-12, high=1.0, provenance="assumed", source="lubricated steel")
    """Wear coefficient K."""
    uncertainty: float = parameter(3.0, low=1.0, high=1e3, provenance="assumed", source="scatter of published K")
    """Factor to which K is known."""

    def __post_init__(self) -> None:
        validate(self)


def wear_depth(load: float, sliding: float, area: float, hardness: float, coefficient: float) -> float:
    """Depth [m] that Archard's law removes of a surface.

    Parameters
    ----------
    load
        [N].
    sliding
        Distance [m].
    area
        [m^2].
    hardness
        Of the softer surface [Pa].
    coefficient
        K.

    Examples
    --------
    >>> round(wear_depth(100.0, 1000.0, 1e-4, 2e9, 1e-5) * 1e6, 6)
    5.0
    """
    return coefficient * load * sliding / (hardness * area)


class Worn(NamedTuple):
    """What happens when the clearance has grown: when, what the response is then, and its largest peak force [N]."""

    clearance: float
    hours: float
    nature: Nature
    largest_peak: float


@dataclass(frozen=True)
class WearLife(Result):
    """How a joint wears.

    Attributes
    ----------
    wear
        What was asked.
    course
        From the nominal clearance to the limit, in hours of operation; infinite beyond a clearance without contact.
    """

    shows = "wear assured_hours=assured course"

    wear: Wear
    course: tuple[Worn, ...]

    @property
    def hours(self) -> float:
        """Hours until the limit of the clearance."""
        return self.course[-1].hours

    @property
    def assured(self) -> float:
        """Those hours over the factor to which the coefficient is known."""
        return self.hours / self.wear.uncertainty

    @property
    def change(self) -> Worn | None:
        """The first point whose nature is another than the nominal one's."""
        return next((one for one in self.course if one.nature != self.course[0].nature), None)

    @property
    def told(self) -> list[str]:
        """Lines for people."""

        def span(hours: float) -> str:
            if not np.isfinite(hours):
                return "never: a gap without contact does not wear"
            factor = self.wear.uncertainty
            return f"{hours_text(hours)} ({life_text(hours / factor)} to {life_text(hours * factor)})"

        lines = [f"wear to the limit of {1e3 * self.wear.limit:g} mm: {span(self.hours)}"]
        if self.change is not None:
            after = f"{self.change.nature} from {1e3 * self.change.clearance:.4g} mm on"
            lines.append(f"worn, the response is {after}, after {span(self.change.hours)}")
        return lines


def worn_clearances(machine: Machine, wear: Wear) -> Array:
    """Clearances [m] that a joint passes, from the machine's own to the limit, evenly spaced.

    Raises
    ------
    DesignError
        If the limit is no larger than the machine's clearance, or that is an angle.
    ParameterError
        If the limit is out of the clearance's range.

    Examples
    --------
    >>> from chaosgym.design.wear import Wear, worn_clearances
    >>> worn_clearances(chaosgym.ImpactBeam(), Wear(limit=2e-4, sliding=1e-4, area=1e-5))[[0, -1]]
    array([0.000127, 0.0002  ])
    """
    name = machine.clearance_field
    nominal = float(getattr(machine, name))
    if parameters_of(machine)[name].unit != "m":
        raise DesignError(f"[archard] needs a clearance that is a length; {name} is an angle")
    if not wear.limit > nominal:
        raise DesignError(
            f"archard.limit = {wear.limit:g} m is out of range; allowed: above the clearance, {nominal:g} m"
        )
    with_settings(machine, {name: wear.limit})
    return np.linspace(nominal, wear.limit, STEPS + 1)


def wear_life(machine: Machine, wear: Wear, *, workers: int | None = None) -> WearLife:
    """Course of a joint's clearance as it wears, each clearance run from rest.

    Parameters
    ----------
    machine
        The nominal machine.
    wear
        Data of Archard's law.
    workers
        Number of threads; all processors by default.

    Raises
    ------
    DesignError
        If the limit is no larger than the machine's clearance, or that is an angle.
    ParameterError
        If the limit is out of the clearance's range.
    SimulationError
        If a run can't be finished.

    Examples
    --------
    >>> from chaosgym.design.wear import Wear, wear_life
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0)
    >>> found = wear_life(beam, Wear(limit=2e-4, sliding=1e-4, area=1e-5))
    >>> found.course[0].clearance, found.course[-1].clearance
    (0.000127, 0.0002)
    """
    gaps = worn_clearances(machine, wear)
    runs = parallel_map(
        _loads,
        [machine.at(clearance=float(gap)) for gap in gaps],
        workers=workers,
    )
    depth = np.array([wear_depth(load, wear.sliding, wear.area, wear.hardness, wear.coefficient) for load, *_ in runs])
    hours_a_metre = _inverse(0.5 * depth * 3600.0 / machine.cycle_period)
    steps = 0.5 * (hours_a_metre[1:] + hours_a_metre[:-1]) * np.diff(gaps)
    hours = np.concatenate([[0.0], np.cumsum(steps)])
    course = (Worn(float(gap), float(hour), *run[1:]) for gap, hour, run in zip(gaps, hours, runs, strict=True))
    return WearLife(wear, tuple(course))


def wear_over(found: Sequence[WearLife], shares: Sequence[float]) -> WearLife:
    """Course of a joint that spends shares of its time at several speeds; nature and force are those of the first.

    Parameters
    ----------
    found
        Course at each speed, over the same clearances.
    shares
        Of the operating time, which add up to 1.

    Examples
    --------
    >>> from chaosgym.design.wear import Wear, wear_life, wear_over
    >>> wear = Wear(limit=2e-4, sliding=1e-4, area=1e-5)
    >>> slow, fast = (wear_life(chaosgym.ImpactBeam(excitation_frequency=speed), wear) for speed in (8.0, 12.0))
    >>> fast.hours < wear_over([slow, fast], [0.5, 0.5]).hours < slow.hours
    True
    """
    with np.errstate(invalid="ignore"):
        steps = np.array([np.diff([one.hours for one in life.course]) for life in found])
    steps[np.isnan(steps)] = np.inf  # beyond a clearance from which on it does not wear
    rates = sum(share * _inverse(row) for share, row in zip(shares, steps, strict=True))
    hours = np.concatenate([[0.0], np.cumsum(_inverse(np.asarray(rates)))])
    course = (one._replace(hours=float(hour)) for one, hour in zip(found[0].course, hours, strict=True))
    return WearLife(found[0].wear, tuple(course))


def _inverse(values: Array) -> Array:
    return np.array([1.0 / value if value > 0.0 else np.inf for value in values])


def _loads(machine: Machine) -> tuple[float, Nature, float]:
    """Mean force of a cycle on both surfaces of the joint together [N], nature, and largest peak [N]."""
    verdict = diagnose(machine, budget=DIAGNOSIS_BUDGET)
    repeats = verdict.period if verdict.nature == "periodic" else None
    state = MotionState(np.asarray(verdict.evidence["final_state"]), rest_state(machine).bouncing)
    settled = simulate(machine, repeats or CYCLES, state, samples_per_cycle=HISTORY_SAMPLES)
    gap = machine.clearance_field.removesuffix("_clearance")
    first = 2 * machine.joints.index(gap) if gap in machine.joints else 0
    force = settled.surface_force[..., first : first + 2]
    return float(np.mean(np.maximum(force, 0.0).sum(axis=-1))), verdict.nature, float(settled.peak_force.max())


def read_wear(values: Mapping[str, float]) -> Wear:
    """Wear of a brief, of whose data the limit, the sliding and the area must be given.

    Raises
    ------
    DesignError
        If one of them is missing.
    ParameterError
        If one is out of its range.

    Examples
    --------
    >>> from chaosgym.design.wear import read_wear
    >>> read_wear({"limit": 2e-4, "sliding": 1e-4, "area": 1e-5}).limit
    0.0002
    """
    for name in ("limit", "sliding", "area"):
        if name not in values:
            raise DesignError(f"[archard] lacks {name}")
        number(f"archard.{name}", values[name], 0.0, inside=True)
    return Wear(**values)
