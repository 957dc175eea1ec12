"""How do classifier and baselines fare on the held-out machines? From parameters, and from records in set scenes."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.classifier.baselines import catch22_guess, criteria_guess, model_guesses, rule_guesses
from benchmarks.classifier.corrupted_records import FAULTS
from chaosgym.classifier.data import Examples
from chaosgym.classifier.estimator import ResponseClassifier
from chaosgym.classifier.evaluation import bootstrap_scores, confusion_matrix, probability_scores
from chaosgym.classifier.features import record_features
from chaosgym.classifier.records import NORMAL_DEVIATIONS
from chaosgym.classifier.scorers import pair_scores

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Scene:
    """Records as they come: a window of the run, how many cycles, which noise, and which responses count.

    ``share``: deviation of normal noise relative to the record's mean peak; ``error`` [N]: even noise; ``clear_only``:
    responses away from boundaries.
    """

    name: str
    window: str
    cycles: int
    share: float = 0.0
    error: float = 0.0
    clear_only: bool = False
    target: float | None = None

    def records(self, peaks: Array, seed: int) -> tuple[Array, NDArray[np.float64]]:
        """Noisy records (n, cycles) and their sensor error (n,)."""
        generator = np.random.default_rng(seed)
        forces = peaks[:, : self.cycles]
        level = forces.mean(axis=1)
        noisy = forces + self.share * level[:, None] * generator.standard_normal(forces.shape)
        noisy = noisy + self.error * generator.uniform(-1.0, 1.0, forces.shape)
        return np.maximum(noisy, 0.0), NORMAL_DEVIATIONS * self.share * level + self.error


SCENES = (
    Scene("50 settled cycles, 1 % noise", "settled", 50, share=0.01, target=0.95),
    Scene("first 50 cycles, 1 % noise", "start", 50, share=0.01, target=0.92),
    Scene(
        "16 settled cycles, 3 N sensor, away from boundaries", "settled", 16, error=3.0, clear_only=True, target=0.95
    ),
    Scene("16 settled cycles, 3 N sensor", "settled", 16, error=3.0),
    Scene("8 settled cycles, 1 % noise", "settled", 8, share=0.01),
    Scene("64 settled cycles, no noise", "settled", 64),
)
"""Scenes of the table; the first three have targets."""


def compare_parameters(examples: Examples, classifier: ResponseClassifier, seed: int) -> dict[str, Any]:
    """Scores on held-out machines from parameters: of types and of natures, by method."""
    train, test = examples.training, examples.test
    features, groups = classifier.features(examples.values), examples.groups[test]
    types, natures = examples.response_type, examples.nature
    chances = classifier.predict_proba(examples.values[test])
    nature_chances = classifier.predict_nature_proba(examples.values[test])
    scored: dict[str, Any] = {
        "response_type": {"classifier": probability_scores(classifier.classes_, chances, types[test], groups)},
        "nature": {"classifier": probability_scores(classifier.natures_, nature_chances, natures[test], groups)},
    }
    if classifier.pupil:
        taught = classifier.pairs_.chances(pair_scores(classifier.teachers_, features[test]))
        for name, chances_of, kinds, truth in (
            ("response_type", classifier.pairs_.types_from, classifier.classes_, types),
            ("nature", classifier.pairs_.natures_from, classifier.natures_, natures),
        ):
            guess = kinds[chances_of(taught).argmax(axis=1)]
            scored[name]["its teachers"] = bootstrap_scores(truth[test], guess, groups)
    for name, labels in (("response_type", types), ("nature", natures)):
        guesses: dict[str, Any] = model_guesses(features[train], labels[train], features[test], seed)
        if name == "nature":
            guesses["criteria of 5.3.1"] = criteria_guess(examples, np.flatnonzero(test))
        scored[name] |= {
            method: bootstrap_scores(labels[test], guess, groups)
            for method, guess in guesses.items()
            if guess is not None
        }
    guess = classifier.classes_[chances.argmax(axis=1)]
    scored["confusion"] = confusion_matrix(types[test], guess, classifier.classes_)
    scored["abstained"] = float(np.mean(chances.max(axis=1) < classifier.least_confidence_))
    return scored


def compare_scene(
    scene: Scene, examples: Examples, classifier: ResponseClassifier, seed: int, *, baselines: bool = True
) -> dict[str, Any]:
    """Scores of natures on held-out machines from records of a scene, by method; of types by the classifier."""
    peaks, _, rows = examples.signals[scene.window]
    asked = examples.test[rows] & (examples.clear[rows] if scene.clear_only else True)
    known = examples.training[rows]
    forces, errors = scene.records(peaks, seed)
    natures, types, groups = (column[rows] for column in (examples.nature, examples.response_type, examples.groups))
    features = record_features(forces, sensor_error=errors)
    blind = record_features(forces[asked])
    pairs = classifier.chances(features[asked])

    def scores(chances: Array) -> dict[str, Any]:
        return probability_scores(
            classifier.natures_, classifier.pairs_.natures_from(chances), natures[asked], groups[asked]
        )

    found = {"classifier": scores(pairs), "classifier, sensor error not told": scores(classifier.chances(blind))}
    if baselines:
        guesses: dict[str, Any] = rule_guesses(forces[known], natures[known], forces[asked])
        guesses |= model_guesses(features[known], natures[known], features[asked], seed)
        guesses["catch22 + boosting"] = catch22_guess(forces[known], natures[known], forces[asked], seed)
        found |= {
            name: bootstrap_scores(natures[asked], guess, groups[asked])
            for name, guess in guesses.items()
            if guess is not None
        }
    return {
        "records": int(asked.sum()),
        "target": scene.target,
        "nature": found,
        "response_type": probability_scores(
            classifier.classes_, classifier.pairs_.types_from(pairs), types[asked], groups[asked]
        ),
        "refused": float(classifier.unlike_training(features[asked]).mean()),
    }


def refusals(examples: Examples, classifier: ResponseClassifier, seed: int) -> dict[str, float]:
    """Share of the held-out machines' records that are refused after each fault, and of sound ones, "none"."""
    scene = replace(SCENES[0], share=0.01)
    peaks, _, rows = examples.signals[scene.window]
    forces, _ = scene.records(peaks[examples.test[rows]], seed)
    forces = forces[forces.mean(axis=1) > 0.0]
    generator = np.random.default_rng(seed)
    faulty = {"none": forces, **{name: fault(forces, generator) for name, fault in FAULTS.items()}}
    return {
        name: float(classifier.unlike_training(record_features(records)).mean()) for name, records in faulty.items()
    }


def outside_parameters(examples: Examples, classifier: ResponseClassifier, seed: int) -> dict[str, float]:
    """Share refused of held-out machines moved out of the range in one random field, and of those as they are."""
    generator = np.random.default_rng(seed)
    values = examples.values[examples.test]
    low, high = examples.ranges
    moved, field = values.copy(), generator.integers(0, values.shape[1], len(values))
    up = generator.random(len(values)) < 0.5
    by = generator.uniform(0.02, 0.5, len(values)) * (high - low)[field]
    moved[np.arange(len(values)), field] = np.where(up, high[field] + by, low[field] - by)
    return {
        "outside": float(classifier.out_of_range(moved).mean()),
        "inside": float(classifier.out_of_range(values).mean()),
    }
