r"""Exact motion of a few modes whose tip rattles between two stops.

Between contact events the beam is linear (thesis 3.3): mass-normalised modes q with

    q'' + D q' + diag(w_i^2) q = phi_f F sin(w t) - phi_t (N_upper - N_lower)

and the tip at x = phi_t . q. The tip is in one of three states, each with its own event functions e(t) > 0:

    GAP        inside the gap, no force               e = c - x   and   e = c + x
    CONTACT    surface s = +-1 pushes with N > 0      e = N = k (s x - c) + d s x'
    DETACHED   beyond surface s, which would pull     e = s x - c   and   e = -N

GAP and DETACHED share the free regime; CONTACT has its own, since k and d act at the tip. Motion is propagated
exactly within a regime (``propagator``), so the only error is in the instant at which e vanishes, and that is
polished to ``event_tolerance``. No event is missed: a step is taken only if a bound of e'' shows that e keeps its
sign, or else it is as short as the fastest mode requires and is searched for a dip as well as for a change of sign.
Modes that have died down to ``NEGLIGIBLE`` require nothing.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.contact import pressing_force
from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.kernel import leaf
from chaosgym.core.propagator import Regimes, move, nudge, safe_time, step_table, with_force
from chaosgym.core.tangent import carry, orthonormalise, touch

FREE, PRESSED = 0, 1
GAP, CONTACT, DETACHED = 0, 1, 2

MAX_STEP_LEVELS = 64
"""Exact steps come in lengths h, 2h, 4h ... up to a cycle."""

STEPS_PER_EVENT = 1000
"""Steps that one cycle may take for each event that it may have."""

NEGLIGIBLE = 1e-9
"""Share of the bounds of the tip's second and third derivative below which a mode does not shorten the steps."""

NUDGE_LIMIT = 0.02
"""Largest angle [rad] of the fastest mode that a Taylor series bridges: its error is below 1e-12."""

CREST_STEPS = 2.0
"""Longest step, in steps of ``step_phase``, whose cubic still shows a crest of the contact force."""

MAX_POLISH = 60
"""Iterations to polish one event; safeguarded Newton needs two or three, bisection about fifty."""


class ModalImpactModel(NamedTuple):
    """All that the kernels know of an impact beam with n modes.

    Attributes
    ----------
    excitation_frequency [Hz], force_amplitude [N], clearance [m] (half gap), contact_stiffness [N/m],
    contact_damping [N s/m] : float
    stiffness : (n,)
        Squared natural angular frequencies of the free beam [1/s^2].
    damping : (n, n)
        Modal damping of the free beam [1/s].
    tip_shape, force_shape : (n,)
        Mass-normalised mode shapes at the tip and at the point of the force [kg^-1/2].
    regimes : Regimes
        FREE and PRESSED (one surface acts on the tip).
    rest : (2n,)
        PRESSED modal coordinates of the position of rest with unit clearance and the upper surface pressing.
    rest_penetration : float
        Penetration at that position per unit clearance; negative, since the surface would have to pull there.
    """

    excitation_frequency: float
    force_amplitude: float
    clearance: float
    contact_stiffness: float
    contact_damping: float
    stiffness: np.ndarray
    damping: np.ndarray
    tip_shape: np.ndarray
    force_shape: np.ndarray
    regimes: Regimes
    rest: np.ndarray
    rest_penetration: float


@njit(cache=True, inline="always")
def tip_of_state(model, state):
    """Tip displacement and velocity of a modal state (2n,)."""
    n = model.tip_shape.shape[0]
    x, v = 0.0, 0.0
    for i in range(n):
        x += model.tip_shape[i] * state[i]
        v += model.tip_shape[i] * state[n + i]
    return x, v


@njit(cache=True, inline="always")
def tip_state_of(model, x, v):
    """Which of the three states holds, and the side, for tip displacement x and velocity v."""
    if abs(x) <= model.clearance:
        return GAP, 1.0
    side = 1.0 if x > 0.0 else -1.0
    force = pressing_force(side * x - model.clearance, side * v, model.contact_stiffness, model.contact_damping)
    return (CONTACT, side) if force > 0.0 else (DETACHED, side)


@njit(cache=True, inline="always")
def origin_shift(model, tip_state, side):
    """What to add to the modal output so that tip motion is measured from mid gap (GAP) or from the surface."""
    if tip_state == GAP:
        return 0.0
    if tip_state == CONTACT:
        return side * model.clearance * model.rest_penetration
    return -side * model.clearance


@njit(cache=True, inline="always")
def tip_motion(output, r, u, shift):
    """Tip displacement, velocity and acceleration for modal coordinates u."""
    x, v, a = shift, 0.0, 0.0
    for j in range(u.shape[0]):
        x += output[r, 0, j] * u[j]
        v += output[r, 1, j] * u[j]
        a += output[r, 2, j] * u[j]
    return x, v, a


@njit(cache=True, inline="always")
def pressing(model, side, x, v, a):
    """Force of surface ``side`` and its rate, from tip motion measured from that surface; negative where it pulls."""
    force = pressing_force(side * x, side * v, model.contact_stiffness, model.contact_damping)
    force_rate = pressing_force(side * v, side * a, model.contact_stiffness, model.contact_damping)
    return force, force_rate


@njit(cache=True, inline="always")
def event_functions(model, tip_state, side, x, v, a):
    """(e1, its slope, e2, its slope); e2 is infinite where there is only one."""
    if tip_state == GAP:
        return model.clearance - x, -v, model.clearance + x, v
    force, force_rate = pressing(model, side, x, v, a)
    if tip_state == CONTACT:
        return force, force_rate, math.inf, 0.0
    return side * x, side * v, -force, -force_rate


@njit(cache=True, inline="always")
def curvature_bounds(model, magnitude, tip_state, r, u):
    """Bounds of the second derivatives of e1 and e2 from now on."""
    size2 = 0.0
    for j in range(u.shape[0]):
        size2 += magnitude[r, 0, j] * abs(u[j])
    if tip_state == GAP:
        return size2, size2
    size3 = 0.0
    for j in range(u.shape[0]):
        size3 += magnitude[r, 1, j] * abs(u[j])
    force_curvature = model.contact_stiffness * size2 + model.contact_damping * size3
    return (force_curvature, 0.0) if tip_state == CONTACT else (size2, force_curvature)


@njit(cache=True, inline="always")
def matters(model, regimes, tip_state, r, j, u, curvature1, curvature2):
    """True if modal coordinate j has a share in the bounds of e'' that is not ``NEGLIGIBLE``."""
    size2, size3 = regimes.magnitude[r, 0, j] * abs(u[j]), regimes.magnitude[r, 1, j] * abs(u[j])
    force_curvature = model.contact_stiffness * size2 + model.contact_damping * size3
    if tip_state == CONTACT:
        return force_curvature > NEGLIGIBLE * curvature1
    return size2 > NEGLIGIBLE * curvature1 or (tip_state == DETACHED and force_curvature > NEGLIGIBLE * curvature2)


@leaf
def rate_that_matters(model, regimes, tip_state, r, u, curvature1, curvature2, slowest):
    """Rate [1/s] of the fastest modal coordinate that ``matters``, at least ``slowest``."""
    rate = slowest
    for j in range(u.shape[0]):
        if regimes.modulus[r, j] > rate and matters(model, regimes, tip_state, r, j, u, curvature1, curvature2):
            rate = regimes.modulus[r, j]
    return rate


@leaf
def suspect(e0, d0, e1, d1, h, doubt):
    """End of the interval in (0, h] where e may have fallen to zero, or -1 if it surely has not.

    ``doubt`` bounds the distance of e from the cubic through both ends.
    """
    if e1 <= 0.0:
        return h
    dip = cubic_extremum(e0, d0, e1, d1, h, 1.0)
    if dip > 0.0 and cubic(e0, d0, e1, d1, h, dip)[0] <= doubt:
        return dip
    return -1.0


@leaf
def locate(model, regimes, tip_state, side, which, u, moved, h, until, safe, e0, d0, e1, d1, fastest, tolerance):
    """Instant in [safe, until] at which event function ``which`` falls to zero, or inf if it only comes close.

    Leaves the state of that instant in ``moved``. The first guess is the root of the cubic through both ends of the
    step; then Newton's method on the exact motion, kept inside a shrinking bracket. ``fastest`` is the rate of the
    fastest mode that matters, ``tolerance`` an angle of it.
    """
    r = PRESSED if tip_state == CONTACT else FREE
    shift = origin_shift(model, tip_state, side)
    low, high = min(safe, until), until
    if until < h:
        # a dip between two positive ends: find its lowest point first
        t = until
        for _ in range(MAX_POLISH):
            move(regimes, r, u, t, moved)
            x, v, a = tip_motion(regimes.output, r, moved, shift)
            f1, k1, f2, k2 = event_functions(model, tip_state, side, x, v, a)
            e, slope = (f1, k1) if which == 1 else (f2, k2)
            if e <= 0.0:
                break
            after = cubic(e0, d0, e1, d1, h, min(t + 1e-3 * h, h))[1]
            before = cubic(e0, d0, e1, d1, h, max(t - 1e-3 * h, 0.0))[1]
            bend = (after - before) / (min(t + 1e-3 * h, h) - max(t - 1e-3 * h, 0.0))
            if bend <= 0.0 or slope * slope < 2.0 * bend * e * 0.25:
                return math.inf
            t = min(max(t - slope / bend, 0.0), h)
        else:
            return math.inf
        high = t
        low = min(low, high)
    t_low, t_high = low, high
    t = 0.5 * (low + high)
    for _ in range(8):
        value, slope = cubic(e0, d0, e1, d1, h, t)
        if value > 0.0:
            t_low = t
        else:
            t_high = t
        t = t - value / slope if slope < 0.0 else 0.5 * (t_low + t_high)
        if not t_low <= t <= t_high:
            t = 0.5 * (t_low + t_high)
    move(regimes, r, u, t, moved)
    for _ in range(MAX_POLISH):
        x, v, a = tip_motion(regimes.output, r, moved, shift)
        f1, k1, f2, k2 = event_functions(model, tip_state, side, x, v, a)
        e, slope = (f1, k1) if which == 1 else (f2, k2)
        if e > 0.0:
            low = t
        else:
            high = t
        change = -e / slope if slope < 0.0 else math.inf
        if not low <= t + change <= high:
            change = 0.5 * (low + high) - t
        if abs(change) * fastest <= tolerance:
            break
        t += change
        if abs(change) * regimes.fastest[r] <= NUDGE_LIMIT:
            nudge(regimes, r, moved, change)
        else:
            move(regimes, r, u, t, moved)
    return t


@leaf
def crest(model, regimes, side, u, moved, h, f0, r0, f1, r1, peak):
    """Largest force of a step that starts rising and ends falling, if it exceeds ``peak``; else ``peak``."""
    t = cubic_extremum(f0, r0, f1, r1, h, -1.0)
    if t < 0.0 or cubic(f0, r0, f1, r1, h, t)[0] <= 0.999 * peak:
        return peak
    move(regimes, PRESSED, u, t, moved)
    x, v, a = tip_motion(regimes.output, PRESSED, moved, origin_shift(model, CONTACT, side))
    force, rate = pressing(model, side, x, v, a)
    bend = (r1 - r0) / h
    return max(peak, force - 0.5 * rate * rate / bend)


@leaf
def sample_motion(model, regimes, tip_state, side, u, moved, time, sample):
    """Write tip displacement, velocity and contact force (upward force of the tip positive) at ``time``."""
    r = PRESSED if tip_state == CONTACT else FREE
    move(regimes, r, u, time, moved)
    x, v, a = tip_motion(regimes.output, r, moved, origin_shift(model, tip_state, side))
    sample[0] = x if tip_state == GAP else x + side * model.clearance
    sample[1] = v
    sample[2] = side * max(0.0, pressing(model, side, x, v, a)[0]) if tip_state == CONTACT else 0.0


@leaf
def enter_regime(model, regimes, tip_state, side, state, cosine, sine, u):
    """Modal coordinates u of a physical state at a phase of the force."""
    r = PRESSED if tip_state == CONTACT else FREE
    n2 = state.shape[0]
    for i in range(n2):
        total = regimes.to_modal[r, i, n2] * cosine + regimes.to_modal[r, i, n2 + 1] * sine
        for j in range(n2):
            total += regimes.to_modal[r, i, j] * state[j]
        u[i] = total - side * model.clearance * model.rest[i] if r == PRESSED else total
    u[n2], u[n2 + 1] = cosine, sine


@leaf
def leave_regime(model, regimes, tip_state, side, u, state):
    """Physical state of modal coordinates u; u is overwritten."""
    r = PRESSED if tip_state == CONTACT else FREE
    n2 = state.shape[0]
    if r == PRESSED:
        for i in range(n2):
            u[i] += side * model.clearance * model.rest[i]
    for i in range(n2):
        total = 0.0
        for j in range(n2 + 2):
            total += regimes.from_modal[r, i, j] * u[j]
        state[i] = total


@njit(cache=True, nogil=True)
def advance(model, state, episode, arrays, step_phase, event_tolerance, event_budget, tangents=None):
    """Advance ``state`` (2n,) and ``episode`` in place by whole cycles, one for each row of ``arrays``.

    Every cycle starts at phase zero of the force. ``step_phase`` is the angle [rad] by which the fastest mode that
    matters turns in a step that may hide an event, ``event_tolerance`` the error of an event's instant as such an
    angle. ``tangents`` travel with the motion; None compiles to a kernel without them.

    Returns
    -------
    (status, cycle) : the cycle is the first one not finished.
    """
    n2 = state.shape[0]
    blocks = n2 // 2 + 1
    omega = 2.0 * math.pi * model.excitation_frequency
    period = 1.0 / model.excitation_frequency
    regimes = with_force(model.regimes, model.force_amplitude, omega)
    output, magnitude = regimes.output, regimes.magnitude
    shortest = step_phase / regimes.fastest
    levels = min(MAX_STEP_LEVELS, 2 + max(0, int(math.log2(period / np.min(shortest)))))
    table = step_table(regimes, shortest, levels)
    top = (np.argmax(regimes.modulus[FREE]), np.argmax(regimes.modulus[PRESSED]))
    step_budget = STEPS_PER_EVENT * event_budget
    # error of a cubic through both ends of a step: max e'''' h^4 / 384 <= max e'' (fastest h)^2 h^2 / 384
    doubt = step_phase * step_phase / 384.0
    samples = arrays.history.shape[1]
    u = np.empty(n2 + 2)
    moved = np.empty(n2 + 2)
    spare = np.empty(n2 + 2)

    for cycle in range(arrays.section.shape[0]):
        x, v = tip_of_state(model, state)
        arrays.section[cycle] = state
        arrays.tip[cycle, 0], arrays.tip[cycle, 1] = x, v
        for column in range(2):
            arrays.peak_force[cycle, column] = 0.0
            arrays.impacts[cycle, column] = 0
            arrays.contact_time[cycle, column] = 0.0
            arrays.bounce_time[cycle, column] = 0.0
        events, steps = 0, 0
        sample = 0
        time = 0.0
        carried = 0.0
        if tangents is not None:
            vectors, growth = tangents.vectors, tangents.log_growth[cycle]
            growth[:] = 0.0
        tip_state, side = tip_state_of(model, x, v)
        r = PRESSED if tip_state == CONTACT else FREE
        enter_regime(model, regimes, tip_state, side, state, 1.0, 0.0, u)
        x, v, a = tip_motion(output, r, u, origin_shift(model, tip_state, side))

        while True:
            e1, d1, e2, d2 = event_functions(model, tip_state, side, x, v, a)
            curvature1, curvature2 = curvature_bounds(model, magnitude, tip_state, r, u)
            safe1 = safe_time(e1, d1, curvature1)
            safe2 = safe_time(e2, d2, curvature2) if tip_state != CONTACT else math.inf
            safe = min(safe1, safe2)
            column = UPPER if side > 0.0 else LOWER
            # go on while nothing can happen, and while no new peak can hide inside the step; otherwise by steps in
            # which the fastest mode that matters shows its events and crests
            reach, peakless = safe, math.inf
            if tip_state == CONTACT:
                peak = max(arrays.peak_force[cycle, column], e1)
                arrays.peak_force[cycle, column] = peak
                peakless = safe_time(peak - e1, -d1, curvature1)
                reach = min(safe, peakless)
            fastest = regimes.fastest[r]
            if reach < CREST_STEPS * shortest[r]:
                if not matters(model, regimes, tip_state, r, top[r], u, curvature1, curvature2):
                    fastest = rate_that_matters(model, regimes, tip_state, r, u, curvature1, curvature2, omega)
                least = step_phase / fastest
                reach = max(least, min(safe, CREST_STEPS * least)) if tip_state == CONTACT else max(reach, least)

            # step
            steps += 1
            if steps > step_budget:
                return status.STEP_BUDGET, cycle
            h, level = shortest[r], 0
            while level + 1 < levels and 2.0 * h <= reach:
                h *= 2.0
                level += 1
            last = max(h, reach) >= period - time
            if last:
                h = period - time
                move(regimes, r, u, h, moved)
            else:
                for j in range(blocks):
                    u1, u2 = u[2 * j], u[2 * j + 1]
                    moved[2 * j] = table[r, level, 0, j] * u1 + table[r, level, 1, j] * u2
                    moved[2 * j + 1] = table[r, level, 2, j] * u1 + table[r, level, 3, j] * u2
            x1, v1, a1 = tip_motion(output, r, moved, origin_shift(model, tip_state, side))

            # did an event happen on the way?
            event = 0
            if h > safe:
                g1, k1, g2, k2 = event_functions(model, tip_state, side, x1, v1, a1)
                until1 = suspect(e1, d1, g1, k1, h, doubt * curvature1 * h * h) if h > safe1 else -1.0
                until2 = suspect(e2, d2, g2, k2, h, doubt * curvature2 * h * h) if h > safe2 else -1.0
                instant = math.inf
                if until1 >= 0.0:
                    instant = locate(
                        model,
                        regimes,
                        tip_state,
                        side,
                        1,
                        u,
                        spare,
                        h,
                        until1,
                        safe1,
                        e1,
                        d1,
                        g1,
                        k1,
                        fastest,
                        event_tolerance,
                    )
                    if instant < math.inf:
                        event = 1
                        moved[:] = spare
                if until2 >= 0.0:
                    instant2 = locate(
                        model,
                        regimes,
                        tip_state,
                        side,
                        2,
                        u,
                        spare,
                        h,
                        until2,
                        safe2,
                        e2,
                        d2,
                        g2,
                        k2,
                        fastest,
                        event_tolerance,
                    )
                    if instant2 < instant:
                        event, instant = 2, instant2
                        moved[:] = spare
                if event:
                    h, last = instant, False
                    x1, v1, a1 = tip_motion(output, r, moved, origin_shift(model, tip_state, side))

            # record the step
            while sample < samples and sample * period < (time + h) * samples:
                sample_motion(
                    model,
                    regimes,
                    tip_state,
                    side,
                    u,
                    spare,
                    sample * period / samples - time,
                    arrays.history[cycle, sample],
                )
                sample += 1
            if tip_state == CONTACT:
                arrays.contact_time[cycle, column] += h
                f1, r1 = pressing(model, side, x1, v1, a1)
                peak = max(arrays.peak_force[cycle, column], f1)
                if h > peakless and d1 > 0.0 and r1 < 0.0:
                    peak = crest(model, regimes, side, u, spare, h, e1, d1, f1, r1, peak)
                arrays.peak_force[cycle, column] = peak
            time += h
            u, moved = moved, u
            x, v, a = x1, v1, a1
            if last:
                break
            if event == 0:
                continue

            # the tip changes its state
            events += 1
            if events > event_budget:
                return status.EVENT_BUDGET, cycle
            cosine, sine = math.cos(omega * time), math.sin(omega * time)
            leave_regime(model, regimes, tip_state, side, u, state)
            if tangents is not None:
                if not (tip_state == DETACHED and event == 1):
                    carry(model.stiffness, regimes, r, time - carried, vectors, growth, spare)
                    carried = time
                if tip_state == GAP:
                    touch(model.tip_shape, model.contact_damping, vectors)
            if tip_state == GAP:
                side = 1.0 if event == 1 else -1.0
                tip_state = CONTACT
            elif tip_state == CONTACT:
                tip_state = DETACHED
            else:
                tip_state = GAP if event == 1 else CONTACT
            r = PRESSED if tip_state == CONTACT else FREE
            enter_regime(model, regimes, tip_state, side, state, cosine, sine, u)
            x, v, a = tip_motion(output, r, u, origin_shift(model, tip_state, side))
            if tip_state == CONTACT:
                column = UPPER if side > 0.0 else LOWER
                arrays.impacts[cycle, column] += 1
                note_touch(episode, side, time, arrays.bounce_time[cycle])

        arrays.events[cycle] = events
        leave_regime(model, regimes, tip_state, side, u, state)
        if tangents is not None:
            carry(model.stiffness, regimes, r, time - carried, vectors, growth, spare)
            orthonormalise(model.stiffness, vectors, growth)
        for i in range(n2):
            if not math.isfinite(state[i]):
                return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
