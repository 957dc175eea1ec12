"""How far a motion stays stable along the speed: where one falls out of it on the way up and on the way down."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from chaosgym.branches.bifurcation import Kind
from chaosgym.branches.branch import stretch
from chaosgym.branches.family_along import family_of, with_noise
from chaosgym.branches.orbit_family import NotFollowedError, OrbitFamily
from chaosgym.branches.orbit_point import OrbitPoint
from chaosgym.branches.section import better_section
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of

MOST_ORBITS = 120
"""Orbits on either side: of worn pins, which bounce many times a cycle, one takes some 25 ms."""


class End(NamedTuple):
    """Where a motion's stability ends: the speed in its field's unit, the bifurcation there.

    ``kind`` is None where the range ends first, or where the branch could not be followed: then ``reason`` says why.
    """

    speed: float
    kind: Kind | None
    reason: str = ""


class StableSpan(NamedTuple):
    """The ends of a motion's stability below and above the machine's speed."""

    below: End
    above: End

    def words(self, unit: str) -> str:
        """Both ends for people, such as "stable from 1.17834 Hz (fold) to 1.90683 Hz (fold)"."""
        ends = (f"{end.speed:.6g} {unit} ({end.kind or end.reason or 'end of the range'})" for end in self)
        return "stable from {} to {}".format(*ends)


def stable_span(machine: Machine, orbit: PeriodicOrbit) -> StableSpan:
    """Follow an orbit along the speed, through the machine's usual range, until its stability ends on either side.

    Parameters
    ----------
    machine
        At its speed.
    orbit
        A certified orbit of it.

    Examples
    --------
    >>> from chaosgym.branches.stable_span import stable_span
    >>> from chaosgym.diagnosis import attractors
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> span = stable_span(beam, attractors(beam).motions[0].orbit)  # doctest: +SKIP
    """
    name = machine.speed_field
    own, allowed = float(getattr(machine, name)), parameters_of(machine)[name]
    low, high = machine.usual_ranges.get(name, (own, own))
    low, high = max(min(low, 0.9 * own), allowed.low), min(max(high, 1.1 * own), allowed.high)
    family = with_noise(family_of(machine, name, low, high, orbit.state, orbit.period), orbit.state)
    place = np.append(family.weight * orbit.state, (own - low) / (high - low))
    normal = np.append(np.zeros(len(orbit.state)), 1.0)
    try:
        family, start = better_section(*family.with_mirror(family.solve(place, normal)))
    except NotFollowedError as error:
        end = End(own, None, f"not followed: {error}")
        return StableSpan(end, end)
    return StableSpan(*(_end(family, start, side) for side in (-1.0, 1.0)))


def _end(family: OrbitFamily, start: OrbitPoint, side: float) -> End:
    begun = replace(start, tangent=side * start.tangent)
    try:
        ahead = stretch(family, begun, until=lambda one: one.loses_stability, closely=False, most_points=MOST_ORBITS)
    except NotFollowedError as error:
        return End(family.value(start.x[-1]), None, f"not followed: {error}")
    lost = [each.bifurcation for each in ahead.found if each.bifurcation.loses_stability or each.bifurcation.ends]
    if lost:
        return End(lost[0].value, lost[0].kind)
    reason = "" if ahead.end.startswith("end of the range") else ahead.end
    return End(family.value(ahead.points[-1].x[-1]), None, reason)
