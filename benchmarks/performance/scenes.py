"""Scenes of the slider crank: what each requires and costs.

Processor time of the thread counts, which other load on the computer hardly changes.
"""

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from chaosgym.core.binned.model import TaylorModel
from chaosgym.machines.slider_crank import SliderCrank
from chaosgym.simulation import simulate

_BALL = {"slider_joint": "ideal", "gravity": 9.81}
_BOTH_INSTRUMENTED = {"slider_joint": "instrumented", "ball_joint": "instrumented"}

SCENES: Mapping[str, Mapping[str, Any]] = {
    "planar, slider, rigid rod": {"rod": "rigid"},
    "planar, slider": {},
    "planar, slider, friction 0.1": {"friction_coefficient": 0.1},
    "planar, instrumented slider": {"slider_joint": "instrumented"},
    "planar, spherical ball, rigid rod": {**_BALL, "ball_joint": "spherical", "rod": "rigid"},
    "planar, spherical ball": {**_BALL, "ball_joint": "spherical"},
    "planar, instrumented ball": {**_BALL, "ball_joint": "instrumented"},
    "planar, both, spherical ball": {"ball_joint": "spherical"},
    "planar, both instrumented": _BOTH_INSTRUMENTED,
    "25 deg, slider": {"motor_angle": 25.0},
    "25 deg, instrumented slider": {"motor_angle": 25.0, "slider_joint": "instrumented"},
    "25 deg, both, spherical ball, rigid rod": {"motor_angle": 25.0, "ball_joint": "spherical", "rod": "rigid"},
    "25 deg, both, spherical ball": {"motor_angle": 25.0, "ball_joint": "spherical"},
    "25 deg, both instrumented": {"motor_angle": 25.0, **_BOTH_INSTRUMENTED},
}
"""Scenes of the slider crank: fields that differ from the machine of the thesis at 200 rpm."""


@dataclass(frozen=True)
class SceneCost:
    """What a scene of the slider crank requires.

    ``scene``; ``degrees_of_freedom`` names of what is integrated; ``method`` "exact" or "Taylor"; ``setup`` [s]
    until a machine is ready that was never seen; ``revolution`` [s] to compute a settled revolution. Both are
    processor time, which other load on the computer hardly changes.
    """

    scene: str
    degrees_of_freedom: tuple[str, ...]
    method: str
    setup: float
    revolution: float


def scene_costs(revolutions: int = 10) -> list[SceneCost]:
    """Cost of every scene of ``SCENES`` at 200 rpm and matrices held over 5 deg, on one core."""
    costs = []
    for scene, settings in SCENES.items():
        plain = {"n_modes": 3, "fitted_modes": 0, "matrix_update_interval": 5.0}
        crank = SliderCrank(**{"crank_speed": 200.0, **plain, **settings})
        # compile and load first, on a machine that shares nothing with the one that is timed
        simulate(replace(crank, rod_length=0.24), 1)
        start = time.thread_time()
        model = crank.reduce()
        setup = time.thread_time() - start
        state = simulate(crank, 5).final_state
        start = time.thread_time()
        simulate(crank, revolutions, state)
        revolution = (time.thread_time() - start) / revolutions
        method = "Taylor" if isinstance(model, TaylorModel) else "exact"
        costs.append(SceneCost(scene, crank.degrees_of_freedom, method, setup, revolution))
    return costs
