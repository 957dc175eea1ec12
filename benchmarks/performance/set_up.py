"""Time to make a slider crank ready to run."""

import statistics
import time
from collections.abc import Iterable
from dataclasses import replace
from itertools import count, islice

from chaosgym.machines.binned.model import KEPT_BYTES, models_by_speed
from chaosgym.machines.slider_crank import SliderCrank

CRANKS = {
    "plain modes, 1 deg": SliderCrank(n_modes=3, fitted_modes=0, matrix_update_interval=1.0),
    "standard": SliderCrank(),
}


def set_up_times(repeats: int = 5) -> dict[str, float]:
    """Microseconds of processor time; each is the median of 5 ``repeats``.

    A new machine differs in more than speed and clearance; its first speed is included. New memory costs until as many
    tables are kept as there is room for; after that they take the place of old ones.
    """
    result: dict[str, float] = {}
    for name, crank in CRANKS.items():
        speeds = (replace(crank, crank_speed=200.0 + 1e-3 * k) for k in count(1))
        seen = (replace(crank, slider_clearance=1e-6 * k) for k in count(1))
        made = (replace(crank, yoke_mass=0.16 + 1e-6 * k) for k in count(1))
        if not result:
            crank.reduce()
            result[f"{name}: new speed in new memory"] = _median_time(speeds, 5 * repeats)
        table = models_by_speed(crank).at(crank.crank_speed).table
        for machine in islice(speeds, 2 * KEPT_BYTES // table.nbytes):
            machine.reduce()
        for what, machines in (("new machine", made), ("new speed", speeds), ("speed seen before", seen)):
            crank.reduce()
            result[f"{name}: {what}"] = _median_time(machines, 5 * repeats)
    return result


def _median_time(machines: Iterable[SliderCrank], repeats: int) -> float:
    return 1e6 * statistics.median(map(_time_to_reduce, islice(machines, repeats)))


def _time_to_reduce(crank: SliderCrank) -> float:
    start = time.thread_time()
    crank.reduce()
    return time.thread_time() - start
