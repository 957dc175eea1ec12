"""What a design study answers: assessment, map of types around it, life over speed, and changes."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from chaosgym.branches.coexistence import Coexistence
from chaosgym.branches.margins import Margins
from chaosgym.design.bearing import hours_of
from chaosgym.design.brief import DesignBrief
from chaosgym.design.checks import Check
from chaosgym.design.collective import damage_shares
from chaosgym.design.combination import Combination
from chaosgym.design.guidelines import Guideline
from chaosgym.design.methodology import Assessment
from chaosgym.design.peak_impacts import PeakImpactDiagram, filling_cycles
from chaosgym.design.texts import hours_text, life_text
from chaosgym.design.trends import (
    ImpactPlace,
    LifeTrend,
)
from chaosgym.design.trials import Improvement, Trial, force_of_machines
from chaosgym.diagnosis import ResponseMap
from chaosgym.machines.parameters import quantity_of, with_settings
from chaosgym.plain import Result, plain
from chaosgym.version import __version__

NO_TREND = "the gap closes at no speed of the usual range"
"""Why life is not drawn against speed."""

LEFT_OUT = "map of types with other motions in the tolerances, life against speed, total indices, margins and changes"
"""What a study of the verdict alone does without."""


@dataclass(frozen=True)
class DesignStudy(Result):
    """Answer to a design brief.

    Attributes
    ----------
    brief
        What was asked.
    assessment
        Of the machine as it is.
    improvement
        Ranked changes; None if the machine meets its criteria as it is. Where nothing is judged they are compared.
    map
        Types around the nominal speed and clearance; None where these do not vary or leave their range.
    life_over_speed
        Over the machine's usual range; None without contact anywhere in it.
    diagram
        Where the peak impacts act.
    impacts
        The same, in figures, at the clearances of the brief.
    combination
        What the tolerances do together.
    guidelines
        The thesis' guidelines, as sentences on this machine.
    margins
        How far each tolerance is from a loss of stability; None unless the nominal response is proven to be periodic.
    coexistence
        Where each of several motions of the nominal machine is stable along the speed; None where there is one alone.
    force_of_every_impact
        Equivalent force a cycle [N] if every impact counts, by rainflow counting, and not the peak of a cycle alone.
    seed
        Of the series and the bootstrap.
    verdict_only
        Whether all is left out that the verdict does not rest on.
    """

    shows = (
        "seed verdict_only model=brief.accuracy combination guidelines margins coexistence improvement map "
        "life_over_speed force_of_every_impact_N=force_of_every_impact"
    )

    brief: DesignBrief
    assessment: Assessment
    improvement: Improvement | None
    map: ResponseMap | None
    life_over_speed: LifeTrend | None
    diagram: PeakImpactDiagram
    impacts: tuple[ImpactPlace, ...]
    combination: Combination
    guidelines: tuple[Guideline, ...]
    margins: Margins | None
    coexistence: Coexistence | None
    force_of_every_impact: float
    seed: int
    verdict_only: bool = False

    @property
    def cycles_to_fill(self) -> int | None:
        """Cycles after which the Peak Impact Diagram has taken shape (5.4.3); None if it has not, or has no impact."""
        return filling_cycles(self.diagram) if len(self.diagram.force) else None

    def lines(self) -> list[str]:
        """Return lines for people."""
        found, best = self.assessment, self.improvement.best if self.improvement is not None else None
        lines = [
            f"{found.machine.name}: {found.judged}",
            f"  Type {found.type}: {found.response.reason}; {found.evaluation.method.partition(': ')[2]}",
            f"  other motions: {found.response.centre.statement.other_motions}",
            *(f"  {line}" for line in self.beside_lines),
            f"  {found.series.told}",
            *(f"  {line}" for line in self.combination.told),
            *(f"  {line}" for line in ([] if self.map is None else self.map.calm.lines)),
            *(f"  {line}" for line in self.duty_lines),
            *(f"  {check.name:19s} {_told(check, found.cycle_period)}" for check in found.checks),
            *(f"  {line}" for line in self.life_lines),
            *(f"  {line}" for line in found.not_judged),
            f"  largest peak        {found.evaluation.largest_force:.1f} N, equivalent {found.evaluation.force:.1f} N",
        ]
        if found.criteria.life is not None:
            lines.append(f"  load rating         {found.evaluation.required_load_rating:.0f} N needed for the life")
        lines += [f"  {line}" for line in self.bending_lines]
        lines += [f"  {line}" for line in ([] if found.wear is None else found.wear.told)]
        lines += [f"  {line}" for line in self.drive_lines]
        lines += [f"  {one.told(found.machine)}" for one in self.impacts]
        lines.append(f"  {self.margin_line}")
        lines += [f"  {one.sentence}" for one in self.guidelines]
        if best is not None:
            lines.append(f"  cheapest change that meets all criteria: {best.told}, cost {best.cost:.2f}")
            lines += [f"  dearer, and better: {one.told}, cost {one.cost:.2f}, {_better(one)}" for one in self.dearer]
        elif self.improvement is not None:
            lines.append(f"  {self.improvement.told}")
            if self.improvement.suggestions and not found.checks:
                lines.append(f"  as it is: equivalent {force_of_machines(found):.1f} N over the machines built")
                lines += [f"  next: {one.compared}" for one in self.improvement.suggestions[1:3]]
        if self.life_over_speed is None and not self.verdict_only:
            lines.append(f"  no life against speed: {NO_TREND}")
        return [*lines, *(f"  {line}" for line in self.model_lines)]

    @property
    def beside_lines(self) -> list[str]:
        """Speeds over which each of several motions is stable, for people."""
        return [] if self.coexistence is None else self.coexistence.lines

    @property
    def model_lines(self) -> tuple[str, ...]:
        """The machine's model and its estimated error, for people."""
        accuracy = self.brief.accuracy
        return () if accuracy is None else tuple(filter(None, (accuracy.line, accuracy.warning)))

    @property
    def life_lines(self) -> list[str]:
        """Life by a load rating where no life is required, for people; none otherwise."""
        found = self.assessment
        if found.criteria.load_rating is None or found.criteria.life is not None:
            return []
        lasts = found.evaluation.life_interval.low
        hours = hours_text(hours_of(lasts, found.cycle_period))
        return [f"life                {hours} in operation ({life_text(lasts)} million cycles), of none required"]

    @property
    def duty_lines(self) -> list[str]:
        """Each speed of the load collective, for people; none for one speed."""
        parts = self.assessment.collective
        lines = []
        for part, damage in zip(parts, damage_shares(parts), strict=True):
            found = part.assessment
            hours = hours_of(found.evaluation.life_interval.low, found.machine.cycle_period)
            if np.isfinite(hours):
                alone = f"{hours_text(hours)} if it ran at this speed alone"
            else:
                force = found.evaluation.force
                alone = f"equivalent force {force:.1f} N" if force else "no contact"
            speed = quantity_of(found.machine, found.machine.speed_field)
            lines.append(
                f"{part.share:.0%} of the time at {speed}: Type {found.type}, {alone}, {damage:.0%} of the damage"
            )
        return lines

    @property
    def bending_lines(self) -> list[str]:
        """How long the flexible part lasts, for people; none if it is left out."""
        found = self.assessment.bending
        return [] if found is None else found.told(self.assessment.cycle_period)

    @property
    def drive_lines(self) -> tuple[str, ...]:
        """Torque and power of the drive at the nominal speed, for people; none for a machine that tells no torque."""
        machine: Any = self.assessment.machine
        drive = machine.drive_torque
        motor = (machine.under_motor().told,) if machine.has_motor else ()
        return () if drive is None else (*drive.told, *motor)

    @property
    def dearer(self) -> tuple[Trial, ...]:
        """Changes on the front that meet all criteria and cost more than the cheapest one, for life or robustness."""
        if self.improvement is None or self.improvement.best is None:
            return ()
        cheapest = self.improvement.best
        return tuple(one for one in self.improvement.front if one.meets and one.cost > cheapest.cost)

    @property
    def margin_line(self) -> str:
        """The nearest loss of stability, for people; of the verdict alone, what is left out."""
        if self.verdict_only:
            return f"left out: {LEFT_OUT}"
        if self.margins is None:
            return "no margin to a loss of stability: it needs a nominal response that is proven to be periodic"
        nearest = self.margins.nearest
        if nearest is None:
            return "no loss of stability within the tolerances, each varied alone"
        at = quantity_of(with_settings(self.assessment.machine, {nearest.parameter: nearest.value}), nearest.parameter)
        side = "above" if nearest.side > 0 else "below"
        far = f"{nearest.share:.2f} tolerances" if nearest.share >= 0.005 else "less than 0.01 of the tolerance"
        return f"nearest loss of stability: {nearest.kind} at {nearest.parameter.replace('_', ' ')} {at}, {far} {side}"

    def as_dict(self) -> dict[str, Any]:
        """Return plain values for JSON."""
        assessed = self.assessment
        machine: Any = assessed.machine
        required = assessed.criteria.life
        shares = zip(assessed.collective, damage_shares(assessed.collective), strict=True)
        own = {
            "chaosgym": __version__,
            "life_hours": [hours_of(life, assessed.cycle_period) for life in assessed.evaluation.life_interval],
            "required_life_hours": None if required is None else hours_of(required, assessed.cycle_period),
            "collective": [
                {
                    "speed": part.speed,
                    "share_of_time": part.share,
                    "share_of_damage": damage,
                    "type": part.assessment.type,
                    "verdict_alone": part.assessment.verdict,
                    "evaluation": part.assessment.evaluation,
                }
                for part, damage in shares
            ],
            "drive": machine.drive_torque,
            "motor": machine.under_motor() if machine.has_motor else None,
            "peak_impacts": {
                "spread": self.diagram.spread,
                "unit": self.diagram.unit,
                "cycles_to_fill": self.cycles_to_fill,
                "over_clearance": self.impacts,
            },
        }
        return {**super().as_dict(), **assessed.as_dict(), **plain(own)}


def _told(check: Check, cycle_period: float) -> str:
    """What a check reached of what is required; a life in hours first."""
    told = check.told
    if check.unit == "million cycles":
        reached, required = (hours_text(hours_of(life, cycle_period)) for life in (check.reached, check.required))
        told = f"{reached} of {required} in operation ({told})"
    return told + (" met" if check.met else " NOT met")


def _better(trial: Trial) -> str:
    """What a dearer change gives."""
    unit = "required" if trial.judges_life else "present"
    life = f"{trial.life:.3g} {unit} lives" if np.isfinite(trial.life) else "no contact"
    does = "meet" if trial.assessment.criteria.judges_machines else "are periodic"
    return f"{life}, {trial.robustness:.0%} of the machines {does}"
