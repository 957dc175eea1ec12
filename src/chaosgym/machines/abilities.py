"""What only some machines can do or tell; the defaults are the answers of all others."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError

if TYPE_CHECKING:
    from chaosgym.machines.drive_torque import DriveTorque
    from chaosgym.machines.picture import Sketch


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
    """

    stiffness: NDArray[np.float64]
    damping: NDArray[np.float64]
    joints: NDArray[np.float64]
    drive: NDArray[np.float64]
    static: NDArray[np.float64]


class Abilities:
    """Optional part of the protocol ``Machine``."""

    name: ClassVar[str]

    @property
    def carries_deviations(self) -> bool:
        """True if ``run`` takes ``tangents``, so that Lyapunov exponents and derivatives of orbits are exact."""
        return False

    @property
    def runs_fixed_steps(self) -> bool:
        """True if ``run`` takes ``RungeKutta4``."""
        return True

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

    def shape_of(self, place: str) -> Array:
        """Mode shapes (n,) at a named point, or of a motion between two, such as ``pinion - wheel``.

        Raises
        ------
        ParameterError
            If the machine has no such point.
        """
        raise ParameterError(f"{self.name} has no named points; allowed: the file of a machine of modes or matrices")

    @property
    def bending_links(self) -> tuple[str, ...]:
        """Names of the links whose sections may be asked for by ``fibre_stress``."""
        return ()

    def fibre_stress(self, link: str, position: float, fibre: float) -> Array:
        """Stress (f, n) [Pa] at the outer fibres of a link that bends, for each coordinate, pull above zero.

        Parameters
        ----------
        link
            Its name.
        position
            Of the section [m] from the link's beginning on.
        fibre
            Distance [m] of the outer fibres from the neutral one.

        Raises
        ------
        ParameterError
            If the machine has no such link, or the position is outside it.
        """
        raise ParameterError(f"{self.name} has no links that bend; allowed: the file of a mechanism with a beam")

    def showing(self, row: Array) -> Self:
        """The machine whose time histories show a row (n,) of its coordinates in place of the joint's displacement.

        Raises
        ------
        ParameterError
            If the machine has no ``bending_links``.
        """
        raise ParameterError(f"{self.name} has no links that bend; allowed: the file of a mechanism with a beam")

    def stress_at(self, position: float) -> Array:
        """Bending stress (n,) at the outer fibre of its beam for each mode, at a position [m] from its beginning on.

        It is E c phi'' [Pa kg^-1/2 m^-1], positive where the upper fibre is pulled.

        Raises
        ------
        ParameterError
            If the machine has no beam of its own, or the position is outside it.
        """
        raise ParameterError(f"{self.name} has no beam of its own; allowed: impact-beam, or a link that bends")

    def draw(self, panel: Any, record: Any, colour: str, moment: float, force_limit: float) -> None:
        """Draw the machine in motion.

        Parameters
        ----------
        panel
            Axes of matplotlib.
        record
            ``CycleRecord`` of a run, with its time history.
        colour
            Of what tells how the step went: calm, or of Type III.
        moment
            Of the last cycle, from 0 to 1.
        force_limit
            Force [N] to which pictures scale.
        """
        from chaosgym.machines.picture import draw_displacement, draw_sketch, sample_at

        sketch = self.sketch(record, np.array([sample_at(record, moment)]), force_limit)
        if sketch is None:
            draw_displacement(panel, record, colour, moment)
        else:
            draw_sketch(panel, sketch, colour)

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

    def draw_poses(self, panels: Any) -> None:
        """Draw the machine at equal steps of its cycle, one in each of the panels of matplotlib.

        Raises
        ------
        ParameterError
            If it has no such picture.
        """
        raise ParameterError(f"{self.name} has no picture of its links; allowed: the file of a mechanism")
