"""Runs for statements about the beam, beyond the peak forces of a settled response."""

import math
from typing import Any

import numpy as np
import scipy.signal

from chaosgym.arrays import Array
from chaosgym.machines import ImpactBeam, Machine
from chaosgym.machines.impact_beam.modes import modal_analysis
from chaosgym.series import two_step_test
from chaosgym.series.stroboscopic import find_recurrence, scales
from chaosgym.simulation import CycleRecord, simulate
from thesis.scorecard.observation import DOT, READING_ERROR, Effort, plotted_peaks

MOTION_CYCLES, MOTION_SAMPLES = 50, 4000
"""Cycles of a long history, and samples in each."""


def long_run(machine: Machine, cycles: int, start: int = 0) -> dict[str, Any]:
    """How long is a run irregular, from rest or another ``start``, and with which period does it end?

    ``start`` is as in ``Effort``.

    Returns
    -------
    dict
        ``irregular_cycles``: cycles before the plotted peaks repeat within the reading error, all if they never do;
        ``period`` that they repeat with, None if they don't; ``nature`` of the whole run by the Two-Step Test.
    """
    state = Effort(0, cycles, 0, start=start).initial_state(machine)
    peaks = plotted_peaks(simulate(machine, cycles, state))[:, None]
    nature = two_step_test(peaks, sensor_error=READING_ERROR).nature
    tail = peaks[-100:]
    scale = scales(tail)
    found = find_recurrence(tail / scale, READING_ERROR / scale)
    if found.period is None:
        return {"irregular_cycles": cycles, "period": None, "nature": nature}
    off = np.max(np.abs(peaks[: -found.period] - peaks[found.period :]), axis=1) > DOT
    last = np.flatnonzero(off)
    irregular = int(last[-1]) + 1 if len(last) else 0
    return {"irregular_cycles": irregular, "period": found.period, "nature": nature}


def follow_modes(record: CycleRecord) -> tuple[Array, Array, Array]:
    """Motion of the point where the shaker pushes a beam, from a record with a time history.

    The modes are driven once more by the shaker force and the contact force of the run, held linear between samples.

    Returns
    -------
    (displacement, velocity, tip)
        Of the force point [m, m/s], and displacement of the tip [m] by the same route; all (cycles * samples,).
    """
    beam = record.machine
    assert isinstance(beam, ImpactBeam)
    assert record.history is not None
    modes, time = modal_analysis(beam), record.time
    n = len(modes.tip_shape)
    shaker = beam.force_amplitude * np.sin(2.0 * math.pi * beam.excitation_frequency * time)
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(modes.angular_frequency**2), -modes.damping]])
    load = np.zeros((2 * n, 2))
    load[n:] = np.column_stack([modes.force_shape, -modes.tip_shape])
    output = np.zeros((3, 2 * n))
    output[0, :n] = output[1, n:] = modes.force_shape
    output[2, :n] = modes.tip_shape
    forces = np.column_stack([shaker, record.history[:, :, 2].ravel()])
    _, motion, _ = scipy.signal.lsim((system, load, output, np.zeros((3, 2))), forces, time, record.section[0])
    displacement, velocity, tip = np.ascontiguousarray(motion.T)
    return displacement, velocity, tip


def force_point_motion(beam: ImpactBeam, transient: int, cycles: int, samples: int = MOTION_SAMPLES) -> dict[str, Any]:
    """Range of displacement [m] and velocity [m/s] of the point where the shaker pushes a beam."""
    record = simulate(beam, cycles, transient=transient, samples_per_cycle=samples)
    displacement, velocity, tip = follow_modes(record)
    assert record.history is not None
    return {
        "displacement": [float(displacement.min()), float(displacement.max())],
        "velocity": [float(velocity.min()), float(velocity.max())],
        "tip_error": float(np.max(np.abs(tip - record.history[:, :, 0].ravel()))),
    }


def longest_bouncing(beam: ImpactBeam, transient: int) -> dict[str, float]:
    """Largest share of a stay on a sensor, from the first touch to the last release, that is bouncing: ``share``.

    Bouncing lasts from the first to the last touch of the stay; a stay ends where the other sensor is touched.
    """
    record = simulate(beam, MOTION_CYCLES, transient=transient, samples_per_cycle=MOTION_SAMPLES)
    assert record.history is not None
    return {"share": float(np.max(bouncing_shares(record.history[:, :, 2].ravel()), initial=0.0))}


def bouncing_shares(force: Array) -> Array:
    """Share of each whole stay on a sensor that is bouncing, from the contact force (samples,) [N], upward positive."""
    side = np.sign(force)
    begins = np.flatnonzero(np.diff(side, prepend=0.0) * side != 0.0)
    ends = np.flatnonzero(np.diff(side, append=0.0) * side != 0.0) + 1
    stays = np.split(np.arange(len(begins)), np.flatnonzero(np.diff(side[begins])) + 1)
    return np.array([(begins[s[-1]] - begins[s[0]]) / (ends[s[-1]] - begins[s[0]]) for s in stays[1:-1]])
