"""Machines of many tests, with constants of their own.

Their constants are earlier fits to the thesis. They stay when the library's are fitted anew, since what these tests
claim, such as that two integrators agree on a chaotic motion, does not depend on them.
"""

from chaosgym.machines import ImpactBeam, SliderCrank

PLAIN_BEAM = ImpactBeam(
    width=17.58e-3,
    force_position=0.1809,
    pivot_rotational_stiffness=128.572,
    pivot_translational_stiffness=9.7e7,
    shaker_stiffness=510.0,
    shaker_damping=22.5,
    shaker_mass=0.089,
    damping_family="stiffness",
    n_modes=5,
    fitted_modes=0,
)
"""Natural modes alone and none fitted, as has the crank below."""

HARD_BEAM = ImpactBeam(
    width=0.02761151664658319,
    force_position=0.18567884341609547,
    pivot_rotational_stiffness=144.9738,
    pivot_translational_stiffness=18144014.029233065,
    shaker_stiffness=97.33696421978397,
    shaker_damping=57.46776610827452,
    shaker_mass=0.0,
    damping_family="beam",
)
"""On a pivot so hard that the tip bounces briefly: few bifurcations, and each alone."""

PLAIN_CRANK = SliderCrank(
    damping_ratio=0.027,
    damping_family="stiffness",
    damping_exponent=1.0,
    housing_mass=0.36,
    housing_inertia=3.922e-4,
    housing_offset_along=3e-3,
    yoke_mass=0.16,
    yoke_inertia=7.059e-4,
    yoke_offset_along=-8e-3,
    slider_mass=0.22,
    contact_stiffness=1.5e7,
    contact_damping_mass=0.0,
    ball_damping_mass=0.0,
    n_modes=3,
    fitted_modes=0,
    matrix_update_interval=1.0,
)
