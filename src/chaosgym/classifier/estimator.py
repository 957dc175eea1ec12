"""A classifier of responses: one boosted model, one temperature.

It learns one question (a nature, whether an irregularity is resolvable) from the values of a machine's fields, from
measured peak forces, or from fields and the first cycles of a run together. Training needs scikit-learn; a fitted one
is a few plain arrays and needs numpy and numba only.
"""

from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.arrays import Array
from chaosgym.classifier.calibration import best_temperature, conformal_thresholds, softmax
from chaosgym.classifier.features import as_records, response_features
from chaosgym.classifier.parameter_features import parameter_scaling
from chaosgym.classifier.trees import class_scores, train_forest
from chaosgym.machines import Machine

Labels = NDArray[np.int64]

CALIBRATION = 0.15
"""Share of the rows that calibrate where they are not named."""

COVERAGE = 0.90
"""Of the sets of plausible classes, for each class."""


class ResponseClassifier:
    """Classes of response from parameters or records.

    Parameters
    ----------
    inputs
        "parameters": rows are values of machine fields in SI units. "records": rows are peak forces [N], one a cycle,
        8 to 64 of them; shorter ones end in NaN.
    machine, fields
        The machine whose fields the columns are, for logarithms and dimensionless groups. None takes plain columns.
    rounds, leaves, learning_rate, least_rows
        Of the boosting; ``leaves`` of a tree at most, ``least_rows`` in a leaf.
    seed
        Same seed, same model.

    Attributes
    ----------
    classes_
        Labels in the order of the probabilities.
    n_features_in_
        Number of columns.
    temperature_
        Divisor of the scores, from the rows that calibrate; 1 without any.
    plausible_ : (n_classes,)
        Probability from which on a class is plausible.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> points = rng.random((400, 2))
    >>> labels = np.where(points[:, 0] > 0.5, "chaotic", "periodic")
    >>> model = chaosgym.ResponseClassifier(rounds=20).fit(points, labels)
    >>> model.predict([[0.9, 0.5], [0.1, 0.5]])
    array(['chaotic', 'periodic'], dtype='<U8')
    """

    def __init__(
        self,
        inputs: Literal["parameters", "records"] = "parameters",
        machine: Machine | None = None,
        fields: tuple[str, ...] | None = None,
        rounds: int = 200,
        leaves: int = 15,
        learning_rate: float = 0.08,
        least_rows: int = 20,
        seed: int = 0,
    ) -> None:
        self.inputs = inputs
        self.machine = machine
        self.fields = fields
        self.rounds = rounds
        self.leaves = leaves
        self.learning_rate = learning_rate
        self.least_rows = least_rows
        self.seed = seed

    def __repr__(self) -> str:
        return f"ResponseClassifier(inputs={self.inputs!r}, seed={self.seed})"

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        calibration: ArrayLike | None = None,
        ranges: tuple[ArrayLike, ArrayLike] | None = None,
        cycles: ArrayLike | None = None,
        sensor_error: ArrayLike | None = None,
    ) -> "ResponseClassifier":
        """Train.

        Parameters
        ----------
        X : (n, n_columns)
            Parameters or records, by ``inputs``.
        y : (n,)
            Classes.
        calibration : (n,) of bool, optional
            Rows that calibrate; some drawn ones by default.
        ranges : two of (n_columns,), optional
            Lowest and highest parameters that count as known; those of the rows by default.
        cycles : (n, n_cycles, 3), optional
            With parameters: first cycles of each run, peak force [N], stroboscopic displacement and velocity.
        sensor_error : (n,), optional
            With records: largest error of a peak [N], NaN where it is not known.
        """
        values, labels = self._columns(X), np.asarray(y)
        if len(values) != len(labels):
            raise ValueError(f"y has {len(labels)} classes for {len(values)} rows of X; allowed: one a row")
        self.n_features_in_ = values.shape[1]
        self.classes_, kinds = np.unique(labels, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError("y holds one class; ResponseClassifier needs at least 2 classes")
        held = self._held_back(kinds, calibration)
        if self.inputs == "parameters":
            self.scaling_ = parameter_scaling(self.machine, self.fields or (), values)
            low, high = (values.min(axis=0), values.max(axis=0)) if ranges is None else ranges
            self.low_, self.high_ = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        features = self._features(values, cycles, sensor_error)
        self.forest_ = train_forest(
            features[~held],
            kinds[~held],
            rounds=self.rounds,
            leaves=self.leaves,
            learning_rate=self.learning_rate,
            least_rows=self.least_rows,
            seed=self.seed,
        )
        self.temperature_, self.plausible_ = 1.0, np.zeros(len(self.classes_))
        if held.any():
            scores = class_scores(self.forest_, features[held])
            self.temperature_ = best_temperature(scores, kinds[held])
            self.plausible_ = conformal_thresholds(softmax(scores / self.temperature_), kinds[held], COVERAGE)
        return self

    def _held_back(self, kinds: Labels, calibration: ArrayLike | None) -> NDArray[np.bool_]:
        """Rows (n,) that calibrate; none if the others would not hold every class."""
        if calibration is None:
            held = np.random.default_rng(self.seed).permutation(len(kinds)) < CALIBRATION * len(kinds)
        else:
            held = np.asarray(calibration, dtype=bool)
        complete = len(np.unique(kinds[~held])) == kinds.max() + 1
        return held if complete else np.zeros(len(kinds), dtype=bool)

    def predict(self, X: ArrayLike, **more: Any) -> NDArray[Any]:
        """Most probable class (n,); ``cycles`` or ``sensor_error`` as in ``fit``."""
        chances = self.predict_proba(X, **more)
        predicted: NDArray[Any] = self.classes_[chances.argmax(axis=1)]
        return predicted

    def predict_proba(self, X: ArrayLike, **more: Any) -> Array:
        """Probabilities (n, n_classes), in the order of ``classes_``."""
        return self.chances(self._features(self._checked(X), **more))

    def chances(self, features: Array) -> Array:
        """Probabilities (n, n_classes) from features that are computed already."""
        return softmax(class_scores(self.forest_, features) / self.temperature_)

    def _features(self, values: Array, cycles: ArrayLike | None = None, sensor_error: ArrayLike | None = None) -> Array:
        if self.inputs == "records":
            peaks, _, errors = as_records(values, None, sensor_error)
            return response_features(None, None, peaks, None, errors)
        if cycles is None:
            return response_features(self.scaling_, values)
        run = np.asarray(cycles, dtype=float)
        return response_features(self.scaling_, values, run[..., 0], run[..., 1:])

    def _checked(self, X: ArrayLike) -> Array:
        """Columns (n, n_columns) for a model that was trained on as many."""
        if not hasattr(self, "forest_"):
            raise ValueError("this ResponseClassifier is not fitted; call fit first, or load a trained one")
        values = self._columns(X)
        if self.inputs == "parameters" and values.shape[1] != self.n_features_in_:
            raise ValueError(f"X has {values.shape[1]} columns; allowed: {self.n_features_in_}, as in fit")
        return values

    def _columns(self, X: ArrayLike) -> Array:
        """Columns (n, n_columns) as numbers."""
        values = np.ascontiguousarray(X, dtype=float)
        if values.ndim != 2:
            raise ValueError(f"X has shape {values.shape}; allowed: 2D, (rows, columns). Reshape your data")
        if self.inputs == "parameters" and not np.isfinite(values).all():
            raise ValueError("X holds NaN or infinity; allowed: finite numbers")
        return values
