"""Margins of a periodic response: how far each parameter may move until the motion loses its stability, and how.

Each parameter that has a tolerance is varied alone, to either side, up to some tolerances away. Where the orbits on
the way are far from losing their stability, have the same contacts and lie nearly in a line, nothing happens between
them; elsewhere the branch is followed until stability ends.

A margin follows this motion. What lives beside it, ``coexistence`` tells.
"""

import math
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
from chaosgym.core import matrices
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, run_period
from chaosgym.diagnosis.response_type import Tolerance, chosen_tolerances
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.errors import DiagnosisError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.numbers import number
from chaosgym.plain import Result

REACH = 1.0
"""Tolerances up to which stability is followed."""

CALM = 0.9
"""Largest multiplier of orbits between which nothing is looked for."""

BENT, HALVINGS = 0.3, 4
"""Share of the way from one orbit to another by which that in the middle may lie beside the line, so that nothing is
looked for between them; and how often the way is halved until that is so."""


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
class Margins(Result):
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

    shows = "largest_multiplier margins nearest tolerances"

    largest_multiplier: float
    margins: tuple[Margin, ...]
    tolerances: Mapping[str, Tolerance]

    @property
    def nearest(self) -> Margin | None:
        """The loss of stability that is the fewest tolerances away, or None."""
        ends = [margin for margin in self.margins if margin.kind is not None]
        return min(ends, key=lambda margin: margin.share, default=None)


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
    number("reach", reach, 0.0, unit="tolerances", inside=True, error=DiagnosisError)
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
    """Margins of a machine whose response is diagnosed; None unless an orbit that attracts is proven.

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
    orbit = verdict.orbit
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
    ends = {side: _calm(family, np.append(here[:-1], place), contacts) for side, place in ((-1, 0.0), (1, 1.0))}
    straight = _straight(here, ends[-1], ends[1])
    quiet = {
        side: straight or (end is not None and _quiet(family, here, end, contacts, HALVINGS))
        for side, end in ends.items()
    }
    start: OrbitPoint | None = None
    if not all(quiet.values()):
        family = with_noise(family, orbit.state)
        try:
            family, start = better_section(*family.with_mirror(family.solve(here, normal)))
        except NotFollowedError as reason:
            told = f"not followed: {reason}"
            return [Margin(name, side, 0.0, nominal, None, told) for side in (-1, 1)]
    result = []
    for side, value in ((-1, low), (1, high)):
        if value == nominal:
            result.append(Margin(name, side, 0.0, value, None, "end of the field's range"))
        elif start is None or quiet[side]:
            result.append(Margin(name, side, _share(tolerance, nominal, value), value, None))
        else:
            result.append(_followed(family, start, side, name, tolerance, nominal))
    return result


def _straight(here: Array, below: OrbitPoint | None, above: OrbitPoint | None) -> bool:
    """Whether the orbits at both ends are calm, and the nominal one lies nearly in a line with them."""
    if below is None or above is None:
        return False
    way = above.x[:-1] - below.x[:-1]
    beside = here[:-1] - below.x[:-1] - here[-1] * way
    return float(matrices.norm(beside)) <= BENT * max(float(matrices.norm(way)), 1e-12)


def _quiet(family: OrbitFamily, here: Array, end: OrbitPoint, contacts: tuple[int, ...], halvings: int) -> bool:
    """Whether the orbits between two are calm and, between as many of them as that takes, lie nearly in a line."""
    guess = 0.5 * (here + end.x)
    middle = _calm(family, guess, contacts, end.solved)
    if middle is None:
        return False
    way = float(matrices.norm((end.x - here)[:-1]))
    if float(matrices.norm((middle.x - guess)[:-1])) <= BENT * max(way, 1e-12):
        return True
    return halvings > 0 and all(
        _quiet(family, one, other, contacts, halvings - 1) for one, other in ((here, middle), (middle.x, end))
    )


def _calm(family: OrbitFamily, guess: Array, contacts: tuple[int, ...], near: Array | None = None) -> OrbitPoint | None:
    """The orbit at the field's value of a guess if Newton's method leads there and it is far from losing stability.

    ``near`` as in ``OrbitFamily.solve``.
    """
    normal = np.append(np.zeros(len(guess) - 1), 1.0)
    try:
        point = family.solve(guess, normal, np.zeros(len(guess) - 1), near=() if near is None else (near,), exact=False)
    except NotFollowedError:
        return None
    return point if point.impacts == contacts and point.largest_multiplier < CALM else None


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
        return abs(math.log(value / nominal)) / math.log1p(tolerance.value)
    return abs(value - nominal) / tolerance.value
