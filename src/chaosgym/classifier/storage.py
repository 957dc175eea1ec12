"""Model files: plain arrays in one .npz with a JSON description; nothing in it is executed.

The hash covers the arrays and the description, model card included.
"""

import hashlib
import io
import json
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.classifier.parameter_features import ParameterScaling, SwingTable
from chaosgym.classifier.trees import Forest
from chaosgym.errors import ModelFileError
from chaosgym.files import DAMAGE, contents, unpacked, write_atomically

FORMAT = 4
"""Version of the model file."""

LARGEST = 50_000_000
"""Bytes that a model file may have, unpacked."""

_KINDS: Mapping[str, Any] = {kind.__name__: kind for kind in (Forest, ParameterScaling, SwingTable)}
"""Values that a file may hold beside arrays, numbers, words, tuples and None."""


def write_model(path: str | Path, card: Mapping[str, Any], parts: Mapping[str, Mapping[str, Any]]) -> None:
    """Write named parts, each a mapping of fitted attributes, and a model card."""
    arrays: dict[str, Any] = {}
    described = {
        name: {key: _describe(value, f"{name}.{key}", arrays) for key, value in part.items()}
        for name, part in parts.items()
    }
    head: dict[str, Any] = {"format": FORMAT, "card": card, "parts": described}
    head["sha256"] = model_hash(head, arrays)
    buffer = io.BytesIO()
    text = np.frombuffer(json.dumps(head, sort_keys=True).encode(), dtype=np.uint8)
    np.savez_compressed(buffer, head=text, **arrays)
    write_atomically(Path(path), lambda temporary: temporary.write_bytes(buffer.getvalue()))


def read_model(path: str | Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """Read what ``write_model`` wrote: the card, with the file's hash as "sha256", and the parts.

    Raises
    ------
    ModelFileError
        If the file is missing, damaged, of another version, or does not match its hash.
    """
    try:
        arrays = unpacked(contents(path, LARGEST), LARGEST)
        card = arrays.pop("card", None)
        head = json.loads((arrays.pop("head") if "head" in arrays else card).tobytes())
        if head["format"] != FORMAT:
            raise ModelFileError(
                f"{path} has format {head['format']}; this version reads format {FORMAT}: "
                "train again with `chaosgym train-classifier`"
            )
        if head["sha256"] != model_hash(head, arrays):
            raise ModelFileError(f"{path} is damaged: its content does not match its hash")
        parts = {
            name: {key: _restore(value, arrays) for key, value in part.items()} for name, part in head["parts"].items()
        }
        return {**head["card"], "sha256": head["sha256"]}, parts
    except DAMAGE as error:
        if isinstance(error, ModelFileError):
            raise
        raise ModelFileError(f"{path} can't be read as a classifier: {error}") from error


def shipped_file(name: str) -> Path:
    """Return the model file of a name that comes with the package, whether it exists or not."""
    return Path(str(resources.files("chaosgym"))) / "weights" / f"{name}.npz"


def model_hash(head: Mapping[str, Any], arrays: Mapping[str, Any]) -> str:
    """SHA-256 of description and arrays."""
    described = {name: value for name, value in head.items() if name != "sha256"}
    digest = hashlib.sha256(json.dumps(described, sort_keys=True).encode())
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        digest.update(f"{name} {array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _describe(value: Any, name: str, arrays: dict[str, Any]) -> Any:
    """JSON description of a value; its arrays go to ``arrays``."""
    if isinstance(value, np.ndarray):
        if value.dtype.kind in "OU":
            return {"words": [str(word) for word in value]}
        arrays[name] = value
        return {"array": name}
    if type(value).__name__ in _KINDS:
        fields = {key: _describe(field, f"{name}.{key}", arrays) for key, field in value._asdict().items()}
        return {"kind": type(value).__name__, "fields": fields}
    if isinstance(value, tuple):
        return {"tuple": [_describe(item, f"{name}.{place}", arrays) for place, item in enumerate(value)]}
    return {"plain": value}


def _restore(described: Mapping[str, Any], arrays: Mapping[str, Any]) -> Any:
    if "words" in described:
        return np.array(described["words"])
    if "array" in described:
        return arrays[described["array"]]
    if "tuple" in described:
        return tuple(_restore(item, arrays) for item in described["tuple"])
    if "kind" in described:
        fields = {key: _restore(field, arrays) for key, field in described["fields"].items()}
        return _KINDS[described["kind"]](**fields)
    return described["plain"]
