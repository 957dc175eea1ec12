"""A classifier of response type in scikit-learn's manner, for machine parameters and for records of peak forces.

Pairs of type and nature are learned, so that the probabilities of types and natures never contradict each other.

A share of the machines calibrates: no model is trained on them, and temperatures, conformal threshold and the least
confidence of an answer come from what the model says of them. Training needs scikit-learn (and torch for networks);
everything else needs numpy and numba.
"""

import inspect
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.classifier.calibration import conformal_threshold
from chaosgym.classifier.expectations import expected_force, expected_period, learn_expectations
from chaosgym.classifier.features import record_features
from chaosgym.classifier.novelty import is_novel, neighbourhood
from chaosgym.classifier.pairs import pairs_of
from chaosgym.classifier.parameter_features import parameter_features, parameter_scaling
from chaosgym.classifier.scorers import Scorer, Trees, pair_scores, pupil, shuffled_columns, train_scorers
from chaosgym.machines import Machine
from chaosgym.simulation import parallel_map

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

CHUNK = 2_000
"""Rows of a table that a thread takes at a time."""

CALIBRATION = 0.15
"""Share of the groups that calibrate where they are not named."""

ABSTAIN = 0.05
"""Share of the calibrating responses, the least confident ones, that are not answered."""

CLEAR = 0.6
"""Probability of a type that is always an answer."""

COVERAGE = 0.90
"""Of the sets of plausible types."""


class ResponseClassifier:
    """Types of response from parameters or records.

    Parameters
    ----------
    inputs
        "parameters": rows are values of machine fields in SI units. "records": rows are peak forces [N], one a cycle,
        8 to 64 of them; shorter ones end in NaN.
    model
        "boosting": gradient boosted trees; "linear": multinomial logistic regression; "network": two small networks;
        or several of them joined by "+", whose logarithmic probabilities are averaged; "best": what surprises itself
        least on the rows that calibrate.
    pupil
        Made-up machines on which one network learns what the model says, to answer in its place; 0 for none.
    machine, fields
        The machine whose fields the columns are, for logarithms and dimensionless groups. None takes plain columns.
    rounds, leaves, depth, learning_rate, least_rows
        Of the boosting; ``leaves`` and ``depth`` of a tree at most, ``least_rows`` in a leaf.
    seed
        Same seed, same model.

    Attributes
    ----------
    classes_, natures_
        Labels in the order of the probabilities.
    n_features_in_
        Number of columns.
    model_, log_losses_, log_loss_
        Chosen model; by model, and of what answers, the mean surprise at the pairs of the rows that calibrate.
    """

    def __init__(
        self,
        inputs: Literal["parameters", "records"] = "parameters",
        model: str = "boosting",
        pupil: int = 0,
        machine: Machine | None = None,
        fields: tuple[str, ...] | None = None,
        rounds: int = 150,
        leaves: int = 16,
        depth: int | None = None,
        learning_rate: float = 0.1,
        least_rows: int = 20,
        seed: int = 0,
    ) -> None:
        self.inputs = inputs
        self.model = model
        self.pupil = pupil
        self.machine = machine
        self.fields = fields
        self.rounds = rounds
        self.leaves = leaves
        self.depth = depth
        self.learning_rate = learning_rate
        self.least_rows = least_rows
        self.seed = seed

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Return the constructor's parameters."""
        return {name: getattr(self, name) for name in inspect.signature(type(self)).parameters}

    def set_params(self, **params: Any) -> "ResponseClassifier":
        """Change the constructor's parameters."""
        known = self.get_params()
        for name, value in params.items():
            if name not in known:
                raise ValueError(f"{name!r} is no parameter of ResponseClassifier; allowed: {', '.join(known)}")
            setattr(self, name, value)
        return self

    def __repr__(self) -> str:
        return f"ResponseClassifier(inputs={self.inputs!r}, model={self.model!r}, seed={self.seed})"

    def __sklearn_is_fitted__(self) -> bool:
        return hasattr(self, "scorers_")

    def __sklearn_tags__(self) -> Any:
        from sklearn.utils import ClassifierTags, InputTags, Tags, TargetTags

        records = self.inputs == "records"
        return Tags(
            estimator_type="classifier",
            target_tags=TargetTags(required=True),
            classifier_tags=ClassifierTags(),
            input_tags=InputTags(allow_nan=records, positive_only=records),
        )

    def fit(
        self,
        X: ArrayLike,
        y: ArrayLike,
        *,
        nature: ArrayLike | None = None,
        period: ArrayLike | None = None,
        peak_force: ArrayLike | None = None,
        groups: ArrayLike | None = None,
        calibration: ArrayLike | None = None,
        ranges: tuple[ArrayLike, ArrayLike] | None = None,
        section: ArrayLike | None = None,
        sensor_error: ArrayLike | None = None,
        tick: Callable[[], object] = lambda: None,
    ) -> "ResponseClassifier":
        """Train.

        Parameters
        ----------
        X : (n, n_columns)
            Parameters or records, by ``inputs``.
        y : (n,)
            Response types.
        nature : (n,), optional
            Natures; learned along with the types.
        period : (n,), optional
            Periods, 0 where there is none; of parameters only, since a record shows its period.
        peak_force : (n,), optional
            Peak force of some settled cycle of each row [N], for the predicted quantiles.
        groups : (n,), optional
            Machine that a row belongs to; rows of one machine stay together.
        calibration : (n,) of bool, optional
            Rows that calibrate; those of some groups by default.
        ranges : two of (n_columns,), optional
            Lowest and highest parameters that count as known; those of the rows by default.
        section, sensor_error
            Of records; see ``record_features``.
        tick
            Called after every step: training, the pupil if there is one, expectations.
        """
        from sklearn.utils.multiclass import check_classification_targets
        from sklearn.utils.validation import check_X_y

        finite: Any = "allow-nan" if self.inputs == "records" else True
        values, types = check_X_y(X, y, dtype=np.float64, ensure_all_finite=finite, estimator=self)
        check_classification_targets(types)
        self.n_features_in_ = values.shape[1]
        self.pairs_, pair = pairs_of(types, np.full(len(types), "any") if nature is None else np.asarray(nature))
        if len(self.classes_) < 2:
            raise ValueError("y holds one class; ResponseClassifier needs at least 2 classes")
        parts = np.arange(len(pair)) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
        held = self._held_back(pair, parts, calibration)
        if self.inputs == "parameters":
            self.scaling_ = parameter_scaling(self.machine, self.fields or (), values)
            low, high = (values.min(axis=0), values.max(axis=0)) if ranges is None else ranges
            self.low_, self.high_ = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        features = self._features(values, section, sensor_error)
        if self.inputs == "records":
            self.neighbourhood_ = neighbourhood(features, parts, self.seed)
        trees = Trees(self.rounds, self.leaves, self.depth, self.learning_rate, self.least_rows)
        trained = train_scorers(self.model, trees, features[~held], pair[~held], self.seed)
        tick()
        self.log_losses_ = {
            name: self._calibrate(scorers, features[held], pair[held]) for name, scorers in trained.items()
        }
        self.model_ = min(self.log_losses_, key=self.log_losses_.__getitem__)
        self.scorers_ = trained[self.model_]
        if self.pupil:
            asked = np.concatenate([values[~held], shuffled_columns(values[~held], self.pupil, self.seed)])
            self.teachers_ = self.scorers_
            self.scorers_ = pupil(self.scorers_, self._features(asked), self.seed)
            tick()
        self.log_loss_ = self._calibrate(self.scorers_, features[held], pair[held])
        force = None if peak_force is None else np.asarray(peak_force, dtype=float) / self._level(values)
        self.expectations_ = learn_expectations(
            features, None if period is None else np.asarray(period), force, self.seed
        )
        tick()
        return self

    @property
    def classes_(self) -> NDArray[Any]:
        """Types in the order of the probabilities."""
        return self.pairs_.types

    @property
    def natures_(self) -> NDArray[Any]:
        """Natures in the order of the probabilities."""
        return self.pairs_.natures

    def _held_back(self, pair: Labels, parts: Labels, calibration: ArrayLike | None) -> NDArray[np.bool_]:
        """Rows (n,) that calibrate; none if the others would not hold every pair."""
        if calibration is None:
            drawn = np.random.default_rng(self.seed).permutation(parts.max() + 1)
            held = np.isin(parts, drawn[: round(CALIBRATION * len(drawn))])
        else:
            held = np.asarray(calibration, dtype=bool)
        complete = len(np.unique(pair[~held])) == pair.max() + 1
        return held if complete else np.zeros(len(pair), dtype=bool)

    def _calibrate(self, scorers: tuple[Scorer, ...], features: Array, pair: Labels) -> float:
        """Mean surprise of calibrated scorers at the rows that calibrate; 0 without any."""
        self.plausible_, self.least_confidence_ = 0.0, 0.0
        if not len(pair):
            return 0.0
        scores = pair_scores(scorers, features)
        self.pairs_ = self.pairs_.calibrated(scores, pair)
        chances = self.pairs_.chances(scores)
        types = self.pairs_.types_from(chances)
        self.plausible_ = conformal_threshold(types, self.pairs_.type_of[pair], COVERAGE)
        self.least_confidence_ = min(CLEAR, float(np.quantile(types.max(axis=1), ABSTAIN)))
        return float(-np.mean(np.log(chances[np.arange(len(pair)), pair].clip(1e-12))))

    def predict(self, X: ArrayLike, **record: Any) -> NDArray[Any]:
        """Most probable type (n,); ``section`` and ``sensor_error`` of records as in ``fit``."""
        chances = self.predict_proba(X, **record)
        predicted: NDArray[Any] = self.classes_[chances.argmax(axis=1)]
        return predicted

    def predict_proba(self, X: ArrayLike, **record: Any) -> Array:
        """Probabilities (n, n_types), in the order of ``classes_``."""
        chances = self.predict_pairs(X, **record)
        return self.pairs_.types_from(chances)

    def predict_nature_proba(self, X: ArrayLike, **record: Any) -> Array:
        """Probabilities (n, n_natures), in the order of ``natures_``."""
        chances = self.predict_pairs(X, **record)
        return self.pairs_.natures_from(chances)

    def predict_pairs(self, X: ArrayLike, **record: Any) -> Array:
        """Probabilities (n, n_pairs) of pairs of type and nature, see ``Pairs``."""
        values = self._checked(X)
        if len(values) <= CHUNK or record:
            return self.chances(self._features(values, **record))
        from threadpoolctl import threadpool_limits

        chunks = [values[start : start + CHUNK] for start in range(0, len(values), CHUNK)]
        with threadpool_limits(1, "blas"):  # its own threads and ours would wait for each other
            return np.concatenate(parallel_map(lambda part: self.chances(self._features(part)), chunks))

    def chances(self, features: Array) -> Array:
        """Probabilities of the pairs from features that are computed already."""
        return self.pairs_.chances(pair_scores(self.scorers_, features))

    def features(self, X: ArrayLike, **record: Any) -> Array:
        """Features (n, n_features) that the model sees."""
        return self._features(self._checked(X), **record)

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None, **record: Any) -> float:
        """Share of types that are right."""
        weights = None if sample_weight is None else np.asarray(sample_weight, dtype=float)
        return float(np.average(self.predict(X, **record) == np.asarray(y), weights=weights))

    def out_of_range(self, X: ArrayLike, **record: Any) -> NDArray[np.bool_]:
        """Whether each row (n,) lies outside what was trained on."""
        values = self._checked(X)
        if self.inputs == "parameters":
            return np.asarray(((values < self.low_) | (values > self.high_)).any(axis=1))
        return self.unlike_training(self._features(values, **record))

    def unlike_training(self, features: Array) -> NDArray[np.bool_]:
        """Whether features of records that are computed already resemble none of the training."""
        return is_novel(self.neighbourhood_, features)

    def predict_period(self, features: Array) -> Labels:
        """Most probable period (n,) of a periodic response from its features; 0 for a longer one or if not trained."""
        return expected_period(self.expectations_, features)

    def predict_peak_force(self, features: Array, values: Array) -> Array:
        """Quantiles (n, 3) of the peak force of a settled cycle [N]; (n, 0) if not trained."""
        return expected_force(self.expectations_, features) * self._level(values)[:, None]

    def _level(self, values: Array) -> Array:
        """Force [N] that predicted forces are relative to."""
        if self.inputs == "parameters":
            return np.ones(len(values))
        level = np.nanmean(values, axis=1)
        return np.where(level > 0.0, level, 1.0)

    def _features(
        self, values: Array, section: ArrayLike | None = None, sensor_error: ArrayLike | None = None
    ) -> Array:
        if self.inputs == "records":
            return record_features(values, section, sensor_error)
        return parameter_features(self.scaling_, values)

    def _checked(self, X: ArrayLike) -> Array:
        """Columns as numbers, or an error that says what is wrong."""
        if not hasattr(self, "scorers_"):
            from sklearn.exceptions import NotFittedError

            raise NotFittedError("this ResponseClassifier is not fitted; call fit first, or load a trained one")
        if hasattr(X, "toarray"):
            raise TypeError("sparse input is not supported; give a dense array")
        values = np.asarray(X)
        if np.iscomplexobj(values):
            raise ValueError("Complex data not supported; give real numbers")
        values = np.ascontiguousarray(values, dtype=float)
        if values.ndim != 2:
            raise ValueError(f"X has shape {values.shape}; allowed: 2D, (rows, columns). Reshape your data")
        if self.inputs == "parameters":
            if values.shape[1] != self.n_features_in_:
                raise ValueError(
                    f"X has {values.shape[1]} features, but ResponseClassifier is expecting "
                    f"{self.n_features_in_} features as input"
                )
            if not np.isfinite(values).all():
                raise ValueError("X holds NaN or infinity; allowed: finite numbers")
        return values
