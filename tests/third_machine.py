"""A machine of one degree of freedom between two stops: the smallest one that every command and task must take."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from chaosgym.machines.flexible_model import Modes, flexible_model
from chaosgym.machines.machine import Number, Option
from chaosgym.machines.modal_impact import ModalImpactMachine
from chaosgym.machines.parameters import parameter


@dataclass(frozen=True, kw_only=True)
class ImpactOscillator(ModalImpactMachine):
    """A mass on a spring and a damper that a harmonic force drives between two compliant stops."""

    name: ClassVar[str] = "impact-oscillator"
    speed_field: ClassVar[str] = "frequency"
    clearance_field: ClassVar[str] = "gap"
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {"frequency": (4.0, 12.0), "gap": (1e-4, 2e-3)}
    options: ClassVar[Mapping[str, Option]] = {"--gap-mm": Number("gap", "mm", 1e-3)}

    frequency: float = parameter(8.0, unit="Hz", low=0.1, high=100.0, provenance="assumed", source="this test")
    gap: float = parameter(1e-3, unit="m", low=0.0, high=0.1, provenance="assumed", source="this test")
    force_amplitude: float = parameter(5.0, unit="N", low=0.0, high=1e3, provenance="assumed", source="this test")
    mass: float = parameter(1.0, unit="kg", low=1e-2, high=1e2, provenance="assumed", source="this test")
    stiffness: float = parameter(1e3, unit="N/m", low=1.0, high=1e6, provenance="assumed", source="this test")
    damping: float = parameter(2.0, unit="N s/m", low=0.0, high=1e3, provenance="assumed", source="this test")
    contact_stiffness: float = parameter(1e6, unit="N/m", low=1e3, high=1e9, provenance="assumed", source="this test")
    contact_damping: float = parameter(50.0, unit="N s/m", low=0.0, high=1e4, provenance="assumed", source="this test")

    @property
    def structure(self) -> Any:
        """Its one mode."""
        rate, shape = math.sqrt(self.stiffness / self.mass), np.array([self.mass**-0.5])
        modes = Modes(np.array([rate]), np.array([[self.damping / self.mass]]), shape, shape)
        return flexible_model(modes, self.contact_stiffness, self.contact_damping)
