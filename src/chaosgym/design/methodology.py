r"""The design methodology of thesis 5.6: whether a machine meets its criteria anywhere within its tolerances.

    I    modelling           the machine: its parameters, with their provenance
    II   variation region    one or two tolerances of each parameter, wear included           ``variation_region``
    III  simulation          the nominal machine and a series of machines over the region     ``build_series``
    IV   nature              the Two-Step Test on each; statistics until they converge        ``settled_run``
    V    classification      Type I, II or III over the region                                ``response_type``
    VI   evaluation          I: the trend; II: the worst case; III: statistics                ``evaluate``
    VII  verdict             against the criteria; if it fails, change and go back to I       ``improve``

Type I: peak forces follow a trend, log F = log F_0 + sum b_i d_i with deviations d_i in tolerances; the evaluation
takes the trend to the unfavourable corner of the region, or to the worst machine found if that is worse. With no
tolerances it is the classical answer for the nominal machine. Type II: the largest peak found anywhere in the region;
so too where motions of different force coexist at the nominal machine, since no share of them is known. Type III
otherwise: the peaks of all machines of the region together, each machine equally likely; the verdict takes the
unfavourable end of the confidence interval.

Together is not one by one: in a region of Type III some machines live much longer than others. So a share of the
machines must meet the criteria by their own statistics too, whatever the type.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from chaosgym.design.bearing import BearingEvaluation, Criteria, evaluate
from chaosgym.design.bending import BendingLife, bending_life
from chaosgym.design.bent_section import Bending
from chaosgym.design.checks import Check, Verdict, checks_of, enough, further_checks, verdict_of
from chaosgym.design.fatigue import equivalent_force
from chaosgym.design.reliability import time_blocks
from chaosgym.design.runs import DIAGNOSIS_BUDGET, NOMINAL_BUDGET, MachineSeries, SettledRun, build_series, settled_run
from chaosgym.design.statistics import Convergence, convergence
from chaosgym.design.texts import listed
from chaosgym.design.trends import Trend, fit_trend
from chaosgym.design.wear import Wear, WearLife, wear_life
from chaosgym.diagnosis import Neighbour, ResponseType, Tolerance, default_tolerances, diagnose, response_type
from chaosgym.diagnosis.type_rule import FORCE_CHANGE
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.plain import Result, plain
from chaosgym.series import Type

SERIES_SIZE = 32
"""Machines of the series that represents the region."""


class AtSpeed(NamedTuple):
    """One speed of a load collective: in the unit of its field, its share of the operating time, and what is found."""

    speed: float
    share: float
    assessment: "Assessment"


@dataclass(frozen=True, kw_only=True)
class Assessment(Result):
    """The result of the methodology for one machine.

    Attributes
    ----------
    machine, criteria
        What was asked.
    region
        Tolerance of each field over which it was asked.
    response
        Type of the response over the region, and its evidence.
    nominal
        Response of the nominal machine.
    convergence
        Cycles that its statistics take.
    series
        Machines of the region.
    trend
        How the force follows the tolerances; its slopes are the sensitivities.
    nominal_evaluation
        Of the nominal machine alone, by its own statistics.
    evaluation
        The one that the type asks for.
    checks
        Each criterion.
    verdict
        "meets", "fails", "undetermined" where the nominal response is, or "not judged" without a criterion.
    machines_that_meet
        Share of the series, each judged by its own statistics; NaN without a life or a reliability that is required.
    bending
        How long the flexible part lasts; None if it is left out.
    wear
        How the joint of the nominal machine wears; None if it is left out.
    collective
        The speeds of a duty of several, whose evaluation, checks and verdict these are; empty for one speed.
    """

    shows = (
        "machine=machine.name stated_by=criteria.stated region verdict response cycles=convergence evaluation "
        "nominal_evaluation checks not_judged bending wear"
    )

    machine: Machine
    criteria: Criteria
    region: Mapping[str, Tolerance]
    response: ResponseType
    nominal: SettledRun
    convergence: Convergence
    series: MachineSeries
    trend: Trend
    nominal_evaluation: BearingEvaluation
    evaluation: BearingEvaluation
    checks: tuple[Check, ...]
    verdict: Verdict
    machines_that_meet: float
    bending: BendingLife | None = None
    wear: WearLife | None = None
    collective: tuple[AtSpeed, ...] = ()

    def __repr__(self) -> str:
        return f"<{self.machine.name}: Type {self.response.type}, {self.verdict}>"

    @property
    def cycle_period(self) -> float:
        """Mean duration of a cycle in operation [s]."""
        parts = self.collective or (AtSpeed(0.0, 1.0, self),)
        return 1.0 / sum(part.share / part.assessment.machine.cycle_period for part in parts)

    @property
    def types(self) -> tuple[Type, ...]:
        """Type at each speed of the duty."""
        return tuple(part.assessment.type for part in self.collective) or (self.type,)

    @property
    def type(self) -> Type:
        """Type of the response."""
        return self.response.type

    @property
    def not_judged(self) -> list[str]:
        """One line for each question that no criterion asks, with what to state."""
        parts = {"bending life": self.bending, "wear life": self.wear}
        lines = [f"{name}: not judged; state life" for name, part in parts.items() if part is not None]
        return self.criteria.not_judged + (lines if self.criteria.life is None else [])

    @property
    def judged(self) -> str:
        """The verdict, by which criteria, and who stated these."""
        if not self.checks:
            why = "no criterion is complete" if self.criteria.asked else "no criterion is stated"
            return f"not judged, since {why}"
        names = [f"{check.name} ({check.stated})" for check in self.checks]
        return f"{self.verdict}, judged by {listed(names)}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON; None stands for an infinite life, and for what is not asked."""
        runs, meeting = self.series.runs, self.machines_that_meet
        nominal = {name: getattr(self.nominal, name) for name in ("nature", "period", "reason")}
        own = {
            "parameters": {name: getattr(self.machine, name) for name in parameters_of(self.machine)},
            "criteria": {name: getattr(self.criteria, name) for name in parameters_of(self.criteria)},
            "nominal": {**nominal, "cycles": len(self.nominal.peaks), "largest_peak_N": self.nominal.largest_peak},
            "sensitivities": dict(zip(self.trend.parameters, self.trend.slopes, strict=True)),
            "series": {
                "machines": len(runs),
                "share_that_meets": meeting,
                "largest_peak_N": [run.largest_peak for run in runs],
                "nature": [run.nature for run in runs],
            },
        }
        return {**super().as_dict(), **plain(own)}


def assess(
    machine: Machine,
    tolerances: Mapping[str, Tolerance] | None = None,
    criteria: Criteria | None = None,
    *,
    series_size: int = SERIES_SIZE,
    further: Sequence[Neighbour] = (),
    bending: Bending | None = None,
    wear: Wear | None = None,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> Assessment:
    """Take a machine through phases I to VII.

    Parameters
    ----------
    machine
        The nominal machine.
    tolerances
        Region by field, see ``variation_region``; the usual tolerances of the machine if None.
    criteria
        Bearing data and requirements; what they do not state is not judged.
    series_size
        Machines that represent the region.
    further
        Machines of the region that were run already: they count for the type and for the largest force.
    bending
        Section of the flexible part that must last as long as the surface; left out if None.
    wear
        Data of Archard's law, by which the joint must last as long; left out if None.
    seed
        Of the series and the bootstrap.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    ParameterError
        If a tolerance names no field, or leads out of the field's range.
    SimulationError
        If a run can't be finished.

    Examples
    --------
    >>> from chaosgym.design import Criteria, assess
    >>> beam = chaosgym.ImpactBeam(excitation_frequency=10.0)
    >>> assess(beam, criteria=Criteria(load_rating=500.0, life=1000.0), series_size=4)
    <impact-beam: Type I, meets>
    >>> assess(beam, series_size=4)
    <impact-beam: Type I, not judged>
    """
    region = default_tolerances(machine) if tolerances is None else dict(tolerances)
    criteria = (criteria or Criteria()).at(machine.cycle_period)
    exponent = criteria.life_exponent
    centre = diagnose(machine, budget=NOMINAL_BUDGET)
    nominal = settled_run(machine, verdict=centre, until_converged=True, budget=NOMINAL_BUDGET)
    series = build_series(machine, region, series_size, seed=seed, workers=workers, progress=progress)
    built = [*series.built, *further]
    response = response_type(machine, region, budget=DIAGNOSIS_BUDGET, centre=centre, workers=workers).over(built)
    force = equivalent_force(nominal.worse_side(exponent), exponent)
    forces = np.array([equivalent_force(run.worse_side(exponent), exponent) for run in series.runs])
    trend = fit_trend(series.parameters, series.shares, forces, force)
    own = evaluate(time_blocks(nominal.worse_side(exponent)), criteria, "statistics of the nominal machine", seed)
    evaluation = _by_type(response, built, nominal, series, trend, criteria, seed)
    share = _share_that_meets(series.runs or (nominal,), criteria, seed)
    bent = None if bending is None else bending_life((nominal, *series.runs), bending, workers=workers)
    worn = None if wear is None else wear_life(machine, wear, workers=workers)
    checks = (
        *checks_of(response.type, evaluation, share, criteria),
        *further_checks(bent, worn, criteria, machine.cycle_period),
    )
    return Assessment(
        machine=machine,
        criteria=criteria,
        region=region,
        response=response,
        nominal=nominal,
        convergence=convergence(nominal.worse_side(exponent)),
        series=series,
        trend=trend,
        nominal_evaluation=own,
        evaluation=evaluation,
        checks=checks,
        verdict=verdict_of(response.type, checks),
        machines_that_meet=share,
        bending=bent,
        wear=worn,
    )


def _by_type(
    response: ResponseType,
    built: Sequence[Neighbour],
    nominal: SettledRun,
    series: MachineSeries,
    trend: Trend,
    criteria: Criteria,
    seed: int,
) -> BearingEvaluation:
    exponent = criteria.life_exponent
    found = [one.largest_peak for one in built] + [point.largest_peak for point in response.neighbours]
    worst = float(np.nanmax([nominal.largest_peak, *found, *response.coexisting_peaks]))
    if response.type == "I":
        own = nominal.worse_side(exponent)
        factor = max(trend.worst_factor, worst / own.max()) if own.any() else 1.0
        peaks = factor * own
        return evaluate(
            [peaks], criteria, "Type I: the trend, taken to the unfavourable corner of the tolerances", seed
        )
    blocks = [run.worse_side(exponent) for run in (nominal, *series.runs)]
    unseen = worst > (1.0 + FORCE_CHANGE) * max(float(block.max(initial=0.0)) for block in blocks)
    if response.type == "II" or response.coexists or unseen:
        mixed = "motions coexist, and which one runs depends on how it started: " if response.type == "III" else ""
        why = mixed if response.coexists or not unseen else "a motion in the tolerances exceeds all of the series: "
        method = f"Type {response.type}: {why}the largest peak force found in the tolerances, in every cycle"
        return evaluate([np.array([worst])], criteria, method, seed)
    if len(blocks) == 1:
        return evaluate(time_blocks(blocks[0]), criteria, "Type III: statistics of the nominal machine", seed)
    return evaluate(blocks, criteria, "Type III: statistics over all machines in the tolerances", seed)


def _share_that_meets(runs: tuple[SettledRun, ...], criteria: Criteria, seed: int) -> float:
    """Share of machines whose own life and reliability, without confidence interval, suffice."""
    if not criteria.judges_machines:
        return float("nan")
    exponent = criteria.life_exponent
    own = [evaluate([run.worse_side(exponent)], criteria, "", seed) for run in runs]
    return float(np.mean([enough(one.life, one.reliability, criteria) for one in own]))
