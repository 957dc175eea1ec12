"""Vectors fixed to links in space, from which the functions of their joints are made."""

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.machines.mechanism.joints import PITCH, ROLL, SKEW, YAW
from chaosgym.machines.mechanism.space import axes_of

TURNS = {ROLL: (1, 2, 1.0), YAW: (0, 2, -1.0), PITCH: (0, 1, 1.0), SKEW: (0, 0, 1.0)}
"""Axis of the second link, that of the first and sign, whose product is a small turn; it is zero in the middle."""


class MovingVectors(NamedTuple):
    """R vectors that move with links, in axes of these.

    ``link`` (R,) numbers of the links, the ground behind all; ``vector`` (R, 3), ``shape`` (R, 3, E) and ``curve``
    (R, 3, E, E) its derivatives by the elastic coordinates of all links.
    """

    link: NDArray[np.int64]
    vector: Array
    shape: Array
    curve: Array


class Rows(NamedTuple):
    """Constants of R functions of joints: a, r and s; ``moves`` (R, 1) 1 of a place, 0 of a turn."""

    axis: MovingVectors
    start: MovingVectors
    end: MovingVectors
    moves: Array

    @property
    def vectors(self) -> tuple[MovingVectors, MovingVectors, MovingVectors]:
        """a, r and s."""
        return self.axis, self.start, self.end


class Vectors(NamedTuple):
    """Turns of all links (B, links + 1, 3, 3), and a, R_1 r, R_2 s and v of R functions, (B, R, 3), on the ground."""

    turn: Array
    axis: Array
    start: Array
    end: Array
    apart: Array


@lru_cache(maxsize=256)
def axes_of_joint(axis: tuple[float, ...]) -> Array:
    """Axes (3, 3) of a joint, in columns: its own, across it as near to y as may be (else to z), and sideways."""
    unit = np.array(axis) / matrices.norm(axis)
    wanted = np.eye(3)[1] if abs(unit[1]) < 0.9 else np.eye(3)[2]
    return np.roll(axes_of(unit, wanted), 1, axis=1)
