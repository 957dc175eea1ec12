"""The command ``design``: machines within their tolerances, judged by the criteria of a brief."""

import datetime
import time
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.machine_options import INITIAL_STATE, stated_state
from chaosgym.cli.options import IntRange, recording_options
from chaosgym.cli.output import (
    AS_JSON,
    DIAGNOSED,
    PATIENCE_SECONDS,
    WORKERS,
    emit,
    note_machine,
    picture_path,
    plot_option,
    seconds_of,
)

if TYPE_CHECKING:
    from chaosgym.machines import Machine
    from chaosgym.recordings.kind import RecordingOptions


@click.command()
@click.argument("briefs_given", type=click.Path(dir_okay=False), nargs=-1, metavar="[FILE.toml]...")
@click.option("--template", metavar="MACHINE", help="Print a commented brief of a machine, ready to edit.")
@click.option("--beside", metavar="FILE", help="Put a recording beside what the briefs' machines do.")
@recording_options(())
@INITIAL_STATE
@click.option("--out", type=click.Path(dir_okay=False), help="Report to write (.html or .pdf), and JSON beside it.")
@click.option("--tables", type=click.Path(dir_okay=False), metavar="FILE.xlsx", help="Workbook of the tables to write.")
@click.option("--overwrite", is_flag=True, help="Replace files that exist.")
@click.option("--verdict-only", is_flag=True, help="Leave map, margins and changes out; it is soon there.")
@plot_option()
@click.option("--seed", type=IntRange(0), default=0, show_default=True, help="Of the machines in tolerance.")
@WORKERS
@AS_JSON
def design(
    briefs_given: tuple[str, ...],
    template: str | None,
    beside: str | None,
    options: "RecordingOptions",
    initial_state: str | None,
    out: str | None,
    tables: str | None,
    overwrite: bool,
    verdict_only: bool,
    plot: str | None,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Say whether a machine meets its criteria within its tolerances, and what to change if not.

    FILE.toml is a brief (see --template), or a machine's file, which starts from its template. What a brief does not
    state is not judged. Several are put side by side, with --beside FILE next to a recording.
    """
    from chaosgym.design import brief as briefs
    from chaosgym.design.study import most_cycles, study
    from chaosgym.plotting import design_report as report
    from chaosgym.plotting.workbook import check_workbook, write_workbook
    from chaosgym.recordings.kind import RecordingOptions

    if template is not None:
        text = briefs.template(template)
        return emit({"text": text}, as_json, lambda: [text.removesuffix("\n")])
    if not briefs_given:
        raise click.UsageError("give a brief (see --template); `chaosgym judge FILE` judges a recording")
    if not beside and options != RecordingOptions():
        raise click.UsageError("options of a recording need one: --beside FILE")
    if initial_state and (len(briefs_given) > 1 or beside):
        raise click.UsageError("--initial-state goes with one brief alone: a state belongs to one machine")
    if len(briefs_given) > 1 or beside:
        if plot or tables:
            raise click.UsageError("--plot and --tables go with one brief alone; --out has the pictures of several")
        return _compared(briefs_given, beside, options, out, overwrite, verdict_only, seed, workers, as_json)
    (brief,) = briefs_given
    picture = picture_path(plot, "design")
    if out is not None:
        report.report_paths(out, overwrite)
    if tables is not None:
        check_workbook(tables, overwrite)
    asked = briefs.read_brief(brief)
    if initial_state:
        asked = replace(asked, machine=asked.machine.from_state(stated_state(asked.machine, initial_state)))
    text, of_machine = briefs.brief_text(brief)
    note_machine(asked.machine)
    _announce(asked.machine, most_cycles(asked, verdict_only=verdict_only))
    answer = study(asked, verdict_only=verdict_only, seed=seed, workers=workers, progress=True)
    result, lines = answer.as_dict(), answer.lines()
    if of_machine:
        lines = [
            *lines,
            f"{brief} is a machine's file, which states no criteria; state yours in a brief:",
            f"  chaosgym design --template {brief} > brief.toml",
        ]
    if out is not None:
        begun = f" --initial-state {initial_state}" if initial_state else ""
        command = f"chaosgym design {brief}{begun}{' --verdict-only' if verdict_only else ''} --seed {seed}"
        date = datetime.date.today().isoformat()
        page = report.design_report(answer, command, date=date, brief=text)
        lines = [*lines, report.report_line(report.write_report(page, result, out, overwrite))]
    if tables is not None:
        lines = [*lines, f"tables: {write_workbook(answer, tables, overwrite)}"]
    return emit(result, as_json, lambda: lines, picture, lambda plots: plots.study_figure(answer))


def _announce(machine: "Machine", cycles: int) -> None:
    """Say how long a study of so many cycles takes if machines are as the nominal one, and if none is periodic."""
    from chaosgym.design.runs import DIAGNOSIS_BUDGET
    from chaosgym.diagnosis import diagnose
    from chaosgym.errors import ChaosgymError
    from chaosgym.units import duration

    most = seconds_of(machine, DIAGNOSED * cycles)
    if most < PATIENCE_SECONDS:
        return
    took = most
    try:
        for _ in range(2):  # the first one may load kernels
            began = time.process_time()
            diagnose(machine, budget=DIAGNOSIS_BUDGET)
            took = (time.process_time() - began) * cycles / DIAGNOSIS_BUDGET
    except ChaosgymError:
        pass  # the study says why
    if took < 0.5 * most:
        usual = f"about {duration(took, 2)} of processor time where machines are as the nominal one, "
        click.echo(f"design: {usual}up to {duration(most, 2)} where none is periodic", err=True)
    else:
        click.echo(f"design: up to about {duration(most, 2)} of processor time", err=True)


def _compared(
    briefs_given: tuple[str, ...],
    beside: str | None,
    options: "RecordingOptions",
    out: str | None,
    overwrite: bool,
    verdict_only: bool,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Answer several briefs, and put them side by side, and beside what was measured."""
    from chaosgym.design.brief import read_brief
    from chaosgym.design.measured import evaluate_run
    from chaosgym.design.study import most_cycles, study
    from chaosgym.plotting.comparison_report import MEASURED, agreement, comparison_report, comparison_rows
    from chaosgym.plotting.design_report import report_line, report_paths, write_report
    from chaosgym.recordings.runs import judged_run

    if len(set(briefs_given)) < len(briefs_given):
        raise click.UsageError("a brief is given twice; give each once")
    if out is not None:
        report_paths(out, overwrite)
    asked = {path: read_brief(path) for path in briefs_given}
    first = next(iter(asked.values()))
    date = datetime.date.today().isoformat()
    run = judged_run(beside, options) if beside else None
    found = None if run is None else evaluate_run(run, first.criteria, date=date)
    cycles = sum(most_cycles(one, verdict_only=verdict_only) for one in asked.values())
    _announce(first.machine, cycles)
    how: dict[str, Any] = {"verdict_only": verdict_only, "seed": seed, "workers": workers}
    studies = {path: study(one, **how, progress=True) for path, one in asked.items()}
    rows = comparison_rows(studies, found)
    width = max(len(name) for name in rows)
    lines = [f"{'':{width}s}  {', '.join([*studies, *([MEASURED] if found else [])])}"]
    lines += [f"{name:{width}s}  {' | '.join(cells)}" for name, cells in rows.items()]
    result = {"briefs": {path: one.as_dict() for path, one in studies.items()}}
    if found is not None and run is not None:
        result = {**result, "measured": found.as_dict()}
        lines = [*lines, f"measured: {found.headline}", agreement(studies, found), *run.notes]
    if out is not None:
        command = f"chaosgym design {' '.join(briefs_given)}{' --verdict-only' if verdict_only else ''} --seed {seed}"
        command += f" --beside {beside}" if beside else ""
        page = comparison_report(studies, command, date=date, measured=found)
        lines = [*lines, report_line(write_report(page, result, out, overwrite))]
    emit(result, as_json, lambda: lines)
