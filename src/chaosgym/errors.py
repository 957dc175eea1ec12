"""Every error that chaosgym raises on purpose, so that one ``except ChaosgymError`` catches them all."""


class ChaosgymError(Exception):
    """Base of all errors of this package; the message says what to do."""


class ParameterError(ChaosgymError, ValueError):
    """A parameter lies outside its allowed range; names the field, the value and the range."""


class SimulationError(ChaosgymError, RuntimeError):
    """A simulation could not be finished: diverged, too many contact events, or a step too coarse."""


class DiagnosisError(ChaosgymError, ValueError):
    """A response can't be judged: too few cycles, values that are not finite, or a wrong shape."""


class DatasetError(ChaosgymError, ValueError):
    """A dataset folder or file is missing, damaged, or belongs to another run."""


class UnfinishedError(ChaosgymError, RuntimeError):
    """A long computation stopped before its end: a full disk, a lost cluster. The same command goes on from there."""


class ModelFileError(ChaosgymError, ValueError):
    """A classifier or policy file is missing, damaged, or of another version."""


class DesignError(ChaosgymError, ValueError):
    """A design question can't be answered as asked: too few cycles, a wrong unit, or a criterion out of range."""
