"""What training scripts share: the folder of a run, its rows of progress, and its checkpoint.

A checkpoint is one file, whole or not there, that only its own user's programs load.

What stable-baselines3 saves is a pickle, and reading one may run anything. So a checkpoint begins with a keyed hash of
the rest. The key is made at random for each user; a file that anybody else wrote is refused before it is read.

The checkpoint holds model, environments and random numbers, so that a run that goes on equals one that never stopped.
"""

import argparse
import hmac
import io
import json
import os
import pickle
import random
import secrets
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from chaosgym.errors import ChaosgymError, ModelFileError
from chaosgym.files import claimed, contents, held, unpacked, write_atomically

try:
    import torch
    from stable_baselines3.common.callbacks import BaseCallback

    version("sb3-contrib")
except ImportError as missing:
    sys.exit(f"Error: training needs the extra [learn]: pip install '.[learn]' in a clone of chaosgym ({missing})")

Array = NDArray[Any]

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


ROW = ("step", "return", "type_iii", "deviation", "processor_seconds")
"""Columns of progress."""


def keywords(text: str) -> dict[str, Any]:
    """Keywords that an object of JSON names."""
    return dict(json.loads(text))


def run(train: Callable[[argparse.Namespace], None], asked: argparse.Namespace) -> None:
    """Train in a folder that is new, empty, or begun by a run before; say in one line what stops that."""
    torch.set_num_threads(1)
    try:
        with held(claimed(asked.out, CHECKPOINT, "policy.json", what="folder of a training run")):
            train(asked)
    except ChaosgymError as error:
        print(f"Error: {error}", file=sys.stderr)
        sys.exit(2)


def write_rows(folder: Path, rows: list[tuple[Any, ...]]) -> None:
    """Write progress.csv."""
    text = "".join(",".join(map(str, row)) + "\n" for row in rows)
    write_atomically(folder / "progress.csv", lambda path: path.write_text(text))


class Progress(BaseCallback):
    """Writes a row and a checkpoint every so many steps, when the model has learned from all that was collected."""

    def __init__(self, asked: argparse.Namespace, kept: dict[str, Any] | None) -> None:
        super().__init__()
        self.asked = asked
        self.kept = kept or {"rows": [ROW], "jobs": [], "sums": np.zeros((3, asked.envs)), "last": 0, "seconds": 0.0}
        self.began = time.process_time() - self.kept["seconds"]

    def _on_training_start(self) -> None:
        steps = self.model.num_timesteps
        if steps > 0:  # a folder without a checkpoint is no run: it stays empty until the first
            write_rows(self.asked.out, self.kept["rows"])
        self.bar = tqdm(total=self.asked.steps, initial=steps, unit="step", desc=self.asked.out.name)

    def _on_step(self) -> bool:
        self.bar.update(self.num_timesteps - self.bar.n)
        sums = self.kept["sums"]
        for i, info in enumerate(self.locals["infos"]):
            sums[:, i] += 1.0, info["type_iii"], info["deviation"]
            if "episode" in info:
                steps, type_iii, deviation = sums[:, i]
                self.kept["jobs"].append((info["episode"]["r"], type_iii / steps, deviation / steps))
                sums[:, i] = 0.0
        return True

    def _on_rollout_start(self) -> None:
        if self.model.num_timesteps - self.kept["last"] >= self.asked.every:
            self._save()

    def _on_training_end(self) -> None:
        self.bar.close()
        self._save()

    def _save(self) -> None:
        self.kept |= {"last": self.model.num_timesteps, "seconds": time.process_time() - self.began}
        if self.kept["jobs"]:
            means = np.round(np.mean(self.kept["jobs"], axis=0), 4)
            self.kept["rows"].append((self.kept["last"], *means.tolist(), round(self.kept["seconds"])))
            self.kept["jobs"] = []
        save_checkpoint(self.asked.out, self.model, self.kept)
        write_rows(self.asked.out, self.kept["rows"])


def keep_arrays(folder: Path, arrays: dict[str, Array]) -> None:
    """Write arrays as the checkpoint of a run without a model."""
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    write_atomically(folder / CHECKPOINT, lambda path: path.write_bytes(buffer.getvalue()))


def kept_arrays(folder: Path) -> dict[str, Array]:
    """Arrays of such a checkpoint; none where there is none.

    Raises
    ------
    ModelFileError
        If the file is none of this kind.
    """
    path = folder / CHECKPOINT
    try:
        return dict(unpacked(contents(path, LARGEST), LARGEST)) if path.exists() else {}
    except ValueError as error:
        raise ModelFileError(f"{path} {error}") from None


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
    before = state["envs"][0].get("num_envs")
    if before is not None and before != envs.num_envs:
        raise ModelFileError(f"{folder} was trained on {before} machines side by side; give --envs {before}")
    try:
        model = kind.load(io.BytesIO(state["model"]), envs, device="cpu", force_reset=False)
    except ValueError:  # of stable-baselines3, where spaces differ
        raise ModelFileError(
            f"{folder} was trained in an environment with other observations or actions; allowed: the same machine, "
            "--keywords and --memory"
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
