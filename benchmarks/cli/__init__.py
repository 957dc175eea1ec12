"""Command line of ``python -m benchmarks``."""

import json
from pathlib import Path
from typing import Any

import click

from benchmarks.cli.bench import bench
from chaosgym.cli import run_command
from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import emit
from chaosgym.cli.sweep import AS_JSON, FOLDER
from chaosgym.envs import ENVIRONMENTS


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


@click.command()
@click.argument("machine", default="impact-beam")
@AS_JSON
def report(machine: str, as_json: bool) -> None:
    """Measure the processor time of the report of MACHINE's template, without a search for changes and with it."""
    from benchmarks.performance.reports import report_seconds

    found = {name: report_seconds(machine, name == "with search") for name in ("without search", "with search")}
    emit(found, as_json, lambda: [f"{seconds:6.1f} s of processor time, {name}" for name, seconds in found.items()])


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


@click.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--machines", type=click.IntRange(1, 256), default=16, show_default=True)
@click.option("--speeds", type=click.IntRange(2), default=23, show_default=True)
@AS_JSON
def judges(env: str, machines: int, speeds: int, as_json: bool) -> None:
    """Compare the judges of running motion with the diagnosis from rest, and with each other."""
    from benchmarks.envs.judges import judges as compare

    found = compare(env, machines, speeds)
    emit({"env": env, **found}, as_json, lambda: [f"{share:7.1%}  {name}" for name, share in found.items()])


@click.command()
@click.option("--machines", type=click.IntRange(2, 10_000), default=64, show_default=True)
@click.option("--fleets", is_flag=True, help="Fleets of beams and cranks instead of beams with one thing changed.")
@AS_JSON
def mismatch(machines: int, fleets: bool, as_json: bool) -> None:
    """Play the shipped policies, guarded and not, on machines that differ from those of their training."""
    from benchmarks.envs.mismatch import FLEETS, ROWS, lines
    from benchmarks.envs.mismatch import mismatch as run

    found = run(machines, FLEETS if fleets else ROWS)
    emit({"rows": found}, as_json, lambda: lines(found))


@click.command()
@click.argument("path", metavar="FILE", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--policy", "policies", multiple=True, required=True, help="NAME=FOLDER; one name, several seeds.")
@click.option("--again", type=click.IntRange(1, 512), default=16, show_default=True, help="Jobs that are played again.")
@AS_JSON
def entry(path: Path, policies: tuple[str, ...], again: int, as_json: bool) -> None:
    """Check the FILE of a comparison before its row enters the table of results."""
    from benchmarks.envs.entry import entry as check_entry
    from benchmarks.envs.entry import lines

    names, folders = zip(*(given.split("=", 1) if "=" in given else (given, "") for given in policies), strict=True)
    if len(set(names)) > 1 or "" in folders:
        raise click.UsageError("--policy takes NAME=FOLDER, with one name for all seeds")
    found = check_entry(path, names[0], [Path(folder) for folder in folders], again)
    emit(found, as_json, lambda: lines(found))


@click.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--level", default="fleet", show_default=True)
@click.option("--machines", type=click.IntRange(1, 256), default=32, show_default=True)
@AS_JSON
def arrivals(env: str, level: str, machines: int, as_json: bool) -> None:
    """Tell how irregular the first steps after a change of demand are, on machines of the test split."""
    from benchmarks.envs.arrivals import arrivals as run
    from benchmarks.envs.arrivals import lines

    found = run(env, level, machines)
    emit({"env": env, "level": level, "players": found}, as_json, lambda: lines(found))


@click.command()
@click.option("--machines", type=click.IntRange(2, 10_000), default=24, show_default=True)
@click.option("--workers", type=click.IntRange(1), default=2, show_default=True, help="Processes.")
@click.option(
    "--kept",
    type=click.Path(dir_okay=False, path_type=Path),
    default="docs/data/other-simulator.jsonl",
    show_default=True,
    help="Jobs that are done, a line each: they are not played again.",
)
@AS_JSON
def other_simulator(machines: int, workers: int, kept: Path, as_json: bool) -> None:
    """Play shipped policies on beams of the fleet in Exudyn, behind the plant interface, and on the same ones here."""
    from benchmarks.envs.other_simulator import lines
    from benchmarks.envs.other_simulator import other_simulator as run

    found = run(machines, workers, kept)
    emit({"rows": found}, as_json, lambda: lines(found))


@click.command()
@click.option("--machines", type=click.IntRange(6, 128), default=64, show_default=True, help="Of the larger sets.")
@click.option("--folder", type=click.Path(exists=True, path_type=Path), default="docs/machines", show_default=True)
@AS_JSON
def life(machines: int, folder: Path, as_json: bool) -> None:
    """Play kriging for the joint's life on machines of which nobody has a model."""
    from benchmarks.envs.life import life as run
    from benchmarks.envs.life import lines

    found = run(machines, folder)
    emit({"rows": found}, as_json, lambda: lines(found))


@click.command()
@click.option("--out", type=click.Path(dir_okay=False, path_type=Path), default="src/chaosgym/envs/pool.csv")
@AS_JSON
def pool(out: Path, as_json: bool) -> None:
    """Draw and filter the machines of chaosgym/AnyMachine-v0 anew."""
    from benchmarks.envs.pool import write_pool

    found = write_pool(out)
    emit({"machines": len(found)}, as_json, lambda: [f"{len(found)} machines: {out}"])


@click.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--machines", type=click.IntRange(1, 256), default=64, show_default=True)
@AS_JSON
def audit(env: str, machines: int, as_json: bool) -> None:
    """Play the loopholes that one could think of."""
    from benchmarks.envs.audit import audit as run

    found = run(env, machines)
    emit(
        {"env": env, "loopholes": found},
        as_json,
        lambda: [
            f"{name:20s} return {row['return']:8.2f}  Type III {row['type_iii']:6.1%}  "
            f"off the demand {row['deviation']:.2f}"
            for name, row in found.items()
        ],
    )


@click.command()
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--machines", type=click.IntRange(3), default=40, show_default=True)
@click.option("--keywords", default="{}", help="Of the environment, as JSON.")
@AS_JSON
def headroom(env: str, machines: int, keywords: str, as_json: bool) -> None:
    """Show what a schedule can win, and how much of it knowing the clearance gives."""
    from benchmarks.envs.headroom import headroom as measure

    try:
        given = json.loads(keywords)
    except ValueError as error:
        raise click.UsageError(f"--keywords is no JSON: {error}") from None
    found = measure(env, machines, given)
    lines = [f"{value:7.3f}  {name}" for name, value in found.items()]
    emit({"env": env, "machines": machines, "keywords": given, **found}, as_json, lambda: lines)


@click.command("textbook-controllers")
@click.argument("env", type=click.Choice(ENVIRONMENTS))
@click.option("--machines", type=click.IntRange(2), default=32, show_default=True, help="Of those kept for evaluation.")
@AS_JSON
def textbook(env: str, machines: int, as_json: bool) -> None:
    """Play ENV by hill climbing, extremum seeking, force feedback, delayed feedback and OGY (takes long)."""
    from benchmarks.envs.textbook_controllers import textbook_scores
    from chaosgym.control.scores import table_lines

    found = textbook_scores(env, machines)

    emit({"env": env, "machines": machines, "contenders": found}, as_json, lambda: table_lines(found))


@click.command()
@click.argument("runs", nargs=-1)
@click.option("--table", type=click.Path(dir_okay=False, path_type=Path), required=True, help="CSV file of the curves.")
@click.option("--figure", type=click.Path(dir_okay=False), default=None, help="Picture of the curves.")
@click.option("--level", default=None, help="Level that RUNS were trained at, if not that of the id.")
@AS_JSON
def curves(runs: tuple[str, ...], table: Path, figure: str | None, level: str | None, as_json: bool) -> None:
    """Put the training curves of RUNS, each NAME=FOLDER, into a table, in the place of other runs of that name there.

    Without RUNS, show the table.
    """
    from benchmarks.envs.curves import COLUMNS, curve_figure, curve_lines, read_curve, read_table, replaced, write_table

    pairs = [run.partition("=") for run in runs]
    for run, (_, separator, folder) in zip(runs, pairs, strict=True):
        if not separator or not folder:
            raise click.UsageError(f"RUNS {run}: allowed: NAME=FOLDER")
    if runs:
        new = [read_curve(name, Path(folder), level) for name, _, folder in pairs]
        write_table(replaced(read_table(table) if table.exists() else (), new), table)
    found = read_table(table)
    if figure is not None:
        curve_figure(found).savefig(figure, dpi=110)
    plain = [{"agent": curve.agent, "env": curve.env, "rows": curve.values.tolist()} for curve in found]
    emit({"columns": COLUMNS, "runs": plain}, as_json, lambda: curve_lines(found))


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
    agreement,
    margins,
    learned,
    check,
    ship,
    types,
    cost,
    judges,
    audit,
    mismatch,
    other_simulator,
    entry,
    arrivals,
    life,
    pool,
    curves,
    headroom,
    textbook,
    classifier,
    monitors,
    general,
    exponents,
    report,
):
    app.add_command(command)


def main() -> None:
    """Entry point."""
    run_command(app)
