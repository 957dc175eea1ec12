r"""A structure free of contact: its modes, from a modal test or from the matrices of a finite element model.

    q_i'' + sum_j D_ij q_j' + w_i^2 q_i = sum over points of phi_i(point) F(point)

Mass-normalised shapes phi turn modal coordinates q into displacements. Where the base moves with acceleration a, the
displacements are relative to it and each mode feels -(phi_i' M r) a, r being the displacement of every degree of
freedom when the base moves by one: "base" is a point whose shape is phi' M r.
"""

import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.matrices import slowest_modes, symmetric, with_deflections
from chaosgym.machines.parameters import suggestion
from chaosgym.numbers import number, numbers, shown

BASE = "base"
"""Point whose shape is the participation of each mode in a motion of the base [kg^1/2]."""

HIGHEST = 1e5
"""Highest natural frequency [Hz] that is accepted; a higher one is taken for a wrong unit."""

MOST_MODES = 1000
MASSES, COMPLIANCES = (1e-12, 1e12), (1e-18, 1e3)
LARGEST_SHAPE, LARGEST_RATE = 1e6, 1e9
"""Ranges of modal masses [kg], of a residual compliance [m/N], of shapes [kg^-1/2] and of damping [1/s]."""

CURED = 'a unit is likely wrong (a model in mm, t and N? then units = "t mm N")'


@dataclass(frozen=True, eq=False)
class Structure:
    """Modes of a machine free of contact.

    Attributes
    ----------
    angular_frequency : (n,)
        [rad/s], 0 for motions of a rigid body.
    damping : (n, n)
        Modal damping [1/s].
    shapes
        Mass-normalised shapes (n,) [kg^-1/2] by the name of the point, and the participations "base" [kg^1/2].

    Examples
    --------
    >>> structure = chaosgym.Structure.of_modes([9.0, 61.0], 0.01, {"tip": [2.1, -1.9]})
    >>> structure.angular_frequency.round(1)
    array([ 56.5, 383.3])
    """

    angular_frequency: Array
    damping: Array
    shapes: Mapping[str, Array]

    @classmethod
    def of_modes(
        cls,
        frequencies: ArrayLike,
        damping: ArrayLike,
        shapes: Mapping[str, ArrayLike],
        *,
        modal_masses: ArrayLike | None = None,
        residual: "tuple[str, float, float] | None" = None,
    ) -> "Structure":
        """Structure of measured or computed modes.

        Parameters
        ----------
        frequencies : (n,)
            Natural frequencies [Hz].
        damping : (), (n,) or (n, n)
            Damping ratios, or the matrix of modal damping [1/s].
        shapes
            (n,) at each named point: mass-normalised [kg^-1/2], or of any scale with ``modal_masses``.
        modal_masses : (n,)
            [kg], in the scale of ``shapes``.
        residual
            Point, compliance there [m/N] of the modes that were left out, and frequency [Hz] of the one mode that
            stands for them.

        Raises
        ------
        ParameterError
            If lengths differ, a value is out of range, or shapes are not mass-normalised.
        """
        try:
            rates = 2.0 * math.pi * numbers("frequencies", np.atleast_1d(frequencies), 0.0, HIGHEST, "Hz")
        except ParameterError as error:
            raise ParameterError(f"{error}; {CURED}") from None
        n = len(rates)
        if n > MOST_MODES:
            raise ParameterError(f"frequencies has {n} entries; allowed: up to {MOST_MODES}")
        given = {name: _shape(f"shapes.{name}", values, n) for name, values in shapes.items()}
        if modal_masses is not None:
            masses = numbers("modal_masses", np.atleast_1d(modal_masses), *MASSES, "kg", shape=(n,))
            given = {name: values / np.sqrt(masses) for name, values in given.items()}
        else:
            _refuse_unit_shapes([values for name, values in given.items() if name != BASE])
        matrix = _damping_matrix(damping, rates)
        if residual is not None:
            rates, matrix, given = _with_residual(rates, matrix, given, *residual)
        return cls(rates, matrix, given)

    @classmethod
    def of_matrices(
        cls,
        mass: Any,
        stiffness: Any,
        damping: Any,
        points: Mapping[str, int],
        *,
        modes: int,
        base: ArrayLike | None = None,
        residual_at: str | Sequence[str] | None = None,
        scale: float = 1.0,
    ) -> "Structure":
        """Structure of a finite element model.

        Parameters
        ----------
        mass, stiffness : (N, N)
            Symmetric matrices, dense or sparse; the mass positive definite, the stiffness at least semidefinite.
        damping : (N, N), () or (n,)
            Damping matrix, or damping ratios of the modes that are kept.
        points
            Number of the degree of freedom of each named point, counted from 0.
        modes
            Number n of modes that are kept, the slowest ones.
        base : (N,)
            Displacement of every degree of freedom when the base moves by one.
        residual_at
            Point or points, such as the joints, whose static deflection by all other modes is kept too, as one more
            mode each.
        scale
            What the unit of mass is in kg, for models whose lengths are not metres but whose unit of force is N.

        Raises
        ------
        ParameterError
            If matrices are not square, symmetric or positive, or a degree of freedom does not exist.

        Notes
        -----
        The additional mode is the Ritz vector of the static deflection by a force at the point, less the kept modes.

        References
        ----------
        D. de Klerk, D. J. Rixen, S. N. Voormeeren, AIAA Journal 46 (2008) 1169, on residual flexibility.
        """
        given = {"mass": mass, "stiffness": stiffness}
        if np.ndim(damping) == 2 or hasattr(damping, "tocsc"):
            given["damping"] = damping
        modes = int(number("modes", modes, 1, MOST_MODES))
        matrices = {name: symmetric(name, matrix) for name, matrix in given.items()}
        size = matrices["mass"].shape[0]
        for name, matrix in matrices.items():
            if matrix.shape[0] != size:
                raise ParameterError(f"{name} has {matrix.shape[0]} rows and mass {size}; allowed: as many")
        for name, row in points.items():
            if not 0 <= row < size:
                raise ParameterError(
                    f"degree of freedom {name} = {shown(row)} does not exist; allowed: 0 to {size - 1}"
                )
        if not 1 <= modes <= size:
            raise ParameterError(f"modes = {modes} is out of range; allowed: 1 to {size}")
        rates, vectors = slowest_modes(matrices["mass"], matrices["stiffness"], modes)
        residual = [residual_at] if isinstance(residual_at, str) else list(residual_at or ())
        if modes < size:
            rows = [points[name] for name in residual]
            rates, vectors = with_deflections(matrices["mass"], matrices["stiffness"], rates, vectors, rows)
        if rates[-1] > 2.0 * math.pi * HIGHEST:
            raise ParameterError(
                f"mode {len(rates)} has {rates[-1] / (2 * math.pi):g} Hz; allowed: up to {HIGHEST:g} Hz; {CURED}, "
                "or keep fewer modes"
            )
        if "damping" in matrices:
            matrix = vectors.T @ (matrices["damping"] @ vectors)
        else:
            ratios = np.asarray(damping)
            if ratios.ndim == 1 and len(ratios) == modes:
                ratios = np.append(ratios, np.full(len(rates) - modes, ratios[-1]))
            matrix = _damping_matrix(ratios, rates)
        shapes = {name: vectors[row] / math.sqrt(scale) for name, row in points.items()}
        if base is not None:
            reach = matrices["mass"] @ numbers("base", base, -1e6, 1e6, shape=(size,))
            shapes[BASE] = vectors.T @ reach * math.sqrt(scale)
        shapes = {name: _shape(name, values, len(rates)) for name, values in shapes.items()}
        return cls(rates, _damping_matrix(0.5 * (matrix + matrix.T), rates), shapes)

    def shape(self, place: str) -> Array:
        """Shape at a point, with a sign such as ``-tip``, or of a motion between two, such as ``pinion - wheel``.

        Raises
        ------
        ParameterError
            If there is no such point; the nearest one is suggested.
        """
        total, sign = np.zeros(len(self.angular_frequency)), 1.0
        for word in place.replace("-", " - ").replace("+", " + ").split() if place not in self.shapes else [place]:
            if word in ("-", "+"):
                sign = -1.0 if word == "-" else 1.0
                continue
            if word not in self.shapes:
                raise ParameterError(f"there is no point {word!r}{suggestion(word, self.shapes)}")
            total = total + sign * self.shapes[word]
        return total

    @property
    def digest(self) -> str:
        """Hash of all numbers and names."""
        parts = [self.angular_frequency, self.damping, *(self.shapes[name] for name in sorted(self.shapes))]
        content = b"".join(np.ascontiguousarray(part).tobytes() for part in parts)
        return hashlib.sha256(content + repr(sorted(self.shapes)).encode()).hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Structure) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)


def _shape(name: str, values: Any, modes: int) -> Array:
    return numbers(name, np.atleast_1d(values), -LARGEST_SHAPE, LARGEST_SHAPE, "kg^-1/2", shape=(modes,))


def _refuse_unit_shapes(shapes: list[Array]) -> None:
    """Refuse shapes whose largest entry is 1 in every one of several modes: nothing of mass 1 kg does that."""
    largest = np.max(np.abs(shapes), axis=0) if shapes else np.zeros(0)
    if len(largest) > 1 and np.all(np.abs(largest - 1.0) < 1e-6):
        raise ParameterError(
            "shapes are not mass-normalised: the largest entry of every mode is 1; add modal_masses, or divide each "
            "shape by the root of its modal mass"
        )


def _damping_matrix(damping: Any, rates: Array) -> Array:
    """Modal damping (n, n) [1/s], of ratios () or (n,), or as it is given."""
    n = len(rates)
    try:
        given = np.asarray(damping)
    except ValueError:
        raise ParameterError(f"modal_damping has rows of different lengths; allowed: {n} rows of {n}") from None
    if given.ndim == 2:
        given = numbers("modal_damping", given, -LARGEST_RATE, LARGEST_RATE, "1/s", shape=(n, n))
        return np.asarray(symmetric("modal_damping", given))
    ratios = numbers("damping_ratios", np.full(n, given) if given.ndim == 0 else given, 0.0, 100.0, shape=(n,))
    return np.diag(2.0 * ratios * rates)


def _with_residual(
    rates: Array, damping: Array, shapes: Mapping[str, Array], at: str, compliance: float, frequency: float
) -> tuple[Array, Array, dict[str, Array]]:
    """Modes with one more that has a compliance [m/N] at one point and moves no other; damped as the last mode."""
    if at not in shapes:
        raise ParameterError(f"there is no point {at!r}{suggestion(at, shapes)}")
    number("residual compliance", compliance, *COMPLIANCES, "m/N")
    rate = 2.0 * math.pi * number("residual frequency", frequency, 1e-3, HIGHEST, "Hz")
    ratio = damping[-1, -1] / (2.0 * rates[-1]) if rates[-1] > 0.0 else 0.0
    matrix = np.zeros((len(rates) + 1, len(rates) + 1))
    matrix[:-1, :-1], matrix[-1, -1] = damping, 2.0 * ratio * rate
    more = {
        name: np.append(values, rate * math.sqrt(compliance) if name == at else 0.0) for name, values in shapes.items()
    }
    return np.append(rates, rate), matrix, more
