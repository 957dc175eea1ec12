"""What only some machines can do or tell; the defaults are the answers of all others."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError

if TYPE_CHECKING:
    from chaosgym.machines.drive_torque import DriveTorque
    from chaosgym.machines.picture import Sketch


class FreeBodies(NamedTuple):
    """What holds the free bodies among n mass-normalised modes.

    Attributes
    ----------
    rigid : (n,)
        Which modes have no stiffness.
    damping : (n, n)
        D [1/s] of all modes.
    rows : (m, n)
        What each joint, each spring beside the modes and each surface that rubs moves for a mode.
    """

    rigid: NDArray[np.bool_]
    damping: NDArray[np.float64]
    rows: NDArray[np.float64]


class Flexible(NamedTuple):
    """Equations of n mass-normalised modes q between contacts, q'' + D q' + diag(w^2) q = f(t) - sum phi_j F_j.

    Attributes
    ----------
    stiffness, damping : (n,), (n, n)
        w^2 [1/s^2] and D [1/s].
    joints : (m, n)
        phi_j, what each joint moves for a mode [kg^-1/2]; F_j is the force of its upper stop less that of its lower.
    drive : (H, 2, n)
        Modal forces of cosine and sine of each harmonic of the speed, from the first on [N kg^-1/2].
    static : (n,)
        The constant one [N kg^-1/2].
    points
        What each named point that is no joint moves for a mode, (n,).
    """

    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    joints: NDArray[np.float64]
    drive: NDArray[np.float64]
    static: NDArray[np.float64]
    points: Mapping[str, NDArray[np.float64]] = {}


class Kinematics(NamedTuple):
    """How joints and named points move with n coordinates, and how these answer an impulse.

    Attributes
    ----------
    mobility : (n, n)
        Change of all velocities by a unit impulse along each coordinate, at the start of a cycle: the inverse of the
        mass matrix.
    places
        Displacement (n,) per unit coordinate of joints and, on machines of modes, of the points of their shapes.
    stops
        Displacement (n,) of each contact per unit coordinate, and the distance [m] to its farthest stop.
    """

    mobility: NDArray[np.float64]
    places: Mapping[str, NDArray[np.float64]]
    stops: list[tuple[Array, float]]

    @property
    def unit_knocks(self) -> Mapping[str, Array]:
        """Change of the velocities (n,) that changes that of a place by 1, by an impulse along its motion, by place."""
        impulses = {place: (row, product(self.mobility, row)) for place, row in self.places.items() if row.any()}
        return {place: answer / float(product(row, answer)) for place, (row, answer) in impulses.items()}


class BendingPart(NamedTuple):
    """A part of a machine that bends.

    Attributes
    ----------
    stress
        Stress (f, n) [Pa] at the outer fibres for each coordinate, pull above zero. It asks for the position [m] of the
        section from the part's beginning on, and for the distance [m] of the outer fibres from the neutral one, which
        a machine's own beam knows.
    showing
        The machine whose time histories show a row (n,) of its coordinates in place of the joint's displacement; None
        where the modes of ``flexible`` tell the stress over time.
    """

    stress: Callable[[float, float], Array]
    showing: Callable[[Array], Any] | None = None


class Propagation(NamedTuple):
    """How a machine moves between two changes of contact.

    Attributes
    ----------
    how
        In words, and what that leaves.
    deviations
        Whether ``run`` takes ``tangents``, so that Lyapunov exponents and derivatives of orbits are exact.
    costly
        Whether a derivative of ``run`` costs several runs, as without deviations.
    fixed_steps
        Whether ``run`` takes ``RungeKutta4``.
    """

    how: str = "exact propagation between contacts"
    deviations: bool = True
    costly: bool = False
    fixed_steps: bool = True


MOST_MODELS = 4
"""Models that a tolerance may choose from, where a machine names no others."""


class Abilities:
    """Optional part of the protocol ``Machine``."""

    name: ClassVar[str]
    model_fields: ClassVar[tuple[str, ...]] = ()
    """Fields that a tolerance chooses: they decide accuracy alone."""
    documented_errors: ClassVar[Mapping[str, float]] = {}
    """Error of the peak force, as a share, that the documentation states of rungs."""

    @property
    def model_numbers(self) -> Mapping[str, float]:
        """What tells this model from coarser and finer ones, such as its number of modes."""
        return {name: getattr(self, name) for name in self.model_fields}

    @property
    def finer(self) -> "Self | None":
        """The same machine by a model so much finer that the difference tells the error of this one; None without."""
        return None

    @property
    def models(self) -> "tuple[Self, ...]":
        """The same machine by each model that a tolerance may choose, the cheapest first."""
        chain = [self]
        while len(chain) < MOST_MODELS and (finer := chain[-1].finer) is not None:
            chain.append(finer)
        return tuple(chain)

    @property
    def left_out(self) -> str:
        """Error that no ``finer`` model tells of, as a sentence; empty if there is none."""
        return ""

    @property
    def moving(self) -> Propagation:
        """How it moves; by default without deviations."""
        return Propagation(deviations=False, costly=True)

    @property
    def mirrors(self) -> bool:
        """True if the mirror image of a motion, half a cycle later, is a motion too, and ``section_at`` serves."""
        return False

    def section_at(self, phase: float, share: float = 1.0) -> "Self | None":
        """Return the machine whose cycles begin at a phase of the drive, for exact runs; None if it has none.

        Parameters
        ----------
        phase
            As a share of the cycle.
        share
            Of a cycle that each row of ``run`` lasts.
        """
        return None

    @property
    def drive_torque(self) -> "DriveTorque | None":
        """Torque of its drive over a revolution while every gap stays in its middle; None if it has none to tell."""
        return None

    @property
    def instabilities(self) -> tuple[str, ...]:
        """What may make its motion grow without end, as far as its equations tell; each a sentence."""
        return ()

    @property
    def chaos_thresholds(self) -> Mapping[str, tuple[float, float]]:
        """Quantities that chaos needs above a printed threshold: (value, threshold) by name; empty if unknown."""
        return {}

    @property
    def flexible(self) -> Flexible | None:
        """Its equations between contacts, if it is one of a few modes; its states are then q and q'."""
        return None

    @property
    def without_friction(self) -> Flexible | None:
        """``flexible``, where friction is left out of the equations."""
        return self.flexible

    @property
    def free_bodies(self) -> FreeBodies | None:
        """What holds its free bodies, if it is one of a few modes."""
        equations = self.without_friction
        if equations is None:
            return None
        return FreeBodies(equations.stiffness == 0.0, equations.damping, equations.joints)

    def shape_of(self, place: str) -> Array:
        """Mode shapes (n,) at a named point, or of a motion between two, such as ``pinion - wheel``.

        Raises
        ------
        ParameterError
            If the machine has no such point.
        """
        raise ParameterError(f"{self.name} has no named points; allowed: the file of a machine of modes or matrices")

    @property
    def bending_parts(self) -> Mapping[str, BendingPart]:
        """Parts that bend, by the name of their link; "" is the machine's own beam."""
        return {}

    def sketch(self, record: Any, rows: NDArray[np.int64], force_limit: float) -> "Sketch | None":
        """The machine at some moments, as shapes and words; None if it has no picture.

        Parameters
        ----------
        record
            ``CycleRecord`` of a run, with its time history.
        rows : (moments,)
            Samples of the history.
        force_limit
            Force [N] to which pictures scale.
        """
        return None

    def draw_poses(self, panels: Any) -> bool:
        """Draw the machine at equal steps of its cycle, one in each of the panels of matplotlib; False if it can't."""
        return False
