"""Machines of many tests: the library's constants, with natural modes alone and none fitted."""

from chaosgym.machines import ImpactBeam, SliderCrank

PLAIN_BEAM = ImpactBeam(n_modes=5, fitted_modes=0)

PLAIN_CRANK = SliderCrank(n_modes=3, fitted_modes=0, matrix_update_interval=1.0)
