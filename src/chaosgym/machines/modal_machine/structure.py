r"""A structure free of contact: its modes, from a modal test or from the matrices of a finite element model.

    q_i'' + sum_j D_ij q_j' + w_i^2 q_i = sum over points of phi_i(point) F(point)

Mass-normalised shapes phi turn modal coordinates q into displacements. Where the base moves with acceleration a, the
displacements are relative to it and each mode feels -(phi_i' M r) a, r being the displacement of every degree of
freedom when the base moves by one: "base" is a point whose shape is phi' M r.
"""

import hashlib
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import takewhile
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.core.matrices import eigh, product
from chaosgym.errors import ParameterError
from chaosgym.machines.modal_blocks import NEGLIGIBLE
from chaosgym.machines.modal_machine.matrices import slowest_modes, symmetric, times, with_deflections
from chaosgym.machines.modal_machine.places import terms_of
from chaosgym.machines.parameters import suggestion
from chaosgym.numbers import number, numbers, shown, whole

BASE = "base"
"""Point whose shape is the participation of each mode in a motion of the base [kg^1/2]."""

HIGHEST = 1e5
"""Highest natural frequency [Hz] that is accepted; a higher one is taken for a wrong unit."""

MOST_MODES = 1000
MASSES, COMPLIANCES = (1e-12, 1e12), (1e-18, 1e3)
LARGEST_SHAPE, LARGEST_RATE = 1e6, 1e9
"""Ranges of modal masses [kg], of a residual compliance [m/N], of shapes [kg^-1/2] and of damping [1/s]."""

CURED = 'a unit is likely wrong (a model in mm, t and N? then units = "t mm N")'


FEWEST = 8
"""Modes of a test or a file up to which all are kept: fewer cost nearly as much."""


class Spare(NamedTuple):
    """Other numbers of modes of one structure.

    Attributes
    ----------
    keep
        The structure with a number of modes.
    kept, most
        Number of modes that it keeps, and that there are.
    matrices
        Whether its matrices tell of all motions; else its modes are all that is known.
    """

    keep: "Callable[[int], Structure]"
    kept: int
    most: int
    matrices: bool


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
    frame : (n, k)
        Modal coordinates of a unit of each coordinate of the k shapes as they were given; None if they are the same.

    Examples
    --------
    >>> structure = chaosgym.Structure.of_modes([9.0, 61.0], 0.01, {"tip": [2.1, -1.9]})
    >>> structure.angular_frequency.round(1)
    array([ 56.5, 383.3])
    """

    angular_frequency: Array
    damping: Array
    shapes: Mapping[str, Array]
    spare: Spare | None = field(default=None, repr=False)
    frame: Array | None = field(default=None, repr=False)

    @property
    def finer(self) -> "Structure | None":
        """The structure with more modes of its matrices, or all of its file; None if it can't keep more."""
        if self.spare is None or self.spare.kept == self.spare.most:
            return None
        keep, kept, most, matrices = self.spare
        return keep(min(2 * kept, most, MOST_MODES) if matrices else most) if kept < MOST_MODES else None

    @property
    def coarser(self) -> "tuple[Structure, ...]":
        """The structure with fewer modes, the fewest first, where a file or a test has many."""
        if self.spare is None or self.spare.matrices:
            return ()
        counts = (FEWEST * 2**k for k in range(MOST_MODES))
        keep, most = self.spare.keep, self.spare.kept
        return tuple(map(keep, takewhile(lambda count: count < most, counts)))

    @property
    def left_out(self) -> str:
        """What finer structures can't tell; empty if they tell all."""
        if self.spare is None or not self.spare.matrices:
            return "its modes are all that is known: the error of leaving others out can't be estimated"
        return "" if self.spare.kept < self.spare.most else "it keeps all modes of its matrices: nothing is left out"

    def first(self, count: int) -> "Structure":
        """The structure with its first modes alone."""
        shapes = {name: shape[:count] for name, shape in self.shapes.items()}
        spare = Spare(self.first, count, len(self.angular_frequency), False)
        return Structure(self.angular_frequency[:count], self.damping[:count, :count], shapes, spare)

    def __getstate__(self) -> dict[str, Any]:
        """What is pickled: its modes, without the matrices that tell of more."""
        return {**vars(self), "spare": None}

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
            (n,) at each named point: mass-normalised [kg^-1/2], or of any scale with ``modal_masses``; so is "base",
            phi' M r [kg^1/2], or [kg] with ``modal_masses``.
        modal_masses : (n,)
            [kg], in the scale of ``shapes``.
        residual
            Point, compliance there [m/N] of the modes that were left out, and frequency [Hz] of the one mode that
            stands for them.

        Raises
        ------
        ParameterError
            If lengths differ, or a value is out of range.
        """
        try:
            rates = 2.0 * math.pi * numbers("frequencies", np.atleast_1d(frequencies), 0.0, HIGHEST, "Hz")
        except ParameterError as error:
            raise ParameterError(f"{error}; {CURED}") from None
        n = len(rates)
        if n > MOST_MODES:
            raise ParameterError(f"frequencies has {n} entries; allowed: up to {MOST_MODES}")
        given = {name: _shape(f"shapes.{name}", values, n) for name, values in shapes.items()}
        frame = np.eye(n)
        if modal_masses is not None:
            masses = numbers("modal_masses", np.atleast_1d(modal_masses), *MASSES, "kg", shape=(n,))
            given = {name: values / np.sqrt(masses) for name, values in given.items()}
            frame = np.diag(np.sqrt(masses))
        matrix = _damping_matrix(damping, rates)
        if residual is not None:
            rates, matrix, given = _with_residual(rates, matrix, given, *residual)
        whole = cls(rates, matrix, given, frame=np.eye(len(rates), n) @ frame)
        if residual is None:
            object.__setattr__(whole, "spare", Spare(whole.first, len(rates), len(rates), False))
        return whole

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
        highest: float = HIGHEST,
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
        highest
            Natural frequency [Hz] above which a mode is taken for a wrong unit.

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
        whole("modes", modes, 1, size)
        rates, vectors = slowest_modes(matrices["mass"], matrices["stiffness"], modes)
        residual = [residual_at] if isinstance(residual_at, str) else list(residual_at or ())
        if modes < size:
            rows = [points[name] for name in residual]
            rates, vectors = with_deflections(matrices["mass"], matrices["stiffness"], rates, vectors, rows)
        if rates[-1] > 2.0 * math.pi * highest:
            raise ParameterError(
                f"mode {len(rates)} has {rates[-1] / (2 * math.pi):g} Hz; allowed: up to {highest:g} Hz; {CURED}, "
                "or keep fewer modes"
            )
        if "damping" in matrices:
            matrix = product(vectors.T, times(matrices["damping"], vectors))
        else:
            ratios = np.asarray(damping)
            if ratios.ndim == 1 and len(ratios) == modes:
                ratios = np.append(ratios, np.full(len(rates) - modes, ratios[-1]))
            matrix = _damping_matrix(ratios, rates)
        shapes = {name: vectors[row] / math.sqrt(scale) for name, row in points.items()}
        if base is not None:
            reach = times(matrices["mass"], numbers("base", base, -1e6, 1e6, shape=(size,)))
            shapes[BASE] = product(vectors.T, reach) * math.sqrt(scale)
        shapes = {name: _shape(name, values, len(rates)) for name, values in shapes.items()}
        more: dict[str, Any] = {"base": base, "residual_at": residual_at, "scale": scale, "highest": math.inf}

        def keep(count: int) -> Structure:
            own = np.asarray(damping) if "damping" not in matrices else damping
            if np.ndim(own) == 1 and len(own) == modes:
                own = np.append(own, np.full(count - modes, own[-1]))
            return cls.of_matrices(mass, stiffness, own, points, modes=count, **more)

        spare = Spare(keep, modes, size, True)
        return cls(rates, _damping_matrix(0.5 * (matrix + matrix.T), rates), shapes, spare)

    def points_beside(self, places: Iterable[str]) -> dict[str, Array]:
        """Shapes (n,) of the points that are none of some places, as "point NAME"."""
        others = set(self.shapes) - {BASE, *places}
        return {f"point {name}": row for name, row in self.shapes.items() if name in others}

    def shape(self, place: str) -> Array:
        """Shape of a linear combination of displacements, such as ``-tip`` or ``motor - 3 gear``; see ``terms_of``.

        Raises
        ------
        ParameterError
            If there is no such point; the nearest one is suggested.
        """
        total = np.zeros(len(self.angular_frequency))
        for term in terms_of(place, self.shapes):
            total = total + term.factor * self.shapes[term.point]
        return total

    def with_springs(self, springs: Iterable[tuple[str, float, float]]) -> "Structure":
        """Structure with more springs and dampers: place, stiffness [N/m] and damping [N s/m] of each.

        Its modes are those of the whole. Each spring holds a linear combination of displacements, to the ground.

        Examples
        --------
        >>> free = [[0.0, 0.0], [0.0, 0.0]]
        >>> bodies = chaosgym.Structure.of_modes([0.0, 0.0], free, {"a": [1.0, 0.0], "b": [0.0, 1.0]})
        >>> bodies.with_springs([("a - b", 8.0, 0.0)]).angular_frequency.round(3)
        array([0., 4.])
        """
        stiffness, damping, springs = np.diag(self.angular_frequency**2), self.damping.copy(), tuple(springs)
        for place, spring, damper in springs:
            shape = self.shape(place)
            stiffness = stiffness + spring * np.outer(shape, shape)
            damping = damping + damper * np.outer(shape, shape)
        squares, vectors = np.diag(stiffness), np.eye(len(damping))
        if np.any(stiffness != np.diag(squares)):
            squares, vectors = eigh(stiffness)
            squares = np.where(squares < NEGLIGIBLE * squares[-1], 0.0, squares)
        shapes = {name: product(vectors.T, values) for name, values in self.shapes.items()}
        damping = product(vectors.T, damping, vectors)
        frame = product(vectors.T, np.eye(len(damping)) if self.frame is None else self.frame)
        whole = Structure(np.sqrt(squares), 0.5 * (damping + damping.T), shapes, frame=frame)
        if self.spare is not None:
            keep = self.spare.keep
            spare = self.spare._replace(keep=lambda count: keep(count).with_springs(springs))
            object.__setattr__(whole, "spare", spare)
        return whole

    @property
    def scale_note(self) -> str:
        """What to say of shapes that look as if their largest entry had been made 1; empty of any others."""
        largest = np.max(np.abs([values for name, values in self.shapes.items() if name != BASE]), axis=0)
        if len(largest) < 2 or np.any(np.abs(largest - 1.0) > 1e-6):
            return ""
        return "the largest entry of every shape is 1: right only if each modal mass is 1 kg; else state modal_masses"

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
