r"""What the model of a machine says of a record: periodic with noise, chaotic, or not this machine.

A record of one peak a cycle hides most of the state, and random scatter hides the rest. The model knows the state. It
is run at many machines within the tolerances, with noise of many levels on speed, force and gap from cycle to cycle;
those whose records look like the measured one tell what the machine does without noise, and how wide its gap is.

This is approximate Bayesian computation. A draw is accepted if its ``record_figures`` agree with the measured ones: if
their root mean square difference, each in what sampling and the model may err by, is below one. Later rounds draw
around the best ones, and draws are weighed by the prior over what they were drawn from.

References
----------
M. Beaumont, W. Zhang, D. Balding, Approximate Bayesian computation in population genetics, Genetics 162 (2002), 2025.
J.-M. Cornuet, J.-M. Marin, A. Mira, C. Robert, Adaptive multiple importance sampling, Scand. J. Stat. 39 (2012), 798.
E. Ionides, Truncated importance sampling, J. Comput. Graph. Stat. 17 (2008), 295.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from chaosgym.arrays import Array
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.errors import DiagnosisError
from chaosgym.fit.model_draws import (
    AFRESH,
    TRANSIENT,
    Draw,
    Prior,
    compared,
    figures,
    names_of,
    near,
    other_start,
    prior_of,
    simulated,
    weights_of,
)
from chaosgym.machines.machine import Machine
from chaosgym.plain import Result
from chaosgym.recordings.judge import unsteady
from chaosgym.recordings.measured_verdict import MeasuredVerdict
from chaosgym.series.noise import repair, stated_error
from chaosgym.series.verdict import Nature

FEWEST_CYCLES, MOST_CYCLES = 32, 200
"""Cycles below which a record is refused, and cycles that each draw is simulated for; longer records are averaged."""

BATCHES = 6
"""Parts of a record whose figures tell how much sampling moves them."""

FIRST, LATER, ROUNDS = 120, 60, 6
"""Draws of the first round, from the prior, and of each later one, around the best; rounds at the most, and twice as
many while some draws agree with the record, but too few. Each parameter that is estimated doubles the first."""

BEST = 24
"""Draws around which the next round draws."""

FITS, FEWEST, MOST, ENOUGH = 1.0, 8, 40, 0.5
"""Root mean square difference up to which a draw agrees with the record, how many must, how many count at most, and the
difference of the last of these at which no further round is drawn."""

SURE = 0.95
"""Share of the posterior from which a nature is told."""

TOLD = 0.5
"""Share of its prior's width (in logarithms) below which an interval tells a parameter."""

INTERVAL = (0.05, 0.5, 0.95)
"""Ends of an interval of 90 %, and its median."""

BUDGET = 400
"""Cycles in which the noise-free machine of an accepted draw is judged."""


class Estimate(NamedTuple):
    """A parameter of the machine: median and 90 % interval, in its unit, and whether the record tells it."""

    value: float
    low: float
    high: float
    told: bool


@dataclass(frozen=True)
class ModelFit(Result):
    """What the model says of a record.

    Attributes
    ----------
    nature
        Of the machine without noise; "undetermined" where the model does not fit or several natures do.
    period
        Of a periodic one; None where several periods do.
    reason
        One sentence for people.
    fits
        Whether at least eight simulated records agree with the measured one.
    shares
        Share of the posterior that each nature has.
    draws, accepted
        Records simulated, and those that agree with the measured one.
    difference
        Root mean square difference of the nearest one; above 1 it does not agree.
    noise
        Posterior medians of the standard deviations of noise, as shares: by operating field, and of the "sensor".
    estimates
        By field, those that were asked for.
    """

    nature: Nature
    period: int | None
    reason: str
    fits: bool
    shares: Mapping[str, float]
    draws: int
    accepted: int
    difference: float
    noise: Mapping[str, float]
    estimates: Mapping[str, Estimate]

    @property
    def words(self) -> str:
        """Nature and period, such as "periodic, period 2"."""
        return f"{self.nature}, period {self.period}" if self.period else self.nature


def with_record(found: ModelFit, alone: MeasuredVerdict) -> ModelFit:
    """What the model says beside the verdict on the record alone: undetermined where they contradict each other.

    Random scatter around a pattern contradicts nothing: the model may know that it is chaos.
    """
    natures = {found.nature, alone.diagnosis.nature}
    if "undetermined" in natures or len(natures) == 1 or alone.random:
        return found
    reason = f"the record alone is {alone.diagnosis.words}, its model says {found.words}: {found.reason}"
    return replace(found, nature="undetermined", period=None, reason=reason)


def model_fit(
    machine: Machine,
    peaks: ArrayLike,
    *,
    surfaces: Sequence[int] | None = None,
    larger: bool = False,
    sensor_sigma: float | None = None,
    estimate: Sequence[str] = (),
    seed: int = 0,
) -> ModelFit:
    """Compare a record with what a machine does within its tolerances, with noise on speed, force and gap.

    Parameters
    ----------
    machine
        Model of the machine at its nominal parameters; its tolerances are those of ``response_type``.
    peaks : (cycles,) or (cycles, sensors)
        Measured peak forces [N], at least 32 cycles.
    surfaces
        Columns of ``CycleRecord.peak_force`` that the sensors read; by default what the machine's sensor shows.
    larger
        The one sensor reads the larger side of each cycle, as the peaks of a series are taken.
    sensor_sigma
        Standard deviation of a reading [N], if it is known; else up to 3 % of the mean are tried.
    estimate
        Fields that are looked for up to a factor of two either way, whatever their tolerance; "clearance" is that of
        the monitored joint.
    seed
        Of the draws.

    Raises
    ------
    DiagnosisError
        If the record is too short or not steady, a reading is not finite, a sensor reads nothing, or a field can't be
        estimated.

    Examples
    --------
    >>> from chaosgym.fit.model_fit import model_fit
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=12.0, n_modes=1, fitted_modes=0)
    >>> noise = np.random.default_rng(1).normal(size=32)
    >>> found = model_fit(beam, chaosgym.simulate(beam, 32, transient=100).peak_force[:, 0] * (1.0 + 0.01 * noise))
    >>> found.nature, found.period
    ('periodic', 1)
    """
    measured = _checked(peaks)
    prior = prior_of(machine, estimate)
    if surfaces is not None and len(surfaces) != measured.shape[1]:
        raise DiagnosisError(f"{len(surfaces)} surfaces are named for {measured.shape[1]} sensors; needed: as many")
    for surface in surfaces or ():
        if not 0 <= surface < len(machine.sides):
            raise DiagnosisError(f"surface {surface} is none of {machine.name}; allowed: 0 to {len(machine.sides) - 1}")
    if surfaces is None and measured.shape[1] > 1:
        raise DiagnosisError(f"{measured.shape[1]} sensors read surfaces that are not named; state them")
    told = stated_error(None, sensor_sigma)
    length = min(len(measured), MOST_CYCLES)
    pieces = np.array([figures(measured[k : k + length]) for k in range(0, len(measured) - length + 1, length)])
    wanted = pieces.mean(axis=0)
    scale = np.hypot(names_of(measured.shape[1])[1], _sampling(measured, length, len(pieces)))
    rng = np.random.default_rng(seed)

    def read(record: Any) -> Array:
        forces = record.peak_force
        if surfaces is not None:
            return np.asarray(forces[:, list(surfaces)])
        return np.asarray(forces.max(axis=1) if larger else machine.sensed(forces))[:, None]

    share = None if told is None else told.sigma / float(measured.mean())
    draws: list[Draw] = []
    proposals: list[tuple[int, Array, Array]] = []
    for number in range(2 * ROUNDS):
        count = LATER if number else FIRST * 2 ** len(prior.wide)
        draws.sort(key=lambda draw: draw.difference)
        if number > 2 and len(draws) >= MOST and draws[MOST - 1].difference < ENOUGH:
            break
        agree = sum(draw.difference < FITS for draw in draws)
        if number >= ROUNDS and not 0 < agree < FEWEST:
            break
        best = draws[:BEST] if number else []
        centres = np.array([draw.place for draw in best])
        widths = np.clip(0.7 * centres.std(axis=0), 0.04, 0.3) if best else np.empty(0)
        proposals.append((count, centres, widths))
        for k in range(count):
            afresh = not best or rng.uniform() < AFRESH
            parent = None if afresh else best[int(rng.integers(len(best)))]
            place = rng.uniform(size=prior.size) if parent is None else near(parent.place, widths, rng)
            start = parent.final if parent else other_start(draws, k)
            drawn = simulated(prior, place, start, length, rng, read)
            if drawn is not None:
                draws.append(compared(place, *drawn, wanted, scale, share, rng))
    if not draws:
        raise DiagnosisError(f"no machine of {machine.name} within the tolerances can be simulated")
    return _concluded(prior, draws, proposals, names_of(measured.shape[1])[0], wanted)


def usual_cycles(machine: Machine, estimate: Sequence[str] = ()) -> int:
    """Cycles that a comparison of a long record with a machine takes; twice as many where few draws agree with it.

    Examples
    --------
    >>> from chaosgym.fit.model_fit import usual_cycles
    >>> beam = chaosgym.ImpactBeam()
    >>> usual_cycles(beam) < usual_cycles(beam, ["clearance"])
    True
    """
    draws = (FIRST << len(prior_of(machine, estimate).wide)) + LATER * (ROUNDS - 1)
    return draws * (TRANSIENT + MOST_CYCLES)


def _checked(peaks: ArrayLike) -> Array:
    measured = np.asarray(peaks, dtype=float)
    measured = measured[:, None] if measured.ndim == 1 else measured
    if measured.ndim != 2 or not measured.shape[1]:
        raise DiagnosisError(f"the record has shape {np.shape(peaks)}; allowed: (cycles,) or (cycles, sensors)")
    if len(measured) < FEWEST_CYCLES:
        raise DiagnosisError(f"the record has {len(measured)} cycles; a model is compared with {FEWEST_CYCLES} or more")
    if not np.all(np.isfinite(measured)):
        raise DiagnosisError("the record has readings that are not finite; leave their cycles out")
    if np.any(measured.mean(axis=0) <= 0.0):
        raise DiagnosisError("the mean reading is not above 0: no model of a contact force can be compared with it")
    for why in filter(None, map(unsteady, measured.T)):
        raise DiagnosisError(f"the record is not a steady response ({why}); a model is compared with steady ones")
    whole = [repair(readings) for readings in measured.T]
    return measured if any(one.gaps for one in whole) else np.column_stack([one.values for one in whole])


def _sampling(measured: Array, length: int, pieces: int) -> Array:
    """Standard errors of the difference of two records' figures, from sampling: those of noise, or by batch means."""
    names, plain = names_of(measured.shape[1])[0], 1.5 / math.sqrt(length)
    told = figures(measured)
    errors = np.array(
        [plain * (math.exp(told[place + 1]) if name == "mean" else 1.0) for place, name in enumerate(names)]
    )
    if len(measured) >= BATCHES * FEWEST_CYCLES // 2:
        batches = np.array([figures(batch) for batch in np.array_split(measured, BATCHES)])
        share = math.sqrt(len(measured) / (BATCHES * length))
        errors = np.maximum(errors, share * batches.std(axis=0))
    return np.asarray(errors * math.sqrt(1.0 + 1.0 / pieces))


def _quantiles(values: Array, weights: Array) -> list[float]:
    order = np.argsort(values)
    below = np.cumsum(weights[order]) - 0.5 * weights[order]
    return [float(np.interp(share, below, values[order])) for share in INTERVAL]


def _concluded(
    prior: Prior,
    draws: Sequence[Draw],
    proposals: Sequence[tuple[int, Array, Array]],
    names: Sequence[str],
    wanted: Array,
) -> ModelFit:
    """The verdict on all draws."""
    ordered = sorted(draws, key=lambda draw: draw.difference)
    nearest, accepted = ordered[0], [draw for draw in ordered[:MOST] if draw.difference < FITS]
    if len(accepted) < FEWEST:
        agree = f"{len(accepted)} agree, and {FEWEST} are needed; " if accepted else ""
        reason = f"the model does not fit: of {len(draws)} simulated records {agree}{_worst(nearest, names)}"
        return ModelFit("undetermined", None, reason, False, {}, len(draws), len(accepted), nearest.difference, {}, {})
    weights = weights_of(accepted, proposals)
    natures: dict[str, float] = {}
    periods: dict[int, float] = {}
    for draw, weight in zip(accepted, weights.tolist(), strict=True):
        verdict = diagnose_alone(prior.machine_at(draw.place), initial_state=draw.final, budget=BUDGET)
        natures[verdict.nature] = natures.get(verdict.nature, 0.0) + weight
        if verdict.period:
            periods[verdict.period] = periods.get(verdict.period, 0.0) + weight
    noise = {
        field: _quantiles(np.array([prior.levels(draw.place)[field] for draw in accepted]), weights)[1]
        for field in prior.noisy
    }
    noise["sensor"] = _quantiles(np.array([draw.sensor for draw in accepted]), weights)[1]
    # the nearest are near each other too: an interval takes all that agree
    agreeing = [draw for draw in ordered if draw.difference < FITS]
    estimates = {field: _estimate(prior, field, agreeing, weights_of(agreeing, proposals)) for field in prior.wide}
    leading = max(natures, key=lambda name: natures[name])
    told = ", ".join(f"{name} {100.0 * share:.3g} %" for name, share in sorted(natures.items(), key=lambda n: -n[1]))
    among = f"of {len(draws)} simulated records {len(accepted)} agree; without noise their machines are {told}"
    sure = natures[leading] >= SURE and leading != "undetermined"
    nature: Any = leading if sure else "undetermined"
    commonest = max(periods, key=lambda k: periods[k], default=0)
    period = commonest if nature == "periodic" and periods[commonest] >= SURE * natures["periodic"] else None
    reason = among if sure else f"the model can't tell: {among}"
    return ModelFit(
        nature, period, reason, True, natures, len(draws), len(accepted), nearest.difference, noise, estimates
    )


def _worst(nearest: Draw, names: Sequence[str]) -> str:
    """In what the nearest draw differs most."""
    if not math.isfinite(nearest.difference):
        return "none has a force where the sensor reads one"
    place = int(np.argmax(np.abs(nearest.parts)))
    way = "above" if nearest.parts[place] > 0.0 else "below"
    return (
        f"the nearest differs by {nearest.difference:.2g} times what sampling and model may err by, most in "
        f"{names[place]}, which is {way} the measured one"
    )


def _estimate(prior: Prior, field: str, accepted: Sequence[Draw], weights: Array) -> Estimate:
    place = list(prior.tolerances).index(field)
    values = np.array([prior.value(field, float(draw.place[place])) for draw in accepted])
    low, middle, high = _quantiles(values, weights)
    ends = prior.ends(field)
    return Estimate(middle, low, high, math.log(high / low) < TOLD * math.log(ends[1] / ends[0]))
