"""How fast is this computer? ``bench``."""

import click

from chaosgym.cli.output import emit


@click.command()
@click.option("--repeats", type=click.IntRange(1, 100), default=5, show_default=True, help="Timed runs per figure.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench(repeats: int, as_json: bool) -> None:
    """Time the simulation on this computer: microseconds per operating cycle, one core."""
    from chaosgym.bench import benchmark

    result = benchmark(repeats)
    emit({"microseconds_per_cycle": result}, as_json, lambda: [
        f"{name:45s} {value:8.1f} us per cycle {1e6 / value:10.0f} cycles/s" for name, value in result.items()
    ])  # fmt: skip
