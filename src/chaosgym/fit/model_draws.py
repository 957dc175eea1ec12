"""Draws of approximate Bayesian computation: noisy records of a machine within its tolerances, and their weights.

A draw is a machine within the tolerances, levels of noise on speed, force and gap from cycle to cycle, and the record
that they give. ``model_fit`` compares the records with a measured one, in rounds, by figures of level, scatter,
distribution and order of cycles. Each figure has a ``discrepancy``: what a model may err by and still be the machine's.
All of them are assumed.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.diagnosis.response_type import Tolerance, default_tolerances
from chaosgym.errors import DiagnosisError, ParameterError, SimulationError
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import field_named, parameters_of, with_settings
from chaosgym.series.noise import class_residual
from chaosgym.simulation import MotionState, simulate

LEAST_SCATTER = 1e-3
"""Standard deviation, as a share of the mean, below which scatter counts as none: few draws have so little noise."""

SHARES = (0.02, 0.1, 0.25, 0.5, 0.75, 0.9, 0.98)
"""Shares of the readings below the quantiles that describe their distribution."""

LAGS, PATTERNS = (1, 2, 3, 4), (2, 3, 4)
"""Cycles between the readings whose correlation counts, and periods of patterns."""

NEIGHBOURS, PASTS = 4, (1, 2)
"""Readings of the nearest past whose next ones forecast, and how many readings a past has."""

OF_SENSOR = (
    ("mean", 0.02),
    ("scatter", 0.2),
    *((f"{100.0 * share:g} % quantile", 0.2) for share in SHARES),
    *((f"correlation over {lag}", 0.15) for lag in LAGS),
    *((f"pattern of {period}", 0.15) for period in PATTERNS),
    *((f"forecast from {past}", 0.15) for past in PASTS),
)
"""Name and discrepancy of the figures of one sensor; mean and scatter are logarithms, quantiles standard deviations."""

BETWEEN = (("correlation of sensors", 0.15), ("correlation of sensors over 1", 0.15))


def figures(record: Array) -> Array:
    """Figures (k,) of readings (cycles, sensors); nan where a sensor reads nothing."""
    told = [value for readings in record.T for value in _of_sensor(readings)]
    for first in range(record.shape[1]):
        for second in range(first + 1, record.shape[1]):
            one, other = (_scaled(record[:, place]) for place in (first, second))
            told += [float(np.mean(one * other)), float(np.mean(one[1:] * other[:-1]))]
    return np.array(told)


def names_of(sensors: int) -> tuple[list[str], Array]:
    """Names of the figures, and their discrepancies."""
    pairs = sensors * (sensors - 1) // 2
    listed = [*OF_SENSOR * sensors, *BETWEEN * pairs]
    return [name for name, _ in listed], np.array([size for _, size in listed])


def _scaled(readings: Array) -> Array:
    mean = float(readings.mean())
    return np.asarray((readings - mean) / max(float(readings.std()), LEAST_SCATTER * abs(mean), 1e-300))


def _of_sensor(readings: Array) -> list[float]:
    mean, sigma = float(readings.mean()), float(readings.std())
    if mean <= 0.0:
        return [np.nan] * len(OF_SENSOR)
    scaled = _scaled(readings)
    power = float(np.mean(scaled**2))
    told = [np.log(mean), np.log(max(sigma / mean, LEAST_SCATTER)), *np.quantile(scaled, SHARES)]
    # the power is 1, and less where there is hardly any scatter, whose order then says nothing
    told += [float(np.mean(scaled[lag:] * scaled[:-lag])) for lag in LAGS]
    told += [power - float(np.mean(class_residual(scaled, period) ** 2)) for period in PATTERNS]
    return told + [_forecast_rest(scaled, past) for past in PASTS]


def _forecast_rest(scaled: Array, past: int) -> float:
    """Variance that the mean of what followed the nearest pasts leaves of each reading."""
    windows = np.lib.stride_tricks.sliding_window_view(scaled, past + 1)
    before, after = windows[:, :-1], windows[:, -1]
    distance = np.sum(before**2, axis=1)[:, None] - 2.0 * before @ before.T + np.sum(before**2, axis=1)
    np.fill_diagonal(distance, np.inf)
    nearest = np.argpartition(distance, NEIGHBOURS, axis=1)[:, :NEIGHBOURS]
    return float(np.mean((after - after[nearest].mean(axis=1)) ** 2)) / (1.0 + 1.0 / NEIGHBOURS)


TRANSIENT = 100
"""Cycles that each draw runs before those that count."""

SPEED_NOISE, NOISE, SENSOR_NOISE = (1e-5, 0.01), (1e-5, 0.03), (1e-5, 0.03)
"""Standard deviations, as shares, of noise on speed, on forces and gaps, and on readings (prior: log-uniform)."""

MOST_PERSISTENT = 0.9
"""Largest correlation of the noise of one cycle and the next (prior: uniform)."""

LEVELS = 8
"""Values that the noise of a draw takes: so many models are made for it."""

WIDE = 2.0
"""Factor either way within which an estimated parameter is looked for."""

AFRESH = 0.2
"""Share of the draws of a later round that are from the prior all the same."""


class Prior(NamedTuple):
    """What draws are made of: numbers from 0 to 1 for tolerances, then for levels of noise, then its persistence."""

    machine: Machine
    tolerances: Mapping[str, Tolerance]
    wide: tuple[str, ...]
    noisy: tuple[str, ...]

    @property
    def size(self) -> int:
        """How many numbers from 0 to 1 make a draw."""
        return len(self.tolerances) + len(self.noisy) + 1

    def value(self, field: str, number: float) -> float:
        """The value of a field at a number from 0 to 1."""
        nominal, share = float(getattr(self.machine, field)), 2.0 * number - 1.0
        if field not in self.wide:
            return float(self.tolerances[field].at(nominal, share))
        low, high = self.ends(field)
        return float(low * (high / low) ** number)

    def ends(self, field: str) -> tuple[float, float]:
        """Ends within which an estimated parameter is looked for."""
        nominal, about = float(getattr(self.machine, field)), parameters_of(self.machine)[field]
        return max(nominal / WIDE, about.low), min(nominal * WIDE, about.high)

    def machine_at(self, place: Array) -> Machine:
        """The machine of a draw without its noise."""
        values = {field: self.value(field, float(u)) for field, u in zip(self.tolerances, place, strict=False)}
        return with_settings(self.machine, values)

    def levels(self, place: Array) -> dict[str, float]:
        """Standard deviations of the noise, as shares, by field."""
        numbers = place[len(self.tolerances) : -1]
        return {field: _level(_range_of(self, field), float(u)) for field, u in zip(self.noisy, numbers, strict=True)}


def _range_of(prior: Prior, field: str) -> tuple[float, float]:
    return SPEED_NOISE if field == prior.machine.speed_field else NOISE


def _level(ends: tuple[float, float], number: float) -> float:
    return float(ends[0] * (ends[1] / ends[0]) ** number)


class Draw(NamedTuple):
    """A simulated record's place in the prior, its difference from the measured one, and where its motion ended."""

    place: Array
    difference: float
    parts: Array
    sensor: float
    final: MotionState


def fields_to_estimate(machine: Machine, names: Sequence[str]) -> tuple[str, ...]:
    """Fields of a machine that are meant by ``estimate`` of ``model_fit``.

    Raises
    ------
    DiagnosisError
        If one is no number of the machine, or not above 0.
    """
    known, found = parameters_of(machine), list[str]()
    for name in names:
        field = field_named(machine, name)
        if field not in known or known[field].choices or isinstance(getattr(machine, field), int):
            raise DiagnosisError(f"{name!r} can't be estimated; allowed: clearance, or a number of {machine.name}")
        if not getattr(machine, field) > 0.0:
            raise DiagnosisError(f"{field} is {getattr(machine, field):g}; only what is above 0 can be estimated")
        found += [field] if field not in found else []
    return tuple(found)


def prior_of(machine: Machine, estimate: Sequence[str]) -> Prior:
    """The prior of a machine: its tolerances, wider for fields that are estimated, and noise on what it is run by."""
    wide = fields_to_estimate(machine, estimate)
    tolerances = {**{field: Tolerance(0.0) for field in wide}, **default_tolerances(machine)}
    noisy = tuple(field for field in machine.operating_fields if getattr(machine, field) != 0.0)
    return Prior(machine, tolerances, wide, noisy)


def other_start(draws: Sequence[Draw], turn: int) -> MotionState | None:
    """In turn rest, where the last draw ended, and its mirror image: motions that coexist are all to be found."""
    if not draws or turn % 3 == 0:
        return None
    coordinates, bouncing = draws[-1].final
    return MotionState(coordinates if turn % 3 == 1 else -coordinates, bouncing)


def near(centre: Array, widths: Array, rng: np.random.Generator) -> Array:
    """A place beside another one, reflected at the ends of the prior."""
    place = np.abs(centre + widths * rng.normal(size=len(centre)))
    return np.asarray(np.clip(1.0 - np.abs(1.0 - place), 0.0, 1.0))


def simulated(
    prior: Prior, place: Array, start: MotionState | None, length: int, rng: np.random.Generator, read: Any
) -> tuple[Array, MotionState] | None:
    """A noisy record (length, sensors) and where it ends; None if the machine can't be run."""
    try:
        machine = prior.machine_at(place)
        about = parameters_of(machine)
        table = {}
        jumps = rng.uniform(size=length) >= MOST_PERSISTENT * place[-1]
        chosen = rng.integers(LEVELS, size=length)
        kept = chosen[np.maximum.accumulate(np.where(jumps, np.arange(length), 0))]
        for field, level in prior.levels(place).items():
            nominal = float(getattr(machine, field))
            values = nominal * (1.0 + level * rng.normal(size=LEVELS))
            table[field] = np.clip(values, about[field].low, about[field].high)[kept]
        record = simulate(machine, length, start, TRANSIENT, operation=table)
    except (ParameterError, SimulationError):
        return None
    return read(record), record.final_state


def compared(
    place: Array,
    record: Array,
    final: MotionState,
    wanted: Array,
    scale: Array,
    share: float | None,
    rng: np.random.Generator,
) -> Draw:
    """A draw with its difference; unknown noise on the readings makes up for the scatter that is missing."""
    mean = record.mean(axis=0)
    if share is None:
        scatter = math.exp(wanted[1]) if wanted[1] > math.log(LEAST_SCATTER) else 0.0
        missing = scatter**2 - float((record[:, 0].std() / max(mean[0], 1e-300)) ** 2)
        share = float(np.clip(math.sqrt(max(missing, 0.0)), *SENSOR_NOISE))
    parts = (figures(record + share * mean * rng.normal(size=record.shape)) - wanted) / scale
    difference = float(np.sqrt(np.mean(parts**2)))
    return Draw(place, difference if np.isfinite(difference) else math.inf, parts, share, final)


def weights_of(accepted: Sequence[Draw], proposals: Sequence[tuple[int, Array, Array]]) -> Array:
    """Prior over the mixture of all rounds, truncated, with sum 1."""
    places = np.array([draw.place for draw in accepted])
    density = np.zeros(len(places))
    for count, centres, widths in proposals:
        if not len(centres):
            density += count
            continue
        apart = (places[:, None, :] - centres) / widths
        kernels = np.exp(-0.5 * np.sum(apart**2, axis=2)) / np.prod(widths * math.sqrt(2.0 * math.pi))
        density += count * ((1.0 - AFRESH) * kernels.mean(axis=1) + AFRESH)
    weights = 1.0 / density
    weights = np.minimum(weights, math.sqrt(len(weights)) * weights.mean())
    return np.asarray(weights / weights.sum())
