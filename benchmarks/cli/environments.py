"""Commands about the environments: their judges, their loopholes, and who plays on which machines."""

import json
from pathlib import Path

import click

from chaosgym.cli.output import AS_JSON, emit
from chaosgym.envs import ENVIRONMENTS


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
@click.option("--machines", type=click.IntRange(8, 10_000), default=1024, show_default=True, help="That are fitted.")
@click.option("--others", type=click.IntRange(8, 10_000), default=256, show_default=True, help="That are scored.")
@click.option("--speeds", type=click.IntRange(1, 100), default=8, show_default=True, help="That each of them holds.")
@click.option("--env", default="chaosgym/ImpactBeamTolerance-v1", show_default=True, help="Id whose fleet is judged.")
@click.option("--sense", "chosen", multiple=True, help="Name of a sense; all by default; may be repeated.")
@click.option(
    "--kept",
    type=click.Path(dir_okay=False, path_type=Path),
    default="docs/data/sense.json",
    show_default=True,
    help="Rows that are done: they are not made again.",
)
@AS_JSON
def sense(
    machines: int, others: int, speeds: int, env: str, chosen: tuple[str, ...], kept: Path, as_json: bool
) -> None:
    """Tell how well readings tell irregular motion, by what judges them, cycles looked and error of the sensors."""
    from benchmarks.envs.sense import SENSES, lines
    from benchmarks.envs.sense import sense as run

    for name in chosen:
        if name not in SENSES:
            raise click.UsageError(f"--sense {name}: allowed: {'; '.join(SENSES)}")
    found = run(machines, others, speeds, chosen or SENSES, kept, env)
    emit({"rows": found}, as_json, lambda: lines(found))


@click.command()
@click.option("--machines", type=click.IntRange(2, 10_000), default=64, show_default=True)
@click.option("--fleets", is_flag=True, help="Fleets of beams and cranks instead of beams with one thing changed.")
@click.option("--row", "chosen", multiple=True, help="Name of a row; all by default; may be repeated.")
@click.option(
    "--kept",
    type=click.Path(dir_okay=False, path_type=Path),
    default="docs/data/mismatch.jsonl",
    show_default=True,
    help="Jobs that are done: they are not played again.",
)
@AS_JSON
def mismatch(machines: int, fleets: bool, chosen: tuple[str, ...], kept: Path, as_json: bool) -> None:
    """Play the shipped policies, guarded and not, on machines that differ from those of their training."""
    from benchmarks.envs.mismatch import FLEETS, ROWS, lines
    from benchmarks.envs.mismatch import mismatch as run

    rows = FLEETS if fleets else ROWS
    for name in chosen:
        if name not in rows:
            raise click.UsageError(f"--row {name}: allowed: {'; '.join(rows)}")
    found = run(machines, chosen or rows, kept)
    emit({"rows": found}, as_json, lambda: lines(found))


@click.command()
@click.option("--machines", type=click.IntRange(2, 128), default=48, show_default=True)
@click.option("--split", type=click.Choice(["train", "test"]), default="test", show_default=True)
@AS_JSON
def told(machines: int, split: str, as_json: bool) -> None:
    """Play the map of the beams' fleet as it is, and told what was charged at each speed of the job."""
    from benchmarks.envs.told import lines
    from benchmarks.envs.told import told as run

    found = run(machines, split)
    emit(found, as_json, lambda: lines(found))


@click.command()
@click.option("--machines", type=click.IntRange(2, 10_000), default=128, show_default=True)
@AS_JSON
def risk(machines: int, as_json: bool) -> None:
    """Tell what the map of the beams' fleet wins and how many machines it makes worse, by when it leaves the demand."""
    from benchmarks.envs.risk import lines
    from benchmarks.envs.risk import risk as run

    found = run(machines)
    emit({"rows": found}, as_json, lambda: lines(found))


@click.command()
@click.option("--machines", type=click.IntRange(2, 192), default=24, show_default=True)
@click.option("--jobs", type=click.IntRange(2, 100), default=4, show_default=True, help="Of each machine.")
@click.option("--kept", type=click.Path(dir_okay=False, path_type=Path), default=None, help="File of the returns.")
@click.option("--policy", type=click.Path(exists=True, path_type=Path), default=None, help="Folder; default: the map.")
@AS_JSON
def job_memory(machines: int, jobs: int, kept: Path | None, policy: Path | None, as_json: bool) -> None:
    """Let the map of the beams' fleet do several jobs on each machine, forgetting and remembering the earlier ones."""
    from benchmarks.envs.job_memory import job_memory as run
    from benchmarks.envs.job_memory import lines

    found = run(machines, jobs, kept, policy)
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


COMMANDS = (
    judges,
    sense,
    mismatch,
    told,
    risk,
    job_memory,
    entry,
    arrivals,
    other_simulator,
    life,
    pool,
    audit,
    headroom,
    curves,
)
"""All of them."""
