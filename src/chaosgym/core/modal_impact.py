r"""Exact motion of a machine of a few modes with one gap (``modal_model``), by the kernel of several joints.

The tables of the structure serve every speed, force and gap; those of the drive are added at the beginning of a run.
"""

import math

import numpy as np

from chaosgym.core.joints.cycle import advance_joints
from chaosgym.core.joints.run import JointRun, new_space, work_space
from chaosgym.core.joints.tables import MOST_LEVELS, ROW, layout, no_rubs, put_drive, put_structure
from chaosgym.core.kernel import njit
from chaosgym.core.lanes import aligned, unset
from chaosgym.core.modal_model import LOAD, LOWER_STOP, STOP, UPPER_STOP


@njit(cache=True)
def shortest_intervals(regimes, step_phase, drive_rate):
    """Shortest interval of each regime [s], in which neither its fastest mode nor the drive turns by more.

    Where neither turns, as of a rigid body alone, it is that of the fastest regime.
    """
    fastest = np.max(regimes.fastest)
    shortest = np.empty(regimes.fastest.shape[0])
    for r in range(shortest.shape[0]):
        rate = max(regimes.fastest[r], drive_rate)
        shortest[r] = step_phase / (rate if rate > 0.0 else fastest if fastest > 0.0 else 1.0)
    return shortest


@njit(cache=True)
def _lags(model):
    """Damper over spring [s] of the surface that presses in each regime, 0 where none, (R, 1)."""
    lags = np.zeros((model.regimes.generator.shape[0], 1))
    for stop in (UPPER_STOP, LOWER_STOP):
        lags[model.pressed[stop], 0] = model.contact_damping[stop - 1] / model.contact_stiffness[stop - 1]
    return lags


@njit(cache=True)
def tabulate(model, shortest):
    """``Tables.values`` of a model, for its number of harmonics and ``shortest`` intervals (R,) [s]."""
    regimes, lags, shape = model.regimes, _lags(model), model.tip_shape.reshape((1, model.tip_shape.size))
    count, n = lags.shape[0], model.tip_shape.size
    at, rubs = layout(n, model.drive.shape[1], 1, 0, MOST_LEVELS), no_rubs(n)
    values, constants = aligned(count * at[ROW]).reshape((count, at[ROW])), np.empty((1, 1))
    for r in range(count):
        constants[0, 0] = model.rest_penetration[r] if r > 0 else 0.0
        generator, to_modal, from_modal = regimes.generator[r], regimes.to_modal[r], regimes.from_modal[r]
        rest, drift = model.rest[r, STOP].reshape((1, 2 * n)), model.drift[r, STOP].reshape((1, 2 * n))
        put_structure(
            at, generator, to_modal, from_modal, shape, lags[r], shortest[r], rest, drift, constants, rubs, values[r]
        )
    return values


@njit(cache=True)
def make_run(model, step_phase, event_tolerance):
    """(Run, where the rows of its sets begin, weights of displacements) of a model, as ``advance_joints`` takes them.

    ``step_phase`` is the angle [rad] by which the fastest mode turns in the shortest interval, ``event_tolerance`` the
    error of an event's instant as such an angle. Tables are made anew if the model's are for another ``step_phase``
    or number of harmonics, or too slow for the drive.
    """
    omega = 2.0 * math.pi * model.excitation_frequency
    regimes, known, lags = model.regimes, model.tables.values, _lags(model)
    count, n, harmonics = lags.shape[0], model.tip_shape.size, model.drive.shape[1]
    at, rubs = layout(n, harmonics, 1, 0, MOST_LEVELS), no_rubs(n)
    slow = np.max(model.tables.shortest) * harmonics * omega > step_phase
    if slow or model.tables.step_phase != step_phase or known.shape[1] != at[ROW]:
        known = tabulate(model, shortest_intervals(regimes, step_phase, harmonics * omega))
    values, rows = unset(count * at[ROW]), np.empty(count, np.int64)
    shape, drive = model.tip_shape.reshape((1, n)), np.empty((harmonics, 2, n))
    for h in range(harmonics):
        for k in range(2):
            for i in range(n):
                drive[h, k, i] = model.drive[0, h, k, i] + omega * omega * model.drive[1, h, k, i]
    for r in range(count):
        rows[r] = r * at[ROW]
        row = values[rows[r] : rows[r] + at[ROW]]
        for i in range(at[ROW]):
            row[i] = known[r, i]
        generator, to_modal, from_modal = regimes.generator[r], regimes.to_modal[r], regimes.from_modal[r]
        rest, load = model.rest[r, LOAD], model.drift[r, LOAD]
        put_drive(at, generator, to_modal, from_modal, shape, lags[r], omega, drive, rest, load, rubs, row)
    at = work_space(at, np.full(1, count), np.empty(0, np.int64))
    stiffness, damping = model.contact_stiffness.reshape((1, 2)), model.contact_damping.reshape((1, 2))
    own = new_space(at, shape, model.stops.reshape((1, 2)), stiffness, damping, rubs.shape, np.empty((0, 4)))
    weights = np.empty(n)
    for i in range(n):
        weights[i] = model.stiffness[i] if model.stiffness[i] != 0.0 else omega * omega
    return JointRun(values, own, at, 1.0 / model.excitation_frequency, event_tolerance / step_phase), rows, weights


@njit(cache=True, nogil=True)
def advance_model(model, share, step_phase, event_tolerance, state, bouncing, arrays, event_budget, tangents):
    """Advance ``state`` (2n,) and ``bouncing`` (3,) in place, as ``advance_joints``: (status, first row not finished).

    Each row of ``arrays`` lasts a share of a cycle from phase zero of the drive. A kernel that Python calls must return
    plain numbers or arrays: numba has no guard against Ctrl-C while it makes a named tuple.
    """
    run, rows, weights = make_run(model, step_phase, event_tolerance)
    run = JointRun(run.tables, run.own, run.at, share * run.period, run.resolution)
    outcome = advance_joints(run, rows, weights, state, bouncing, arrays, event_budget, tangents)
    return outcome[0], outcome[1]
