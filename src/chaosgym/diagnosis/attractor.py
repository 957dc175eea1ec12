"""One motion that a machine settles on."""

from dataclasses import dataclass, field

from chaosgym.arrays import Array
from chaosgym.diagnosis.periodic_orbit import PeriodicOrbit
from chaosgym.machines import Machine
from chaosgym.plain import Result
from chaosgym.series.verdict import Nature
from chaosgym.simulation import simulate


@dataclass(frozen=True, kw_only=True)
class Attractor(Result):
    """A motion that a machine settles on.

    Attributes
    ----------
    nature, period
        As of a verdict.
    peaks : (sides,)
        Largest contact force on each surface [N].
    state : (n_states,)
        One of its states, at the start of a cycle.
    states : (k, n_states)
        All of a period, or those of the diagnosed run.
    orbit
        The proven orbit, or None.
    random_starts
        How many of the random starts settle on it.
    from_starts
        Names of the other starts that do, such as "rest".
    """

    shows = "nature period largest_peak peaks_N=peaks random_starts from_starts largest_multiplier state"

    nature: Nature
    period: int | None
    peaks: Array
    state: Array = field(repr=False)
    states: Array = field(repr=False)
    orbit: PeriodicOrbit | None = field(default=None, repr=False)
    random_starts: int = 0
    from_starts: tuple[str, ...] = ()

    @property
    def largest_peak(self) -> float:
        """Largest contact force [N]."""
        return float(self.peaks.max())

    @property
    def neutral(self) -> bool:
        """True for a family of orbits side by side, of which each start settles on another; its force is the largest.

        Motions of undamped modes without contact are such a family too.
        """
        if self.period is None:
            return not self.peaks.any()
        return self.orbit is not None and self.orbit.neutral

    @property
    def words(self) -> str:
        """Nature, period and force, such as "periodic, period 1, up to 0.317 N"."""
        period = f", period {self.period}" if self.period else ""
        force = f"up to {self.largest_peak:.3g} N" if self.largest_peak > 0.0 else "without contact"
        return f"{self.nature}{period}, {'neutral, ' if self.neutral else ''}{force}"

    @property
    def largest_multiplier(self) -> float | None:
        """That of the orbit, if there is one."""
        return None if self.orbit is None else self.orbit.largest_multiplier


def of_orbit(machine: Machine, orbit: PeriodicOrbit) -> Attractor:
    """The motion on an orbit that is proven."""
    record = simulate(machine, orbit.period, orbit.state)
    peaks = record.peak_force.max(axis=0)
    return Attractor(
        nature="periodic", period=orbit.period, peaks=peaks, state=orbit.state, states=record.states, orbit=orbit
    )
