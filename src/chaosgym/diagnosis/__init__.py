"""Tests of a response: periodic, quasiperiodic or chaotic; they take a ``CycleRecord`` or one sample a cycle."""

from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.lyapunov import (
    LyapunovExponent,
    exponent_from_series,
    largest_lyapunov_exponent,
    lyapunov_spectrum,
)
from chaosgym.diagnosis.matrix_update import compare_attractors, compare_outcomes, matrix_update_test
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.diagnosis.precursors import bounce_fraction, precursors, predictive_criteria, signs_of_chaos
from chaosgym.diagnosis.response import TYPES, Diagnosis, Nature, Type
from chaosgym.diagnosis.response_map import ResponseMap, geometric_grid, response_map
from chaosgym.diagnosis.response_type import ResponseType, Tolerance, default_tolerances, response_type
from chaosgym.diagnosis.section_shape import section_shape
from chaosgym.diagnosis.spectrum import power_spectrum
from chaosgym.diagnosis.two_step import two_step_test
from chaosgym.diagnosis.type_rule import Neighbour, judge_type, types_on_grid
from chaosgym.diagnosis.zero_one import zero_one_statistic

__all__ = [
    "TYPES",
    "Diagnosis",
    "LyapunovExponent",
    "Nature",
    "Neighbour",
    "PeriodicOrbit",
    "ResponseMap",
    "ResponseType",
    "Tolerance",
    "Type",
    "bounce_fraction",
    "compare_attractors",
    "compare_outcomes",
    "default_tolerances",
    "diagnose",
    "exponent_from_series",
    "find_periodic_orbit",
    "geometric_grid",
    "judge_type",
    "largest_lyapunov_exponent",
    "lyapunov_spectrum",
    "matrix_update_test",
    "power_spectrum",
    "precursors",
    "predictive_criteria",
    "response_map",
    "response_type",
    "section_shape",
    "signs_of_chaos",
    "two_step_test",
    "types_on_grid",
    "zero_one_statistic",
]
