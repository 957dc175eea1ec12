"""How long a motion was chaotic before it came to the periodic motion that it ends on: transient chaos (thesis 5.2.3).

The cycles up to the last that lies more than a tenth of the motion's size away from its final form are its way there.
That was chaotic if its 0-1 walks diffuse and it did not die out steadily.
"""

import numpy as np

from chaosgym.arrays import Array
from chaosgym.series.stroboscopic import DECAY_FACTOR, deviations, find_decay
from chaosgym.series.zero_one import zero_one_statistic

INITIAL_TRANSIENT = 50
"""Cycles that the motion may take to come near its final form before it counts as transient chaos."""

CHAOTIC_STATISTIC = 0.5
"""0-1 statistic above which a motion is chaotic."""

CHAOTIC_CYCLES = 50
"""Fewest cycles that are called chaotic."""

FAR = 0.1
"""Distance from the final form, relative to the size of the motion, beyond which a cycle belongs to the way there."""


def irregular_cycles(scaled: Array, series: list[Array], period: int, settle: int) -> int:
    """Cycles for which a motion was irregular before its final form: 0 if it approached that steadily.

    Parameters
    ----------
    scaled : (cycles, coordinates)
        Samples divided by their scale.
    series
        What the 0-1 test looks at, (cycles,) each.
    period
        Of the motion that it ends on.
    settle
        Cycle from which it repeats; ``cycles`` if it only nears the motion.
    """
    nearing = settle == len(scaled)
    deviation = deviations(scaled, period, repeats=1 if nearing else None)[:settle]
    far = np.flatnonzero(deviation > FAR)
    end = int(far[-1]) + 1 if len(far) else 0
    if end < CHAOTIC_CYCLES or _dies_out(scaled[: end if nearing else settle]):
        return 0
    statistics = [zero_one_statistic(one[:end]) for one in series if np.ptp(one[:end]) > 0.0]
    return end if statistics and np.median(statistics) > CHAOTIC_STATISTIC else 0


def _dies_out(scaled: Array) -> bool:
    decay = find_decay(scaled)
    return decay is not None and decay.factor >= DECAY_FACTOR
