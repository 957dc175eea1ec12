"""The command ``diagnose``: is a response periodic or chaotic?"""

from collections.abc import Mapping
from typing import Any

import click

from chaosgym.cli.machine_options import machine_command
from chaosgym.cli.output import emit
from chaosgym.machines.registry import MACHINES


@machine_command(required=False)
@click.option(
    "--test",
    type=click.Choice(["adaptive", "mut"]),
    default="adaptive",
    show_default=True,
    help="All tests in stages, or the Matrix Update Test alone.",
)
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
        raise click.UsageError(f"give a machine ({', '.join(MACHINES)}), --peaks FILE or --series FILE")
    elif test == "mut":
        result, lines = _matrix_update(machine)
    else:
        result, lines = _diagnose_machine(machine, budget, types, step_check, sensor_error)
    emit(result, as_json, lambda: lines)


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

    verdict = matrix_update_test(machine)
    summary = _summary(verdict.judged.peak_force[:, 0])
    result = {"machine": machine.name, **verdict.as_dict(), "peak_force_summary_N": summary, "warnings": []}
    return result, _verdict_lines(f"{machine.name}, Matrix Update Test", verdict, summary, " N")


def _diagnose_machine(
    machine: Any, budget: int, types: bool, check: bool, sensor_error: float
) -> tuple[dict[str, Any], list[str]]:
    from chaosgym.diagnosis import diagnose, response_type
    from chaosgym.diagnosis.step_check import step_check

    verdict = diagnose(machine, budget=budget, sensor_error=sensor_error)
    summary = _summary(verdict.judged.peak_force[:, 0])
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
        judged = response_type(machine, budget=budget, sensor_error=sensor_error, centre=verdict)
        result |= {"response_type": judged.type, "response_type_reason": judged.reason}
        lines.append(f"  Type {judged.type}: {judged.reason}")
    if check:
        compared = step_check(machine, verdict, budget=budget, sensor_error=sensor_error)
        result["step_check"] = compared.as_dict()
        lines.append(f"  {compared.summary}")
    return result, lines
