"""Runs for statements about the crank, beyond the peak forces of a settled response."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.design.peak_impacts import peak_impacts, worn_side
from chaosgym.design.statistics import cycles_needed
from chaosgym.diagnosis import matrix_update_test
from chaosgym.machines import SliderCrank
from chaosgym.simulation import simulate
from thesis.scorecard.observation import THOROUGH, plotted_peaks

ANGLE_SAMPLES, ANGLE_CYCLES = 3600, 10
"""Samples of crank angle in a revolution, and revolutions of which the median is taken."""

TRANSIENT, SHOWN, *_ = THOROUGH["slider-crank"]
"""Revolutions in which a response settles, and those shown of it (4.4.1)."""

CLOUD_CYCLES = 100
"""Revolutions of a Peak Impact Diagram."""


def crank_angles(crank: SliderCrank, transient: int) -> dict[str, float | None]:
    """At which crank angles [deg] of a revolution is contact lost and resumed?

    Returns
    -------
    dict
        ``loss`` and ``resumption``: ends of the longest gap in the contact force that begins in the first half
        revolution; ``settled``: end of the last gap that begins there; ``impact``: largest force within a quarter of
        a revolution after the loss. Medians over the revolutions that have a gap, as the thesis shows one
        "during which an impact occurs" (4.4.1, 4.4.2); None if none has. ``impulse_down`` and ``impulse_up``: largest
        force of either half revolution, medians over all.
    """
    record = simulate(crank, ANGLE_CYCLES, transient=transient, samples_per_cycle=ANGLE_SAMPLES)
    assert record.history is not None
    return median_angles(np.abs(record.history[:, :, 2]))


def median_angles(force: NDArray[np.float64]) -> dict[str, float | None]:
    """Crank angles of several revolutions, from the size of their contact force (revolutions, samples) [N]."""
    found = [revolution_angles(one) for one in force]
    known = {name: [one[name] for one in found if one[name] is not None] for name in found[0]}
    return {name: float(np.median(angles)) if angles else None for name, angles in known.items()}


def revolution_angles(force: NDArray[np.float64]) -> dict[str, Any]:
    """Crank angles of one revolution, from the size of its contact force (samples,); see ``crank_angles``."""
    degree = 360.0 / len(force)
    half = len(force) // 2
    impulses = {
        "impulse_down": degree * int(np.argmax(force[:half])),
        "impulse_up": degree * (half + int(np.argmax(force[half:]))),
    }
    # a gap that is open at 0 deg began in the half before and is none of this one
    free = np.concatenate([[True], force == 0.0, [False]])
    begins = np.flatnonzero(free[1:] & ~free[:-1])
    ends = np.flatnonzero(free[:-1] & ~free[1:])[-len(begins) :] if len(begins) else begins
    begins, ends = begins[begins < half], ends[: np.count_nonzero(begins < half)]
    if not len(begins):
        return {"loss": None, "resumption": None, "settled": None, "impact": None, **impulses}
    longest = int(np.argmax(ends - begins))
    loss = int(begins[longest])
    return {
        "loss": degree * loss,
        "resumption": degree * int(ends[longest]),
        "settled": degree * int(ends[-1]),
        "impact": degree * (loss + int(np.argmax(force[loss : loss + half // 2]))),
        **impulses,
    }


def contact_loss(crank: SliderCrank) -> dict[str, float]:
    """Mean share of a settled revolution without contact, over those that figures 4.8 and 4.9 show: ``lost``."""
    record = simulate(crank, SHOWN, transient=TRANSIENT)
    return {"lost": float(1.0 - record.contact_fraction.sum(axis=1).mean())}


def update_pair(crank: SliderCrank, first: float, second: float, cycles: int) -> dict[str, list[float]]:
    """Peak forces from rest with two intervals [deg] between matrix updates: ``first`` and ``second``."""
    runs = [simulate(replace(crank, matrix_update_interval=interval), cycles) for interval in (first, second)]
    peaks = [[float(peak) for peak in plotted_peaks(run)] for run in runs]
    return {"first": peaks[0], "second": peaks[1]}


def update_test(crank: SliderCrank, first: float, second: float) -> dict[str, str]:
    """Verdict of the Matrix Update Test with two intervals [deg]: ``nature`` and ``reason``."""
    verdict = matrix_update_test(crank, intervals=(first, second), transient=100)
    return {"nature": verdict.nature, "reason": verdict.reason}


def statistics(crank: SliderCrank) -> dict[str, int]:
    """Cycles that the mean and the standard deviation of the peak force need to converge: ``cycles``."""
    return {"cycles": int(cycles_needed(plotted_peaks(simulate(crank, 400, transient=TRANSIENT))))}


def bearing_spread(crank: SliderCrank) -> dict[str, float]:
    """Length of guide [m] or angle of ball joint [deg] over which the peak impacts spread: ``spread``."""
    record = simulate(crank, CLOUD_CYCLES, transient=TRANSIENT)
    return {"spread": peak_impacts(record, worn_side(record)).spread}
