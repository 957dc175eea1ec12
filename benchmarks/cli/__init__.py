"""Command line of ``python -m benchmarks``: the commands about verdicts, sweeps and classifiers."""

from pathlib import Path
from typing import Any

import click

from benchmarks.cli.bench import bench
from benchmarks.cli.datasets import build_dataset
from benchmarks.cli.environments import COMMANDS
from benchmarks.cli.fidelity import accuracy, ladder, stability
from benchmarks.cli.house import house
from benchmarks.cli.mutants import mutants
from chaosgym.cli import run_command
from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import AS_JSON, emit
from chaosgym.cli.sweep import FOLDER


@machine_command
@click.option("--points", type=click.IntRange(1, 10**6), default=500, show_default=True, help="Random machines.")
@click.option("--cycles", type=click.IntRange(1000, 10**7), default=10_000, show_default=True, help="Of the reference.")
@click.option("--budget", type=click.IntRange(100, 10**7), default=3200, show_default=True, help="Of the diagnosis.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def agreement(machine: Any, points: int, cycles: int, budget: int, seed: int, as_json: bool) -> None:
    """Compare all tests of chaos with a long reference on random machines (takes long)."""
    from benchmarks.agreement import agreement as compare
    from benchmarks.agreement import random_machines

    machines = random_machines(machine, points, seed)
    table = compare(machines, reference_cycles=cycles, budget=budget, progress=True)
    emit(table.as_dict(), as_json, lambda: table.markdown().splitlines())


@machine_command
@click.option("--points", type=click.IntRange(1, 10**6), default=500, show_default=True, help="Random machines.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def margins(machine: Any, points: int, seed: int, as_json: bool) -> None:
    """Compare sampled response types with margins on random machines, and look at each that differs."""
    from benchmarks.agreement import random_machines
    from benchmarks.margins import types_and_margins

    found = types_and_margins(random_machines(machine, points, seed), progress=True)
    emit(found, as_json, lambda: [f"{count:5d}  {outcome}" for outcome, count in found["counts"].items()])


@click.command("learned-margin")
@FOLDER
@click.option("--points", type=click.IntRange(100, 10**6), default=3000, show_default=True, help="Machines to follow.")
@AS_JSON
def learned(folder: str, points: int, as_json: bool) -> None:
    """Measure how well trees learn margins of the sweep in FOLDER, and what an exact margin costs."""
    from benchmarks.classifier.learned_margin import learned_margin
    from chaosgym.sweeps import read_sweep

    found = learned_margin(read_sweep(folder), points, progress=True)
    emit(found, as_json, lambda: [f"{name}: {value}" for name, value in found.items()])


@click.command("check-sweep")
@FOLDER
@click.option("--points", type=click.IntRange(1, 10**6), default=50, show_default=True, help="Rows to label again.")
@click.option("--seed", type=click.IntRange(0), default=None, help="Of the rows; default: other ones every time.")
@AS_JSON
def check(folder: str, points: int, seed: int | None, as_json: bool) -> None:
    """Label some rows again and compare them; exit code 1 if they differ by more than another platform explains."""
    from benchmarks.sweeps.check import check_rows
    from chaosgym.sweeps import read_sweep

    found = check_rows(read_sweep(folder), points, seed=seed, progress=True)
    emit(found.as_dict(), as_json, lambda: [f"{folder}: {found.line}"])
    if not found.sound:
        raise SystemExit(1)


@click.command("ship-dataset")
@FOLDER
@AS_JSON
def ship(folder: str, as_json: bool) -> None:
    """Write sample, plan and card of the whole dataset in FOLDER into datasets/MACHINE."""
    from benchmarks.sweeps.ship import ship_dataset

    files = [str(path) for path in ship_dataset(Path(folder))]
    emit({"wrote": files}, as_json, lambda: [f"wrote {file}" for file in files])


@click.command("check-types")
@FOLDER
@click.option("--points", type=click.IntRange(1, 10**6), default=300, show_default=True, help="Crosses to judge again.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@AS_JSON
def types(folder: str, points: int, seed: int, as_json: bool) -> None:
    """Judge centres of crosses over their whole regions of speed and clearance, and count other types."""
    from benchmarks.sweeps.regions import region_types
    from chaosgym.sweeps import read_sweep

    found = region_types(read_sweep(folder), points, seed=seed, progress=True)
    emit(found.as_dict(), as_json, found.lines)


@click.command("sweep-cost")
@FOLDER
@click.option("--points", type=click.IntRange(3, 10**6), default=300, show_default=True, help="Rows to label again.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@AS_JSON
def cost(folder: str, points: int, seed: int, as_json: bool) -> None:
    """Measure the processor time of a point against every axis, and extrapolate it."""
    from benchmarks.sweeps.cost import labelling_cost
    from chaosgym.sweeps import read_sweep

    found = labelling_cost(read_sweep(folder), points, seed=seed, progress=True)
    emit(
        found,
        as_json,
        lambda: [
            f"{found['machine']}: {1e3 * found['seconds']:.1f} +- {1e3 * found['standard_error']:.1f} ms of processor "
            f"time a point, {found['points_per_second']:.1f} points a second and core ({points} rows)",
            *(
                f"  {name:22s}" + ", ".join(f"{part}: {1e3 * mean:.1f} ms" for part, mean in parts.items())
                for name, parts in found["by"].items()
            ),
            *(
                f"  {size} points: " + ", ".join(f"{hours:.3g} h on {cores} cores" for cores, hours in row.items())
                for size, row in found["hours"].items()
            ),
        ],
    )


@machine_command
@click.option("--crosses", type=click.IntRange(1, 10**6), default=300, show_default=True, help="Fresh machines.")
@click.option("--seed", type=click.IntRange(0), default=1000, show_default=True, help="Not one of the training data.")
@click.option("--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped.")
def classifier(machine: Any, crosses: int, seed: int, model: str | None, as_json: bool) -> None:
    """Microseconds against accuracy on fresh machines: parameters, each stage, the cascade, the full diagnosis."""
    from benchmarks.classifier.pareto import pareto, pareto_table
    from chaosgym.classifier import MachineClassifier, default_classifier

    judge = MachineClassifier.load(model) if model else default_classifier(machine.name)
    found = pareto(judge, crosses, seed=seed, progress=True)
    emit(found, as_json, lambda: pareto_table(found))


@machine_command
@click.option("--changes", type=click.IntRange(4, 10**6), default=60, show_default=True, help="Traces of each kind.")
@click.option("--seed", type=click.IntRange(0), default=1000, show_default=True)
@click.option("--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped.")
def monitors(machine: Any, changes: int, seed: int, model: str | None, as_json: bool) -> None:
    """False alarms, delays and harmless alarms of the monitor and its rivals, on changes inside one run."""
    from benchmarks.classifier.changes import traces
    from benchmarks.classifier.monitors import compare_monitors, monitor_table
    from chaosgym.classifier import MachineClassifier, default_classifier

    judge = MachineClassifier.load(model) if model else default_classifier(machine.name)
    found = traces(judge.machine, judge.card["data"]["axes"], changes, seed, progress=True)
    scores = compare_monitors(judge, found)
    emit({"machine": machine.name, "monitors": scores}, as_json, lambda: monitor_table(machine.name, scores))


@machine_command
@click.option("--points", type=click.IntRange(1, 10**6), default=100, show_default=True, help="Random machines.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def general(machine: Any, points: int, seed: int, as_json: bool) -> None:
    """Natures of a machine without a classifier of its own, such as my-machine.toml, against the full diagnosis."""
    from benchmarks.agreement import random_machines
    from benchmarks.classifier.general import general as judge

    found = judge(random_machines(machine, points, seed), progress=True)
    emit(found, as_json, lambda: [f"{name:24s} {value}" for name, value in found.items()])


@click.command()
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@AS_JSON
def exponents(seed: int, as_json: bool) -> None:
    """Lyapunov exponents of short, noisy recordings by libraries (nolds, neurokit2) and by the fitted map."""
    from benchmarks.classifier.exponents import exponents as measure

    found = measure(seed)
    rows = [
        f"{name:14s} {kind:28s} {values}" for name, one in found["exponents"].items() for kind, values in one.items()
    ]
    emit(found, as_json, lambda: rows + [f"left out: {text}" for text in found["left_out"]])


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
def app() -> None:
    """Numbers about chaosgym itself."""


for command in (
    bench,
    house,
    agreement,
    margins,
    learned,
    check,
    build_dataset,
    ship,
    types,
    cost,
    classifier,
    monitors,
    general,
    exponents,
    accuracy,
    ladder,
    stability,
    mutants,
):
    app.add_command(command)
for command in COMMANDS:
    app.add_command(command)


def main() -> None:
    """Entry point."""
    run_command(app)
