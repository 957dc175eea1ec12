"""The datasets of the repository: their plans, their samples, and the whole made anew.

Git keeps a sample of each. It is a sweep of its own: the first crosses of the whole, since machines and split depend
on seed and number alone. Settings and drawn numbers of a whole are compared with its sample exactly. Labels are equal
to the last bit on the same platform only; elsewhere natures are compared (``agreement``).
"""

import hashlib
import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa

from benchmarks.sweeps.agreement import Agreement, agreement
from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically
from chaosgym.machines import MACHINES
from chaosgym.series.verdict import Definition
from chaosgym.sweeps.axes import Axis
from chaosgym.sweeps.dataset import DATA_FILE, LabelledSweep, parquet_writer, read_sweep, schema, signal_columns
from chaosgym.sweeps.plan import SweepPlan
from chaosgym.sweeps.run import run_sweep


class Recipe(NamedTuple):
    """Options of a dataset: crosses, seed of their draw, cycles by point at the most, axes, definition of labels."""

    crosses: int
    seed: int
    budget: int
    axes: tuple[str, ...]
    definition: Definition = "settled"


def _recipes() -> dict[str, Recipe]:
    text = (Path(__file__).parents[2] / "datasets" / "datasets.toml").read_text(encoding="utf-8")
    return {
        name: Recipe(**{**options, "axes": tuple(options["axes"])}) for name, options in tomllib.loads(text).items()
    }


RECIPES: Mapping[str, Recipe] = _recipes()
"""By name of the machine."""

SAMPLE_CROSSES = 1000
"""Crosses of a sample, all of a smaller dataset."""

SAMPLE_SIGNALS = 0.5
"""Share of a sample's points whose signals are kept, so that no sample exceeds 2 MB; all of the whole's are."""

WHOLE, SAMPLE = "whole", "sample"
"""Folders in ``datasets/MACHINE``; Git ignores the first."""


def dataset_plan(machine: str, crosses: int | None = None) -> SweepPlan:
    """Return the plan of a machine's dataset, or of its first crosses.

    Raises
    ------
    DatasetError
        If the machine has no dataset.
    """
    if machine not in RECIPES:
        raise DatasetError(f"machine {machine!r} has no dataset; known: {', '.join(RECIPES)}")
    recipe = RECIPES[machine]
    axes = tuple(Axis.parse(text) for text in recipe.axes)
    kind: Any = MACHINES[machine]
    size, definition = crosses or recipe.crosses, recipe.definition
    return SweepPlan(kind(), axes, "crosses", size, recipe.seed, recipe.budget, signals=1.0, definition=definition)


def sample_of(whole: LabelledSweep) -> LabelledSweep:
    """Return the first crosses of a dataset, as the sweep that their plan makes; ``settings["whole"]`` names the whole.

    Raises
    ------
    DatasetError
        If the sweep is not one of crosses that keeps all signals.
    """
    plan = whole.plan
    if plan.sampling != "crosses" or plan.signals < 1.0:
        raise DatasetError(
            "a sample is taken of crosses with the signals of all points: --sampling crosses:N --label signals=1"
        )
    part = replace(plan, size=min(plan.size, SAMPLE_CROSSES), signals=SAMPLE_SIGNALS)
    table = whole.table.slice(0, len(part))
    left_out = pa.array(~part.with_signals(range(len(part))))
    for name in signal_columns():
        place = table.schema.get_field_index(name)
        kept = table.column(name).to_pylist()
        values = [None if out else value for value, out in zip(kept, left_out.to_pylist(), strict=True)]
        table = table.set_column(place, table.schema.field(place), pa.array(values, table.schema.field(place).type))
    settings = {
        **part.settings(),
        "version": whole.settings["version"],
        "whole": {"size": plan.size, "signals": plan.signals, "drawn": drawn_digest(plan)},
    }
    described = schema(part, settings)
    fields = [field.with_metadata(described.field(field.name).metadata) for field in table.schema]
    metadata = {**described.metadata, b"provenance": table.schema.metadata[b"provenance"]}
    return LabelledSweep(table.cast(pa.schema(fields, metadata)), settings)


def write_sample(whole: LabelledSweep, folder: str | Path) -> Path:
    """Write the sample of a dataset into a folder; return its file."""
    table = sample_of(whole).table
    path = Path(folder) / DATA_FILE
    path.parent.mkdir(parents=True, exist_ok=True)

    def write(temporary: Path) -> None:
        with parquet_writer(temporary, table.schema) as writer:
            writer.write_table(table)

    write_atomically(path, write)
    return path


def drawn_digest(plan: SweepPlan) -> str:
    """Digest of the numbers that a plan of crosses draws: places on the axes and split; equal on every processor."""
    drawn = np.ascontiguousarray(plan.drawn(), dtype="<f8").tobytes()
    return hashlib.sha256(drawn + " ".join(plan.splits(range(len(plan)))).encode()).hexdigest()[:16]


def settings_digest(plan: SweepPlan) -> str:
    """Digest of the settings of a plan: base machine, axes, seed, budget."""
    return hashlib.sha256(json.dumps(plan.settings(), sort_keys=True).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Built:
    """A dataset that was made, or its first crosses.

    Attributes
    ----------
    sweep
        Its rows.
    settings, drawn
        Digests of the settings and of the drawn numbers of the whole dataset.
    agreement
        How far the rows agree with the sample; None without one.
    """

    sweep: LabelledSweep
    settings: str
    drawn: str
    agreement: Agreement | None


def build_dataset(
    machine: str, folder: str | Path, *, sample: str | Path | None = None, crosses: int | None = None, **how: Any
) -> Built:
    """Make a dataset, or its first crosses, and compare it with a sample; a stopped run goes on.

    Parameters
    ----------
    machine
        Name of the machine.
    folder
        New, empty, or holding a run of the same plan.
    sample
        Folder of the sample to compare with; none by default.
    crosses
        How many of the first; all by default.
    how
        ``workers``, ``scheduler``, ``repair`` and ``progress`` of ``run_sweep``.

    Raises
    ------
    DatasetError
        If this installation plans or draws other machines than the sample is of, before anything is computed; or as
        ``run_sweep`` does.
    """
    plan = dataset_plan(machine)
    kept = None if sample is None else read_sweep(sample)
    if kept is not None:
        _check_plan(plan, kept, sample)
    wanted = dataset_plan(machine, crosses)
    sweep = None if how.get("repair") else _finished(wanted, Path(folder))
    sweep = sweep or run_sweep(wanted, folder, **how)
    return Built(sweep, settings_digest(plan), drawn_digest(plan), None if kept is None else _compare(kept, sweep))


def _finished(plan: SweepPlan, folder: Path) -> LabelledSweep | None:
    """Read a dataset that is finished, though an older version did not write all columns of today."""
    if not (folder / DATA_FILE).is_file():
        return None
    sweep = read_sweep(folder)
    return sweep if sweep.plan == plan else None


def _check_plan(plan: SweepPlan, sample: LabelledSweep, folder: str | Path | None) -> None:
    """Refuse to make another dataset than the one that a sample is of."""
    if "whole" not in sample.settings:
        raise DatasetError(f"{folder} is no sample of a dataset")
    of = sample.settings["whole"]
    wanted = json.loads(json.dumps(plan.settings()))
    held = {**sample.settings, "size": of["size"], "signals": of["signals"]}
    differing = sorted(name for name, value in wanted.items() if held.get(name) != value)
    if not differing and of["drawn"] != drawn_digest(plan):
        differing = ["the numbers that numpy draws"]
    if differing:
        raise DatasetError(
            f"{folder} is the sample of another dataset: it differs in {', '.join(differing)}; use the release of "
            "chaosgym that the sample is of, or --no-check for a dataset of its own"
        )


def _compare(sample: LabelledSweep, whole: LabelledSweep) -> Agreement:
    """Compare the rows that a sample and a dataset share."""
    again = sample_of(whole).table
    rows = min(len(again), len(sample.table))
    return agreement(sample.table.slice(0, rows), again.slice(0, rows), sample.provenance, whole.provenance)
