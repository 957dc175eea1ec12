"""How a damped linear structure moves between two events: its 2 x 2 blocks, their rates, and where they rest."""

import math

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError

MAX_CONDITION = 1e6
"""Condition number of a set of eigenvectors below which no better one is looked for."""

HOPELESS_CONDITION = 1e12
"""Condition number beyond which a motion would keep less than four digits."""

RIGID_SHARE = 1e-6
"""Natural frequency, as a share of the fastest one, below which a mode is the motion of a rigid body.

Programs of finite elements print rigid bodies so, at the rounding of their stiffness. A static force would push such a
mode so far away that the gap drowns in the rounding of that distance.
"""

UNCOUPLED = 1e-8
"""Damping between two modes, as a share of their own, that counts as none where modes are nearly critical."""

NEGLIGIBLE = 1e-13
"""Stiffness and damping, against the largest, of a direction that neither springs nor dampers resist."""


def nearly_rigid(angular_frequency: Array) -> NDArray[np.bool_]:
    """Which modes (n,) are so slow that they count as motions of a rigid body, though their frequency is not 0."""
    return (angular_frequency > 0.0) & (angular_frequency < RIGID_SHARE * np.max(angular_frequency))


def modal_blocks(stiffness: Array, damping: Array, rigid: bool, rubs: bool = False) -> tuple[Array, Array]:
    """Real 2 x 2 blocks of q'' + damping q' + stiffness q = 0: generator (4, n) and from_modal (2n, 2n).

    Where the machine can move as a ``rigid`` body, a direction that neither spring nor damper resists drifts, in a
    block of its own. What slides and ``rubs`` makes the matrices unsymmetric, and may let a motion grow.
    """
    scale = math.sqrt(matrices.norm(stiffness)) or 1.0
    held, directions = _stretched(stiffness / scale**2 + damping / scale, rubs)
    loose = (held < NEGLIGIBLE * max(1.0, float(held[-1]))) & rigid
    blocks, columns = [], []
    for free in directions[:, loose].T:
        blocks.append((0.0, 1.0, 0.0, 0.0))
        columns.append((np.concatenate([free, 0.0 * free]), np.concatenate([0.0 * free, free])))
    # without such directions, the modes stay as they are, to the last digit
    basis = directions[:, ~loose] if loose.any() else np.eye(len(stiffness))
    if basis.shape[1]:
        own = (product(basis.T, stiffness, basis), product(basis.T, damping, basis))
        _add_damped(*own, basis, rigid, blocks, columns, rubs)
    first, second = zip(*columns, strict=True)
    from_modal = np.column_stack([*first, *second])
    if rubs and loose.any():
        _push_along(stiffness, damping, directions[:, loose], np.array(blocks).T, from_modal)
    return np.array(blocks).T, from_modal


def _stretched(matrix: Array, rubs: bool) -> tuple[Array, Array]:
    """By how much a matrix stretches directions, ascending, and these: singular values and vectors where it rubs."""
    if not rubs:
        return matrices.eigh(matrix)
    _, sizes, directions = matrices.svd(matrix)
    return sizes[::-1], directions[::-1].T


def _push_along(stiffness: Array, damping: Array, loose: Array, generator: Array, from_modal: Array) -> None:
    """Add to the columns of other coordinates how friction moves directions (n, k) that nothing resists.

    A block B moves others by Y u, and these by X u with X B^2 = -loose' (stiffness Y + damping Y B).
    """
    n = len(stiffness)
    for j in range(loose.shape[1], n):
        block, pair = generator[:, j].reshape(2, 2), [j, n + j]
        moved = from_modal[:n, pair]
        forced = product(-loose.T, product(stiffness, moved) + product(damping, moved, block))
        square = product(block, block)
        if block[1, 0] != 0.0:
            along = matrices.solve(square.T, forced.T).T
        else:
            # nothing pushes where the other one rests
            along = np.divide(forced, np.diag(square), out=np.zeros_like(forced), where=np.diag(square) > 0.0)
        from_modal[:n, pair] += product(loose, along)
        from_modal[n:, pair] += product(loose, along, block)


def _add_damped(
    stiffness: Array,
    damping: Array,
    basis: Array,
    rigid: bool,
    blocks: list[tuple[float, float, float, float]],
    columns: list[tuple[Array, Array]],
    rubs: bool,
) -> None:
    """Add the blocks of coordinates, columns of ``basis``, that all have a spring or a damper.

    A mode that is critically damped to the last digit has one eigenvector instead of two. If damping couples no modes,
    displacement and velocity of each serve as its coordinates. Else its damping is moved by a billionth, which
    separates the pair; where that leaves equal modes entangled, that of each by another amount. The best set of
    eigenvectors that was found serves, unless it would leave no digits.
    """
    n = len(stiffness)
    scale = math.sqrt(matrices.norm(stiffness)) or 1.0
    # a displacement weighs as much as the velocity that belongs to it, in slow modes as in fast ones
    rates, directions = _stretched(stiffness + product(damping, damping), rubs)
    weight = product(directions * np.sqrt(np.maximum(rates, 0.0)), directions.T)
    found, one, graded = [], np.ones(n), np.arange(1.0, n + 1.0)
    for moved in (0.0 * one, 1e-9 * one, 1e-8 * one, 1e-9 * graded, 1e-8 * graded):
        roots = np.sqrt(1.0 + moved)
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -(np.outer(roots, roots) * damping)]])
        values, vectors = matrices.eig(system)
        balanced = np.concatenate([product(weight, vectors[:n]), vectors[n:]])
        lengths = np.linalg.norm(balanced, axis=0)
        condition = float(np.linalg.cond(balanced / lengths)) if lengths.all() else math.inf
        found.append((condition, values, vectors))
        if condition < MAX_CONDITION:
            break
        if len(found) == 1 and not rubs and _add_uncoupled(stiffness, damping, basis, rigid, blocks, columns):
            return
    condition, values, vectors = min(found, key=lambda each: each[0])
    if not condition < HOPELESS_CONDITION:
        raise ParameterError(
            "modes that are equal and critically damped can't be told apart; allowed: damping ratios that differ from "
            "1 by a millionth or more"
        )
    resting = int(np.sum(_stretched(stiffness, rubs)[0] < NEGLIGIBLE * scale**2)) if rigid else 0
    order = np.argsort(matrices.modulus(values), kind="stable")
    slowest = order[:resting]
    values[slowest[values[slowest].imag == 0.0]] = 0.0
    vectors = np.concatenate([product(basis, vectors[:n]), product(basis, vectors[n:])])
    turning = [i for i in order if values[i].imag > 0.0]
    decaying = [i for i in order if values[i].imag == 0.0]
    for i in turning:
        a, b = min(values[i].real, math.inf if rubs else 0.0), values[i].imag
        blocks.append((a, -b, b, a))
        columns.append((vectors[:, i].real, -vectors[:, i].imag))
    for i, k in zip(decaying[::2], decaying[1::2], strict=True):
        most = math.inf if rubs else 0.0
        blocks.append((min(values[i].real, most), 0.0, 0.0, min(values[k].real, most)))
        columns.append((vectors[:, i].real, vectors[:, k].real))


def _add_uncoupled(
    stiffness: Array,
    damping: Array,
    basis: Array,
    rigid: bool,
    blocks: list[tuple[float, float, float, float]],
    columns: list[tuple[Array, Array]],
) -> bool:
    """Add the blocks of the modes that damping does not couple, in coordinates (w q, q'); False if it does couple them.

    A mode of a ``rigid`` body without a spring creeps to rest, as two real eigenvalues.
    """
    if np.any(stiffness != np.diag(np.diag(stiffness))):
        rates, shapes = matrices.eigh(stiffness)
    else:
        rates, shapes = np.diag(stiffness), np.eye(len(stiffness))
    between = product(shapes.T, damping, shapes)
    own = np.diag(between)
    held = rates > NEGLIGIBLE * np.max(rates)
    if not (rigid or held.all()) or not np.all(own[held] >= 0.0) or not np.all(own[~held] > NEGLIGIBLE * np.max(own)):
        return False
    if np.any(np.abs(between - np.diag(own)) > UNCOUPLED * np.sqrt(np.outer(own, own))):
        return False
    for rate, resistance, has_spring, shape in zip(rates, own, held, product(basis, shapes).T, strict=True):
        w = math.sqrt(rate) if has_spring else 0.0
        blocks.append((0.0, w, -w, -resistance))
        first, second = (shape / w, 0.0 * shape) if has_spring else (shape, -shape / resistance)
        columns.append((np.concatenate([first, 0.0 * shape]), np.concatenate([second, shape])))
    return True


def largest_modulus(generator: Array) -> float:
    """Largest modulus of an eigenvalue of blocks (4, n) by ``modal_blocks``.

    That of a pair is the root of its determinant; a mode damped beyond its critical damping keeps the block of a pair,
    and has two real eigenvalues.
    """
    turns, half = generator[2] != 0.0, 0.5 * (generator[0] - generator[3])
    split = half**2 + generator[1] * generator[2]
    real = 0.5 * np.abs(generator[0] + generator[3]) + np.sqrt(np.maximum(split, 0.0))
    pair = np.where(split > 0.0, real, np.hypot(generator[0], generator[2]))
    return float(np.max(np.where(turns, pair, np.max(np.abs(generator[[0, 3]]), axis=0))))


def settled(generator: Array, force: Array) -> tuple[Array, Array]:
    """Position of rest (2n,) of modal coordinates under a constant force (2n,), and the rate of those without one."""
    n = generator.shape[1]
    rest, drift = np.zeros(2 * n), np.zeros(2 * n)
    for j, (p, q, r, s) in enumerate(generator.T):
        pair = [j, n + j]
        if r != 0.0:
            determinant = p * s - q * r
            rest[pair] = (
                (q * force[n + j] - s * force[j]) / determinant,
                (r * force[j] - p * force[n + j]) / determinant,
            )
        elif q != 0.0:
            drift[pair] = force[pair]
        else:
            for i, rate in zip(pair, (p, s), strict=True):
                if rate == 0.0:
                    drift[i] = force[i]
                else:
                    rest[i] = -force[i] / rate
    return rest, drift
