"""The labels of points: of each, one run, judged in stages; then the types, which rest on neighbours too."""

import platform
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib.metadata import version
from pathlib import Path
from threading import Event
from typing import Any

import llvmlite.binding
import numpy as np
import pyarrow as pa

from chaosgym.branches.coexistence import coexistence
from chaosgym.core.kernel_cache import source_digest
from chaosgym.diagnosis import bounce_fraction, response_type
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.diagnosis.type_rule import CROSS, type_of_cross, types_on_grid
from chaosgym.errors import DiagnosisError, ParameterError, SimulationError, UnfinishedError
from chaosgym.machines import Machine
from chaosgym.series.stroboscopic import irregularity
from chaosgym.series.verdict import Definition
from chaosgym.simulation import CycleRecord, simulate
from chaosgym.sweeps.dataset import SENSOR_ERROR, SIGNALS, WINDOW, WINDOWS, fixed_fields, schema, signal_columns
from chaosgym.sweeps.plan import SweepPlan
from chaosgym.version import __version__

SOURCES = Path(__file__).resolve().parents[1]

PACKAGES = ("numpy", "scipy", "numba", "llvmlite", "pyarrow")


@cache
def provenance() -> dict[str, str]:
    """Describe this installation in words."""
    return {
        "chaosgym": __version__,
        "commit": source_commit(),
        "physics": "-".join(source_digest(SOURCES / floor) for floor in ("core", "machines")),
        "python": platform.python_version(),
        **{name: version(name) for name in PACKAGES},
        "platform": f"{platform.system()} {platform.machine()}",
        "processor": str(llvmlite.binding.get_host_cpu_name()),
    }


def source_commit() -> str:
    """Commit that last changed the package's sources; "+" if they have changed since, "unknown" without Git."""

    def git(*arguments: str) -> str:
        command = ["git", "-C", str(SOURCES), *arguments, "--", "."]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    try:
        commit = git("log", "-1", "--format=%H")
        return f"{commit}{'+' if git('status', '--porcelain') else ''}" if commit else "unknown"
    except (OSError, subprocess.CalledProcessError):
        return "unknown"


RETRY = 8
"""Budgets that a point may take which is undetermined after one."""


def label_point(
    machine: Machine, budget: int, *, signals: bool = False, definition: Definition = "settled"
) -> dict[str, Any]:
    """Label one machine by a definition; a run that fails is a row with status "failed"."""
    try:
        verdict = diagnose_alone(machine, budget=budget)
        if verdict.nature == "undetermined":
            verdict = diagnose_alone(machine, budget=RETRY * budget)
    except (DiagnosisError, SimulationError) as error:
        return {"status": "failed", "reason": str(error)}
    verdict = verdict.labelled(definition)
    judged = verdict.judged
    peaks = judged.peaks
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]
    label = {
        "nature": verdict.nature,
        "period": verdict.period,
        "status": verdict.status,
        "margin": verdict.margin,
        "two_step": verdict.votes["two_step"],
        "exponent": exponent["value"],
        "exponent_error": exponent["standard_error"],
        "peak_force_min": peaks.min(),
        "peak_force_max": peaks.max(),
        "peak_force_mean": peaks.mean(),
        "peak_force_std": peaks.std(),
        "largest_peak": verdict.evidence["largest_peak"],
        "impacts_per_cycle": judged.impacts.sum(axis=1).mean(),
        "contact_fraction": judged.contact_fraction.sum(axis=1).mean(),
        "bounce_fraction": bounce_fraction(judged),
        "settle_cycle": verdict.settle_cycle,
        "transient_chaos": verdict.transient_chaos,
        "horizon": verdict.horizon,
        "cycles_used": verdict.evidence["cycles_used"],
        "headline": verdict.statement.headline,
        "reason": verdict.reason,
    }
    kept = _signals(machine, verdict.run) if signals else {}
    settled = kept.get("settled_peak_force", peaks[-WINDOW:])
    scatter = irregularity(settled)
    return {**label, **kept, "irregularity": scatter, "resolvable": scatter > SENSOR_ERROR}


def _signals(machine: Machine, record: CycleRecord) -> dict[str, Any]:
    """Signals of a run, which goes on if it ended before their last cycle; none if it can't."""
    missing = max(WINDOWS.values()) + WINDOW - len(record)
    try:
        if missing > 0:
            record = record.followed_by(simulate(machine, missing, record.final_state))
    except SimulationError:
        return {}
    series = {"peak_force": record.peaks, "displacement": record.displacement, "velocity": record.velocity}
    return {
        f"{window}_{name}": series[name][first : first + WINDOW].astype(np.float32)
        for window, first in WINDOWS.items()
        for name in SIGNALS[window]
    }


def full_type(machine: Machine, plan: SweepPlan) -> dict[str, Any]:
    """Type of a machine over all its tolerances, by runs of its own, and its other motions; nothing where they fail."""
    try:
        found = response_type(
            machine,
            budget=plan.budget,
            initial_states=plan.initial_states,
            definition=plan.definition,
            workers=1,
        )
        if found.attractors is None:
            return {"full_response_type": found.type}
        beside = coexistence(machine, found.centre, found.attractors, workers=1)
    except (DiagnosisError, ParameterError, SimulationError):
        return {}
    told = "; ".join([found.centre.statement.other_motions, *beside.lines])
    return {"full_response_type": found.type, "motions": len(found.attractors.motions), "other_motions": told}


def label_rows(
    plan: SweepPlan, rows: range, stop: Event | None = None, known: Mapping[int, dict[str, Any]] | None = None
) -> pa.Table:
    """Label some rows of a plan; response types that rest on neighbours are left to the end of the sweep.

    ``known`` has types by runs of their own that need not be computed again.

    Raises
    ------
    UnfinishedError
        If ``stop`` is set meanwhile.
    """
    points = plan.points(rows)
    fixed, signals, lines = fixed_fields(plan), signal_columns(), list[dict[str, Any]]()
    with_signals, with_full_type = plan.with_signals(rows), plan.with_full_type(rows)
    for index in range(len(rows)):
        if stop is not None and stop.is_set():
            raise UnfinishedError("the sweep was stopped; the same command goes on")
        point = {name: float(column[index]) for name, column in points.items()}
        try:
            machine = plan.machine_at(point)
        except ParameterError as error:
            lines.append({**fixed, **point, "status": "failed", "reason": str(error)})
            continue
        label = label_point(machine, plan.budget, signals=plan.signals > 0.0, definition=plan.definition)
        if not with_signals[index]:
            label = {name: value for name, value in label.items() if name not in signals}
        if with_full_type[index]:
            label |= (known or {}).get(rows[index]) or full_type(machine, plan)
        lines.append(fixed | point | label)
    if plan.sampling == "crosses":
        for line, number, part in zip(lines, plan.machine_numbers(rows), plan.splits(rows), strict=True):
            line |= {"machine": int(number), "split": part}
    described = schema(plan, {"rows": [rows.start, rows.stop], "provenance": provenance()})
    return pa.Table.from_pylist(lines, schema=described)


def with_response_types(table: pa.Table, plan: SweepPlan, rows: range) -> pa.Table:
    """Fill in the response types of some rows: a whole grid, whole crosses, or any other points.

    That of a point follows from the points up to one tolerance away in speed and clearance.
    """
    natures = np.array(table.column("nature").fill_null("undetermined").to_pylist())
    largest = table.column("largest_peak").to_numpy(zero_copy_only=False)
    if plan.sampling == "crosses":
        crosses = zip(natures.reshape(-1, len(CROSS)), largest.reshape(-1, len(CROSS)), strict=True)
        kinds = [kind for cross in crosses for kind in (type_of_cross(*cross)[0], *[None] * (len(CROSS) - 1))]
        table = _with_column(table, "response_type", pa.array(kinds, pa.string()))
        return _with_column(table, "type_neighbours", pa.array(plan.type_neighbours(rows), pa.int32()))
    reach = plan.type_axes()
    if not reach and plan.sampling == "grid":
        return _with_column(table, "response_type", _without_neighbours(table))
    if not reach:
        return _with_column(table, "response_type", table.column("full_response_type").combine_chunks())
    types = types_on_grid(
        natures.reshape(plan.shape), largest.reshape(plan.shape), axes=list(reach), reach=list(reach.values())
    )
    table = _with_column(table, "response_type", pa.array(types.ravel().tolist(), pa.string()))
    return _with_column(table, "type_neighbours", pa.array(plan.type_neighbours(rows), pa.int32()))


def _without_neighbours(table: pa.Table) -> pa.Array:
    """Types on a grid that is too coarse: III where the point does not repeat, else that of runs of its own."""
    types = []
    for nature, full in zip(table["nature"].to_pylist(), table["full_response_type"].to_pylist(), strict=True):
        types.append("III" if nature in ("chaotic", "quasiperiodic") else full or "undetermined")
    return pa.array(types, pa.string())


def _with_column(table: pa.Table, name: str, values: pa.Array) -> pa.Table:
    position = table.schema.get_field_index(name)
    return table.set_column(position, table.schema.field(position), values)
