r"""Exact motion of one mode whose impacts take no time.

Its one degree of freedom, written for the tip between two surfaces at +-c, obeys

    x'' = -K x - D x' + G sin(w t)          |x| < c
    v -> -e v                               at |x| = c
    x = s c, v = 0                          while G sin(w t) presses on surface s harder than K c pulls away

Free flights are exact (``propagator``). Those that start at a surface and are short are summed as a Taylor series from
there, so that none of the bounces drowns in the rounding of c. Infinitely many ever shorter bounces end in rest on the
surface; as soon as all that are left would be over within ``CHATTER_PHASE``, the tip is put to rest.

A force that takes no time has no size. What stands in the records is the largest force of the compliant contact from
which e was derived: ``force_per_speed`` times the speed before; while the tip rests, it is the force that holds it.

The file is long because flight, bounce and rest share one state, and no other machine has any of the three.

References
----------
A. B. Nordmark, P. T. Piiroinen, Simulation and stability analysis of impacting systems with complete chattering,
Nonlinear Dynamics 58 (2009) 85-106.
"""

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from chaosgym.core import status
from chaosgym.core.cubic import cubic, cubic_extremum
from chaosgym.core.cycle import LOWER, UPPER, note_touch
from chaosgym.core.kernel import leaf
from chaosgym.core.propagator import Regimes, block, bound, derivative, safe_time, steady_response
from chaosgym.core.tangent import carry, orthonormalise

CHATTER_PHASE = 0.01
"""Angle [rad] of the faster of force and beam within which the bounces that are left out would be over."""

SHORT_FLIGHT = 0.5
"""Longest flight, as an angle [rad] of the faster of force and beam, that the Taylor series sums to rounding."""

SERIES_TERMS = 13
"""Terms of that series: the first one left out is 1e-14 of the flight's height."""

FACTORIAL = tuple(float(math.factorial(k)) for k in range(SERIES_TERMS + 1))

FORGOTTEN = 1e-12
"""What rest on a surface leaves of a deviation: nothing; this keeps its logarithm finite."""

MAX_POLISH = 60
"""Iterations to polish one impact."""


class RestitutionModel(NamedTuple):
    """All that the kernel knows of a rigid beam whose impacts take no time.

    As ``ModalImpactModel`` with one mode and the free regime alone; ``restitution``, ``contact_duration`` [s] and
    ``force_per_speed`` [N s/m] are those of the compliant contact.
    """

    excitation_frequency: float
    force_amplitude: float
    clearance: float
    stiffness: np.ndarray
    damping: np.ndarray
    tip_shape: np.ndarray
    force_shape: np.ndarray
    regimes: Regimes
    restitution: float
    contact_duration: float
    force_per_speed: float


class Tip(NamedTuple):
    """Equation of motion of the tip; ``fastest`` is the faster of force and beam [rad/s], ``mass`` that of the tip."""

    spring: float
    damper: float
    load: float
    omega: float
    fastest: float
    mass: float


@njit(cache=True, inline="always")
def acceleration(tip, x, v, time):
    """Acceleration of the free tip [m/s^2]."""
    return -tip.spring * x - tip.damper * v + tip.load * math.sin(tip.omega * time)


@njit(cache=True)
def expand(tip, v, a, time, series):
    """Taylor series of the way from a surface, divided by t: derivative k + 1 of the displacement over (k + 1)!."""
    sine, cosine = tip.load * math.sin(tip.omega * time), tip.load * math.cos(tip.omega * time)
    series[0], series[1] = v, 0.5 * a
    before, last = v, a
    for k in range(2, series.shape[0]):
        sine, cosine = tip.omega * cosine, -tip.omega * sine
        before, last = last, -tip.spring * before - tip.damper * last + sine
        series[k] = last / FACTORIAL[k + 1]


@njit(cache=True, inline="always")
def short_flight(series, t):
    """Way over time, and velocity, after a time t."""
    mean, velocity = 0.0, 0.0
    for k in range(series.shape[0] - 1, -1, -1):
        mean = mean * t + series[k]
        velocity = velocity * t + (k + 1) * series[k]
    return mean, velocity


@njit(cache=True)
def landing(series):
    """Duration of a short flight, or inf if it does not come back soon: Newton's method on way over time."""
    guess = -series[0] / series[1]
    t = guess
    for _ in range(8):
        mean, velocity = short_flight(series, t)
        if velocity * series[1] <= 0.0:
            return math.inf
        change = -mean * t / (velocity - mean)
        t += change
        if not 0.0 < t < 2.0 * guess:
            return math.inf
        if abs(change) <= 1e-14 * t:
            return t
    return math.inf


class Beam(NamedTuple):
    """The free beam under its force: coordinates u (4,) are its block's two, then cosine and sine of the force's phase.

    ``generator`` (4, 1), ``to_modal`` (2, 2) as in ``Regimes``; ``steady`` (2, 2) response to the force; ``output``
    (3, 4) displacement, velocity and acceleration of the tip; ``size`` (4,) bound of the acceleration.
    """

    generator: np.ndarray
    to_modal: np.ndarray
    steady: np.ndarray
    output: np.ndarray
    size: np.ndarray
    omega: float


@njit(cache=True)
def beam_under_force(model, omega):
    """Beam at one frequency [rad/s]."""
    generator, to_modal = model.regimes.generator[0], model.regimes.to_modal[0]
    steady, output, size = np.empty((2, 2)), np.empty((3, 4)), np.empty(4)
    sine = model.force_amplitude * model.force_shape[0] * to_modal[:, 1]
    steady_response(generator, np.zeros(2), sine, omega, steady)
    row, rate = model.regimes.output[0].copy(), np.empty(2)
    cosine, sine = row[0] * steady[0, 0] + row[1] * steady[1, 0], row[0] * steady[0, 1] + row[1] * steady[1, 1]
    for q in range(3):
        output[q, :2] = row
        output[q, 2], output[q, 3] = cosine, sine
        if q < 2:
            derivative(generator, row, rate)
            row[:] = rate
            cosine, sine = omega * sine, -omega * cosine
    bound(generator, row, size[:2])
    size[2:] = math.hypot(cosine, sine)
    return Beam(generator, to_modal, steady, output, size, omega)


@leaf
def move(beam, u, time, moved):
    """moved = u after a time."""
    e11, e12, e21, e22 = block(beam.generator, 0, time)
    moved[0], moved[1] = e11 * u[0] + e12 * u[1], e21 * u[0] + e22 * u[1]
    c, s = math.cos(beam.omega * time), math.sin(beam.omega * time)
    moved[2], moved[3] = c * u[2] - s * u[3], s * u[2] + c * u[3]


@leaf
def enter(model, beam, x, v, time, u):
    """Modal coordinates u (4,) of tip displacement x and velocity v."""
    cosine, sine = math.cos(beam.omega * time), math.sin(beam.omega * time)
    q, p = x / model.tip_shape[0], v / model.tip_shape[0]
    for i in range(2):
        u[i] = beam.to_modal[i, 0] * q + beam.to_modal[i, 1] * p
        u[i] -= beam.steady[i, 0] * cosine + beam.steady[i, 1] * sine
    u[2], u[3] = cosine, sine


@njit(cache=True, inline="always")
def tip_of(beam, row, u):
    """Displacement, velocity or acceleration of the tip, by row of the output."""
    output = beam.output
    return output[row, 0] * u[0] + output[row, 1] * u[1] + output[row, 2] * u[2] + output[row, 3] * u[3]


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


@njit(cache=True)
def crossing(beam, clearance, side, u, moved, low, until, h):
    """Instant up to h at which the tip reaches a surface, or inf if it only comes close by ``until``."""
    high = until
    for _ in range(MAX_POLISH):
        move(beam, u, high, moved)
        e, rate = clearance - side * tip_of(beam, 0, moved), -side * tip_of(beam, 1, moved)
        bend = -side * tip_of(beam, 2, moved)
        if e <= 0.0:
            break
        if bend <= 0.0 or rate * rate < 0.5 * bend * e or not 0.0 < high - rate / bend <= h:
            return math.inf
        high -= rate / bend
    else:
        return math.inf
    low = min(low, high)
    t = high
    for _ in range(MAX_POLISH):
        if e > 0.0:
            low = t
        else:
            high = t
        newton = t - e / rate if rate < 0.0 else low
        if not low < newton < high:
            newton = 0.5 * (low + high)
        if abs(newton - t) <= 1e-15 * high or newton in (low, high):
            break
        t = newton
        move(beam, u, t, moved)
        e, rate = clearance - side * tip_of(beam, 0, moved), -side * tip_of(beam, 1, moved)
    return t


@njit(cache=True)
def long_flight(model, beam, tip, x, v, time, remaining, step_phase, u, moved, spare):
    """Fly on to the next surface or to the end: (elapsed, side or 0, x, v)."""
    c = model.clearance
    shortest = step_phase / tip.fastest
    doubt = step_phase * step_phase / 384.0
    enter(model, beam, x, v, time, u)
    elapsed = 0.0
    while True:
        bend = 0.0
        for j in range(4):
            bend += beam.size[j] * abs(u[j])
        safe = min(safe_time(c - x, -v, bend), safe_time(c + x, v, bend))
        h = max(safe, shortest)
        last = h >= remaining - elapsed
        if last:
            h = remaining - elapsed
        move(beam, u, h, moved)
        x1, v1 = tip_of(beam, 0, moved), tip_of(beam, 1, moved)
        if h > safe:
            first, struck = math.inf, 0.0
            for side in (1.0, -1.0):
                until = suspect(c - side * x, -side * v, c - side * x1, -side * v1, h, doubt * bend * h * h)
                if until >= 0.0:
                    t = crossing(beam, c, side, u, spare, safe, until, h)
                    if t < first:
                        first, struck = t, side
            if struck != 0.0:
                move(beam, u, first, moved)
                return elapsed + first, struck, struck * c, struck * max(0.0, struck * tip_of(beam, 1, moved))
        elapsed += h
        for j in range(4):
            u[j] = moved[j]
        x, v = x1, v1
        if last:
            return elapsed, 0.0, x, v


@njit(cache=True)
def fly(model, beam, tip, x, v, time, remaining, step_phase, u, moved, spare, series):
    """From x, v to the next surface or for ``remaining`` seconds: (elapsed, side or 0, x, v)."""
    side = 1.0 if x > 0.0 else -1.0
    a = acceleration(tip, x, v, time)
    if abs(x) == model.clearance and side * v < 0.0 < side * a:
        guess = -2.0 * v / a
        if guess * tip.fastest < SHORT_FLIGHT and abs(v) * guess < model.clearance:
            expand(tip, v, a, time, series)
            t = landing(series)
            if t < math.inf:
                mean, velocity = short_flight(series, min(t, remaining))
                return (t, side, x, velocity) if t <= remaining else (remaining, 0.0, x + mean * remaining, velocity)
    return long_flight(model, beam, tip, x, v, time, remaining, step_phase, u, moved, spare)


@njit(cache=True)
def hold(tip, clearance, side, time):
    """How long the force goes on pressing a tip that rests on a surface: the sine falls to the share that it needs."""
    if tip.load == 0.0:
        return math.inf
    needed = min(1.0, tip.spring * clearance / abs(tip.load))
    phase = tip.omega * time + (0.0 if side * tip.load > 0.0 else math.pi)
    phase -= 2.0 * math.pi * math.floor(phase / (2.0 * math.pi) + 0.25)
    return max(0.0, math.pi - math.asin(needed) - phase) / tip.omega


@njit(cache=True)
def largest_hold(tip, clearance, side, time, elapsed):
    """Largest force that held the tip on a surface [N]."""
    phase = tip.omega * time + (0.0 if side * tip.load > 0.0 else math.pi)
    phase -= 2.0 * math.pi * math.floor(phase / (2.0 * math.pi) + 0.25)
    end = phase + tip.omega * elapsed
    sine = 1.0 if phase <= 0.5 * math.pi <= end else max(math.sin(phase), math.sin(end))
    return max(0.0, tip.mass * (abs(tip.load) * sine - tip.spring * clearance))


@njit(cache=True)
def rebound(model, tip, x, v, time, vectors):
    """Saltation at an impact with velocity v."""
    e = model.restitution
    before, after = acceleration(tip, x, v, time), acceleration(tip, x, -e * v, time)
    for m in range(vectors.shape[0]):
        q, p = vectors[m, 0], vectors[m, 1]
        vectors[m, 0] = -e * q
        vectors[m, 1] = -e * p + (after + e * before) / v * q


@njit(cache=True)
def sample_flight(model, beam, tip, x, v, time, span, rests, first, period, u, moved, rows):
    """Write the samples from number ``first`` on that lie in ``span``; returns the number of the next one."""
    samples = rows.shape[0]
    sample = first
    side = 1.0 if x > 0.0 else -1.0
    while sample < samples and sample * period < (time + span) * samples:
        t = sample * period / samples - time
        if rests:
            rows[sample, 0], rows[sample, 1] = x, 0.0
            push = tip.load * math.sin(tip.omega * (time + t)) - tip.spring * x
            rows[sample, 2] = side * max(0.0, side * push) * tip.mass
        else:
            enter(model, beam, x, v, time, u)
            move(beam, u, t, moved)
            rows[sample, 0] = min(max(tip_of(beam, 0, moved), -model.clearance), model.clearance)
            rows[sample, 1], rows[sample, 2] = tip_of(beam, 1, moved), 0.0
        sample += 1
    return sample


@njit(cache=True)
def comes_to_rest(model, tip, side, speed, push):
    """True if a tip that leaves surface ``side`` with ``speed`` against an acceleration ``push`` is done bouncing."""
    if push <= 0.0:
        return False
    if speed == 0.0:
        return True
    left = 1.0 - model.restitution
    return 2.0 * speed * tip.fastest < CHATTER_PHASE * push * left


@njit(cache=True, nogil=True)
def advance_restitution(model, state, episode, arrays, step_phase, event_budget, tangents):
    """Advance ``state`` (2,) and ``episode`` in place by whole cycles; see ``modal_impact.advance``.

    A tip that starts beyond a surface is put on it.
    """
    shape = model.tip_shape[0]
    omega = 2.0 * math.pi * model.excitation_frequency
    period = 1.0 / model.excitation_frequency
    c, e = model.clearance, model.restitution
    beam = beam_under_force(model, omega)
    fastest = max(model.regimes.fastest[0], omega)
    load = shape * model.force_shape[0] * model.force_amplitude
    tip = Tip(model.stiffness[0], model.damping[0, 0], load, omega, fastest, 1.0 / shape**2)
    carries = tangents.vectors.shape[0] > 0
    u, moved, spare, series = np.empty(4), np.empty(4), np.empty(4), np.empty(SERIES_TERMS)

    for cycle in range(arrays.section.shape[0]):
        arrays.section[cycle] = state
        x = min(max(shape * state[0], -c), c)
        if abs(x) >= c * (1.0 - 4e-16):
            x = math.copysign(c, x)
        v = shape * state[1]
        arrays.tip[cycle, 0], arrays.tip[cycle, 1] = x, v
        for column in range(2):
            arrays.peak_force[cycle, column] = 0.0
            arrays.impacts[cycle, column] = 0
            arrays.contact_time[cycle, column] = 0.0
            arrays.bounce_time[cycle, column] = 0.0
        if carries:
            tangents.log_growth[cycle] = 0.0
        time, sample, events = 0.0, 0, 0
        side = 1.0 if x > 0.0 else -1.0
        struck = side if abs(x) == c and side * v > 0.0 else 0.0
        touched, released = False, False
        if c == 0.0:
            v = 0.0

        while True:
            push = side * acceleration(tip, x, 0.0, time)
            if struck != 0.0:
                side = struck
                column = UPPER if side > 0.0 else LOWER
                speed = abs(v)
                arrays.peak_force[cycle, column] = max(arrays.peak_force[cycle, column], model.force_per_speed * speed)
                arrays.impacts[cycle, column] += 1
                note_touch(episode, side, time, arrays.bounce_time[cycle])
                v, touched = -e * v, True
                push = side * acceleration(tip, x, 0.0, time)
                if comes_to_rest(model, tip, side, abs(v), push):
                    v = 0.0
                if carries and v != 0.0:
                    rebound(model, tip, x, side * speed, time, tangents.vectors)
            column = UPPER if side > 0.0 else LOWER
            rests = c == 0.0 or (v == 0.0 and abs(x) == c and push > 0.0 and not released)
            struck = 0.0
            if rests:
                elapsed = min(hold(tip, c, side, time), period - time)
                last, released = elapsed == period - time, True
                if carries:
                    tangents.vectors[:] = tangents.vectors * FORGOTTEN
                arrays.peak_force[cycle, column] = max(
                    arrays.peak_force[cycle, column], largest_hold(tip, c, side, time, elapsed)
                )
                arrays.contact_time[cycle, column] += elapsed
                sample = sample_flight(
                    model, beam, tip, x, v, time, elapsed, True, sample, period, u, moved, arrays.history[cycle]
                )
                if c == 0.0 and not last:
                    side = -side
                    arrays.impacts[cycle, UPPER if side > 0.0 else LOWER] += 1
                    note_touch(episode, side, time + elapsed, arrays.bounce_time[cycle])
            else:
                elapsed, struck, x1, v1 = fly(
                    model, beam, tip, x, v, time, period - time, step_phase, u, moved, spare, series
                )
                last = struck == 0.0
                if touched:
                    arrays.contact_time[cycle, column] += min(elapsed, model.contact_duration)
                sample = sample_flight(
                    model, beam, tip, x, v, time, elapsed, False, sample, period, u, moved, arrays.history[cycle]
                )
                if carries:
                    carry(model.stiffness, model.regimes, 0, elapsed, tangents, cycle, spare)
                x, v, released = x1, v1, False
            time += elapsed
            touched = False
            if last:
                break
            events += 1
            if events > event_budget:
                return status.EVENT_BUDGET, cycle

        arrays.events[cycle] = events
        state[0], state[1] = x / shape, v / shape
        if carries:
            orthonormalise(model.stiffness, tangents, cycle)
        if not (math.isfinite(state[0]) and math.isfinite(state[1])):
            return status.DIVERGED, cycle
        episode.touch[0] -= period
        episode.touch[1] -= period
    return status.OK, arrays.section.shape[0]
