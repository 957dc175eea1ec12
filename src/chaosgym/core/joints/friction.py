r"""Coulomb friction of joints: a slider in series with a tangential spring, the element of Jenkins.

While a surface presses with N, the spring of a joint whose tangential displacement is w holds with T = k_t z, and
abs(T) never exceeds mu N:

    (1)  sticks     z = w - a, the anchor a moves with the surfaces, a' = V      until  abs(T) reaches mu N
    (2)  slides     z = s mu N / k_t on the side s = +-1                         until  s (w' - V - z') falls to zero
    (3)  open       z = 0

A touch begins with z = 0, and an anchor is set where the force goes on as it was, so that T is continuous. N is linear
in displacement and velocity, hence a sliding joint is as linear as one that sticks. Two channels of each joint read
what ends a mode (``tables``): side mu N -+ T of one that sticks, and s (w' - V) - mu N' / k_t of one that slides. The
sign of s is that of the side or the other one, SLIDES_UP or SLIDES_DOWN: by that, both surfaces share their tables.

Where w stays in one place, T dissipates what it takes; z is a part of the state, behind displacements and velocities.

References
----------
G. M. Jenkins, Analysis of the stress-strain relationships in reactor grade graphite, Brit. J. Appl. Phys. 13 (1962) 30.
J. H. Griffin, Friction damping of resonant stresses in gas turbine engine airfoils, J. Eng. Power 102 (1980) 329.
"""

from chaosgym.core.events import reading_at
from chaosgym.core.joints.space import (
    DEFLECTION,
    FRICTION,
    JOINT,
    LOWER_DAMPER,
    LOWER_TANGENTIAL,
    MODE,
    NUMBERS,
    OF_SLIDER,
    RADIX,
    SERIES,
    SHAPES,
    SIDE,
    SLIDER,
    SLIDING_SPEED,
    SLIPS,
    STATE,
    UPPER_DAMPER,
    UPPER_TANGENTIAL,
    known,
    lag_of,
    spring_of,
    stop_of,
)
from chaosgym.core.joints.tables import BLOCKS, DEGREE, HARMONICS, JOINTS, MODES, SLIDERS
from chaosgym.core.kernel import leaf, part

STICKS, SLIDES_UP, SLIDES_DOWN = 1.0, 2.0, 3.0

AT_LIMIT = 1e-12
"""Share of mu N that a spring's force may lack to count as sliding at the beginning of a cycle; if that does not slide,
it sticks at once."""


@part
def _of(run, c, which):
    return run.own[run.at[SLIDER] + c * OF_SLIDER + which]


@part
def _anchor(run, c):
    """Where the displacement of the anchor of a friction lies."""
    return run.at[STATE] + 2 * (run.at[MODES] + run.at[HARMONICS]) + c


@leaf
def _motion(run, shape):
    """Displacement and velocity, in the state of the work space, of what has its shape at a place of it."""
    own, n = run.own, run.at[MODES]
    x, v = 0.0, 0.0
    for i in range(n):
        x += own[shape + i] * own[run.at[STATE] + i]
        v += own[shape + i] * own[run.at[STATE] + n + i]
    return x, v


@leaf
def _slid(run, c):
    """Deflection of the spring of a friction that slides (2), or 0 of one that is open (3)."""
    j = run.at[RADIX + run.at[JOINTS] + c]
    side, mode = known(run, j, SIDE), known(run, j, MODE)
    if side == 0.0:
        return 0.0
    x, v = _motion(run, run.at[SHAPES] + j * run.at[MODES])
    damper = known(run, j, UPPER_DAMPER if side > 0.0 else LOWER_DAMPER)
    # force towards the upper side, which sliding down turns round
    pushed = spring_of(run, j, side) * (x - stop_of(run, j, side)) + damper * v
    pushed = max(pushed, 0.0) if side > 0.0 else min(pushed, 0.0)
    signed = -pushed if mode == SLIDES_DOWN else pushed
    return _of(run, c, FRICTION) * signed / _of(run, c, UPPER_TANGENTIAL if side > 0.0 else LOWER_TANGENTIAL)


@leaf
def _deflection(run, c):
    """Deflection z [m] of (1) to (3), in the state of the work space."""
    j = run.at[RADIX + run.at[JOINTS] + c]
    if known(run, j, SIDE) != 0.0 and known(run, j, MODE) == STICKS:
        return _motion(run, run.at[SLIPS] + c * run.at[MODES])[0] - run.own[_anchor(run, c)]
    return _slid(run, c)


@leaf
def _hold(run, c, deflection):
    """Let a friction stick (1), with a deflection of its spring."""
    j = run.at[RADIX + run.at[JOINTS] + c]
    run.own[run.at[JOINT] + j * NUMBERS + MODE] = STICKS
    run.own[_anchor(run, c)] = _motion(run, run.at[SLIPS] + c * run.at[MODES])[0] - deflection


@leaf
def begin_friction(run, state):
    """Write what friction does in a state (2n + f,), whose pressed surfaces are known, and where its anchors are."""
    n, sliders = run.at[MODES], run.at[SLIDERS]
    for c in range(sliders):
        j, deflection = run.at[RADIX + run.at[JOINTS] + c], state[2 * n + c]
        run.own[_anchor(run, c) + sliders] = _of(run, c, SLIDING_SPEED)
        side, mode = known(run, j, SIDE), run.at[JOINT] + j * NUMBERS + MODE
        run.own[mode] = SLIDES_UP if deflection * side > 0.0 else SLIDES_DOWN
        if side == 0.0 or abs(deflection) < (1.0 - AT_LIMIT) * abs(_slid(run, c)) or deflection == 0.0:
            _hold(run, c, 0.0 if side == 0.0 else deflection)
    show_friction(run)


@leaf
def show_friction(run):
    """Write which channels of friction have something to read."""
    own, at = run.own, run.at
    for c in range(at[SLIDERS]):
        j = at[RADIX + at[JOINTS] + c]
        side, first = known(run, j, SIDE), at[JOINT] + (at[JOINTS] + 2 * c) * NUMBERS + SIDE
        own[first] = side
        own[first + NUMBERS] = side if known(run, j, MODE) == STICKS else 0.0


@leaf
def change_friction(run, channel):
    """Go on where a channel has changed, in the state of the work space.

    At a contact that has closed or opened, friction begins without force. Where it sticks, it slides from now on, to
    the side of the limit that it has reached; where it slides, it sticks.
    """
    at, k = run.at, channel - run.at[JOINTS]
    if k < 0:
        c = at[RADIX + at[JOINTS] + at[SLIDERS] + channel]
        if c >= 0:
            _hold(run, c, 0.0)
    else:
        mode = at[JOINT] + at[RADIX + at[JOINTS] + k // 2] * NUMBERS + MODE
        if run.own[mode] == STICKS:
            run.own[mode] = SLIDES_UP if k % 2 == 0 else SLIDES_DOWN
        else:
            _hold(run, k // 2, _slid(run, k // 2))
    show_friction(run)


@leaf
def note_deflections(run):
    """Note the deflections of all tangential springs at the end of a cycle."""
    for c in range(run.at[SLIDERS]):
        run.own[run.at[SLIDER] + c * OF_SLIDER + DEFLECTION] = _deflection(run, c)


@leaf
def write_deflections(run, state):
    """Write the noted deflections behind displacements and velocities of a state (2n + f,)."""
    for c in range(run.at[SLIDERS]):
        state[2 * run.at[MODES] + c] = _of(run, c, DEFLECTION)


@leaf
def write_anchors(run, vectors, k):
    """Write the anchors of deviation k behind its displacements and velocities in the work space."""
    own, at = run.own, run.at
    for i in range(2 * at[MODES], 2 * at[BLOCKS]):
        own[at[STATE] + i] = 0.0
    for c in range(at[SLIDERS]):
        j = at[RADIX + at[JOINTS] + c]
        if known(run, j, SIDE) != 0.0 and known(run, j, MODE) == STICKS:
            own[_anchor(run, c)] = _motion(run, at[SLIPS] + c * at[MODES])[0] - vectors[k, 2 * at[MODES] + c]


@leaf
def read_anchors(run, anchors, vectors, k):
    """Write the deflections of deviation k, whose displacements and velocities are in the work space.

    Those of what slides or is open follow from displacements and velocities; ``anchors`` is where the others lie.
    """
    own, at = run.own, run.at
    for c in range(at[SLIDERS]):
        j = at[RADIX + at[JOINTS] + c]
        side, mode, found = known(run, j, SIDE), known(run, j, MODE), 0.0
        if side != 0.0 and mode == STICKS:
            found = _motion(run, at[SLIPS] + c * at[MODES])[0] - own[anchors + c]
        elif side != 0.0:
            x, v = _motion(run, at[SHAPES] + j * at[MODES])
            force = spring_of(run, j, side) * x + known(run, j, UPPER_DAMPER if side > 0.0 else LOWER_DAMPER) * v
            found = force * _of(run, c, FRICTION) / _of(run, c, UPPER_TANGENTIAL if side > 0.0 else LOWER_TANGENTIAL)
            found = -found if mode == SLIDES_DOWN else found
        vectors[k, 2 * at[MODES] + c] = found


@leaf
def touch_friction(run, j, side, touches, instant, vectors):
    """Saltation of deviations (k, 2n + f) where joint j closes: the spring of what touches earlier has slid since.

    It closes where its depth is zero if it ``touches``, else where its pressure is; ``instant`` is that of its series.
    """
    own, at, n = run.own, run.at, run.at[MODES]
    c = at[RADIX + at[JOINTS] + at[SLIDERS] + j]
    if c < 0:
        return
    lag = 0.0 if touches else lag_of(run, j, side)
    _, v, a, _ = reading_at(own, at[SERIES] + j * (DEGREE + 1), 1, DEGREE, instant)
    slip = _motion(run, at[SLIPS] + c * n)[1] - _of(run, c, SLIDING_SPEED)
    for k in range(vectors.shape[0]):
        ahead = 0.0
        for i in range(n):
            ahead += own[at[SHAPES] + j * n + i] * (vectors[k, i] + lag * vectors[k, n + i])
        vectors[k, 2 * n + c] = slip * ahead / (v + lag * a)
