"""The sets of pressed surfaces of a machine of a few modes and several joints: its blocks and where it rests in each.

What friction does at a pressed surface, sticking or sliding to either side, makes a set of its own.

sets = PressedSets(stiffness, damping, shape, springs, dampers)     # of a structure, whatever drives it
"""

import itertools
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.compilation import call
from chaosgym.core.joints.tables import Rubs, read_at_rest
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.modal_blocks import largest_modulus, modal_blocks, settled

MOST_SETS = 1_000_000
"""Sets of pressed surfaces that a machine may have."""

FRICTION_MODES = 3
"""What friction does at a pressed surface: it sticks, slides up or slides down."""


class Sliders(NamedTuple):
    """Joints with friction.

    Attributes
    ----------
    joint : (f,) int
        Which joints these are.
    shape : (f, n)
        Tangential displacement [kg^-1/2].
    friction, speed : (f,)
        Coefficient of friction; speed of the surfaces [m/s].
    springs : (f, 2)
        Tangential springs at the upper and the lower surface [N/m].
    """

    joint: NDArray[np.int64]
    shape: Array
    friction: Array
    speed: Array
    springs: Array

    @property
    def numbers(self) -> Array:
        """As the kernels take them, (f, 4)."""
        return np.column_stack([self.friction, self.springs, self.speed])


def no_sliders(modes: int) -> Sliders:
    """No friction, of a structure of some modes."""
    return Sliders(np.empty(0, np.int64), np.empty((0, modes)), np.empty(0), np.empty(0), np.empty((0, 2)))


class PressedSet(NamedTuple):
    """A structure with some surfaces pressed: blocks as in ``Regimes``, and where it rests per position of each.

    ``rest``, ``drift`` (m, 2n) are those of ``settled``; ``constants`` (m + 2f, m) what each channel reads then,
    counted from its surface where it presses; ``lag`` (m,) damper over spring [s] of those that act; ``rubs`` is what
    friction does.
    """

    generator: Array
    to_modal: Array
    from_modal: Array
    fastest: float
    rest: Array
    drift: Array
    constants: Array
    lag: Array
    rubs: Rubs


class PressedSets:
    """The sets of pressed surfaces of a structure, by number; each is made once.

    Parameters
    ----------
    stiffness : (n,)
        Squared natural angular frequencies of the structure free of contact [1/s^2]; 0 for the motion of a rigid body.
    damping : (n, n)
        Modal damping [1/s].
    shape : (m, n)
        Mass-normalised displacement of each joint [kg^-1/2].
    springs, dampers : (m, 2)
        Of the upper and the lower surface [N/m], [N s/m].
    two_sided : (m,) bool
        False for joints with an upper surface only.
    sliders
        Joints with friction.

    Raises
    ------
    ParameterError
        If there are more than ``MOST_SETS`` sets.
    """

    def __init__(
        self,
        stiffness: Array,
        damping: Array,
        shape: Array,
        springs: Array,
        dampers: Array,
        two_sided: Array,
        sliders: Sliders | None = None,
    ) -> None:
        self.stiffness, self.damping, self.shape = stiffness, damping, np.ascontiguousarray(shape)
        self.springs, self.dampers = springs, dampers
        differs = two_sided & ((springs[:, 0] != springs[:, 1]) | (dampers[:, 0] != dampers[:, 1]))
        self.sliders = no_sliders(len(stiffness)) if sliders is None else sliders
        self.modes = np.ones(len(shape), np.int64)
        self.modes[self.sliders.joint] = FRICTION_MODES
        self.radix = 1 + np.where(differs, 2, 1) * self.modes
        self.count = math.prod(self.radix.tolist())
        if self.count > MOST_SETS:
            raise ParameterError(
                f"{len(shape)} joints have {self.count:,} sets of pressed surfaces; allowed: {MOST_SETS:,} (fewer "
                "joints, or the same springs on both sides)"
            )
        self._made: dict[int, PressedSet] = {}

    def digits(self, code: int) -> list[int]:
        """Digit of each joint in the number of a set: 0 for none; 1 for the upper surface, or for either.

        With friction these are 1 to 3 for the upper surface: it sticks, slides up or slides down.
        """
        digits = []
        for radix in self.radix.tolist():
            digits.append(code % radix)
            code //= radix
        return digits

    def of(self, code: int) -> PressedSet:
        """Return the set of a number."""
        if code not in self._made:
            self._made[code] = self._make(code)
        return self._made[code]

    def visited(self, most: int) -> list[int]:
        """Numbers of the sets that were made first, so many at most."""
        return list(self._made)[:most]

    @property
    def fastest(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, the upper surfaces pressed."""
        every = sum(math.prod(self.radix[:j].tolist()) for j in range(len(self.radix)))
        return self.of(every).fastest

    def _make(self, code: int) -> PressedSet:
        m, n = self.shape.shape
        digits = self.digits(code)
        pressed = [j for j in range(m) if digits[j]]
        springs, dampers, pushes = np.zeros(m), np.zeros(m), self.shape.copy()
        for j in pressed:
            surface = (digits[j] - 1) // self.modes[j]
            springs[j], dampers[j] = self.springs[j, surface], self.dampers[j, surface]
        held, weight, rate = self._friction(digits, springs, pushes)
        shapes = self.sliders.shape
        stiffness = np.diag(self.stiffness) + product(pushes.T * springs, self.shape) + product(shapes.T * held, shapes)
        damping = self.damping + product(pushes.T * dampers, self.shape)
        rigid = bool(np.any(self.stiffness == 0.0))
        generator, from_modal = modal_blocks(stiffness, damping, rigid, bool(rate.any()))
        to_modal: Array = np.asarray(matrices.inv(from_modal), dtype=np.float64)
        rest, drift = np.zeros((m, 2 * n)), np.zeros((m, 2 * n))
        for j in pressed:
            rest[j], drift[j] = settled(generator, product(to_modal[:, n:], springs[j] * pushes[j]))
        constants = product(self.shape, from_modal[:n], rest.T)
        strains = product(shapes, from_modal[:n], rest.T)
        if rigid:
            constants[pressed, pressed] -= 1.0
        elif pressed:
            # how far a joint rests beyond its surface is small against how far the surface is away
            sticks = np.flatnonzero(held).tolist()
            some, pushed = (np.concatenate([a[pressed], shapes[sticks]]) for a in (self.shape, pushes))
            stiff = np.concatenate([springs[pressed], held[sticks]])
            compliance = product(some / self.stiffness, pushed.T)
            deep = -matrices.inv(np.eye(len(some)) + compliance * stiff)[:, : len(pressed)]
            constants[np.ix_(pressed, pressed)] = deep[: len(pressed)]
            strains[np.ix_(sticks, pressed)] = deep[len(pressed) :]
        lag = np.divide(dampers, springs, out=np.zeros(m), where=springs > 0.0)
        follow = np.zeros((2 * n, 2 * len(held)))
        for c in np.flatnonzero(held):
            follow[:, c] = settled(generator, product(to_modal[:, n:], held[c] * shapes[c]))[0]
            follow[:, len(held) + c] = settled(generator, -follow[:, c])[0]
        rubs = Rubs(self.sliders.joint.astype(float), shapes, follow, weight, rate)
        shown = np.zeros((m + 2 * len(held), m))
        shown[:m] = constants
        for k, j in itertools.product(range(2 * len(held)), pressed):
            at_rest = constants[self.sliders.joint[k // 2], j], strains[k // 2, j]
            shown[m + k, j] = call(read_at_rest, generator, from_modal, self.shape, lag, rubs, k, *at_rest, drift[j])
        return PressedSet(generator, to_modal, from_modal, largest_modulus(generator), rest, drift, shown, lag, rubs)

    def _friction(self, digits: list[int], springs: Array, pushes: Array) -> tuple[Array, Array, Array]:
        """Tangential springs that hold (f,), and ``Rubs.weight``, ``Rubs.rate``; adds to what pressure pushes."""
        f = len(self.sliders.joint)
        held, weight, rate = np.zeros(f), np.zeros((2 * f, 2)), np.zeros(2 * f)
        for c, j in enumerate(self.sliders.joint.tolist()):
            if not digits[j]:
                continue
            surface, mode = divmod(digits[j] - 1, FRICTION_MODES)
            friction, spring = self.sliders.friction[c], self.sliders.springs[c, surface]
            if mode == 0:
                held[c] = spring
                weight[2 * c : 2 * c + 2] = [[friction * springs[j], -spring], [friction * springs[j], spring]]
            else:
                sign = 1.0 if mode == 1 else -1.0
                pushes[j] += sign * friction * self.sliders.shape[c]
                weight[2 * c], rate[2 * c] = (-friction * springs[j] / spring, sign), 1.0
        return held, weight, rate
