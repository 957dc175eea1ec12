"""Microseconds against accuracy: parameters alone, each number of cycles, the cascade, the full diagnosis.

On fresh machines: drawn at random over the classifier's ranges, uniform as in its dataset, each with its
four neighbours. The label is that of the diagnosis with the dataset's budget. Times are processor times, without the
reduction of the machine to its modes, which is kept from question to question.
"""

from collections.abc import Sequence
from time import thread_time
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.classifier import MachineClassifier, NatureAnswer
from chaosgym.classifier.calibration import calibration_error
from chaosgym.classifier.cascade import STAGES, judge_nature
from chaosgym.classifier.features import response_features
from chaosgym.diagnosis.type_rule import CROSS, type_of_cross
from chaosgym.machines import Machine
from chaosgym.simulation import simulate
from chaosgym.sweeps import Axis, SweepPlan
from chaosgym.sweeps.label import label_point
from chaosgym.sweeps.plan import UNSTATED

MILLION = 1e6


class Fresh(NamedTuple):
    """Machines whose answers are known: natures, largest peaks [N] and seconds of the diagnosis (n,)."""

    machines: Sequence[Machine]
    natures: NDArray[np.str_]
    peaks: NDArray[np.float64]
    seconds: NDArray[np.float64]


def fresh_machines(classifier: MachineClassifier, crosses: int, seed: int, *, progress: bool = False) -> Fresh:
    """Crosses over the classifier's ranges, diagnosed."""
    data = classifier.card["data"]
    axes = tuple(Axis(**{**axis, "count": None}) for axis in data["axes"])
    plan = SweepPlan(classifier.machine, axes, "crosses", crosses, seed, data["budget"])
    columns = plan.points()
    machines = [
        plan.machine_at({name: float(column[row]) for name, column in columns.items()}) for row in range(len(plan))
    ]
    definition = data.get("definition", UNSTATED)
    label_point(machines[0], plan.budget)
    labels, seconds = [], []
    for machine in tqdm(machines, desc="diagnose", unit="machine", disable=not progress):
        machine.reduce()
        began = thread_time()
        labels.append(label_point(machine, plan.budget, definition=definition))
        seconds.append(thread_time() - began)
    natures = np.array([str(label.get("nature")) for label in labels])
    peaks = np.array([float(label.get("largest_peak", np.nan)) for label in labels])
    return Fresh(machines, natures, peaks, np.array(seconds))


def pareto(classifier: MachineClassifier, crosses: int, *, seed: int = 1000, progress: bool = False) -> dict[str, Any]:
    """Cost and accuracy of every way to an answer.

    Returns
    -------
    dict
        ``rows``: by way ``microseconds`` (mean), ``nature`` (accuracy on all points that are periodic or chaotic),
        ``standard_error``, ``ece``, ``proven`` and ``wrong_proofs`` where it proves; ``types``: accuracy, balanced
        accuracy, ECE, microseconds and proven share on the centres; ``coverage`` of the sets of plausible natures.
    """
    fresh = fresh_machines(classifier, crosses, seed, progress=progress)
    known = np.isin(fresh.natures, ("periodic", "chaotic"))
    rows: dict[str, Any] = {"parameters": _stage(classifier, 0, fresh, known)}
    rows |= {f"{cycles} cycles": _stage(classifier, cycles, fresh, known) for cycles in STAGES}
    ways: dict[str, dict[str, Any]] = {
        "cascade without proofs": {"prove": False},
        "cascade": {},
        **{f"cascade, {budget} us": {"budget_us": float(budget)} for budget in (500, 1000, 2000, 4000, 8000)},
    }
    for name, how in ways.items():
        answers = [_ask(classifier, machine, **how) for machine in tqdm(fresh.machines, name, disable=not progress)]
        rows[name] = _scores(answers, fresh, known)
    rows["full diagnosis"] = {"microseconds": MILLION * float(fresh.seconds.mean()), "nature": 1.0}
    return {
        "machine": classifier.machine.name,
        "points": int(known.sum()),
        "share_periodic": float(np.mean(fresh.natures[known] == "periodic")),
        "rows": rows,
        "types": _types(classifier, fresh, progress),
    }


def _stage(classifier: MachineClassifier, cycles: int, fresh: Fresh, known: NDArray[np.bool_]) -> dict[str, Any]:
    """One stage by itself, its simulation included."""
    model = classifier.stages[cycles]
    chances, seconds = [], []
    for machine in fresh.machines:
        values = np.array([[getattr(machine, name) for name in classifier.fields]], dtype=float)
        machine.reduce()
        began = thread_time()
        peaks = section = None
        if cycles:
            record = simulate(machine, cycles)
            peaks = record.peak_force[None, :, 0]
            section = np.column_stack([record.displacement, record.velocity])[None]
        chances.append(model.chances(response_features(model.scaling_, values, peaks, section))[0])
        seconds.append(thread_time() - began)
    told = np.array(chances)[known]
    truth = fresh.natures[known]
    right = model.classes_[told.argmax(axis=1)] == truth
    coverage = {
        str(kind): float(np.mean(told[truth == kind, place] >= model.plausible_[place]))
        for place, kind in enumerate(model.classes_)
    }
    return {
        **_accuracy(right, told.max(axis=1)),
        "microseconds": MILLION * float(np.mean(seconds)),
        "coverage": coverage,
    }


def _accuracy(right: NDArray[np.bool_], confidence: NDArray[np.float64]) -> dict[str, float]:
    share = float(right.mean())
    return {
        "nature": share,
        "standard_error": float(np.sqrt(share * (1.0 - share) / len(right) * len(CROSS))),
        "ece": calibration_error(confidence, right),
    }


def _ask(classifier: MachineClassifier, machine: Machine, **how: Any) -> NatureAnswer:
    values = np.array([[getattr(machine, name) for name in classifier.fields]], dtype=float)
    machine.reduce()
    return judge_nature(classifier.stages, machine, values, **how)


def _scores(answers: Sequence[NatureAnswer], fresh: Fresh, known: NDArray[np.bool_]) -> dict[str, Any]:
    likely = np.array([max(answer.probabilities, key=answer.probabilities.__getitem__) for answer in answers])
    proven = np.array([answer.proven for answer in answers])
    confidence = np.array([answer.probability for answer in answers])
    return {
        **_accuracy(likely[known] == fresh.natures[known], confidence[known]),
        "microseconds": float(np.mean([answer.microseconds for answer in answers])),
        "cycles": float(np.mean([answer.cycles for answer in answers])),
        "abstained": float(np.mean([answer.nature is None for answer in answers])),
        "proven": float(proven[known].mean()),
        "proven_of_periodic": float(proven[known][fresh.natures[known] == "periodic"].mean()),
        "wrong_proofs": int(np.sum(proven & known & (fresh.natures != "periodic"))),
    }


def _types(classifier: MachineClassifier, fresh: Fresh, progress: bool) -> dict[str, Any]:
    """Types of the centres by the cascade, against the printed rule on the diagnosed cross."""
    natures, peaks = fresh.natures.reshape(-1, len(CROSS)), fresh.peaks.reshape(-1, len(CROSS))
    truth = np.array([type_of_cross(*cross)[0] for cross in zip(natures, peaks, strict=True)])
    found: dict[str, Any] = {}
    ways: dict[str, dict[str, Any]] = {"cascade without proofs": {"prove": False}, "cascade": {}}
    for name, how in ways.items():
        centres = tqdm(fresh.machines[:: len(CROSS)], f"types, {name}", disable=not progress)
        answers = [classifier.classify(machine, **how) for machine in centres]
        chances = [answer.type_probabilities for answer in answers]
        likely = np.array([max(told, key=told.__getitem__, default="none") for told in chances])
        confidence = np.array([max(told.values(), default=0.0) for told in chances])
        asked = np.isin(truth, ("I", "II", "III"))
        right = (likely == truth)[asked]
        found[name] = {
            "accuracy": float(right.mean()),
            "standard_error": float(np.sqrt(right.mean() * (1.0 - right.mean()) / len(right))),
            "balanced_accuracy": float(
                np.mean([np.mean(likely[truth == kind] == kind) for kind in np.unique(truth[asked])])
            ),
            "ece": calibration_error(confidence[asked], right),
            "proven": float(np.mean([answer.type_proven for answer in answers])),
            "abstained": float(np.mean([answer.response_type is None for answer in answers])),
            "microseconds": float(np.mean([answer.microseconds for answer in answers])),
            "centres": int(asked.sum()),
        }
    return found


def pareto_table(found: dict[str, Any]) -> list[str]:
    """Markdown lines of ``pareto``."""
    share = found["share_periodic"]
    lines = [
        f"{found['machine']}: {found['points']} points of fresh machines, {share:.1%} of them periodic",
        "",
        "| way to the nature | us | accuracy | ECE | proven | of periodic | proven and wrong |",
        "|---|---|---|---|---|---|---|",
    ]
    for name, row in found["rows"].items():
        told = f"{row['nature']:.3f} ± {row['standard_error']:.3f}" if "standard_error" in row else "1 by definition"
        error = f"{row['ece']:.3f}" if "ece" in row else ""
        proof = (
            f"{row['proven']:.1%} | {row['proven_of_periodic']:.1%} | {row['wrong_proofs']}"
            if "proven" in row
            else " | | "
        )
        lines.append(f"| {name} | {row['microseconds']:,.0f} | {told} | {error} | {proof} |")
    lines += ["", "| type by | us | accuracy | balanced | ECE | proven |", "|---|---|---|---|---|---|"]
    for name, row in found["types"].items():
        lines.append(
            f"| {name} | {row['microseconds']:,.0f} | {row['accuracy']:.3f} ± {row['standard_error']:.3f} | "
            f"{row['balanced_accuracy']:.3f} | {row['ece']:.3f} | {row['proven']:.1%} |"
        )
    return lines
