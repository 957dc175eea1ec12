"""The comparison report: studies of several briefs side by side, and beside what was measured."""

from collections.abc import Mapping
from functools import partial

import numpy as np

from chaosgym.design.bearing import hours_of
from chaosgym.design.design_study import DesignStudy
from chaosgym.design.fatigue import equivalent_force
from chaosgym.design.measured import MeasuredPeaks
from chaosgym.design.methodology import Assessment
from chaosgym.design.texts import NOT_ASKED, hours_text, listed, percent_text, share_text
from chaosgym.machines.parameters import parameters_of, quantity_of
from chaosgym.plotting import design as figures
from chaosgym.plotting.design_report import HEADLINES, drawn_by, picture_of, rendered, tolerance_text


def comparison_report(
    studies: Mapping[str, DesignStudy], command: str = "", *, date: str = "", measured: MeasuredPeaks | None = None
) -> str:
    """HTML report of several studies side by side, by name of their brief, and beside what was measured."""
    pictures = []
    if measured is not None:
        caption = (
            "Share of cycles whose peak force is no larger. Measured, and of each brief's nominal machine on its worse "
            "surface; band: the machines built to its tolerances."
        )
        nominal = {name: study.assessment for name, study in studies.items()}
        drawn = drawn_by(partial(figures.peaks_beside, measured.peaks, nominal))
        pictures.append(picture_of(drawn, caption))
    for name, study in studies.items():
        drawn = drawn_by(partial(figures.series_life, study.assessment))
        pictures.append(picture_of(drawn, f"{name}: life of each machine built to the tolerances."))
    return rendered(
        "comparison.html",
        command,
        studies=studies,
        measured=measured,
        names=[*studies, *([MEASURED] if measured is not None else [])],
        rows=comparison_rows(studies, measured),
        agreement=None if measured is None else agreement(studies, measured),
        differing=_differing(studies),
        pictures=pictures,
        date=date,
    )


MEASURED = "measured"
"""Name of the column of a recording."""

NOTHING = "–"
"""What stands where there is nothing to tell."""


def comparison_rows(studies: Mapping[str, DesignStudy], measured: MeasuredPeaks | None = None) -> dict[str, list[str]]:
    """What each study found, by quantity, as texts for people; what was measured comes last."""
    columns = [_column(study) for study in studies.values()]
    if measured is not None:
        columns.append(_measured_column(measured, next(iter(studies.values()))))
    names = dict.fromkeys(name for column in columns for name in column)
    return {name: [column.get(name, NOTHING) for column in columns] for name in names}


def agreement(studies: Mapping[str, DesignStudy], measured: MeasuredPeaks) -> str:
    """Which briefs' machines in the tolerances have equivalent forces on both sides of the measured one, for people."""
    force, around = measured.evaluation.force, []
    for name, study in studies.items():
        forces = _forces(study.assessment)
        if min(forces) <= force <= max(forces):
            around.append(name)
    return (
        f"The equivalent force measured, {force:.1f} N, lies within what machines in the tolerances of "
        f"{listed(around) or 'no brief'} have"
    )


def _forces(found: Assessment) -> list[float]:
    """Equivalent force [N] of the nominal machine and of each one of the series."""
    exponent = found.criteria.life_exponent
    return [equivalent_force(run.worse_side(exponent), exponent) for run in (found.nominal, *found.series.runs)]


def _column(study: DesignStudy) -> dict[str, str]:
    found = study.assessment
    value, machine, period = found.evaluation, found.machine, found.cycle_period
    exponent = found.criteria.life_exponent
    best = study.improvement.best if study.improvement else None
    meeting = study.combination.meeting
    forces = _forces(found)
    rated, asked = found.criteria.load_rating is not None, found.criteria
    required = hours_text(hours_of(asked.life, period)) if asked.life is not None else NOT_ASKED
    lasts = hours_text(hours_of(value.life_interval.low, period)) if rated else NOT_ASKED
    probable = NOT_ASKED
    if meeting is not None:
        probable = f"{percent_text(meeting.share)} ({percent_text(meeting.low)} to {percent_text(meeting.high)})"
    suffices = "not looked for" if study.verdict_only else "none"
    if study.improvement is None and found.verdict == "meets":
        suffices = "none needed"
    elif best is not None:
        suffices = best.told
    return {
        "verdict": HEADLINES[found.verdict][1],
        "machine": machine.name,
        "speed": quantity_of(machine, machine.speed_field),
        "clearance": quantity_of(machine, machine.clearance_field),
        "nominal response": found.nominal.nature,
        "type over the tolerances": found.type,
        "machines in the tolerances": found.series.told.partition(" of ")[0],
        "life in operation": lasts,
        "life required": required,
        "reliability": share_text(value.reliability_interval.low),
        "mean peak force, nominal": f"{np.mean(found.nominal.worse_side(exponent)):.1f} N",
        "largest peak force": f"{value.largest_force:.1f} N",
        "equivalent force": f"{value.force:.1f} N",
        "equivalent force of each machine": f"{min(forces):.1f} to {max(forces):.1f} N",
        "load rating needed": NOT_ASKED if asked.life is None else f"{value.required_load_rating:.0f} N",
        "probability of meeting what is required": probable,
        "cheapest change that suffices": suffices if found.checks else NOT_ASKED,
    }


def _measured_column(measured: MeasuredPeaks, study: DesignStudy) -> dict[str, str]:
    """The same quantities of a recording, at the speed and by the criteria of the first study."""
    value, found = measured.evaluation, study.assessment
    period = found.machine.cycle_period
    told = {
        "machine": measured.source.get("file", MEASURED),
        "nominal response": measured.verdict.diagnosis.nature,
        "life in operation": hours_text(hours_of(value.life_interval.low, period)),
        "life required": NOT_ASKED
        if found.criteria.life is None
        else hours_text(hours_of(found.criteria.life, period)),
        "mean peak force, nominal": f"{np.mean(measured.peaks):.1f} N",
        "largest peak force": f"{value.largest_force:.1f} N",
        "equivalent force": f"{value.force:.1f} N",
        "reliability": share_text(value.reliability_interval.low),
    }
    if found.criteria.life is not None:
        told["load rating needed"] = f"{value.required_load_rating:.0f} N"
    return told


def _differing(studies: Mapping[str, DesignStudy]) -> dict[str, list[str]]:
    """Parameters with their tolerances, and criteria, that are not the same in all studies."""
    columns = []
    for study in studies.values():
        found = study.assessment
        column = {
            name: f"{quantity_of(found.machine, name)} {tolerance_text(found, name)}".strip()
            for name in parameters_of(found.machine)
        }
        columns.append(
            column | {name: quantity_of(found.criteria, name) for name in found.criteria.asked if name != "life"}
        )
    names = dict.fromkeys(name for column in columns for name in column)
    table = {name: [column.get(name, NOTHING) for column in columns] for name in names}
    return {name: cells for name, cells in table.items() if len(set(cells)) > 1}
