"""Where people wait beside the kernels: short questions in a running process, training, and memory of a batch.

All times are processor time, medians of runs in one process after one that is not counted.
"""

import statistics
import tempfile
import tracemalloc
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.performance.timing import processor_seconds
from chaosgym.classifier import classifier_for
from chaosgym.diagnosis import diagnose
from chaosgym.explore.point import orbit_diagram, sliders_of, view_of
from chaosgym.machines import ImpactBeam
from chaosgym.machines.accuracy import model_within
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate
from chaosgym.sweeps import SweepPlan, run_sweep
from chaosgym.sweeps.plan import default_axes

MACHINES, CYCLES, POINTS = 64, 10, 16


def waits(repeats: int = 5) -> dict[str, float]:
    """Measure what the impact beam's questions take.

    Returns
    -------
    dict
        By what is asked, microseconds of processor time; of ``memory``, bytes a machine.
    """
    beam = ImpactBeam()
    classifier = classifier_for(beam)
    low, high = zip(*(beam.usual_ranges[name] for name in (beam.speed_field, beam.clearance_field)), strict=True)
    random = np.random.default_rng(1)

    def others() -> list[ImpactBeam]:
        return [beam.at(*point) for point in random.uniform(low, high, (POINTS, 2)).tolist()]  # nothing is remembered

    def each(ask: Callable[[ImpactBeam], object]) -> float:
        return _median(lambda: [ask(other) for other in others()], repeats) / POINTS

    choose = partial(model_within, tolerance="1 %")

    def longer(other: ImpactBeam) -> ImpactBeam:
        return with_settings(other, {"length": beam.length * random.uniform(0.9, 1.1)})

    plan = SweepPlan(beam, default_axes(beam, "random"), "random", POINTS)

    def sweep() -> None:
        with tempfile.TemporaryDirectory() as folder:
            run_sweep(plan, Path(folder) / "sweep", workers=1)

    found = {
        "simulate one cycle": _median(lambda: simulate(beam, 1), 20 * repeats),
        "classify a random beam, nature": each(lambda other: classifier.classify(other, types=False)),
        "classify a random beam, types": each(lambda other: classifier.classify(other)),
        "diagnose a random beam": each(diagnose),
        "diagnose a random beam, budget 800": each(partial(diagnose, budget=800)),
        "model within 1 %, new speed": each(choose),
        "model within 1 %, new beam": each(lambda other: choose(longer(other))),
        "move of a slider in explore": each(view_of),
        "orbit diagram in explore": _median(lambda: list(orbit_diagram(beam, sliders_of(beam)[0])), repeats),
        "point of a sweep": _median(sweep, repeats) / POINTS,
    }
    batch: Any = beam.batch(MACHINES)
    for i in range(MACHINES):
        batch.start(i, beam)
    which, speeds = np.arange(MACHINES), np.random.default_rng(0).uniform(8.0, 30.0, (MACHINES, CYCLES))

    def own_speeds() -> None:
        batch.run_varied(which, speeds)

    found["cycle with deviation, a speed of its own"] = _median(own_speeds, repeats) / speeds.size
    found["cycle of ten at one speed"] = _median(lambda: batch.run(which, CYCLES), repeats) / speeds.size
    tracemalloc.start()
    kept = beam.batch(MACHINES)
    for i in range(MACHINES):
        kept.start(i, beam)
    found["memory, bytes a machine of a batch"] = tracemalloc.get_traced_memory()[0] / MACHINES
    tracemalloc.stop()
    return found


def _median(work: Callable[[], object], repeats: int) -> float:
    work()
    return 1e6 * statistics.median(processor_seconds(work) for _ in range(repeats))
