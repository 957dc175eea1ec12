"""What kind of response is this? Tests take a ``CycleRecord`` or a plain array of one sample a cycle."""

from chaosgym.diagnosis.response import NATURES, STATUSES, TYPES, Diagnosis, Nature, Status, Type
from chaosgym.diagnosis.spectrum import Spectrum, power_spectrum
from chaosgym.diagnosis.stroboscopic import Recurrence, find_recurrence
from chaosgym.diagnosis.two_step import two_step_test
from chaosgym.diagnosis.zero_one import zero_one_statistic

__all__ = [
    "NATURES",
    "STATUSES",
    "TYPES",
    "Diagnosis",
    "Nature",
    "Recurrence",
    "Spectrum",
    "Status",
    "Type",
    "find_recurrence",
    "power_spectrum",
    "two_step_test",
    "zero_one_statistic",
]
