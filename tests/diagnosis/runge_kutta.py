"""Any machine of modes with one gap by Runge-Kutta steps of order four, ended where a contact changes.

The equations are those of the model's matrices, written out; nothing is shared with the library's kernels, which
propagate each piece exactly, nor with ``tests.machines.referee``, which does so by matrix exponentials.
"""

import numpy as np
from numba import njit

PHASE = 0.05
"""Angle [rad] by which the fastest mode turns in a step: a state is missed by some millionths in a cycle, or less."""

HALVINGS = 50
GAP, CONTACT, DETACHED = 0, 1, 2


@njit(nogil=True)
def _margins(z, tip, stops, springs, dampers):
    """(depth [m], force [N]) of the stop that is deeper, and its side."""
    n = len(tip)
    x, v = 0.0, 0.0
    for i in range(n):
        x += tip[i] * z[i]
        v += tip[i] * z[n + i]
    above, below = x - stops[0], stops[1] - x
    if above >= below:
        return above, springs[0] * above + dampers[0] * v, 1.0
    return below, springs[1] * below - dampers[1] * v, -1.0


@njit(nogil=True)
def _slope(t, z, where, stiffness, damping, static, drive, omega, tip, stops, springs, dampers, out):
    n = len(tip)
    _, force, side = _margins(z, tip, stops, springs, dampers)
    push = side * force if where == CONTACT else 0.0
    for i in range(n):
        out[i] = z[n + i]
        pull = static[i] - stiffness[i] * z[i] - push * tip[i]
        for j in range(n):
            pull -= damping[i, j] * z[n + j]
        out[n + i] = pull
    for g in range(len(drive)):
        c, s = np.cos((g + 1) * omega * t), np.sin((g + 1) * omega * t)
        for i in range(n):
            out[n + i] += drive[g, 0, i] * c + drive[g, 1, i] * s


@njit(nogil=True)
def _step(t, z, h, where, given, work):
    """State a step later, in work[4]."""
    stiffness, damping, static, drive, omega, tip, stops, springs, dampers = given
    _slope(t, z, where, stiffness, damping, static, drive, omega, tip, stops, springs, dampers, work[0])
    for stage, share in ((1, 0.5), (2, 0.5), (3, 1.0)):
        for i in range(len(z)):
            work[5, i] = z[i] + share * h * work[stage - 1, i]
        _slope(
            t + share * h, work[5], where, stiffness, damping, static, drive, omega, tip, stops, springs, dampers,
            work[stage],
        )  # fmt: skip
    for i in range(len(z)):
        work[4, i] = z[i] + h / 6.0 * (work[0, i] + 2.0 * work[1, i] + 2.0 * work[2, i] + work[3, i])


@njit(nogil=True)
def _regime(z, where, given):
    """What follows on a regime at a state; the same where it goes on."""
    depth, force, _ = _margins(z, *given[5:])
    if where == GAP:
        return CONTACT if depth > 0.0 else GAP
    if where == CONTACT:
        return DETACHED if force < 0.0 else CONTACT
    return GAP if depth < 0.0 else CONTACT if force > 0.0 else DETACHED


@njit(nogil=True)
def _cycle(state, steps, given):
    z, work = state.copy(), np.empty((6, len(state)))
    h, t = 2.0 * np.pi / given[4] / steps, 0.0
    depth, force, _ = _margins(z, *given[5:])
    where = GAP if depth <= 0.0 else CONTACT if force > 0.0 else DETACHED
    for _ in range(steps):
        left = h
        for _ in range(100):
            _step(t, z, left, where, given, work)
            following = _regime(work[4], where, given)
            if following == where:
                break
            low, high = 0.0, left
            for _ in range(HALVINGS):
                middle = 0.5 * (low + high)
                _step(t, z, middle, where, given, work)
                if _regime(work[4], where, given) == where:
                    low = middle
                else:
                    high = middle
            _step(t, z, high, where, given, work)
            following = _regime(work[4], where, given)
            z[:] = work[4]
            t, left, where = t + high, left - high, following
        z[:] = work[4]
        t += left
    return z


class RungeKutta:
    """Follows a ``ModalImpactModel`` cycle by cycle."""

    def __init__(self, model):
        omega = 2.0 * np.pi * model.excitation_frequency
        drive = np.ascontiguousarray(model.drive[0] + omega**2 * model.drive[1])
        held = [np.ascontiguousarray(values, float) for values in (model.stiffness, model.damping, model.static_force)]
        tip, stops = np.ascontiguousarray(model.tip_shape, float), np.array(model.stops, float)
        springs, dampers = (np.array(v, float) for v in (model.contact_stiffness, model.contact_damping))
        self.given = (*held, drive, omega, tip, stops, springs, dampers)
        n = len(tip)
        rates = [omega * len(drive)]
        for k, d in zip(springs, dampers, strict=True):
            block = np.zeros((2 * n, 2 * n))
            block[:n, n:] = np.eye(n)
            block[n:, :n] = -np.diag(held[0]) - k * np.outer(tip, tip)
            block[n:, n:] = -held[1] - d * np.outer(tip, tip)
            rates.append(np.abs(np.linalg.eigvals(block)).max())
        self.steps = int(np.ceil(2.0 * np.pi / omega * max(rates) / PHASE))

    def after(self, state, cycles=1):
        """State after some cycles."""
        for _ in range(cycles):
            state = _cycle(np.asarray(state, float), self.steps, self.given)
        return state
