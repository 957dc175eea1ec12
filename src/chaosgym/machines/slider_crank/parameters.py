"""Parameters of the Spatial Slider Crank: a flywheel, a connecting rod and a slider with clearance in its joints.

A motor turns the crank at constant speed. A ball joint drives a slender steel rod; at its other end a yoke pivots on a
slider that runs along a straight guide (thesis 4.2). Clearance in the slider joint lets the slider rattle across the
guide, clearance in the ball joint lets the ball rattle in its housing.

Gravity is off by default. With the mechanism's plane upright, the slider's weight keeps it on the guide below about
360 rpm, so no impact could happen in the slider joint; yet the thesis shows impacts of 35 to 130 N at 190 to 290 rpm
(4.4.2), which follow the law of a slider without weight. Its ball joint results need gravity (4.4.1). Each scene
therefore says which gravity it has. What makes impacts of the printed size under gravity is pitch: an instrumented
slider joint whose slider has its centre of gravity about 30 mm off the guide.

References
----------
P. Gu, Chaotic Vibration in Machine Systems and Its Implications for Design, PhD thesis, MIT, 1994, chapter 4.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from chaosgym.errors import ParameterError
from chaosgym.machines.binned.machine import BinnedMachine
from chaosgym.machines.machine import Option, TaskDefaults
from chaosgym.machines.parameters import parameter
from chaosgym.machines.slider_crank.scenes import OPTIONS, SCENES
from chaosgym.machines.slider_crank.task_defaults import TASK_DEFAULTS

FITTED = "docs/development/calibration.md"
"""Source of what was fitted to the thesis' results."""

_FREQUENCY = "first natural frequency 75.6 Hz, thesis 4.5.5"
_STEEL = "steel"


@dataclass(frozen=True, kw_only=True)
class CrankParameters(BinnedMachine):
    """Parameters of the Spatial Slider Crank, and what follows from them alone.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range; names the field, the value and the range.
    """

    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {
        rung: {"rod": "flexible", "n_modes": modes, "fitted_modes": fitted, "matrix_update_interval": interval}
        for rung, modes, fitted, interval in (
            ("draft", 2, 1, 5.0),
            ("standard", 3, 1, 2.0),
            ("fine", 4, 1, 1.0),
            ("reference", 5, 1, 0.25),
        )
    }

    model_fields: ClassVar[tuple[str, ...]] = ("n_modes", "fitted_modes", "matrix_update_interval")
    documented_errors: ClassVar[Mapping[str, float]] = {"draft": 0.01, "standard": 0.01, "fine": 0.005}

    name: ClassVar[str] = "slider-crank"
    speed_field: ClassVar[str] = "crank_speed"
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]] = {
        "crank_speed": (50.0, 300.0),
        "slider_clearance": (0.02e-3, 0.3e-3),
        "ball_clearance": (0.02e-3, 0.3e-3),
    }
    options: ClassVar[Mapping[str, Option]] = OPTIONS
    scenes: ClassVar[Mapping[str, Mapping[str, Any]]] = SCENES
    task_defaults: ClassVar[TaskDefaults] = TASK_DEFAULTS
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
    n_modes: int = parameter(3, low=1, high=40, provenance="calibrated", source=FITTED)
    """Bending modes of the flexible rod, in each plane; the fit to the thesis kept three and ``fitted_modes`` 0."""
    fitted_modes: int = parameter(1, low=0, high=6, provenance="assumed", source="a matter of computing")
    """Modes added that stand for all that are left out: they give the slider the rod's inertia."""
    damping_ratio: float = parameter(0.01077, low=0.0, high=100.0, provenance="calibrated", source=FITTED)
    """Structural damping ratio of the rod's first mode."""
    damping_family: str = parameter(
        "power", choices=("uniform", "stiffness", "power"), provenance="calibrated", source=FITTED
    )
    """"uniform": the same ratio in every mode; "stiffness": proportional to the mode's frequency; "power": to that
    power of it that ``damping_exponent`` names."""
    damping_exponent: float = parameter(1.3257, low=-2.0, high=4.0, provenance="calibrated", source=FITTED)
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
    housing_mass: float = parameter(0.3705, unit="kg", low=0.0, high=100.0, provenance="calibrated", source=FITTED)
    """Ball joint housing at the rod's end [kg]."""
    housing_inertia: float = parameter(
        5.57889e-4, unit="kg m^2", low=0.0, high=10.0, provenance="derived", source=_FREQUENCY
    )
    """Moment of inertia of the housing about the ball centre [kg m^2]."""
    housing_offset_along: float = parameter(
        -5.85e-3, unit="m", low=-0.1, high=0.1, provenance="calibrated", source=FITTED
    )
    """Centre of gravity of the housing from the ball centre towards the slider [m]."""
    housing_offset_across: float = parameter(0.0, unit="m", low=-0.1, high=0.1, provenance="assumed", source="symmetry")
    """Centre of gravity of the housing across the rod [m]."""
    yoke_mass: float = parameter(0.2982, unit="kg", low=0.0, high=100.0, provenance="calibrated", source=FITTED)
    """Yoke at the rod's other end [kg]."""
    yoke_inertia: float = parameter(
        5.77575e-4, unit="kg m^2", low=0.0, high=10.0, provenance="derived", source=_FREQUENCY
    )
    """Moment of inertia of the yoke about the slider pivot [kg m^2]."""
    yoke_offset_along: float = parameter(0.01844, unit="m", low=-0.1, high=0.1, provenance="calibrated", source=FITTED)
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
    contact_stiffness: float = parameter(
        1.552e7, unit="N/m", low=1e3, high=1e12, provenance="calibrated", source=FITTED
    )
    """Linearised Hertzian stiffness of a joint [N/m]; the stations of an instrumented slider joint share it."""
    contact_damping_ratio: float = parameter(
        0.05, low=0.0, high=100.0, provenance="printed", source="thesis 4.5.4: 2.5 % and 5 %"
    )
    """Damping ratio of a joint in contact, related to ``contact_damping_mass``."""
    contact_damping_mass: float = parameter(6.908, unit="kg", low=0.0, high=1e3, provenance="calibrated", source=FITTED)
    """Mass to which the contact damping ratio is related [kg]; 0: that of slider and yoke."""
    ball_damping_mass: float = parameter(0.48, unit="kg", low=0.0, high=1e3, provenance="calibrated", source=FITTED)
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
        # a rod that can stand across the guide leaves open which way the slider goes on from there
        if self.rod_length < 1.001 * self.crank_radius:
            raise ParameterError(
                f"rod_length = {self.rod_length:g} m is out of range; "
                f"allowed: above the crank radius of {self.crank_radius:g} m by 0.1 % or more"
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
    def is_spatial(self) -> bool:
        """True if the motor stands at an angle, so that the rod swings in two planes."""
        return self.motor_angle > 0.0
