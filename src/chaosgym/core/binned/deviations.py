"""How small deviations of a mechanism travel along: over intervals, over a step, and through a touch."""

from chaosgym.core.binned.motion import SPARE, evaluate, expand_from, places, put_evaluated
from chaosgym.core.kernel import leaf
from chaosgym.core.lanes import LANES, add_columns


@leaf
def carry(motion, propagator, intervals, vectors):
    """Advance deviations (k, 2n) by some steps whose propagator begins at a place in the table."""
    own, here, states = motion.own, places(motion.n, motion.m), 2 * motion.n
    z = here.sampled
    for k in range(vectors.shape[0]):
        for i in range(states):
            own[z + i] = vectors[k, i]
        for _ in range(intervals):
            add_columns(motion.table, propagator, states, states, own, z, own, here.moved, LANES)
            for i in range(states):
                own[z + i] = own[here.moved + i]
        for i in range(states):
            vectors[k, i] = own[z + i]


@leaf
def carry_expanded(motion, at, row, duration, last, h, vectors):
    """Advance deviations (k, 2n) by h, of which they are expanded as the motion was."""
    own, here, states = motion.own, places(motion.n, motion.m), 2 * motion.n
    z = here.sampled
    for k in range(vectors.shape[0]):
        for c in range(here.width):
            own[z + c] = vectors[k, c] if c < states else 0.0
        expand_from(motion, at, row, z, duration, last)
        evaluate(motion, last, h, SPARE)
        put_evaluated(motion, z)
        for i in range(states):
            vectors[k, i] = own[z + i]


@leaf
def jump(motion, before, after, vectors):
    """Saltation of deviations (k, 2n) where a surface is touched: the damper of (1) acts at once, each at its time.

    ``before`` and ``after`` are where the accelerations on either side of the event begin. Where a contact ends its
    force is zero, and nothing jumps.
    """
    n, lanes, table = motion.n, places(motion.n, motion.m).lanes, motion.table
    for k in range(vectors.shape[0]):
        for i in range(n):
            for j in range(n):
                column = (n + j) * lanes + i
                vectors[k, n + i] += (table[after + column] - table[before + column]) * vectors[k, j]
