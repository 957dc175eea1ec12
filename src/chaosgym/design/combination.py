r"""What tolerances do in combination: how probable each type is, and which parameter matters most (thesis 5.5, 5.6).

Of the machines built to the tolerances each has a type of its own: III if its response does not repeat, II if it
repeats and its largest peak force exceeds the nominal one by 10 %, I otherwise; III throughout where periodic and other
responses are mixed (case III of 5.5.1), or where motions of different force coexist. Shares of them are probabilities,
with intervals of Clopper and Pearson; machines of a Sobol sequence lie more evenly than independent ones, for which
these hold.

The total index of a parameter is the share of the variance that it takes part in, alone or together with others:

    S_i = E[V(Y | all but x_i)] / V(Y)

It is 1 at the most; an estimate from few machines may be above.

Y is the largest peak force, or the logarithm of the life. Total indices add up to more than one where parameters act
together, as they do in chaos.

References
----------
C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits, Biometrika 26 (1934), 404-413.
A. Saltelli et al., Variance based sensitivity analysis of model output, Computer Physics Communications 181 (2010),
259-270; computed by ``scipy.stats.sobol_indices``.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, get_args

import numpy as np

from chaosgym.arrays import Array
from chaosgym.design.fatigue import equivalent_force
from chaosgym.design.guidelines import case_of
from chaosgym.design.methodology import Assessment
from chaosgym.design.runs import SettledRun, deviating, worse_side
from chaosgym.diagnosis import Neighbour, Tolerance
from chaosgym.diagnosis.type_rule import FORCE_CHANGE
from chaosgym.errors import SimulationError
from chaosgym.machines import Machine
from chaosgym.plain import Result, plain
from chaosgym.series import Nature, Type
from chaosgym.simulation import simulate
from chaosgym.simulation.parallel import parallel_map

BASE = 64
"""Machines of the base sample of total indices; each parameter adds as many, and two base samples are drawn."""

TRANSIENT, RECORDED = 60, 60
"""Cycles of each machine of that sample, before and while peaks are taken."""

LEAST_FORCE = 1e-2
"""Share of the largest equivalent force below which a machine counts as one without wear: its life has no logarithm."""

SAME = 1e-9
"""Spread, as a share of the largest value, below which an output does not vary."""

RESAMPLES = 400
"""Bootstrap samples of an index's interval."""


class Probability(NamedTuple):
    """A share of machines, and the ends of its confidence interval."""

    share: float
    low: float
    high: float


def probability(count: int, machines: int, confidence: float = 0.95) -> Probability:
    """Share of machines with its interval of Clopper and Pearson.

    Parameters
    ----------
    count
        Machines that have a property.
    machines
        All of them, 1 or more.
    confidence
        Of the interval.

    Examples
    --------
    >>> [round(value, 4) for value in probability(0, 10)]
    [0.0, 0.0, 0.3085]
    """
    from scipy.stats import binomtest  # slow to import, and few questions need it

    interval = binomtest(count, machines).proportion_ci(confidence, method="exact")
    return Probability(count / machines, float(interval.low), float(interval.high))


class Influence(NamedTuple):
    """Total index of one parameter, and its interval; of the largest peak force, and of the life's logarithm."""

    parameter: str
    peak: Probability
    life: Probability


@dataclass(frozen=True)
class Combination(Result):
    """What tolerances do in combination.

    Attributes
    ----------
    types
        Probability of each type, over the machines built.
    natures
        Probability of each nature that occurs.
    meeting
        Probability that a machine reaches the required life and reliability by its own statistics; None if neither is
        required.
    influences
        Of each toleranced parameter; empty without tolerances, where forces do not vary, or where a run can't be
        finished.
    sampled
        Machines that were run for the influences.
    """

    shows = "types natures meeting machines_of_indices=sampled"

    types: Mapping[str, Probability]
    natures: Mapping[str, Probability]
    meeting: Probability | None
    influences: tuple[Influence, ...]
    sampled: int

    def most(self, what: str) -> Influence | None:
        """The parameter that matters most for "peak" or "life"."""
        return max(self.influences, key=lambda one: getattr(one, what).share, default=None)

    @property
    def told(self) -> list[str]:
        """Lines for people."""
        meeting = "" if self.meeting is None else f"; of meeting what is required {_told(self.meeting)}"
        shares = sorted(((kind, one) for kind, one in self.types.items() if one.share), key=lambda pair: -pair[1].share)
        told = ", ".join(f"Type {kind} {_told(one)}" for kind, one in shares)
        all_of_them = self.types["III"].share == 1.0 and self.natures["periodic"].share > 0.0
        why = "; the periodic ones too, since they lie among others" if all_of_them else ""
        lines = [f"probability of a machine built within the tolerances: {told}{why}{meeting}"]
        for what, name in (("peak", "largest peak force"), ("life", "life")):
            first = self.most(what)
            if first is not None:
                index: Probability = getattr(first, what)
                share = f"total index {index.share:.2f}, {index.low:.2f} to {index.high:.2f}"
                share += "; above 1 is the error of a small sample" if index.share > 1.0 else ""
                lines.append(f"matters most for the {name}: {first.parameter.replace('_', ' ')} ({share})")
        return lines

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        indices = {one.parameter: {"largest_peak": one.peak, "life": one.life} for one in self.influences}
        return {**super().as_dict(), "total_indices": plain(indices)}


def _told(found: Probability) -> str:
    return f"{found.share:.0%} ({found.low:.0%} to {found.high:.0%})"


def own_type(run: SettledRun, nominal_peak: float) -> Type:
    """Type of one machine among those built to the tolerances, beside the nominal largest peak [N].

    Examples
    --------
    >>> from chaosgym.design.combination import own_type
    >>> from chaosgym.design import Criteria, assess
    >>> found = assess(chaosgym.ImpactBeam(excitation_frequency=10.0), series_size=4)
    >>> own_type(found.nominal, nominal_peak=35.0)
    'II'
    """
    if run.nature == "undetermined":
        return "undetermined"
    if run.nature != "periodic":
        return "III"
    return "II" if run.largest_peak > (1.0 + FORCE_CHANGE) * nominal_peak else "I"


def combination(
    found: Assessment,
    further: Sequence[Neighbour] = (),
    *,
    base: int = BASE,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> Combination:
    """Probabilities and total indices over the tolerances of an assessed machine.

    Parameters
    ----------
    found
        With the machines that were built to the tolerances.
    further
        More machines of its tolerances, which tell the case of 5.5.1.
    base
        Machines of the base sample of total indices, a power of 2; 0 for no indices.
    seed
        Of the sample and of the bootstrap.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    SimulationError
        If a run can't be finished.

    Examples
    --------
    >>> from chaosgym.design import assess
    >>> from chaosgym.design.combination import combination
    >>> found = assess(chaosgym.ImpactBeam(excitation_frequency=10.0), series_size=4)
    >>> combination(found, base=8).types["I"].share
    1.0
    """
    runs = found.series.runs or (found.nominal,)
    confidence = found.criteria.confidence
    mixed = case_of(found, further) == "III" or found.response.coexists
    types = ["III" if mixed else own_type(run, found.nominal.largest_peak) for run in runs]
    natures = [run.nature for run in runs]
    return Combination(
        _shares(types, get_args(Type), confidence),
        _shares(natures, get_args(Nature), confidence),
        None
        if math.isnan(found.machines_that_meet)
        else probability(round(found.machines_that_meet * len(runs)), len(runs), confidence),
        influences(
            found.machine,
            found.region,
            found.criteria.life_exponent,
            confidence,
            base=base,
            seed=seed,
            workers=workers,
            progress=progress,
        ),
        base * (2 + len(found.region)) if found.region else 0,
    )


def _shares(found: Sequence[str], kinds: Sequence[str], confidence: float) -> dict[str, Probability]:
    return {kind: probability(found.count(kind), len(found), confidence) for kind in kinds}


def influences(
    machine: Machine,
    region: Mapping[str, Tolerance],
    exponent: float,
    confidence: float = 0.95,
    *,
    base: int = BASE,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> tuple[Influence, ...]:
    """Total index of each toleranced parameter, each machine from rest.

    Parameters
    ----------
    machine
        The nominal machine.
    region
        Tolerance by field; parameters are spread evenly over them.
    exponent
        Of the life law.
    confidence
        Of the intervals, by bootstrap.
    base, seed, workers, progress
        As for ``combination``.

    Returns
    -------
    tuple of Influence
        Empty where there are none to tell, see ``Combination``.

    Examples
    --------
    >>> from chaosgym.design.combination import influences
    >>> from chaosgym.diagnosis import Tolerance
    >>> region = {"clearance": Tolerance(0.05), "length": Tolerance(0.001)}
    >>> found = influences(chaosgym.ImpactBeam(excitation_frequency=10.0), region, 10.0 / 3.0, base=8)
    >>> [one.parameter for one in found]
    ['clearance', 'length']
    """
    names = tuple(region)
    if not names or not base:
        return ()

    def forces(shares: Array) -> tuple[float, float]:
        peaks = simulate(deviating(machine, region, shares), RECORDED, transient=TRANSIENT).peak_force
        return float(np.max(peaks)), equivalent_force(worse_side(peaks, exponent), exponent)

    def model(points: Array) -> Array:
        label = "total indices" if progress else None
        peak, force = np.array(parallel_map(forces, list(points), workers=workers, progress=label)).T
        return np.array([peak, np.log(np.maximum(force, LEAST_FORCE * force.max() or 1.0))])

    try:
        found = total_indices(model, len(names), base, confidence, seed)
    except SimulationError:  # one of hundreds at the rim of the tolerances: the report tells the rest
        return ()
    return tuple(Influence(*row) for row in zip(names, *found, strict=True)) if all(found) else ()


def total_indices(
    model: Callable[[Array], Array], dimensions: int, base: int, confidence: float = 0.95, seed: int = 0
) -> list[list[Probability]]:
    """Total index of each input of a model, with its bootstrap interval, for each output; none for a constant one.

    Parameters
    ----------
    model
        Outputs (outputs, n) at points (n, dimensions), whose coordinates are -1 to 1.
    dimensions
        Inputs.
    base
        Points of a base sample, a power of 2; the model is asked for ``base * (dimensions + 2)`` points.
    confidence
        Of the intervals.
    seed
        Of the sample and of the bootstrap.

    Examples
    --------
    >>> from chaosgym.design.combination import total_indices
    >>> def sum_of_two(points):
    ...     return points[None, :, 0] + 2.0 * points[None, :, 1]
    >>> [indices] = total_indices(sum_of_two, 2, base=256)
    >>> [round(one.share, 1) for one in indices]
    [0.2, 0.8]
    """
    from scipy import stats  # slow to import, and few questions need it

    random = np.random.default_rng(seed)
    sample = 2.0 * stats.qmc.Sobol(2 * dimensions, rng=random).random(base).T - 1.0
    first, second = sample[:dimensions], sample[dimensions:]
    own = np.eye(dimensions, dtype=bool)[:, :, None]
    mixed = np.where(own, second, first)  # (dimensions, dimensions, base): in the k-th, input k is the second sample's
    points = np.concatenate([first[None], second[None], mixed])
    values = model(np.swapaxes(points, 1, 2).reshape(-1, dimensions))
    values = values.reshape(len(values), dimensions + 2, base)
    answers = {"f_A": values[:, 0], "f_B": values[:, 1], "f_AB": np.swapaxes(values[:, 2:], 0, 1)}
    varies = np.ptp(values, axis=(1, 2)) > SAME * np.abs(values).max(axis=(1, 2))
    if not varies.any():
        return [[] for _ in values]
    kept = {name: part[..., varies, :] for name, part in answers.items()}
    drawn = [np.arange(base), *random.integers(base, size=(RESAMPLES, base))]
    found = [stats.sobol_indices(func={n: part[..., one] for n, part in kept.items()}, n=base) for one in drawn]
    index = np.array([np.reshape(one.total_order, (-1, dimensions)) for one in found])
    tail = 50.0 * (1.0 - confidence)
    rows = iter(np.stack([index[0], *np.percentile(index[1:], [tail, 100.0 - tail], axis=0)], axis=-1))
    return [[Probability(*row) for row in next(rows).tolist()] if one else [] for one in varies]
