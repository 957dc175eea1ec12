"""The search space: parameters that are not in print, and the ranges within which a calibration moves them.

Printed and derived numbers stay: where one follows from the others (the static deflection of the beam, the first
frequency of the crank), it is solved for anew for every candidate.
"""

import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import scipy.optimize

from chaosgym.errors import ParameterError
from chaosgym.machines import THESIS_SLIDER_CRANK, ImpactBeam, Machine, SliderCrank
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from chaosgym.machines.slider_crank.machine import frequencies_at
from thesis.scorecard.quantities import lateral_mass
from thesis.statements import read_comparisons

STATIC_TIP_DEFLECTION = 3.175e-3
"""Tip deflection [m] under 8.9 N: a dimensionless clearance of 0.04 is 0.127 mm (thesis 3.5.1)."""

SLIDER_SHARE = 0.3175
"""Slider over lateral mass: +-0.254 mm is a dimensionless clearance of 0.016, so r m / M is 15.875 mm (4.5.1)."""

FIRST_FREQUENCY = 75.6
"""First natural frequency [Hz] of the crank's rod at crank angle zero (thesis 4.5.5)."""


@dataclass(frozen=True)
class Real:
    """A number between two bounds, searched evenly or, with ``log``, by ratio."""

    name: str
    low: float
    high: float
    unit: str = "-"
    log: bool = False

    def share(self, value: float) -> float:
        """Where a value lies in its range, 0 to 1; the nearer bound for one outside."""
        if self.log:
            found = math.log(value / self.low) / math.log(self.high / self.low)
        else:
            found = (value - self.low) / (self.high - self.low)
        return min(max(found, 0.0), 1.0)

    def at(self, share: float) -> float:
        """Value at a share of the range."""
        if self.log:
            return float(self.low * (self.high / self.low) ** share)
        return float(self.low + share * (self.high - self.low))


@dataclass(frozen=True)
class Basin:
    """One structure of a machine, and where its search begins.

    ``fixed`` are the fields that make the structure, ``dimensions`` the numbers that are searched, from ``start`` on.
    """

    name: str
    fixed: Mapping[str, Any]
    dimensions: tuple[Real, ...]
    start: Mapping[str, float]

    def shares(self) -> list[float]:
        """The start as shares of the ranges."""
        return [one.share(self.start[one.name]) for one in self.dimensions]

    def values(self, shares: Sequence[float]) -> dict[str, float]:
        """Numbers by name, from shares of the ranges."""
        return {one.name: one.at(float(share)) for one, share in zip(self.dimensions, shares, strict=True)}


@dataclass(frozen=True)
class SearchSpace:
    """What a calibration of one machine searches.

    Attributes
    ----------
    base : Machine
        Machine whose other fields stay.
    basins
        Structures, each with a start.
    build
        Machine from the base and the values of a candidate, fixed ones included; raises ``ParameterError`` if there is
        none.
    joint
        Joint whose statements are followed; None for all.
    """

    base: Machine
    basins: tuple[Basin, ...]
    build: Callable[[Any, Mapping[str, Any]], Machine]
    joint: str | None = None

    def machine(self, basin: Basin, shares: Sequence[float]) -> Machine:
        """Build the machine of one candidate."""
        values = {**basin.fixed, **basin.values(shares)}
        return self.build(self.base, {name: value for name, value in values.items() if name not in self.unprinted})

    def conditions(self, basin: Basin, shares: Sequence[float]) -> dict[str, float]:
        """Conditions that are not in print, as the candidate has them."""
        return {name: value for name, value in basin.values(shares).items() if name in self.unprinted}

    def only(self, beginning: str) -> "SearchSpace":
        """Return the space with those structures alone whose names begin so.

        Raises
        ------
        ParameterError
            If none does.
        """
        basins = tuple(one for one in self.basins if one.name.startswith(beginning))
        if not basins:
            known = ", ".join(repr(one.name) for one in self.basins)
            raise ParameterError(f"basin = {beginning!r} begins no name of a structure; known: {known}")
        return replace(self, basins=basins)

    def from_the_middle(self) -> "SearchSpace":
        """Return the space with every structure once, its search beginning in the middle of the ranges.

        The starts come from fits to all statements; a search that must not know some of them may not use them.
        """
        seen: dict[str, Basin] = {}
        for one in self.basins:
            structure = json.dumps([dict(one.fixed), [each.name for each in one.dimensions]], sort_keys=True)
            middle = {each.name: each.at(0.5) for each in one.dimensions}
            seen.setdefault(structure, replace(one, start=middle))
        return replace(self, basins=tuple(seen.values()))

    @property
    def unprinted(self) -> frozenset[str]:
        """Names of conditions that are not in print."""
        return frozenset(read_comparisons().unprinted)


def with_printed_deflection(beam: ImpactBeam) -> ImpactBeam:
    """The beam with the pivot's rotational stiffness that gives the printed static deflection.

    Raises
    ------
    ParameterError
        If no stiffness does.
    """

    def excess(stiffness: float) -> float:
        return static_tip_deflection(replace(beam, pivot_rotational_stiffness=stiffness)) - STATIC_TIP_DEFLECTION

    low, high = 1e-3, 1e5
    if excess(low) < 0.0 or excess(high) > 0.0:
        raise ParameterError(
            f"shaker_stiffness = {beam.shaker_stiffness:g} N/m at force_position = {beam.force_position:g} m is out of "
            f"range; allowed: values that leave a static deflection of {1e3 * STATIC_TIP_DEFLECTION:g} mm to the pivot"
        )
    stiffness = scipy.optimize.brentq(excess, low, high, xtol=1e-4, rtol=1e-9)
    return replace(beam, pivot_rotational_stiffness=round(float(stiffness), 4))


def with_printed_frequency(crank: SliderCrank, inertia_ratio: float) -> SliderCrank:
    """The crank with end inertias of a given ratio, yoke to housing, that give the printed first frequency.

    Raises
    ------
    ParameterError
        If an inertia falls below what the body's offset centre of gravity requires.
    """

    def excess(log_inertia: float) -> float:
        housing = math.exp(log_inertia)
        trial = replace(
            crank,
            housing_inertia=housing,
            yoke_inertia=housing * inertia_ratio,
            housing_offset_along=0.0,
            housing_offset_across=0.0,
            yoke_offset_along=0.0,
            yoke_offset_across=0.0,
        )
        return float(frequencies_at(trial, 0.0)[0]) - FIRST_FREQUENCY

    housing = math.exp(scipy.optimize.brentq(excess, math.log(1e-5), math.log(1e-1), xtol=1e-8))
    return replace(crank, housing_inertia=housing, yoke_inertia=housing * inertia_ratio)


def _beam(base: ImpactBeam, values: Mapping[str, Any]) -> Machine:
    return with_printed_deflection(replace(base, **values))


def _crank(base: SliderCrank, values: Mapping[str, Any]) -> Machine:
    """The crank of a candidate: end inertias by the first frequency, masses by the printed dimensionless clearance."""
    fields = dict(values)
    ratio, lateral = fields.pop("inertia_ratio"), fields.pop("lateral_mass")
    slider, offset = SLIDER_SHARE * lateral, fields.get("slider_offset_across", 0.0)
    plain = {"housing_inertia": 1.0, "yoke_inertia": 1.0, "slider_mass": slider}
    block = base.slider_pitch_inertia + slider * offset**2
    crank = with_printed_frequency(replace(base, **{**fields, **plain}, slider_pitch_inertia=block), ratio)
    without = lateral_mass(replace(crank, yoke_mass=0.0))
    yoke = (lateral - without) / (1.0 + 2.0 * crank.yoke_offset_along / crank.rod_length)
    return replace(crank, yoke_mass=yoke)


BEAM_FIELDS = (
    Real("width", 4e-3, 60e-3, "m", log=True),
    Real("force_position", 0.06, 0.278, "m"),
    Real("shaker_damping", 0.3, 300.0, "N s/m", log=True),
    Real("shaker_stiffness", 1.0, 3000.0, "N/m", log=True),
    Real("pivot_translational_stiffness", 1e3, 1e9, "N/m", log=True),
    Real("shaker_mass", 0.0, 0.3, "kg"),
)

CRANK_FIELDS = (
    Real("contact_stiffness", 8e6, 4e7, "N/m", log=True),
    Real("lateral_mass", 0.4, 0.9, "kg"),
    Real("housing_offset_along", -0.03, 0.03, "m"),
    Real("yoke_offset_along", -0.040, 0.030, "m"),
    Real("inertia_ratio", 0.25, 4.0, "-", log=True),
    Real("damping_ratio", 1e-3, 0.06, "-", log=True),
    Real("damping_exponent", 0.0, 2.0),
    Real("contact_damping_mass", 0.2, 20.0, "kg", log=True),
    Real("damping_of_section_4_4", 0.005, 0.05, "-", log=True),
)

_WITHOUT_FUDGES = tuple(one for one in CRANK_FIELDS if one.name not in ("contact_damping_mass", "yoke_offset_along"))

_PITCH = (Real("slider_offset_across", 0.02, 0.07, "m"), Real("sensor_distance", 0.03, 0.05, "m"))

_TILTING: Mapping[str, Any] = {"slider_joint": "instrumented", "gravity": 9.81}
_POWER: Mapping[str, Any] = {"damping_family": "power", "housing_mass": 0.16}
_ALONG: Mapping[str, Any] = {
    "gravity": 9.81,
    "gravity_angle": -90.0,
    "contact_damping_mass": 0.0,
    "yoke_offset_along": 0.0,
}
"""Gravity along the guide, the yoke on its pivot, and contact damping by the mass of slider and yoke."""


def _numbers(fields: tuple[Real, ...], *values: float) -> dict[str, float]:
    return {one.name: value for one, value in zip(fields, values, strict=True)}


SEARCH_SPACES: Mapping[str, SearchSpace] = {
    ImpactBeam.name: SearchSpace(
        ImpactBeam(),
        (
            Basin(
                "soft pivot, damping of the beam",
                {"damping_family": "beam"},
                BEAM_FIELDS,
                _numbers(BEAM_FIELDS, 0.02934215, 0.2207116, 51.17915, 34.84915, 25888.36, 0.00152),
            ),
            Basin(
                "soft pivot, uniform damping",
                {"damping_family": "uniform"},
                BEAM_FIELDS,
                _numbers(BEAM_FIELDS, 0.01796204, 0.2079303, 53.17532, 24.02252, 14981.86, 0.03966861),
            ),
            Basin(
                "soft pivot, damping by frequency",
                {"damping_family": "stiffness"},
                BEAM_FIELDS,
                _numbers(BEAM_FIELDS, 0.0267, 0.212, 57.0, 22.0, 23000.0, 0.001),
            ),
            Basin(
                "hard pivot, damping of the beam",
                {"damping_family": "beam"},
                BEAM_FIELDS,
                _numbers(BEAM_FIELDS, 0.02761152, 0.1856788, 57.46777, 97.33696, 18144014.0, 0.0),
            ),
        ),
        _beam,
    ),
    SliderCrank.name: SearchSpace(
        THESIS_SLIDER_CRANK,
        (
            Basin(
                "weightless, bouncing decides",
                _POWER,
                CRANK_FIELDS,
                _numbers(
                    CRANK_FIELDS, 1.4865e7, 0.6, -0.010736, 0.017667, 0.96226, 0.012488, 1.28105, 8.10882, 0.01485
                ),
            ),
            Basin(
                "weightless, softer rod",
                _POWER,
                CRANK_FIELDS,
                _numbers(
                    CRANK_FIELDS, 1.55171e7, 0.564, -0.01355, 0.018438, 1.035287, 0.010768, 1.32567, 6.90793, 0.015223
                ),
            ),
            Basin(
                "under gravity, tilting slider",
                {**_POWER, **_TILTING},
                (*CRANK_FIELDS, *_PITCH),
                _numbers(
                    (*CRANK_FIELDS, *_PITCH),
                    *(2.98e7, 0.50, 0.0, 0.0, 1.0, 0.0032, 1.0, 2.0, 0.015, 0.0505, 0.043),
                ),
            ),
            Basin(
                "gravity along the guide",
                {**_POWER, **_ALONG},
                _WITHOUT_FUDGES,
                _numbers(_WITHOUT_FUDGES, 1.55171e7, 0.564, -0.01355, 1.035287, 0.010768, 1.32567, 0.015223),
            ),
        ),
        _crank,
        "slider",
    ),
}
"""By machine. Ranges end where physics does or where no candidate came; ``walls`` checks it. Starts: earlier fits."""
