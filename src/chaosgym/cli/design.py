"""The command ``design``: a machine within its tolerances, or a recording, judged by criteria."""

import datetime
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.machine_options import Quantity
from chaosgym.cli.measured_options import Measured, Run, measured_options, measured_run
from chaosgym.cli.output import AS_JSON, WORKERS, draw, emit, note_machine, picture_path, plot_option

if TYPE_CHECKING:
    from chaosgym.design.bearing import Criteria
    from chaosgym.design.measured import MeasuredPeaks


@click.command()
@click.argument("briefs_given", type=click.Path(dir_okay=False), nargs=-1, metavar="[FILE.toml]...")
@click.option("--template", metavar="MACHINE", help="Print a commented brief of a machine, ready to edit.")
@measured_options
@click.option(
    "--load-rating",
    type=Quantity("N"),
    help="With measured forces and no brief: load rating of the surface, by which its life is told.",
)
@click.option("--beside", is_flag=True, help="Put what was measured beside what the briefs' machines do.")
@click.option("--out", type=click.Path(dir_okay=False), help="HTML report to write, with a JSON file beside it.")
@click.option("--overwrite", is_flag=True, help="Replace the report if it exists.")
@plot_option()
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the machines in tolerance.")
@WORKERS
@AS_JSON
def design(
    briefs_given: tuple[str, ...],
    template: str | None,
    measured: Measured,
    load_rating: float | None,
    beside: bool,
    out: str | None,
    overwrite: bool,
    plot: str | None,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Say whether a machine meets its criteria within its tolerances, and what to change if not.

    FILE.toml is a brief (see --template), or a machine's file, which starts from its template. What a brief does not
    state is not judged. Several are put side by side, with --beside next to a recording.
    """
    from chaosgym.design import brief as briefs
    from chaosgym.design.bearing import Criteria
    from chaosgym.design.study import study
    from chaosgym.plotting import design_report as report

    if template is not None:
        text = briefs.template(template)
        return emit({"text": text}, as_json, lambda: [text.removesuffix("\n")])
    if beside and not (measured and briefs_given):
        raise click.UsageError("--beside needs a brief, and --peaks or --series")
    if len(briefs_given) > 1 or beside:
        if (measured and not beside) or load_rating is not None or plot:
            raise click.UsageError(
                "several briefs go without --load-rating and --plot, and with --peaks or --series by --beside only"
            )
        return _compared(briefs_given, measured, out, overwrite, seed, workers, as_json)
    brief = briefs_given[0] if briefs_given else None
    if (brief is None and not measured) or (load_rating is not None and (brief is not None or not measured)):
        raise click.UsageError("give a brief (see --template), or --peaks FILE.csv, with --load-rating for a life")
    picture = picture_path(plot, "design-measured" if measured else "design")
    if out is not None:
        report.report_paths(out, overwrite)
    asked = briefs.read_brief(brief) if brief is not None else None
    text, of_machine = briefs.brief_text(brief) if brief is not None else ("", False)
    if asked is not None:
        note_machine(asked.machine)
    if measured:
        option = {} if load_rating is None else {"load_rating": "--load-rating"}
        criteria = asked.criteria if asked is not None else Criteria(load_rating=load_rating, stated=option)
        run, found = _evaluated(measured, criteria)
        page, result, lines = report.measured_report(found), found.as_dict(), [*found.lines(), *run.notes]
        draw(picture, lambda plots: plots.peaks_figure(found), result, lines)
    elif asked is not None:
        answer = study(asked, seed=seed, workers=workers, progress=True)
        page, result, lines = (
            report.design_report(
                answer,
                f"chaosgym design {brief} --seed {seed}",
                date=datetime.date.today().isoformat(),
                brief=text,
            ),
            answer.as_dict(),
            answer.lines(),
        )
        draw(picture, lambda plots: plots.study_figure(answer), result, lines)
    if of_machine:
        lines.append(f"{brief} is a machine's file, which states no criteria; state yours in a brief:")
        lines.append(f"  chaosgym design --template {brief} > brief.toml")
    if out is not None:
        report.write_report(page, result, out, overwrite)
        lines.append(f"report: {out}")
    emit(result, as_json, lambda: lines)


def _evaluated(measured: Measured, criteria: "Criteria") -> "tuple[Run, MeasuredPeaks]":
    """What was measured, and what it means by some criteria."""
    from chaosgym.design.measured import evaluate_peaks

    run = measured_run(measured)
    source = {
        "file": run.source,
        "sha256": run.sha256,
        "column": run.name,
        "date": datetime.date.today().isoformat(),
        "read as": "; ".join(run.notes).removeprefix("read "),
    }
    return run, evaluate_peaks(run.peaks, criteria, verdict=run.verdict, source=source)


def _compared(
    briefs_given: tuple[str, ...],
    measured: Measured,
    out: str | None,
    overwrite: bool,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Answer several briefs, and put them side by side, and beside what was measured."""
    from chaosgym.design.brief import read_brief
    from chaosgym.design.study import study
    from chaosgym.plotting.comparison_report import MEASURED, agreement, comparison_report, comparison_rows
    from chaosgym.plotting.design_report import report_paths, write_report

    if len(set(briefs_given)) < len(briefs_given):
        raise click.UsageError("a brief is given twice; give each once")
    if out is not None:
        report_paths(out, overwrite)
    asked = {path: read_brief(path) for path in briefs_given}
    first = next(iter(asked.values()))
    run, found = _evaluated(measured, first.criteria) if measured else (None, None)
    studies = {path: study(one, seed=seed, workers=workers, progress=True) for path, one in asked.items()}
    rows = comparison_rows(studies, found)
    width = max(len(name) for name in rows)
    lines = [f"{'':{width}s}  {', '.join([*studies, *([MEASURED] if found else [])])}"]
    lines += [f"{name:{width}s}  {' | '.join(cells)}" for name, cells in rows.items()]
    result: dict[str, Any] = {"briefs": {path: one.as_dict() for path, one in studies.items()}}
    if found is not None and run is not None:
        result["measured"] = found.as_dict()
        lines += [f"measured: {found.headline}", agreement(studies, found), *run.notes]
    if out is not None:
        command = f"chaosgym design {' '.join(briefs_given)} --seed {seed}"
        if measured:
            command += f" --beside --{'peaks' if measured.peaks else 'series'} {measured.peaks or measured.series}"
        page = comparison_report(studies, command, date=datetime.date.today().isoformat(), measured=found)
        write_report(page, result, out, overwrite)
        lines.append(f"report: {out}")
    emit(result, as_json, lambda: lines)
