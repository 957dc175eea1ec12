"""Margins of a periodic response: how far each parameter may move until the motion loses its stability, and how.

Each parameter that has a tolerance is varied alone, to either side, up to some tolerances away. Where the orbits at
both ends are stable, have the same contacts and lie nearly in a line with the nominal one, nothing happens between
them; elsewhere the branch is followed until stability ends.

A margin follows this motion. What lives beside it, ``coexistence`` tells.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation import Kind
from chaosgym.branches.branch import stretch
from chaosgym.branches.family_along import family_of, with_noise
from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily, contacts_of
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.branches.section import better_section
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit, run_period
from chaosgym.diagnosis.response_type import Tolerance, chosen_tolerances
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of

REACH = 1.0
"""Tolerances up to which stability is followed."""

CALM = 0.9
"""Largest multiplier of orbits between which nothing is looked for."""

BENT = 0.3
"""Share of the way from one end to the other by which the nominal orbit may lie beside its middle, so that the ends
decide."""


class Margin(NamedTuple):
    """How far one parameter may move to one side.

    Attributes
    ----------
    parameter, side
        Which, and -1 or +1.
    share
        Distance in tolerances: to where stability ends, or as far as it was followed.
    value
        The parameter's value there.
    kind
        Bifurcation at which stability ends, or at which the motion itself ends on the one that it once began at: a
        doubled one at a flip, one without symmetry at a symmetry breaking. None if there is none so far.
    end
        Why it was not followed further; empty if stability ends or the reach is reached.
    """

    parameter: str
    side: int
    share: float
    value: float
    kind: Kind | None
    end: str = ""


@dataclass(frozen=True, kw_only=True)
class Margins:
    """Margins of a periodic response.

    Attributes
    ----------
    largest_multiplier
        Of the orbit.
    margins
        Below and above for each parameter.
    tolerances
        By field.
    """

    largest_multiplier: float
    margins: tuple[Margin, ...]
    tolerances: Mapping[str, Tolerance]

    @property
    def nearest(self) -> Margin | None:
        """The loss of stability that is the fewest tolerances away, or None."""
        ends = [margin for margin in self.margins if margin.kind is not None]
        return min(ends, key=lambda margin: margin.share, default=None)

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        return {
            "largest_multiplier": self.largest_multiplier,
            "margins": [margin._asdict() for margin in self.margins],
            "nearest": self.nearest._asdict() if self.nearest else None,
            "tolerances": {name: tolerance._asdict() for name, tolerance in self.tolerances.items()},
        }


def margins(
    machine: Machine,
    orbit: PeriodicOrbit,
    tolerances: Mapping[str, Tolerance] | None = None,
    *,
    reach: float = REACH,
) -> Margins:
    """Distance of a periodic orbit to the nearest loss of stability along each tolerance.

    Parameters
    ----------
    machine
        The nominal machine.
    orbit
        A certified orbit of it; ``find_periodic_orbit`` gives it from a settled state.
    tolerances
        By field; ``default_tolerances(machine)`` by default.
    reach
        Tolerances up to which stability is followed.

    Raises
    ------
    DiagnosisError
        If the orbit is not certified, or ``reach`` is not above 0.

    Examples
    --------
    >>> from chaosgym.diagnosis import Tolerance, find_periodic_orbit
    >>> from chaosgym.branches.margins import margins
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0)
    >>> orbit = find_periodic_orbit(beam, chaosgym.simulate(beam, 1, transient=50).final_state, period=1)
    >>> found = margins(beam, orbit, {"clearance": Tolerance(0.05)})
    >>> found.nearest is None  # stable throughout the tolerance
    True
    """
    if not orbit.certified:
        raise DiagnosisError("margins need a periodic orbit that is certified; allowed: one that closes and attracts")
    if not reach > 0.0:
        raise DiagnosisError(f"reach = {reach:g} tolerances is out of range; allowed: above 0")
    chosen = chosen_tolerances(machine, tolerances, "parameters")
    contacts = contacts_of(run_period(machine, orbit.state, orbit.period))
    found = tuple(
        margin
        for name, tolerance in chosen.items()
        for margin in _along(machine, orbit, contacts, name, tolerance, reach)
    )
    return Margins(
        largest_multiplier=orbit.largest_multiplier,
        margins=found,
        tolerances=chosen,
    )


def margins_of(
    machine: Machine, verdict: MachineDiagnosis, tolerances: Mapping[str, Tolerance] | None = None, **how: Any
) -> Margins | None:
    """Margins of a machine whose response is diagnosed; None unless it is periodic and proven.

    Parameters
    ----------
    machine
        The nominal machine.
    verdict
        ``diagnose(machine)``.
    tolerances, how
        As for ``margins``.

    Examples
    --------
    >>> import chaosgym
    >>> from chaosgym.branches.margins import margins_of
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=19.0)
    >>> margins_of(beam, chaosgym.diagnose(beam)).nearest.kind  # doctest: +SKIP
    'fold'
    """
    if verdict.status != "certified" or verdict.period is None:
        return None
    orbit = find_periodic_orbit(machine, verdict.evidence["final_state"], verdict.period)
    return margins(machine, orbit, tolerances, **how) if orbit is not None and orbit.certified else None


def _along(
    machine: Machine, orbit: PeriodicOrbit, contacts: tuple[int, ...], name: str, tolerance: Tolerance, reach: float
) -> list[Margin]:
    """Margins of one parameter, below and above."""
    nominal, allowed = float(getattr(machine, name)), parameters_of(machine)[name]
    low, high = (float(np.clip(tolerance.at(nominal, side * reach), allowed.low, allowed.high)) for side in (-1, 1))
    if not low < high:
        return []
    family = family_of(machine, name, low, high, orbit.state, orbit.period)
    here = np.append(family.weight * orbit.state, (nominal - low) / (high - low))
    normal = np.append(np.zeros(len(orbit.state)), 1.0)
    below = _calm_end(family, here, contacts, normal, 0.0)
    above = _calm_end(family, here, contacts, normal, 1.0) if below is not None else None
    start: OrbitPoint | None = None
    if below is None or above is None or not _straight(here, below, above):
        family = with_noise(family, orbit.state)
        try:
            family, start = better_section(*family.with_mirror(family.solve(here, normal)))
        except NotFollowedError as reason:
            told = f"not followed: {reason}"
            return [Margin(name, side, 0.0, nominal, None, told) for side in (-1, 1)]
    found = []
    for side, value in ((-1, low), (1, high)):
        if value == nominal:
            found.append(Margin(name, side, 0.0, value, None, "end of the field's range"))
        elif start is None:
            found.append(Margin(name, side, _share(tolerance, nominal, value), value, None))
        else:
            found.append(_followed(family, start, side, name, tolerance, nominal))
    return found


def _calm_end(
    family: OrbitFamily, here: Array, contacts: tuple[int, ...], normal: Array, border: float
) -> OrbitPoint | None:
    """The orbit at an end of the range if Newton's method leads there and it is far from losing its stability."""
    guess = np.append(here[:-1], border)
    try:
        point = family.solve(guess, normal, np.zeros(len(here) - 1), exact=False)
    except NotFollowedError:
        return None
    return point if point.impacts == contacts and point.largest_multiplier < CALM else None


def _straight(here: Array, below: OrbitPoint, above: OrbitPoint) -> bool:
    way = above.x[:-1] - below.x[:-1]
    share = here[-1]
    beside = here[:-1] - below.x[:-1] - share * way
    return float(np.linalg.norm(beside)) <= BENT * max(float(np.linalg.norm(way)), 1e-12)


def _followed(
    family: OrbitFamily, start: OrbitPoint, side: int, name: str, tolerance: Tolerance, nominal: float
) -> Margin:
    begun = replace(start, tangent=side * start.tangent)
    try:
        ahead = stretch(
            family, begun, longest_step=0.25, first_step=0.1, until=lambda one: one.loses_stability, closely=False
        )
    except NotFollowedError as reason:
        return Margin(name, side, 0.0, nominal, None, f"not followed: {reason}")
    lost = [each.bifurcation for each in ahead.found if each.bifurcation.loses_stability or each.bifurcation.ends]
    if lost:
        return Margin(name, side, _share(tolerance, nominal, lost[0].value), lost[0].value, lost[0].kind)
    value = family.value(ahead.points[-1].x[-1])
    end = "" if ahead.end.startswith("end of the range") else ahead.end
    return Margin(name, side, _share(tolerance, nominal, value), value, None, end)


def _share(tolerance: Tolerance, nominal: float, value: float) -> float:
    """Distance of a value from the nominal one in tolerances."""
    if tolerance.relative:
        return float(abs(np.log(value / nominal)) / np.log1p(tolerance.value))
    return abs(value - nominal) / tolerance.value
