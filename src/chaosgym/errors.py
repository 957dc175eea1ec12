"""Every error that chaosgym raises on purpose, so that one ``except ChaosgymError`` catches them all."""

from collections.abc import Iterable


def nearest_or(otherwise: str, name: object, known: Iterable[str], *, alike: float = 0.6) -> str:
    """End of a message about an unknown name: the nearest known one, or what is said ``otherwise``.

    ``alike``, from 0 to 1, is how like it must be.

    Examples
    --------
    >>> from chaosgym.errors import nearest_or
    >>> nearest_or("allowed: speed, clearance", "sped", ["speed", "clearance"])
    'did you mean speed?'
    """
    from difflib import get_close_matches

    near = get_close_matches(str(name), list(known), n=1, cutoff=alike)
    return f"did you mean {near[0]}?" if near else otherwise


class ChaosgymError(Exception):
    """Base of all errors of this package; the message says what to do.

    Examples
    --------
    >>> try:
    ...     chaosgym.read_machine("missing.toml")
    ... except chaosgym.ChaosgymError as error:
    ...     print(error)
    missing.toml can't be read: No such file or directory
    """


class ParameterError(ChaosgymError, ValueError):
    """A parameter lies outside its allowed range; names the field, the value and the range.

    Examples
    --------
    >>> try:
    ...     chaosgym.ImpactBeam(clearance=-1e-4)
    ... except chaosgym.ParameterError as error:
    ...     print(error)
    clearance = -0.0001 m is out of range; allowed: 0 to 1 m
    """


class SimulationError(ChaosgymError, RuntimeError):
    """A simulation could not be finished: diverged, too many contact events, or a step too coarse.

    Examples
    --------
    >>> try:
    ...     chaosgym.simulate(chaosgym.ImpactBeam(), 5, integrator=chaosgym.ExactEvents(event_budget=2))
    ... except chaosgym.SimulationError as error:
    ...     print(str(error)[:40])
    one cycle needed more contact events tha
    """


class DiagnosisError(ChaosgymError, ValueError):
    """A response can't be judged: too few cycles, values that are not finite, or a wrong shape."""


class NoRecordingError(DiagnosisError):
    """A file is no recording: it holds no numbers, or is of no form that is known."""


class DatasetError(ChaosgymError, ValueError):
    """A dataset folder or file is missing, damaged, or belongs to another run."""


class UnfinishedError(ChaosgymError, RuntimeError):
    """A long computation stopped before its end: a full disk, a lost cluster. The same command goes on from there."""


class ModelFileError(ChaosgymError, ValueError):
    """A classifier or policy file is missing, damaged, or of another version."""


class DesignError(ChaosgymError, ValueError):
    """A design question can't be answered as asked: too few cycles, a wrong unit, or a criterion out of range."""
