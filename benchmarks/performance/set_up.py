"""Time to make a slider crank ready to run."""

import statistics
import time
from dataclasses import replace

from chaosgym.machines.slider_crank import SliderCrank


def set_up_times(repeats: int = 5) -> dict[str, float]:
    """Microseconds of processor time with bins of 1 and 5 deg; each is the median of 5 ``repeats``.

    A new machine differs in more than speed and clearance; its first speed is included.
    """
    result = {}
    changes = range(1, 5 * repeats + 1)
    for interval in (1.0, 5.0):
        crank = SliderCrank(n_modes=3, fitted_modes=0, matrix_update_interval=interval)
        machines = {
            "new machine": [replace(crank, yoke_mass=0.16 + 1e-6 * k) for k in changes],
            "new speed": [replace(crank, crank_speed=200.0 + 1e-3 * k) for k in changes],
            "speed seen before": [replace(crank, slider_clearance=1e-6 * k) for k in changes],
        }
        crank.reduce()
        for name, each in machines.items():
            result[f"{name}, bins of {interval:g} deg"] = 1e6 * statistics.median(map(_time_to_reduce, each))
    return result


def _time_to_reduce(crank: SliderCrank) -> float:
    start = time.thread_time()
    crank.reduce()
    return time.thread_time() - start
