"""The command ``tradeoff``: the cost of accuracy."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.options import FloatRange, IntRange
from chaosgym.cli.output import WORKERS, announce, emit, patience, seconds_of, verdict_lines

if TYPE_CHECKING:
    from chaosgym.fidelity.tradeoff import Tradeoff, TradeoffRow

FOLDER = click.Path(file_okay=False, path_type=Path)


@machine_command
@click.option("--points", type=IntRange(1, 1000), default=60, show_default=True, help="Operating points.")
@click.option("--cycles", type=IntRange(20, 10**5), default=200, show_default=True, help="Cycles that count.")
@click.option("--transient", type=IntRange(0, 10**5), default=100, show_default=True, help="Cycles before them.")
@click.option(
    "--budget",
    type=FloatRange(0.0, min_open=True),
    default=10.0,
    show_default=True,
    help="Processor time of each fixed step [s].",
)
@WORKERS
@click.option("--out", type=FOLDER, default=None, help="Write tradeoff.json and tradeoff.png there.")
@click.option("--step-check", is_flag=True, help="Instead, repeat the verdict with finer steps: does it stay?")
def tradeoff(
    machine: Any,
    points: int,
    cycles: int,
    transient: int,
    budget: float,
    workers: int | None,
    out: Path | None,
    step_check: bool,
    as_json: bool,
) -> None:
    """Measure every rung of a machine, and fixed steps, against its reference: cost, errors, Pareto front."""
    from chaosgym.fidelity.tradeoff import settings_of
    from chaosgym.fidelity.tradeoff import tradeoff as measure
    from chaosgym.machines.parameters import with_settings

    if step_check:
        return _step_check(machine, as_json)
    settings = settings_of(machine)
    exact = sum(
        seconds_of(with_settings(machine, {"fidelity": one.rung}), points * (transient + cycles))
        for one in settings
        if one.method == "exact"
    )
    announce("tradeoff", machine, 0, besides=exact + budget * sum(one.method != "exact" for one in settings))
    result = measure(
        machine, points=points, cycles=cycles, transient=transient, budget=budget, workers=workers, progress=True
    )
    if out is not None:
        from chaosgym.plotting.fidelity import tradeoff_figure

        write_result(out, "tradeoff", result.as_dict(), tradeoff_figure(result))
    return emit(result.as_dict(), as_json, lambda: _tradeoff_lines(result))


def _step_check(machine: Any, as_json: bool) -> None:
    """Judge one machine with its own step and with finer ones."""
    from chaosgym.diagnosis.step_check import step_check

    with patience("diagnose with finer steps"):
        check = step_check(machine)
    verdict = check.given.as_dict()
    shown = {name: verdict[name] for name in ("nature", "period", "reason", "statement")}
    result = {"machine": machine.name, **shown, "step_check": check.as_dict()}
    emit(result, as_json, lambda: [*verdict_lines(machine.name, check.given, []), f"  {check.summary}"])


def _tradeoff_lines(result: "Tradeoff") -> list[str]:
    title = (
        f"{'rung':14s} {'method':13s} {'step':>4s} {'us/cycle':>9s} {'cycles/s':>8s} {'path':>8s} {'mean':>8s} "
        f"{'spread':>8s} {'maximum':>8s} {'Wasserst.':>9s} {'chaotic':>8s} {'nature':>6s} {'type':>5s} {'points':>6s}"
    )
    lines = [title]
    for row in sorted(result.rows, key=lambda row: row.microseconds_per_cycle):
        lines.append(_tradeoff_line(row))
    lines += [f"not run: {setting}: {why}" for setting, why in result.refused.items()]
    lines += ["", "* on the Pareto front of cost and Wasserstein distance; errors are shares of the reference"]
    if result.noise is not None:
        scatter = f"two halves of the reference's run are {result.noise:.2g} apart"
        lines.append(f"chaotic: Wasserstein distance at {result.chaotic} chaotic points, where {scatter}")
    lines.append("")
    return lines + [f"{scene:28s} {cost:9.1f} us per cycle" for scene, cost in result.costs.items()]


def _tradeoff_line(row: "TradeoffRow") -> str:
    def share(value: float | None, width: int) -> str:
        return f"{'-' if value is None else format(value, '.2g'):>{width}s}"

    errors = (row.mean_error, row.spread_error, row.maximum_error)
    return (
        f"{row.rung:14s} {row.method:13s} {row.step:4g} {row.microseconds_per_cycle:9.1f} "
        f"{row.cycles_per_second:8.0f} {share(row.trajectory_error, 8)} {' '.join(share(e, 8) for e in errors)} "
        f"{share(row.wasserstein, 9)} {share(row.chaotic_wasserstein, 8)} {share(row.nature_agreement, 6)} "
        f"{share(row.type_agreement, 5)} {row.points:6d}"
        f"{' *' if row.on_front else ''}"
    )


def write_result(folder: Path, name: str, values: Any, figure: Any) -> None:
    """Write values as JSON and their figure as PNG, both of one name, into a folder."""
    from chaosgym.files import write_atomically

    folder.mkdir(parents=True, exist_ok=True)
    text = json.dumps(values, indent=1, allow_nan=False) + "\n"
    write_atomically(folder / f"{name}.json", lambda path: path.write_text(text, encoding="utf-8"))
    write_atomically(folder / f"{name}.png", lambda path: figure.savefig(path, format="png", dpi=120))
