"""The command ``design``: machines within their tolerances, judged by the criteria of a brief."""

import datetime
from typing import TYPE_CHECKING

import click

from chaosgym.cli.options import recording_options
from chaosgym.cli.output import AS_JSON, WORKERS, emit, note_machine, picture_path, plot_option

if TYPE_CHECKING:
    from chaosgym.recordings.runs import RecordingOptions


@click.command()
@click.argument("briefs_given", type=click.Path(dir_okay=False), nargs=-1, metavar="[FILE.toml]...")
@click.option("--template", metavar="MACHINE", help="Print a commented brief of a machine, ready to edit.")
@click.option("--beside", metavar="FILE", help="Put a recording beside what the briefs' machines do.")
@recording_options()
@click.option("--out", type=click.Path(dir_okay=False), help="HTML report to write, with a JSON file beside it.")
@click.option("--overwrite", is_flag=True, help="Replace the report if it exists.")
@plot_option()
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the machines in tolerance.")
@WORKERS
@AS_JSON
def design(
    briefs_given: tuple[str, ...],
    template: str | None,
    beside: str | None,
    options: "RecordingOptions",
    out: str | None,
    overwrite: bool,
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
    from chaosgym.design.study import study
    from chaosgym.plotting import design_report as report
    from chaosgym.recordings.runs import RecordingOptions

    if template is not None:
        text = briefs.template(template)
        return emit({"text": text}, as_json, lambda: [text.removesuffix("\n")])
    if not briefs_given:
        raise click.UsageError("give a brief (see --template); `chaosgym judge FILE` judges a recording")
    if not beside and options != RecordingOptions():
        raise click.UsageError("options of a recording need one: --beside FILE")
    if len(briefs_given) > 1 or beside:
        if plot:
            raise click.UsageError("--plot goes with one brief alone; --out has the pictures of several")
        return _compared(briefs_given, beside, options, out, overwrite, seed, workers, as_json)
    (brief,) = briefs_given
    picture = picture_path(plot, "design")
    if out is not None:
        report.report_paths(out, overwrite)
    asked = briefs.read_brief(brief)
    text, of_machine = briefs.brief_text(brief)
    note_machine(asked.machine)
    answer = study(asked, seed=seed, workers=workers, progress=True)
    result, lines = answer.as_dict(), answer.lines()
    if of_machine:
        lines = [
            *lines,
            f"{brief} is a machine's file, which states no criteria; state yours in a brief:",
            f"  chaosgym design --template {brief} > brief.toml",
        ]
    if out is not None:
        command, date = f"chaosgym design {brief} --seed {seed}", datetime.date.today().isoformat()
        report.write_report(report.design_report(answer, command, date=date, brief=text), result, out, overwrite)
        lines = [*lines, f"report: {out}"]
    return emit(result, as_json, lambda: lines, picture, lambda plots: plots.study_figure(answer))


def _compared(
    briefs_given: tuple[str, ...],
    beside: str | None,
    options: "RecordingOptions",
    out: str | None,
    overwrite: bool,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Answer several briefs, and put them side by side, and beside what was measured."""
    from chaosgym.design.brief import read_brief
    from chaosgym.design.measured import evaluate_run
    from chaosgym.design.study import study
    from chaosgym.plotting.comparison_report import MEASURED, agreement, comparison_report, comparison_rows
    from chaosgym.plotting.design_report import report_paths, write_report
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
    studies = {path: study(one, seed=seed, workers=workers, progress=True) for path, one in asked.items()}
    rows = comparison_rows(studies, found)
    width = max(len(name) for name in rows)
    lines = [f"{'':{width}s}  {', '.join([*studies, *([MEASURED] if found else [])])}"]
    lines += [f"{name:{width}s}  {' | '.join(cells)}" for name, cells in rows.items()]
    result = {"briefs": {path: one.as_dict() for path, one in studies.items()}}
    if found is not None and run is not None:
        result = {**result, "measured": found.as_dict()}
        lines = [*lines, f"measured: {found.headline}", agreement(studies, found), *run.notes]
    if out is not None:
        command = f"chaosgym design {' '.join(briefs_given)} --seed {seed}"
        command += f" --beside {beside}" if beside else ""
        page = comparison_report(studies, command, date=date, measured=found)
        write_report(page, result, out, overwrite)
        lines = [*lines, f"report: {out}"]
    emit(result, as_json, lambda: lines)
