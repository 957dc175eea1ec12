"""The search space: parameters that are not in print, and the ranges within which a calibration moves them.

Printed and derived numbers stay: where one follows from the others (the static deflection of the beam, the first
frequency of the crank), it is solved for anew for every candidate.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import scipy.optimize

from chaosgym.errors import ParameterError
from chaosgym.machines import THESIS_IMPACT_BEAM, THESIS_SLIDER_CRANK, ImpactBeam, Machine, SliderCrank
from chaosgym.machines.impact_beam.modes import static_tip_deflection
from chaosgym.machines.slider_crank.parameters import frequencies_at

STATIC_TIP_DEFLECTION = 3.175e-3
"""Tip deflection [m] under 8.9 N: a dimensionless clearance of 0.04 is 0.127 mm (thesis 3.5.1)."""

FIRST_FREQUENCY = 75.6
"""First natural frequency [Hz] of the crank's rod at crank angle zero (thesis 4.5.5)."""


@dataclass(frozen=True)
class Real:
    """A number between two bounds, searched evenly or, with ``log``, by ratio."""

    name: str
    low: float
    high: float
    unit: str
    log: bool = False


@dataclass(frozen=True)
class Whole:
    """A whole number between two bounds, both included."""

    name: str
    low: int
    high: int
    unit: str = "-"


@dataclass(frozen=True)
class Word:
    """One of several words."""

    name: str
    choices: tuple[str, ...]
    unit: str = "-"


Dimension = Real | Whole | Word


@dataclass(frozen=True)
class SearchSpace:
    """What a calibration of one machine searches.

    Attributes
    ----------
    base : Machine
        Machine whose other fields stay.
    dimensions
        What is searched.
    build
        Machine from the base and one value for each dimension; raises ``ParameterError`` if there is none.
    starts
        Candidates to try first; the first one gives the present constants.
    random_trials
        Candidates before the estimator takes over from chance: fewer where a candidate costs more.
    """

    base: Machine
    dimensions: tuple[Dimension, ...]
    build: Callable[[Any, Mapping[str, Any]], Machine]
    starts: tuple[Mapping[str, Any], ...]
    random_trials: int

    def machine(self, values: Mapping[str, Any]) -> Machine:
        """Build the machine of one candidate."""
        return self.build(self.base, values)


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
    fields = {name: value for name, value in values.items() if name != "inertia_ratio"}
    offsets = {f"{body}_inertia": 1.0 for body in ("housing", "yoke")}
    return with_printed_frequency(replace(base, **{**fields, **offsets}), values["inertia_ratio"])


_BEAM_FIELDS = (
    Real("width", 12e-3, 26e-3, "m"),
    Real("force_position", 0.12, 0.22, "m"),
    Real("shaker_mass", 0.0, 0.3, "kg"),
    Real("shaker_damping", 5.0, 120.0, "N s/m", log=True),
    Real("pivot_translational_stiffness", 1e6, 1e9, "N/m", log=True),
    Word("damping_family", ("uniform", "stiffness")),
    Whole("n_modes", 4, 8),
)

_CRANK_FIELDS = (
    Real("slider_mass", 0.10, 0.35, "kg"),
    Real("yoke_mass", 0.05, 0.30, "kg"),
    Real("housing_mass", 0.15, 0.60, "kg"),
    Real("housing_offset_along", -0.010, 0.035, "m"),
    Real("yoke_offset_along", -0.040, 0.030, "m"),
    Real("inertia_ratio", 0.25, 4.0, "-", log=True),
    Real("damping_ratio", 5e-4, 0.06, "-", log=True),
    Word("damping_family", ("uniform", "stiffness")),
    Whole("n_modes", 2, 6),
    Word("geometric_stiffness", ("off", "on")),
)


def _present(machine: Machine, dimensions: tuple[Dimension, ...]) -> dict[str, Any]:
    return {one.name: getattr(machine, one.name) for one in dimensions if hasattr(machine, one.name)}


SEARCH_SPACES: Mapping[str, SearchSpace] = {
    ImpactBeam.name: SearchSpace(
        THESIS_IMPACT_BEAM,
        _BEAM_FIELDS,
        _beam,
        (
            _present(THESIS_IMPACT_BEAM, _BEAM_FIELDS),
            {
                "width": 17.71e-3,
                "force_position": 0.1969,
                "shaker_mass": 0.111,
                "shaker_damping": 30.4,
                "pivot_translational_stiffness": 9.7e7,
                "damping_family": "stiffness",
                "n_modes": 5,
            },
            {
                "width": 12.7e-3,
                "force_position": 0.160,
                "shaker_mass": 0.195,
                "shaker_damping": 11.3,
                "pivot_translational_stiffness": 3.6e7,
                "damping_family": "stiffness",
                "n_modes": 7,
            },
            {
                "width": 25.4e-3,
                "force_position": 0.209,
                "shaker_mass": 0.1,
                "shaker_damping": 30.0,
                "pivot_translational_stiffness": 1e8,
                "damping_family": "uniform",
                "n_modes": 5,
            },
            {
                "width": 0.0210043483,
                "force_position": 0.2010367187,
                "shaker_mass": 0.1016893242,
                "shaker_damping": 43.65022747,
                "pivot_translational_stiffness": 36299594.42,
                "damping_family": "stiffness",
                "n_modes": 5,
            },
        ),
        60,
    ),
    SliderCrank.name: SearchSpace(
        THESIS_SLIDER_CRANK,
        _CRANK_FIELDS,
        _crank,
        (
            {
                **_present(THESIS_SLIDER_CRANK, _CRANK_FIELDS),
                "inertia_ratio": THESIS_SLIDER_CRANK.yoke_inertia / THESIS_SLIDER_CRANK.housing_inertia,
            },
            {
                **_present(THESIS_SLIDER_CRANK, _CRANK_FIELDS),
                "slider_mass": 0.12,
                "yoke_mass": 0.26,
                "yoke_offset_along": 0.02,
                "inertia_ratio": 1.8,
            },
            {
                "slider_mass": 0.118758,
                "yoke_mass": 0.244289,
                "housing_mass": 0.545084,
                "housing_offset_along": 0.0101523,
                "yoke_offset_along": 0.0114435,
                "inertia_ratio": 1.98658,
                "damping_ratio": 0.0430875,
                "damping_family": "stiffness",
                "n_modes": 4,
                "geometric_stiffness": "off",
            },
        ),
        20,
    ),
}
"""By machine. Ranges and candidates: algebra on printed numbers, and fits that preceded this one."""
