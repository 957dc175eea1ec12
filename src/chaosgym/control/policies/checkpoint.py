"""Checkpoint of a training run: one file, whole or not there, that only its own user's programs load.

What stable-baselines3 saves is a pickle, and reading one may run anything. So a checkpoint begins with a keyed hash of
the rest. The key is made at random for each user; a file that anybody else wrote is refused before it is read.

The checkpoint holds model, environments and random numbers, so that a run that goes on equals one that never stopped.
"""

import hmac
import io
import os
import pickle
import random
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import ModelFileError
from chaosgym.files import claimed, contents, held, write_atomically

CHECKPOINT = "checkpoint.bin"

LARGEST = 4_000_000_000
"""Bytes that a checkpoint may have, replay buffer included."""

DIGEST = "sha256"

SIZE = 32
"""Bytes of the keyed hash, and of the key."""

BY_CLASS = ("venv", "class_attributes")
"""Attributes of a wrapper that another object of its class has too."""

UNSAVED = ("_last_lstm_states", "replay_buffer", "action_space")
"""Attributes of a model that ``save`` leaves out, or ``load`` seeds anew, of those algorithms that have them."""


@contextmanager
def run_folder(folder: Path) -> Iterator[None]:
    """Keep the folder of a training run for this process: new, empty, or begun by a run before.

    Raises
    ------
    DatasetError
        If it holds anything else. Nothing in it is touched.
    UnfinishedError
        If another process writes into it.
    """
    with held(claimed(folder, CHECKPOINT, "policy.json", what="folder of a training run")):
        yield


def save_checkpoint(folder: Path, model: Any, kept: Any = None) -> None:
    """Write a checkpoint of a model of stable-baselines3 with its environments.

    Parameters
    ----------
    folder
        Where it is written.
    model
        At the start of a rollout: nothing is collected that the model has not learned from.
    kept
        What else the run needs to go on; anything that pickle takes.
    """
    import torch

    file = io.BytesIO()
    model.save(file)
    state = {
        "model": file.getvalue(),
        "unsaved": {name: getattr(model, name) for name in UNSAVED if hasattr(model, name)},
        "envs": [{key: value for key, value in vars(env).items() if key not in BY_CLASS} for env in _layers(model.env)],
        "random": (random.getstate(), np.random.get_state(), torch.get_rng_state()),  # noqa: NPY002
        "kept": kept,
    }
    content = pickle.dumps(state)
    signed = _keyed_hash(content) + content
    write_atomically(folder / CHECKPOINT, lambda temporary: temporary.write_bytes(signed))


def load_checkpoint(folder: Path, kind: Any, envs: Any) -> tuple[Any, Any] | None:
    """Model of a checkpoint and what else was kept; None if the folder has none.

    Parameters
    ----------
    folder
        Where it was written.
    kind
        Class of the model.
    envs
        New environments, made as those that it was trained in; they are put where those were.

    Raises
    ------
    ModelFileError
        If the file is damaged, was written by another user or on another computer, or the environments differ.
    """
    import torch

    path = folder / CHECKPOINT
    if not path.exists():
        return None
    try:
        signed = contents(path, LARGEST)
    except ValueError as error:
        raise ModelFileError(f"{path} {error}") from None
    if not hmac.compare_digest(signed[:SIZE], _keyed_hash(signed[SIZE:])):
        raise ModelFileError(
            f"{path} is damaged, or was not written by this user on this computer; it is a pickle and may hold "
            "anything, so it is not read: choose another folder to start anew"
        )
    state = pickle.loads(signed[SIZE:])
    try:
        model = kind.load(io.BytesIO(state["model"]), envs, device="cpu", force_reset=False)
    except ValueError:  # of stable-baselines3, where spaces differ
        raise ModelFileError(
            f"{folder} was trained in an environment with other observations or actions; allowed: the same machine "
            "and --keywords"
        ) from None
    for env, values in zip(_layers(model.env), state["envs"], strict=True):
        vars(env).update(values)
    vars(model).update(state["unsaved"])
    random.setstate(state["random"][0])
    np.random.set_state(state["random"][1])  # noqa: NPY002
    torch.set_rng_state(state["random"][2])
    return model, state["kept"]


def _layers(envs: Any) -> Iterator[Any]:
    """The environments and all that they wrap."""
    while envs is not None:
        yield envs
        envs = vars(envs).get("venv")


def _keyed_hash(content: bytes) -> bytes:
    return hmac.digest(_key(), content, DIGEST)


def _key() -> bytes:
    """Key of this user, made at random when it is first needed."""
    base = os.environ.get("XDG_STATE_HOME") or os.path.expanduser("~/.local/state")
    path = Path(base) / "chaosgym" / "checkpoint.key"
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        write_atomically(path, lambda temporary: _write_secret(temporary, secrets.token_bytes(SIZE)))
    return path.read_bytes()


def _write_secret(path: Path, content: bytes) -> None:
    with os.fdopen(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600), "wb") as file:
        file.write(content)
