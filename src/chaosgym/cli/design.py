"""May a designer rely on the machine? ``design``."""

import click

from chaosgym.cli.output import emit


@click.command()
@click.argument("brief", type=click.Path(dir_okay=False), required=False, metavar="[FILE.toml]")
@click.option("--template", metavar="MACHINE", help="Print a commented brief of a machine, ready to edit.")
@click.option("--peaks", type=click.Path(dir_okay=False), help="CSV of measured peak forces [N], one a cycle.")
@click.option("--load-rating", type=float, metavar="N", help="With --peaks and no brief: load rating [N].")
@click.option("--out", type=click.Path(dir_okay=False), help="HTML report to write, with a JSON file beside it.")
@click.option("--overwrite", is_flag=True, help="Replace the report if it exists.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the machines in tolerance.")
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def design(
    brief: str | None,
    template: str | None,
    peaks: str | None,
    load_rating: float | None,
    out: str | None,
    overwrite: bool,
    seed: int,
    workers: int | None,
    as_json: bool,
) -> None:
    """Say whether a machine meets its criteria within its tolerances, and what to change if not."""
    from chaosgym.design import brief as briefs
    from chaosgym.design import measured
    from chaosgym.design.criteria import Criteria
    from chaosgym.design.study import study
    from chaosgym.plotting import design_report as report

    if template is not None:
        return click.echo(briefs.template(template), nl=False)
    if (brief is None) == (load_rating is None or peaks is None):
        raise click.UsageError("give a brief (see --template), or --peaks FILE.csv with --load-rating")
    if out is not None:
        report.report_paths(out, overwrite)
    asked = briefs.read_brief(brief) if brief is not None else None
    if peaks is not None:
        criteria = asked.criteria if asked is not None else Criteria(load_rating=load_rating or 0.0)
        found = measured.evaluate_peaks(measured.read_peaks(peaks), criteria)
        page, result, lines = report.measured_report(found), found.as_dict(), found.lines()
    elif asked is not None:
        answer = study(asked, seed=seed, workers=workers, progress=True)
        page, result, lines = (
            report.design_report(answer, f"chaosgym design {brief} --seed {seed}"),
            answer.as_dict(),
            answer.lines(),
        )
    if out is not None:
        report.write_report(page, result, out, overwrite)
        lines.append(f"report: {out}")
    emit(result, as_json, lambda: lines)
