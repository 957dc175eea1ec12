"""What kind of response is this? Tests take a ``CycleRecord`` or a plain array of one sample a cycle."""

from chaosgym.diagnosis.agreement import AgreementTable, agreement, random_machines
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.lyapunov import (
    LyapunovExponent,
    exponent_from_series,
    largest_lyapunov_exponent,
    lyapunov_spectrum,
    two_trajectory_exponent,
)
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
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
    "AgreementTable",
    "Diagnosis",
    "LyapunovExponent",
    "Nature",
    "Neighbour",
    "PeriodicOrbit",
    "Recurrence",
    "ResponseMap",
    "ResponseType",
    "Spectrum",
    "Status",
    "Tolerance",
    "Type",
    "agreement",
    "default_tolerances",
    "diagnose",
    "exponent_from_series",
    "find_periodic_orbit",
    "find_recurrence",
    "geometric_grid",
    "judge_type",
    "largest_lyapunov_exponent",
    "lyapunov_spectrum",
    "power_spectrum",
    "random_machines",
    "response_map",
    "response_type",
    "two_step_test",
    "two_trajectory_exponent",
    "types_on_grid",
    "zero_one_statistic",
]
