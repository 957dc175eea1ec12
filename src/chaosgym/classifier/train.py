"""How is the classifier trained, and is it any better than simple rules?

The network and the scikit-learn baselines see the same rows and are judged on the same held-out blocks of the swept
plane: whole rectangles, since a random split would put near-copies of every test point into the training set.
"""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import trange

from chaosgym.classifier.model import RESPONSE_TYPES, ResponseClassifier, fourier_features
from chaosgym.errors import DatasetError
from chaosgym.sweeps import LabelledSweep
from chaosgym.version import __version__

Array = NDArray[np.float64]

BLOCKS = 12
"""The held-out rectangles come from a BLOCKS x BLOCKS board laid over the first two swept parameters."""

WAVES, WAVE_SCALE = 64, 0.1
HIDDEN = 64
UPDATES, BATCH = 2500, 256
LEARNING_RATE = 5e-3
WEIGHT_DECAY = 0.1


@dataclass(frozen=True)
class TrainingResult:
    """Trained classifier and the report: rows, and per method accuracy and balanced accuracy on held-out rows."""

    classifier: ResponseClassifier
    report: dict[str, Any]


def held_out_blocks(features: Array, seed: int, share: float = 0.25) -> NDArray[np.bool_]:
    """Choose the held-out rows: True for the rows (n,) in randomly drawn rectangles of the first two features."""
    board = np.zeros(len(features), dtype=int)
    for column in features[:, :2].T:
        edges = np.linspace(column.min(), column.max(), BLOCKS + 1)[1:-1]
        board = board * BLOCKS + np.digitize(column, edges)
    occupied = np.unique(board)
    drawn = np.random.default_rng(seed).permutation(occupied)
    return np.isin(board, drawn[: max(1, round(share * len(occupied)))])


def train_classifier(sweep: LabelledSweep, seed: int = 0, *, progress: bool = False) -> TrainingResult:
    """Train the network on a labelled sweep and judge it beside its baselines.

    Parameters
    ----------
    sweep
        Labelled points; rows without a response type are left out.
    seed
        Of the held-out blocks, the first weights and the baselines. Same seed, same weights.
    progress
        Show a progress bar on standard error.

    Raises
    ------
    DatasetError
        If fewer than 50 rows have a response type, or only one type occurs in the training or held-out rows.
    """
    fields = [axis["field"] for axis in sweep.settings["axes"]]
    answers = np.array([str(value) for value in sweep.column("response_type")])
    usable = np.isin(answers, RESPONSE_TYPES)
    if usable.sum() < 50:
        raise DatasetError(f"only {usable.sum()} rows have a response type; at least 50 are needed to train")
    values = np.column_stack([sweep.column(name)[usable] for name in fields])
    if np.any(values <= 0.0):
        raise DatasetError("the classifier takes logarithms of the swept parameters; all must be above 0")
    features = np.log(values)
    labels = np.searchsorted(RESPONSE_TYPES, answers[usable])
    test = held_out_blocks(features, seed)
    for name, rows in (("training", ~test), ("held-out", test)):
        if len(np.unique(labels[rows])) < 2:
            raise DatasetError(f"the {name} rows hold one response type only; sweep a wider range or more points")

    centre, spread = features[~test].mean(axis=0), features[~test].std(axis=0)
    scaled = (features - centre) / spread
    waves = WAVE_SCALE * np.random.default_rng(seed).standard_normal((len(fields), WAVES))
    weights, biases = _fit_network(fourier_features(scaled[~test], waves), labels[~test], seed, progress)
    classifier = ResponseClassifier(weights, biases, centre, spread, waves, card={"fields": fields})
    predicted = {"network": classifier.predict_proba(values[test]).argmax(axis=1)}
    predicted |= _baselines(scaled[~test], labels[~test], scaled[test], seed)
    report = {
        "rows": {"training": int((~test).sum()), "held_out": int(test.sum())},
        "share_of_types": {
            name: float((labels == index).mean()) for index, name in enumerate(RESPONSE_TYPES)
        },
        "held_out": {name: _scores(labels[test], guess) for name, guess in predicted.items()},
    }  # fmt: skip
    card = {
        "machine": sweep.settings["machine"],
        "base": sweep.settings["base"],
        "fields": fields,
        "ranges": {name: [float(column.min()), float(column.max())]
                   for name, column in zip(fields, values.T, strict=True)},
        "label": {key: sweep.settings[key] for key in ("budget", "sampling", "axes", "type_reach")},
        "seed": seed,
        "version": __version__,
        "report": report,
    }  # fmt: skip
    return TrainingResult(replace(classifier, card=card), report)


def _fit_network(
    features: Array, labels: NDArray[np.int64], seed: int, progress: bool
) -> tuple[tuple[Array, ...], tuple[Array, ...]]:
    import torch

    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(seed)
    sizes = (features.shape[1], HIDDEN, HIDDEN, len(RESPONSE_TYPES))
    layers = [torch.nn.Linear(inputs, outputs, dtype=torch.float64)
              for inputs, outputs in pairwise(sizes)]  # fmt: skip
    with torch.no_grad():
        for layer in layers:
            torch.nn.init.xavier_uniform_(layer.weight, gain=5 / 3, generator=generator)
            torch.nn.init.zeros_(layer.bias)
    network = torch.nn.Sequential(layers[0], torch.nn.Tanh(), layers[1], torch.nn.Tanh(), layers[2])
    optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LEARNING_RATE, total_steps=UPDATES)
    inputs, targets = torch.from_numpy(features), torch.from_numpy(labels)
    for _ in trange(UPDATES, desc="train classifier", unit="update", disable=not progress, mininterval=1.0):
        rows = torch.randint(len(inputs), (BATCH,), generator=generator)
        optimiser.zero_grad()
        torch.nn.functional.cross_entropy(network(inputs[rows]), targets[rows]).backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    torch.set_num_threads(threads)
    weights = tuple(layer.weight.detach().numpy().T.copy() for layer in layers)
    return weights, tuple(layer.bias.detach().numpy().copy() for layer in layers)


def _baselines(features: Array, labels: NDArray[np.int64], test: Array, seed: int) -> dict[str, NDArray[np.int64]]:
    from sklearn.dummy import DummyClassifier
    from sklearn.ensemble import HistGradientBoostingClassifier
    from sklearn.linear_model import LogisticRegression
    from sklearn.neighbors import KNeighborsClassifier

    models = {
        "majority": DummyClassifier(),
        "logistic regression": LogisticRegression(max_iter=1000),
        "nearest neighbours": KNeighborsClassifier(n_neighbors=15),
        "gradient boosting": HistGradientBoostingClassifier(random_state=seed),
    }
    return {name: model.fit(features, labels).predict(test) for name, model in models.items()}


def _scores(truth: NDArray[np.int64], guess: NDArray[np.int64]) -> dict[str, float]:
    recalls = [float((guess[truth == kind] == kind).mean()) for kind in np.unique(truth)]
    return {"accuracy": float((guess == truth).mean()), "balanced_accuracy": float(np.mean(recalls))}


def report_table(report: dict[str, Any]) -> list[str]:
    """Lines of the comparison on held-out rows, for people."""
    rows = report["rows"]
    head = f"{rows['held_out']} held-out and {rows['training']} training points"
    return [
        f"{head:44s} accuracy  balanced",
        *(f"  {name:42s} {score['accuracy']:8.3f}  {score['balanced_accuracy']:8.3f}"
          for name, score in report["held_out"].items()),
    ]  # fmt: skip
