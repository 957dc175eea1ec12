"""How does a trained policy decide? Observation in, action out, by numpy alone.

policy = load_policy("runs/ppo-beam")    # a folder with policy.json and weights.npz
policy.reset()                           # at the start of each job
action = policy(observation)
"""

import json
import zipfile
from dataclasses import dataclass, field
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from chaosgym.control.learner_view import BeliefMemory, Memory, SpeedMemory, commanded, memory_of
from chaosgym.control.policies.network import Dense, Lstm, Network, State
from chaosgym.envs import ENVIRONMENTS
from chaosgym.errors import ModelFileError, ParameterError
from chaosgym.files import write_atomically

Array = NDArray[Any]

FORMAT = 3
"""Version of the files."""

LARGEST = 50_000_000
"""Bytes that the weights may have."""

DESCRIPTION, WEIGHTS = "policy.json", "weights.npz"


class Normalisation(NamedTuple):
    """Shift and scale of the observations: ``mean`` and ``deviation`` (d,); results are cut off at +-``limit``."""

    mean: Array
    deviation: Array
    limit: float

    def __call__(self, observations: Array) -> Array:
        """Return normalised observations (..., d)."""
        values = np.clip((observations - self.mean) / self.deviation, -self.limit, self.limit)
        return values.astype(np.float32)


@dataclass
class TrainedPolicy:
    """A network with all that is needed to play it.

    Attributes
    ----------
    env
        Id of the environment that it was trained on.
    observation_space, action_space
        Of that environment.
    network
        From prepared observations to actions.
    normalisation
        Applied to the observations, memory included; None for none.
    memory
        What it is given of the past of a job: "none", "speeds" (``SpeedMemory``), "belief" (``BeliefMemory``) or
        "identified" (``IdentifiedMemory``), on the tables of ``env``.
    largest_step
        Change of speed for an action of 1, if the network answers with increments; None for target speeds.
    squashed
        Whether the network's answer goes through tanh; otherwise it is clipped.
    """

    env: str
    observation_space: Box
    action_space: Box
    network: Network
    normalisation: Normalisation | None = None
    memory: Memory = "none"
    largest_step: float | None = None
    squashed: bool = False
    _state: State | None = field(default=None, init=False, repr=False)
    _memory: SpeedMemory | BeliefMemory | None = field(default=None, init=False, repr=False)
    _jobs: int = field(default=0, init=False, repr=False)

    def __post_init__(self) -> None:
        self._memory = memory_of(self.observation_space, self._attribute, self.memory)
        space = self._memory.space if self._memory else self.observation_space
        self.network.check(space.shape[0], self.action_space.shape[0])
        if self.normalisation:
            for name, values in (("mean", self.normalisation.mean), ("deviation", self.normalisation.deviation)):
                if values.shape != space.shape or not np.isfinite(values).all():
                    raise ModelFileError(f"the {name} of the normalisation is not {space.shape[0]} finite numbers")
            if not (self.normalisation.deviation > 0.0).all():
                raise ModelFileError("a deviation of the normalisation is not positive")
            _expect_scale("limit of the normalisation", self.normalisation.limit)
        if self.largest_step is not None:
            _expect_scale("largest step", self.largest_step)

    def reset(self) -> None:
        """Forget the last job."""
        self._state, self._jobs = None, 0

    def __call__(self, observation: Array) -> NDArray[np.float32]:
        """Return the action (1,) for an observation (d,), or actions (n, 1) for those of n jobs side by side (n, d).

        Raises
        ------
        ModelFileError
            If observations of another length were expected.
        ParameterError
            If an observation is not finite, or there are more or fewer jobs than before and no ``reset`` in between.
        """
        observations = np.asarray(observation, np.float32)
        if observations.shape[-1:] != self.observation_space.shape:
            raise ModelFileError(
                f"the observation has shape {observations.shape}; this policy of {self.env} expects "
                f"{self.observation_space.shape}"
            )
        if not np.isfinite(observations).all():
            raise ParameterError(f"the observation {observations.tolist()} is not finite")
        last = values = np.atleast_2d(observations)
        if (self._memory or self.network.lstm) and self._jobs not in (0, len(values)):
            raise ParameterError(f"observations of {len(values)} jobs after {self._jobs}: call reset() between jobs")
        if self._memory:
            values = self._memory.add(values) if self._jobs else self._memory.start(values)
        self._jobs = len(values)
        if self.normalisation:
            values = self.normalisation(values)
        answer, self._state = self.network(values, self._state)
        low, high = self.action_space.low, self.action_space.high
        if self.squashed:
            answer = low + 0.5 * (np.tanh(answer) + 1.0) * (high - low)
        answer = commanded(answer, last, self._memory, self.observation_space, self.largest_step)
        return np.clip(answer, low, high).reshape(*observations.shape[:-1], -1).astype(np.float32)

    def _attribute(self, name: str) -> Any:
        """Attribute of the environment that it was trained on."""
        return gym.make(self.env).get_wrapper_attr(name)

    def fits(self, env: gym.Env[Any, Any]) -> None:
        """Raise a ModelFileError unless the spaces are those of an environment."""
        for name, own, theirs in (
            ("observation", self.observation_space, env.observation_space),
            ("action", self.action_space, env.action_space),
        ):
            if own != theirs:
                raise ModelFileError(
                    f"the {name} space of the policy, {own}, is not that of the environment, {theirs}; "
                    f"it was trained on {self.env}"
                )


def save_policy(policy: TrainedPolicy, folder: str | Path) -> None:
    """Write ``policy.json`` and ``weights.npz`` into a folder that exists; the same policy gives the same bytes."""
    network = policy.network
    arrays: dict[str, Array] = {}
    if network.lstm:
        arrays |= {f"lstm.{name}": values for name, values in network.lstm._asdict().items()}
    for place, layer in enumerate(network.layers):
        arrays |= {f"layer{place}.weight": layer.weight, f"layer{place}.bias": layer.bias}
    if policy.normalisation:
        arrays |= {"mean": policy.normalisation.mean, "deviation": policy.normalisation.deviation}
    buffer = BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    description = {
        "format": FORMAT,
        "env": policy.env,
        "observation": _bounds(policy.observation_space),
        "action": _bounds(policy.action_space),
        "lstm": network.lstm is not None,
        "activations": [layer.activation for layer in network.layers],
        "normalisation_limit": policy.normalisation.limit if policy.normalisation else None,
        "memory": policy.memory,
        "largest_step": policy.largest_step,
        "squashed": policy.squashed,
        "sha256": sha256(buffer.getvalue()).hexdigest(),
    }
    text = json.dumps(description, indent=1) + "\n"
    write_atomically(Path(folder) / WEIGHTS, lambda path: path.write_bytes(buffer.getvalue()))
    write_atomically(Path(folder) / DESCRIPTION, lambda path: path.write_text(text, encoding="utf-8"))


def load_policy(folder: str | Path) -> TrainedPolicy:
    """Read what ``save_policy`` wrote; nothing in it is executed or imported.

    Raises
    ------
    ModelFileError
        If a file is missing, damaged, of another version, or does not match its hash.
    """
    folder = Path(folder)
    for name in (DESCRIPTION, WEIGHTS):
        if not (folder / name).is_file():
            raise ModelFileError(f"{folder} holds no {name}; a policy is a folder with {DESCRIPTION} and {WEIGHTS}")
    try:
        description = json.loads((folder / DESCRIPTION).read_text(encoding="utf-8"))
        if description["format"] != FORMAT:
            raise ModelFileError(
                f"{folder} has format {description['format']}; this version reads format {FORMAT}: export it again"
            )
        return _policy(description, _arrays(folder / WEIGHTS, description["sha256"]))
    except (
        OSError,
        ValueError,
        KeyError,
        TypeError,
        IndexError,
        AttributeError,
        EOFError,
        zipfile.BadZipFile,
    ) as error:
        told = error if isinstance(error, ModelFileError) else f"{type(error).__name__}: {error}"
        raise ModelFileError(f"{folder} can't be read as a policy: {told}") from error


def _policy(description: dict[str, Any], arrays: dict[str, Array]) -> TrainedPolicy:
    env, limit, step = (description[name] for name in ("env", "normalisation_limit", "largest_step"))
    if env not in ENVIRONMENTS:
        # Gymnasium would import the module of an id like "module:name"
        raise ModelFileError(f"its environment, {env!r}, is none of {', '.join(ENVIRONMENTS)}")
    lstm = Lstm(*(arrays[f"lstm.{name}"] for name in Lstm._fields)) if description["lstm"] else None
    layers = tuple(
        Dense(arrays[f"layer{place}.weight"], arrays[f"layer{place}.bias"], activation)
        for place, activation in enumerate(description["activations"])
    )
    return TrainedPolicy(
        env,
        _space(description["observation"]),
        _space(description["action"]),
        Network(lstm, layers),
        None if limit is None else Normalisation(arrays["mean"], arrays["deviation"], float(limit)),
        description["memory"],
        None if step is None else float(step),
        bool(description["squashed"]),
    )


def _arrays(path: Path, digest: str) -> dict[str, Array]:
    size = path.stat().st_size
    if size > LARGEST:
        raise ModelFileError(f"{WEIGHTS} has {size} bytes; allowed: up to {LARGEST}")
    content = path.read_bytes()
    if sha256(content).hexdigest() != digest:
        raise ModelFileError(f"{WEIGHTS} is damaged: its content does not match the hash in {DESCRIPTION}")
    with np.load(BytesIO(content), allow_pickle=False) as held:
        return {name: held[name] for name in held.files}


def _expect_scale(name: str, value: float) -> None:
    if not 0.0 < value < np.inf:
        raise ModelFileError(f"the {name} is {value}; expected: a positive number")


def _bounds(space: Box) -> dict[str, list[float]]:
    return {"low": space.low.tolist(), "high": space.high.tolist()}


def _space(bounds: dict[str, list[float]]) -> Box:
    return Box(np.array(bounds["low"], np.float32), np.array(bounds["high"], np.float32))
