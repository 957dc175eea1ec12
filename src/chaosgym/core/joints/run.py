"""How a machine of several joints moves within one set of pressed surfaces, and what its channels read."""

from chaosgym.core.events import ROUNDING
from chaosgym.core.joints.space import (
    AWAKE,
    BASE,
    DRIFT,
    FOURTH,
    JOINT,
    LOWER_GAP,
    NOW,
    NUMBERS,
    POWERS,
    RATE,
    RATES,
    READING,
    READING_BEND,
    READING_FOURTH,
    READING_RATE,
    READING_REST,
    READINGS,
    ROUNDED,
    SERIES,
    SIDE,
    SPARE,
    STATE,
    UPPER_GAP,
    U,
    gap_of,
    known,
    lag_of,
    spring_of,
    stop_of,
)
from chaosgym.core.joints.tables import (
    AHEAD,
    BENDS,
    BLOCKS,
    BOUNDS,
    CHANNELS,
    CONSTANTS,
    DEGREE,
    DRIFTING,
    DRIFTS,
    E_RATE,
    FINE,
    FINER,
    FROM,
    GENERATOR,
    HARMONICS,
    JOINTS,
    MODES,
    NOW_ROWS,
    PROPAGATORS,
    SHORTEST,
    SIZES,
    SLIDERS,
    STATES,
    TAYLOR,
    TO,
    WIDTH,
    E,
    V,
    Y,
)
from chaosgym.core.kernel import leaf, part
from chaosgym.core.lanes import (
    LANES,
    add_columns,
    dot,
    dot_of_sizes,
    item,
    propagate,
    propagate_and_expand,
    put,
    sample,
)
from chaosgym.core.propagator import exponential


@leaf
def enter(run, row):
    """Set u, and what is known of the channels, to the state in a set.

    The state is followed by cosines and sines, anchors and their speeds.
    """
    own, at, tables = run.own, run.at, run.tables
    m, width = at[JOINTS], 2 * at[WIDTH]
    more = at[STATE] + 2 * at[BLOCKS]
    own[more] = 1.0
    for j in range(m):
        side = known(run, j, SIDE)
        own[more + 1 + j] = 0.0 if side == 0.0 else stop_of(run, j, side)
    add_columns(tables, row + at[TO], width, 2 * at[BLOCKS] + 1 + m, own, at[STATE], own, at[U], LANES)
    for c in range(1 + m):
        own[at[U] + width + c] = own[more + c]
    if tables[row + DRIFTING] != 0.0:
        _begin_drift(run, row)
    for j in range(at[CHANNELS]):
        _settle(run, row, j)


@leaf
def _begin_drift(run, row):
    """Write how far coordinates without a position of rest drift, by powers of time."""
    own, at, tables = run.own, run.at, run.tables
    width, generator = at[WIDTH], row + at[GENERATOR]
    for lane in range(2 * width):
        own[at[DRIFT] + lane] = 0.0
        for c in range(1 + at[JOINTS]):
            rate = tables[row + at[DRIFTS] + c * 2 * width + lane]
            own[at[DRIFT] + lane] += rate * own[at[U] + 2 * width + c]
    for power in range(1, POWERS):
        last, share = at[DRIFT] + (power - 1) * 2 * width, 1.0 / (power + 1)
        for j in range(width):
            a, b, k = own[last + j], own[last + width + j], generator + j
            own[last + 2 * width + j] = share * (tables[k] * a + tables[k + width] * b)
            own[last + 3 * width + j] = share * (tables[k + 2 * width] * a + tables[k + 3 * width] * b)


@leaf
def _settle(run, row, j):
    """Write the numbers of channel j that depend on the set; u and the positions of the pressed surfaces are known."""
    own, at, tables = run.own, run.at, run.tables
    m, width, first = at[JOINTS], 2 * at[WIDTH], at[JOINT] + j * NUMBERS
    more, side, rest = at[U] + width, known(run, j, SIDE), 0.0
    for c in range(1 + m):
        rest += tables[row + at[CONSTANTS] + j * (1 + m) + c] * own[more + c]
    if side == 0.0:
        own[first + UPPER_GAP] = stop_of(run, j, 1.0) - rest
        own[first + LOWER_GAP] = rest - stop_of(run, j, -1.0)
        own[first + BASE] = rest
    else:
        own[first + (UPPER_GAP if side > 0.0 else LOWER_GAP)] = -side * rest
        own[first + BASE] = rest if j >= m else own[more + 1 + j] + rest
    own[first + AWAKE] = 1.0
    if j >= m and side == 0.0:
        own[first + AWAKE] = 0.0
        return
    reach = dot_of_sizes(tables, row + at[SIZES] + j * width, own, at[U], width)
    own[first + ROUNDED] = ROUNDING * (reach + abs(own[first + BASE]))
    if tables[row + DRIFTING] != 0.0:
        _show_drift(run, row, j)
        return
    own[first + READING_REST] = own[first + READING_BEND] = own[first + READING_FOURTH] = 0.0
    own[first + RATE] = own[first + READING_RATE] = 0.0
    # friction may let a motion grow, and moves the anchors
    if side == 0.0 and at[SLIDERS] == 0 and reach < own[first + UPPER_GAP] and reach < own[first + LOWER_GAP]:
        own[first + AWAKE] = 0.0


@leaf
def _show_drift(run, row, j):
    """Write what the drift adds to displacement and reading of channel j, and to the reading's bounds for a cycle."""
    own, at, first = run.own, run.at, run.at[JOINT] + j * NUMBERS
    width, side = 2 * at[WIDTH], known(run, j, SIDE)
    lag = 0.0 if side == 0.0 else lag_of(run, j, side)
    for k in range(POWERS):
        shown = row + at[NOW_ROWS] + (4 * j + Y) * width
        own[first + RATE + k] = dot(run.tables, shown, own, at[DRIFT] + k * width, width)
    own[first + READING_REST] = lag * own[first + RATE]
    own[first + READING_BEND] = own[first + READING_FOURTH] = 0.0
    for k in range(POWERS):
        power, beyond = k + 1, 0.0
        if k + 1 < POWERS:
            beyond = (power + 1) * own[first + RATE + k + 1]
        own[first + READING_RATE + k] = own[first + RATE + k] + lag * beyond
        bend = abs(own[first + READING_RATE + k]) * power * (power - 1)
        if power >= 2:
            own[first + READING_BEND] += bend * run.period ** (power - 2)
        if power >= 4:
            own[first + READING_FOURTH] += bend * (power - 2) * (power - 3) * run.period ** (power - 4)


@leaf
def leave(run, row):
    """Write the state of u in a set, cosines and sines, anchors and their speeds behind it."""
    own, at = run.own, run.at
    n, harmonics, sliders, width = at[MODES], at[HARMONICS], at[SLIDERS], at[WIDTH]
    count = 2 * width + 1 + at[JOINTS]
    add_columns(run.tables, row + at[FROM], at[STATES], count, own, at[U], own, at[STATE], LANES)
    for h in range(harmonics):
        own[at[STATE] + 2 * n + h] = own[at[U] + n + h]
        own[at[STATE] + 2 * n + harmonics + h] = own[at[U] + width + n + h]
    anchors = at[STATE] + 2 * (n + harmonics)
    for c in range(sliders):
        own[anchors + c] = own[at[U] + n + harmonics + c]
        own[anchors + sliders + c] = own[at[U] + width + n + harmonics + c]


@leaf
def read_now(run, row):
    """Write what every channel that is awake reads in u."""
    own, at = run.own, run.at
    width = 2 * at[WIDTH]
    for j in range(at[CHANNELS]):
        if known(run, j, AWAKE) == 0.0:
            continue
        rows, place = row + at[NOW_ROWS] + 4 * j * width, at[READING] + j * READINGS + NOW
        own[place] = dot(run.tables, rows + E * width, own, at[U], width) + known(run, j, READING_REST)
        own[place + RATES] = dot(run.tables, rows + E_RATE * width, own, at[U], width) + known(run, j, READING_RATE)


@part
def look(run, row, level, h):
    """Write what every channel that is awake reads after 1 to 8 intervals of a level, of length h."""
    own, at = run.own, run.at
    blocks, channels = at[BLOCKS], at[CHANNELS]
    for j in range(channels):
        if known(run, j, AWAKE) == 0.0:
            continue
        ahead = row + at[AHEAD] + (level * channels + j) * 4 * blocks * LANES
        place = at[READING] + j * READINGS + NOW + 1
        sample(run.tables, ahead, own, at[U], blocks, at[WIDTH], place, place + RATES)
        if run.tables[row + DRIFTING] != 0.0:
            _add_drift_ahead(own, at[JOINT] + j * NUMBERS, h, place)


@leaf
def _add_drift_ahead(own, first, h, place):
    """Add to the readings after 1 to 8 intervals what the drift of a joint adds."""
    last = first + READING_RATE + POWERS - 1
    for i in range(LANES):
        time = (i + 1) * h
        moved, rate = own[last], POWERS * own[last]
        for k in range(1, POWERS):
            moved = own[last - k] + time * moved
            rate = (POWERS - k) * own[last - k] + time * rate
        own[place + i] += own[first + READING_REST] + time * moved
        own[place + RATES + i] += rate


@part
def bound_fourth(run, row):
    """Write bounds of the fourth derivatives of what the channels read, from now on."""
    own, at = run.own, run.at
    width = 2 * at[WIDTH]
    for j in range(at[CHANNELS]):
        if known(run, j, AWAKE) != 0.0:
            bound = dot_of_sizes(run.tables, row + at[BOUNDS] + j * width, own, at[U], width)
            put(own, at[JOINT] + j * NUMBERS + FOURTH, bound + known(run, j, READING_FOURTH))


@leaf
def bound_second(tables, own, at, row, j):
    """Bound of the second derivative of what channel j reads, from now on."""
    width = 2 * at[WIDTH]
    bend = own[at[JOINT] + j * NUMBERS + READING_BEND]
    return dot_of_sizes(tables, row + at[BENDS] + j * width, own, at[U], width) + bend


@part
def read_after(run, intervals):
    """Take over what the channels read after some intervals of a look as what they read now."""
    own = run.own
    for j in range(run.at[CHANNELS]):
        place = run.at[READING] + j * READINGS + NOW
        put(own, place, item(own, place + intervals))
        put(own, place + RATES, item(own, place + RATES + intervals))


@part
def add_drift(run, row, time, out):
    """Add to coordinates at ``out`` how far those without a position of rest drift in a time."""
    if run.tables[row + DRIFTING] != 0.0:
        _drift(run, time, out)


@part
def read_next(run, intervals):
    """Take over what the channels read one interval later as what they read after one."""
    own = run.own
    for j in range(run.at[CHANNELS]):
        place = run.at[READING] + j * READINGS + NOW + 1
        put(own, place, item(own, place + intervals))
        put(own, place + RATES, item(own, place + RATES + intervals))


@leaf
def _drift(run, time, out):
    own, width = run.own, 2 * run.at[WIDTH]
    last = run.at[DRIFT] + (POWERS - 1) * width
    for lane in range(width):
        total = own[last + lane]
        for power in range(1, POWERS):
            total = own[last - power * width + lane] + time * total
        own[out + lane] += time * total


@part
def entries_of(run, row, level, intervals):
    """Where the propagator over 1 to 8 intervals of a level begins in the tables."""
    return row + run.at[PROPAGATORS] + (LANES * level + intervals - 1) * 4 * run.at[WIDTH]


@part
def instant_beside(run, row, time):
    """Where the propagator over the tabulated instant next to a time within the shortest interval begins; the rest."""
    piece = run.tables[row + SHORTEST] / FINE
    instant = min(max(0, int(time / piece + 0.5)), FINE)
    return row + run.at[FINER] + instant * 4 * run.at[WIDTH], time - instant * piece


@part
def jump(run, row, level, intervals, h):
    """Move u by 1 to 8 intervals of a level, of length h."""
    at = run.at
    propagate(run.tables, entries_of(run, row, level, intervals), run.own, at[U], at[U], at[WIDTH])
    add_drift(run, row, intervals * h, at[U])


@part
def place(run, row, time):
    """Move u by a time within the shortest interval."""
    at = run.at
    entries, rest = instant_beside(run, row, time)
    propagate_and_expand(run.tables, entries, row + at[GENERATOR], run.own, at[U], rest, at[U], at[WIDTH])
    add_drift(run, row, time, at[U])


@leaf
def travel(run, row, time, u, out):
    """Put coordinates after any time at ``out``, which may be u."""
    own, at, tables = run.own, run.at, run.tables
    width, generator = at[WIDTH], row + at[GENERATOR]
    for j in range(at[BLOCKS]):
        k = generator + j
        p, q, r, s = tables[k], tables[k + width], tables[k + 2 * width], tables[k + 3 * width]
        e11, e12, e21, e22 = exponential(p, q, r, s, time)
        first, second = own[u + j], own[u + width + j]
        own[out + j] = e11 * first + e12 * second
        own[out + width + j] = e21 * first + e22 * second


@leaf
def expand(run, row):
    """Write the Taylor series of the displacement of every channel that is awake, from where it rests, of time in s."""
    own, at = run.own, run.at
    blocks = at[BLOCKS]
    for j in range(at[CHANNELS]):
        if known(run, j, AWAKE) == 0.0:
            continue
        series, first = at[SERIES] + j * (DEGREE + 1), row + at[TAYLOR] + 4 * j * blocks * LANES
        sample(run.tables, first, own, at[U], blocks, at[WIDTH], series, series + LANES)
        if run.tables[row + DRIFTING] != 0.0:
            for k in range(POWERS):
                own[series + 1 + k] += known(run, j, RATE + k)


@leaf
def write_samples(run, row, time, span, sample, history):
    """Write displacement, velocity and force (positive from the upper surface) of all joints at the instants in a span.

    ``history`` (samples, 3m) is that of the cycle, ``sample`` the next one; returns the next one after the span.
    """
    own, at, samples = run.own, run.at, history.shape[0]
    spare, width = at[SPARE], 2 * at[WIDTH]
    while sample < samples and sample * run.period < (time + span) * samples:
        since = max(0.0, sample * run.period / samples - time)
        travel(run, row, since, at[U], spare)
        add_drift(run, row, since, spare)
        for j in range(at[JOINTS]):
            rows, side = row + at[NOW_ROWS] + 4 * j * width, known(run, j, SIDE)
            history[sample, 3 * j] = dot(run.tables, rows + Y * width, own, spare, width) + known(run, j, BASE)
            speed = dot(run.tables, rows + V * width, own, spare, width)
            history[sample, 3 * j + 1] = speed + known(run, j, RATE)
            history[sample, 3 * j + 2] = 0.0
            if side != 0.0:
                reading = dot(run.tables, rows + E * width, own, spare, width) + known(run, j, READING_REST)
                depth = side * reading - gap_of(run, j, side)
                history[sample, 3 * j + 2] = side * max(0.0, spring_of(run, j, side) * depth)
        sample += 1
    return sample
