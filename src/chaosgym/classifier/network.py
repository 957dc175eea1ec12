"""How are a few small networks evaluated without torch, and how are they trained with it?

Random Fourier features (Rahimi and Recht 2007; Tancik et al. 2020), two hidden layers with tanh, one score a class. The
scores of an ensemble are averaged. Inference is numpy in single precision.
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Single = NDArray[np.float32]

WAVES, WAVE_SCALE = 96, 0.15
HIDDEN = 96
BATCH, EPOCHS, LEAST_UPDATES, MOST_UPDATES = 512, 40, 2000, 6000
LEARNING_RATE = 4e-3
WEIGHT_DECAY = 0.05


class Network(NamedTuple):
    """Networks of one shape, stacked along the first axis of every array.

    ``centre``, ``spread`` (n_features,) of the training features; ``waves`` (members, n_features, n_waves);
    ``weights`` and ``biases`` of the layers: (members, n_in, n_out) and (members, 1, n_out).
    """

    centre: Array
    spread: Array
    waves: Single
    weights: tuple[Single, ...]
    biases: tuple[Single, ...]


def network_scores(network: Network, features: Array) -> Array:
    """Mean scores (n_rows, n_classes) of the members for features (n_rows, n_features); NaN counts as the mean."""
    scaled = ((features - network.centre) / network.spread).astype(np.float32)
    np.nan_to_num(scaled, copy=False, nan=0.0)
    total: Array | None = None
    for member in range(len(network.waves)):
        layer = fourier_features(scaled, network.waves[member])
        for weight, bias in zip(network.weights[:-1], network.biases[:-1], strict=True):
            layer = layer @ weight[member]
            layer += bias[member]
            np.tanh(layer, out=layer)
        scores = layer @ network.weights[-1][member] + network.biases[-1][member]
        total = scores.astype(float) if total is None else total + scores
    assert total is not None
    return total / len(network.waves)


def fourier_features(scaled: Single, waves: Single) -> Single:
    """Scaled inputs (n, n_features) beside the sines and cosines of their waves, (n, n_features + 2 n_waves)."""
    count, width = scaled.shape[1], waves.shape[1]
    out = np.empty((len(scaled), count + 2 * width), dtype=np.float32)
    out[:, :count] = scaled
    phase = scaled @ waves
    np.sin(phase, out=out[:, count : count + width])
    np.cos(phase, out=out[:, count + width :])
    return out


def train_networks(features: Array, labels: NDArray[np.int64], classes: int, members: int, seed: int) -> Network:
    """Train an ensemble on features (n, n_features) and class numbers (n,).

    One thread, so that the same seed gives the same weights.
    """
    import torch

    centre, spread = np.nanmean(features, axis=0), np.nanstd(features, axis=0)
    spread = np.where(spread > 1e-12, spread, 1.0)
    scaled = np.nan_to_num((features - centre) / spread).astype(np.float32)
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    trained = []
    for member in range(members):
        trained.append(_train_one(scaled, labels, classes, seed + 1000 * member))
    torch.set_num_threads(threads)
    waves, weights, biases = zip(*trained, strict=True)
    return Network(
        centre, spread, np.stack(waves),
        tuple(np.stack(layer) for layer in zip(*weights, strict=True)),
        tuple(np.stack(layer) for layer in zip(*biases, strict=True)),
    )  # fmt: skip


def _train_one(
    scaled: Single, labels: NDArray[np.int64], classes: int, seed: int
) -> tuple[Single, list[Single], list[Single]]:
    import torch

    generator = torch.Generator().manual_seed(seed)
    waves = (2.0 * np.pi * WAVE_SCALE * np.random.default_rng(seed).standard_normal((scaled.shape[1], WAVES))).astype(
        np.float32
    )
    inputs, targets = torch.from_numpy(fourier_features(scaled, waves)), torch.from_numpy(labels)
    sizes = (inputs.shape[1], HIDDEN, HIDDEN, classes)
    layers = [torch.nn.Linear(before, after) for before, after in pairwise(sizes)]
    with torch.no_grad():
        for layer in layers:
            torch.nn.init.xavier_uniform_(layer.weight, gain=5 / 3, generator=generator)
            torch.nn.init.zeros_(layer.bias)
    network = torch.nn.Sequential(layers[0], torch.nn.Tanh(), layers[1], torch.nn.Tanh(), layers[2])
    updates = int(np.clip(EPOCHS * len(scaled) / BATCH, LEAST_UPDATES, MOST_UPDATES))
    optimiser = torch.optim.AdamW(network.parameters(), lr=LEARNING_RATE, weight_decay=WEIGHT_DECAY)
    schedule = torch.optim.lr_scheduler.OneCycleLR(optimiser, LEARNING_RATE, total_steps=updates)
    for _ in range(updates):
        rows = torch.randint(len(inputs), (BATCH,), generator=generator)
        optimiser.zero_grad()
        torch.nn.functional.cross_entropy(network(inputs[rows]), targets[rows]).backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
    weights = [layer.weight.detach().numpy().T.copy() for layer in layers]
    return waves, weights, [layer.bias.detach().numpy()[None, :].copy() for layer in layers]
