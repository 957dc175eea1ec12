"""What a dataset holds, as JSON and as its card: how it was made, how far to trust it, its licence."""

import json
import shlex
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.diagnosis import default_tolerances
from chaosgym.errors import DatasetError
from chaosgym.files import first_line, write_atomically
from chaosgym.machines.parameters import changes_of, parameters_of
from chaosgym.series import TYPES
from chaosgym.sweeps.dataset import DAMAGE, DATA_FILE, LabelledSweep, read_sweep
from chaosgym.sweeps.folder import CHUNK_FOLDER, PLAN_FILE, read_plan_file
from chaosgym.sweeps.plan import SweepPlan

CLASSES = ("nature", "response_type", "full_response_type", "status", "split")


def dataset_info(folder: str | Path) -> dict[str, Any]:
    """Describe a sweep's folder as JSON values.

    Returns
    -------
    dict
        ``machine``, ``complete``, ``rows`` (finished and planned), ``classes`` (counts by label column; by split too),
        ``faults``, ``types`` (agreement of the two type columns), ``settings``, ``definitions`` and ``provenance``; of
        an unfinished sweep without classes and faults.

    Raises
    ------
    DatasetError
        If the folder holds no sweep, or its file is damaged.
    """
    folder = Path(folder)
    if (folder / DATA_FILE).is_file():
        return _finished(read_sweep(folder), (folder / DATA_FILE).stat().st_size)
    if not (folder / PLAN_FILE).is_file():
        raise DatasetError(f"{folder} holds no sweep: neither {DATA_FILE} nor {PLAN_FILE}")
    settings = read_plan_file(folder / PLAN_FILE)
    try:
        plan = SweepPlan.from_settings(settings)
    except DAMAGE as error:
        raise DatasetError(f"{folder / PLAN_FILE} is damaged: {type(error).__name__}: {first_line(error)}") from error
    kept = {path.name for path in (folder / CHUNK_FOLDER).glob("*.parquet")}
    rows = sum(len(chunk) for chunk in plan.chunks() if f"{chunk.start:012d}.parquet" in kept)
    return {
        "machine": settings["machine"],
        "complete": False,
        "rows": {"finished": rows, "planned": len(plan)},
        "settings": settings,
    }


def _finished(sweep: LabelledSweep, size: int) -> dict[str, Any]:
    present = [name for name in CLASSES if name in sweep.table.column_names]
    classes: dict[str, Any] = {name: _counts(sweep.column(name)) for name in present}
    if "split" in present:
        parts = sweep.column("split")
        for name in ("nature", "response_type"):
            values = sweep.column(name)
            classes[f"{name}_by_split"] = {str(part): _counts(values[parts == part]) for part in np.unique(parts)}
    metadata = sweep.table.schema.metadata
    return {
        "machine": sweep.settings["machine"],
        "complete": True,
        "rows": {"finished": len(sweep.table), "planned": len(sweep.plan)},
        "bytes": size,
        "classes": classes,
        "faults": _faults(sweep),
        "two_step": _two_step(sweep),
        "types": compare_types(sweep),
        "settings": sweep.settings,
        "definitions": json.loads(metadata[b"definitions"]),
        "provenance": sweep.provenance,
    }


def _counts(values: Any) -> dict[str, int]:
    """Counts by class, the most frequent first; rows without one are left out."""
    return dict(Counter(str(value) for value in values if value is not None).most_common())


def _faults(sweep: LabelledSweep) -> dict[str, int]:
    """Rows that a reader may want to leave out."""
    status, nature, neighbours = (sweep.column(name) for name in ("status", "nature", "type_neighbours"))
    wanted_neighbours = sweep.plan.all_neighbours
    faults = {name: int(np.sum(status == name)) for name in ("failed", "disputed", "unresolved", "transient")}
    faults["undetermined"] = int(np.sum(nature == "undetermined"))
    if sweep.plan.sampling == "grid" and wanted_neighbours:
        faults["without_all_neighbours"] = int(np.sum(neighbours != wanted_neighbours))
    if sweep.plan.signals:
        wanted = sweep.plan.with_signals(range(len(sweep.table)))
        faults["without_promised_signals"] = int(wanted.sum()) - (
            len(sweep.table) - sweep.table.column("start_velocity").null_count
        )
    return faults


def _two_step(sweep: LabelledSweep) -> dict[str, Any] | None:
    """How often the Two-Step Test alone and the exponent's sign agree that a response is chaotic or is not.

    None for a sweep of a version without the column.
    """
    if "two_step" not in sweep.table.column_names:
        return None
    alone = sweep.column("two_step")
    exponent, error = sweep.column("exponent"), sweep.column("exponent_error")
    told = np.array([word not in (None, "undetermined") for word in alone])
    chaotic = exponent > 3.0 * error
    return {
        "rows": int(told.sum()),
        "undetermined": int(np.sum(alone == "undetermined")),
        "agreement": round(float(np.mean((alone == "chaotic")[told] == chaotic[told])), 4) if told.any() else None,
    }


def compare_types(sweep: LabelledSweep) -> dict[str, Any] | None:
    """Types from neighbours against types over the full window, where both stand; None if nowhere."""
    shared, full = sweep.column("response_type"), sweep.column("full_response_type")
    both = np.array([a is not None and b is not None for a, b in zip(shared, full, strict=True)])
    if not sweep.plan.all_neighbours or not both.any():
        return None
    pairs = Counter((str(a), str(b)) for a, b in zip(shared[both], full[both], strict=True))
    return {
        "points": int(both.sum()),
        "disagreement": float(np.mean(shared[both] != full[both])),
        "pairs": {f"{a} against {b}": count for (a, b), count in sorted(pairs.items())},
    }


CARD_FILE = "CARD.md"


def sweep_command(plan: SweepPlan, folder: str) -> str:
    """Return the command line that makes a plan's dataset."""
    words = ["chaosgym", "sweep", plan.machine.name]
    for name, value in changes_of(plan.machine).items():
        if name not in plan.fields:
            words += ["--set", f"{name}={value}"]
    for axis in plan.axes:
        words += ["--axis", str(axis)]
    options = {"random": "--random", "sobol": "--sobol", "crosses": "--crosses"}
    if plan.sampling in options:
        words += [options[plan.sampling], str(plan.size)]
    words += ["--seed", str(plan.seed), "--budget", str(plan.budget)]
    for option, share in (("--signals", plan.signals), ("--full-types", plan.full_types)):
        words += [option, f"{share:g}"] if share else []
    words += ["--initial-states", str(plan.initial_states)] if plan.full_types else []
    return shlex.join([*words, "--out", folder])


def write_card(folder: str | Path) -> Path:
    """Write the card of a finished sweep into its folder; return its path.

    Raises
    ------
    DatasetError
        If the sweep is not finished.
    """
    folder = Path(folder)
    text = dataset_card(read_sweep(folder), folder)
    write_atomically(folder / CARD_FILE, lambda temporary: temporary.write_text(text))
    return folder / CARD_FILE


def dataset_card(sweep: LabelledSweep, folder: Path) -> str:
    """Return the card of a sweep that lies in ``folder``."""
    info = dataset_info(folder)
    plan = sweep.plan
    sections = [
        f"# {plan.machine.name}: {len(sweep.table):,} labelled points",
        _how_made(plan, info, folder),
        _columns(sweep),
        _balance(info["classes"]),
        _trust(plan, info),
        _split(plan),
        _provenance(info),
        "## Licence\n\nMIT, as chaosgym itself.",
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


def _how_made(plan: SweepPlan, info: Mapping[str, Any], folder: Path) -> str:
    described = parameters_of(plan.machine)
    ranges = [
        f"| `{axis.field}` | {axis.low:.6g} to {axis.high:.6g} | {described[axis.field].unit} | {axis.scale} |"
        for axis in plan.axes
    ]
    crosses = ""
    if plan.sampling == "crosses":
        crosses = (
            f"{plan.size} independent machines, drawn at random. Each is a cross of five rows: the "
            "centre, and one tolerance below and above it in speed and in clearance. The response type of the centre "
            "follows from the five.\n\n"
        )
    return (
        f"## How it was made\n\n    {sweep_command(plan, str(folder))}\n\n"
        f"{crosses}Every point is run from rest and diagnosed in stages of 16, 32, 100, 200, ... cycles, {plan.budget} "
        "at the most; one that is undetermined may take eight times as many. The other parameters are those of the "
        "base machine in the file's metadata.\n\n"
        "| field | range | unit | uniform in |\n|---|---|---|---|\n" + "\n".join(ranges)
    )


def _columns(sweep: LabelledSweep) -> str:
    rows = []
    for field in sweep.table.schema:
        unit, meaning = (field.metadata[key].decode() for key in (b"unit", b"meaning"))
        rows.append(f"| `{field.name}` | {field.type} | {unit} | {meaning} |")
    return "## Columns\n\n| column | type | unit | meaning |\n|---|---|---|---|\n" + "\n".join(rows)


def _balance(classes: Mapping[str, Any]) -> str:
    lines = []
    for name, counts in classes.items():
        if name.endswith("_by_split"):
            continue
        total = sum(counts.values())
        shown = ", ".join(f"{label} {count:,} ({count / total:.1%})" for label, count in counts.items())
        lines.append(f"- `{name}`: {shown or 'none'}")
    for name in ("nature_by_split", "response_type_by_split"):
        for part, counts in classes.get(name, {}).items():
            total = sum(counts.values())
            shown = ", ".join(f"{label} {count / total:.1%}" for label, count in sorted(counts.items()))
            lines.append(f"- {part}, `{name.removesuffix('_by_split')}`: {shown}")
    return "## Class balance\n\n" + "\n".join(lines)


def _trust(plan: SweepPlan, info: Mapping[str, Any]) -> str:
    faults, types = info["faults"], info["types"]
    lines = [
        f"- Horizon: {plan.budget} cycles from rest. Chaos that dies out later counts as chaotic, and so does chaos "
        f"that died out within it: status *transient*, {faults['transient']:,} rows.",
        f"- {faults['undetermined']:,} rows are undetermined, {faults['failed']:,} could not be run, "
        f"{faults['disputed']:,} are disputed between tests.",
    ]
    votes = info["two_step"]
    if votes and votes["agreement"] is not None:
        lines.append(
            f"- The Two-Step Test alone (`two_step`) and the exponent's sign agree on chaos at "
            f"{votes['agreement']:.1%} of {votes['rows']:,} rows; it is undetermined at {votes['undetermined']:,}."
        )
    if "without_all_neighbours" in faults:
        lines.append(
            f"- {faults['without_all_neighbours']:,} rows at borders of the grid lack some neighbours "
            "(`type_neighbours`), so their type may be too low."
        )
    if types:
        pairs = ", ".join(f"{pair} {count}" for pair, count in types["pairs"].items() if len(set(_words(pair))) > 1)
        lines.append(
            f"- Types from neighbours in speed and clearance against types over all tolerances "
            f"({', '.join(default_tolerances(plan.machine))}; {plan.initial_states} initial states): "
            f"{types['disagreement']:.1%} of {types['points']:,} points disagree ({pairs or 'none'})."
        )
    return "## How far to trust the labels\n\n" + "\n".join(lines)


def _words(pair: str) -> list[str]:
    return [word for word in pair.split(" against ") if word in TYPES]


def _split(plan: SweepPlan) -> str:
    if plan.sampling != "crosses":
        return ""
    return (
        "## Split\n\n`split` divides whole machines. It depends on the seed and the number of the machine alone, so "
        "that a larger dataset of the same seed keeps it."
    )


def _provenance(info: Mapping[str, Any]) -> str:
    lines = [", ".join(f"{name} {value}" for name, value in made.items()) for made in info["provenance"]]
    return "## Provenance\n\n" + "\n".join(f"- {line}" for line in lines)
