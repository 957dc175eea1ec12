"""Training of a machine's classifier on a labelled sweep, and its scores on machines that no training has seen.

Records for training are runs as a sensor shows them, of any length, from the start or settled. Each copy of a run takes
a window of 8 to 64 cycles and one sensor. The error that it is told is even or normal (three deviations), 0.02 to 10 N
or 0.1 to 10 % of the record's mean; in one copy of six nothing is told. Its real error is none in one copy of five,
anything up to the told one in two, the told one in one, and up to one and a half times as large in one: sensors are
mostly better than they promise. A tenth of the records are rounded, to 0.1 or 0.01 N. A record is irregular beyond the
sensor's error if the ``irregularity`` of the settled run, without any noise, exceeds the told error.
"""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.arrays import Array
from chaosgym.classifier.cascade import STAGES
from chaosgym.classifier.data import Examples, examples_of
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.evaluation import score_records, score_stages
from chaosgym.classifier.features import MAX_CYCLES, MIN_CYCLES
from chaosgym.classifier.machine_classifier import IRREGULAR, NATURE, MachineClassifier
from chaosgym.errors import DatasetError
from chaosgym.machines.parameters import parameters_of
from chaosgym.series.stroboscopic import irregularity
from chaosgym.sweeps import LabelledSweep
from chaosgym.version import __version__

TOLD, RELATIVE = (-1.7, 1.0), (-3.0, -1.0)
"""Decades of the told errors [N], and of those that are shares of the mean peak."""

WORSE = 1.5
"""Largest real error over the told one."""

NORMAL_DEVIATIONS = 3.0
"""Standard deviations that count as the largest error of normal noise."""


class Records(NamedTuple):
    """Records as a sensor gives them.

    ``peaks`` (n, cycles) [N], NaN after the end; ``sensor_error`` (n,) [N], NaN where not told; ``rows`` (n,) which run
    each record is of.
    """

    peaks: Array
    sensor_error: Array
    rows: NDArray[np.int64]


def training_records(start: Array, settled: Array, copies: int, seed: int) -> Records:
    """Noisy copies of runs, whose peaks [N] of two windows are given (n, cycles)."""
    generator = np.random.default_rng(seed)
    parts = [_copy(window, generator) for _ in range(copies) for window in (settled, start)]
    return Records(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def _copy(peaks: Array, generator: np.random.Generator) -> Records:
    count, cycles = peaks.shape
    lengths = np.exp(generator.uniform(np.log(MIN_CYCLES), np.log(cycles + 1.0), count)).astype(int)
    starts = (generator.random(count) * (cycles - lengths + 1)).astype(int) * (generator.random(count) < 0.5)
    columns = np.minimum(starts[:, None] + np.arange(cycles), cycles - 1)
    ended = np.arange(cycles) >= lengths[:, None]
    forces = np.take_along_axis(peaks, columns, axis=1)
    level = np.where(ended, 0.0, forces).sum(axis=1) / lengths
    relative = generator.random(count) < 1.0 / 3.0
    absolute, shares = (10.0 ** generator.uniform(*decades, count) for decades in (TOLD, RELATIVE))
    told = np.asarray(np.where(relative, level * shares, absolute))
    forces = noisy(forces, told * _quality(count, generator), generator)
    step = generator.choice([0.0, 0.1, 0.01], count, p=[0.9, 0.05, 0.05])[:, None]
    forces = np.where(step > 0.0, np.round(forces / np.where(step > 0.0, step, 1.0)) * step, forces)
    forces[ended] = np.nan
    silent = generator.random(count) < 1.0 / 6.0
    return Records(forces, np.where(silent, np.nan, told), np.arange(count))


def _quality(count: int, generator: np.random.Generator) -> Array:
    """Real error over the told one, (count,)."""
    kind, share = generator.integers(0, 5, count), generator.random(count)
    return np.select(
        [kind == 0, kind <= 2, kind == 3], [0.0 * share, share, 1.0 + 0.0 * share], 1.0 + (WORSE - 1.0) * share
    )


def noisy(forces: Array, error: Array, generator: np.random.Generator) -> Array:
    """Peaks (n, cycles) with errors of at most ``error`` (n,): even in half of the rows, normal in the others."""
    normal = generator.random(len(forces)) < 0.5
    even = generator.uniform(-1.0, 1.0, forces.shape)
    bell = generator.standard_normal(forces.shape) / NORMAL_DEVIATIONS
    return np.asarray(np.maximum(forces + error[:, None] * np.where(normal[:, None], bell, even), 0.0))


RECORDS, COPIES = 60_000, 6
"""Noisy training records made of the signals, about, and copies of a run's window at most."""

LARGE = 20_000
"""Rows from which on trees are larger and more."""

LEAST_SIGNALS = 50
"""Rows with signals that the stages with cycles and the records need."""


@dataclass(frozen=True)
class TrainingResult:
    """Trained classifier, and the report on held-out rows."""

    classifier: MachineClassifier
    report: dict[str, Any]

    def save(self, folder: str | Path) -> None:
        """Write ``classifier.npz``, ``report.json`` and ``CARD.md`` into a folder."""
        target = Path(folder)
        target.mkdir(parents=True, exist_ok=True)
        self.classifier.save(target / "classifier.npz")
        (target / "report.json").write_text(json.dumps(self.report, indent=1) + "\n", encoding="utf-8")
        (target / "CARD.md").write_text("\n".join(card_lines(self.classifier.card)) + "\n", encoding="utf-8")


def train_classifier(sweep: LabelledSweep, seed: int = 0, *, progress: bool = False) -> TrainingResult:
    """Train on a labelled sweep and judge on its held-out rows.

    Parameters
    ----------
    sweep
        Labelled points; with signals, the stages with cycles and the classifiers of records are learned too.
    seed
        Of split, noise and trees. Same seed, same file.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If there are too few rows or only one nature.
    """
    began = time.perf_counter()
    examples = examples_of(sweep, seed)
    with_cycles = int(examples.has_signals.sum()) >= LEAST_SIGNALS
    with tqdm(total=2 + 6 * with_cycles, desc="train classifier", unit="step", disable=not progress) as bar:
        stages = {cycles: _stage(examples, cycles, seed, bar.update) for cycles in (0, *STAGES[: 4 * with_cycles])}
        records = fit_records(examples, seed, bar.update) if with_cycles else {}
        report = _counts(examples) | {"stages": score_stages(stages, examples)}
        if records:
            report["records"] = score_records(records, examples, seed)
        bar.update()
    card = _card(sweep, examples, report, seed)
    classifier = MachineClassifier(examples.machine, stages, records, card)
    return TrainingResult(classifier, {**report, "training_seconds": round(time.perf_counter() - began, 1)})


def _trees(rows: int) -> dict[str, Any]:
    return {"rounds": 300, "leaves": 31, "least_rows": 40} if rows >= LARGE else {}


def _stage(examples: Examples, cycles: int, seed: int, tick: Callable[[], object]) -> ResponseClassifier:
    """Natures from parameters and the first cycles."""
    rows = ~examples.test & (examples.has_signals if cycles else True)
    model = ResponseClassifier("parameters", examples.machine, examples.fields, seed=seed, **_trees(int(rows.sum())))
    fitted = model.fit(
        examples.values[rows],
        examples.nature[rows],
        calibration=examples.calibration[rows],
        ranges=examples.ranges,
        cycles=examples.start[rows, :cycles] if cycles else None,
    )
    tick()
    return fitted


def fit_records(
    examples: Examples, seed: int, tick: Callable[[], object] = lambda: None
) -> dict[str, ResponseClassifier]:
    """Natures and resolvable irregularity from noisy records of the rows that train and calibrate."""
    chosen = np.flatnonzero(examples.has_signals & ~examples.test & (examples.settled.max(axis=1) > 0.0))
    copies = min(COPIES, max(1, round(RECORDS / (2 * len(chosen)))))
    noisy = training_records(examples.start[chosen, :, 0], examples.settled[chosen], copies, seed)
    rows = chosen[noisy.rows]
    labels = {
        NATURE: examples.nature[rows],
        IRREGULAR: irregularities(examples.settled[chosen])[noisy.rows] > noisy.sensor_error,
    }
    models = {}
    for name, label in labels.items():
        told = ~np.isnan(noisy.sensor_error) | (name == NATURE)
        if len(np.unique(label[told])) < 2:
            raise DatasetError("all signals are regular, or none is; sweep a wider range or more points")
        model = ResponseClassifier("records", seed=seed, **_trees(len(rows)))
        models[name] = model.fit(
            noisy.peaks[told],
            label[told],
            calibration=examples.calibration[rows[told]],
            sensor_error=noisy.sensor_error[told],
        )
        tick()
    return models


def irregularities(settled: NDArray[np.float64]) -> NDArray[np.float64]:
    """Amplitude [N] of the irregularity of clean settled peaks (n, cycles), see ``irregularity``."""
    return np.array([irregularity(peaks) for peaks in settled])


def _counts(examples: Examples) -> dict[str, Any]:
    training = ~(examples.calibration | examples.test)
    parts = {"training": training, "calibration": examples.calibration, "held_out": examples.test}
    return {
        "rows": {**{name: int(rows.sum()) for name, rows in parts.items()}, "left_out": examples.left_out},
        "machines": {name: len(np.unique(examples.groups[rows])) for name, rows in parts.items()},
        "share_of_natures": {str(name): float((examples.nature == name).mean()) for name in np.unique(examples.nature)},
    }


def _card(sweep: LabelledSweep, examples: Examples, report: dict[str, Any], seed: int) -> dict[str, Any]:
    kept = ("sampling", "size", "seed", "budget", "signals", "axes", "definition")
    return {
        "machine": examples.machine.name,
        "base": {name: getattr(examples.machine, name) for name in parameters_of(examples.machine)},
        "fields": list(examples.fields),
        "ranges": {
            name: [float(low), float(high)] for name, low, high in zip(examples.fields, *examples.ranges, strict=True)
        },
        "data": {key: sweep.settings[key] for key in kept if key in sweep.settings},
        "cycles": MAX_CYCLES,
        "seed": seed,
        "version": __version__,
        "command": f"chaosgym train-classifier --data FOLDER --out FOLDER --seed {seed}",
        "limits": (
            "knows machines that differ from the base in the named fields, within their ranges; the nature is that of "
            f"the diagnosis within its budget, from rest; {_died_out(sweep)}; chaos weaker than the sensor's error "
            "looks periodic to any sensor"
        ),
        "report": report,
    }


def _died_out(sweep: LabelledSweep) -> str:
    if sweep.definition == "settled":
        return "of chaos that dies out it is that of the motion that is left"
    return "transient chaos counts as chaotic although its settled record is periodic"


def card_lines(card: dict[str, Any] | Any) -> list[str]:
    """Lines of the model card in Markdown."""
    report = card["report"]
    ranges = [f"| `{name}` | {low:.6g} | {high:.6g} |" for name, (low, high) in card["ranges"].items()]
    lines = [f"# Classifier of the {card['machine']}", "", f"`{card['command']}`, version {card['version']}.", ""]
    lines += ["| field | from | to |", "|---|---|---|", *ranges, ""]
    return [*lines, *report_table(report), "", f"Limits: {card['limits']}."]


def report_table(report: dict[str, Any]) -> list[str]:
    """Lines of a report's table in Markdown: scores on held-out machines."""
    rows = report["rows"]
    lines = [
        f"{rows['training']} rows train, {rows['calibration']} calibrate, {rows['held_out']} of other machines judge.",
        "",
        "| nature from | accuracy | balanced | ECE | of the majority |",
        "|---|---|---|---|---|",
    ]
    for name, scores in report["stages"].items():
        lines.append(_score_line(name, scores))
    if "records" not in report:
        return lines
    lines += [
        "",
        "| settled | irregular: model | rule | away from the error | near it | ECE | nature: model | rule |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name, found in report["records"].items():
        irregular, nature = found["irregular"], found["nature"]
        lines.append(
            f"| {name} | {_interval(irregular['accuracy'])} | {found['irregular_rule']:.3f} | "
            f"{found['irregular_away']:.3f} | {found['near']:.1%} | {irregular['calibration_error']:.3f} | "
            f"{_interval(nature['accuracy'])} | {found['nature_rule']:.3f} |"
        )
    return lines


def _score_line(name: str, scores: dict[str, Any]) -> str:
    return (
        f"| {name} | {_interval(scores['accuracy'])} | {scores['balanced_accuracy'][0]:.3f} | "
        f"{scores['calibration_error']:.3f} | {scores['majority']:.3f} |"
    )


def _interval(estimate: Any) -> str:
    value, low, high = estimate
    return f"{value:.3f} [{low:.3f}, {high:.3f}]"
