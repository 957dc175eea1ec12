"""How fast are the answers? Microseconds a question, rows a second, and what a simulation of the same point takes."""

import time
from collections.abc import Callable
from os import cpu_count
from statistics import median
from typing import Any

import numpy as np

from chaosgym.classifier.shipped import MachineClassifier
from chaosgym.diagnosis import two_step_test
from chaosgym.simulation import simulate

ROWS = 200_000
REPEATS = 200
TEST_CYCLES = 200
"""Settled cycles, after as many of transient, of the Two-Step Test that is compared with."""

RECORD_CYCLES = 50


def measure_speed(classifier: MachineClassifier, seed: int = 0) -> dict[str, Any]:
    """Time the classifier on this computer; medians of repeated calls.

    Returns
    -------
    dict
        ``query_us`` one machine; ``rows_per_second`` of a table, on ``threads``; ``record_us`` one record of 50
        cycles, features included; ``two_step_us`` simulating and judging the training machine; ``times_faster`` than
        that by parameters, and by a record with the simulation of its 50 cycles included, from the start of the run.
    """
    low, high = classifier.parameters.low_, classifier.parameters.high_
    values = np.random.default_rng(seed).uniform(low, high, (ROWS, len(low)))
    machine = classifier.machine
    query = _median(lambda: classifier.classify(machine), REPEATS)
    table = _median(lambda: classifier.parameters.predict_proba(values), 5)
    long = _median(lambda: two_step_test(simulate(machine, TEST_CYCLES, transient=TEST_CYCLES)), 5)
    found: dict[str, Any] = {
        "query_us": 1e6 * query,
        "rows_per_second": ROWS / table,
        "threads": cpu_count() or 1,
        "two_step_us": 1e6 * long,
        "times_faster": long / query,
    }
    if classifier.records is not None:
        peaks = simulate(machine, RECORD_CYCLES).peak_force[:, 0]
        record = _median(lambda: classifier.classify_record(peaks), REPEATS)
        short = _median(lambda: classifier.classify_record(simulate(machine, RECORD_CYCLES).peak_force[:, 0]), 5)
        found |= {
            "record_us": 1e6 * record,
            "cycles_saved": 2 * TEST_CYCLES - RECORD_CYCLES,
            "times_faster_by_record": long / short,
        }
    return found


def _median(call: Callable[[], object], repeats: int) -> float:
    call()
    seconds = []
    for _ in range(repeats):
        start = time.perf_counter()
        call()
        seconds.append(time.perf_counter() - start)
    return median(seconds)
