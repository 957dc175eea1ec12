r"""What is the Spatial Slider Crank? A flywheel, a connecting rod and a slider whose joints rattle in their clearance.

A motor turns the crank at constant speed. A ball joint drives a slender steel rod; at its other end a yoke pivots on a
slider that runs along a straight guide (thesis 4.2). Clearance in the slider joint lets the slider rattle across the
guide, clearance in the ball joint lets the ball rattle in its housing.

Nominal kinematics and rod (``kinematics``, ``connecting_rod``) -> equations of small motions (``crank_equations``),
held over bins of crank angle -> exact propagators (``core.crank_propagator``) -> SliderCrankModel.

Gravity is off by default. With the mechanism's plane upright, the slider's weight keeps it on the guide below about
360 rpm, so no impact could happen in the slider joint; yet the thesis shows impacts of 35 to 130 N at 190 to 290 rpm
(4.4.2), which follow the law of a slider without weight. Its ball joint results need gravity (4.4.1). Each scene
therefore says which gravity it has.

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, chapter 4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, ClassVar, NamedTuple

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from chaosgym.core.crank_propagator import FORCING_TERMS, propagator_table, series_order
from chaosgym.core.slider_crank import SliderCrankModel
from chaosgym.errors import ParameterError
from chaosgym.machines.crank_equations import (
    SLIDER_ACROSS,
    SLIDER_PITCH,
    degrees_of_freedom,
    equations,
    rod_of,
)
from chaosgym.machines.kinematics import planar_motion
from chaosgym.machines.parameters import parameter, parameters_of, validate

Array = NDArray[np.float64]

MAX_PHASE = 8.0
"""Longest step times largest eigenvalue that a Taylor series sums without loss of digits."""

_FIT = "set S: search over the printed natures and forces of figures 4.13 to 4.16"
_STEEL = "steel"


@dataclass(frozen=True, kw_only=True)
class SliderCrank:
    """The Spatial Slider Crank; the defaults are the planar mechanism of the thesis with clearance at the slider.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.
    """

    name: ClassVar[str] = "slider-crank"
    speed_field: ClassVar[str] = "crank_speed"
    clearance_field: ClassVar[str] = "slider_clearance"
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "crank_speed": (50.0, 300.0),
        "slider_clearance": (0.02e-3, 0.3e-3),
    }
    sides: ClassVar[tuple[str, ...]] = ("upper", "lower")
    """Surfaces whose force points up and down: on the slider, or on the housing if the ball joint is monitored."""

    crank_speed: float = parameter(
        190.0, unit="rpm", low=1.0, high=5000.0, provenance="printed", source="thesis figure 4.14"
    )
    """Constant speed of the crank [rpm]."""
    crank_radius: float = parameter(
        0.050, unit="m", low=1e-3, high=1.0, provenance="derived", source="stroke 100 mm, thesis 4.2"
    )
    """From the motor axis to the ball centre [m]."""
    rod_length: float = parameter(
        0.235, unit="m", low=1e-2, high=5.0, provenance="printed", source="thesis figure 4.24a"
    )
    """From the ball centre to the slider pivot, above the crank radius [m]."""
    rod_diameter: float = parameter(6.35e-3, unit="m", low=1e-3, high=0.1, provenance="printed", source="thesis 4.6")
    """Diameter of the round rod [m]."""
    motor_angle: float = parameter(
        0.0, unit="deg", low=0.0, high=25.0, provenance="printed", source="thesis 4.2: 0 to 25 deg"
    )
    """Angle between the motor axis and the normal of the guide [deg]; planar motion at 0."""
    rod: str = parameter("flexible", choices=("flexible", "rigid"), provenance="printed", source="thesis 4.3.1")
    """Whether the rod bends and stretches."""
    n_modes: int = parameter(3, low=1, high=12, provenance="calibrated", source=_FIT)
    """Bending modes of the flexible rod."""
    damping_ratio: float = parameter(0.027, low=0.0, high=1.0, provenance="calibrated", source=_FIT)
    """Structural damping ratio of the rod's first mode."""
    damping_family: str = parameter("stiffness", choices=("uniform", "stiffness"), provenance="calibrated", source=_FIT)
    """"uniform": the same ratio in every mode; "stiffness": proportional to the mode's frequency."""
    geometric_stiffness: str = parameter(
        "off", choices=("off", "on"), provenance="calibrated", source="figure 4.18: 2500 N only without it"
    )
    """Whether tension in the rod stiffens it."""
    youngs_modulus: float = parameter(2.068e11, unit="Pa", low=1e8, high=1e13, provenance="assumed", source=_STEEL)
    """Young's modulus of the rod [Pa]."""
    density: float = parameter(7833.0, unit="kg/m^3", low=10.0, high=1e5, provenance="assumed", source=_STEEL)
    """Mass density of the rod [kg/m^3]."""
    housing_mass: float = parameter(0.36, unit="kg", low=0.0, high=100.0, provenance="calibrated", source=_FIT)
    """Ball joint housing at the rod's end [kg]."""
    housing_inertia: float = parameter(
        3.922e-4, unit="kg m^2", low=0.0, high=10.0, provenance="calibrated",
        source="first natural frequency 75.6 Hz, thesis 4.5.5",
    )  # fmt: skip
    """Moment of inertia of the housing about the ball centre [kg m^2]."""
    housing_offset_along: float = parameter(3e-3, unit="m", low=-0.1, high=0.1, provenance="calibrated", source=_FIT)
    """Centre of gravity of the housing from the ball centre towards the slider [m]."""
    housing_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the housing across the rod [m]."""
    yoke_mass: float = parameter(0.16, unit="kg", low=0.0, high=100.0, provenance="calibrated", source=_FIT)
    """Yoke at the rod's other end [kg]."""
    yoke_inertia: float = parameter(
        7.059e-4, unit="kg m^2", low=0.0, high=10.0, provenance="calibrated",
        source="first natural frequency 75.6 Hz, thesis 4.5.5",
    )  # fmt: skip
    """Moment of inertia of the yoke about the slider pivot [kg m^2]."""
    yoke_offset_along: float = parameter(-8e-3, unit="m", low=-0.1, high=0.1, provenance="calibrated", source=_FIT)
    """Centre of gravity of the yoke from the slider pivot, positive away from the crank [m]."""
    yoke_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the yoke across the rod [m]."""
    slider_mass: float = parameter(0.22, unit="kg", low=1e-3, high=100.0, provenance="calibrated", source=_FIT)
    """Slider [kg]."""
    slider_pitch_inertia: float = parameter(
        2e-4, unit="kg m^2", low=1e-9, high=10.0, provenance="assumed", source="a block 100 mm long"
    )
    """Moment of inertia of the slider about its pivot, in the plane of the mechanism [kg m^2]."""
    slider_offset_along: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the slider from its pivot along the guide [m]."""
    slider_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the slider from its pivot, upward [m]."""
    slider_joint: str = parameter(
        "clearance", choices=("ideal", "clearance", "instrumented"), provenance="printed", source="thesis 4.3.2"
    )
    """"ideal": tight; "clearance": one gap above and below the pivot; "instrumented": two stations of sensors."""
    ball_joint: str = parameter(
        "ideal", choices=("ideal", "spherical", "instrumented"), provenance="printed", source="thesis 4.3.2"
    )
    """"ideal": tight; "spherical": ball in a shell; "instrumented": ball between four tetrahedral sensors."""
    slider_clearance: float = parameter(
        0.254e-3,
        unit="m",
        low=0.0,
        high=1e-3,
        provenance="printed",
        source="thesis figure 4.14; adjustable to 1 mm, 4.2",
    )
    """Half the gap of the slider joint [m]."""
    ball_clearance: float = parameter(
        0.127e-3,
        unit="m",
        low=0.0,
        high=1e-3,
        provenance="printed",
        source="thesis figure 4.8; adjustable to 1 mm, 4.2",
    )
    """Half the gap of the ball joint [m]."""
    sensor_distance: float = parameter(
        0.040, unit="m", low=1e-3, high=0.5, provenance="assumed", source="bearing length of about 100 mm"
    )
    """From the slider pivot to either station of an instrumented slider joint, along the guide [m]."""
    contact_law: str = parameter("linear", choices=("linear",), provenance="printed", source="thesis 3.3")
    """Force of a bearing surface: "linear" spring and damper."""
    contact_stiffness: float = parameter(
        1.5e7, unit="N/m", low=1e3, high=1e10, provenance="printed", source="thesis 3.3"
    )
    """Linearised Hertzian stiffness of a joint [N/m]; the stations of an instrumented slider joint share it."""
    contact_damping_ratio: float = parameter(
        0.05, low=0.0, high=1.0, provenance="printed", source="thesis 4.5.4: 2.5 % and 5 %"
    )
    """Damping ratio of a joint in contact, related to the mass of slider and yoke."""
    friction_coefficient: float = parameter(
        0.0, low=0.0, high=0.5, provenance="printed", source="thesis 4.5.3: 0 and 0.1"
    )
    """Coulomb friction between slider and guide."""
    friction_ramp: float = parameter(0.02, low=1e-4, high=1.0, provenance="assumed", source="not in print")
    """Slider speed below which friction fades, as a share of the crank pin's speed."""
    gravity: float = parameter(
        0.0, unit="m/s^2", low=0.0, high=100.0, provenance="derived", source="contact loss below 360 rpm, thesis 4.4.2"
    )
    """Acceleration of gravity in the plane of the mechanism [m/s^2]."""
    gravity_angle: float = parameter(
        0.0, unit="deg", low=-180.0, high=180.0, provenance="printed", source="thesis 4.4.1"
    )
    """Direction of gravity [deg]: 0 presses the slider down on the guide, 90 pulls it away from the crank."""
    matrix_update_interval: float = parameter(
        1.0, unit="deg", low=0.1, high=30.0, provenance="assumed", source="5, 6 and 10 deg in thesis 5.2.2"
    )
    """Crank angle over which mass, damping and stiffness matrices are held [deg]; divides 360."""

    def __post_init__(self) -> None:
        validate(self)
        if self.rod_length <= self.crank_radius:
            raise ParameterError(
                f"rod_length = {self.rod_length:g} m is out of range; "
                f"allowed: above the crank radius of {self.crank_radius:g} m"
            )
        if abs(360.0 / self.matrix_update_interval - round(360.0 / self.matrix_update_interval)) > 1e-9:
            raise ParameterError(
                f"matrix_update_interval = {self.matrix_update_interval:g} deg is out of range; "
                "allowed: 0.1 to 30 deg that divide 360 deg"
            )
        if self.slider_joint == "ideal" and self.ball_joint == "ideal":
            raise ParameterError(
                "slider_joint = 'ideal' and ball_joint = 'ideal' leave nothing that rattles; "
                "allowed: at least one joint with clearance"
            )
        for body in ("housing", "yoke", "slider"):
            field = "slider_pitch_inertia" if body == "slider" else f"{body}_inertia"
            offset = math.hypot(getattr(self, f"{body}_offset_along"), getattr(self, f"{body}_offset_across"))
            least = getattr(self, f"{body}_mass") * offset**2
            if getattr(self, field) < least:
                raise ParameterError(
                    f"{field} = {getattr(self, field):g} kg m^2 is out of range; "
                    f"allowed: from mass times squared offset, {least:g} kg m^2, on"
                )
        if self.motor_angle != 0.0:
            raise ParameterError(f"motor_angle = {self.motor_angle:g} deg is not implemented yet; allowed: 0 deg")
        if self.ball_joint != "ideal":
            raise ParameterError(f"ball_joint = {self.ball_joint!r} is not implemented yet; allowed: 'ideal'")

    @property
    def cycle_period(self) -> float:
        """Duration of one revolution [s]."""
        return 60.0 / self.crank_speed

    @property
    def crank_rate(self) -> float:
        """Angular velocity of the crank [rad/s]."""
        return self.crank_speed * math.pi / 30.0

    @property
    def contact_damping(self) -> float:
        """Damping constant [N s/m] of a joint in contact: 2 zeta sqrt(k m), m the mass of slider and yoke."""
        mass = self.slider_mass + self.yoke_mass
        return 2.0 * self.contact_damping_ratio * math.sqrt(self.contact_stiffness * mass)

    @property
    def monitored_joint(self) -> str:
        """Joint whose force is recorded: the slider joint if it has clearance, otherwise the ball joint."""
        return "slider" if self.slider_joint != "ideal" else "ball"

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] at rest at crank angle zero, every joint tight, (n_modes + 1,)."""
        return frequencies_at(self, 0.0)

    @property
    def degrees_of_freedom(self) -> tuple[str, ...]:
        """Names of the coordinates that are integrated: only those that the scene requires."""
        return degrees_of_freedom(self)

    def reduce(self, step_phase: float = 1.0) -> SliderCrankModel:
        """Return the model with propagators for steps in which a closed contact turns by at most ``step_phase`` [rad].

        Machines that differ in clearance alone share all of it; those that differ in speed share the assembly.
        """
        model = _at_speed(self.crank_speed, step_phase, *(getattr(self, field) for field in _STRUCTURE_FIELDS))
        return model._replace(gap=_gaps(self))


_STRUCTURE_FIELDS = tuple(
    name for name in parameters_of(SliderCrank) if name not in ("crank_speed", "slider_clearance", "ball_clearance")
)

THESIS_SLIDER_CRANK = SliderCrank()
"""The planar mechanism of the thesis; ``parameters_of(SliderCrank)`` says where each number comes from."""

SUPERHARMONIC_SLIDER_CRANK = replace(
    THESIS_SLIDER_CRANK,
    crank_speed=1508.0, slider_clearance=0.127e-3, n_modes=4, damping_ratio=0.0007, damping_family="uniform",
    housing_mass=0.4, housing_inertia=5.68e-4, housing_offset_along=0.035,
    yoke_mass=0.25, yoke_inertia=5.68e-4, yoke_offset_along=-0.040, slider_mass=0.1,
)  # fmt: skip
"""The mechanism of figure 4.18: end bodies whose centres of gravity lie along the rod excite its first mode."""


def frequencies_at(machine: SliderCrank, crank_angle: float) -> Array:
    """Natural frequencies [Hz] of the mechanism at rest at a crank angle [deg], every joint tight."""
    bound = replace(machine, slider_joint="clearance", ball_joint="ideal", rod="flexible")
    system = equations(bound, np.array([math.radians(crank_angle)]))
    free = [i for i, name in enumerate(bound.degrees_of_freedom) if name != SLIDER_ACROSS]
    at = np.ix_(free, free)
    squares = scipy.linalg.eigh(system.stiffness[0, 0][at], system.mass[0][at], eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi))


class _Channels(NamedTuple):
    """Contact channels; see ``SliderCrankModel``. ``slides`` (m,): friction acts along the guide."""

    row: Array
    stiffness: Array
    damping: Array
    two_sided: NDArray[np.bool_]
    reading: Array
    slides: NDArray[np.bool_]


def _channels(machine: SliderCrank) -> _Channels:
    names = machine.degrees_of_freedom
    rows = []
    stations = (machine.sensor_distance, -machine.sensor_distance) if machine.slider_joint == "instrumented" else (0.0,)
    for station in stations:
        row = np.zeros(len(names))
        row[names.index(SLIDER_ACROSS)] = 1.0
        if machine.slider_joint == "instrumented":
            row[names.index(SLIDER_PITCH)] = station
        rows.append(row)
    count = len(rows)
    return _Channels(
        row=np.array(rows),
        stiffness=np.full(count, machine.contact_stiffness / count),
        damping=np.full(count, machine.contact_damping / count),
        two_sided=np.ones(count, dtype=bool),
        reading=np.tile([0.0, -1.0], (count, 1)),
        slides=np.ones(count, dtype=bool),
    )


def _gaps(machine: SliderCrank) -> Array:
    count = 2 if machine.slider_joint == "instrumented" else 1
    return np.full(count, machine.slider_clearance)


class _Structure(NamedTuple):
    """Accelerations of all bins by powers of the crank rate, whatever the speed and the clearance.

    ``free`` (3, bins, 2n, n) per unit p and p'; ``forcing`` (2, bins, 4, n) of gravity and of squared crank rate;
    ``push`` (sets, bins, 2n + m, n) what closed contacts add per unit p, p' and clearance; ``contact`` [rad/s] angular
    frequency of the masses next to the closed contacts; ``spectrum`` [1/s] largest modulus of an eigenvalue.
    """

    channels: _Channels
    radix: int
    display: Array
    free: Array
    forcing: Array
    push: Array
    contact: float
    spectrum: float


def _forcing(inverse_mass: Array, loads: Array) -> Array:
    """Cubics in the time of each bin through the loads at its nodes, as accelerations: (2, bins, 4, n)."""
    bins, nodes = len(inverse_mass), FORCING_TERMS - 1
    at = (np.arange(bins)[:, None] * nodes + np.arange(FORCING_TERMS)) % (bins * nodes)
    coefficients = np.linalg.inv(np.vander(np.arange(FORCING_TERMS) / nodes, increasing=True))
    return np.asarray(-np.einsum("bij,kbcj->kbci", inverse_mass, coefficients @ loads[:, at]))


def _push(inverse_mass: Array, channels: _Channels, radix: int, friction: Array) -> Array:
    """Accelerations that the closed contacts of every set add: (sets, bins, 2n + m, n).

    ``friction`` (bins, n) is what one newton of contact force drives along the guide.
    """
    bins, n, m = len(inverse_mass), inverse_mass.shape[-1], len(channels.row)
    push = np.zeros((radix**m, bins, 2 * n + m, n))
    for chosen in range(radix**m):
        for j in range(m):
            digit = chosen // radix**j % radix
            if digit:
                row, sign = channels.row[j], 1.0 if digit == 1 else -1.0
                force = row + sign * channels.slides[j] * friction
                answer = np.einsum("bij,bj->bi", inverse_mass, force)[:, None, :]
                push[chosen, :, :n] -= channels.stiffness[j] * row[:, None] * answer
                push[chosen, :, n : 2 * n] -= channels.damping[j] * row[:, None] * answer
                push[chosen, :, 2 * n + j] += channels.stiffness[j] * answer[:, 0]
    return push


def _rates(free: Array, pushed: Array, row: Array) -> tuple[float, float]:
    """(contact, spectrum) of ``_Structure`` from the accelerations (b, 2n, n) of some bins with all contacts closed."""
    n = free.shape[-1]
    local = -row @ pushed[:, :n] @ np.linalg.pinv(row)
    contact = math.sqrt(float(np.max(np.abs(np.linalg.eigvals(local)))))
    system = np.zeros((len(free), 2 * n, 2 * n))
    system[:, n:, :n] = np.eye(n)
    system[:, :, n:] = free + pushed
    return contact, float(np.max(np.abs(np.linalg.eigvals(system))))


@lru_cache(maxsize=64)
def _structure(*structure: Any) -> _Structure:
    machine = SliderCrank(**dict(zip(_STRUCTURE_FIELDS, structure, strict=True)))
    rod = rod_of(machine)
    bins = round(360.0 / machine.matrix_update_interval)
    width = 2.0 * math.pi / bins
    middles = np.array([(b + 0.5) * width for b in range(bins)])
    held = equations(machine, middles, rod)
    n = held.mass.shape[-1]
    inverse_mass = np.asarray(np.linalg.inv(held.mass), dtype=np.float64)
    free = np.zeros((3, bins, 2 * n, n))
    free[:, :, :n] = -np.swapaxes(inverse_mass @ held.stiffness, -1, -2)
    free[:2, :, n:] = -np.swapaxes(inverse_mass @ held.damping, -1, -2)
    nodes = FORCING_TERMS - 1
    loads = equations(machine, np.array([k * width / nodes for k in range(bins * nodes)]), rod).load

    channels = _channels(machine)
    radix = 3 if machine.friction_coefficient > 0.0 else 2
    push = _push(inverse_mass, channels, radix, _friction(machine, middles)[:, None] * held.slider_along)
    some = [0, bins // 4]
    contact, spectrum = _rates(free[0, some], push[-1, some, : 2 * n], channels.row)
    return _Structure(
        channels, radix, channels.row.mean(axis=0), free, _forcing(inverse_mass, loads), push, contact, spectrum
    )


def _friction(machine: SliderCrank, crank_angle: Array) -> Array:
    """Friction coefficient with the sign of the nominal slider velocity, ramped through zero."""
    motion = planar_motion(crank_angle, machine.crank_radius, machine.rod_length)
    speed = motion.slider_rate / (machine.friction_ramp * machine.crank_radius)
    return np.asarray(machine.friction_coefficient * np.clip(speed, -1.0, 1.0))


@lru_cache(maxsize=64)
def _at_speed(crank_speed: float, step_phase: float, *structure: Any) -> SliderCrankModel:
    parts = _structure(*structure)
    interval = structure[_STRUCTURE_FIELDS.index("matrix_update_interval")]
    rate = crank_speed * math.pi / 30.0
    duration = math.radians(interval) / rate
    m = len(parts.channels.row)
    sets, bins, _, n = parts.push.shape
    acceleration = np.zeros((sets, bins, 2 * n + FORCING_TERMS + m, n))
    acceleration[:, :, : 2 * n] = parts.free[0] + rate * parts.free[1] + rate**2 * parts.free[2]
    acceleration[:, :, 2 * n : 2 * n + FORCING_TERMS] = parts.forcing[0] + rate**2 * parts.forcing[1]
    acceleration[:, :, : 2 * n] += parts.push[:, :, : 2 * n]
    acceleration[:, :, 2 * n + FORCING_TERMS :] = parts.push[:, :, 2 * n :]
    steps = max(1, math.ceil(duration * max(parts.contact / step_phase, parts.spectrum / MAX_PHASE)))
    step = duration / steps
    order = series_order(parts.spectrum * step)
    return SliderCrankModel(
        bin_duration=duration,
        steps=steps,
        contact_rate=parts.contact,
        order=order,
        row=parts.channels.row,
        gap=np.zeros(m),
        stiffness=parts.channels.stiffness,
        damping=parts.channels.damping,
        two_sided=parts.channels.two_sided,
        radix=parts.radix,
        reading=parts.channels.reading,
        display=parts.display,
        acceleration=acceleration,
        curvature=np.ascontiguousarray(np.einsum("jn,sbcn->sbjc", parts.channels.row, acceleration)),
        propagator=propagator_table(acceleration, duration, step, order),
    )
