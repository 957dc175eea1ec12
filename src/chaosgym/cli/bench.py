"""How fast is this computer? ``bench``."""

import click

from chaosgym.cli.output import emit


@click.command()
@click.option("--repeats", type=click.IntRange(1, 100), default=5, show_default=True, help="Timed runs per figure.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench(repeats: int, as_json: bool) -> None:
    """Time the simulation on this computer, one core: microseconds per operating cycle, and to set a crank up."""
    from chaosgym.bench import benchmark

    result = benchmark(repeats)
    emit(result, as_json, lambda: [
        f"{kind.replace('_', ' ')}: {name:45s} {value:8.1f}" for kind, values in result.items()
        for name, value in values.items()
    ])  # fmt: skip
