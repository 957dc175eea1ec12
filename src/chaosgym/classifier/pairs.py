"""Which pairs of type and nature occur, and how sure is a classifier of each?

A chaotic response is Type III. Learning pairs such as (III, chaotic) keeps the probabilities of types and of natures
from contradicting each other.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.calibration import best_temperature
from chaosgym.classifier.kernels.pairs import fill_chances

Array = NDArray[np.float64]
Labels = NDArray[np.int64]

ELSEWHERE = -1e9
"""Score of a type that does not occur with a nature."""


class Pairs(NamedTuple):
    """Pairs that occur.

    ``types``, ``natures``: names; ``type_of``, ``nature_of`` (n_pairs,) their numbers; ``temperatures`` (2,) that
    divide the scores of natures, and of the types of a nature.
    """

    types: NDArray[Any]
    natures: NDArray[Any]
    type_of: Labels
    nature_of: Labels
    temperatures: Array

    def chances(self, scores: Array) -> Array:
        """Probabilities (n, n_pairs) of scores (n, n_pairs)."""
        out = np.empty_like(scores)
        fill_chances(scores, self.nature_of, self.temperatures, out)
        return out

    def numbers(self, types: NDArray[Any], natures: NDArray[Any]) -> Labels:
        """Number of the pair of each row's type and nature, (n,) each, all of which are known."""
        key = np.searchsorted(self.natures, natures) * len(self.types) + np.searchsorted(self.types, types)
        return np.searchsorted(self.nature_of * len(self.types) + self.type_of, key)

    def types_from(self, chances: Array) -> Array:
        """Probabilities of types (n, n_types) from those of pairs (n, n_pairs)."""
        return _pooled(chances, self.type_of)

    def natures_from(self, chances: Array) -> Array:
        """Probabilities of natures (n, n_natures) from those of pairs (n, n_pairs)."""
        return _pooled(chances, self.nature_of)

    def calibrated(self, scores: Array, pair: Labels) -> "Pairs":
        """The same pairs with the temperatures that make the pairs (n,) most likely by their scores (n, n_pairs)."""
        top = scores.max(axis=1, keepdims=True)
        natures = np.log(_pooled(np.exp(scores - top), self.nature_of).clip(1e-300))
        nature = self.nature_of[pair]
        types = np.where(self.nature_of[None, :] == nature[:, None], scores - top, ELSEWHERE)
        several = np.bincount(self.nature_of)[nature] > 1
        found = [
            best_temperature(natures, nature) if natures.shape[1] > 1 else 1.0,
            best_temperature(types[several], pair[several]) if several.any() else 1.0,
        ]
        return self._replace(temperatures=np.array(found))


def pairs_of(types: NDArray[Any], natures: NDArray[Any]) -> tuple[Pairs, Labels]:
    """Pairs that occur among types and natures, (n,) each, and the number of each row's pair (n,)."""
    kinds, type_of = np.unique(types, return_inverse=True)
    kinds_of_nature, nature_of = np.unique(natures, return_inverse=True)
    found, pair = np.unique(nature_of * len(kinds) + type_of, return_inverse=True)
    natures_of_pairs, types_of_pairs = np.divmod(found, len(kinds))
    return Pairs(kinds, kinds_of_nature, types_of_pairs, natures_of_pairs, np.ones(2)), np.asarray(pair)


def _pooled(chances: Array, group_of: Labels) -> Array:
    """Sums of the probabilities of pairs (n, n_pairs) over the pairs of each group, (n, n_groups)."""
    pooled = np.zeros((len(chances), int(group_of.max()) + 1))
    for pair, group in enumerate(group_of):
        pooled[:, group] += chances[:, pair]
    return pooled
