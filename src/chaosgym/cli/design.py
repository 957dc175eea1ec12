"""May a designer rely on the machine? ``design``."""

import datetime

import click

from chaosgym.cli.machine_options import Quantity
from chaosgym.cli.measured_options import Measured, measured_options, measured_runs
from chaosgym.cli.output import draw, emit, note_machine, picture_path, plot_option


@click.command()
@click.argument("briefs_given", type=click.Path(dir_okay=False), nargs=-1, metavar="[FILE.toml]...")
@click.option("--template", metavar="MACHINE", help="Print a commented brief of a machine, ready to edit.")
@measured_options
@click.option(
    "--load-rating", type=Quantity("N"), help="With measured forces and no brief: load rating of the surface."
)
@click.option("--out", type=click.Path(dir_okay=False), help="HTML report to write, with a JSON file beside it.")
@click.option("--overwrite", is_flag=True, help="Replace the report if it exists.")
@plot_option()
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the machines in tolerance.")
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def design(
    briefs_given: tuple[str, ...],
    template: str | None,
    measured: Measured,
    load_rating: float | None,
    out: str | None,
    overwrite: bool,
    plot: str | None,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Say whether a machine meets its criteria within its tolerances, and what to change if not.

    FILE.toml is a brief (see --template), or a machine's file, which starts from its template. Several are put side by
    side.
    """
    from chaosgym.design import brief as briefs
    from chaosgym.design.bearing import Criteria
    from chaosgym.design.measured import evaluate_peaks
    from chaosgym.design.study import study
    from chaosgym.plotting import design_report as report

    if template is not None:
        return click.echo(briefs.template(template), nl=False)
    if len(briefs_given) > 1:
        if measured or load_rating is not None or plot:
            raise click.UsageError("several briefs go without --peaks, --series, --load-rating and --plot")
        return _compared(briefs_given, out, overwrite, seed, workers, as_json)
    brief = briefs_given[0] if briefs_given else None
    if (brief is None) == (load_rating is None or not measured):
        raise click.UsageError("give a brief (see --template), or --peaks FILE.csv with --load-rating")
    if plot and not measured:
        raise click.UsageError("--plot goes with --peaks or --series; a brief is drawn in its report, --out FILE.html")
    picture = picture_path(plot, "design-measured")
    if out is not None:
        report.report_paths(out, overwrite)
    asked = briefs.read_brief(brief) if brief is not None else None
    text, of_machine = briefs.brief_text(brief) if brief is not None else ("", False)
    if asked is not None:
        note_machine(asked.machine)
    if measured:
        criteria = asked.criteria if asked is not None else Criteria(load_rating=load_rating or 0.0)
        (run,) = measured_runs(measured, of_force=True)
        source = {
            "file": run.source,
            "sha256": run.sha256,
            "column": run.name,
            "date": datetime.date.today().isoformat(),
            "read as": "; ".join(run.notes).removeprefix("read "),
        }
        stated = asked.stated if asked is not None else ("load_rating",)
        found = evaluate_peaks(run.peaks, criteria, verdict=run.verdict, stated=stated, source=source)
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
    if of_machine:
        result["criteria_are_examples"] = True
        lines.append(f"{brief} is a machine's file, judged by the examples of its template; state your own criteria:")
        lines.append(f"  chaosgym design --template {brief} > brief.toml")
    if out is not None:
        report.write_report(page, result, out, overwrite)
        lines.append(f"report: {out}")
    emit(result, as_json, lambda: lines)


def _compared(
    briefs_given: tuple[str, ...], out: str | None, overwrite: bool, seed: int, workers: int | None, as_json: bool
) -> None:
    """Answer several briefs, and put them side by side."""
    from chaosgym.design.brief import read_brief
    from chaosgym.design.study import study
    from chaosgym.plotting import design_report as report

    if len(set(briefs_given)) < len(briefs_given):
        raise click.UsageError("a brief is given twice; give each once")
    if out is not None:
        report.report_paths(out, overwrite)
    asked = {path: read_brief(path) for path in briefs_given}
    studies = {path: study(one, seed=seed, workers=workers, progress=True) for path, one in asked.items()}
    rows = report.comparison_rows(studies)
    width = max(len(name) for name in rows)
    lines = [f"{'':{width}s}  {', '.join(studies)}"]
    lines += [f"{name:{width}s}  {' | '.join(cells)}" for name, cells in rows.items()]
    result = {"briefs": {path: found.as_dict() for path, found in studies.items()}}
    if out is not None:
        command = f"chaosgym design {' '.join(briefs_given)} --seed {seed}"
        page = report.comparison_report(studies, command, date=datetime.date.today().isoformat())
        report.write_report(page, result, out, overwrite)
        lines.append(f"report: {out}")
    emit(result, as_json, lambda: lines)
