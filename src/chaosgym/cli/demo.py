"""The command ``demo``: what chaosgym does, in a few minutes."""

import click

from chaosgym.cli.output import emit


@click.command()
@click.option("--out", type=click.Path(file_okay=False), default="chaosgym-demo", show_default=True, help="New folder.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def demo(out: str, seed: int, as_json: bool) -> None:
    """Simulate, label, train, and compare an agent with plain rules: a few minutes (needs the extra [learn])."""
    from chaosgym.demo import demo_table, run_demo

    result = run_demo(out, seed, say=lambda line: click.echo(line, err=True))
    emit(result, as_json, lambda: demo_table(result))
