"""The Spatial Slider Crank: its equations of motion, its contacts, and what they show.

Links and joints (``mechanism``) -> equations of small motions (``equations``), held over bins of crank angle -> exact
propagators (``core.binned.tables``) -> BinnedModel.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.core import matrices
from chaosgym.core.cycle import CycleArrays
from chaosgym.machines.binned.equations import Contact, Held, held, middles_and_nodes
from chaosgym.machines.binned.model import MAX_SETS
from chaosgym.machines.parameters import Parameter, parameters_of
from chaosgym.machines.slider_crank.equations import (
    BALL_ACROSS,
    SLIDER_ACROSS,
    SLIDER_LATERAL,
    degrees_of_freedom,
    equations,
)
from chaosgym.machines.slider_crank.joints import ball_joint_of, gaps_of, joints_of, sensor_peaks, slider_joint_of
from chaosgym.machines.slider_crank.mechanism import pin_and_pivot
from chaosgym.machines.slider_crank.parameters import FITTED, CrankParameters

if TYPE_CHECKING:
    from chaosgym.machines.picture import Sketch

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
    numbers = about.provenance == "calibrated" and about.source == FITTED and not about.choices and name != "n_modes"
    return numbers or (about.provenance == "derived" and about.unit in ("kg", "kg m^2"))


FINEST = 0.25
"""Least crank angle [deg] of a bin of a model that tells the error of another."""


@dataclass(frozen=True, kw_only=True)
class SliderCrank(CrankParameters):
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

    @property
    def finer(self) -> "SliderCrank | None":
        """The crank with two more modes of the rod and bins of half the angle; see ``Machine.finer``."""
        interval = 0.5 * self.matrix_update_interval
        if interval < FINEST:
            return None
        modes: dict[str, Any] = {"n_modes": self.n_modes + 2, "fitted_modes": max(1, self.fitted_modes)}
        return replace(self, matrix_update_interval=interval, **(modes if self.rod == "flexible" else {}))

    @property
    def models(self) -> "tuple[SliderCrank, ...]":
        """The rungs standard and fine, and a finer one; the rung draft misses too many natures (``Machine.models``)."""
        rungs = [self.fidelity_ladder[rung] for rung in ("standard", "fine")]
        models = [replace(self, **{name: rung[name] for name in self.model_fields}) for rung in rungs]
        finest = models[-1].finer
        return (*models, *([] if finest is None else [finest]))

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
            return pin_and_pivot(self, phase)[1][:, 0], "m"
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
        return slider_joint_of(self).sensors + ball_joint_of(self).sensors

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

    def held(self) -> Held:
        """Return the held accelerations, whatever the speed and the clearances."""
        middles, nodes = middles_and_nodes(self.bins)
        found = equations(self, middles, nodes)
        # friction has the sign of the nominal velocity of the slider, ramped through zero
        rate = found.slider_rate / (self.friction_ramp * self.crank_radius)
        friction = self.friction_coefficient * np.clip(rate, -1.0, 1.0)
        rubs = (friction[:, None] * found.slider_along)[None]
        return held(found.mass, found.damping, found.stiffness, found.load, rubs)

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
        shown = SLIDER_ACROSS if self.monitored_joint == "slider" else BALL_ACROSS
        return np.array([float(name == shown) for name in self.degrees_of_freedom])

    @property
    def stiffest(self) -> float:
        """Contact stiffness [N/m]."""
        return self.contact_stiffness

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

    def room_of(self, joint: int | None = None) -> tuple[float, float]:
        """How far [m] the gap lets the displacement go: a ball among tetrahedral sensors, further than half of it."""
        sensors = self.monitored_joint == "ball" and self.ball_joint == "instrumented"
        gap = float(getattr(self, self.clearance_field)) * (math.sqrt(3.0) if sensors else 1.0)
        return -gap, gap

    def sketch(self, record: Any, rows: NDArray[np.int64], force_limit: float) -> "Sketch":
        """Crank, rod and slider; see ``Machine.sketch``."""
        from chaosgym.machines.slider_crank.picture import sketch_of_crank

        return sketch_of_crank(record, rows, force_limit)


THESIS_SLIDER_CRANK = SliderCrank(fitted_modes=0, matrix_update_interval=5.0)
"""The default crank in the thesis' own reduction (5.2.2), in which its constants were fitted."""


def frequencies_at(machine: SliderCrank, crank_angle: float) -> Array:
    """Natural frequencies [Hz] of the mechanism at rest at a crank angle [deg], every joint tight.

    Examples
    --------
    >>> from chaosgym.machines.slider_crank.machine import frequencies_at
    >>> frequencies_at(chaosgym.SliderCrank(), 90.0).round(1)
    array([  75.6,  136.2,  549.5, 1167.6, 1542.4])
    """
    bound = replace(machine, slider_joint="clearance", ball_joint="ideal", rod="flexible")
    system = equations(bound, np.array([math.radians(crank_angle)]))
    free = [i for i, name in enumerate(bound.degrees_of_freedom) if name not in (SLIDER_ACROSS, SLIDER_LATERAL)]
    at = np.ix_(free, free)
    squares, _ = matrices.eigh(system.stiffness[0, 0][at], system.mass[0][at])
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)) / (2.0 * math.pi))
