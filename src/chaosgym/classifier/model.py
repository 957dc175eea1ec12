"""Which response type does a machine have, to the best of a trained network's knowledge?

Inference is a few matrix products in numpy: neither torch nor scikit-learn is imported. A model file is a plain .npz
with a JSON card inside; nothing in it is executed on loading, and its arrays are checked against their hash.
"""

import hashlib
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.errors import ModelFileError, ParameterError
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of

Array = NDArray[np.float64]

RESPONSE_TYPES = ("I", "II", "III")
"""Classes in the order of the probabilities."""

FORMAT = 1
"""Version of the model file."""


@dataclass(frozen=True)
class Classification:
    """Answer for one machine: the most probable type and the probability of each."""

    response_type: str
    probabilities: dict[str, float]


def fourier_features(scaled: Array, waves: Array) -> Array:
    """Scaled inputs (n, n_fields) followed by the sines and cosines of their waves, (n, n_fields + 2 n_waves)."""
    phase = 2.0 * np.pi * scaled @ waves
    return np.concatenate([scaled, np.sin(phase), np.cos(phase)], axis=1)


@dataclass(frozen=True)
class ResponseClassifier:
    """A trained network from machine parameters to the probabilities of Types I, II and III.

    Attributes
    ----------
    weights, biases : tuples of (n_in, n_out) and (n_out,)
        Layers; tanh between them, softmax at the end.
    centre, spread : (n_fields,)
        Mean and standard deviation of the logarithms of the fields in training.
    waves : (n_fields, n_waves)
        Frequencies of the sines and cosines that the first layer sees beside the scaled logarithms, so that it can
        follow the stripes of the map (random Fourier features: Rahimi and Recht 2007; Tancik et al. 2020).
    card
        What the model was trained on and how good it is: machine, base parameters, features, ranges, metrics ...
    """

    weights: tuple[Array, ...]
    biases: tuple[Array, ...]
    centre: Array
    spread: Array
    waves: Array
    card: Mapping[str, Any]

    @property
    def fields(self) -> tuple[str, ...]:
        """Machine fields that are the inputs, each by its logarithm."""
        return tuple(self.card["fields"])

    def predict_proba(self, values: Array) -> Array:
        """Probabilities (n, 3) of the types for parameter values (n, n_fields) in SI units."""
        layer = fourier_features((np.log(np.asarray(values, dtype=float)) - self.centre) / self.spread, self.waves)
        for weight, bias in zip(self.weights[:-1], self.biases[:-1], strict=True):
            layer = np.tanh(layer @ weight + bias)
        scores = layer @ self.weights[-1] + self.biases[-1]
        scores = np.exp(scores - scores.max(axis=1, keepdims=True))
        return np.asarray(scores / scores.sum(axis=1, keepdims=True))

    def predict(self, values: Array) -> NDArray[np.str_]:
        """Most probable type (n,) for parameter values (n, n_fields) in SI units."""
        predicted: NDArray[np.str_] = np.array(RESPONSE_TYPES)[self.predict_proba(values).argmax(axis=1)]
        return predicted

    def classify(self, machine: Machine) -> Classification:
        """Classify one machine.

        Raises
        ------
        ParameterError
            If the machine differs from the training machines in a parameter that was not varied there, or lies outside
            the range of one that was. The classifier does not guess.
        """
        if machine.name != self.card["machine"]:
            raise ParameterError(f"this classifier knows {self.card['machine']}, not {machine.name}")
        for name in parameters_of(machine):
            value = getattr(machine, name)
            if name in self.fields:
                low, high = self.card["ranges"][name]
                if not low <= value <= high:
                    unit = parameters_of(machine)[name].unit
                    raise ParameterError(
                        f"{name} = {value:g} {unit} is outside what the classifier was trained on; "
                        f"allowed: {low:g} to {high:g} {unit}"
                    )
                continue
            # a field that is younger than the classifier had its default value then
            trained = self.card["base"].get(name, getattr(type(machine), name))
            if value != trained:
                raise ParameterError(
                    f"{name} = {value} differs from the classifier's training machine; allowed: "
                    f"{trained}. Use `chaosgym diagnose`, or train a classifier on such machines"
                )
        row = np.array([[getattr(machine, name) for name in self.fields]])
        chances = self.predict_proba(row)[0]
        return Classification(
            RESPONSE_TYPES[int(chances.argmax())], dict(zip(RESPONSE_TYPES, chances.tolist(), strict=True))
        )

    def save(self, path: str | Path) -> None:
        """Write the model file."""
        from chaosgym.files import write_atomically

        arrays = self._arrays()
        card = {**self.card, "format": FORMAT, "layers": len(self.weights), "sha256": _digest(arrays)}
        buffer = io.BytesIO()
        np.savez(buffer, card=np.frombuffer(json.dumps(card, sort_keys=True).encode(), dtype=np.uint8), **arrays)
        write_atomically(Path(path), lambda temporary: temporary.write_bytes(buffer.getvalue()))

    def _arrays(self) -> dict[str, Any]:
        arrays: dict[str, Any] = {"centre": self.centre, "spread": self.spread, "waves": self.waves}
        for layer, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            arrays[f"weight{layer}"] = weight
            arrays[f"bias{layer}"] = bias
        return arrays

    @classmethod
    def load(cls, path: str | Path) -> "ResponseClassifier":
        """Read a model file.

        Raises
        ------
        ModelFileError
            If it is missing, damaged, of another version, or its arrays do not match their hash.
        """
        try:
            with np.load(io.BytesIO(Path(path).read_bytes()), allow_pickle=False) as held:
                arrays = {name: held[name] for name in held.files if name != "card"}
                card = json.loads(held["card"].tobytes())
            if card["format"] != FORMAT:
                raise ModelFileError(f"{path} has format {card['format']}; this version reads format {FORMAT}")
            if card["sha256"] != _digest(arrays):
                raise ModelFileError(f"{path} is damaged: its arrays do not match their hash")
            layers = range(card["layers"])
            return cls(
                weights=tuple(arrays[f"weight{layer}"] for layer in layers),
                biases=tuple(arrays[f"bias{layer}"] for layer in layers),
                centre=arrays["centre"],
                spread=arrays["spread"],
                waves=arrays["waves"],
                card=card,
            )
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            if isinstance(error, ModelFileError):
                raise
            raise ModelFileError(f"{path} can't be read as a classifier: {error}") from error


def _digest(arrays: Mapping[str, Any]) -> str:
    digest = hashlib.sha256()
    for name in sorted(arrays):
        digest.update(name.encode())
        digest.update(np.ascontiguousarray(arrays[name], dtype="<f8").tobytes())
    return digest.hexdigest()


@lru_cache
def default_classifier(machine_name: str) -> ResponseClassifier:
    """Return the classifier that is shipped for a machine.

    Raises
    ------
    ModelFileError
        If none is shipped for it.
    """
    path = resources.files("chaosgym") / "weights" / f"{machine_name}.npz"
    if not path.is_file():
        raise ModelFileError(f"no classifier is shipped for {machine_name}; train one with `chaosgym train-classifier`")
    with resources.as_file(path) as file:
        return ResponseClassifier.load(file)
