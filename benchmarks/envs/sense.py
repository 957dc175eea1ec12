"""How well do readings tell irregular motion, by what judges them, cycles looked and error of the sensors?

The label is the one that is paid: whether most cycles of the last step are irregular to the judge of the environment.
Machines of the fleet hold one speed after another for sixty cycles, with ripple, kicks and wear. A step has ten cycles
on the beam, twenty on the crank. Trees are fitted to machines of the training split, and those of the test are scored.
The area under the curve (AUC) is the chance that an irregular record gets more than a calm one.

    felt            how far peaks repeat in the last step, ``chaosgym.envs.memory.irregularity``
    felt, all       the same over all cycles looked
    records         the shipped classifier of records
    observation     boosted trees on what an observation holds of the last step, and on the speed
    sequence        the same on statistics of peaks of both surfaces, impacts and bouncing of all cycles, and the speed
    shipped         what answers to ``classifier="on"``: the shipped sense, on peaks of one surface, impacts, bouncing
                    and speed; where none is shipped, the classifier of records
"""

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from chaosgym.classifier.shipped import default_classifier
from chaosgym.envs.classified import RecordsAtSpeed
from chaosgym.envs.kernels.steps import PLACE, REPEATS
from chaosgym.envs.memory import irregularity
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ParameterError
from chaosgym.files import write_atomically

Array = NDArray[Any]

ENV = "chaosgym/ImpactBeamTolerance-v1"

FITTED_SEED, SCORED_SEED = 3, 2
"""Of machines and speeds."""

LOOKED = 60
"""Cycles at each speed."""

ERRORS = 1.0, 0.0
"""Half widths of the error of a peak [N]; 0 for ideal sensors, of impacts and bouncing too."""

SENSES = ("felt", "felt, all", "records", "observation", "sequence", "shipped")

DRAWS = 200
"""Of the machines, for the interval."""


class Held(NamedTuple):
    """Records of n machines at h speeds: ``peaks`` (n, h, 60, 2) [N], ``impacts`` (n, h, 60) of both sides,
    ``bouncing`` (n, h, 60) from 0 to 1, ``share`` (n, h, steps) of irregular cycles in each step, ``speed`` (n, h)."""

    peaks: Array
    impacts: Array
    bouncing: Array
    share: Array
    speed: Array

    @property
    def step(self) -> int:
        """Cycles of a step."""
        return LOOKED // int(self.share.shape[2])


def looks(step: int) -> tuple[int, int, int]:
    """Cycles looked: whole steps."""
    return step, -(-LOOKED // 2 // step) * step, LOOKED


def held(machines: int, speeds: int, seed: int, split: str = "train", env: str = ENV) -> Held:
    """Simulate machines of a split that hold one speed after another, at most the slew limit apart."""
    envs = native_envs(env, 1, level="fleet", split=split)
    task, variants, generator = envs.task, envs.settings.variants, np.random.default_rng(seed)
    batch: Any = variants.batch(machines)
    kind: Any = type(envs.jobs.judge)
    every, judge = np.arange(machines), kind(machines)
    speed = generator.choice(task.grid, machines)
    for i in range(machines):
        machine = variants.drawn(generator)
        worn = getattr(machine, machine.clearance_field) * (1.0 + task.wear * generator.random())
        batch.start(i, machine.at(float(speed[i]), worn))
    furthest = round(task.slew_limit / task.trim_step)
    parts: list[tuple[Array, ...]] = []
    for place in trange(-1, speeds, desc="speeds", unit="speed", leave=False):
        if place >= 0:
            move = task.trim_step * generator.integers(1, furthest + 1, machines) * generator.choice([-1, 1], machines)
            there = speed + move
            speed = np.where((there < task.grid[0]) | (there > task.grid[-1]), speed - move, there)
        if task.kick > 0.0:  # of machines that have no ripple
            batch.set_speeds(every, speed)
            kicks = task.kick * generator.standard_normal((machines, LOOKED, variants.nominal.n_velocities))
            cycles, growth = batch.run_kicked(every, kicks), np.zeros((machines, LOOKED))
        else:
            rippled = speed[:, None] * (1.0 + task.speed_ripple * generator.standard_normal((machines, LOOKED)))
            cycles, growth = batch.run_varied(every, rippled)
        peaks = variants.nominal.sensed(cycles.peak_force)
        steps = [slice(k, k + task.cycles_per_step) for k in range(0, LOOKED, task.cycles_per_step)]
        shares = [judge.verdict(every, growth[:, step], peaks[:, step])[0] for step in steps]
        bouncing = cycles.bounce_duration.sum(axis=2) / variants.nominal.period_at(speed)[:, None]
        if place >= 0:
            parts.append((cycles.peak_force, cycles.impacts.sum(axis=2), bouncing, np.stack(shares, 1), speed))
    return Held(*(np.stack(values, axis=1) for values in zip(*parts, strict=True)))


def measured(true: Held, error: float, seed: int, env: str = ENV) -> Held:
    """The records with the errors of the task's sensors, those of the peaks of half width ``error``; 0 for none."""
    if error == 0.0:
        return true
    task, generator = native_envs(env, 1).task, np.random.default_rng(seed)
    peaks = np.maximum(true.peaks + generator.uniform(-error, error, true.peaks.shape), 0.0)
    counted = generator.binomial(true.impacts, 1.0 - task.missed_impacts)
    off = generator.uniform(-task.bouncing_error, task.bouncing_error, true.share.shape)
    return true._replace(peaks=peaks, impacts=counted, bouncing=true.bouncing + off.repeat(true.step, axis=2))


def observed(peaks: Array) -> Array:
    """What an observation holds of peaks (n, cycles) of one side, in its places: (n, entries)."""
    values = np.zeros((len(peaks), len(PLACE)))
    values[:, PLACE.mean_peak_force], values[:, PLACE.std_peak_force] = peaks.mean(axis=1), peaks.std(axis=1)
    values[:, PLACE.max_peak_force] = peaks.max(axis=1)
    for column, lag in REPEATS:
        values[:, column] = _missed(peaks, lag)
    return values


def _missed(values: Array, lag: int) -> Array:
    return np.asarray(np.abs(values[:, lag:] - values[:, :-lag]).mean(axis=1))


def observation(record: Held, looked: int) -> Array:
    """The last step of the cycles looked, as an observation tells it, and the speed: (n h, entries)."""
    last = slice(looked - record.step, looked)
    values = observed(_flat(record.peaks)[:, last, 0])
    values[:, PLACE.speed] = record.speed.ravel()
    values[:, PLACE.impacts_per_cycle] = _flat(record.impacts)[:, last].mean(axis=1)
    values[:, PLACE.bouncing_share] = _flat(record.bouncing)[:, last].mean(axis=1)
    return values


def statistics(record: Held, looked: int) -> Array:
    """Statistics of all cycles looked, and of the last step: (n h, columns)."""
    peaks, columns = _flat(record.peaks)[:, :looked], [record.speed.ravel()]
    for side in (0, 1):
        for part in (peaks[:, :, side], peaks[:, -record.step :, side]):
            columns += [part.mean(axis=1), part.std(axis=1), part.min(axis=1), part.max(axis=1)]
            columns += [_missed(part, lag) for lag in (1, 2, 3, 4, 6, 8)]
        columns += [irregularity(observed(peaks[:, :, side]))]
    centred = peaks - peaks.mean(axis=1, keepdims=True)
    columns += [(centred[:, :, 0] * centred[:, :, 1]).mean(axis=1), (peaks[:, :, 0] - peaks[:, :, 1]).mean(axis=1)]
    for values in (_flat(record.impacts)[:, :looked], _flat(record.bouncing)[:, :looked]):
        columns += [values.mean(axis=1), values.std(axis=1), _missed(values, 1), _missed(values, 2)]
    return np.stack(columns, axis=1)


def _flat(values: Array) -> Array:
    return values.reshape(-1, *values.shape[2:])


def scores(sense: str, error: float, fitted: Held, scored: Held, env: str = ENV) -> dict[int, Array]:
    """What a sense makes of the scored records (n h,), the more the more irregular, by cycles looked."""
    if sense == "shipped":
        return shipped(error, scored, env)
    peaks = _flat(scored.peaks)[:, :, 0]
    found = {}
    for looked in looks(scored.step):
        if sense.startswith("felt"):
            first = 0 if sense == "felt, all" else looked - scored.step
            found[looked] = irregularity(observed(peaks[:, first:looked]))
        elif sense == "records":
            classifier = default_classifier(native_envs(env, 1).nominal.name)
            found[looked] = classifier.irregular_probability(peaks[:, :looked], max(error, 1e-6))
        else:
            features = observation if sense == "observation" else statistics
            trees = boosted().fit(features(fitted, looked), labels_of(fitted, looked))
            found[looked] = trees.decision_function(features(scored, looked))
    return found


def shipped(error: float, scored: Held, env: str = ENV) -> dict[int, Array]:
    """What ``classifier="on"`` makes of the scored records (n h,), by cycles looked."""
    peaks, impacts, bouncing = _flat(scored.peaks)[:, :, 0], _flat(scored.impacts), _flat(scored.bouncing)
    every = np.arange(len(peaks))
    records = RecordsAtSpeed(native_envs(env, 1).nominal, error, len(peaks))
    found = {}
    for first in range(0, LOOKED, scored.step):
        cycles = slice(first, first + scored.step)
        means = (values[:, cycles].mean(axis=1) for values in (impacts, bouncing))
        records.add(every, scored.speed.ravel(), peaks[:, cycles], *means)
        found[first + scored.step] = records.irregular_probability(every)
    return found


def labels_of(record: Held, looked: int) -> Array:
    """Whether most cycles of the last step of those looked are irregular, (n h,)."""
    return np.asarray(record.share[:, :, looked // record.step - 1].ravel() > 0.5)


def boosted() -> Any:
    """Boosted trees, not fitted yet."""
    from sklearn.ensemble import HistGradientBoostingClassifier

    return HistGradientBoostingClassifier(
        max_iter=150, learning_rate=0.06, max_leaf_nodes=15, l2_regularization=1.0, early_stopping=False
    )


def area(labels: Array, score: Array, machines: int) -> dict[str, float]:
    """AUC, and its interval of 95 % over machines, of labels and scores (machines times speeds,)."""
    from sklearn.metrics import roc_auc_score

    by_machine, generator = np.arange(len(labels)).reshape(machines, -1), np.random.default_rng(0)
    drawn = [by_machine[generator.integers(0, machines, machines)].ravel() for _ in range(DRAWS)]
    areas = [roc_auc_score(labels[rows], score[rows]) for rows in drawn]
    low, high = np.percentile(areas, [2.5, 97.5])
    return {"auc": float(roc_auc_score(labels, score)), "low": float(low), "high": float(high)}


def sense(
    machines: int, others: int, speeds: int, senses: Iterable[str], kept: Path, env: str = ENV
) -> list[dict[str, Any]]:
    """Areas under the curve of each sense, by error and cycles looked; rows in the file ``kept`` are not made anew.

    Raises
    ------
    ParameterError
        If the file holds rows of other numbers of machines or speeds, or of another environment.
    """
    about: dict[str, Any] = {"machines": machines, "others": others, "speeds": speeds}
    about |= {} if env == ENV else {"env": env}
    told: dict[str, Any] = json.loads(kept.read_text(encoding="utf-8")) if kept.exists() else {"of": about, "rows": []}
    if told["of"] != about:
        raise ParameterError(f"{kept} is of {told['of']}; give these numbers, or another file")
    rows: list[dict[str, Any]] = told["rows"]
    done = {(row["sense"], row["error"]) for row in rows}
    missing = [(name, error) for name in senses for error in ERRORS if (name, error) not in done]
    if missing:
        true = (
            held(machines, speeds, FITTED_SEED, env=env),
            held(others, speeds, SCORED_SEED, "test", env),
        )
    for name, error in missing:
        fitted, scored = (measured(record, error, seed, env) for seed, record in enumerate(true))
        found = scores(name, error, fitted, scored, env)
        chosen = looks(scored.step)
        areas = {str(looked): area(labels_of(scored, looked), found[looked], others) for looked in chosen}
        rows.append({"sense": name, "error": error, "areas": areas})
        write_atomically(kept, lambda path: path.write_text(json.dumps(told, indent=1) + "\n", encoding="utf-8"))
    return [row for row in rows if row["sense"] in senses]


def lines(found: Iterable[Mapping[str, Any]]) -> list[str]:
    """A Markdown table."""
    rows = sorted(found, key=lambda row: (SENSES.index(row["sense"]), -row["error"]))
    cycles = list(rows[0]["areas"])
    told = [
        f"| sense | error | {' | '.join(f'{looked} cycles' for looked in cycles)} |",
        "|---" * (2 + len(cycles)) + "|",
    ]
    for row in rows:
        areas = [row["areas"][looked] for looked in cycles]
        cells = [f"{one['auc']:.3f} ({one['low']:.3f} to {one['high']:.3f})" for one in areas]
        told.append(f"| {row['sense']} | {row['error']:g} N | {' | '.join(cells)} |")
    return told
