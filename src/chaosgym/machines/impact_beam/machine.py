"""The Impact Beam System: finite elements, the modes that are kept, and the model that the kernels integrate."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core.modal_model import ModalImpactModel
from chaosgym.machines.abilities import BendingPart
from chaosgym.machines.flexible_model import flexible_model
from chaosgym.machines.impact_beam.modes import (
    inseparable,
    modal_analysis,
    modal_curvatures,
    static_tip_deflection,
)
from chaosgym.machines.impact_beam.parameters import FINER, FITTED, LADDER, BeamParameters
from chaosgym.machines.integrators import TIGHTEST_EVENTS, ExactEvents
from chaosgym.machines.modal_blocks import nearly_rigid

if TYPE_CHECKING:
    from chaosgym.machines.picture import Sketch

HELD = 10.0
"""Drive over a mode's frequency from which its spring may be left out, with an error of 1 % (derived: f0^2 / f^2)."""


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
    def finer(self) -> "ImpactBeam | None":
        """The beam with 1.5 times as many modes at the least; see ``Machine.finer``."""
        count = next((count for count in FINER if count >= 1.5 * self.n_modes), FINER[-1])
        if count <= self.n_modes:
            return None
        return replace(self, n_modes=count, fitted_modes=FITTED if self.reduction == "free" else 0)

    @property
    def models(self) -> "tuple[ImpactBeam, ...]":
        """Models that a tolerance may choose; see ``Machine.models``."""
        if self.reduction != "free":
            return super().models
        return tuple(replace(self, n_modes=count, fitted_modes=FITTED) for count in LADDER)

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

    @property
    def bending_parts(self) -> Mapping[str, BendingPart]:
        """The beam; positions are from the pivot on."""
        return {"": BendingPart(self._fibre_stress)}

    def _fibre_stress(self, position: float, _fibre: float) -> Array:
        upper = -0.5 * self.height * self.youngs_modulus * modal_curvatures(self, position)
        return np.stack([upper, -upper])

    @property
    def structure(self) -> ModalImpactModel:
        """Model of the beam, whatever frequency, force and clearance; beams that differ in these alone share it."""
        model = self.interpolated or _structure(
            self._with_unchecked(excitation_frequency=1.0, force_amplitude=0.0, clearance=0.0)
        )
        if not model.stiffness.all():
            self._refuse_slow_drive()
        return model

    def _refuse_slow_drive(self) -> None:
        """Refuse a drive so slow that the springs count of modes which are taken for motions of a rigid body."""
        rates = modal_analysis(self).angular_frequency
        held = float(np.max(rates[nearly_rigid(rates)], initial=0.0)) / (2.0 * math.pi)
        if self.excitation_frequency < HELD * held:
            raise inseparable(self)


@lru_cache(maxsize=256)
def _structure(beam: ImpactBeam) -> ModalImpactModel:
    modes, contact = modal_analysis(beam), (beam.contact_stiffness, beam.contact_damping)
    return flexible_model(modes, *contact, step_phase=beam.default_integrator.step_phase)
