"""Models of a machine of a few modes along one of its fields, interpolated.

A field that changes the modes, such as a damping, asks for new ones at each value. That takes milliseconds, and its
rounding makes the model jump by 1e-13 from value to value. Between two values of the field polynomials through a few
exact models in Chebyshev points serve instead, if they have converged to ``CONVERGED``. They are smooth, and cost a
twentieth.

References
----------
L. N. Trefethen, Approximation Theory and Approximation Practice, SIAM 2013, chapters 2 to 4.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.matrices import product
from chaosgym.core.modal_model import ModalImpactModel, Regimes
from chaosgym.machines.flexible_model import with_tables

CONVERGED = 1e-9
"""Last coefficients of a polynomial, as a share of the largest number of an array."""

DEGREES = (8, 16, 32)
"""Degrees that are tried, each with the points of the one before."""

PARTS = (
    "drive",
    "static_force",
    "contact_stiffness",
    "contact_damping",
    "stiffness",
    "damping",
    "tip_shape",
    "rest",
    "drift",
    "rest_penetration",
)
"""Arrays of a model that vary with a field of the structure."""


def interpolated(
    exact: Callable[[float], ModalImpactModel], low: float, high: float
) -> Callable[[float], ModalImpactModel] | None:
    """Models between two values of a field, or None where they do not vary smoothly enough.

    Parameters
    ----------
    exact
        The model at a value.
    low, high
        Range of the values.
    """
    known: dict[float, ModalImpactModel] = {}
    for degree in DEGREES:
        places = matrices.cos(np.pi * np.arange(degree + 1) / degree)
        for place in places:
            if float(place) not in known:
                known[float(place)] = exact(low + 0.5 * (high - low) * (1.0 + float(place)))
        models = [known[float(place)] for place in places]
        if not _alike(models):
            return None
        numbers = [_numbers(_in_phase(model, models[0])) for model in models]
        rows = np.array([np.concatenate(each) for each in numbers])
        coefficients = matrices.solve(chebyshev.chebvander(places, degree), rows)
        if _converged(coefficients, [len(part) for part in numbers[0]]):
            return lambda value: _model(
                models[0],
                product(chebyshev.chebvander([2.0 * (value - low) / (high - low) - 1.0], degree)[0], coefficients),
            )
    return None


def _parts(model: ModalImpactModel) -> list[Array]:
    return [getattr(model, name) for name in PARTS] + list(model.regimes)


def _numbers(model: ModalImpactModel) -> list[Array]:
    return [part.ravel() for part in _parts(model)]


def _alike(models: list[ModalImpactModel]) -> bool:
    """True if all have the same surfaces, and the same of their modes turn."""

    def kind(model: ModalImpactModel) -> Any:
        turning = model.regimes.generator[:, 2] != 0.0
        return [part.shape for part in _parts(model)], model.pressed.tolist(), turning.tolist(), model.tables.step_phase

    return not any(map(_critical, models)) and all(kind(model) == kind(models[0]) for model in models[1:])


def _critical(model: ModalImpactModel) -> bool:
    """True if a mode is nearly critical: its eigenvectors vary with the root of a field."""
    p, _, r, s = np.moveaxis(model.regimes.generator, 1, 0)
    return bool(np.any((r != 0.0) & (p == 0.0) & (s != 0.0)))


def _in_phase(model: ModalImpactModel, like: ModalImpactModel) -> ModalImpactModel:
    """The model in modal coordinates whose largest entries are those of another one: eigenvectors have any phase."""
    regimes = model.regimes
    turned, back = np.empty_like(regimes.from_modal), np.empty_like(regimes.from_modal)
    for r, (own, other) in enumerate(zip(regimes.from_modal, like.regimes.from_modal, strict=True)):
        turned[r] = _phases(own, other, regimes.generator[r])
        back[r] = matrices.inv(turned[r])
    return model._replace(
        rest=np.einsum("rij,rkj->rki", back, model.rest),
        drift=np.einsum("rij,rkj->rki", back, model.drift),
        regimes=regimes._replace(
            from_modal=product(regimes.from_modal, turned),
            to_modal=product(back, regimes.to_modal),
            output=np.einsum("rj,rji->ri", regimes.output, turned),
        ),
    )


def _phases(own: Array, other: Array, generator: Array) -> Array:
    """Matrix (2n, 2n) that turns and scales the columns of each block to those of another regime."""
    n = generator.shape[1]
    matrix = np.zeros((2 * n, 2 * n))
    for j in range(n):
        pair = np.ix_([j, n + j], [j, n + j])
        if generator[2, j] != 0.0:
            # columns are real and negative imaginary part of an eigenvector
            wanted, found = (each[:, j] - 1j * each[:, n + j] for each in (other, own))
            largest = int(np.argmax(np.abs(wanted)))
            factor = wanted[largest] / found[largest]
            matrix[pair] = [[factor.real, -factor.imag], [factor.imag, factor.real]]
            continue
        largest = np.argmax(np.abs(other[:, [j, n + j]]), axis=0)
        scales = other[largest, [j, n + j]] / own[largest, [j, n + j]]
        # the two columns of a drift belong together
        matrix[pair] = np.diag(scales if generator[1, j] == 0.0 else [scales[0], scales[0]])
    return matrix


def _converged(coefficients: Array, lengths: list[int]) -> bool:
    if not np.all(np.isfinite(coefficients)):
        return False
    ends = np.cumsum(lengths)[:-1]
    return all(
        float(np.max(np.abs(part[-2:]), initial=0.0)) <= CONVERGED * float(np.max(np.abs(part), initial=0.0))
        for part in np.split(coefficients, ends, axis=1)
    )


def _model(like: ModalImpactModel, numbers: Array) -> ModalImpactModel:
    """Model of some numbers, with tables of its own."""
    parts, at = [], 0
    for part in _parts(like):
        parts.append(np.ascontiguousarray(numbers[at : at + part.size].reshape(part.shape)))
        at += part.size
    given: dict[str, Any] = dict(zip(PARTS, parts, strict=False))
    return with_tables(like._replace(**given, regimes=Regimes(*parts[len(PARTS) :])))
