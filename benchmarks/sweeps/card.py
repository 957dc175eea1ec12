"""The card of a dataset: how it was made, how far to trust it, its licence."""

import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from chaosgym.diagnosis import default_tolerances
from chaosgym.machines.parameters import changes_of, parameters_of
from chaosgym.series import TYPES
from chaosgym.sweeps.dataset import LabelledSweep
from chaosgym.sweeps.info import dataset_info
from chaosgym.sweeps.plan import SweepPlan

CARD_FILE = "CARD.md"


def sweep_command(plan: SweepPlan, folder: str) -> str:
    """Return the command line that makes a plan's dataset."""
    words = ["chaosgym", "sweep", plan.machine.name]
    for name, value in changes_of(plan.machine).items():
        if name not in plan.fields:
            words += ["--set", f"{name}={value}"]
    for axis in plan.axes:
        words += ["--axis", str(axis)]
    words += ["--sampling", "grid" if plan.sampling == "grid" else f"{plan.sampling}:{plan.size}:{plan.seed}"]
    words += ["--budget", str(plan.budget)]
    labels = {"definition": plan.definition, "signals": f"{plan.signals:g}", "full-types": f"{plan.full_types:g}"}
    labels |= {"initial-states": str(plan.initial_states)} if plan.full_types else {}
    for key, value in labels.items():
        words += ["--label", f"{key}={value}"]
    return shlex.join([*words, "--out", folder])


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


def _died_out(plan: SweepPlan, faults: Mapping[str, int]) -> str:
    if plan.definition == "settled":
        return "; `transient_chaos` says how long it lasted where it died out before"
    return f", and so does chaos that died out within it: status *transient*, {faults['transient']:,} rows"


def _trust(plan: SweepPlan, info: Mapping[str, Any]) -> str:
    faults, types = info["faults"], info["types"]
    lines = [
        f"- Horizon: {plan.budget} cycles from rest. Chaos that dies out later counts as chaotic"
        f"{_died_out(plan, faults)}.",
        f"- {faults['undetermined']:,} rows are undetermined, {faults['failed']:,} could not be run, "
        f"{faults['disputed']:,} are disputed between tests.",
    ]
    lines.append(f"- Model: {info['model']['rung'] or 'its own'}; {info['model']['told']}.")
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
