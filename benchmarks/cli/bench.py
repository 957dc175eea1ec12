"""The command ``bench``: how fast this computer is."""

from dataclasses import asdict
from os import cpu_count
from pathlib import Path
from typing import Any

import click

from benchmarks.cli.stored import tell
from chaosgym.cli.output import AS_JSON

SHOWN_FUNCTIONS = 15
"""Functions of a cold start that are shown; ``--json`` has all."""

MOST_WORKERS = 4
"""Dask workers on this computer."""


@click.command()
@click.option("--repeats", type=click.IntRange(1, 100), default=5, show_default=True, help="Timed runs per figure.")
@click.option(
    "--against", type=click.Choice(["exudyn", "peers"]), help="The same machines in other programs (chaosgym[peers])."
)
@click.option("--scenes", is_flag=True, help="The scenes of the slider crank instead: degrees of freedom and cost.")
@click.option("--set-up", "set_up", is_flag=True, help="The times to make a slider crank ready instead.")
@click.option("--mechanisms", is_flag=True, help="Mechanisms from files against the crank of the thesis instead.")
@click.option("--scaling", is_flag=True, help="What grows with modes, gaps, cycles, machines, threads, instead.")
@click.option("--points", type=click.IntRange(0), default=0, help="With --scaling: of a sweep on 1, 2, 4 Dask workers.")
@click.option("--figure", type=click.Path(dir_okay=False, path_type=Path), help="With --scaling: picture of it, PNG.")
@click.option("--first-use", "first_use", is_flag=True, help="What commands take at first, and to compile, instead.")
@click.option("--waits", is_flag=True, help="Short questions, training and memory of a batch instead.")
@click.option(
    "--beside",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="What the same options printed with --json at another commit: those figures beside these.",
)
@AS_JSON
def bench(
    repeats: int,
    against: str | None,
    scenes: bool,
    set_up: bool,
    mechanisms: bool,
    scaling: bool,
    points: int,
    figure: Path | None,
    first_use: bool,
    waits: bool,
    beside: Path | None,
    as_json: bool,
) -> None:
    """Rates on this computer: cycles, environment steps, sweep points, classifier rows; or against a peer."""
    if (against is not None) + scenes + set_up + mechanisms + scaling + first_use + waits > 1:
        raise click.UsageError(
            "--against, --scenes, --set-up, --mechanisms, --scaling, --first-use and --waits exclude each other"
        )
    if against == "peers":
        from benchmarks.performance.peers import peers

        programs = peers()
        told = {"peers": [program._asdict() for program in programs]}
        return tell(told, as_json, lambda: _peer_table(programs), beside)
    if against is not None:
        from benchmarks.performance.against_exudyn import against_exudyn

        rows = against_exudyn(repeats=repeats, progress=True)
        return tell({"against": against, "settings": rows}, as_json, lambda: _comparison(rows), beside)
    if first_use:
        from benchmarks.performance.first_use import cold_start, warm_start

        spent: dict[str, Any] = {"warm_seconds": warm_start(repeats=repeats), "cold": cold_start()}
        return tell(spent, as_json, lambda: _first_use_lines(spent), beside)
    if waits:
        from benchmarks.performance.waits import waits as measure

        waited = measure(repeats)
        lines = [f"{value:12.1f}  {name}" for name, value in waited.items()]
        return tell({"waits": waited}, as_json, lambda: lines, beside)
    from benchmarks.performance import (
        assembly_times,
        benchmark,
        cycle_costs,
        scene_costs,
        set_up_times,
    )

    if scenes:
        costs = scene_costs()
        return tell({"scenes": [asdict(cost) for cost in costs]}, as_json, lambda: _scene_table(costs), beside)
    if set_up:
        times = set_up_times(repeats)
        return tell(
            {"set_up_microseconds": times},
            as_json,
            lambda: [f"{name:40s} {value:10.1f} us" for name, value in times.items()],
            beside,
        )
    if mechanisms:
        cycles, times = cycle_costs(repeats), assembly_times(repeats)
        found = {"cycles": [cost._asdict() for cost in cycles], "assembly_milliseconds": times}
        return tell(found, as_json, lambda: _mechanism_table(cycles, times), beside)
    if scaling:
        return _scaling(repeats, points, figure, as_json, beside)
    result = benchmark(repeats, progress=True)
    return tell(result, as_json, lambda: _rates(result), beside)


def _first_use_lines(found: dict[str, Any]) -> list[str]:
    lines = [f"{seconds:8.2f} s  {command}, compiled" for command, seconds in found["warm_seconds"].items()]
    for command, cost in found["cold"].items():
        lines.append(
            f"{cost['seconds']:8.2f} s  {command}, first ever, {cost['wall_seconds']:.0f} s on the clock: "
            f"{len(cost['functions'])} functions, the dearest"
        )
        lines += [f"{seconds:12.2f} s  {name}" for name, seconds in cost["functions"][:SHOWN_FUNCTIONS]]
    return lines


def _rates(result: dict[str, Any]) -> list[str]:
    load = result["load_average"]
    lines = [f"{'':64s}{'per second':>12s}{'per CPU second':>16s}"]
    for quantity, figures in result.items():
        if quantity in ("load_average", "step_microseconds", "in_loops"):
            continue
        lines.append(quantity.replace("_", " "))
        for name, rates in figures.items():
            lines.append(f"  {name:62s}{_shown(rates['per_second']):>12s}{_shown(rates['per_processor_second']):>16s}")
    lines.append(f"{'us of processor time':64s}{'a step':>12s}{'Python of it':>16s}{'in warm caches':>16s}")
    for name, cost in result["step_microseconds"].items():
        lines.append(f"  {name:62s}{cost['step']:12.1f}{cost['python']:16.1f}{cost['warm']:16.1f}")
    lines.append("in reference loops: 1,000 steps of 64 logistic maps compiled, or of one in Python")
    lines += [f"  {name:74s}{loops:16.1f}" for name, loops in result["in_loops"].items()]
    return [*lines, f"load average of this computer: {load['before']:.1f} before, {load['after']:.1f} after"]


def _shown(figure: float) -> str:
    return f"{figure:.1f}" if figure < 100.0 else f"{figure:,.0f}"


def _peer_table(programs: list[Any]) -> list[str]:
    head = f"{'cycles per CPU second, error of the first peak':56s}{'Hz':>4s}"
    return [head] + [
        f"{each.name:56s}{each.frequency:4.0f}{each.cycles_per_second:12,.1f}{each.error:12.1e}" for each in programs
    ]


def _comparison(rows: list[dict[str, Any]]) -> list[str]:
    lines = [f"{'':78s}{'cycles per CPU second':>22s}{'ratio':>7s}{'goal':>6s}  right verdicts (periods)"]
    shown = ""
    for row in rows:
        rates, own = row["cycles_per_processor_second"], f"{row['machine']}: chaosgym, exact events"
        if row["machine"] != shown:
            shown = row["machine"]
            lines.append(f"{own:78s}{rates['chaosgym']:22,.1f}{'':13s}{_verdicts(row, 'chaosgym')}")
        figures = f"{rates['exudyn']:22,.1f}{row['ratio']:7.0f}{row['goal']:6.0f}"
        lines.append(f"  {row['setting']:76s}{figures}{_verdicts(row, 'exudyn')}")
    return lines


def _verdicts(row: dict[str, Any], side: str) -> str:
    wrong = ", ".join(f"{speed:g}" for speed in row["wrong_at"][side])
    share = f"  {row['right_class'][side]} ({row['right_period'][side]}) of {row['speeds']}"
    return share + (f", wrong at {wrong}" if wrong else "")


def _scene_table(costs: list[Any]) -> list[str]:
    head = f"{'slider crank, 200 rpm, 5 deg bins':41s} {'DOF':>3s}  {'method':11s} {'set-up':>9s} {'revolution':>12s}"
    rows = [
        f"{cost.scene:41s} {len(cost.degrees_of_freedom):3d}  {cost.method:11s} {1e3 * cost.setup:6.1f} ms "
        f"{1e3 * cost.revolution:9.2f} ms"
        for cost in costs
    ]
    return [head, *rows, "the degrees of freedom of a scene by name: chaosgym show slider-crank, and --json"]


def _mechanism_table(rows: list[Any], times: dict[str, float]) -> list[str]:
    from benchmarks.performance.mechanisms import ASSEMBLY

    head = f"{'cycle, against one of the crank of the thesis':46s}{'DOF':>5s}{'contacts':>10s}{'us':>8s}{'ratio':>8s}"
    lines = [
        f"{row.machine:46s}{row.coordinates:5d}{row.contacts:10d}{row.microseconds:8.0f}{row.ratio:8.2f}"
        f"{row.target:8.1f}"
        for row in rows
    ]
    made = [f"{f'assemble, {name}':69s}{value:8.1f} ms{ASSEMBLY[name]:5.0f}" for name, value in times.items()]
    return [f"{head}{'target':>8s}", *lines, *made]


def _scaling(repeats: int, points: int, figure: Path | None, as_json: bool, beside: Path | None) -> None:
    from benchmarks.performance.processors import powers_of_two, thread_shares, worker_shares
    from benchmarks.performance.scaling_figure import scaling_figure
    from benchmarks.performance.sizes import sizes

    grown, shares = sizes(repeats), thread_shares(repeats)
    if points:
        shares += worker_shares(points, [count for count in powers_of_two(cpu_count() or 1) if count <= MOST_WORKERS])
    if figure is not None:
        scaling_figure(grown, shares, figure)
    found = {"sizes": [each._asdict() for each in grown], "processors": [each._asdict() for each in shares]}
    tell(found, as_json, lambda: [*_size_table(grown), *_share_table(shares)], beside)


def _size_table(grown: list[Any]) -> list[str]:
    head = f"{'what grows':18s}{'to':>10s}{'us a cycle':>12s}{'us an impact':>14s}{'kB kept':>12s}"
    rows = []
    for each in grown:
        impact = f"{each.microseconds / each.impacts:14.2f}" if each.impacts else f"{'':14s}"
        rows.append(f"{each.grows:18s}{each.value:10g}{each.microseconds:12.1f}{impact}{1e-3 * each.kept:12.2f}")
    return [head, *rows]


def _share_table(shares: list[Any]) -> list[str]:
    head = f"{'us of a cycle (threads) or a point (workers)':46s}{'wall':>12s}{'processor':>12s}"
    return [f"{head}  memory [MB]"] + [
        f"{f'{each.number} {each.of}':46s}{1e6 * each.wall:12.1f}{1e6 * each.processor:12.1f}  "
        + ", ".join(f"{1e-6 * size:.0f}" for size in each.memory)
        for each in shares
    ]
