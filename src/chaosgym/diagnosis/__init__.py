"""What kind of response is this? Tests take a ``CycleRecord`` or a plain array of one sample a cycle."""

from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.response import NATURES, STATUSES, TYPES, Diagnosis, Nature, Status, Type
from chaosgym.diagnosis.response_type import (
    Neighbour,
    ResponseMap,
    ResponseType,
    Tolerance,
    default_tolerances,
    geometric_grid,
    judge_type,
    response_map,
    response_type,
    types_on_grid,
)
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
    "Neighbour",
    "Recurrence",
    "ResponseMap",
    "ResponseType",
    "Spectrum",
    "Status",
    "Tolerance",
    "Type",
    "default_tolerances",
    "diagnose",
    "find_recurrence",
    "geometric_grid",
    "judge_type",
    "power_spectrum",
    "response_map",
    "response_type",
    "two_step_test",
    "types_on_grid",
    "zero_one_statistic",
]
