"""The commands ``diagnose`` and ``overlay``: is a response periodic or chaotic, and is it what the model says?"""

from pathlib import Path
from typing import Any

import click

from chaosgym.cli.machine_options import FloatRange, machine_command
from chaosgym.cli.measured_model import compared
from chaosgym.cli.measured_options import (
    Measured,
    Run,
    measured_options,
    measured_run,
    measured_runs,
    measured_sweep,
    run_as_dict,
    run_lines,
)
from chaosgym.cli.measured_run_up import judged_run_up, region_lines
from chaosgym.cli.measured_table import all_runs, judged, judged_files, sources_of, table_as_dict, table_lines
from chaosgym.cli.output import draw, emit, force_line, patience, picture_path, plot_option, verdict_lines
from chaosgym.machines import MACHINES


@machine_command(required=False)
@click.option(
    "--test",
    type=click.Choice(["adaptive", "two-step", "mut"]),
    default="adaptive",
    show_default=True,
    help="All tests in stages, or the Two-Step Test or the Matrix Update Test alone.",
)
@click.option("--budget", type=click.IntRange(100, 10**7), default=3200, show_default=True, help="Cycles at the most.")
@click.option("--types", is_flag=True, help="Also tell the response type (I, II, III) over the tolerances.")
@click.option("--margins", is_flag=True, help="Also tell how far each tolerance is from a loss of stability.")
@click.option(
    "--reach",
    type=FloatRange(0.0, 10.0, min_open=True),
    default=1.0,
    show_default=True,
    help="Tolerances up to which margins are looked for.",
)
@click.option(
    "--kicks",
    type=click.IntRange(1, 10**5),
    help="With --margins: knocks tried, for the smallest that leaves.",
)
@click.option("--step-check", is_flag=True, help="Repeat with a finer step and say whether the verdict stays.")
@click.option("--sweep", metavar="FILE", help="Peak forces at many speeds, with a column of speeds: Types I, II, III.")
@click.option("--speed-column", metavar="NAME", help="Column of the speed of --sweep, where there are several.")
@click.option("--run-up", is_flag=True, help="The speed of --series changes: orders, and types by bands of speed.")
@click.option("--orders", type=FloatRange(1.0, 1000.0), metavar="NUMBER", help="Highest order of --run-up; default 20.")
@click.option(
    "--estimate",
    multiple=True,
    metavar="FIELD",
    help="With a machine and what was measured: tell this parameter, such as clearance; repeatable.",
)
@measured_options
@plot_option()
def diagnose(
    machine: Any,
    test: str,
    budget: int,
    types: bool,
    margins: bool,
    reach: float,
    kicks: int | None,
    step_check: bool,
    sweep: str | None,
    speed_column: str | None,
    run_up: bool,
    orders: float | None,
    estimate: tuple[str, ...],
    measured: Measured,
    plot: str | None,
    as_json: bool,
) -> None:
    """Tell periodic from chaotic: a machine by simulation, a measured signal, or one by the other.

    With --sweep, the types of a measured sweep. With --run-up, orders and types of a recording whose speed changes.
    """
    picture = picture_path(plot, f"diagnose-{machine.name if machine else 'measured'}")
    if kicks and not margins:
        raise click.UsageError("--kicks belongs to --margins")
    if speed_column and not sweep:
        raise click.UsageError("--speed-column belongs to --sweep")
    if orders and not run_up:
        raise click.UsageError("--orders belongs to --run-up")
    if estimate and not (machine and measured):
        raise click.UsageError("--estimate needs a machine and what was measured: MACHINE --peaks FILE")
    if sweep:
        if machine or measured or run_up or types or margins or step_check or test != "adaptive":
            raise click.UsageError(
                "--sweep goes alone: no machine, no --peaks, --series or --run-up, nothing that needs a machine"
            )
        speeds, peaks, found, told = measured_sweep(sweep, speed_column, measured)
        result = {**told, **found.as_dict(), "warnings": []}
        lines = _sweep_lines(told, found)
        label = f"{told['speed_column']} [{told['speed_unit']}]" if told["speed_unit"] else told["speed_column"]
        title = f"Types of {Path(told['file']).name}"
        draw(picture, lambda plots: plots.sweep_figure(speeds, peaks, found, label, title), result, lines)
    elif run_up:
        if machine or types or margins or step_check or test != "adaptive":
            raise click.UsageError("--run-up goes without a machine, --test, --types, --margins and --step-check")
        found, title, unit, result, lines = judged_run_up(measured, orders)
        draw(picture, lambda plots: plots.run_up_figure(found, title, unit), result, lines)
    elif measured:
        if types or margins or step_check or test != "adaptive":
            raise click.UsageError("--peaks and --series go without --test, --types, --margins and --step-check")
        if machine:
            result, lines = _drawn(*compared(machine, measured, estimate), picture)
        else:
            result, lines = _measured(measured, picture)
    elif machine is None:
        raise click.UsageError(f"give a machine ({', '.join(MACHINES)}), --peaks FILE, --series FILE or --sweep FILE")
    elif test == "two-step":
        with patience("diagnose"):
            result, lines, verdict = _two_step(machine, budget, measured.sensor_error or 0.0)
        draw(picture, lambda plots: plots.diagnosis_figure(verdict), result, lines)
    elif test == "mut":
        with patience("diagnose"):
            result, lines, verdict = _matrix_update(machine)
        draw(picture, lambda plots: plots.diagnosis_figure(verdict), result, lines)
    else:
        if measured.sensor_sigma is not None:
            raise click.UsageError("--sensor-sigma belongs to --peaks or --series")
        with patience("diagnose"):
            sensor_error = measured.sensor_error or 0.0
            result, lines, verdict, motions = _diagnose_machine(
                machine, budget, types, margins, step_check, sensor_error
            )
            if margins:
                _add_margins(machine, verdict, reach, kicks or 0, result, lines, motions)
        draw(picture, lambda plots: plots.diagnosis_figure(verdict), result, lines)
    emit(result, as_json, lambda: lines)


def _measured(measured: Measured, picture: Path | None) -> tuple[dict[str, Any], list[str]]:
    """One measured run in full, or a table of several, with its picture."""
    sources = sources_of(measured)
    runs = [] if sources else measured_runs(measured)
    if len(runs) == 1:
        return _drawn(runs[0], run_as_dict(runs[0]), run_lines(runs[0].source, runs[0]), picture)
    found = [judged(runs[0].source, runs)] if runs else judged_files(measured, sources)
    result, lines = table_as_dict(found), table_lines(found)
    shown = [(_title(run), run.peaks, run.verdict.diagnosis) for run in all_runs(found)]
    draw(picture, lambda plots: plots.thumbnails(shown), result, lines)
    return result, lines


def _drawn(
    run: Run, result: dict[str, Any], lines: list[str], picture: Path | None
) -> tuple[dict[str, Any], list[str]]:
    """What is told of a measured run, with its picture."""
    title = _title(run)
    draw(picture, lambda plots: plots.measured_figure(run.peaks, run.verdict.diagnosis, title, run.unit), result, lines)
    return result, lines


def _title(run: Run) -> str:
    return f"{Path(run.source).name}, {run.name}"


def _sweep_lines(told: dict[str, Any], found: Any) -> list[str]:
    """Regions of types, upwards, then what was read."""
    rows = [f"{told['file']}: {len(found.speeds)} speeds", *region_lines(found, told["speed_unit"], "N")]
    return [*rows, *(f"  {note}" for note in told["notes"])]


def _two_step(machine: Any, budget: int, sensor_error: float) -> tuple[dict[str, Any], list[str], Any]:
    """Both steps of the Two-Step Test on one run from rest."""
    from chaosgym.diagnosis.verdict import of_machine
    from chaosgym.series import two_step_test
    from chaosgym.simulation import simulate

    record = simulate(machine, budget)
    verdict = of_machine(two_step_test(record, sensor_error=sensor_error), record=record)
    told, forces = _forces(machine, verdict)
    result = {"machine": machine.name, **verdict.as_dict(), **told, "warnings": []}
    lines = verdict_lines(f"{machine.name}, Two-Step Test", verdict, forces)
    if section := verdict.evidence.get("section"):
        lines.append(f"  section: {section}")
    return result, lines, verdict


def _matrix_update(machine: Any) -> tuple[dict[str, Any], list[str], Any]:
    from chaosgym.diagnosis import matrix_update_test

    verdict = matrix_update_test(machine)
    told, forces = _forces(machine, verdict)
    result = {"machine": machine.name, **verdict.as_dict(), **told, "warnings": []}
    return result, verdict_lines(f"{machine.name}, Matrix Update Test", verdict, forces), verdict


def _forces(machine: Any, verdict: Any) -> tuple[dict[str, Any], list[str]]:
    """Settled peak forces of every surface, and the largest of the transient: for JSON, and as lines."""
    from chaosgym.design.statistics import summary

    settled, before = verdict.judged.peak_force, verdict.transient_run.peak_force
    shown = machine.sides[verdict.judged.worst_side]
    surfaces = {side: summary(settled[:, place]) for side, place in machine.surfaces.items()}
    transient = {side: float(before[:, place].max()) for side, place in machine.surfaces.items()}
    told = {
        "peak_force_summary_N": surfaces[shown],
        "worst_surface": shown,
        "surfaces_peak_force_N": surfaces,
        "transient_largest_peak_force_N": transient,
    }
    touched = {side: found for side, found in surfaces.items() if found["max"] > 0.0}
    lines = [f"{side}: {force_line(found)}" for side, found in touched.items()]
    largest = max(surfaces, key=lambda side: surfaces[side]["max"])
    if surfaces[shown]["max"] < (1.0 - 1e-9) * surfaces[largest]["max"]:
        lines.append(f"monitored: {shown}; the largest force is on {largest}, {surfaces[largest]['max']:.2f} N")
    elif min(found["max"] for found in surfaces.values()) < (1.0 - 1e-9) * surfaces[shown]["max"] and len(touched) > 1:
        lines.append(f"worst surface: {shown}, {surfaces[shown]['max']:.2f} N")
    if 0 < len(touched) < len(surfaces):
        lines.append(f"never touched once settled: {', '.join(side for side in surfaces if side not in touched)}")
    lines.append("transient: up to " + ", ".join(f"{peak:.2f} N {side}" for side, peak in transient.items()))
    return told, lines


def _diagnose_machine(
    machine: Any, budget: int, types: bool, margins: bool, check: bool, sensor_error: float
) -> tuple[dict[str, Any], list[str], Any, Any]:
    """The verdict, and the motions of the machine if they were looked for."""
    from chaosgym.diagnosis import attractors, diagnose, response_type, signs_of_chaos
    from chaosgym.diagnosis.carried import carried_states
    from chaosgym.diagnosis.step_check import step_check

    verdict, judged, motions = diagnose(machine, budget=budget, sensor_error=sensor_error), None, None
    if types:
        judged = response_type(machine, budget=budget, sensor_error=sensor_error, centre=verdict)
        verdict, motions = judged.centre, judged.attractors
    elif margins and verdict.nature == "periodic":
        motions = attractors(machine, centre=verdict, carried=carried_states(machine))
        verdict = motions.told_of(verdict)
    told, forces = _forces(machine, verdict)
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    result = {
        "machine": machine.name,
        **verdict.as_dict(),
        **told,
        "largest_lyapunov_exponent_per_cycle": {key: exponent[key] for key in ("value", "standard_error")},
        "cycles_used": verdict.evidence["cycles_used"],
        "warnings": [verdict.reason] if verdict.status in ("disputed", "transient", "unresolved") else [],
    }
    if not verdict.judged.peak_force.any():
        result["warnings"].append("no contact at all: the gap is never closed")
    votes = ", ".join(f"{test} {vote}" for test, vote in verdict.votes.items())
    lines = verdict_lines(machine.name, verdict, forces)
    lines.append(f"  {result['cycles_used']} cycles used; votes: {votes}")
    signs = signs_of_chaos(verdict)
    result["signs_of_chaos"] = [sign.as_dict() for sign in signs]
    lines += [f"  {sign.line}" for sign in signs]
    if not verdict.judged.peak_force.any():
        lines.append(f"  {result['warnings'][-1]}")
    if types or margins:
        result["attractors"] = None if motions is None else motions.as_dict()
    if judged:
        result |= {"response_type": judged.type, "response_type_reason": judged.reason}
        lines.append(f"  Type {judged.type}: {judged.reason}")
    if check:
        compared = step_check(machine, verdict, budget=budget, sensor_error=sensor_error)
        result["step_check"] = compared.as_dict()
        lines.append(f"  {compared.summary}")
    return result, lines, verdict, motions


def _add_margins(
    machine: Any, verdict: Any, reach: float, kicks: int, result: dict[str, Any], lines: list[str], motions: Any
) -> None:
    """Add the margins of a certified orbit and what lives beside it, or why there are none."""
    from chaosgym.branches.coexistence import coexistence
    from chaosgym.branches.margins import margins_of

    found = margins_of(machine, verdict, reach=reach)
    if found is None:
        result["margins"] = None
        lines.append(f"  no margins: they need a periodic response that is proven, this one is {verdict.words}")
        return
    result["margins"] = found.as_dict()
    lines.append(f"  largest multiplier {found.largest_multiplier:.3g}; stability ends, in tolerances:")
    lines += [f"    {line}" for line in _margin_lines(machine, found, reach)]
    beside = coexistence(machine, verdict, motions, knocks=kicks)
    result["coexistence"] = beside.as_dict()
    lines += [f"  {line}" for line in beside.lines]


def _margin_lines(machine: Any, found: Any, reach: float) -> list[str]:
    told: dict[str, list[str]] = {}
    for margin in found.margins:
        sign, nominal = "-" if margin.side < 0 else "+", getattr(machine, margin.parameter)
        change = f" ({margin.value / nominal - 1.0:+.2%})" if nominal else ""
        if margin.kind is not None:
            text = f"{sign}{margin.share:.2f} {margin.kind} at {margin.value:.8g}{change}"
        else:
            text = f"{sign}{margin.share:.2f} {margin.end}" if margin.end else f"{sign} none within {reach:g}"
        told.setdefault(margin.parameter, []).append(text)
    return [f"{name:22s} {'; '.join(texts)}" for name, texts in told.items()]


@machine_command
@measured_options
@click.option(
    "--out", type=click.Path(dir_okay=False, path_type=Path), required=True, help="Picture (.png, .svg, .pdf)."
)
def overlay(machine: Any, measured: Measured, out: Path, as_json: bool) -> None:
    """Lay a measured record over what a machine does: peaks, their distribution and their section."""
    if not measured:
        raise click.UsageError("give what was measured: --peaks FILE or --series FILE")
    from chaosgym.fit.overlay import overlay as compare
    from chaosgym.plotting.commands import overlay_figure
    from chaosgym.plotting.style import check_picture, save_picture

    picture = check_picture(out)
    run = measured_run(measured)
    found = compare(machine, run.peaks, run.verdict.diagnosis, larger=bool(measured.series))
    save_picture(overlay_figure(found), picture)
    result = {**found.as_dict(), "file": run.source, "out": str(out)}
    emit(result, as_json, lambda: _overlay_lines(result))


def _overlay_lines(result: dict[str, Any]) -> list[str]:
    share = result["distance_share_of_mean"]
    rows = []
    for name in ("measured", "simulated"):
        told = result[name]
        period = f", period {told['period']}" if told["period"] else ""
        forces = f"mean peak {told['mean_peak_force_N']:.2f} N, largest {told['largest_peak_force_N']:.2f} N"
        rows.append(f"{name:10s} {told['nature']}{period}, {forces}")
    apart = "" if share is None else f", {share:.1%} of the measured mean"
    rows.append(f"their peaks are {result['distance_N']:.3g} N apart on average{apart}")
    return [*rows, f"written to {result['out']}"]
