r"""What is the Impact Beam System? A beam on a flexure pivot, shaken in the middle, whose tip rattles in a gap.

A steel beam is mounted on a flexure pivot (a rotational and a translational spring) at x = 0. A shaker pushes it at
``force_position`` with F sin(2 pi f t); its suspension adds a spring, a damper and a moving mass there. The tip moves
between two force sensors, ``clearance`` away on either side, that push with a linear spring and damper (thesis 3.3).

Finite elements -> modes of the beam free of the sensors -> ``n_modes`` modal coordinates -> ModalImpactModel.

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, chapter 3.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.modal_impact import ModalImpactModel
from chaosgym.core.propagator import Regimes
from chaosgym.core.restitution import RestitutionModel
from chaosgym.errors import ParameterError
from chaosgym.machines.beam_element import bending_matrices, graded_mesh
from chaosgym.machines.fidelity import FidelityLadder
from chaosgym.machines.impact_beam.linear_impact import linear_impact
from chaosgym.machines.parameters import parameter, validate

Array = NDArray[np.float64]

MIN_ELEMENTS = 24
"""Elements of the finest default mesh; more modes take three elements a mode."""

MAX_CONDITION = 1e8
"""Largest condition number of a usable set of eigenvectors."""

_FIT = "five-mode fit to the printed natures and forces of figures 3.8 to 3.12"


@dataclass(frozen=True, kw_only=True)
class ImpactBeam(FidelityLadder):
    """The Impact Beam System; the defaults are the beam of the thesis at 30 Hz and +-0.127 mm.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.
    """

    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        "restitution": {"contact_law": "restitution", "n_modes": 1, "event_accuracy": "standard"},
        "rigid": {"contact_law": "linear", "n_modes": 1, "event_accuracy": "standard"},
        "modes-3": {"contact_law": "linear", "n_modes": 3, "event_accuracy": "standard"},
        "modes-5": {"contact_law": "linear", "n_modes": 5, "event_accuracy": "standard"},
        "modes-8": {"contact_law": "linear", "n_modes": 8, "event_accuracy": "standard"},
        "reference": {"contact_law": "linear", "n_modes": 12, "event_accuracy": "tightest"},
    }

    name: ClassVar[str] = "impact-beam"
    speed_field: ClassVar[str] = "excitation_frequency"
    clearance_field: ClassVar[str] = "clearance"
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "excitation_frequency": (4.0, 30.0),
        "clearance": (0.02e-3, 0.2e-3),
    }
    sides: ClassVar[tuple[str, ...]] = ("upper", "lower")

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
    width: float = parameter(17.58e-3, unit="m", low=1e-4, high=1.0, provenance="calibrated", source=_FIT)
    """Across the direction of bending [m]."""
    youngs_modulus: float = parameter(2.0e11, unit="Pa", low=1e8, high=1e13, provenance="assumed", source="steel")
    """Young's modulus [Pa]."""
    density: float = parameter(7850.0, unit="kg/m^3", low=10.0, high=1e5, provenance="assumed", source="steel")
    """Mass density [kg/m^3]."""
    force_position: float = parameter(0.1809, unit="m", low=1e-3, high=10.0, provenance="calibrated", source=_FIT)
    """Distance of the shaker's push rod from the pivot, at most the length [m]."""
    pivot_rotational_stiffness: float = parameter(
        128.572,
        unit="N m/rad",
        low=0.0,
        high=1e9,
        provenance="derived",
        source="static tip deflection 3.175 mm under 8.9 N: dimensionless clearance 0.04 is 0.127 mm, thesis 3.5.1",
    )
    """Rotational spring of the flexure pivot [N m/rad]."""
    pivot_translational_stiffness: float = parameter(
        9.7e7, unit="N/m", low=1.0, high=1e13, provenance="calibrated", source=_FIT
    )
    """Translational spring of the flexure pivot [N/m]."""
    shaker_stiffness: float = parameter(510.0, unit="N/m", low=0.0, high=1e9, provenance="calibrated", source=_FIT)
    """Suspension spring of the shaker [N/m]."""
    shaker_damping: float = parameter(22.5, unit="N s/m", low=0.0, high=1e6, provenance="calibrated", source=_FIT)
    """Suspension damper of the shaker [N s/m]."""
    shaker_mass: float = parameter(0.089, unit="kg", low=0.0, high=1e3, provenance="calibrated", source=_FIT)
    """Moving mass of the shaker and its push rod [kg]."""
    damping_ratio: float = parameter(0.01, low=0.0, high=100.0, provenance="printed", source="thesis 3.5.1 and 5.3.1")
    """Structural damping ratio of the first bending mode."""
    damping_family: str = parameter("stiffness", choices=("uniform", "stiffness"), provenance="calibrated", source=_FIT)
    """"uniform": the same ratio in every mode; "stiffness": proportional to the mode's frequency."""
    contact_stiffness: float = parameter(
        1.5e7, unit="N/m", low=1e3, high=1e12, provenance="printed", source="thesis 3.3"
    )
    """Linearised Hertzian stiffness of a sensor surface [N/m]."""
    contact_damping: float = parameter(20.0, unit="N s/m", low=0.0, high=1e6, provenance="printed", source="thesis 3.3")
    """Damping of a sensor surface [N s/m]."""
    contact_law: str = parameter("linear", choices=("linear", "restitution"), provenance="printed", source="thesis 3.3")
    """"linear": spring and damper; "restitution": impacts of a rigid beam that take no time, with what the same spring
    and damper restore of the speed."""
    event_accuracy: str = parameter(
        "standard", choices=("standard", "tightest"), provenance="assumed", source="a matter of computing"
    )
    """How closely contact events are placed where no integrator is given."""
    n_modes: int = parameter(5, low=1, high=40, provenance="printed", source="thesis 5.2.3: 5 degrees of freedom")
    """Modes kept, the rocking mode included."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
        validate(self)
        if self.contact_law == "restitution" and self.n_modes > 1:
            raise ParameterError(
                f"n_modes = {self.n_modes} is out of range; allowed: 1 with contact_law = 'restitution', whose beam is "
                "rigid"
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

    @property
    def cycle_period(self) -> float:
        """Duration of one operating cycle [s]."""
        return float(self.period_at(self.excitation_frequency))

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed [Hz], or at many."""
        return 1.0 / speed

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] of the kept modes between the sensors, (n_modes,)."""
        return np.asarray(np.sqrt(self.reduce().stiffness) / (2.0 * math.pi))

    def reduce(self) -> ModalImpactModel | RestitutionModel:
        """Return the modal model; machines that differ in frequency, force or clearance share the costly part."""
        structure: ModalImpactModel | RestitutionModel = _structure(
            *(getattr(self, field) for field in _STRUCTURE_FIELDS)
        )
        return structure._replace(
            excitation_frequency=self.excitation_frequency,
            force_amplitude=self.force_amplitude,
            clearance=self.clearance,
        )


_STRUCTURE_FIELDS = (
    "length",
    "height",
    "width",
    "youngs_modulus",
    "density",
    "force_position",
    "pivot_rotational_stiffness",
    "pivot_translational_stiffness",
    "shaker_stiffness",
    "shaker_damping",
    "shaker_mass",
    "damping_ratio",
    "damping_family",
    "contact_stiffness",
    "contact_damping",
    "contact_law",
    "n_modes",
)

THESIS_IMPACT_BEAM = ImpactBeam()
"""The beam of the thesis; ``parameters_of(ImpactBeam)`` says where each number comes from."""


class ModalAnalysis(NamedTuple):
    """Modes of the beam free of the sensors.

    ``angular_frequency`` (n,) [rad/s]; ``damping_ratio`` (n,) structural part; ``damping`` (n, n) modal damping with
    the shaker's damper [1/s]; ``tip_shape``, ``force_shape`` (n,) mass-normalised shapes [kg^-1/2].
    """

    angular_frequency: Array
    damping_ratio: Array
    damping: Array
    tip_shape: Array
    force_shape: Array


def _assembled(beam: ImpactBeam, elements: int) -> tuple[Array, Array, int, int]:
    """Mass and stiffness matrices with springs and shaker mass, and the numbers of the force and tip deflections."""
    stations = (0.0, beam.force_position, beam.length)
    at_tip = beam.length - beam.force_position < 1e-9 * beam.length
    lengths = graded_mesh((0.0, beam.length) if at_tip else stations, elements)
    section = beam.width * beam.height
    bending_stiffness = beam.youngs_modulus * beam.width * beam.height**3 / 12.0
    mass, stiffness = bending_matrices(lengths, bending_stiffness, beam.density * section)
    tip = len(mass) - 2
    at_force = 2 * int(np.argmin(np.abs(np.concatenate([[0.0], np.cumsum(lengths)]) - beam.force_position)))
    stiffness[0, 0] += beam.pivot_translational_stiffness
    stiffness[1, 1] += beam.pivot_rotational_stiffness
    stiffness[at_force, at_force] += beam.shaker_stiffness
    mass[at_force, at_force] += beam.shaker_mass
    return mass, stiffness, at_force, tip


def modal_analysis(beam: ImpactBeam, elements: int | None = None) -> ModalAnalysis:
    """Natural modes of the beam between the sensors.

    Parameters
    ----------
    beam
        The machine.
    elements
        Number of finite elements; at least 24 and three a mode by default.
    """
    from scipy.linalg import eigh

    mass, stiffness, at_force, tip = _assembled(beam, elements or max(MIN_ELEMENTS, 3 * beam.n_modes))
    wanted = max(beam.n_modes, 2)
    # the inverse problem, M s = K s / w^2, keeps the slow rocking mode exact on fine meshes
    size = len(mass)
    scale = 1.0 / np.sqrt(np.diag(stiffness))
    try:
        inverse_squares, shapes = eigh(
            mass * np.outer(scale, scale),
            stiffness * np.outer(scale, scale),
            subset_by_index=[size - wanted, size - 1],
        )
    except np.linalg.LinAlgError as error:
        raise _inseparable(beam) from error
    if inverse_squares[0] < 1e-14 * inverse_squares[-1]:
        raise _inseparable(beam)
    angular = 1.0 / np.sqrt(inverse_squares[::-1])
    shapes = (scale[:, None] * shapes / np.sqrt(inverse_squares))[:, ::-1]
    shapes = shapes * np.where(shapes[tip] < 0.0, -1.0, 1.0)
    if beam.damping_family == "uniform":
        ratio = np.full(wanted, beam.damping_ratio)
    else:
        ratio = beam.damping_ratio * angular / angular[1]
    kept = slice(0, beam.n_modes)
    angular, ratio, force_shape = angular[kept], ratio[kept], shapes[at_force, kept]
    damping = np.diag(2.0 * ratio * angular) + beam.shaker_damping * np.outer(force_shape, force_shape)
    return ModalAnalysis(angular, ratio, damping, shapes[tip, kept].copy(), force_shape.copy())


def _inseparable(beam: ImpactBeam) -> ParameterError:
    return ParameterError(
        f"n_modes = {beam.n_modes} of a beam with length = {beam.length:g} m, height = {beam.height:g} m, "
        f"pivot_rotational_stiffness = {beam.pivot_rotational_stiffness:g} N m/rad and shaker_stiffness = "
        f"{beam.shaker_stiffness:g} N/m differ so much in frequency that rounding hides the slowest; "
        "allowed: fewer modes, or stiffer springs"
    )


def static_tip_deflection(beam: ImpactBeam) -> float:
    """Tip deflection [m] without sensors when the force amplitude acts statically: the unit of clearance (3.5.1)."""
    _, stiffness, at_force, tip = _assembled(beam, MIN_ELEMENTS)
    load = np.zeros(len(stiffness))
    load[at_force] = beam.force_amplitude
    return float(np.linalg.solve(stiffness, load)[tip])


def pinned_pinned_frequency(beam: ImpactBeam, length: float) -> float:
    """First natural frequency [Hz] of a beam of the same section, pinned at both ends (thesis table 3.1)."""
    from scipy.linalg import eigh

    section = beam.width * beam.height
    bending_stiffness = beam.youngs_modulus * beam.width * beam.height**3 / 12.0
    mass, stiffness = bending_matrices(
        graded_mesh((0.0, length), MIN_ELEMENTS), bending_stiffness, beam.density * section
    )
    free = [i for i in range(len(mass)) if i not in (0, len(mass) - 2)]
    lowest = eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True, subset_by_index=[0, 0])
    return float(math.sqrt(lowest[0]) / (2.0 * math.pi))


def _modal_blocks(stiffness: Array, damping: Array) -> tuple[Array, Array, Array]:
    """Real 2 x 2 blocks of q'' + damping q' + stiffness q = 0: (rotates (n,), rate (n, 2), from_modal (2n, 2n)).

    A mode that is critically damped to the last digit has one eigenvector instead of two. Its damping is then moved by
    a billionth, which separates the pair.
    """
    n = len(stiffness)
    scale = math.sqrt(np.linalg.norm(stiffness, 2))
    for nudged in (1.0, 1.0 + 1e-9, 1.0 + 1e-8):
        system = np.block([[np.zeros((n, n)), np.eye(n)], [-stiffness, -nudged * damping]])
        values, vectors = np.linalg.eig(system)
        balanced = vectors * np.concatenate([np.full(n, scale), np.ones(n)])[:, None]
        if np.linalg.cond(balanced / np.linalg.norm(balanced, axis=0)) < MAX_CONDITION:
            break
    turning = [i for i in np.argsort(np.abs(values)) if values[i].imag > 0.0]
    decaying = [i for i in np.argsort(np.abs(values)) if values[i].imag == 0.0]
    rotates, rate, columns = [], [], []
    for i in turning:
        rotates.append(True)
        rate.append((min(values[i].real, 0.0), values[i].imag))
        columns += [vectors[:, i].real, -vectors[:, i].imag]
    for i, k in zip(decaying[::2], decaying[1::2], strict=True):
        rotates.append(False)
        rate.append((min(values[i].real, 0.0), min(values[k].real, 0.0)))
        columns += [vectors[:, i].real, vectors[:, k].real]
    return np.array(rotates), np.array(rate), np.column_stack(columns)


def _derivative(rotates: Array, rate: Array) -> Array:
    """Block-diagonal matrix B of u' = B u."""
    from scipy.linalg import block_diag

    blocks = [[[a, -b], [b, a]] if turns else [[a, 0.0], [0.0, b]] for turns, (a, b) in zip(rotates, rate, strict=True)]
    return np.asarray(block_diag(*blocks))


def _bound(rotates: Array, row: Array) -> Array:
    """Coefficients m with |row . exp(B t) u| <= sum m |u| for all t >= 0."""
    pairs = np.abs(row).reshape(-1, 2)
    turning = np.hypot(pairs[:, 0], pairs[:, 1])[:, None]
    return np.where(rotates[:, None], turning, pairs).ravel()


def _regimes(modes: ModalAnalysis, *systems: tuple[Array, Array]) -> Regimes:
    """Regimes of several (stiffness, damping) of the same modes."""
    tip = modes.tip_shape
    n = len(tip)
    load = np.concatenate([np.zeros(n), modes.force_shape])
    parts = []
    for matrices in systems:
        rotates, rate, from_modal = _modal_blocks(*matrices)
        to_modal = np.linalg.inv(from_modal)
        derivative = _derivative(rotates, rate)
        displacement = tip @ from_modal[:n]
        rows = [displacement]
        for _ in range(3):
            rows.append(rows[-1] @ derivative)
        magnitude = np.stack([_bound(rotates, rows[2]), _bound(rotates, rows[3])])
        modulus = np.where(rotates[:, None], np.hypot(rate[:, :1], rate[:, 1:]), np.abs(rate)).ravel()
        parts.append(
            (
                rotates,
                rate,
                to_modal,
                from_modal,
                np.stack(rows[:3]),
                magnitude,
                to_modal @ load,
                modulus,
                modulus.max(),
            )
        )
    return Regimes(*(np.ascontiguousarray(np.stack(part)) for part in zip(*parts, strict=True)))


@lru_cache(maxsize=256)
def _structure(*structure: Any) -> ModalImpactModel | RestitutionModel:
    beam = ImpactBeam(**dict(zip(_STRUCTURE_FIELDS, structure, strict=True)))
    modes = modal_analysis(beam)
    return _rigid_model(beam, modes) if beam.contact_law == "restitution" else _flexible_model(beam, modes)


def _rigid_model(beam: ImpactBeam, modes: ModalAnalysis) -> RestitutionModel:
    stiffness = modes.angular_frequency**2
    impact = linear_impact(1.0 / float(modes.tip_shape[0]) ** 2, beam.contact_stiffness, beam.contact_damping)
    return RestitutionModel(
        excitation_frequency=beam.excitation_frequency,
        force_amplitude=beam.force_amplitude,
        clearance=beam.clearance,
        stiffness=stiffness,
        damping=modes.damping,
        tip_shape=modes.tip_shape,
        force_shape=modes.force_shape,
        regimes=_regimes(modes, (np.diag(stiffness), modes.damping)),
        restitution=impact.restitution,
        contact_duration=impact.duration,
        force_per_speed=impact.force_per_speed,
    )


def _flexible_model(beam: ImpactBeam, modes: ModalAnalysis) -> ModalImpactModel:
    n, tip, stiffness = beam.n_modes, modes.tip_shape, modes.angular_frequency**2
    pressed_stiffness = np.diag(stiffness) + beam.contact_stiffness * np.outer(tip, tip)
    pressed_damping = modes.damping + beam.contact_damping * np.outer(tip, tip)
    regimes = _regimes(modes, (np.diag(stiffness), modes.damping), (pressed_stiffness, pressed_damping))
    # rest with one surface pressing: (K + k p p') q = k c p, so x - c = -c / (1 + k p' K^-1 p)
    compliance = beam.contact_stiffness * float(np.sum(tip**2 / stiffness))
    position = beam.contact_stiffness * (tip / stiffness) / (1.0 + compliance)
    rest = regimes.to_modal[1] @ np.concatenate([position, np.zeros(n)])
    return ModalImpactModel(
        excitation_frequency=beam.excitation_frequency,
        force_amplitude=beam.force_amplitude,
        clearance=beam.clearance,
        contact_stiffness=beam.contact_stiffness,
        contact_damping=beam.contact_damping,
        stiffness=stiffness,
        damping=modes.damping,
        tip_shape=tip,
        force_shape=modes.force_shape,
        regimes=regimes,
        rest=np.ascontiguousarray(rest),
        rest_penetration=-1.0 / (1.0 + compliance),
    )
