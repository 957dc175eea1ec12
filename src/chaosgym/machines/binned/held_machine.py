"""What a machine is whose matrices vary with the angle of a drive and are held over bins of it."""

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cache, lru_cache
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.binned.model import BinnedModel, TaylorModel
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import Kinematics
from chaosgym.machines.binned.equations import STEP_PHASE, Contact, Held
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of


@dataclass(frozen=True, kw_only=True)
class HeldMachine(Machine):
    """A mechanism that is driven at a constant speed [rpm], with contacts along rows of displacement."""

    beside_matrices: ClassVar[tuple[str, ...]] = ()
    """Fields that change neither the matrices nor the contacts but for their gaps: speed and clearances."""

    if TYPE_CHECKING:
        matrix_update_interval: float
        """Angle of the drive over which matrices are held [deg]; divides 360."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        if abs(360.0 / self.matrix_update_interval - self.bins) > 1e-9:
            known = parameters_of(self)["matrix_update_interval"]
            raise ParameterError(
                f"matrix_update_interval = {self.matrix_update_interval:g} deg is out of range; "
                f"allowed: {known.low:g} to {known.high:g} deg that divide 360 deg"
            )

    @property
    def bins(self) -> int:
        """Bins of the drive's angle over which matrices are held."""
        return round(360.0 / self.matrix_update_interval)

    @abstractmethod
    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""

    @property
    @abstractmethod
    def contacts(self) -> Sequence[Contact]:
        """All contacts, those of a joint in a row."""

    @property
    @abstractmethod
    def has_propagators(self) -> bool:
        """True if contact is linear, no contact force turns with a ball, and the contact sets are few."""

    @property
    @abstractmethod
    def display(self) -> Array:
        """Displacement (n,) of the monitored joint per unit coordinate."""

    @property
    @abstractmethod
    def stiffest(self) -> float:
        """Stiffness [N/m] that the fastest contact may have."""

    @property
    def gaps(self) -> Array:
        """Clearances [m] of the contacts."""
        return np.array([contact.gap for contact in self.contacts])

    @property
    def kinematics(self) -> Kinematics:
        """How the monitored joint and the contacts move, and the inverse of the mass matrix at angle 0."""
        return Kinematics(
            mobility=np.asarray(kept_held(structure_of(self)).inverse_mass[0]),
            places={"the joint": self.display},
            stops=[(row, contact.gap) for contact in self.contacts for row in contact.row],
        )

    @property
    def radix(self) -> int:
        """Contact states of a channel that differ in their matrices: 3 where friction tells one side from the other."""
        return 2

    @property
    def round_bearing(self) -> bool:
        """True if the monitored joint's bearing is one surface all around, which wears as one."""
        return False

    @property
    def sampled_bins(self) -> list[int]:
        """Bins at which eigenvalues are looked at."""
        return list(range(0, self.bins, max(1, self.bins // 12)))

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed [rpm], or at many."""
        return 60.0 / speed

    @staticmethod
    def rate_at(speed: float) -> float:
        """Angular velocity [rad/s] of the drive at a speed [rpm]."""
        return speed * math.pi / 30.0

    @property
    def drive_speed(self) -> float:
        """Speed of the drive, in the unit of the speed field."""
        return float(getattr(self, self.speed_field))

    @property
    def crank_rate(self) -> float:
        """Angular velocity of the drive [rad/s]."""
        return self.rate_at(self.drive_speed)

    @property
    def n_states(self) -> int:
        """Displacement and velocity of every degree of freedom."""
        return 2 * len(self.degrees_of_freedom)

    @abstractmethod
    def reduce(self, step_phase: float = STEP_PHASE) -> BinnedModel | TaylorModel:
        """Return the model that the kernels integrate; see ``BinnedMachine.reduce``."""


KEPT = 128
"""Machines whose assembled equations are kept, whatever their speed and clearance."""


def structure_of(machine: HeldMachine) -> HeldMachine:
    """The machine at the default speed and clearances, by which is kept what all machines of its matrices share."""
    return machine._with_unchecked(**_beside(type(machine)))


@cache
def _beside(kind: Any) -> dict[str, Any]:
    return {field.name: field.default for field in fields(kind) if field.name in kind.beside_matrices}


@lru_cache(maxsize=KEPT)
def kept_held(structure: HeldMachine) -> Held:
    """What is held, kept for machines without a table of propagators."""
    return structure.held()
