"""The command ``numerics``: which statements change sides by the thesis' own way to integrate."""

import click

from chaosgym.cli.output import AS_JSON, WORKERS, emit
from chaosgym.plain import plain


@click.command()
@click.option("--machine", type=click.Choice(["impact-beam", "slider-crank"]), multiple=True, help="Default: both.")
@WORKERS
@click.option("--markdown", is_flag=True, help="Print the page of the documentation.")
@AS_JSON
def numerics(machine: tuple[str, ...], workers: int | None, markdown: bool, as_json: bool) -> None:
    """Judge statements with fixed steps and with held matrices, as the thesis may have; the same command resumes."""
    from thesis.cache import default_folder
    from thesis.scorecard.evaluation import THESIS_MACHINES
    from thesis.scorecard.numerics import numerics as judge
    from thesis.scorecard.numerics import page

    names = machine or tuple(THESIS_MACHINES)
    found = {name: judge(name, folder=default_folder(), workers=workers, progress=True) for name in names}
    if markdown:
        return click.echo(page(found), nl=False)
    emit(plain(found), as_json, lambda: page(found).splitlines())
