"""What must a machine be able to do, so that simulation, diagnosis, sweeps and environments can use it?"""

from collections.abc import Mapping
from typing import Any, ClassVar, Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray


@runtime_checkable
class Machine(Protocol):
    """A frozen dataclass of parameters in SI units, with everything that the floors above need to know of it.

    A new machine is one file beside this one, one kernel file in ``core`` and one line in ``simulation``.
    """

    name: ClassVar[str]
    """Name on the command line, such as ``impact-beam``."""
    speed_field: ClassVar[str]
    """Field that an operator changes while the machine runs."""
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]]
    """Ranges of speed and clearance, in the fields' units, that sweeps and environments cover by default."""
    sides: ClassVar[tuple[str, ...]]
    """Names of the bearing surfaces whose contact force is recorded."""

    @property
    def clearance_field(self) -> str:
        """Field that holds the clearance of the monitored joint."""
        ...

    @property
    def cycle_period(self) -> float:
        """Duration of one operating cycle [s]."""
        ...

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed, in the unit of the speed field, or at many."""
        ...

    @property
    def natural_frequencies(self) -> NDArray[np.float64]:
        """Natural frequencies [Hz] of the machine free of contact, those of the kept modes."""
        ...

    def __hash__(self) -> int:
        """Equal fields, equal hash: results of a machine can be kept."""
        ...

    def reduce(self) -> Any:
        """Return the model, a NamedTuple of numbers and arrays, that the kernels integrate."""
        ...
