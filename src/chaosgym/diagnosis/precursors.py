"""Early warnings of chaos on a periodic response (thesis 5.3.2).

period doubling     the period is 2, 4, 8 ...
period three        the period is a multiple of three that is no doubling: 3, 6, 12 ...
long bouncing       bouncing on a surface lasts until the end of the half cycle
"""

from dataclasses import dataclass

from chaosgym.simulation import CycleRecord

LONG_BOUNCING = 0.5
"""Bouncing that lasts this share of a half cycle reaches its end: the rest is the flight to the other surface."""


@dataclass(frozen=True)
class Precursors:
    """Early warnings on one response; ``bounce_fraction`` is the longest bouncing in half cycles."""

    period_doubling: bool
    period_three: bool
    long_bouncing: bool
    bounce_fraction: float

    @property
    def any(self) -> bool:
        """True if there is any warning."""
        return self.period_doubling or self.period_three or self.long_bouncing


def precursors(period: int | None, bounce_fraction: float = 0.0) -> Precursors:
    """Early warnings of chaos from the period of a response and from how long it bounces.

    Parameters
    ----------
    period
        Period of a periodic response in cycles, or None.
    bounce_fraction
        Longest bouncing before sustained contact, in half cycles; ``bounce_fraction(record)`` gives it.
    """
    odd = period or 1
    doublings = 0
    while odd % 2 == 0:
        odd //= 2
        doublings += 1
    return Precursors(
        period_doubling=odd == 1 and doublings > 0,
        period_three=odd == 3,
        long_bouncing=bounce_fraction >= LONG_BOUNCING,
        bounce_fraction=float(bounce_fraction),
    )


def bounce_fraction(record: CycleRecord) -> float:
    """Longest bouncing of a record, from the first touch of a surface to its last, in half cycles."""
    return float(record.bounce_duration.max()) / (0.5 * record.machine.cycle_period)
