"""The command line: each command parses, calls one library function, and prints or saves.

Tables for people go to standard output, ``--json`` prints one JSON object there instead; progress and logs go to
standard error. Exit codes: 0 done, 1 a computation failed, 2 wrong usage.
"""

import functools
import json
import sys
from collections.abc import Callable, Mapping
from typing import Any

import click

from chaosgym.errors import ChaosgymError, SimulationError
from chaosgym.machine_options import MACHINE_OPTIONS, machine_command
from chaosgym.version import __version__

SUMMARY_CYCLES = 200
"""Settled cycles that the summary of the peak force covers."""


def _emit(result: Mapping[str, Any], as_json: bool, lines: Callable[[], list[str]]) -> None:
    """Print the result as JSON, or the lines for people."""
    if as_json:
        click.echo(json.dumps(result, allow_nan=False))
    else:
        for line in lines():
            click.echo(line)


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 110})
@click.version_option(__version__, prog_name="chaosgym")
def app() -> None:
    """Machines with clearance that rattle: simulate, diagnose, sweep and classify them."""


@app.command()
@machine_command
@click.option("--cycles", type=click.IntRange(1, 10**7), default=100, show_default=True, help="Cycles to record.")
@click.option("--transient", type=click.IntRange(0, 10**7), default=0, show_default=True, help="Cycles to skip first.")
def simulate(machine: Any, cycles: int, transient: int, as_json: bool) -> None:
    """Run a machine from rest and print the peak force of every cycle."""
    from chaosgym.bench import timed_run

    record, seconds_per_cycle = timed_run(machine, cycles, transient=transient)
    peaks = record.peak_force[:, 0]
    result = {
        "machine": machine.name,
        "peak_force_N": peaks.tolist(),
        "impacts": record.impacts.sum(axis=1).tolist(),
        "contact_fraction": record.contact_fraction.sum(axis=1).tolist(),
        "seconds_per_cycle": seconds_per_cycle,
    }
    _emit(result, as_json, lambda: [
        f"{machine.name}: {cycles} cycles after {transient}",
        f"peak force, {machine.sides[0]} side   {peaks.min():.2f} to {peaks.max():.2f} N, mean {peaks.mean():.2f} N",
        f"last peaks                {' '.join(f'{peak:.2f}' for peak in peaks[-8:])}",
        f"impacts per cycle         {record.impacts.sum(axis=1).mean():.1f}",
        f"share in contact          {record.contact_fraction.sum(axis=1).mean():.2f}",
        f"computing time            {1e6 * seconds_per_cycle:.0f} us per cycle",
    ])  # fmt: skip


@app.command()
@machine_command
def show(machine: Any, as_json: bool) -> None:
    """Print every parameter of a machine with its unit and where the number comes from."""
    from chaosgym.machines.parameters import parameters_of

    described = parameters_of(machine)
    frequencies = machine.natural_frequencies.tolist()
    default = type(machine)()
    provenance = {
        name: {"unit": about.unit, "grade": about.provenance, "source": about.source}
        if getattr(machine, name) == getattr(default, name)
        else {"unit": about.unit, "grade": "given", "source": "this command"}
        for name, about in described.items()
    }
    result = {
        "machine": machine.name,
        "parameters": {name: getattr(machine, name) for name in described},
        "natural_frequencies_hz": frequencies,
        "provenance": provenance,
    }

    def lines() -> list[str]:
        rows = []
        for name, about in described.items():
            value = getattr(machine, name)
            shown = value if isinstance(value, str) else f"{value:.6g}"
            unit = "" if about.unit == "-" else about.unit
            origin = provenance[name]
            rows.append(f"{name:30s} {shown:>11s} {unit:8s} {origin['grade']:10s} {origin['source']}")
        return [*rows, "natural frequencies [Hz]: " + ", ".join(f"{value:.1f}" for value in frequencies)]

    _emit(result, as_json, lines)


@app.command()
@functools.partial(machine_command, required=False)
@click.option(
    "--test", type=click.Choice(["adaptive", "mut"]), default="adaptive", show_default=True,
    help="All tests in stages, or the Matrix Update Test alone.",
)  # fmt: skip
@click.option("--budget", type=click.IntRange(100, 10**7), default=3200, show_default=True, help="Cycles at the most.")
@click.option("--types", is_flag=True, help="Also tell the response type (I, II, III) over the tolerances.")
@click.option("--step-check", is_flag=True, help="Repeat with a finer step and say whether the verdict stays.")
@click.option("--peaks", type=click.Path(), help="Judge measured peak forces instead: one column, one line a cycle.")
@click.option("--series", type=click.Path(), help="Judge a measured time series instead: columns time [s] and value.")
@click.option("--period-s", type=float, help="Operating cycle of the series [s].")
@click.option("--sensor-error", type=float, default=0.0, show_default=True, help="Differences within it do not count.")
def diagnose(
    machine: Any,
    test: str,
    budget: int,
    types: bool,
    step_check: bool,
    peaks: str | None,
    series: str | None,
    period_s: float | None,
    sensor_error: float,
    as_json: bool,
) -> None:
    """Tell periodic from chaotic: a machine by simulation, or a measured signal."""
    if peaks or series:
        if machine or types or step_check or (peaks and series) or (series and period_s is None):
            raise click.UsageError("give --peaks FILE, or --series FILE with --period-s T, or a machine")
        result, lines = _diagnose_measured(peaks, series, period_s, sensor_error)
    elif machine is None:
        raise click.UsageError(f"give a machine ({', '.join(MACHINE_OPTIONS)}), --peaks FILE or --series FILE")
    elif test == "mut":
        result, lines = _matrix_update(machine)
    else:
        result, lines = _diagnose_machine(machine, budget, types, step_check, sensor_error)
    _emit(result, as_json, lambda: lines)


def _verdict_lines(subject: str, verdict: Any, summary: Mapping[str, float], unit: str) -> list[str]:
    period = f", period {verdict.period}" if verdict.period else ""
    status = f"{verdict.status}, " if verdict.status else ""
    return [
        f"{subject}: {verdict.nature}{period} ({status}margin {verdict.margin:.2f})",
        f"  {verdict.reason}",
        f"  {summary['min']:.2f} to {summary['max']:.2f}{unit}, mean {summary['mean']:.2f}{unit}, "
        f"standard deviation {summary['std']:.2f}{unit}",
    ]


def _summary(values: Any) -> dict[str, float]:
    return {
        "min": float(values.min()),
        "max": float(values.max()),
        "mean": float(values.mean()),
        "std": float(values.std()),
    }


def _diagnose_measured(
    peaks: str | None, series: str | None, period: float | None, sensor_error: float
) -> tuple[dict[str, Any], list[str]]:
    from chaosgym.diagnosis import two_step_test
    from chaosgym.diagnosis.measured import read_columns, samples_per_period

    if peaks:
        samples = read_columns(peaks, 1)[:, 0]
    else:
        time, value = read_columns(str(series), 2).T
        samples = samples_per_period(time, value, float(period or 0.0))
    verdict = two_step_test(samples, sensor_error=sensor_error)
    summary = _summary(samples if peaks else samples[:, 1])
    result = {"file": peaks or series, **verdict.as_dict(), "peak_force_summary_N": summary, "warnings": []}
    return result, _verdict_lines(str(peaks or series), verdict, summary, "")


def _matrix_update(machine: Any) -> tuple[dict[str, Any], list[str]]:
    from chaosgym.diagnosis import matrix_update_test
    from chaosgym.simulation import simulate

    verdict = matrix_update_test(machine)
    summary = _summary(simulate(machine, SUMMARY_CYCLES, transient=SUMMARY_CYCLES).peak_force[:, 0])
    result = {"machine": machine.name, **verdict.as_dict(), "peak_force_summary_N": summary, "warnings": []}
    return result, _verdict_lines(f"{machine.name}, Matrix Update Test", verdict, summary, " N")


def _diagnose_machine(
    machine: Any, budget: int, types: bool, check: bool, sensor_error: float
) -> tuple[dict[str, Any], list[str]]:
    from chaosgym.diagnosis import diagnose, response_type
    from chaosgym.diagnosis.step_check import step_check
    from chaosgym.simulation import simulate

    verdict = diagnose(machine, budget=budget, sensor_error=sensor_error)
    settled = simulate(machine, SUMMARY_CYCLES, verdict.evidence["final_state"])
    summary = _summary(settled.peak_force[:, 0])
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    result = {
        "machine": machine.name,
        **verdict.as_dict(),
        "peak_force_summary_N": summary,
        "largest_lyapunov_exponent_per_cycle": {key: exponent[key] for key in ("value", "standard_error")},
        "cycles_used": verdict.evidence["cycles_used"],
        "warnings": [verdict.reason] if verdict.status in ("disputed", "transient", "unresolved") else [],
    }
    votes = ", ".join(f"{test} {vote}" for test, vote in verdict.votes.items())
    lines = _verdict_lines(machine.name, verdict, summary, " N")
    lines.append(f"  {result['cycles_used']} cycles used; votes: {votes}")
    if types:
        judged = response_type(machine, sensor_error=sensor_error)
        result |= {"response_type": judged.type, "response_type_reason": judged.reason}
        lines.append(f"  Type {judged.type}: {judged.reason}")
    if check:
        compared = step_check(machine)
        result["step_check"] = compared.as_dict()
        lines.append(f"  {compared.summary}")
    return result, lines


@app.command()
@machine_command
@click.option("--points", type=click.IntRange(1, 10**6), default=500, show_default=True, help="Random machines.")
@click.option("--cycles", type=click.IntRange(1000, 10**7), default=10_000, show_default=True, help="Of the reference.")
@click.option("--budget", type=click.IntRange(100, 10**7), default=3200, show_default=True, help="Of the diagnosis.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
def agreement(machine: Any, points: int, cycles: int, budget: int, seed: int, as_json: bool) -> None:
    """Compare all tests of chaos with a long reference on random machines (takes long)."""
    from chaosgym.diagnosis.agreement import agreement as compare
    from chaosgym.diagnosis.agreement import random_machines

    machines = random_machines(machine, points, seed)
    table = compare(machines, reference_cycles=cycles, budget=budget, progress=True)
    _emit(table.as_dict(), as_json, lambda: table.markdown().splitlines())


@app.command()
@machine_command
@click.option(
    "--model", type=click.Path(exists=True, dir_okay=False), help="Classifier file; default: the shipped one."
)
def classify(machine: Any, model: str | None, as_json: bool) -> None:
    """Tell the response type (I, II, III) by the learned classifier, without simulating."""
    from chaosgym.classifier import ResponseClassifier, default_classifier

    classifier = ResponseClassifier.load(model) if model else default_classifier(machine.name)
    answer = classifier.classify(machine)
    result = {
        "machine": machine.name,
        "response_type": answer.response_type,
        "probabilities": answer.probabilities,
    }
    _emit(result, as_json, lambda: [
        f"{machine.name}: Type {answer.response_type}",
        *(f"  Type {name:4s} {'#' * round(40 * chance):40s} {chance:.3f}"
          for name, chance in answer.probabilities.items()),
    ])  # fmt: skip


@app.command()
@machine_command
@click.option("--axis", "axes", multiple=True, metavar="FIELD=LOW:HIGH[:COUNT][:lin|log]", help="Repeatable, in SI.")
@click.option("--grid", "sampling", flag_value="grid", default="grid", help="All combinations (default).")
@click.option("--random", "random_size", type=click.IntRange(1), metavar="N", help="N random points.")
@click.option("--sobol", "sobol_size", type=click.IntRange(1), metavar="N", help="N points of a Sobol sequence.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--transient", type=click.IntRange(0, 10**7), default=200, show_default=True, help="Cycles to skip.")
@click.option("--cycles", type=click.IntRange(16, 10**7), default=200, show_default=True, help="Cycles to judge.")
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--out", type=click.Path(file_okay=False), required=True, help="Folder for the labelled points.")
def sweep(
    machine: Any,
    axes: tuple[str, ...],
    sampling: str,
    random_size: int | None,
    sobol_size: int | None,
    seed: int,
    transient: int,
    cycles: int,
    workers: int | None,
    out: str,
    as_json: bool,
) -> None:
    """Label many machines and keep them as Parquet; the same command again resumes."""
    from collections import Counter

    from chaosgym.sweeps import Axis, SweepPlan, run_sweep
    from chaosgym.sweeps.plan import default_axes

    if random_size and sobol_size:
        raise click.UsageError("--random and --sobol exclude each other")
    kind: Any = "random" if random_size else "sobol" if sobol_size else sampling
    chosen = tuple(Axis.parse(text) for text in axes) or default_axes(machine, kind)
    plan = SweepPlan(machine, chosen, kind, random_size or sobol_size or 0, seed, transient, cycles)
    labelled = run_sweep(plan, out, workers=workers, progress=True)
    counts = {name: dict(Counter(str(value) for value in labelled.column(name)))
              for name in ("nature", "response_type", "status")}  # fmt: skip
    result = {"machine": machine.name, "folder": out, "points": len(labelled.table), **counts}
    _emit(result, as_json, lambda: [
        f"{machine.name}: {len(labelled.table)} points in {out}",
        *(f"  {name:14s}" + ", ".join(f"{key} {count}" for key, count in sorted(counts[name].items()))
          for name in counts),
    ])  # fmt: skip


@app.command("train-classifier")
@click.option(
    "--data", type=click.Path(exists=True, file_okay=False), required=True, help="Folder of a finished sweep."
)
@click.option("--out", type=click.Path(dir_okay=False), required=True, help="Model file to write (.npz).")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def train_classifier(data: str, out: str, seed: int, as_json: bool) -> None:
    """Train the classifier on a sweep and judge it beside its baselines (needs the extra [learn])."""
    from pathlib import Path

    from chaosgym.classifier.train import report_table
    from chaosgym.classifier.train import train_classifier as train
    from chaosgym.sweeps import read_sweep

    if Path(out).exists() or not Path(out).absolute().parent.is_dir():
        raise click.UsageError(f"--out {out} exists already, or its folder does not; choose another file")
    trained = train(read_sweep(data), seed, progress=True)
    trained.classifier.save(out)
    _emit({"model": out, **trained.report}, as_json, lambda: report_table(trained.report))


@app.command()
@click.option("--out", type=click.Path(file_okay=False), default="chaosgym-demo", show_default=True, help="New folder.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True)
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def demo(out: str, seed: int, as_json: bool) -> None:
    """Simulate, label, train, and compare an agent with constant speed: a few minutes (needs the extra [learn])."""
    from chaosgym.demo import demo_table, run_demo

    result = run_demo(out, seed, say=lambda line: click.echo(line, err=True))
    _emit(result, as_json, lambda: demo_table(result))


@app.command()
@click.argument("brief", type=click.Path(dir_okay=False), required=False, metavar="[FILE.toml]")
@click.option("--template", metavar="MACHINE", help="Print a commented brief of a machine, ready to edit.")
@click.option("--peaks", type=click.Path(dir_okay=False), help="CSV of measured peak forces [N], one a cycle.")
@click.option("--load-rating", type=float, metavar="N", help="With --peaks and no brief: load rating [N].")
@click.option("--out", type=click.Path(dir_okay=False), help="HTML report to write, with a JSON file beside it.")
@click.option("--overwrite", is_flag=True, help="Replace the report if it exists.")
@click.option("--seed", type=click.IntRange(0), default=0, show_default=True, help="Of the machines in tolerance.")
@click.option("--workers", type=click.IntRange(1, 4096), default=None, help="Threads; default: all processors.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def design(
    brief: str | None, template: str | None, peaks: str | None, load_rating: float | None, out: str | None,
    overwrite: bool, seed: int, workers: int | None, as_json: bool,
) -> None:  # fmt: skip
    """Say whether a machine meets its criteria within its tolerances, and what to change if not."""
    from chaosgym.design import brief as briefs
    from chaosgym.design import measured
    from chaosgym.design.criteria import Criteria
    from chaosgym.design.study import study
    from chaosgym.plotting import design_report as report

    if template is not None:
        return click.echo(briefs.template(template), nl=False)
    if (brief is None) == (load_rating is None or peaks is None):
        raise click.UsageError("give a brief (see --template), or --peaks FILE.csv with --load-rating")
    if out is not None:
        report.report_paths(out, overwrite)
    asked = briefs.read_brief(brief) if brief is not None else None
    if peaks is not None:
        criteria = asked.criteria if asked is not None else Criteria(load_rating=load_rating or 0.0)
        found = measured.evaluate_peaks(measured.read_peaks(peaks), criteria)
        page, result, lines = report.measured_report(found), found.as_dict(), found.lines()
    elif asked is not None:
        answer = study(asked, seed=seed, workers=workers, progress=True)
        page, result, lines = (
            report.design_report(answer, f"chaosgym design {brief} --seed {seed}"),
            answer.as_dict(),
            answer.lines(),
        )
    if out is not None:
        report.write_report(page, result, out, overwrite)
        lines.append(f"report: {out}")
    _emit(result, as_json, lambda: lines)


@app.command()
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def info(as_json: bool) -> None:
    """Print versions and folders, for a bug report."""
    import platform
    from importlib import metadata

    from chaosgym.core import KERNEL_CACHE

    packages: dict[str, str | None] = {}
    for package in ("numpy", "scipy", "numba", "gymnasium", "pyarrow", "matplotlib", "torch", "stable-baselines3"):
        try:
            packages[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            packages[package] = None
    result = {
        "version": __version__,
        "python": platform.python_version(),
        "platform": platform.platform(),
        "machines": sorted(MACHINE_OPTIONS),
        "packages": packages,
        "kernel_cache": KERNEL_CACHE,
    }
    _emit(result, as_json, lambda: [
        f"chaosgym {__version__} on Python {result['python']}, {result['platform']}",
        "machines: " + ", ".join(MACHINE_OPTIONS),
        *(f"{package:18s} {version or 'not installed'}" for package, version in packages.items()),
        f"kernel cache: {KERNEL_CACHE}",
    ])  # fmt: skip


@app.command()
@click.option("--repeats", type=click.IntRange(1, 100), default=5, show_default=True, help="Timed runs per figure.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
def bench(repeats: int, as_json: bool) -> None:
    """Time the simulation on this computer: microseconds per operating cycle, one core."""
    from chaosgym.bench import benchmark

    result = benchmark(repeats)
    _emit({"microseconds_per_cycle": result}, as_json, lambda: [
        f"{name:45s} {value:8.1f} us per cycle {1e6 / value:10.0f} cycles/s" for name, value in result.items()
    ])  # fmt: skip


def main() -> None:
    """Entry point: one clear line instead of a traceback for every error that chaosgym raises on purpose."""
    try:
        app(standalone_mode=False)
    except click.exceptions.Abort:
        click.echo("Aborted.", err=True)
        sys.exit(130)
    except click.ClickException as error:
        click.echo(f"Error: {error.format_message()}", err=True)
        sys.exit(error.exit_code)
    except (ChaosgymError, OSError) as error:
        click.echo(f"Error: {error}", err=True)
        sys.exit(1 if isinstance(error, SimulationError) else 2)
