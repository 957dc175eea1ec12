"""A plant as an environment: a machine that is not simulated here, behind an FMU or a class of yours.

Nothing labels its motion. A step is irregular by the recurrence of its own peak forces (``chaosgym.envs.judge``), and
at the end of a job ``chaosgym.judge_peaks`` judges the longest stretch at one speed. ``info`` says so.
"""

import warnings
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, ClassVar, NoReturn

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array, Indices
from chaosgym.envs.drive import action_space
from chaosgym.envs.jobs import Jobs
from chaosgym.envs.levels import task_of
from chaosgym.envs.machine_env import EnvSettings, MachineEnv
from chaosgym.envs.observation import FORCE_RANGE, Observation, observation_space
from chaosgym.envs.pool import Pool
from chaosgym.envs.task import Status, Task, divided
from chaosgym.envs.variants import OWN, Units, Variants
from chaosgym.errors import DiagnosisError, ParameterError, SimulationError
from chaosgym.machines.batch import Cycles
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameter
from chaosgym.plants.plant import LONGEST_HOLD, Plant, filled, plant_of, readings_of

PER_SECOND = {"Hz": 1.0, "rpm": 60.0}
"""Units of speed, and what one turn a second is in each."""

JUDGE = "recurrence of the plant's own peak forces; nothing labels its motion"
"""``info["judge"]`` of every step."""

EXACT = {"sensor_error": 0.0, "bouncing_error": 0.0, "missed_impacts": 0.0, "speed_ripple": 0.0}
"""Errors that are not added to what a plant tells, which has its own."""


@dataclass(frozen=True, kw_only=True)
class Unknown(Machine):
    """What is not known of a plant: whoever asks for a model of it is told that there is none."""

    name = "plant"
    speed_field = "speed"
    clearance_field = "clearance"
    n_velocities = 0  # that could be kicked
    turn: ClassVar[float] = 1.0

    speed: float = parameter(1.0, low=0.0, high=1e9, provenance="assumed", source="operating speed")
    clearance: float = parameter(0.0, low=0.0, high=1.0, unit="m", provenance="assumed", source="not known")

    @classmethod
    def period_at(cls, speed: Any) -> Any:
        """Duration of a turn [s]."""
        return cls.turn / speed

    def _refuse(self, *_given: Any, **_named: Any) -> NoReturn:
        raise ParameterError("a plant has no model; allowed: controllers that go by measurements, such as Kriging()")

    natural_frequencies = n_states = fastest_rate = property(_refuse)
    reduce = run = batch = _refuse

    def sensed(self, peak_force: Array) -> Array:
        """The larger of the forces on both stops [N]."""
        return np.asarray(peak_force.max(axis=-1))


class PlantBatch:
    """One plant in the place of machines that move side by side.

    A step without a usable reading counts as the one before, for ``LONGEST_HOLD`` steps; the next one fails.

    Parameters
    ----------
    plant, name
        What runs, and how errors name it.
    largest
        Mean peak force from which on a reading is beyond the sensors' range [N].

    Attributes
    ----------
    failure
        Why the last step failed; "" if it did not.
    lost
        Steps of the job without a usable reading.
    measured
        Speed of the last step; not a number if the plant did not tell it.
    """

    def __init__(self, plant: Plant, name: str, largest: float) -> None:
        self.plant, self.name, self._largest = plant, name, largest
        self.failure, self.lost, self.measured = "", 0, float("nan")
        self._speed, self._runs = 0.0, False
        self._last: tuple[Array, dict[str, float]] | None = None

    def start(self, i: int, machine: Machine) -> None:
        """Bring the plant to rest."""
        self.stop()
        self.failure, self.lost, self._held, self._silent, self._last = "", 0, 0, 0, None
        self._runs = True
        try:
            self.plant.reset()
        except Exception as error:
            raise SimulationError(f"plant {self.name} can't start: {error}") from error

    def stop(self) -> None:
        """Call ``stop()`` of a plant that runs and has it."""
        if self._runs:
            self._runs = False
            getattr(self.plant, "stop", lambda: None)()

    def set_speeds(self, which: Indices, speeds: Array) -> None:
        """Set the speed of the coming cycles."""
        self._speed = float(speeds[0])

    def run(self, which: Indices, cycles: int) -> Cycles:
        """Run the plant; where it fails all is zero and ``failed`` true."""
        peaks, impacts, bounce = np.zeros((1, cycles, 2)), np.zeros((1, cycles, 2), np.int64), np.zeros((1, cycles, 2))
        try:
            forces, told = self._reading(cycles)
        except ParameterError as error:
            self.failure = str(error)
            return Cycles(np.ones(1, np.bool_), peaks, impacts, bounce)
        peaks[0, :, : forces.shape[1]] = forces
        counted = np.floor(told.get("impacts", 0.0) * np.arange(cycles + 1) + 0.5).astype(np.int64)
        impacts[0, :, 0] = np.diff(counted)
        bounce[0, :, 0] = told.get("bouncing", 0.0)  # share of the half cycle, which ``PlantJobs`` turns into time
        return Cycles(np.zeros(1, np.bool_), peaks, impacts, bounce)

    def _reading(self, cycles: int) -> tuple[Array, dict[str, float]]:
        """Forces (cycles, sides) of a step [N] and what else was told, or those of the last one that can be used."""
        raw, told = readings_of(self.plant, self._speed, cycles, self.name, f"{cycles} cycles")
        self.measured = told.pop("speed", float("nan"))
        forces = filled(raw) if np.isfinite(list(told.values())).all() else None
        if forces is not None and forces.max(axis=1).mean() < self._largest:
            self._last, self._held = (forces, told), 0
            self._hear(forces)
            return forces, told
        self.lost, self._held = self.lost + 1, self._held + 1
        if self._last is None or self._held > LONGEST_HOLD:
            raise ParameterError(
                f"plant {self.name} told no usable reading for {self._held} steps; allowed: finite forces below "
                f"{self._largest:g} N, {FORCE_RANGE:g} times reference_force"
            )
        forces, told = self._last
        return forces[-cycles:], told

    def _hear(self, forces: Array) -> None:
        """Warn once in a job that no force was told for some steps."""
        self._silent = 0 if forces.any() else self._silent + 1
        if self._silent == LONGEST_HOLD + 1:
            warnings.warn(
                f"plant {self.name} told 0 N for {self._silent} steps: nothing touches, or the sensor is dead",
                stacklevel=2,
            )


class OnePlant:
    """The plant, as ``Variants`` are the machines of a job."""

    split, count, seed = None, 0, 0

    def __init__(self, nominal: Machine, batch: PlantBatch) -> None:
        self.nominal, self.tolerances, self._batch = nominal, dict[str, float](), batch

    def batch(self, count: int) -> Any:
        """Return the plant."""
        return self._batch

    def drawn(self, generator: np.random.Generator) -> Machine:
        """Return what is known of it."""
        return self.nominal

    def units(self, machine: Machine) -> Units:
        """Its speeds and forces are the task's."""
        return OWN

    def checked_numbers(self, given: Any, count: int) -> NDArray[np.int64]:
        """Refuse: a plant is one machine."""
        raise ParameterError(f"options['machine'] = {given!r} is out of range; a plant is one machine")


class PlantJobs(Jobs):
    """The job of a plant; ``felt`` (cycles,) are the peak forces of its last step [N]."""

    felt: Array

    def _moved(self, which: Indices, speeds: Array, generators: Any) -> tuple[Cycles, Array]:
        """Cycles of the plant, whose speed is the measured one, if it tells that."""
        cycles, growth = super()._moved(which, speeds, generators)
        batch: Any = self.batch
        self.felt = self.variants.nominal.sensed(cycles.peak_force)[0]
        if np.isfinite(batch.measured):
            self.state["speed"] = batch.measured
        cycles.bounce_duration[:] *= self.variants.nominal.period_at(speeds[:, :, None])
        return cycles, growth


class PlantSettings(EnvSettings):
    """Task and spaces of a plant; its keywords are those of ``PlantEnv``."""

    def __init__(
        self,
        plant: Plant,
        name: str,
        *,
        lowest_speed: float | None = None,
        highest_speed: float | None = None,
        reference_force: float | None = None,
        unit: str = "Hz",
        objective: str = "both",
        **keywords: Any,
    ) -> None:
        given = {"lowest_speed": lowest_speed, "highest_speed": highest_speed, "reference_force": reference_force}
        for what, value in given.items():
            if value is None:
                raise ParameterError(f"{what} is missing: of a plant nothing is known but what you say of it")
        if unit not in PER_SECOND:
            raise ParameterError(f"unit = {unit!r} is not one of {', '.join(PER_SECOND)}")
        assert lowest_speed is not None
        assert highest_speed is not None
        if not 0.0 < lowest_speed < highest_speed:
            raise ParameterError(
                f"lowest_speed = {lowest_speed!r} is out of range; allowed: above 0, below {highest_speed!r}"
            )
        ranges = {"speed": (float(lowest_speed), float(highest_speed)), "clearance": (0.0, 1.0)}
        kind = type("Unknown", (Unknown,), {"usual_ranges": ranges, "turn": PER_SECOND[unit]})
        nominal = kind()
        self.task, fields = divided(
            task_of(nominal, "nominal"), nominal, EXACT | given | {"objective": objective} | keywords
        )
        if fields:
            raise ParameterError(f"{next(iter(fields))} is of a machine that is simulated here; a plant has its own")
        self._refuse(self.task)
        batch = PlantBatch(plant, name, FORCE_RANGE * self.task.reference_force)
        self.variants: Variants | Pool = OnePlant(nominal, batch)  # type: ignore[assignment]
        self.model, self.unit = nominal, unit
        self.space, self.actions = observation_space(self.task), action_space(self.task)

    def jobs(self, count: int) -> Jobs:
        """Return the job of the plant."""
        return PlantJobs(self.task, self.variants, self.space, count)

    @staticmethod
    def _refuse(task: Task) -> None:
        """Refuse what would have to be done to the plant."""
        for name in ("kick", "wear", "speed_ripple"):
            if getattr(task, name):
                raise ParameterError(
                    f"{name} = {getattr(task, name):g} is out of range; allowed: 0, for a plant has its own"
                )
        if task.drive != "constant":
            raise ParameterError(f"drive = {task.drive!r} is out of range; allowed: 'constant', for a plant")


class PlantEnv(MachineEnv):
    """A plant whose speed an agent trims around a demand: ``gym.make("chaosgym/Plant-v0", ...)``.

    Parameters
    ----------
    fmu, input, output
        File of an FMU for co-simulation, and its variables; see ``chaosgym.FmuPlant``. It is a program of its author,
        and runs with your rights.
    plant
        Instead of an FMU: ``"module:Class"``, or a class or function that makes a plant.
    arguments
        More arguments of ``FmuPlant``, or those of the class.
    lowest_speed, highest_speed, reference_force
        Range of the drive, and the usual peak force [N], by which damage is counted. They must be given.
    unit
        Of the speeds: Hz or rpm. A cycle is a turn.
    render_mode
        None: nobody sees into a plant.
    keywords
        Other fields of ``Task``. ``objective`` is "both" by default: irregular motion, and the joint's life.

    Raises
    ------
    ParameterError
        If the plant can't be made, or a keyword is missing or out of range.

    Notes
    -----
    ``info`` of a step ends with ``judge``, which says who judges the motion; ``steps_without_reading`` so far, each of
    which counts as the step before; ``failure``, why a job ended with the status SIMULATION_FAILED; at the end of a job
    ``verdict``, what ``judge_peaks`` says of the peaks of the longest stretch at one set-point, and ``verdict_cycles``,
    how many there were.

    Examples
    --------
    >>> import gymnasium as gym
    >>> class Rig:
    ...     def reset(self): ...
    ...     def run(self, speed, cycles):
    ...         return [2.0 * speed] * cycles  # [N]
    >>> env = gym.make("chaosgym/Plant-v0", plant=Rig, lowest_speed=10.0, highest_speed=24.0, reference_force=40.0)
    >>> observation, info = env.reset(seed=0, options={"speed": 15.0})
    >>> float(observation[6])
    30.0
    """

    def __init__(
        self,
        *,
        fmu: str | None = None,
        input: str | None = None,
        output: Any = None,
        plant: str | Callable[..., Plant] | None = None,
        arguments: Mapping[str, Any] | None = None,
        lowest_speed: float | None = None,
        highest_speed: float | None = None,
        reference_force: float | None = None,
        unit: str = "Hz",
        render_mode: str | None = None,
        **keywords: Any,
    ) -> None:
        if (fmu is None) == (plant is None):
            raise ParameterError("a plant is given by fmu=FILE, or by plant='module:Class'; allowed: one of the two")
        if render_mode is not None:
            raise ParameterError(f"render_mode = {render_mode!r} is not possible with a plant; allowed: None")
        more = dict(arguments or {})
        if fmu is not None:
            from chaosgym.plants.fmu import FmuPlant

            if input is None or output is None:
                raise ParameterError("an FMU needs input=..., its speed, and output=..., its force")
            ports = {"input": input, "output": output, "unit": unit}
            self.plant: Plant = FmuPlant(fmu, **ports | more)
        elif isinstance(plant, str):
            self.plant = plant_of(plant, **more)
        else:
            assert plant is not None
            self.plant = plant(**more)
        self._name = fmu or (plant if isinstance(plant, str) else str(getattr(plant, "__name__", "of yours")))
        said: dict[str, Any] = {
            "lowest_speed": lowest_speed,
            "highest_speed": highest_speed,
            "reference_force": reference_force,
        }
        self._take_settings(PlantSettings(self.plant, self._name, unit=unit, **said, **keywords), None)
        self.metadata = {**self.metadata, "render_modes": []}
        self._peaks: list[tuple[float, Array]] = []
        batch: Any = self._job.batch
        self._batch: PlantBatch = batch
        weakref.finalize(self, batch.stop)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Observation, dict[str, Any]]:
        """As ``MachineEnv.reset``; a seed draws the demands, and ``options`` may have a speed."""
        self._peaks = []
        with self._stopped():
            observation, info = super().reset(seed=seed, options=options)
        return observation, {**info, "judge": JUDGE}

    def step(self, action: Any) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """As ``MachineEnv.step``; a plant that fails ends the job, and is stopped whenever one ends."""
        with self._stopped():
            observation, reward, terminated, truncated, info = super().step(action)
        job: Any = self._job
        self._peaks.append((float(job.state["set_point"][0]), job.felt))
        info |= {"judge": JUDGE, "steps_without_reading": self._batch.lost}
        if terminated:
            if info["status"] == Status.SIMULATION_FAILED:
                info["failure"] = self._batch.failure
            info |= self._verdict()
            self._batch.stop()
        return observation, reward, terminated, truncated, info

    def close(self) -> None:
        """Stop the plant, and end what runs it."""
        self._batch.stop()
        getattr(self.plant, "close", lambda: None)()
        super().close()

    @contextmanager
    def _stopped(self) -> Iterator[None]:
        """Stop the plant if anything goes wrong, Ctrl-C too, and say why it did not start."""
        try:
            yield
        except SimulationError as error:
            self._batch.stop()
            raise SimulationError(self._batch.failure or str(error)) from error
        except BaseException:
            self._batch.stop()
            raise

    def _verdict(self) -> dict[str, Any]:
        """What the peaks of the longest stretch at one set-point say."""
        from chaosgym.recordings.judge import judge_peaks

        stretches: list[list[Array]] = []
        before = float("nan")
        for speed, peaks in self._peaks:
            if speed != before:
                stretches.append([])
            stretches[-1].append(peaks)
            before = speed
        longest = np.concatenate(max(stretches, key=len))
        try:
            told = "; ".join(judge_peaks(longest).diagnosis.statement.lines()[:2])
        except DiagnosisError as error:
            told = f"undetermined ({error})"
        return {"verdict": told, "verdict_cycles": len(longest)}
