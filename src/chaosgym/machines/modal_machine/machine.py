"""Your own machine: the modes of a structure, a joint with one or two stops, and a periodic drive.

structure = Structure.of_modes([9.0, 61.0], 0.01, {"tip": [2.1, -1.9], "shaker": [1.2, 0.8]})
machine = ModalMachine(modes=structure, joint="tip", drives=(Drive.sine("force", "shaker", 8.9),), speed=19.0)
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.joints.tables import SLOW
from chaosgym.core.modal_model import ModalImpactModel
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import Flexible
from chaosgym.machines.flexible_model import Modes, Stop, flexible_model
from chaosgym.machines.machine import SPEED_IN_HZ, Number, Option
from chaosgym.machines.modal_impact import ModalImpactMachine
from chaosgym.machines.modal_machine.drive import checked, modal_drive
from chaosgym.machines.modal_machine.driven_structure import DrivenStructure
from chaosgym.machines.parameters import assumed, parameter

ROUNDING = 2.0**-52
"""Relative distance of neighbouring numbers."""

OF_JOINT = {
    "clearance": "clearance",
    "offset": "offset",
    "stops": "stops",
    "stiffness": "contact_stiffness",
    "damping": "contact_damping",
    "lower_stiffness_factor": "lower_stiffness_factor",
    "lower_damping_factor": "lower_damping_factor",
    "preload": "preload",
}
"""What is known of a joint, and the field of a machine with one joint that is the same."""

FEWEST_DIGITS = 1e-9
"""Share of the clearance that rounding may cost unsaid."""


def aliases_of(joint: str) -> dict[str, str]:
    """Fields of a machine by those of its only joint, whose name this is; see ``Machine.aliases``."""
    return {f"{joint}.{what}": field for what, field in (OF_JOINT | {"friction": "friction"}).items()}


@dataclass(frozen=True, kw_only=True)
class ModalMachine(DrivenStructure, ModalImpactMachine):
    """A structure of a few modes with one joint that has a gap, and a periodic drive.

    Fields that are not listed are those of ``DrivenStructure``.

    Attributes
    ----------
    joint
        Point that moves in the gap, such as "tip", "-tip" or "pinion - wheel"; the upper stop lies where it grows.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range or a point does not exist; names it and what is allowed.

    Examples
    --------
    >>> structure = chaosgym.Structure.of_modes([9.0, 61.0], 0.01, {"tip": [2.1, -1.9]})
    >>> drive = chaosgym.Drive.sine("force", "tip", 8.9)
    >>> machine = chaosgym.ModalMachine(modes=structure, joint="tip", drives=(drive,), speed=19.0)
    >>> chaosgym.simulate(machine, cycles=10, transient=100).peak_force.shape
    (10, 2)
    """

    name: ClassVar[str] = "modal-machine"
    clearance_field: ClassVar[str] = "clearance"
    aliases: ClassVar[Mapping[str, str]] = aliases_of("joint")
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"speed": (4.0, 30.0), "clearance": (2e-5, 2e-4)}
    options: ClassVar[Mapping[str, Option]] = {
        **SPEED_IN_HZ,
        "--clearance-mm": Number("clearance", "mm", 1e-3),
    }

    joint: str
    clearance: float = assumed(0.1e-3, "m", 0.0, 10.0)
    """Half the gap; with one stop its distance from the middle [m]."""
    offset: float = assumed(0.0, "m", -10.0, 10.0)
    """Middle of the gap, from where the joint rests without any load [m]."""
    stops: str = parameter("two", choices=("two", "one"), provenance="assumed", source="default")
    """"two", or "one" on the upper side."""
    contact_stiffness: float = assumed(1e7, "N/m", 1e-3, 1e13)
    """Spring of the upper stop [N/m]."""
    contact_damping: float = assumed(20.0, "N s/m", 0.0, 1e9)
    """Damper of the upper stop [N s/m]."""
    lower_stiffness_factor: float = assumed(1.0, "-", 1e-9, 1e9)
    """Spring of the lower stop over that of the upper one."""
    lower_damping_factor: float = assumed(1.0, "-", 0.0, 1e9)
    """Damper of the lower stop over that of the upper one."""
    preload: float = assumed(0.0, "N", -1e9, 1e9)
    """Constant force on the joint, towards the upper stop [N]."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        if not self.modes.shape(self.joint).any():
            raise ParameterError(f"joint = {self.joint!r} never moves: every shape is 0 there")
        modal_drive(self.modes, map(checked, self.drives))

    @property
    def n_states(self) -> int:
        """Displacement and velocity of every mode."""
        return 2 * len(self.modes.angular_frequency)

    @property
    def flexible(self) -> Flexible:
        """Its equations between contacts, with the shapes of the points that are not the joint."""
        return super().flexible._replace(points=self.modes.points_beside([self.joint]))

    @property
    def operating_fields(self) -> tuple[str, ...]:
        """Fields that may change from cycle to cycle."""
        return self.speed_field, self.clearance_field, "offset", "drive_level"

    @property
    def structure(self) -> ModalImpactModel:
        """Model at no speed and no gap; machines that differ in these and in the level of the drive share it."""
        return self.interpolated or _structure(
            self._with_unchecked(speed=1.0, clearance=0.0, offset=0.0, drive_level=1.0)
        )

    def room_of(self, joint: int | None = None) -> tuple[float, float]:
        """Displacement [m] of the joint at its lower and its upper stop; with one stop there is no lower one."""
        upper, lower = self.stops_at(self.clearance).tolist()
        return lower, upper

    def stops_at(self, clearance: Any) -> Array:
        """Positions of the upper and the lower stop [m] at a clearance, (2,), or at many, (k, 2)."""
        gap = np.asarray(clearance, dtype=float)
        lower = self.offset - gap if self.stops == "two" else np.full_like(gap, -math.inf)
        return np.stack([self.offset + gap, lower], axis=-1)

    def reduce(self) -> ModalImpactModel:
        """Return the modal model."""
        model = self.structure
        return model._replace(
            excitation_frequency=self.speed, drive=self.drive_level * model.drive, stops=self.stops_at(self.clearance)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What turns, modes that count as rigid, and digits that a static force costs."""
        hertz = self.frequency_factor * self.modes.angular_frequency / (2.0 * math.pi)
        model, far = self.structure, ""
        # slower modes drift from where they are, whatever their position of rest
        held = np.sqrt(model.stiffness) >= SLOW * self.speed
        held &= (model.stiffness > 0.0) & (model.tip_shape * model.static_force != 0.0)
        away = np.abs(model.tip_shape * model.static_force)[held] / model.stiffness[held]
        farthest = float(np.max(away, initial=0.0))
        if ROUNDING * farthest > FEWEST_DIGITS * max(self.clearance, 1e-6):
            far = (
                f"the static force would push a mode of {hertz[held][np.argmax(away)]:.3g} Hz {farthest:.2g} m away: "
                f"positions are good to {ROUNDING * farthest:.1g} m only; write 0 Hz if the body is free"
            )
        return self._notes(far)


def clearance_option(field: str, turning: bool) -> dict[str, Option]:
    """Short option of the clearance of a joint, in the unit that is usual for it."""
    if turning:
        return {"--clearance-arcmin": Number(field, "arcmin", math.pi / 10_800.0)}
    return {"--clearance-mm": Number(field, "mm", 1e-3)}


@lru_cache(maxsize=256)
def _structure(machine: ModalMachine) -> ModalImpactModel:
    joint, (harmonics, static) = machine.modes.shape(machine.joint), modal_drive(machine.modes, machine.drives)
    rates, damping = machine.modes.angular_frequency, machine.modes.damping
    modes = Modes(machine.frequency_factor * rates, machine.damping_factor * damping, joint, np.zeros_like(joint))
    upper = Stop(machine.contact_stiffness, machine.contact_damping)
    lower = Stop(machine.lower_stiffness_factor * upper.stiffness, machine.lower_damping_factor * upper.damping)
    load = static + machine.preload * joint
    return flexible_model(modes, *upper, lower=lower, static_force=load, drive=harmonics)
