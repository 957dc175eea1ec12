r"""Exact motion of a machine of a few modes with one gap (``modal_model``), by the kernel of several joints.

The tables of the structure serve every speed, force and gap; those of the drive are added at the beginning of a run.
"""

import math

import numpy as np

from chaosgym.core.joints.cycle import advance_joints, room_for
from chaosgym.core.joints.space import JointRun, new_space, work_space
from chaosgym.core.joints.tables import MOST_LEVELS, ROW, layout, put_drive, put_structure
from chaosgym.core.kernel import njit
from chaosgym.core.lanes import aligned, unset
from chaosgym.core.modal_model import LOAD, LOWER_STOP, STOP, UPPER_STOP, Tables

ROUNDED = 1.0 + 1e-12
"""An interval that was made for a drive suits it, whatever rounding made of the quotient."""


@njit(cache=True)
def _lags(model):
    """Damper over spring [s] of the surface that presses in each regime, 0 where none, (R, 1)."""
    lags = np.zeros((model.regimes.generator.shape[0], 1))
    for stop in (UPPER_STOP, LOWER_STOP):
        lags[model.pressed[stop], 0] = model.contact_damping[stop - 1] / model.contact_stiffness[stop - 1]
    return lags


@njit(cache=True)
def tabulate(model, step_phase, drive_rate):
    """``Tables.shortest`` and ``Tables.values`` of a model, for its number of harmonics.

    In the shortest interval of a regime neither its fastest mode nor a drive at ``drive_rate`` [rad/s] turns by more
    than ``step_phase`` [rad]. Where neither turns, as of a rigid body alone, it is that of the fastest regime.
    """
    regimes, lags, shape = model.regimes, _lags(model), model.tip_shape.reshape((1, model.tip_shape.size))
    count, n, fastest = lags.shape[0], model.tip_shape.size, 0.0
    at, rubs, shortest = layout(n, model.drive.shape[1], 1, 0, MOST_LEVELS), None, np.empty(count)
    values, constants = aligned(count * at[ROW]).reshape((count, at[ROW])), np.empty((1, 1))
    for r in range(count):
        fastest = max(fastest, regimes.fastest[r])
    for r in range(count):
        rate = max(regimes.fastest[r], drive_rate)
        shortest[r] = step_phase / (rate if rate > 0.0 else fastest if fastest > 0.0 else 1.0)
        constants[0, 0] = model.rest_penetration[r] if r > 0 else 0.0
        generator, to_modal, from_modal = regimes.generator[r], regimes.to_modal[r], regimes.from_modal[r]
        rest, drift = model.rest[r, STOP].reshape((1, 2 * n)), model.drift[r, STOP].reshape((1, 2 * n))
        put_structure(
            at, generator, to_modal, from_modal, shape, lags[r], shortest[r], rest, drift, constants, rubs, values[r]
        )
    return shortest, values


@njit(cache=True)
def suits(model, tables, step_phase):
    """Whether tables of the structure serve a drive at this speed: they are for ``step_phase``, and not too slow."""
    longest = 0.0
    for r in range(tables.shortest.size):
        longest = max(longest, tables.shortest[r])
    rate = 2.0 * math.pi * model.excitation_frequency * model.drive.shape[1]
    return tables.step_phase == step_phase and longest * rate <= step_phase * ROUNDED


@njit(cache=True)
def put_speed(model, at, values, rows, weights):
    """Write the drive at the model's speed into tables of ``make_run``, and its ``weights``."""
    omega = 2.0 * math.pi * model.excitation_frequency
    regimes, lags, rubs = model.regimes, _lags(model), None
    n, harmonics = model.tip_shape.size, model.drive.shape[1]
    shape, drive = model.tip_shape.reshape((1, n)), np.empty((harmonics, 2, n))
    for h in range(harmonics):
        for k in range(2):
            for i in range(n):
                drive[h, k, i] = model.drive[0, h, k, i] + omega * omega * model.drive[1, h, k, i]
    for r in range(rows.size):
        row = values[rows[r] : rows[r] + at[ROW]]
        generator, to_modal, from_modal = regimes.generator[r], regimes.to_modal[r], regimes.from_modal[r]
        rest, load = model.rest[r, LOAD], model.drift[r, LOAD]
        put_drive(at, generator, to_modal, from_modal, shape, lags[r], omega, drive, rest, load, rubs, row)
    for i in range(n):
        weights[i] = model.stiffness[i] if model.stiffness[i] != 0.0 else omega * omega


@njit(cache=True)
def make_run(model, tables, step_phase):
    """``JointRun.tables``, ``own`` and ``at`` of a model, and ``rows`` and ``weights`` of ``advance_joints``.

    There is no number in these tables if those of the structure, ``tables``, are for another number of harmonics or do
    not suit the drive: ``tabulate`` makes others.
    """
    known, n, count = tables.values, model.tip_shape.size, model.regimes.generator.shape[0]
    at = layout(n, model.drive.shape[1], 1, 0, MOST_LEVELS)
    suit = known.shape[1] == at[ROW] and suits(model, tables, step_phase)
    values, rows, weights = unset(count * at[ROW] if suit else 0), np.empty(count, np.int64), np.empty(n)
    for r in range(count if suit else 0):
        rows[r] = r * at[ROW]
        for i in range(at[ROW]):
            values[rows[r] + i] = known[r, i]
    if suit:
        put_speed(model, at, values, rows, weights)
    radix = np.empty(1, np.int64)
    radix[0] = count
    at, shape = work_space(at, radix, np.empty(0, np.int64)), model.tip_shape.reshape((1, n))
    stiffness, damping = model.contact_stiffness.reshape((1, 2)), model.contact_damping.reshape((1, 2))
    own = new_space(at, shape, model.stops.reshape((1, 2)), stiffness, damping, np.empty((0, n)), np.empty((0, 4)))
    return values, own, at, rows, weights


@njit(cache=True)
def suited_run(model, step_phase):
    """As ``make_run``, for the model's own tables or, where these do not suit the drive, for others."""
    made = make_run(model, model.tables, step_phase)
    if made[0].size == 0:
        rate = 2.0 * math.pi * model.excitation_frequency * model.drive.shape[1]
        shortest, values = tabulate(model, step_phase, rate)
        made = make_run(model, Tables(step_phase, shortest, values), step_phase)
    return made


@njit(cache=True)
def advance_model(model, share, step_phase, event_tolerance, state, bouncing, arrays, event_budget, tangents):
    """Advance ``state`` (2n,) and ``bouncing`` (3,) in place, as ``advance_joints``: (status, first row not finished).

    Each row of ``arrays`` lasts a share of a cycle from phase zero of the drive. Python makes these calls one by one:
    numba compiles again what it links.
    """
    values, own, at, rows, weights = suited_run(model, step_phase)
    run = JointRun(values, own, at, share * (1.0 / model.excitation_frequency), event_tolerance / step_phase)
    kept = room_for(at, bouncing, tangents)
    outcome = advance_joints(run, rows, weights, state, bouncing, arrays, event_budget, tangents, kept, None)
    return outcome[0], outcome[1]
