"""A sense of irregular motion: a small network of numpy on statistics of what was felt since the speed last changed.

It was trained on machines of a fleet at speeds that ripple, with the share of irregular cycles that the reward charges
(``agents/learn_sense.py``). It sees peaks of one surface, impacts and bouncing, with the errors of their sensors.
"""

from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.classifier.storage import read_model, shipped_file, write_model
from chaosgym.errors import ModelFileError

RECENT = 10
"""Cycles that are needed, and whose statistics are told beside those of all cycles."""

LAGS = (1, 2, 3, 4, 6, 8)
"""Cycles after which peaks are compared."""

_OF_PEAKS = ("mean", "deviation", "least", "largest", *(f"missed after {lag}" for lag in LAGS))

FORCES = tuple(f"{name}, {part}" for part in ("all", "recent") for name in _OF_PEAKS)

STATISTICS = ("speed", "cycles", "sensor error", *FORCES, "impacts", "bouncing", "last impacts", "last bouncing")
"""What it sees, in order; forces in N."""

LARGEST = 5.0
"""Statistics are cut off here, in standard deviations from their mean in training."""

_FORCES = slice(2, 3 + len(FORCES))


class Sense(NamedTuple):
    """A network with two layers of rectified units.

    ``floor`` is added to forces before their logarithm [N]; ``mean`` and ``deviation`` (entries,) are of what it was
    trained on; ``weights`` are arrays (outputs, inputs) and ``biases`` (outputs,) of each layer.
    """

    floor: float
    mean: Array
    deviation: Array
    weights: tuple[Array, ...]
    biases: tuple[Array, ...]

    def prepared(self, statistics: Array) -> Array:
        """What the network takes, (n, entries), of statistics (n, entries)."""
        return ((logarithms(statistics, self.floor) - self.mean) / self.deviation).clip(-LARGEST, LARGEST)

    def __call__(self, statistics: Array) -> Array:
        """How likely a cycle of the last step is irregular, (n,) from 0 to 1, by ``STATISTICS`` (n, entries)."""
        values = self.prepared(statistics)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            values = np.maximum(values @ weight.T + bias, 0.0)
        return np.asarray(0.5 + 0.5 * np.tanh(0.5 * (values @ self.weights[-1].T + self.biases[-1])[:, 0]))


def logarithms(statistics: Array, floor: float) -> Array:
    """Statistics (n, entries) with the logarithms of the forces."""
    values = np.array(statistics, float)
    values[:, _FORCES] = np.log(values[:, _FORCES] + floor)
    return values


def save_sense(sense: Sense, card: dict[str, Any], path: str | Path) -> None:
    """Write a sense into a file; nothing in it is executed when it is read."""
    write_model(path, card, {"sense": sense._asdict()})


def load_sense(path: str | Path) -> Sense:
    """Read what ``save_sense`` wrote.

    Raises
    ------
    ModelFileError
        If it is missing, damaged, of another version, does not match its hash, or its parts do not fit each other.
    """
    _, parts = read_model(path)
    try:
        sense = Sense(**parts["sense"])
        told = sense(np.ones((1, len(STATISTICS))))
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise ModelFileError(f"{path} can't be read as a sense: {error!r}") from error
    if told.shape != (1,) or not np.isfinite(told).all() or len(sense.mean) != len(STATISTICS):
        raise ModelFileError(f"{path} does not tell a probability of {len(STATISTICS)} statistics")
    return sense


def has_sense(machine_name: str) -> bool:
    """Whether a sense is shipped for a machine."""
    return shipped_file(f"{machine_name}-sense").is_file()


@lru_cache
def shipped_sense(machine_name: str) -> Sense:
    """Return the sense that is shipped for a machine, by the name of the machine on the command line.

    Raises
    ------
    ModelFileError
        If none is shipped for it.

    Examples
    --------
    >>> from chaosgym.envs.sense import shipped_sense
    >>> len(shipped_sense("impact-beam").weights)
    3
    """
    if not has_sense(machine_name):
        raise ModelFileError(f"no sense is shipped for {machine_name}; train one with agents/learn_sense.py")
    return load_sense(shipped_file(f"{machine_name}-sense"))
