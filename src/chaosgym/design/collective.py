r"""A load collective: life and reliability of a machine that runs at several speeds (Palmgren-Miner over the speeds).

A machine that spends the share q_i of its operating time at a speed with cycle period T_i, at which alone it would live
H_i hours, lives H hours:

    1 / H = sum q_i / H_i,      w_i = (q_i / T_i) / sum (q_k / T_k)

w_i is the share of its cycles, by which equivalent forces combine, F = (sum w_i F_i^p)^(1/p). Reliability and safety
factor are the least of all speeds, since a surface has to survive each.

References
----------
M. A. Miner, Cumulative damage in fatigue, Journal of Applied Mechanics 12 (1945), A159-A164.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from chaosgym.design.bearing import BearingEvaluation, Criteria, evaluate
from chaosgym.design.bending import BendingLife
from chaosgym.design.checks import checks_of, enough, further_checks, safety_check, verdict_of
from chaosgym.design.fatigue import equivalent_force, required_load_rating
from chaosgym.design.methodology import Assessment, AtSpeed, assess
from chaosgym.design.reliability import Interval
from chaosgym.design.wear import WearLife, wear_over
from chaosgym.diagnosis import Tolerance
from chaosgym.machines import Machine


def assess_duty(
    machine: Machine,
    region: Mapping[str, Tolerance] | None = None,
    criteria: Criteria | None = None,
    duty: Mapping[float, float] | None = None,
    **options: Any,
) -> Assessment:
    """Take a machine through the methodology at every speed of its duty.

    Parameters
    ----------
    machine
        The nominal machine, at its nominal speed.
    region, criteria
        As for ``assess``.
    duty
        Share of the operating time by speed, in nominal speeds; 1 must be among them. None or empty for one speed.
    options
        Of ``assess``. Machines of ``further`` are at the nominal speed.

    Returns
    -------
    Assessment
        Of the nominal speed, whose evaluation, checks and verdict are those of the whole duty.

    Raises
    ------
    ParameterError
        If a speed is out of its range.

    Examples
    --------
    >>> from chaosgym.design import Criteria
    >>> from chaosgym.design.collective import assess_duty
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> found = assess_duty(beam, None, Criteria(load_rating=500.0), {1.0: 0.8, 1.2: 0.2}, series_size=2)
    >>> [part.speed for part in found.collective]
    [10.0, 12.0]
    """
    nominal = assess(machine, region, criteria, **options)
    if not duty:
        return nominal
    speed, elsewhere = getattr(machine, machine.speed_field), {**options, "further": ()}
    parts = []
    for ratio, share in duty.items():
        at = float(f"{ratio * speed:.12g}")
        found = nominal if ratio == 1.0 else assess(machine.at(at), region, criteria, **elsewhere)
        parts.append(AtSpeed(at, share, found))
    return _over(nominal, tuple(parts), options.get("seed", 0))


def _over(nominal: Assessment, parts: tuple[AtSpeed, ...], seed: int) -> Assessment:
    """The nominal assessment with evaluation, checks and verdict of all speeds."""
    rate = sum(part.share / part.assessment.machine.cycle_period for part in parts)
    cycles = [part.share / part.assessment.machine.cycle_period / rate for part in parts]
    criteria = nominal.criteria.at(1.0 / rate)
    evaluation = _evaluation([part.assessment.evaluation for part in parts], cycles, criteria)
    own = _evaluation([part.assessment.nominal_evaluation for part in parts], cycles, criteria)
    share = _share_that_meets(parts, cycles, criteria, seed)
    regular = [part.assessment for part in parts if part.assessment.type in ("I", "II")]
    checks = checks_of("III", evaluation, share, criteria)
    if regular:
        checks += safety_check(min(assessment.evaluation.safety_factor for assessment in regular), criteria)
    bent, worn = _bending(parts, cycles), _wear(nominal, parts)
    checks += further_checks(bent, worn, criteria, 1.0 / rate)
    kinds = [part.assessment.type for part in parts]
    return replace(
        nominal,
        criteria=criteria,
        evaluation=evaluation,
        nominal_evaluation=own,
        checks=checks,
        verdict=verdict_of("undetermined" if "undetermined" in kinds else kinds[0], checks),
        machines_that_meet=share,
        bending=bent,
        wear=worn,
        collective=parts,
    )


def _bending(parts: Sequence[AtSpeed], cycles: Sequence[float]) -> BendingLife | None:
    """Life in bending over all speeds, of each machine; stresses are those of the nominal speed."""
    bent = [part.assessment.bending for part in parts]
    own = next((life for life in bent if life is not None), None)
    if own is None:
        return None
    lives = zip(*(life.lives for life in bent if life is not None), strict=True)
    return replace(own, lives=tuple(miner(row, cycles) for row in lives))


def _wear(nominal: Assessment, parts: Sequence[AtSpeed]) -> WearLife | None:
    """Course of the joint over all speeds, with nature and force of the nominal one."""
    nominal_first = sorted(parts, key=lambda part: part.assessment is not nominal)
    worn = [(part.assessment.wear, part.share) for part in nominal_first]
    lives = [(life, share) for life, share in worn if life is not None]
    return wear_over(*zip(*lives, strict=True)) if lives else None


def miner(lives: Sequence[float], shares: Sequence[float]) -> float:
    """Life of a collective from the life at each of its levels, 1 / L = sum p_i / L_i; both in one unit, NaN if one is.

    Examples
    --------
    >>> miner([1000.0, 4000.0], [0.5, 0.5])
    1600.0
    """
    if any(math.isnan(life) for life in lives):
        return math.nan
    damage = sum(share / life for life, share in zip(lives, shares, strict=True) if share and math.isfinite(life))
    return 1.0 / damage if damage else math.inf


def damage_shares(parts: Sequence[AtSpeed]) -> list[float]:
    """Share of the damage that is done at each speed, by the equivalent force there; zeros where there is none.

    Examples
    --------
    >>> from chaosgym.design import Criteria
    >>> from chaosgym.design.collective import assess_duty, damage_shares
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> found = assess_duty(beam, None, Criteria(load_rating=500.0), {1.0: 0.8, 1.2: 0.2}, series_size=2)
    >>> round(sum(damage_shares(found.collective)), 12)
    1.0
    """
    largest = max(part.assessment.evaluation.force for part in parts) if parts else 0.0
    done = [
        part.share
        / part.assessment.machine.cycle_period
        * (part.assessment.evaluation.force / (largest or 1.0)) ** part.assessment.criteria.life_exponent
        for part in parts
    ]
    return [damage / sum(done) if sum(done) else 0.0 for damage in done]


def _evaluation(speeds: Sequence[BearingEvaluation], cycles: Sequence[float], criteria: Criteria) -> BearingEvaluation:
    force = equivalent_force([part.force for part in speeds], criteria.life_exponent, np.array(cycles) / sum(cycles))
    low, high = (miner([part.life_interval[end] for part in speeds], cycles) for end in (0, 1))
    least = [min(part.reliability_interval[end] for part in speeds) for end in (0, 1)]
    required = criteria.life
    return BearingEvaluation(
        method=f"Palmgren-Miner over {len(speeds)} speeds: each as its type asks for; reliability: the least of them",
        force=force,
        largest_force=max(part.largest_force for part in speeds),
        life=miner([part.life for part in speeds], cycles),
        life_interval=Interval(low, high),
        conservative_life=miner([part.conservative_life for part in speeds], cycles),
        required_load_rating=math.nan
        if required is None
        else required_load_rating(force, required, criteria.life_exponent),
        reliability=min(part.reliability for part in speeds),
        reliability_interval=Interval(*least),
        normal_reliability=min(part.normal_reliability for part in speeds),
        safety_factor=min(part.safety_factor for part in speeds),
    )


def _share_that_meets(parts: Sequence[AtSpeed], cycles: Sequence[float], criteria: Criteria, seed: int) -> float:
    """Share of the series, each of whose machines is the same one at every speed, that lives and endures enough."""
    if not criteria.judges_machines:
        return math.nan
    exponent = criteria.life_exponent
    rows = zip(*(part.assessment.series.runs or (part.assessment.nominal,) for part in parts), strict=True)
    verdicts = []
    for runs in rows:
        own = [evaluate([run.worse_side(exponent)], criteria, "", seed) for run in runs]
        life = miner([evaluation.life for evaluation in own], cycles)
        verdicts.append(enough(life, min(evaluation.reliability for evaluation in own), criteria))
    return float(np.mean(verdicts))
