"""A classifier of response type in scikit-learn's manner, for machine parameters and for records of peak forces.

First the nature is learned, then the type of a response of such a nature; the probabilities of pairs such as (III,
chaotic) are products, so that those of types and natures never contradict each other.

Calibration is cross-fitted: every training row is judged by a model that has not seen its machine; temperatures,
conformal threshold and the least confidence of an answer come from these judgements. The model that is kept sees all
rows. Training needs scikit-learn (and torch for networks); everything else needs numpy and numba.
"""

import inspect
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from chaosgym.classifier.calibration import best_temperature, conformal_threshold, softmax
from chaosgym.classifier.features import record_features
from chaosgym.classifier.linear import Linear, linear_scores, train_linear
from chaosgym.classifier.network import Network, network_scores
from chaosgym.classifier.novelty import is_novel, neighbourhood
from chaosgym.classifier.parameter_features import parameter_features, parameter_scaling
from chaosgym.classifier.trees import Forest, class_scores, constant_forest, forest_scores, joined
from chaosgym.machines import Machine
from chaosgym.simulation import parallel_map

Array = NDArray[np.float64]
Labels = NDArray[np.int64]
Scorer = Forest | Linear | Network
_Tick = Callable[[], object]

MODELS = ("boosting", "linear", "network")

CHUNK = 10_000
"""Rows of a table that a thread takes at a time."""

ABSTAIN = 0.05
"""Share of the training machines' responses, the least confident ones, that are not answered."""

CLEAR = 0.6
"""Probability of a type that is always an answer."""

COVERAGE = 0.90
"""Of the sets of plausible types."""

QUANTILES = (0.05, 0.5, 0.95)
"""Of the peak force of a settled cycle."""

QUANTILE_ROUNDS = PERIOD_ROUNDS = 60

PERIODS = (1, 2, 3, 4)
"""Periods that parameters are asked for; longer ones are answered by None."""


class ResponseClassifier:
    """Types of response from parameters or records.

    Parameters
    ----------
    inputs
        "parameters": rows are values of machine fields in SI units. "records": rows are peak forces [N], one a cycle,
        8 to 64 of them; shorter ones end in NaN.
    model
        "boosting": gradient boosted trees; "linear": multinomial logistic regression; "network": an ensemble of small
        networks; or several of them joined by "+", whose scores are averaged.
    machine, fields
        The machine whose fields the columns are, for logarithms and dimensionless groups. None takes plain columns.
    rounds, leaves, depth, learning_rate, least_rows
        Of the boosting; ``leaves`` and ``depth`` of a tree at most, ``least_rows`` in a leaf.
    members
        Networks of the ensemble.
    folds
        Of the cross-fitting; below 2 there is none, and the probabilities are those of the model.
    seed
        Same seed, same model.

    Attributes
    ----------
    classes_, natures_
        Labels in the order of the probabilities.
    n_features_in_
        Number of columns.
    log_loss_
        Mean surprise at type and nature in the cross-fitting: what tells models apart without the test rows.
    """

    def __init__(
        self,
        inputs: Literal["parameters", "records"] = "parameters",
        model: str = "boosting",
        machine: Machine | None = None,
        fields: tuple[str, ...] | None = None,
        rounds: int = 150,
        leaves: int = 15,
        depth: int | None = None,
        learning_rate: float = 0.06,
        least_rows: int = 20,
        members: int = 1,
        folds: int = 3,
        seed: int = 0,
    ) -> None:
        self.inputs = inputs
        self.model = model
        self.machine = machine
        self.fields = fields
        self.rounds = rounds
        self.leaves = leaves
        self.learning_rate = learning_rate
        self.least_rows = least_rows
        self.depth = depth
        self.members = members
        self.folds = folds
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
        ranges: tuple[ArrayLike, ArrayLike] | None = None,
        section: ArrayLike | None = None,
        sensor_error: ArrayLike | None = None,
        tick: _Tick = lambda: None,
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
            Machine that a row belongs to; rows of one machine stay together in the cross-fitting.
        ranges : two of (n_columns,), optional
            Lowest and highest parameters that count as known; those of the rows by default.
        section, sensor_error
            Of records; see ``record_features``.
        tick
            Called after each of ``folds + 1`` trainings.
        """
        from sklearn.utils.multiclass import check_classification_targets
        from sklearn.utils.validation import check_X_y

        finite: Any = "allow-nan" if self.inputs == "records" else True
        values, types = check_X_y(X, y, dtype=np.float64, ensure_all_finite=finite, estimator=self)
        check_classification_targets(types)
        self.n_features_in_ = values.shape[1]
        kinds, natures = self._encode(types, np.full(len(types), "any") if nature is None else np.asarray(nature))
        parts = np.arange(len(kinds)) if groups is None else np.unique(np.asarray(groups), return_inverse=True)[1]
        if self.inputs == "parameters":
            self.scaling_ = parameter_scaling(self.machine, self.fields or (), values)
            low, high = (values.min(axis=0), values.max(axis=0)) if ranges is None else ranges
            self.low_, self.high_ = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
        features = self._features(values, section, sensor_error)
        if self.inputs == "records":
            self.neighbourhood_ = neighbourhood(features, parts, self.seed)
        self._calibrate(features, kinds, natures, parts, tick)
        everything = np.arange(len(kinds))
        self.scorers_ = tuple(
            self._train(question, features, labels, everything[counts])
            for question, (counts, labels) in enumerate(self._questions(kinds, natures))
        )
        self._fit_period(features, period)
        self._fit_peak_force(features, values, peak_force)
        tick()
        return self

    def _encode(self, types: NDArray[Any], natures: NDArray[Any]) -> tuple[Labels, Labels]:
        """Number types and natures, (n,) each, and the pairs that occur."""
        self.classes_, type_of = np.unique(types, return_inverse=True)
        self.natures_, nature_of = np.unique(natures, return_inverse=True)
        if len(self.classes_) < 2:
            raise ValueError("y holds one class; ResponseClassifier needs at least 2 classes")
        pairs = np.unique(nature_of * len(self.classes_) + type_of)
        self.nature_of_, self.type_of_ = np.divmod(pairs, len(self.classes_))
        return np.asarray(type_of), np.asarray(nature_of)

    def _questions(self, types: Labels, natures: Labels) -> list[tuple[NDArray[np.bool_], Labels]]:
        """What is learned: the nature, and for each nature its type; (rows that count (n,), class numbers (n,))."""
        asked = [(np.ones(len(types), dtype=bool), natures)]
        for nature in range(len(self.natures_)):
            known = self.type_of_[self.nature_of_ == nature]
            asked.append((natures == nature, np.searchsorted(known, types).clip(max=len(known) - 1)))
        return asked

    def _calibrate(self, features: Array, types: Labels, natures: Labels, parts: Labels, tick: _Tick) -> None:
        questions = self._questions(types, natures)
        self.temperatures_ = np.ones(len(questions))
        self.plausible_, self.least_confidence_ = 0.0, 0.0
        if self.folds < 2:
            return
        fold = (np.random.default_rng(self.seed).permutation(parts.max() + 1) % self.folds)[parts]
        scores: list[list[Array]] = [[] for _ in questions]
        order = []
        for held in range(self.folds):
            rows = np.flatnonzero(fold == held)
            kept = np.flatnonzero(fold != held)
            if len(rows) and len(kept):
                order.append(rows)
                for question, (counts, labels) in enumerate(questions):
                    scorers = self._train(question, features, labels, kept[counts[kept]])
                    scores[question].append(_raw_scores(scorers, features[rows]))
            tick()
        rows = np.concatenate(order)
        out_of_fold = [np.concatenate(part) for part in scores]
        for question, (counts, labels) in enumerate(questions):
            counted = counts[rows]
            if out_of_fold[question].shape[1] > 1 and counted.any():
                self.temperatures_[question] = best_temperature(out_of_fold[question][counted], labels[rows][counted])
        pairs = self._pairs(out_of_fold)
        true_pair = np.searchsorted(
            self.nature_of_ * len(self.classes_) + self.type_of_, natures[rows] * len(self.classes_) + types[rows]
        )
        self.log_loss_ = float(-np.mean(np.log(pairs[np.arange(len(rows)), true_pair].clip(1e-12))))
        chances = self.types_of(pairs)
        self.plausible_ = conformal_threshold(chances, types[rows], COVERAGE)
        self.least_confidence_ = min(CLEAR, float(np.quantile(chances.max(axis=1), ABSTAIN)))

    def _train(self, question: int, features: Array, labels: Labels, rows: Labels) -> tuple[Scorer, ...]:
        """Scorers of one question from some rows; none where there is nothing to tell apart."""
        count = int(labels.max()) + 1 if question == 0 else int(np.sum(self.nature_of_ == question - 1))
        if count < 2:
            return ()
        known, asked = features[rows], labels[rows]
        if len(np.unique(asked)) < count:
            shares = np.bincount(asked, minlength=count) / max(1, len(asked))
            return (constant_forest(np.log(shares.clip(1e-6))),)
        scorers: list[Scorer] = []
        kinds = self.model.split("+")
        if not set(kinds) <= set(MODELS):
            raise ValueError(f"model = {self.model!r} is not made of {', '.join(MODELS)}")
        if "boosting" in kinds:
            from chaosgym.classifier.boosting import train_forest

            scorers.append(train_forest(
                known, asked, rounds=self.rounds, leaves=self.leaves, learning_rate=self.learning_rate,
                least_rows=self.least_rows, depth=self.depth, seed=self.seed,
            ))  # fmt: skip
        if "linear" in kinds:
            scorers.append(train_linear(known, asked))
        if "network" in kinds:
            from chaosgym.classifier.network import train_networks

            scorers.append(train_networks(known, asked, count, self.members, self.seed))
        return tuple(scorers)

    def _fit_period(self, features: Array, period: ArrayLike | None) -> None:
        self.period_forest_: Forest | None = None
        if period is None or self.inputs == "records":
            return
        from chaosgym.classifier.boosting import train_forest

        periods = np.asarray(period)
        rows = periods > 0
        kinds = np.searchsorted(PERIODS, periods[rows])
        self.period_kinds_, numbers = np.unique(kinds, return_inverse=True)
        if len(self.period_kinds_) > 1:
            self.period_forest_ = train_forest(features[rows], numbers, rounds=PERIOD_ROUNDS, seed=self.seed)

    def _fit_peak_force(self, features: Array, values: Array, peak_force: ArrayLike | None) -> None:
        self.quantile_forest_: Forest | None = None
        if peak_force is None:
            return
        from chaosgym.classifier.boosting import train_quantile_forest

        forces = np.asarray(peak_force, dtype=float) / self._level(values)
        rows = np.isfinite(forces) & (forces > 0.0)
        self.quantile_forest_ = joined(tuple(
            train_quantile_forest(features[rows], np.log(forces[rows]), quantile, QUANTILE_ROUNDS, self.seed)
            for quantile in QUANTILES
        ))  # fmt: skip

    def predict(self, X: ArrayLike, **record: Any) -> NDArray[Any]:
        """Most probable type (n,); ``section`` and ``sensor_error`` of records as in ``fit``."""
        chances = self.predict_proba(X, **record)
        predicted: NDArray[Any] = self.classes_[chances.argmax(axis=1)]
        return predicted

    def predict_proba(self, X: ArrayLike, **record: Any) -> Array:
        """Probabilities (n, n_types), in the order of ``classes_``."""
        return self.types_of(self.predict_pairs(X, **record))

    def predict_nature_proba(self, X: ArrayLike, **record: Any) -> Array:
        """Probabilities (n, n_natures), in the order of ``natures_``."""
        return self.natures_of(self.predict_pairs(X, **record))

    def predict_pairs(self, X: ArrayLike, **record: Any) -> Array:
        """Probabilities (n, n_pairs) of type ``classes_[type_of_]`` with nature ``natures_[nature_of_]``."""
        values = self._checked(X)
        if len(values) <= CHUNK or record:
            return self.chances(self._features(values, **record))
        chunks = [values[start : start + CHUNK] for start in range(0, len(values), CHUNK)]
        return np.concatenate(parallel_map(lambda part: self.chances(self._features(part)), chunks))

    def chances(self, features: Array) -> Array:
        """Probabilities of the pairs from features that are computed already."""
        return self._pairs([_raw_scores(scorers, features) for scorers in self.scorers_])

    def _pairs(self, scores: list[Array]) -> Array:
        """Probabilities of the pairs: that of the nature times that of the type of such a nature."""
        parts = [softmax(score / temperature) for score, temperature in zip(scores, self.temperatures_, strict=True)]
        chances = np.empty((len(scores[0]), len(self.type_of_)))
        for nature in range(len(self.natures_)):
            chances[:, self.nature_of_ == nature] = parts[0][:, nature : nature + 1] * parts[nature + 1]
        return chances

    def types_of(self, pairs: Array) -> Array:
        """Probabilities of types (n, n_types) from those of pairs (n, n_pairs)."""
        return _pooled(pairs, self.type_of_)

    def natures_of(self, pairs: Array) -> Array:
        """Probabilities of natures (n, n_natures) from those of pairs (n, n_pairs)."""
        return _pooled(pairs, self.nature_of_)

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
        if self.period_forest_ is None:
            return np.zeros(len(features), dtype=np.int64)
        chances = class_scores(self.period_forest_, features)
        return np.asarray(np.array([*PERIODS, 0])[self.period_kinds_[chances.argmax(axis=1)]])

    def predict_peak_force(self, features: Array, values: Array) -> Array:
        """Quantiles (n, 3) of the peak force of a settled cycle [N]; (n, 0) if not trained."""
        if self.quantile_forest_ is None:
            return np.empty((len(features), 0))
        logs = forest_scores(self.quantile_forest_, features)
        return np.asarray(np.sort(np.exp(logs), axis=1) * self._level(values)[:, None])

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


def _raw_scores(scorers: tuple[Scorer, ...], features: Array) -> Array:
    """Mean scores of the scorers, (n, n_classes); a single class where there are none."""
    parts = [_scores_of(scorer, features) for scorer in scorers]
    if not parts:
        return np.zeros((len(features), 1))
    return parts[0] if len(parts) == 1 else np.asarray(sum(parts) / len(parts))


def _scores_of(scorer: Scorer, features: Array) -> Array:
    if isinstance(scorer, Linear):
        return linear_scores(scorer, features)
    return network_scores(scorer, features) if isinstance(scorer, Network) else class_scores(scorer, features)


def _pooled(chances: Array, group_of: Labels) -> Array:
    """Sums of the probabilities of pairs (n, n_pairs) over the pairs of each group, (n, n_groups)."""
    pooled = np.zeros((len(chances), int(group_of.max()) + 1))
    for pair, group in enumerate(group_of):
        pooled[:, group] += chances[:, pair]
    return pooled
