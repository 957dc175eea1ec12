"""Which runs do statements about the beam need, beyond the peak forces of a settled response?"""

import math
from typing import Any

import numpy as np
import scipy.signal

from chaosgym.atlas.observation import READING_ERROR
from chaosgym.diagnosis.stroboscopic import find_recurrence, scales
from chaosgym.machines import ImpactBeam, Machine
from chaosgym.simulation import simulate

MOTION_CYCLES, MOTION_SAMPLES = 50, 4000
"""Cycles of the motion of the force point, and samples in each."""


def long_run(machine: Machine, cycles: int) -> dict[str, Any]:
    """How long is a run from rest irregular, and with which period does it end?

    Returns
    -------
    dict
        ``irregular_cycles``: cycles before the peak forces repeat within the reading error, all if they never do;
        ``period`` that they repeat with, None if they don't.
    """
    peaks = simulate(machine, cycles).peak_force
    tail = peaks[-100:]
    scale = scales(tail)
    found = find_recurrence(tail / scale, READING_ERROR / scale)
    if found.period is None:
        return {"irregular_cycles": cycles, "period": None}
    off = np.max(np.abs(peaks[: -found.period] - peaks[found.period :]), axis=1) > 2.0 * READING_ERROR
    last = np.flatnonzero(off)
    return {"irregular_cycles": int(last[-1]) + 1 if len(last) else 0, "period": found.period}


def force_point_motion(beam: ImpactBeam, transient: int) -> dict[str, Any]:
    """Range of displacement [m] and velocity [m/s] of the point where the shaker pushes a beam.

    The modes are driven once more by the shaker force and the contact force of the run, held linear between samples.
    """
    record = simulate(beam, MOTION_CYCLES, transient=transient, samples_per_cycle=MOTION_SAMPLES)
    assert record.history is not None
    model = beam.reduce()
    n = beam.n_modes
    time = np.arange(MOTION_CYCLES * MOTION_SAMPLES) * (beam.cycle_period / MOTION_SAMPLES)
    shaker = beam.force_amplitude * np.sin(2.0 * math.pi * beam.excitation_frequency * time)
    contact = record.history[:, :, 2].ravel()
    system = np.block([[np.zeros((n, n)), np.eye(n)], [-np.diag(model.stiffness), -model.damping]])
    load = np.zeros((2 * n, 2))
    load[n:] = np.column_stack([model.force_shape, -model.tip_shape])
    output = np.zeros((3, 2 * n))
    output[0, :n] = output[1, n:] = model.force_shape
    output[2, :n] = model.tip_shape
    _, motion, _ = scipy.signal.lsim(
        (system, load, output, np.zeros((3, 2))), np.column_stack([shaker, contact]), time, record.section[0]
    )
    tip_error = float(np.max(np.abs(motion[:, 2] - record.history[:, :, 0].ravel())))
    return {
        "displacement": [float(motion[:, 0].min()), float(motion[:, 0].max())],
        "velocity": [float(motion[:, 1].min()), float(motion[:, 1].max())],
        "tip_error": tip_error,
    }
