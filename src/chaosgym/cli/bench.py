"""How fast is this computer? ``bench``."""

from dataclasses import asdict
from typing import Any

import click

from chaosgym.cli.output import emit


@click.command()
@click.option("--repeats", type=click.IntRange(1, 100), default=5, show_default=True, help="Timed runs per figure.")
@click.option("--scenes", is_flag=True, help="The scenes of the slider crank instead: degrees of freedom and cost.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench(repeats: int, scenes: bool, as_json: bool) -> None:
    """Time the simulation on this computer: microseconds per operating cycle, one core."""
    from chaosgym.bench import benchmark, scene_costs

    if scenes:
        costs = scene_costs()
        return emit({"scenes": [asdict(cost) for cost in costs]}, as_json, lambda: _scene_table(costs))
    result = benchmark(repeats)
    emit({"microseconds_per_cycle": result}, as_json, lambda: [
        f"{name:45s} {value:8.1f} us per cycle {1e6 / value:10.0f} cycles/s" for name, value in result.items()
    ])  # fmt: skip


def _scene_table(costs: list[Any]) -> list[str]:
    head = f"{'slider crank, 200 rpm, 5 deg bins':41s} {'DOF':>3s}  {'method':11s} {'set-up':>9s} {'revolution':>12s}"
    rows = [
        f"{cost.scene:41s} {len(cost.degrees_of_freedom):3d}  {cost.method:11s} {1e3 * cost.setup:6.1f} ms "
        f"{1e3 * cost.revolution:9.2f} ms"
        for cost in costs
    ]
    return [head, *rows, "the degrees of freedom of a scene by name: chaosgym show slider-crank, and --json"]
