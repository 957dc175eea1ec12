"""Verdicts on machines: nature with proof, Types I, II and III over the tolerances, signs of chaos."""

from chaosgym.diagnosis.attractor import Attractor
from chaosgym.diagnosis.attractors import Attractors, attractors
from chaosgym.diagnosis.calm_region import CalmRegion, calm_region
from chaosgym.diagnosis.diagnose import diagnose
from chaosgym.diagnosis.lyapunov import largest_lyapunov_exponent, lyapunov_spectrum
from chaosgym.diagnosis.matrix_update import compare_attractors, compare_outcomes, matrix_update_test
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit, find_periodic_orbit
from chaosgym.diagnosis.precursors import bounce_fraction, precursors, predictive_criteria, signs_of_chaos
from chaosgym.diagnosis.response_map import ResponseMap, geometric_grid, response_map
from chaosgym.diagnosis.response_type import ResponseType, Tolerance, default_tolerances, response_type
from chaosgym.diagnosis.type_rule import Neighbour, judge_type, types_on_grid
from chaosgym.diagnosis.verdict import MachineDiagnosis

__all__ = [
    "Attractor",
    "Attractors",
    "CalmRegion",
    "MachineDiagnosis",
    "Neighbour",
    "PeriodicOrbit",
    "ResponseMap",
    "ResponseType",
    "Tolerance",
    "attractors",
    "bounce_fraction",
    "calm_region",
    "compare_attractors",
    "compare_outcomes",
    "default_tolerances",
    "diagnose",
    "find_periodic_orbit",
    "geometric_grid",
    "judge_type",
    "largest_lyapunov_exponent",
    "lyapunov_spectrum",
    "matrix_update_test",
    "precursors",
    "predictive_criteria",
    "response_map",
    "response_type",
    "signs_of_chaos",
    "types_on_grid",
]
