"""The Impact Beam System: finite elements, the modes that are kept, and the model that the kernels integrate."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.modal_model import ModalImpactModel
from chaosgym.machines.flexible_model import flexible_model
from chaosgym.machines.impact_beam.modes import modal_analysis, modal_curvatures, static_tip_deflection
from chaosgym.machines.impact_beam.parameters import BeamParameters
from chaosgym.machines.integrators import TIGHTEST_EVENTS, ExactEvents

if TYPE_CHECKING:
    from chaosgym.machines.picture import Sketch


@dataclass(frozen=True, kw_only=True)
class ImpactBeam(BeamParameters):
    """The Impact Beam System; the defaults are the beam of the thesis on the rung ``standard``, 30 Hz and +-0.127 mm.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=20.0, clearance=3.2e-5)
    >>> beam.cycle_period
    0.05
    """

    @property
    def n_states(self) -> int:
        """Displacement and velocity of every mode."""
        return 2 * (self.n_modes + self.fitted_modes)

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] of the kept modes between the surfaces, (n_modes,)."""
        if self.interpolated is not None:
            return super().natural_frequencies
        return np.asarray(modal_analysis(self).angular_frequency / (2.0 * math.pi))

    @property
    def default_integrator(self) -> ExactEvents:
        """Integrator where none is given."""
        return TIGHTEST_EVENTS if self.event_accuracy == "tightest" else ExactEvents()

    @property
    def chaos_thresholds(self) -> Mapping[str, tuple[float, float]]:
        """Clearance over the static tip deflection, and frequency [Hz] (thesis 5.3.1).

        The least clearance is printed for structural dampings of 1 and 8 %, and interpolated between them.
        """
        clearance = self.clearance / static_tip_deflection(self)
        least = 0.02 + 0.02 * (self.damping_ratio - 0.01) / 0.07
        return {"clearance": (clearance, max(0.0, least)), "frequency": (self.excitation_frequency, 16.0)}

    def sketch(self, record: Any, rows: NDArray[np.int64], force_limit: float) -> "Sketch":
        """The beam between its sensors; see ``Machine.sketch``."""
        from chaosgym.machines.impact_beam.picture import sketch_of_beam

        return sketch_of_beam(record, rows)

    def stress_at(self, position: float) -> Array:
        """Bending stress (n,) for each mode at a position [m] from the pivot on; see ``Machine.stress_at``."""
        return -0.5 * self.height * self.youngs_modulus * modal_curvatures(self, position)

    @property
    def structure(self) -> ModalImpactModel:
        """Model of the beam, whatever frequency, force and clearance; beams that differ in these alone share it."""
        return self.interpolated or _structure(
            self._with_unchecked(excitation_frequency=1.0, force_amplitude=0.0, clearance=0.0)
        )


@lru_cache(maxsize=256)
def _structure(beam: ImpactBeam) -> ModalImpactModel:
    modes, contact = modal_analysis(beam), (beam.contact_stiffness, beam.contact_damping)
    return flexible_model(modes, *contact, step_phase=beam.default_integrator.step_phase)
