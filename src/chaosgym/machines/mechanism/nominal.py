"""Nominal motion of a mechanism: where its links are at every crank angle while every gap stays in its middle.

From rough angles of the links at crank angle 0 the loops are closed by Newton's method. Steps of the crank follow them
through a revolution, each foretold by the cubic through the last two and corrected; all angles that are asked for then
start from cubics through these steps.
"""

from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.mechanism.mechanism import Mechanism

STEP, SHORTEST = 2.0 * np.pi / 24, 1e-4
"""Longest and shortest step of the crank [rad]."""

FAR = 0.01
"""Correction of a step, in rad or in lengths of the mechanism, beyond which it is tried anew with half the length."""

CLOSED, NEARLY, LAST, ROUNDING = 1e-9, 1e-6, 1e-8, 1e-13
"""Last correction of coordinates of closed loops that is admitted, that is enough for a step, whose square is rounding,
and that is rounding."""

WORST = 1e9
"""Condition number of the loops' equations beyond which they are singular."""

REPEATED = 1e-12
"""Last correction so small that A is the same before and after it."""

TRIES = 40


class Nominal(NamedTuple):
    """Nominal motion at B crank angles.

    ``z`` (B, size) coordinates of all links, ``inverse`` (B, size, size) of A = dc/dz, ``condition`` (B,) of what
    joints hold in it, in Frobenius' norm.
    """

    z: Array
    inverse: Array
    condition: Array


def _degrees(theta: float) -> str:
    return f"{np.degrees(theta) % 360.0:.1f} deg"


class _Loops:
    """The functions of a mechanism, in lengths of its own."""

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism, self.length = mechanism, _length_of(mechanism)
        lengths = np.ones(mechanism.size)
        for name, own in mechanism.at.items():
            lengths[own.start : mechanism.spin(name)] = self.length
        self.scale = lengths

    def block(self, slope: Array) -> Array:
        """Part of A (B, z, z) of what joints hold or open by places and turns, in own lengths: the rest is 1 and 0."""
        held = self.mechanism.rigid
        return np.asarray(slope[:, : len(held), held] * self.scale[held])

    def solve(self, z: Array, theta: Array, tries: int = TRIES, enough: float = ROUNDING) -> tuple[Array, float, Array]:
        """Coordinates (B, z) by Newton's method, the last correction, and A (B, z, z) before it.

        Elastic coordinates stay zero.
        """
        last, slope, held = np.inf, np.empty(0), self.mechanism.rigid
        step = np.zeros_like(z)
        for _ in range(tries):
            before = last
            value, slope = self.mechanism.functions(z, theta)
            try:
                step[:, held] = matrices.solve(self.block(slope), value[:, : len(held), None])[..., 0]
            except np.linalg.LinAlgError:
                return z, np.inf, slope
            last = float(np.max(np.abs(step)))
            if not np.isfinite(last):
                return z, np.inf, slope
            z = self.mechanism.moved(z, -self.scale * step / max(1.0, last))
            if last < enough or (last < CLOSED and last >= before):
                break
        return z, last, slope

    def tangent(self, z: Array, slope: Array, theta: Array) -> Array:
        """Derivatives (B, z) of the coordinates z by the crank angle (B,), of A there."""
        held, rate = self.mechanism.rigid, np.zeros_like(z)
        drive = self.mechanism.pace(theta)[:, : len(held), None]
        rate[:, held] = self.scale[held] * matrices.solve(self.block(slope), drive)[..., 0]
        return self.mechanism.rates(z, rate)

    def inverse(self, slope: Array) -> tuple[Array, Array]:
        """Inverse (B, z, z) of A, and the condition number (B,) of its part of ``block``, in Frobenius' norm."""
        held, bent = self.mechanism.rigid, self.mechanism.elastic
        block = self.block(slope)
        own = matrices.inv(block)
        condition = np.prod([np.linalg.norm(each, axis=(1, 2)) for each in (block, own)], axis=0)
        own *= self.scale[held, None]
        inverse, count = np.zeros_like(slope), len(held)
        inverse[:, held, :count] = own
        if len(bent):
            inverse[:, held, count:] = product(-own, slope[:, :count, bent])
            inverse[:, bent, np.arange(count, len(self.scale))] = 1.0
        return inverse, np.asarray(condition)


def _length_of(mechanism: Mechanism) -> float:
    """Largest distance [m] of two points of a link, or of the ground."""
    sets = [np.array(list(mechanism.ground.values()), dtype=float)]
    sets += [np.array([p.place[0] for p in link.points.values()]) for link in mechanism.links]
    sets = [some.reshape(-1, mechanism.dimensions) for some in sets]
    lengths = [float(np.max(np.linalg.norm(some[:, None] - some, axis=-1), initial=0.0)) for some in sets]
    return max(lengths) or 1.0


def _refuse_singular(loops: _Loops, z: Array, theta: float) -> None:
    """Refuse functions that depend on each other: the count is right, and yet two joints hold the same motion."""
    mechanism = loops.mechanism
    slope = mechanism.functions(z, np.array([theta]))[1][0] * loops.scale
    left, sizes, _ = np.linalg.svd(slope)
    if sizes[-1] > sizes[0] / WORST:
        return
    weight = np.abs(left[:, -1])
    names = [*["the drive"] * mechanism.lead, *map(str, mechanism.rows())]
    involved = [name for name, share in zip(names, weight, strict=False) if share > 0.1 * weight.max()]
    raise ParameterError(
        f"at crank angle {_degrees(theta)} the mechanism can't move, or moves in two ways: {', '.join(involved)} "
        "depend on each other; allowed: joints that hold different motions, away from a dead centre"
    )


def _start(loops: _Loops) -> Array:
    """Coordinates (1, z) at crank angle 0 near the rough angles of the links."""
    mechanism, theta = loops.mechanism, np.zeros(1)
    z = np.zeros((1, mechanism.size))
    places: list[int] = []
    for link in mechanism.links:
        z[0, mechanism.spin(link.name)] = link.angle
        places += range(mechanism.at[link.name].start, mechanism.spin(link.name))
    value, slope = mechanism.functions(z, theta)
    z[0, places] -= product(matrices.pinv(slope[0][:, places]), value[0])
    found, last, _ = loops.solve(z, theta)
    if last > CLOSED:
        _refuse_singular(loops, z, 0.0)
        value, _ = mechanism.functions(found, theta)
        names = [*["the drive"] * mechanism.lead, *map(str, mechanism.rows())]
        worst = [name for name, gap in zip(names, np.abs(value[0]), strict=False) if gap > 0.3 * np.abs(value[0]).max()]
        raise ParameterError(
            f"the loop does not close at crank angle 0: {', '.join(worst)} stay apart by "
            f"{np.abs(value[0]).max():.3g} m or rad; allowed: lengths that reach, and angles of the links "
            "that are roughly right there"
        )
    _refuse_singular(loops, found, 0.0)
    return found


class Revolution(NamedTuple):
    """Steps of the nominal motion through a revolution.

    ``theta`` (s,) crank angles from 0 to 2 pi, ``z`` and ``tangent`` (s, size) coordinates and their derivatives,
    ``winding`` (size,) turns of each coordinate in a revolution, ``length`` [m] of the mechanism.
    """

    theta: Array
    z: Array
    tangent: Array
    winding: Array
    length: float


def revolution_of(mechanism: Mechanism) -> Revolution:
    """Follow the closed loops through a revolution of the crank.

    Raises
    ------
    ParameterError
        If a loop does not close, the crank can't turn, nothing else moves, or the mechanism does not come back; says
        where.
    """
    loops = _Loops(mechanism)
    angles, places = [0.0], [_start(loops)]
    tangents = [loops.tangent(places[0], loops.solve(places[0], np.zeros(1), 1)[2], np.zeros(1))]
    step = STEP
    while angles[-1] < 2.0 * np.pi:
        end = min(angles[-1] + step, 2.0 * np.pi)
        theta = np.array([end if 2.0 * np.pi - end > 0.1 * SHORTEST else 2.0 * np.pi])
        guess = _foretold(angles, places, tangents, float(theta[0]))
        z, last, slope = loops.solve(guess, theta, 12, NEARLY)
        if last > NEARLY or np.max(np.abs(z - guess) / loops.scale) > FAR * min(1.0, 4.0 * step / STEP):
            step *= 0.5
            if step < SHORTEST:
                loops.mechanism.refuse_turned_over(places[-1])
                raise ParameterError(
                    f"the crank can't turn beyond {_degrees(angles[-1])}: the loop does not close there; allowed: "
                    "lengths with which it turns right round"
                )
            continue
        angles.append(float(theta[0]))
        places.append(z)
        tangents.append(loops.tangent(z, slope, theta))
        step = min(2.0 * step, STEP)
    drift = places[-1][0] - places[0][0]
    turns = np.zeros(mechanism.size)
    for turn in map(mechanism.spin, mechanism.at):
        turns[turn] = np.round(drift[turn] / (2.0 * np.pi))
    if np.max(np.abs(drift - 2.0 * np.pi * turns) / loops.scale) > 1e-6:
        raise ParameterError(
            "the mechanism does not come back after a revolution of the crank: its links pass a dead centre, or a gear "
            "or belt turns a link by a part of a turn (let its slow shaft be driven); allowed: a motion that repeats "
            "with every revolution"
        )
    if len(mechanism.links) > 1 and np.sum(np.ptp(np.concatenate(places), axis=0) / loops.scale > CLOSED) <= 1:
        raise ParameterError(
            "only the crank turns and no other link moves; allowed: a crank whose pin lies away from its shaft"
        )
    return Revolution(
        np.array(angles), np.concatenate(places), np.concatenate(tangents), turns[: mechanism.size], loops.length
    )


def _foretold(angles: list[float], places: list[Array], tangents: list[Array], theta: float) -> Array:
    """Coordinates at the next crank angle, by the cubic through the last two steps."""
    if len(angles) < 2:
        return places[-1] + (theta - angles[-1]) * tangents[-1]
    span = angles[-1] - angles[-2]
    return _between((theta - angles[-2]) / span, span, places[-2], places[-1], tangents[-2], tangents[-1])


def _between(x: Any, h: Any, z0: Array, z1: Array, d0: Array, d1: Array) -> Array:
    """Cubic with values z and slopes d at both ends of h, at a share x of it."""
    ends = z0 * ((1 + 2 * x) * (1 - x) ** 2) + z1 * (x**2 * (3 - 2 * x))
    return np.asarray(ends + h * (d0 * (x * (1 - x) ** 2) - d1 * (x**2 * (1 - x))))


def nominal(mechanism: Mechanism, revolution: Revolution, theta: Array) -> Nominal:
    """Nominal motion at crank angles (B,) [rad] of a revolution.

    Raises
    ------
    ParameterError
        If a loop does not close to rounding, or is singular there.
    """
    loops, where = _Loops(mechanism), np.mod(theta, 2.0 * np.pi)
    z, last, slope = _closed(loops, revolution, where)
    if last > REPEATED:
        slope = mechanism.functions(z, where)[1]
    try:
        inverse, condition = loops.inverse(slope)
    except np.linalg.LinAlgError:
        condition = np.linalg.cond(loops.block(slope))
    if last > LAST or not np.all(condition < WORST):
        worst = float(where[int(np.argmax(condition))])
        raise ParameterError(
            f"the loop is singular at crank angle {_degrees(worst)}: the mechanism is at a dead centre"
        )
    return Nominal(_unwound(z, theta, where, revolution), np.asarray(inverse), np.asarray(condition))


def refined(mechanism: Mechanism, revolution: Revolution, theta: Array) -> Revolution:
    """A revolution with steps at crank angles (B,) from 0 on, at which its places are known to rounding."""
    loops, ends = _Loops(mechanism), np.append(theta, 2.0 * np.pi)
    z = _closed(loops, revolution, ends)[0]
    z, _, slope = loops.solve(z, ends, 1)
    return revolution._replace(theta=ends, z=z, tangent=loops.tangent(z, slope, ends))


def _unwound(z: Array, theta: Array, where: Array, revolution: Revolution) -> Array:
    """Coordinates of the first revolution, with the turns that links have made up to crank angles beyond it."""
    return z + (theta - where)[:, None] * revolution.winding


def places(mechanism: Mechanism, revolution: Revolution, theta: Array) -> Array:
    """``nominal(mechanism, revolution, theta).z`` alone, in half the time."""
    where = np.mod(theta, 2.0 * np.pi)
    z, last, _ = _closed(_Loops(mechanism), revolution, where)
    return _unwound(z, theta, where, revolution) if last <= LAST else nominal(mechanism, revolution, theta).z


def _closed(loops: _Loops, revolution: Revolution, where: Array) -> tuple[Array, float, Array]:
    """Coordinates (B, z) at crank angles of the first revolution, their last correction, and A before that."""
    at = np.clip(np.searchsorted(revolution.theta, where, side="right") - 1, 0, len(revolution.theta) - 2)
    begin, span = revolution.theta[at], np.diff(revolution.theta)[at]
    x, h = ((where - begin) / span)[:, None], span[:, None]
    z0, z1, d0, d1 = (part[k] for part in (revolution.z, revolution.tangent) for k in (at, at + 1))
    return loops.solve(_between(x, h, z0, z1, d0, d1), where, 8, LAST)


def even_angles(count: int) -> Array:
    """Crank angles [rad] of a revolution at equal steps from 0 on."""
    return np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
