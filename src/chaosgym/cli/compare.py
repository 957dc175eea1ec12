"""The command ``compare``: every controller, and trained policies, on the same machines."""

from pathlib import Path

import click

from chaosgym.cli.output import emit


@click.command()
@click.argument("env")
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="Parquet file; goes on from there."
)
@click.option("--machines", type=click.IntRange(2, 256), default=256, show_default=True, help="Of those kept for this.")
@click.option("--only", multiple=True, help="Name of a controller to run; all by default; may be repeated.")
@click.option("--policy", "policies", multiple=True, help="NAME=FOLDER of a trained policy; one name, several seeds.")
@click.option("--figure", type=click.Path(dir_okay=False, path_type=Path), default=None, help="Scores as a picture.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def compare(
    env: str,
    out: Path,
    machines: int,
    only: tuple[str, ...],
    policies: tuple[str, ...],
    figure: Path | None,
    as_json: bool,
) -> None:
    """Let all controllers, and trained policies, run ENV on the same machines, and score them.

    ENV is an id such as chaosgym/ImpactBeamTolerance-v1, or the file of a machine.
    0 is following the demand, 1 is the machine's own map with the demands to come unknown.
    """
    from chaosgym.control.comparison import ONE, ZERO, Scores, table_lines
    from chaosgym.control.comparison import compare as run
    from chaosgym.control.policies import TrainedPolicy, load_policy

    trained: dict[str, list[TrainedPolicy]] = {}
    for given in policies:
        name, separator, folder = given.partition("=")
        if not separator:
            raise click.UsageError(f"--policy {given}: allowed: NAME=FOLDER")
        trained.setdefault(name, []).append(load_policy(folder))
    chosen = [ZERO, ONE, *(name for name in only if name not in (ZERO, ONE))] if only else None
    scores = Scores(run(env, out, machines=machines, only=chosen, policies=trained, progress=True))
    summary = scores.summary()
    if figure is not None:
        from chaosgym.plotting.comparison import comparison_figure

        comparison_figure(summary, env).savefig(figure, dpi=130)
    emit({"env": env, "contenders": summary}, as_json, lambda: table_lines(summary))
