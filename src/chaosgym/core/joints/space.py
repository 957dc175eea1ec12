"""The work space of one run of several joints: what lies where in it, and what is known of each channel."""

from typing import NamedTuple

import numpy as np

from chaosgym.core.joints.tables import CHANNELS, DEGREE, HARMONICS, JOINTS, MODES, PLACES, STATES, WIDTH
from chaosgym.core.kernel import leaf, njit, part
from chaosgym.core.lanes import LANES, aligned, item, padded

UPPER_GAP, LOWER_GAP, UPPER_STIFFNESS, LOWER_STIFFNESS, UPPER_LAG, LOWER_LAG = range(6)
"""Numbers of a channel: distance [m] of its surfaces from where it rests; spring [N/m]; damper over spring [s]. Those
of friction read newtons or metres a second and have one surface; their SIDE is 0 while they have nothing to read."""

SIDE, AWAKE, BASE, READING_REST, FOURTH, READING_BEND, READING_FOURTH = range(6, 13)
"""More of them: the surface that presses, +1 or -1, or 0; 1 unless the joint surely reaches no surface in this set;
where it rests [m]; what the drift adds to the reading, to a bound of its second derivative, and of its fourth one after
that bound itself."""

UPPER_STOP, LOWER_STOP, UPPER_DAMPER, LOWER_DAMPER = range(13, 17)
"""And more: positions of its surfaces [m], infinite where there is none; their dampers [N s/m]."""

POWERS = 6
"""Powers of time in a drift: what is left out of its series is ``SLOW``^6 / 7! of it, which is rounding."""

RATE, READING_RATE, ROUNDED = 17, 17 + POWERS, 17 + 2 * POWERS
"""And last: what the drift adds to displacement and reading, by powers of time from the first on; how much of the
displacement [m] is rounding of what it is the sum of."""

MODE = 18 + 2 * POWERS
"""What friction of a joint does while a surface presses, as a digit: STICKS, SLIDES_UP, SLIDES_DOWN; 1 without it."""

NUMBERS = 32

READINGS = 4 * LANES
"""Numbers of what a joint reads: seven to spare, now, after 1 to 8 intervals; and as many rates."""

NOW, RATES = np.int64(LANES - 1), 2 * LANES

U, SPARE, STATE, JOINT, READING, SERIES, TOTALS, PEAKS, SHAPES, DRIFT, SLIDER, SLIPS, OWN, RADIX = range(
    PLACES, PLACES + 14
)
"""Where coordinates and the constants after them, room for others, the state with what follows it, ``NUMBERS`` and
``READINGS`` of the channels, their Taylor series, room for eight numbers, the largest forces of the cycle (2m,), the
displacements of the joints per unit modal coordinate (m, n), the drift (POWERS, 2L), ``OF_SLIDER`` numbers of each
friction and its tangential displacement (f, n) begin in ``own``; its length. RADIX is where in ``at`` the digits of a
joint in the number of a set begin: one for none, and for each surface that differs 1, or as many as friction has modes;
behind them the joint of each friction (f,), and the friction of each joint, -1 for none, (m,)."""

FRICTION, UPPER_TANGENTIAL, LOWER_TANGENTIAL, SLIDING_SPEED, DEFLECTION, OF_SLIDER = range(6)
"""Numbers of friction: its coefficient; tangential spring [N/m] of each surface; speed of the surfaces [m/s];
deflection of the spring at the end of a cycle [m]."""


class JointRun(NamedTuple):
    """All that a run reads, and its work space. Few arrays: a call of a function hands on seven numbers for each.

    Attributes
    ----------
    tables : (...,)
        Rows of ``joints.tables`` one after the other.
    own : (...,)
        Work space, and what is known of the joints.
    at : (...,) int
        Sizes, and what lies where in a row and in ``own``.
    period : float
        Of the cycle [s].
    resolution : float
        Error of an event's instant, in shortest intervals.
    """

    tables: np.ndarray
    own: np.ndarray
    at: np.ndarray
    period: float
    resolution: float


@njit(cache=True, nogil=True)
def work_space(layout, radix, rubbed):
    """``JointRun.at``, the ``layout`` (PLACES,) of a row and then that of the work space.

    ``radix`` (m,) are the digits of each joint, ``rubbed`` (f,) the joints with friction.
    """
    sliders = rubbed.shape[0]
    at = np.zeros(RADIX + 2 * radix.shape[0] + sliders, np.int64)
    for i in range(PLACES):
        at[i] = layout[i]
    for j in range(radix.shape[0]):
        at[RADIX + j] = radix[j]
        at[RADIX + radix.shape[0] + sliders + j] = -1
    for c in range(sliders):
        at[RADIX + radix.shape[0] + c] = rubbed[c]
        at[RADIX + radix.shape[0] + sliders + rubbed[c]] = c
    m, channels, width = at[JOINTS], at[CHANNELS], 2 * at[WIDTH]
    at[U] = 0
    at[SPARE] = width + padded(1 + m)
    at[STATE] = 2 * at[SPARE]
    at[JOINT] = at[STATE] + at[STATES] + padded(2 * (at[HARMONICS] + sliders) + 1 + m)
    at[READING] = at[JOINT] + NUMBERS * channels
    at[SERIES] = at[READING] + READINGS * channels
    at[TOTALS] = at[SERIES] + (DEGREE + 1) * channels
    at[PEAKS] = at[TOTALS] + LANES
    at[SHAPES] = at[PEAKS] + padded(2 * m)
    at[DRIFT] = at[SHAPES] + padded(m * at[MODES])
    at[SLIDER] = at[DRIFT] + POWERS * width
    at[SLIPS] = at[SLIDER] + padded(OF_SLIDER * sliders)
    at[OWN] = at[SLIPS] + padded(sliders * at[MODES])
    return at


@njit(cache=True, nogil=True)
def new_space(at, shape, stops, stiffness, damping, slip, friction):
    """``JointRun.own``, with what is known of the joints whatever presses.

    ``shape`` (m, n) is the displacement of each joint per unit modal coordinate; ``stops``, ``stiffness`` and
    ``damping`` (m, 2) are position [m], spring and damper of its upper and lower surface. ``slip`` (f, n) and
    ``friction`` (f, 4) are the tangential displacements of joints with friction and the first numbers of ``OF_SLIDER``.
    """
    own = aligned(at[OWN])
    m, n = shape.shape
    for j in range(m):
        first = at[JOINT] + j * NUMBERS
        for which in range(2):
            own[first + UPPER_STOP + which] = stops[j, which]
            own[first + UPPER_STIFFNESS + which] = stiffness[j, which]
            own[first + UPPER_DAMPER + which] = damping[j, which]
            own[first + UPPER_LAG + which] = damping[j, which] / stiffness[j, which]
        for i in range(n):
            own[at[SHAPES] + j * n + i] = shape[j, i]
        own[first + MODE] = 1.0
    for c in range(slip.shape[0]):
        for k in range(friction.shape[1]):
            own[at[SLIDER] + c * OF_SLIDER + k] = friction[c, k]
        for i in range(n):
            own[at[SLIPS] + c * n + i] = slip[c, i]
    return own


@part
def known(run, j, which):
    """One of the ``NUMBERS`` of channel j."""
    return item(run.own, run.at[JOINT] + j * NUMBERS + which)


@part
def gap_of(run, j, side):
    """How far the surface on a side of joint j is from where the joint rests, towards that side [m]."""
    return known(run, j, UPPER_GAP if side > 0.0 else LOWER_GAP)


@part
def lag_of(run, j, side):
    """Damper over spring [s] of the surface on a side of joint j."""
    return known(run, j, UPPER_LAG if side > 0.0 else LOWER_LAG)


@part
def spring_of(run, j, side):
    """Spring [N/m] of the surface on a side of joint j."""
    return known(run, j, UPPER_STIFFNESS if side > 0.0 else LOWER_STIFFNESS)


@part
def stop_of(run, j, side):
    """Position [m] of the surface on a side of joint j."""
    return known(run, j, UPPER_STOP if side > 0.0 else LOWER_STOP)


@leaf
def joint_motion(run, state, j):
    """Displacement and velocity of joint j in a state (2n,)."""
    n = run.at[MODES]
    x, v, first = 0.0, 0.0, run.at[SHAPES] + j * n
    for i in range(n):
        x += run.own[first + i] * state[i]
        v += run.own[first + i] * state[n + i]
    return x, v


@leaf
def find_sides(run, state):
    """Write which surface of every joint presses in a state (2n,)."""
    for j in range(run.at[JOINTS]):
        x, v = joint_motion(run, state, j)
        side = 0.0
        upper, lower = x - stop_of(run, j, 1.0), stop_of(run, j, -1.0) - x
        if upper > 0.0 and upper + known(run, j, UPPER_LAG) * v > 0.0:
            side = 1.0
        elif lower > 0.0 and lower - known(run, j, LOWER_LAG) * v > 0.0:
            side = -1.0
        run.own[run.at[JOINT] + j * NUMBERS + SIDE] = side


@leaf
def pressed_set(run):
    """Number of the set of surfaces that press: a digit for each joint."""
    code, place = 0, 1
    for j in range(run.at[JOINTS]):
        side, radix = known(run, j, SIDE), run.at[RADIX + j]
        if side != 0.0:
            # digits of the lower surface are the last ones; radix 4 and 7 are those of friction
            modes = 3 if radix > 3 else 1
            code += place * (int(known(run, j, MODE)) + (radix - 1 - modes if side < 0.0 else 0))
        place *= radix
    return code
