"""What would simpler methods say of the same responses? Rules without learning, and models of scikit-learn.

majority                        the most frequent class of the training
criteria of 5.3.1               chaos where the printed criteria expect it (``diagnosis.criteria``)
3 N repeatability               the thesis' experiments: periodic if the peaks repeat within 3 N
one-threshold repeatability     periodic if the smallest repeat residual is below a threshold, chosen in training
0-1 test                        periodic if its statistic is below one half
catch22 + boosting              the 22 features of C. H. Lubba et al. (2019), level and spread added
logistic regression, nearest neighbours, gradient boosting    on the classifier's own features
"""

from collections.abc import Mapping
from importlib.util import find_spec
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.boosting import without_empty_columns
from chaosgym.classifier.data import Examples
from chaosgym.classifier.features import repeat_residual
from chaosgym.diagnosis.criteria import predictive_criteria
from chaosgym.diagnosis.stroboscopic import MIN_CYCLES, find_recurrence
from chaosgym.diagnosis.zero_one import zero_one_statistic
from chaosgym.errors import DiagnosisError
from chaosgym.machines.parameters import with_settings

Array = NDArray[np.float64]
Words = NDArray[Any]

SENSOR_ERROR = 3.0
"""Error [N] of the thesis' sensors (3.6)."""

CHAOTIC = 0.5
"""0-1 statistic from which on a record counts as chaotic."""

NEIGHBOURS = 15
MOST_ROWS = 15_000
"""Training rows of the models whose cost grows fast with them."""


def model_guesses(known: Array, labels: Words, asked: Array, seed: int) -> dict[str, Words]:
    """Guesses of models of scikit-learn, trained on features ``known`` (n, n_features), for features ``asked``."""
    from sklearn.dummy import DummyClassifier
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.impute import SimpleImputer
    from sklearn.linear_model import LogisticRegression
    from sklearn.neighbors import KNeighborsClassifier
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    def scaled(model: Any) -> Any:
        return make_pipeline(SimpleImputer(keep_empty_features=True), StandardScaler(), model)

    models = {
        "majority": DummyClassifier(),
        "logistic regression": scaled(LogisticRegression(max_iter=1000)),
        "nearest neighbours": scaled(KNeighborsClassifier(n_neighbors=NEIGHBOURS)),
        "gradient boosting": HistGradientBoostingClassifier(random_state=seed),
    }
    drawn = np.random.default_rng(seed).permutation(len(known))[:MOST_ROWS]
    known = without_empty_columns(known)
    return {name: model.fit(known[drawn], labels[drawn]).predict(asked) for name, model in models.items()}


def criteria_guess(examples: Examples, rows: NDArray[np.int64]) -> Words | None:
    """Natures by the printed criteria; None for a machine that has none."""
    guesses = []
    for row in rows:
        settings: Mapping[str, Any] = dict(zip(examples.fields, examples.values[row].tolist(), strict=True))
        try:
            possible = predictive_criteria(with_settings(examples.machine, settings)).chaos_possible
        except DiagnosisError:
            return None
        guesses.append("chaotic" if possible else "periodic")
    return np.array(guesses)


def rule_guesses(known: Array, natures: Words, asked: Array) -> dict[str, Words]:
    """Natures of records ``asked`` (n, cycles) by rules; the threshold is chosen on records ``known``."""
    repeated = np.array([find_recurrence(record[:, None], SENSOR_ERROR, 16).period is not None for record in asked])
    threshold = _best_threshold(repeat_residual(known), natures == "periodic")
    guesses = {
        "3 N repeatability": np.where(repeated, "periodic", "chaotic"),
        "one-threshold repeatability": np.where(repeat_residual(asked) <= threshold, "periodic", "chaotic"),
    }
    if asked.shape[1] >= MIN_CYCLES:
        walks = np.array([zero_one_statistic(record) for record in asked])
        guesses["0-1 test"] = np.where(walks < CHAOTIC, "periodic", "chaotic")
    return guesses


def _best_threshold(residual: Array, periodic: NDArray[np.bool_]) -> float:
    """The residual up to which calling a record periodic is right most often."""
    order = np.argsort(residual)
    right = np.cumsum(np.where(periodic[order], 1, -1))
    return float(residual[order][int(np.argmax(right))])


def catch22_guess(known: Array, labels: Words, asked: Array, seed: int) -> Words | None:
    """Guesses of boosted trees on catch22 features; None if pycatch22 is not installed."""
    if find_spec("pycatch22") is None:
        return None
    from sklearn.ensemble import HistGradientBoostingClassifier

    drawn = np.random.default_rng(seed).permutation(len(known))[: MOST_ROWS // 6]
    model = HistGradientBoostingClassifier(random_state=seed).fit(_catch22(known[drawn]), labels[drawn])
    guess: Words = model.predict(_catch22(asked))
    return guess


def _catch22(records: Array) -> Array:
    import pycatch22

    shapes = np.array([pycatch22.catch22_all(record.tolist(), catch24=True)["values"] for record in records])
    return np.where(np.isfinite(shapes), shapes, np.nan)
