"""Does an input resemble anything that was trained on? Ranges for parameters, nearest neighbours for records.

A record is far away if its figures lie further from those of the nearest kept training records than all but a few
training records do from the records of other machines, or if one figure lies beyond its range in training.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.kernels.nearest import nearest

Array = NDArray[np.float64]

PROTOTYPES = 2000
"""Training rows that are kept to compare with."""

LIMIT = 6.0
"""Scaled figures are clipped here, so that a single one can't decide by its tail."""

BANDS = 4
"""Lengths of record with a threshold of their own."""

FALSE_REFUSALS = 0.025
"""Share of the training rows that are told apart by mistake."""


class Neighbourhood(NamedTuple):
    """Kept training rows.

    ``centre``, ``spread`` (n_features,); ``low``, ``high`` (n_features,) range in training with a tenth more on both
    sides; ``prototypes`` (n_kept, n_features) scaled; ``thresholds`` (n_bands,) largest usual distance for values of
    the first feature, the length of the record, between ``edges`` (n_bands - 1,).
    """

    centre: Array
    spread: Array
    low: Array
    high: Array
    prototypes: Array
    edges: Array
    thresholds: Array


def neighbourhood(features: Array, groups: NDArray[np.int64], seed: int) -> Neighbourhood:
    """Keep rows of features (n, n_features) and find the usual distance to rows of other groups (n,)."""
    generator = np.random.default_rng(seed)
    centre = np.nan_to_num(np.nanmedian(features, axis=0))
    spread = np.nanpercentile(features, 84.0, axis=0) - np.nanpercentile(features, 16.0, axis=0)
    spread = np.where(np.nan_to_num(spread) > 1e-9, 0.5 * spread, 1.0)
    low, high = np.nanmin(features, axis=0), np.nanmax(features, axis=0)
    room = 0.1 * (high - low)
    none = np.empty((0, len(centre)))
    edges = np.quantile(features[:, 0], np.arange(1, BANDS) / BANDS)
    whole = Neighbourhood(centre, spread, low - room, high + room, none, edges, np.full(BANDS, np.inf))
    parts = np.unique(groups)
    held = np.isin(groups, generator.permutation(parts)[: max(1, len(parts) // 5)])
    if held.all():
        held = generator.random(len(groups)) < 0.2
    known = whole._replace(prototypes=_drawn(features[~held], whole, generator))
    tried = _some(features[held], generator)
    distances, band = novelty(known, tried), np.searchsorted(edges, tried[:, 0])
    thresholds = [
        np.quantile(distances[band == i], 1.0 - FALSE_REFUSALS) if np.any(band == i) else np.inf for i in range(BANDS)
    ]
    return whole._replace(prototypes=_drawn(features, whole, generator), thresholds=np.array(thresholds))


def is_novel(kept: Neighbourhood, features: Array) -> NDArray[np.bool_]:
    """Whether rows (n, n_features) lie further away than is usual for their length, (n,)."""
    return novelty(kept, features) > kept.thresholds[np.searchsorted(kept.edges, features[:, 0])]


def _some(features: Array, generator: np.random.Generator) -> Array:
    return features[generator.permutation(len(features))[:PROTOTYPES]]


def _drawn(features: Array, scale: Neighbourhood, generator: np.random.Generator) -> Array:
    return _scaled(_some(features, generator), scale.centre, scale.spread).astype(np.float32).astype(float)


def novelty(kept: Neighbourhood, features: Array) -> Array:
    """Distance (n,) of rows to the nearest kept row, root mean square over the figures; infinite beyond a range."""
    distances = nearest(_scaled(features, kept.centre, kept.spread), kept.prototypes)
    with np.errstate(invalid="ignore"):
        beyond = ((features < kept.low) | (features > kept.high)).any(axis=1)
    return np.where(beyond, np.inf, distances)


def _scaled(features: Array, centre: Array, spread: Array) -> Array:
    return np.asarray(np.clip((features - centre) / spread, -LIMIT, LIMIT))
