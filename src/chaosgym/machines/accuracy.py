"""How far a machine's model is from a finer one, and the cheapest model within a stated tolerance.

A machine offers ``models``, a ladder of them, and of each a ``finer`` one; nothing here knows what they are. The two
are run for some cycles from rest, and twice the difference of their peak forces is the estimated error of the model.

Chaos parts two runs however near their models are. So where a change of the clearance by a millionth grows more than
tenfold, cycles count only up to there, and of the mean differences up to each of them the least.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core import status
from chaosgym.errors import ChaosgymError, ParameterError
from chaosgym.plain import Result

Machine = Any
"""A ``chaosgym.machines.machine.Machine``, whose fields this module helps to choose, so that it can't import it."""

M = TypeVar("M", bound=Machine)

TOLERANCES = (1e-5, 0.5)
"""Least and largest error of the peak force, as a share, that may be allowed."""

CYCLES, PATIENT_CYCLES = 4, 32
"""Cycles that are compared, and cycles from rest in which the first contact is waited for."""

SAFETY = 2.0
"""Estimated error over the difference of the two models."""

SMALL, GROWN = 1e-6, 10.0
"""Share by which the clearance is changed, and its growth in the peak force from which on cycles do not count."""

DEFAULT_TOLERANCE = "1 %"
"""Error of the peak force that is allowed where a person asks and states none."""

NO_CONTACT = f"no contact in {PATIENT_CYCLES} cycles from rest: there is no peak force whose error could be estimated"
NO_FINER = "there is no finer model of it to compare with"
FAILS = "a run from rest fails, so its error can't be estimated"


def is_tolerance(fidelity: Any) -> bool:
    """Whether a ``fidelity`` is an error that is allowed, such as "1 %", and no rung.

    Examples
    --------
    >>> from chaosgym.machines.accuracy import is_tolerance
    >>> is_tolerance("0.5%"), is_tolerance("fine")
    (True, False)
    """
    return isinstance(fidelity, str) and fidelity.rstrip().endswith("%")


def tolerance_of(given: float | str) -> float:
    """Error that is allowed, as a share, of a share or a text such as "1 %".

    Raises
    ------
    ParameterError
        If it is no number or out of range.

    Examples
    --------
    >>> from chaosgym.machines.accuracy import tolerance_of
    >>> tolerance_of("0.5%"), tolerance_of(0.01)
    (0.005, 0.01)
    """
    allowed = f"{100.0 * TOLERANCES[0]:g} % to {100.0 * TOLERANCES[1]:g} %"
    try:
        share = float(given.strip().removesuffix("%")) / 100.0 if isinstance(given, str) else float(given)
    except (TypeError, ValueError):
        share = math.nan
    if not TOLERANCES[0] <= share <= TOLERANCES[1]:
        raise ParameterError(f"fidelity = {given!r} is out of range; allowed: {allowed}, or a rung")
    return share


@dataclass(frozen=True)
class ModelAccuracy(Generic[M], Result):
    """A machine's model, and how far its peak forces may be off.

    Attributes
    ----------
    machine
        The machine by that model.
    error
        Estimated error of the peak force, as a share; None if it can't be estimated.
    unknown
        What the estimate leaves out, or why there is none; empty if nothing.
    tolerance
        What the model was chosen for, as a share; None for a model that was stated.
    points
        Operating points of which the error is the largest.
    below
        Estimated error of the model below, where this one is the finest and has none; None otherwise.
    """

    shows = "numbers=machine.model_numbers estimated_error=error tolerance points unknown warning"

    machine: M
    error: float | None
    unknown: str = ""
    tolerance: float | None = None
    points: int = 1
    below: float | None = None

    @property
    def warning(self) -> str:
        """That the error exceeds what was asked for, or what is documented of the rung; empty if it does not."""
        if self.below is not None and self.tolerance is not None:
            return (
                f"no model is estimated to be within {_percent(self.tolerance)}: this is the finest, and the one below "
                f"it is at an estimated error of {_percent(self.below)}"
            )
        if self.error is None:
            return ""
        if self.tolerance is not None and self.error > self.tolerance:
            return (
                f"no model within {_percent(self.tolerance)}: this is the nearest, at an estimated error of "
                f"{_percent(self.error)}"
            )
        documented = self.machine.documented_errors.get(self.machine.rung or "")
        if self.tolerance is None and documented is not None and self.error > documented:
            return (
                f"the rung {self.machine.rung} is documented to be within {_percent(documented)}, and its estimated "
                f"error here is {_percent(self.error)}: take fidelity = '{DEFAULT_TOLERANCE}', or a finer rung"
            )
        return ""

    @property
    def line(self) -> str:
        """Model and error in a line."""
        numbers = ", ".join(f"{name} {value:g}" for name, value in self.machine.model_numbers.items())
        rung = self.machine.rung if len(self.machine.fidelity_ladder) > 1 else None
        model = f"{rung} ({numbers})" if rung and numbers else rung or numbers or "the only one"
        worst = f", the largest at {self.points} points" if self.points > 1 else ""
        error = "" if self.error is None else f"; estimated error of the peak force {_percent(self.error)}{worst}"
        asked = "" if self.tolerance is None or self.error is None else f", asked {_percent(self.tolerance)}"
        return f"model: {model}{error}{asked}" + (f"; {self.unknown}" if self.unknown else "")

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        rung = self.machine.rung if len(self.machine.fidelity_ladder) > 1 else None
        return {"rung": rung, **super().as_dict()}


class ErrorSpread(NamedTuple):
    """Estimated errors of the peak force of some machines by one model, as shares; None where none has an estimate.

    ``estimated`` of the ``machines`` have one; a machine without contact has none.
    """

    machines: int
    estimated: int
    median: float | None
    nine_of_ten: float | None
    largest: float | None

    @property
    def line(self) -> str:
        """The errors in a line."""
        of = f"estimated error of the peak force at {self.estimated} of {self.machines} machines"
        if self.median is None or self.nine_of_ten is None or self.largest is None:
            return of
        return (
            f"{of}: median {_percent(self.median)}, nine of ten within {_percent(self.nine_of_ten)}, "
            f"largest {_percent(self.largest)}"
        )


def error_spread(machines: Sequence[Machine]) -> ErrorSpread:
    """Estimate the error of each of some machines by the model that it has.

    Examples
    --------
    >>> from chaosgym.machines.accuracy import error_spread
    >>> beams = [chaosgym.ImpactBeam(excitation_frequency=speed) for speed in (10.0, 20.0, 30.0)]
    >>> spread = error_spread(beams)
    >>> spread.estimated, 0.0 < spread.median < spread.largest < 0.1
    (3, True)
    """
    errors = [error for one in machines if (error := accuracy_of(one).error) is not None]
    if not errors:
        return ErrorSpread(len(machines), 0, None, None, None)
    median, nine_of_ten = np.quantile(errors, (0.5, 0.9)).tolist()
    return ErrorSpread(len(machines), len(errors), median, nine_of_ten, max(errors))


def accuracy_of(machine: M, points: Sequence[M] = ()) -> ModelAccuracy[M]:
    """Estimate the error of a machine's model, as it is.

    Parameters
    ----------
    machine
        What is asked about.
    points
        The machine at those operating points of which the largest error is told; at its own by default.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0, contact_stiffness=6e7)
    >>> accuracy = chaosgym.accuracy_of(beam)
    >>> accuracy.machine.rung, accuracy.error > 0.04
    ('standard', True)
    """
    return _worst(machine, [_Runs().estimate(point) for point in points or (machine,)])


def model_within(machine: M, tolerance: float | str, points: Sequence[M] = ()) -> ModelAccuracy[M]:
    """Return the machine by the cheapest of its ``models`` whose estimated error is within a tolerance.

    Where none is, that of the least error is taken, and its ``warning`` says so.

    Parameters
    ----------
    machine
        What is asked about.
    tolerance
        Error of the peak force that is allowed, as a share, or as a text such as "1 %".
    points
        The machine at the operating points at all of which the model has to serve; at its own by default.

    Raises
    ------
    ParameterError
        If the tolerance is out of range.

    Examples
    --------
    >>> from chaosgym.machines.accuracy import model_within
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0, contact_stiffness=6e7)
    >>> accuracy = model_within(beam, "1 %")
    >>> accuracy.machine.n_modes > 4, accuracy.error < 0.01
    (True, True)
    """
    allowed = tolerance_of(tolerance)
    models = _models(machine)
    ladders = [_models(point) for point in points] or [models]
    runs, best = _Runs(), None
    for place, model in enumerate(models):
        estimates: list[ModelAccuracy[M]] = []
        for ladder in ladders:
            estimates.append(runs.estimate(ladder[place]))
            if (estimates[-1].error or 0.0) > allowed:
                break
        worst = _worst(model, estimates, allowed, len(ladders))
        if worst.unknown == FAILS:
            best = best or worst
        elif worst.error is None:
            return replace(worst, below=best.error if best and model.finer is None else None)
        elif worst.error <= allowed:
            return worst
        elif best is None or best.error is None or worst.error < best.error:
            best = worst
    assert best is not None, "a ladder has at least one model"
    return best


def _models(machine: M) -> Sequence[M]:
    """Its models; a state belongs to one of them."""
    return (machine,) if machine.initial_state else machine.models


def _worst(
    machine: M, estimates: Sequence[ModelAccuracy[M]], tolerance: float | None = None, points: int = 1
) -> ModelAccuracy[M]:
    worst = max(estimates, key=lambda one: -1.0 if one.error is None else one.error)
    return ModelAccuracy(machine, worst.error, worst.unknown, tolerance, max(points, len(estimates)))


class _Runs:
    """Short runs from rest, each made once."""

    def __init__(self) -> None:
        self._peaks: dict[tuple[Any, int], Array | None] = {}

    def peaks(self, machine: Machine, cycles: int) -> Array | None:
        """Peak force of each cycle [N], on whatever surface; None if the run fails."""
        key = machine, cycles
        if key not in self._peaks:
            self._peaks[key] = _peaks(machine, cycles)
        return self._peaks[key]

    def estimate(self, machine: M) -> ModelAccuracy[M]:
        """Estimated error of a model at one operating point."""
        finer = machine.finer
        if finer is None:
            return ModelAccuracy(machine, None, machine.left_out or NO_FINER)
        own = self.peaks(machine, CYCLES)
        cycles = CYCLES if own is None or own.any() else PATIENT_CYCLES
        own, other = self.peaks(machine, cycles), self.peaks(finer, cycles)
        if own is None or other is None:
            return ModelAccuracy(machine, None, FAILS)
        if not (own.any() or other.any()):
            return ModelAccuracy(machine, None, NO_CONTACT)
        first = int(np.argmax((own > 0.0) | (other > 0.0)))
        rows = slice(first, first + CYCLES)
        apart, whole = np.abs(own - other)[rows].cumsum(), np.maximum(own, other)[rows].cumsum()
        alike = self._alike(machine, own, cycles)
        share = apart[-1] / whole[-1] if alike >= CYCLES else np.min((apart / whole)[: max(1, alike)])
        return ModelAccuracy(machine, SAFETY * float(share), machine.left_out)

    def _alike(self, machine: Machine, own: Array, cycles: int) -> int:
        """Number of cycles from the first contact on in which a small change of the clearance stays small."""
        gap = getattr(machine, machine.clearance_field)
        changed = self.peaks(machine.at(clearance=gap * (1.0 + SMALL)), cycles) if gap > 0.0 else own
        if changed is None:
            return 0
        rows = slice(int(np.argmax(own > 0.0)), None)
        grown = (np.abs(changed - own) > SMALL * GROWN * own)[rows][:CYCLES]
        return int(np.argmax(grown)) if grown.any() else CYCLES


def _peaks(machine: Machine, cycles: int) -> Array | None:
    arrays, surfaces = machine.arrays(cycles), np.zeros(3 * max(1, len(machine.joints)))
    try:
        outcome, _ = machine.run(np.zeros(machine.n_states), surfaces, arrays, machine.default_integrator)
    except (ChaosgymError, np.linalg.LinAlgError):
        return None
    return np.asarray(arrays.peak_force.max(axis=1)) if outcome == status.OK else None


def _percent(share: float) -> str:
    return f"{100.0 * share:.2g} %"
