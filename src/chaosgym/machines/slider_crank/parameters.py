r"""The Spatial Slider Crank: a flywheel, a connecting rod and a slider whose joints rattle in their clearance.

A motor turns the crank at constant speed. A ball joint drives a slender steel rod; at its other end a yoke pivots on a
slider that runs along a straight guide (thesis 4.2). Clearance in the slider joint lets the slider rattle across the
guide, clearance in the ball joint lets the ball rattle in its housing.

Nominal kinematics and rod (``kinematics``, ``connecting_rod``) -> equations of small motions (``equations``),
held over bins of crank angle -> exact propagators (``kernels.propagator``) -> BinnedModel.

Gravity is off by default. With the mechanism's plane upright, the slider's weight keeps it on the guide below about
360 rpm, so no impact could happen in the slider joint; yet the thesis shows impacts of 35 to 130 N at 190 to 290 rpm
(4.4.2), which follow the law of a slider without weight. Its ball joint results need gravity (4.4.1). Each scene
therefore says which gravity it has. What makes impacts of the printed size under gravity is pitch: an instrumented
slider joint whose slider has its centre of gravity about 30 mm off the guide.

The file is long because half of it is the table of fields, each with its range, its provenance and its source.

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, chapter 4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from chaosgym.core.binned.model import HERTZ, LINEAR
from chaosgym.core.cycle import CycleArrays
from chaosgym.errors import ParameterError
from chaosgym.machines.binned.machine import BinnedMachine
from chaosgym.machines.binned.model import MAX_SETS, Contact, Held
from chaosgym.machines.machine import Option, Work
from chaosgym.machines.parameters import Parameter, parameter, parameters_of
from chaosgym.machines.slider_crank.equations import SLIDER_ACROSS, SLIDER_LATERAL, degrees_of_freedom, equations
from chaosgym.machines.slider_crank.joints import display_of, gaps_of, joints_of, sensor_peaks, sensors_of
from chaosgym.machines.slider_crank.kinematics import slider_position
from chaosgym.machines.slider_crank.model import force_bound, held_of
from chaosgym.machines.slider_crank.scenes import EXTREMES, OPTIONS, SCENES
from chaosgym.machines.slider_crank.spatial_equations import spatial_equations
from chaosgym.machines.slider_crank.work import WORK

Array = NDArray[np.float64]

_FIT = "fitted to the statements, see docs/development/calibration.md"
_FREQUENCY = "first natural frequency 75.6 Hz, thesis 4.5.5"
_STEEL = "steel"

DIMENSIONS = (
    "crank_radius",
    "rod_length",
    "rod_diameter",
    "youngs_modulus",
    "density",
    "slider_mass",
    "yoke_mass",
    "housing_mass",
)
"""Fields that make it another crank than that of the thesis."""


def _is_fitted(name: str, about: Parameter) -> bool:
    """True for a constant that was fitted to the thesis' results, or follows from them: a mass, spring or damping."""
    numbers = about.provenance == "calibrated" and about.source == _FIT and not about.choices and name != "n_modes"
    return numbers or (about.provenance == "derived" and about.unit in ("kg", "kg m^2"))


@dataclass(frozen=True, kw_only=True)
class SliderCrank(BinnedMachine):
    """The Spatial Slider Crank; the defaults are the planar mechanism of the thesis with clearance at the slider.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.

    Examples
    --------
    >>> crank = chaosgym.SliderCrank(crank_speed=200.0, slider_clearance=3.2e-5)
    >>> crank.cycle_period
    0.3
    """

    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        rung: {"rod": "flexible", "n_modes": modes, "fitted_modes": fitted, "matrix_update_interval": interval}
        for rung, modes, fitted, interval in (
            ("draft", 2, 1, 5.0),
            ("standard", 3, 1, 2.0),
            ("fine", 3, 1, 1.0),
            ("reference", 5, 1, 0.25),
        )
    }

    name: ClassVar[str] = "slider-crank"
    speed_field: ClassVar[str] = "crank_speed"
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "crank_speed": (50.0, 300.0),
        "slider_clearance": (0.02e-3, 0.3e-3),
        "ball_clearance": (0.02e-3, 0.3e-3),
    }
    options: ClassVar[Mapping[str, Option]] = OPTIONS
    scenes: ClassVar[Mapping[str, Mapping[str, Any]]] = SCENES
    extremes: ClassVar[Mapping[str, Mapping[str, Any]]] = EXTREMES
    work: ClassVar[Work] = WORK
    beside_matrices: ClassVar[tuple[str, ...]] = ("crank_speed", "slider_clearance", "ball_clearance")
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
    n_modes: int = parameter(3, low=1, high=40, provenance="calibrated", source=_FIT)
    """Bending modes of the flexible rod, in each plane; the fit to the thesis kept three and ``fitted_modes`` 0."""
    fitted_modes: int = parameter(1, low=0, high=6, provenance="assumed", source="a matter of computing")
    """Modes added that stand for all that are left out: they give the slider the rod's inertia."""
    damping_ratio: float = parameter(0.01077, low=0.0, high=100.0, provenance="calibrated", source=_FIT)
    """Structural damping ratio of the rod's first mode."""
    damping_family: str = parameter(
        "power", choices=("uniform", "stiffness", "power"), provenance="calibrated", source=_FIT
    )
    """"uniform": the same ratio in every mode; "stiffness": proportional to the mode's frequency; "power": to that
    power of it that ``damping_exponent`` names."""
    damping_exponent: float = parameter(1.3257, low=-2.0, high=4.0, provenance="calibrated", source=_FIT)
    """Exponent of the frequency in the structural damping ratio of a mode, with damping_family = "power"."""
    geometric_stiffness: str = parameter(
        "off",
        choices=("off", "on"),
        provenance="calibrated",
        source="figure 4.18: 2500 N only without it, by a set of its own",
    )
    """Whether tension in the rod stiffens it."""
    youngs_modulus: float = parameter(2.068e11, unit="Pa", low=1e8, high=1e13, provenance="assumed", source=_STEEL)
    """Young's modulus of the rod [Pa]."""
    density: float = parameter(7833.0, unit="kg/m^3", low=10.0, high=1e5, provenance="assumed", source=_STEEL)
    """Mass density of the rod [kg/m^3]."""
    housing_mass: float = parameter(0.3705, unit="kg", low=0.0, high=100.0, provenance="calibrated", source=_FIT)
    """Ball joint housing at the rod's end [kg]."""
    housing_inertia: float = parameter(
        5.57889e-4, unit="kg m^2", low=0.0, high=10.0, provenance="derived", source=_FREQUENCY
    )
    """Moment of inertia of the housing about the ball centre [kg m^2]."""
    housing_offset_along: float = parameter(
        -5.85e-3, unit="m", low=-0.1, high=0.1, provenance="calibrated", source=_FIT
    )
    """Centre of gravity of the housing from the ball centre towards the slider [m]."""
    housing_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the housing across the rod [m]."""
    yoke_mass: float = parameter(0.2982, unit="kg", low=0.0, high=100.0, provenance="calibrated", source=_FIT)
    """Yoke at the rod's other end [kg]."""
    yoke_inertia: float = parameter(
        5.77575e-4, unit="kg m^2", low=0.0, high=10.0, provenance="derived", source=_FREQUENCY
    )
    """Moment of inertia of the yoke about the slider pivot [kg m^2]."""
    yoke_offset_along: float = parameter(0.01844, unit="m", low=-0.1, high=0.1, provenance="calibrated", source=_FIT)
    """Centre of gravity of the yoke from the slider pivot, positive away from the crank [m]."""
    yoke_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the yoke across the rod [m]."""
    slider_mass: float = parameter(
        0.1791,
        unit="kg",
        low=1e-3,
        high=100.0,
        provenance="derived",
        source="share of the lateral mass: 0.254 mm is 0.016, thesis 4.5.1",
    )
    """Slider [kg]."""
    slider_pitch_inertia: float = parameter(
        2e-4, unit="kg m^2", low=1e-9, high=10.0, provenance="assumed", source="a block 100 mm long"
    )
    """Moment of inertia of the slider about its pivot, in the plane of the mechanism [kg m^2]."""
    slider_roll_inertia: float = parameter(
        6e-5, unit="kg m^2", low=1e-9, high=10.0, provenance="assumed", source="a block 40 mm wide and high"
    )
    """Moment of inertia of the slider about the guide [kg m^2], which matters at a motor angle alone.

    About the vertical it has the pitch inertia: it is as wide as it is high.
    """
    slider_offset_along: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the slider from its pivot along the guide [m]."""
    slider_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the slider from its pivot, upward [m]."""
    slider_joint: str = parameter(
        "clearance", choices=("ideal", "clearance", "instrumented"), provenance="printed", source="thesis 4.3.2"
    )
    """"ideal": tight; "clearance": one gap around the pivot; "instrumented": eight sensors at two stations."""
    ball_joint: str = parameter(
        "ideal", choices=("ideal", "spherical", "instrumented"), provenance="printed", source="thesis 4.3.2"
    )
    """"ideal": tight; "spherical": ball in a shell; "instrumented": ball between four tetrahedral sensors."""
    slider_clearance: float = parameter(
        0.254e-3,
        unit="m",
        low=0.0,
        high=0.02,
        provenance="printed",
        source="thesis figure 4.14; adjustable to 1 mm, 4.2",
    )
    """Half the gap of the slider joint [m]."""
    ball_clearance: float = parameter(
        0.127e-3,
        unit="m",
        low=0.0,
        high=0.02,
        provenance="printed",
        source="thesis figure 4.8; adjustable to 1 mm, 4.2",
    )
    """Half the gap of the ball joint [m]."""
    sensor_distance: float = parameter(
        0.040, unit="m", low=1e-3, high=0.5, provenance="assumed", source="bearing length of about 100 mm"
    )
    """From the slider pivot to either station of an instrumented slider joint, along the guide [m]."""
    sensor_offset: float = parameter(
        0.006, unit="m", low=0.0, high=0.1, provenance="assumed", source="thesis 4.2: off-center, no size in print"
    )
    """From the middle of the guide's face to a sensor, across the guide [m]; matters at a motor angle alone."""
    ball_sensor_angle: float = parameter(
        -90.0,
        unit="deg",
        low=-180.0,
        high=180.0,
        provenance="calibrated",
        source="impacts from 100 and from 300 deg on, figure 4.10",
    )
    """Direction halfway between the two in-plane sensors of an instrumented ball joint, from the rod's axis [deg]."""
    contact_law: str = parameter("linear", choices=("linear", "hertz"), provenance="printed", source="thesis 3.3")
    """"linear": spring and damper; "hertz": penetration to the power of 1.5 with dissipation."""
    hertz_reference_force: float = parameter(
        50.0, unit="N", low=1e-3, high=1e6, provenance="assumed", source="middle of the printed forces"
    )
    """Force [N] at which the Hertzian law has the linear law's secant stiffness and restitution."""
    contact_stiffness: float = parameter(1.552e7, unit="N/m", low=1e3, high=1e12, provenance="calibrated", source=_FIT)
    """Linearised Hertzian stiffness of a joint [N/m]; the stations of an instrumented slider joint share it."""
    contact_damping_ratio: float = parameter(
        0.05, low=0.0, high=100.0, provenance="printed", source="thesis 4.5.4: 2.5 % and 5 %"
    )
    """Damping ratio of a joint in contact, related to ``contact_damping_mass``."""
    contact_damping_mass: float = parameter(6.908, unit="kg", low=0.0, high=1e3, provenance="calibrated", source=_FIT)
    """Mass to which the contact damping ratio is related [kg]; 0: that of slider and yoke."""
    ball_damping_mass: float = parameter(0.48, unit="kg", low=0.0, high=1e3, provenance="calibrated", source=_FIT)
    """The same for the ball joint [kg]; 0: that of the slider joint."""
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
        2.0, unit="deg", low=0.1, high=30.0, provenance="assumed", source="5, 6 and 10 deg in thesis 5.2.2"
    )
    """Crank angle over which mass, damping and stiffness matrices are held [deg]; divides 360."""

    def __post_init__(self, fidelity: str | None) -> None:
        super().__post_init__(fidelity)
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
            self._check_inertia(field, getattr(self, f"{body}_mass") * offset**2)
        if self.is_spatial:
            self._check_inertia("slider_roll_inertia", self.slider_mass * self.slider_offset_across**2)

    def _check_inertia(self, field: str, least: float) -> None:
        if getattr(self, field) < least:
            raise ParameterError(
                f"{field} = {getattr(self, field):g} kg m^2 is out of range; "
                f"allowed: from mass times squared offset, {least:g} kg m^2, on"
            )

    @property
    def contact_damping(self) -> float:
        """Damping constant [N s/m] of the slider joint in contact: 2 zeta sqrt(k m), m the contact damping mass."""
        return 2.0 * self.contact_damping_ratio * math.sqrt(self.contact_stiffness * self.damped_mass)

    @property
    def damped_mass(self) -> float:
        """Mass [kg] to which the contact damping ratio is related: ``contact_damping_mass``, or slider and yoke."""
        return self.contact_damping_mass or self.slider_mass + self.yoke_mass

    @property
    def monitored_joint(self) -> str:
        """Joint whose force is recorded: the slider joint if it has clearance, otherwise the ball joint."""
        return "slider" if self.slider_joint != "ideal" else "ball"

    @property
    def round_bearing(self) -> bool:
        """True for the ball joint."""
        return self.monitored_joint == "ball"

    def bearing_place(self, phase: Array, force: Array) -> tuple[Array, str]:
        """Where on its bearing the monitored joint carries a force, and the unit of that place.

        Parameters
        ----------
        phase : (n,)
            Phases [rad] of the cycle.
        force : (n, 3)
            Components of the force, as in ``CycleRecord.peak_vector``.

        Returns
        -------
        (place, unit)
            The slider's pivot on its guide, counted from the crank's axis, and "m"; or the polar angle on the ball
            joint's housing, counted in the rod's plane of swing from the rod's axis, and "deg".
        """
        if self.monitored_joint == "slider":
            tilt = math.radians(self.motor_angle)
            return slider_position(phase, self.crank_radius, self.rod_length, tilt), "m"
        return np.degrees(np.arctan2(force[:, 1], force[:, 0])), "deg"

    @property
    def notes(self) -> tuple[str, ...]:
        """Constants that were fitted to the thesis' crank and that a crank of other dimensions keeps."""
        default, known = type(self)(), parameters_of(self)
        usual = {name for name in known if getattr(self, name) == getattr(default, name)}
        others = [name for name in DIMENSIONS if name not in usual]
        kept = [name for name, about in known.items() if name in usual and _is_fitted(name, about)]
        kept = [name for name in kept if name != "ball_damping_mass" or self.ball_joint != "ideal"]
        if not others or not kept:
            return ()
        values = ", ".join(f"{name} {getattr(self, name):g} {known[name].unit.strip('-')}".strip() for name in kept)
        return (f"{', '.join(others)}: not the thesis' crank, yet these are still fitted to it: {values}",)

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the force sensors of the instrumented joints; ``CycleRecord.sensor_peak`` has their columns."""
        return sensors_of(self)

    @property
    def clearance_field(self) -> str:
        """Field that holds the clearance of the monitored joint."""
        return f"{self.monitored_joint}_clearance"

    @property
    def chaos_thresholds(self) -> Mapping[str, tuple[float, float]]:
        """Clearance [m] of the slider, and speed [rpm] (thesis 5.3.1).

        The least clearance is printed for contact dampings of 2.5 and 5 %, in proportion; so it is taken beyond them.
        """
        least = 0.064e-3 * self.contact_damping_ratio / 0.05
        return {"clearance": (self.slider_clearance, least), "speed": (self.crank_speed, 100.0)}

    @property
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] at rest at crank angle zero, every joint tight, (n_modes + 1,).

        At a motor angle (2 n_modes + 1,): those of bending sideways too.
        """
        return frequencies_at(self, 0.0)

    @property
    def degrees_of_freedom(self) -> tuple[str, ...]:
        """Names of the coordinates that are integrated: only those that the scene requires."""
        return degrees_of_freedom(self)

    @property
    def is_spatial(self) -> bool:
        """True if the motor stands at an angle, so that the rod swings in two planes."""
        return self.motor_angle > 0.0

    @property
    def bins(self) -> int:
        """Bins of crank angle over which matrices are held."""
        return round(360.0 / self.matrix_update_interval)

    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""
        return held_of(self)

    @property
    def contacts(self) -> list[Contact]:
        """All contacts, those of the slider joint first."""
        return joints_of(self)

    @property
    def gaps(self) -> Array:
        """Clearances [m] of the contacts."""
        return gaps_of(self)

    @property
    def display(self) -> Array:
        """Displacement of the monitored joint: of the slider across the guide, or of the rod's end across the rod."""
        return display_of(self)

    @property
    def stiffest(self) -> float:
        """Contact stiffness [N/m]."""
        return self.contact_stiffness

    @property
    def law(self) -> int:
        """Law of all contacts."""
        return LINEAR if self.contact_law == "linear" else HERTZ

    @property
    def has_propagators(self) -> bool:
        """True if contact is linear, no contact force turns with the ball, and the contact sets are few."""
        if self.contact_law != "linear" or self.ball_joint == "spherical":
            return False
        return int(self.radix ** len(self.gaps)) <= MAX_SETS

    @property
    def radix(self) -> int:
        """Contact states of a channel that differ in their matrices: friction tells one side from the other."""
        return 3 if self.friction_coefficient > 0.0 else 2

    @property
    def sampled_bins(self) -> list[int]:
        """Bins at which eigenvalues are looked at: the rod in line with the guide, and farthest off it."""
        return [0, self.bins // 4]

    def further_results(self, arrays: CycleArrays) -> dict[str, Any]:
        """Phase and components of each peak force, and the peaks of the sensors."""
        peaks = sensor_peaks(self, arrays.channel_peak) if self.sensors else None
        return {**super().further_results(arrays), "sensor_peak": peaks}

    @property
    def room(self) -> tuple[float, float]:
        """How far [m] the gap lets the displacement go: a ball among tetrahedral sensors, further than half of it."""
        sensors = self.monitored_joint == "ball" and self.ball_joint == "instrumented"
        gap = float(getattr(self, self.clearance_field)) * (math.sqrt(3.0) if sensors else 1.0)
        return -gap, gap

    def draw(self, panel: Any, record: Any, colour: str, moment: float, force_limit: float) -> None:
        """Draw crank, rod and slider; see ``Machine.draw``."""
        from chaosgym.machines.slider_crank.picture import draw_crank

        draw_crank(panel, record, colour, moment, force_limit)

    def share_of_bound(self, states: Array, peak_force: Array) -> float:
        """Largest force, as a share of that of an impact of all masses at ten times the speed of the crank pin."""
        return float(peak_force.max()) / force_bound(self)


THESIS_SLIDER_CRANK = SliderCrank(fitted_modes=0, matrix_update_interval=5.0)
"""The default crank in the thesis' own reduction (5.2.2), in which its constants were fitted."""


def frequencies_at(machine: SliderCrank, crank_angle: float) -> Array:
    """Natural frequencies [Hz] of the mechanism at rest at a crank angle [deg], every joint tight.

    Examples
    --------
    >>> from chaosgym.machines.slider_crank.parameters import frequencies_at
    >>> frequencies_at(chaosgym.SliderCrank(), 90.0).round(1)
    array([  75.6,  136.2,  549.5, 1167.6, 1542.4])
    """
    from scipy.linalg import eigh

    bound = replace(machine, slider_joint="clearance", ball_joint="ideal", rod="flexible")
    assemble = spatial_equations if machine.is_spatial else equations
    system = assemble(bound, np.array([math.radians(crank_angle)]))
    free = [i for i, name in enumerate(bound.degrees_of_freedom) if name not in (SLIDER_ACROSS, SLIDER_LATERAL)]
    at = np.ix_(free, free)
    squares = eigh(system.stiffness[0, 0][at], system.mass[0][at], eigvals_only=True)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi))
