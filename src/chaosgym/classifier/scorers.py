"""Which models give scores to pairs of type and nature, and how does one small network learn what several know?

Boosted trees, networks and logistic regression judge differently, and their mean is better than each. It is slow, so a
network learns it: on the training rows, and on as many made-up machines as are wanted, since the teacher can be asked
about any (model compression: C. Bucila et al., KDD 2006).
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.calibration import softmax
from chaosgym.classifier.linear import Linear, linear_scores, train_linear
from chaosgym.classifier.network import Network, network_scores, train_network
from chaosgym.classifier.trees import Forest, class_scores

Array = NDArray[np.float64]
Labels = NDArray[np.int64]
Scorer = Forest | Linear | Network

MODELS = ("boosting", "linear", "network")

CANDIDATES = ("boosting", "linear", "boosting+linear", "boosting+network")
"""What "best" chooses from, by the machines that calibrate."""

NETWORKS = 2
"""Networks that are trained where a model asks for one."""


class Trees(NamedTuple):
    """Size of the boosted model: ``rounds``; ``leaves`` and ``depth`` of a tree at most; ``least_rows`` in a leaf."""

    rounds: int
    leaves: int
    depth: int | None
    learning_rate: float
    least_rows: int


def train_scorers(
    model: str, trees: Trees, features: Array, labels: Labels, seed: int
) -> dict[str, tuple[Scorer, ...]]:
    """Train what ``model`` names, joined by "+", or every one for "best".

    Parameters
    ----------
    features, labels
        Features (n, n_features) and class numbers (n,), all of which occur.

    Returns
    -------
    dict
        Scorers by candidate: the model, or for "best" every one of ``CANDIDATES``.

    Raises
    ------
    ValueError
        If a name is none of ``MODELS``.
    """
    candidates = CANDIDATES if model == "best" else (model,)
    kinds = list(dict.fromkeys(kind for candidate in candidates for kind in candidate.split("+")))
    if not set(kinds) <= set(MODELS):
        raise ValueError(f"model = {model!r} is not best, nor made of {', '.join(MODELS)} joined by +")
    trained = {kind: _train(kind, trees, features, labels, seed) for kind in kinds}
    return {
        candidate: tuple(scorer for kind in candidate.split("+") for scorer in trained[kind])
        for candidate in candidates
    }


def _train(kind: str, trees: Trees, features: Array, labels: Labels, seed: int) -> tuple[Scorer, ...]:
    if kind == "boosting":
        from chaosgym.classifier.boosting import train_forest

        return (train_forest(features, labels, seed=seed, **trees._asdict()),)
    if kind == "linear":
        return (train_linear(features, labels),)
    truth = np.eye(int(labels.max()) + 1)[labels]
    return tuple(train_network(features, truth, seed + 1000 * member) for member in range(NETWORKS))


def pair_scores(scorers: tuple[Scorer, ...], features: Array) -> Array:
    """Scores (n, n_pairs) of features (n, n_features): of several scorers the mean of their logarithmic chances."""
    if len(scorers) == 1:
        return _scores_of(scorers[0], features)
    logarithms = [np.log(softmax(_scores_of(scorer, features)).clip(1e-12)) for scorer in scorers]
    return np.asarray(sum(logarithms) / len(logarithms))


def pupil(teachers: tuple[Scorer, ...], features: Array, seed: int) -> tuple[Scorer, ...]:
    """One network that says what the teachers say about features (n, n_features)."""
    return (train_network(features, softmax(pair_scores(teachers, features)), seed),)


def shuffled_columns(values: Array, count: int, seed: int) -> Array:
    """Rows (count, n_columns) that take every column from another row of ``values`` (n, n_columns)."""
    generator = np.random.default_rng(seed)
    return np.column_stack([column[generator.integers(0, len(column), count)] for column in values.T])


def _scores_of(scorer: Any, features: Array) -> Array:
    if isinstance(scorer, Linear):
        return linear_scores(scorer, features)
    return network_scores(scorer, features) if isinstance(scorer, Network) else class_scores(scorer, features)
