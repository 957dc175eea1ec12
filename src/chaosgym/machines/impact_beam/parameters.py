"""Parameters of the Impact Beam System: a beam on a flexure pivot, shaken in the middle, whose tip rattles in a gap.

A steel beam is mounted on a flexure pivot (a rotational and a translational spring) at x = 0. A shaker pushes it at
``force_position`` with F sin(2 pi f t); its suspension adds a spring, a damper and a moving mass there. The tip moves
between two force sensors, ``clearance`` away on either side, that push with a linear spring and damper (thesis 3.3).

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, chapter 3.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from chaosgym.errors import ParameterError
from chaosgym.machines.impact_beam.task_defaults import TASK_DEFAULTS
from chaosgym.machines.machine import Number, Option, TaskDefaults
from chaosgym.machines.modal_impact import ModalImpactMachine
from chaosgym.machines.parameters import parameter

_FIT = "docs/development/calibration.md"

LADDER, FITTED = (4, 7, 10, 14, 20, 30), 2
"""Modes, beside the fitted ones, of the models that a tolerance may choose."""

FINER = (4, 10, 14, 20, 30, 40)
"""Modes of finer models: the least of them that is at least 1.5 times as many tells the error of a model."""

INTERFACES = 4
"""Deflection and slope at the pivot, deflections at shaker and tip: kept by the reduction "interfaces"."""


@dataclass(frozen=True, kw_only=True)
class BeamParameters(ModalImpactMachine):
    """Parameters of the Impact Beam System; the defaults are its rung ``standard`` at 30 Hz and +-0.127 mm.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.
    """

    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        rung: {
            "contact_law": "linear",
            "reduction": "free",
            "n_modes": modes,
            "fitted_modes": fitted,
            "event_accuracy": accuracy,
        }
        for rung, modes, fitted, accuracy in (
            ("standard", 4, 2, "standard"),
            ("fine", 10, 2, "standard"),
            ("reference", 20, 2, "tightest"),
        )
    }

    model_fields: ClassVar[tuple[str, ...]] = ("n_modes", "fitted_modes")
    documented_errors: ClassVar[Mapping[str, float]] = {"standard": 0.05, "fine": 0.005, "reference": 0.001}

    name: ClassVar[str] = "impact-beam"
    speed_field: ClassVar[str] = "excitation_frequency"
    clearance_field: ClassVar[str] = "clearance"
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "excitation_frequency": (4.0, 30.0),
        "clearance": (0.02e-3, 0.2e-3),
    }
    options: ClassVar[Mapping[str, Option]] = {
        "--frequency-hz": Number("excitation_frequency", "Hz"),
        "--clearance-mm": Number("clearance", "mm", 1e-3),
    }
    scenes: ClassVar[Mapping[str, Mapping[str, Any]]] = {"as in the thesis": {}}

    task_defaults: ClassVar[TaskDefaults] = TASK_DEFAULTS

    excitation_frequency: float = parameter(
        30.0, unit="Hz", low=1e-3, high=1e4, provenance="printed", source="thesis figure 3.7"
    )
    """Frequency of the force, and of the operating cycle [Hz]."""
    force_amplitude: float = parameter(8.9, unit="N", low=0.0, high=1e6, provenance="printed", source="thesis 3.4")
    """Amplitude of the shaker force [N]."""
    clearance: float = parameter(
        0.127e-3, unit="m", low=0.0, high=1.0, provenance="printed", source="thesis figures 3.6 and 3.7"
    )
    """Half the gap: the tip moves freely between -clearance and +clearance [m]."""
    length: float = parameter(0.279, unit="m", low=0.01, high=10.0, provenance="printed", source="thesis 3.5.2")
    """From the pivot to the tip [m]."""
    height: float = parameter(
        10.156e-3,
        unit="m",
        low=1e-4,
        high=1.0,
        provenance="derived",
        source="pinned-pinned frequency 288.2 Hz at 284.0 mm, thesis table 3.1",
    )
    """Thickness in the direction of bending [m]."""
    width: float = parameter(0.01796203652149064, unit="m", low=1e-4, high=1.0, provenance="calibrated", source=_FIT)
    """Across the direction of bending [m]."""
    youngs_modulus: float = parameter(2.0e11, unit="Pa", low=1e8, high=1e13, provenance="assumed", source="steel")
    """Young's modulus [Pa]."""
    density: float = parameter(7850.0, unit="kg/m^3", low=10.0, high=1e5, provenance="assumed", source="steel")
    """Mass density [kg/m^3]."""
    force_position: float = parameter(
        0.20793028156308968, unit="m", low=1e-3, high=10.0, provenance="calibrated", source=_FIT
    )
    """Distance of the shaker's push rod from the pivot, at most the length [m]."""
    pivot_rotational_stiffness: float = parameter(
        208.7018,
        unit="N m/rad",
        low=0.0,
        high=1e9,
        provenance="derived",
        source="static tip deflection 3.175 mm under 8.9 N: dimensionless clearance 0.04 is 0.127 mm, thesis 3.5.1",
    )
    """Rotational spring of the flexure pivot [N m/rad]."""
    pivot_translational_stiffness: float = parameter(
        14981.859396355085, unit="N/m", low=1.0, high=1e13, provenance="calibrated", source=_FIT
    )
    """Translational spring of the flexure pivot [N/m]."""
    shaker_stiffness: float = parameter(
        24.022515293504412, unit="N/m", low=0.0, high=1e9, provenance="calibrated", source=_FIT
    )
    """Suspension spring of the shaker [N/m]."""
    shaker_damping: float = parameter(
        53.17532038056393, unit="N s/m", low=0.0, high=1e6, provenance="calibrated", source=_FIT
    )
    """Suspension damper of the shaker [N s/m]."""
    shaker_mass: float = parameter(
        0.03966858811540816, unit="kg", low=0.0, high=1e3, provenance="calibrated", source=_FIT
    )
    """Moving mass of the shaker and its push rod [kg]."""
    damping_ratio: float = parameter(0.01, low=0.0, high=100.0, provenance="printed", source="thesis 3.5.1 and 5.3.1")
    """Structural damping ratio of the first bending mode."""
    damping_family: str = parameter(
        "uniform", choices=("uniform", "stiffness", "beam"), provenance="calibrated", source=_FIT
    )
    """"uniform": the same ratio in every mode; "stiffness": proportional to the mode's frequency; "beam": proportional
    to the stiffness of the beam alone, pivot and shaker springs left out, with the ratio at its first pinned-pinned
    frequency."""
    contact_stiffness: float = parameter(
        1.5e7, unit="N/m", low=1e3, high=1e12, provenance="printed", source="thesis 3.3"
    )
    """Linearised Hertzian stiffness of a sensor surface [N/m]."""
    contact_damping: float = parameter(20.0, unit="N s/m", low=0.0, high=1e6, provenance="printed", source="thesis 3.3")
    """Damping of a sensor surface [N s/m]."""
    contact_law: str = parameter("linear", choices=("linear",), provenance="printed", source="thesis 3.3")
    """Spring and damper. Data sets name it; there is no other."""
    event_accuracy: str = parameter(
        "standard", choices=("standard", "tightest"), provenance="assumed", source="a matter of computing"
    )
    """How closely contact events are placed where no integrator is given."""
    reduction: str = parameter(
        "free", choices=("free", "interfaces"), provenance="assumed", source="interfaces kept in thesis 2.2.1"
    )
    """"free": natural modes of the beam between the sensors; "interfaces": deflection and slope at the pivot and
    deflections at shaker and tip, with fixed-interface modes for the rest (component mode synthesis)."""
    n_modes: int = parameter(4, low=1, high=40, provenance="assumed", source="a matter of computing")
    """Modes kept, the rocking mode included; the thesis has five and none fitted (5.2.3).

    With "interfaces" the degrees of freedom, those of the interfaces too."""
    fitted_modes: int = parameter(2, low=0, high=6, provenance="assumed", source="a matter of computing")
    """Modes added that stand for all that are left out: they give the tip its compliance."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        if self.reduction == "interfaces" and (self.n_modes < INTERFACES or self.fitted_modes):
            raise ParameterError(
                f"n_modes = {self.n_modes} and fitted_modes = {self.fitted_modes} are out of range; allowed: "
                f"{INTERFACES} or more and 0 with reduction = 'interfaces'"
            )
        if self.force_position > self.length:
            raise ParameterError(
                f"force_position = {self.force_position:g} m lies beyond the tip; allowed: 0.001 to {self.length:g} m"
            )
        if self.pivot_rotational_stiffness == 0.0 and self.shaker_stiffness == 0.0:
            raise ParameterError(
                "pivot_rotational_stiffness = 0 N m/rad and shaker_stiffness = 0 N/m leave the beam without a "
                "position of rest; allowed: at least one above 0"
            )
