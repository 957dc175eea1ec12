"""The shipped classifiers: the one of a machine, and a general one for machines that have none."""

from functools import lru_cache

from chaosgym.classifier.machine_classifier import NATURE, MachineClassifier
from chaosgym.classifier.storage import shipped_file
from chaosgym.errors import ModelFileError
from chaosgym.machines import MACHINES, Machine

GENERAL_CYCLES = 128
"""Cycles from rest after which a machine without a classifier is judged by its record."""


@lru_cache
def default_classifier(machine_name: str) -> MachineClassifier:
    """Return the classifier that is shipped for a machine.

    Raises
    ------
    ModelFileError
        If none is shipped for it.

    Examples
    --------
    >>> chaosgym.default_classifier("slider-crank").machine.name
    'slider-crank'
    """
    if not has_classifier(machine_name):
        raise ModelFileError(f"no classifier is shipped for {machine_name}; train one with `chaosgym train-classifier`")
    return MachineClassifier.load(shipped_file(machine_name))


def has_classifier(machine_name: str) -> bool:
    """Whether a classifier is shipped for a machine."""
    return shipped_file(machine_name).is_file()


def classifier_for(machine: Machine) -> MachineClassifier:
    """Return the classifier that is shipped for a machine, or else one for any machine with a gap.

    The general one takes proofs of periodic orbits, and reads peak forces as the classifier of ``MACHINES.general``
    does. It has no guess from parameters, and takes no measured records.

    Examples
    --------
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> chaosgym.classifier_for(beam).classify(beam).response_type
    'I'
    """
    try:
        return default_classifier(machine.name)
    except ModelFileError:
        pass
    nature = default_classifier(MACHINES.general).records[NATURE]
    return MachineClassifier(machine, {GENERAL_CYCLES: nature}, {}, {"fields": ()})
