"""The card of a dataset: how it was made, what it holds, how far to trust it, its licence."""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.diagnosis import TYPES, default_tolerances
from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically
from chaosgym.machines import MACHINES
from chaosgym.machines.parameters import parameters_of
from chaosgym.sweeps.dataset import LabelledSweep, read_sweep
from chaosgym.sweeps.info import dataset_info
from chaosgym.sweeps.plan import SweepPlan

CARD_FILE, NOISE_FILE = "CARD.md", "noise.json"


def sweep_command(plan: SweepPlan, folder: str) -> str:
    """Return the command line that makes a plan's dataset."""
    default: Any = MACHINES[plan.machine.name]()
    words = ["chaosgym", "sweep", plan.machine.name]
    for name in parameters_of(plan.machine):
        value = getattr(plan.machine, name)
        if value != getattr(default, name) and name not in plan.fields:
            words += ["--set", f"{name}={value}"]
    for axis in plan.axes:
        words += ["--axis", str(axis)]
    options = {"random": "--random", "sobol": "--sobol", "lattice": "--machines"}
    if plan.sampling in options:
        words += [options[plan.sampling], str(plan.size)]
    for patch in plan.patches:
        words += ["--patch", str(patch)]
    words += ["--seed", str(plan.seed), "--budget", str(plan.budget)]
    for option, share in (("--signals", plan.signals), ("--full-types", plan.full_types)):
        words += [option, f"{share:g}"] if share else []
    return shlex.join([*words, "--out", folder])


def write_card(folder: str | Path) -> Path:
    """Write the card of a finished sweep into its folder; return its path.

    Raises
    ------
    DatasetError
        If the sweep is not finished, or the file of its label noise is damaged.
    """
    folder = Path(folder)
    text = dataset_card(read_sweep(folder), folder)
    write_atomically(folder / CARD_FILE, lambda temporary: temporary.write_text(text))
    return folder / CARD_FILE


def dataset_card(sweep: LabelledSweep, folder: Path) -> str:
    """Return the card of a sweep that lies in ``folder``, with its label noise if that was measured there."""
    info = dataset_info(folder)
    plan = sweep.plan
    sections = [
        f"# {plan.machine.name}: {len(sweep.table):,} labelled points",
        _how_made(plan, info, folder),
        _columns(sweep),
        _balance(info["classes"]),
        _trust(plan, info),
        _noise(folder),
        _split(sweep, plan),
        _provenance(info),
        "## Licence\n\nMIT, as chaosgym itself.",
    ]
    return "\n\n".join(section for section in sections if section) + "\n"


def _how_made(plan: SweepPlan, info: Mapping[str, Any], folder: Path) -> str:
    described = parameters_of(plan.machine)
    ranges = [
        f"| `{span.field}` | {span.low:.6g} to {span.high:.6g} | {described[span.field].unit} | {about} |"
        for spans, about in ((plan.axes, "per machine"), (plan.patches, "lattice"))
        for span in spans
    ]
    lattice = ""
    if plan.patches:
        steps = " and ".join(
            f"{patch.count} values of `{patch.field}` {patch.shown_step} apart" for patch in plan.patches
        )
        lattice = (
            f"{plan.size} machines from a scrambled Sobol sequence, each on a lattice of {steps}, at a place of its "
            "own. Neighbours lie one tolerance apart, so response types come from the rows themselves.\n\n"
        )
    return (
        f"## How it was made\n\n    {sweep_command(plan, str(folder))}\n\n"
        f"{lattice}Every point is run from rest and diagnosed in stages of 100, 200, ... cycles, {plan.budget} at the "
        "most; one that is undetermined may take eight times as many. The other parameters are those of the base "
        "machine in the file's metadata.\n\n"
        "| field | range | unit | varied |\n|---|---|---|---|\n" + "\n".join(ranges)
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
    if "without_all_neighbours" in faults:
        lines.append(
            f"- {faults['without_all_neighbours']:,} rows at borders of the lattice lack some neighbours "
            "(`type_neighbours`), so their type may be too low."
        )
    if types:
        pairs = ", ".join(f"{pair} {count}" for pair, count in types["pairs"].items() if len(set(_words(pair))) > 1)
        lines.append(
            f"- Types from neighbours in speed and clearance against types over all tolerances "
            f"({', '.join(default_tolerances(plan.machine))}; three initial states): {types['disagreement']:.1%} of "
            f"{types['points']:,} points disagree ({pairs or 'none'})."
        )
    return "## How far to trust the labels\n\n" + "\n".join(lines)


def _words(pair: str) -> list[str]:
    return [word for word in pair.split(" against ") if word in TYPES]


def read_noise(folder: str | Path) -> dict[str, Any] | None:
    """What ``chaosgym dataset noise`` found for a folder; None if it did not run.

    Raises
    ------
    DatasetError
        If its file is damaged.
    """
    file = Path(folder) / NOISE_FILE
    if not file.is_file():
        return None
    try:
        found: dict[str, Any] = json.loads(file.read_text())
    except (OSError, ValueError) as error:
        raise _damaged_noise(folder, error) from error
    return found


def _damaged_noise(folder: str | Path, error: Exception) -> DatasetError:
    file = Path(folder) / NOISE_FILE
    return DatasetError(f"{file} is damaged: {error!r}; run `chaosgym dataset noise {folder}` again")


def _noise(folder: Path) -> str:
    noise = read_noise(folder)
    if noise is None:
        return ""
    try:
        rows = [
            f"| {name} | {change['nature']:.1%} ± {change['half_interval']:.1%} | {change['largest_peak']:.1%} |"
            for name, change in noise["changes"].items()
        ]
        options = f"--points {noise['points']} --seed {noise['seed']}"
    except (KeyError, TypeError, AttributeError, ValueError) as error:
        raise _damaged_noise(folder, error) from error
    return (
        f"## Label noise\n\n`chaosgym dataset noise {folder} {options}`. No model can agree with the labels better "
        "than they agree with themselves; what another initial state changes are coexisting attractors.\n\n"
        "| change | nature differs | still periodic, largest peak more than 10 % away |\n|---|---|---|\n"
        + "\n".join(rows)
    )


def _split(sweep: LabelledSweep, plan: SweepPlan) -> str:
    if plan.sampling != "lattice":
        return ""
    gap, near = nearest_machines(sweep, plan)
    fields = ", ".join(axis.field for axis in plan.axes)
    return (
        "## Split\n\n`split` divides whole machines, drawn by the seed. Every test machine differs from every machine "
        f"of the other parts by {gap:.2g} tolerances or more in one of {fields} at least "
        f"(median of the nearest {near:.2g})."
    )


def nearest_machines(sweep: LabelledSweep, plan: SweepPlan) -> tuple[float, float]:
    """Distance of test machines from the nearest of another part, largest difference in tolerances: (least, median)."""
    rows = np.arange(0, len(plan), len(plan) // plan.size)
    test = sweep.column("split")[rows] == "test"
    allowed = default_tolerances(plan.machine)
    units: list[NDArray[np.float64]] = []
    for axis in plan.axes:
        values = sweep.column(axis.field)[rows]
        if axis.field in allowed and allowed[axis.field].relative:
            units.append(np.log(values) / np.log1p(allowed[axis.field].value))
        else:
            units.append(values / (allowed[axis.field].value if axis.field in allowed else 0.1 * np.ptp(values)))
    places = np.column_stack(units)
    if not test.any() or test.all():
        return np.inf, np.inf
    apart = np.abs(places[test][:, None] - places[~test][None]).max(axis=2).min(axis=1)
    return float(apart.min()), float(np.median(apart))


def _provenance(info: Mapping[str, Any]) -> str:
    lines = [", ".join(f"{name} {value}" for name, value in made.items()) for made in info["provenance"]]
    return "## Provenance\n\n" + "\n".join(f"- {line}" for line in lines)
