"""How is a small network evaluated without torch, and how is it trained with it?

Two hidden layers of rectified units, one score a class. It learns probabilities: those of labels, or what a teacher
says (``distilled``). Inference is numpy in single precision.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.kernels.scaling import fill_scaled

Array = NDArray[np.float64]
Single = NDArray[np.float32]

HIDDEN = 128
BATCH, EPOCHS = 512, 25
LEAST_UPDATES, MOST_UPDATES = 1000, 12_000
LEARNING_RATE, WEIGHT_DECAY = 3e-3, 0.05

LIMIT = 5.0
"""Scaled inputs are clipped here."""


class Network(NamedTuple):
    """Layers of one network.

    ``centre``, ``spread`` (n_features,) of the training features; ``weights``, ``biases`` of the layers: (n_in, n_out)
    and (n_out,).
    """

    centre: Single
    spread: Single
    weights: tuple[Single, ...]
    biases: tuple[Single, ...]


def network_scores(network: Network, features: Array) -> Array:
    """Scores (n_rows, n_classes) of features (n_rows, n_features); NaN counts as the mean."""
    layer = _scaled(network.centre, network.spread, features)
    for weight, bias in zip(network.weights[:-1], network.biases[:-1], strict=True):
        layer = layer @ weight
        layer += bias
        np.maximum(layer, 0.0, out=layer)
    return np.asarray(layer @ network.weights[-1] + network.biases[-1], dtype=float)


def _scaled(centre: Single, spread: Single, features: Array) -> Single:
    out = np.empty(features.shape, dtype=np.float32)
    fill_scaled(features, centre, spread, LIMIT, out)
    return out


def train_network(features: Array, targets: Array, seed: int) -> Network:
    """Train on features (n, n_features) and probabilities (n, n_classes); one thread: same seed, same weights."""
    import torch

    centre, spread = np.nanmean(features, axis=0), np.nanstd(features, axis=0)
    centre, spread = (column.astype(np.float32) for column in (centre, np.where(spread > 1e-12, spread, 1.0)))
    inputs = torch.from_numpy(_scaled(centre, spread, features))
    wanted = torch.from_numpy(targets.astype(np.float32))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    generator = torch.Generator().manual_seed(seed)
    layers = [
        torch.nn.Linear(before, after) for before, after in pairwise((inputs.shape[1], HIDDEN, HIDDEN, wanted.shape[1]))
    ]
    with torch.no_grad():
        for layer in layers:
            torch.nn.init.kaiming_uniform_(layer.weight, nonlinearity="relu", generator=generator)
            torch.nn.init.zeros_(layer.bias)
    network = torch.nn.Sequential(layers[0], torch.nn.ReLU(), layers[1], torch.nn.ReLU(), layers[2])
    updates = int(np.clip(EPOCHS * len(inputs) / BATCH, LEAST_UPDATES, MOST_UPDATES))
    optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LEARNING_RATE, total_steps=updates)
    for _ in range(updates):
        rows = torch.randint(len(inputs), (BATCH,), generator=generator)
        optimiser.zero_grad()
        torch.nn.functional.cross_entropy(network(inputs[rows]), wanted[rows]).backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    torch.set_num_threads(threads)
    return Network(
        centre,
        spread,
        tuple(layer.weight.detach().numpy().T.copy() for layer in layers),
        tuple(layer.bias.detach().numpy().copy() for layer in layers),
    )
