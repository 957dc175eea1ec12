"""A structure of a few modes and what drives it: what machines of one gap and of several have alike."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from math import pi
from typing import TYPE_CHECKING, Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import Abilities
from chaosgym.machines.machine import SPEED_IN_HZ, Option
from chaosgym.machines.modal_blocks import RIGID_SHARE, nearly_rigid
from chaosgym.machines.modal_machine.drive import Drive, drive_notes
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.machines.parameters import assumed

if TYPE_CHECKING:
    from chaosgym.machines.picture import Sketch


@dataclass(frozen=True, kw_only=True)
class DrivenStructure(Abilities):
    """A structure of a few modes and a periodic drive, by more modes of its matrices or by fewer of a file with many.

    Of several joints, what is known of one is a field each: ``left_clearance`` of the joint "left", and so on.

    Attributes
    ----------
    modes
        Of the structure between the stops.
    drives
        What drives it, by harmonics of the speed.
    """

    speed_field: ClassVar[str] = "speed"
    options: ClassVar[Mapping[str, Option]] = SPEED_IN_HZ
    model_fields: ClassVar[tuple[str, ...]] = ("modes",)
    places: ClassVar[Mapping[str, str]] = {}
    """Point that moves in the gap of each of several joints, by the joint's name."""
    turning: ClassVar[tuple[str, ...]] = ()
    """Names of joints that turn: their fields are in rad and N m, and "N" and "m" of a result mean these."""

    modes: Structure
    drives: tuple[Drive, ...] = field(default=())
    speed: float = assumed(30.0, "Hz", 1e-3, 1e5)
    """Operating cycles a second [Hz]."""
    drive_level: float = assumed(1.0, "-", 0.0, 1e6)
    """Factor of all harmonics of the drive."""
    damping_factor: float = assumed(1.0, "-", 0.0, 1e6)
    """Factor of the structure's damping."""
    frequency_factor: float = assumed(1.0, "-", 1e-3, 1e3)
    """Factor of all natural frequencies."""

    def shape_of(self, place: str) -> Array:
        """Mode shapes (n,) at a point of the structure; see ``Machine.shape_of``."""
        return self.modes.shape(place)

    def sketch(self, record: Any, rows: NDArray[np.int64], force_limit: float) -> "Sketch":
        """What moves in each gap; see ``Machine.sketch``."""
        from chaosgym.machines.modal_machine.picture import sketch_of_joints

        return sketch_of_joints(record, rows)

    def _notes(self, *own: str) -> tuple[str, ...]:
        """What turns, modes that count as rigid, notes of its own, and what sampled drives leave out."""
        hertz = self.frequency_factor * self.modes.angular_frequency / (2.0 * pi)
        notes = _turning_note(self.turning), _rigid_note(hertz), *own, self.modes.scale_note, *drive_notes(self.drives)
        return tuple(filter(None, notes))

    @property
    def model_numbers(self) -> Mapping[str, float]:
        """Number of modes, and other fields that a tolerance chooses."""
        others = {name: getattr(self, name) for name in self.model_fields if name != "modes"}
        return {"modes": len(self.modes.angular_frequency), **others}

    def _finer_fields(self) -> dict[str, Any]:
        """Fields of a finer model that differ from its own."""
        structure = self.modes.finer
        return {} if structure is None else {"modes": structure}

    @property
    def finer(self) -> "Self | None":
        """The machine with more modes of its matrices, or all of its file; see ``Machine.finer``."""
        fields = self._finer_fields()
        try:
            return replace(self, **fields) if fields else None
        except ParameterError:
            return None

    @property
    def models(self) -> "tuple[Self, ...]":
        """With fewer modes of its file, then as it is, then with more of its matrices; see ``Machine.models``."""
        fewer: list[Self] = []
        for structure in self.modes.coarser:
            try:
                fewer.append(replace(self, modes=structure))
            except ParameterError:  # a joint that these modes do not move
                continue
        return (*fewer, *super().models)

    @property
    def left_out(self) -> str:
        """Error of leaving out modes that nothing tells of; see ``Machine.left_out``."""
        return self.modes.left_out


def _turning_note(joints: tuple[str, ...]) -> str:
    """What is to be said of joints that turn; empty if none does."""
    who = "the joint turns" if joints == ("joint",) else f"joints that turn: {', '.join(joints)}"
    return f"{who}; results write N for its N m and m for its rad (mm for mrad)" if joints else ""


def _rigid_note(hertz: Array) -> str:
    """What is to be said of natural frequencies (n,) [Hz] that count as motions of a rigid body; empty if none does."""
    slow = ", ".join(f"{rate:.3g}" for rate in hertz[nearly_rigid(hertz)])
    told = f"modes of {slow} Hz count as motions of a rigid body: below {RIGID_SHARE:g} of the fastest mode"
    return told if slow else ""
