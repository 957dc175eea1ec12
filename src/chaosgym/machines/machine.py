"""The protocol of a machine: what simulation, diagnosis, sweeps, environments and the command line call."""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import InitVar, dataclass, fields
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self, final

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.core.cycle import CycleArrays, cycle_arrays
from chaosgym.errors import ParameterError
from chaosgym.machines.abilities import Abilities, Kinematics
from chaosgym.machines.accuracy import is_tolerance
from chaosgym.machines.integrators import ExactEvents, Integrator
from chaosgym.machines.parameters import check_parameter, expand_fidelity, validate, with_settings

if TYPE_CHECKING:
    from chaosgym.core.tangent import Tangents
    from chaosgym.machines.batch import CompiledBatch


class Number(NamedTuple):
    """A number: the field that it sets, its unit on the command line, and how many SI units that is.

    ``only`` are the words of another option, a ``Choice``, with which it makes sense; all if it is empty.
    """

    field: str
    unit: str
    factor: float = 1.0
    only: Mapping[str, tuple[str, ...]] = {}


class Choice(NamedTuple):
    """A word: the fields that each word sets, and the options that it redirects to another field."""

    words: Mapping[str, Mapping[str, Any]]
    redirects: Mapping[str, Mapping[str, str]] = {}
    only: Mapping[str, tuple[str, ...]] = {}


Option = Number | Choice
"""An option of a machine on the command line: a short name in shop-floor units for some of its fields."""

SPEED_IN_HZ: Mapping[str, Option] = {
    "--speed-hz": Number("speed", "Hz"),
    "--speed-rpm": Number("speed", "rpm", 1.0 / 60.0),
}
SPEED_IN_RPM: Mapping[str, Option] = {"--speed-rpm": Number("speed", "rpm"), "--speed-hz": Number("speed", "Hz", 60.0)}
"""Options of a machine whose field ``speed`` is in Hz, or in rpm."""


class TaskDefaults(NamedTuple):
    """Defaults of a machine in the environments.

    Attributes
    ----------
    fields
        Of the nominal machine that differ from the machine's own defaults.
    model
        Settings of the nominal machine that make it the coarser model which controllers may use; {} for the same.
    tolerances
        Half widths as shares of the nominal value; None for those of the machine.
    fleet
        More of them, of what no sensor tells, where a fleet is at work.
    task
        Numbers of the task that differ from what follows from the usual ranges.
    """

    fields: Mapping[str, Any] = {}
    model: Mapping[str, Any] = {}
    tolerances: Mapping[str, float] | None = None
    fleet: Mapping[str, float] = {}
    task: Mapping[str, float] = {}


@dataclass(frozen=True, kw_only=True)
class Machine(Abilities, ABC):
    """A frozen dataclass of parameters in SI units, and how the machine runs.

    A subclass declares its fields with ``parameter`` and defines what is abstract here. The rest has a default.
    ``ModalImpactMachine`` defines all but the fields and the model of a machine that is a few modes and one gap.

    The keyword ``fidelity`` sets the fields of a rung of the ladder, as in ``ImpactBeam(fidelity="fine")``, or those of
    the cheapest model within an estimated error, as in ``ImpactBeam(fidelity="1 %")``. A machine keeps the fields, not
    the name, so that ``dataclasses.replace`` and ``with_settings`` may change any of them.

    Raises
    ------
    ParameterError
        On construction, if a field is outside its range, if the rung is unknown, or if a field that it sets is given
        too; names the field, the value and what is allowed.
    """

    name: ClassVar[str]
    """Name on the command line, such as ``impact-beam``."""
    speed_field: ClassVar[str]
    """Field that an operator changes while the machine runs."""
    usual_ranges: ClassVar[Mapping[str, tuple[float, float]]]
    """Ranges of speed and clearance, in the fields' units, that sweeps and environments cover by default."""
    sides: ClassVar[tuple[str, ...]] = ("upper", "lower")
    """Names of the bearing surfaces whose contact force is recorded."""
    fidelity_ladder: ClassVar[Mapping[str, Mapping[str, Any]]] = {"reference": {}}
    """Fields that each rung sets, from the cheapest rung to the reference."""
    options: ClassVar[Mapping[str, Option]] = {}
    """Options on the command line, in the order in which they take effect; other fields are reached by ``--set``."""
    aliases: ClassVar[Mapping[str, str]] = {}
    """Fields by other names, those of the only joint: ``joint.stiffness`` for ``contact_stiffness``."""
    scenes: ClassVar[Mapping[str, Mapping[str, Any]]] = {"as it is": {}}
    """Scenes whose cost the trade-off shows: the fields in which they differ from the default."""

    initial_state: ClassVar[tuple[float, ...]] = ()
    """State (n_states,) in SI units from which it runs where no other is given; rest in the middle of the gap if empty.

    That of the class is what its file states; ``from_state`` gives a machine another.
    """

    tolerances: ClassVar[Mapping[str, tuple[float, bool]]] = {}
    """Half width of each field within which machines are built, and whether it is a share; usual ones if empty."""
    has_motor: ClassVar[bool] = False
    """Whether a motor turns it, so that ``under_motor`` of a mechanism tells its speed."""
    task_defaults: ClassVar[TaskDefaults] = TaskDefaults()
    """What environments start from, where the usual does not serve."""

    fidelity: InitVar[str | None] = None

    def __new__(cls, **given: Any) -> Self:
        """Refuse a rung together with a field that it sets: only here is it known what was given."""
        expand_fidelity(cls, given)
        return super().__new__(cls)

    def __post_init__(self, fidelity: str | None) -> None:
        for name, value in expand_fidelity(type(self), {"fidelity": fidelity}).items():
            object.__setattr__(self, name, value)
        validate(self)
        if is_tolerance(fidelity):
            self._take_model(fidelity)

    def _take_model(self, tolerance: str | None) -> None:
        """Set the fields of the cheapest model within a tolerance; other fields are checked by a machine like it."""
        like = type(self)(**{each.name: getattr(self, each.name) for each in fields(self)})
        chosen = with_settings(like, {"fidelity": tolerance})
        for each in fields(self):
            object.__setattr__(self, each.name, getattr(chosen, each.name))

    @final
    def begins_from(self) -> str:
        """Where it runs from unless told otherwise, in words: "rest" or "its initial state"."""
        return "its initial state" if any(self.initial_state) else "rest"

    @final
    def from_state(self, state: ArrayLike) -> Self:
        """Return the machine that runs from a state (n_states,) where no other is given; () for rest.

        Raises
        ------
        ParameterError
            If the state has another length, or a value is not finite.

        Examples
        --------
        >>> beam = chaosgym.ImpactBeam(excitation_frequency=19.0)
        >>> other = chaosgym.diagnosis.attractors(beam).motions[1]  # doctest: +SKIP
        >>> chaosgym.diagnose(beam.from_state(other.state))  # doctest: +SKIP
        """
        values = np.asarray(state, dtype=float)
        if values.shape not in ((0,), (self.n_states,)) or not np.all(np.isfinite(values)):
            raise ParameterError(
                f"initial_state has shape {values.shape}; allowed: ({self.n_states},), all values finite: "
                "displacements, then velocities"
            )
        return self._with_unchecked(initial_state=tuple(values.tolist()))

    @property
    @final
    def rung(self) -> str | None:
        """Rung of the ladder whose fields this machine has; None if it stands beside the ladder."""
        for rung, values in self.fidelity_ladder.items():
            if all(getattr(self, name) == value for name, value in values.items()):
                return rung
        return None

    @property
    def definition(self) -> str:
        """Identifier of the kind of machine: the name, or the hash of the file that describes the kind."""
        return self.name

    @property
    @abstractmethod
    def clearance_field(self) -> str:
        """Field that holds the clearance of the monitored joint; a class attribute serves too."""

    @staticmethod
    def period_at(speed: Any) -> Any:
        """Duration of one operating cycle [s] at a speed, in the unit of the speed field (here Hz), or at many."""
        return 1.0 / speed

    @property
    @abstractmethod
    def natural_frequencies(self) -> Array:
        """Natural frequencies [Hz] of the machine free of contact, those of the kept modes."""

    @property
    @abstractmethod
    def n_states(self) -> int:
        """Number of states of the equations of motion."""

    @property
    def n_velocities(self) -> int:
        """Velocities in the state, which stand behind as many displacements."""
        return self.n_states // 2

    @property
    @abstractmethod
    def fastest_rate(self) -> float:
        """Largest modulus [1/s] of an eigenvalue, contacts closed."""

    @abstractmethod
    def reduce(self) -> Any:
        """Return the model, a NamedTuple of numbers and arrays, that the kernels integrate."""

    @abstractmethod
    def run(
        self,
        coordinates: Array,
        bouncing: Array,
        arrays: CycleArrays,
        integrator: Integrator,
        tangents: "Tangents | None" = None,
    ) -> tuple[int, int]:
        """Run as many cycles as ``arrays`` has rows; ``coordinates`` (n_states,), ``bouncing`` (3m,) change in place.

        Parameters
        ----------
        tangents
            Deviations that travel along, for a machine whose ``moving`` has them.

        Returns
        -------
        (status, cycles)
            One of ``core.status``, and the number of cycles that were finished.
        """

    @property
    def operating_fields(self) -> tuple[str, ...]:
        """Fields that may change from cycle to cycle: what the states stand for does not depend on them."""
        return self.speed_field, self.clearance_field

    @property
    @final
    def cycle_period(self) -> float:
        """Duration of one operating cycle [s]."""
        return float(self.period_at(getattr(self, self.speed_field)))

    @property
    def notes(self) -> tuple[str, ...]:
        """What a user should know of this machine beside every result of it, a line each."""
        return ()

    @property
    @final
    def surfaces(self) -> Mapping[str, int]:
        """Surfaces that there are, by name, and their columns in ``CycleRecord.peak_force``: one stop, one surface."""
        rooms = [self.room_of(joint) for joint in range(len(self.sides) // 2)]
        there = [math.isfinite(bound) for lower, upper in rooms for bound in (upper, lower)]
        return {side: place for place, side in enumerate(self.sides) if there[place]}

    @property
    def sensors(self) -> tuple[str, ...]:
        """Names of the force sensors; ``CycleRecord.sensor_peak`` has their columns."""
        return ()

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints whose surfaces ``sides`` are, two each; empty for a machine with one monitored joint."""
        return ()

    @property
    def degrees_of_freedom(self) -> tuple[str, ...]:
        """Names of the coordinates that are integrated; empty where they are modes."""
        return ()

    @property
    def default_integrator(self) -> ExactEvents:
        """Integrator where none is given."""
        return ExactEvents()

    def state_weights(self, state: Array) -> Array:
        """Weights (n_states,) by which deviations of a state are measured; by default each coordinate counts alike."""
        size = np.abs(state)
        return np.asarray(1.0 / np.where(size > 1e-6 * size.max(), size, max(size.max(), 1e-300)))

    @final
    def at(self, speed: float | None = None, clearance: float | None = None) -> Self:
        """Return the machine at another operating point: what else it is was checked when it was made.

        Raises
        ------
        ParameterError
            If the speed or the clearance, in their fields' units, is out of range.
        """
        point = {self.speed_field: speed, self.clearance_field: clearance}
        given = {field: value for field, value in point.items() if value is not None}
        return self._with_unchecked(**{field: check_parameter(self, field, value) for field, value in given.items()})

    def along(self, field: str, low: float, high: float) -> "Callable[[float], Machine]":
        """Return the machine at any value of a field, for many values between two.

        Raises
        ------
        ParameterError
            By what is returned, if the field's own range ends before.
        """
        if field == self.speed_field:
            return lambda value: self.at(speed=value)
        if field == self.clearance_field:
            return lambda value: self.at(clearance=value)
        return lambda value: with_settings(self, {field: value})

    def _with_unchecked(self, **fields: Any) -> Self:
        """Return the machine with some fields replaced by values that are known to be allowed."""
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, **fields)
        return other

    def room_of(self, joint: int | None = None) -> tuple[float, float]:
        """Displacement [m] of the monitored joint, or of one of the ``joints`` by its number, at its stops.

        The lower one stands first; infinite where there is none.
        """
        gap = float(getattr(self, self.clearance_field))
        return -gap, gap

    @property
    def kinematics(self) -> Kinematics | None:
        """How its joints and points move, and what an impulse does to them; None where it does not tell."""
        equations = self.without_friction
        if equations is None:
            return None
        rooms = [self.room_of(joint) for joint in range(len(equations.joints))]
        farthest = [max((abs(stop) for stop in room if math.isfinite(stop)), default=0.0) for room in rooms]
        joints = tuple(f"the joint {name}" for name in self.joints) or ("the joint",)
        return Kinematics(
            mobility=np.eye(self.n_velocities),
            places=dict(zip(joints, equations.joints, strict=True)) | dict(equations.points),
            stops=list(zip(equations.joints, farthest, strict=True)),
        )

    def sensed(self, peak_force: Array) -> Array:
        """Peak forces [N] that the sensor of the monitored joint shows, (..., cycles), of those of all ``sides``."""
        return np.asarray(peak_force[..., 0])

    def arrays(self, cycles: int, samples: int = 0) -> CycleArrays:
        """Return the arrays into which ``run`` writes what happens in some cycles, with samples of the history."""
        return cycle_arrays(cycles, self.n_states, samples)

    def further_results(self, arrays: CycleArrays) -> dict[str, Any]:
        """Return those fields of ``CycleRecord`` that not every machine has, such as ``sensor_peak``."""
        return {}

    @abstractmethod
    def batch(self, count: int) -> "CompiledBatch":
        """Return ``count`` variants that move in one compiled call."""
