"""A trained policy: observations in, actions out, by numpy alone.

policy = load_policy("runs/ppo-0")       # a folder with policy.json and weights.npz
chaosgym.evaluate(policy, "chaosgym/ImpactBeamTolerance-v1")
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.control.policies.learned_map import LearnedMap, warn_of_other_steps
from chaosgym.control.policies.network import Dense, Lstm, Network, State
from chaosgym.control.readings import Readings
from chaosgym.envs import environment
from chaosgym.envs.drive import BACK
from chaosgym.envs.entries import keywords_of
from chaosgym.envs.memory import SpeedMemory, Usual
from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.task import Task
from chaosgym.errors import ModelFileError, ParameterError
from chaosgym.files import DAMAGE, contents, unpacked, write_atomically

Array = NDArray[Any]

FORMAT = 4
"""Version of the files."""

LARGEST = 50_000_000
"""Bytes that the weights may have, unpacked."""

DESCRIPTION, WEIGHTS = "policy.json", "weights.npz"

ACTIONS = {"trim": BACK + 1, "continuous": 2}
"""Numbers that the network answers with, by the kind of action: the largest one decides, or they are the action."""

ADDED = {entry.name: (keyword, value) for keyword, (value, entry) in keywords_of(Task).items()}
"""Entries that not every observation has: the keyword of the environment, and its value, that add each."""


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
        Environment that it was trained on: its id, or the file of the machine.
    action
        Kind of its actions, "trim" or "continuous".
    network
        From prepared observations to actions.
    normalisation
        Applied to the observations, memory included; None for none.
    usual
        For a policy with a ``SpeedMemory``, what is usual at each speed; None for one without a memory.
    squashed
        Whether continuous answers go through tanh; otherwise they are clipped.
    observes
        Names of the entries that it sees, in their order: those of every observation, or others of a ``Task``'s
        ``places``. The environment may have more.
    machine
        ``definition`` of the machine that it was trained on; by default the name in the environment's id.
    cycles_per_step
        Cycles of the steps that it learned from; 0 for those of the machine's own task.

    Raises
    ------
    ModelFileError
        If the parts do not fit each other.
    """

    env: str
    action: str
    network: Network
    normalisation: Normalisation | None = None
    usual: Usual | None = None
    squashed: bool = False
    machine: str = ""
    observes: tuple[str, ...] = OBSERVATION_NAMES
    cycles_per_step: int = 0
    knows: str = "measurements"
    _state: State | None = field(default=None, init=False, repr=False)
    _memory: SpeedMemory | None = field(default=None, init=False, repr=False)
    _readings: Readings | None = field(default=None, init=False, repr=False)
    _width: int = field(init=False, repr=False)
    _columns: list[int] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        if self.action not in ACTIONS:
            raise ModelFileError(f"the kind of actions is {self.action!r}; known: {', '.join(ACTIONS)}")
        self.machine = self.machine or environment(self.env).kwargs["machine"]
        known = (*OBSERVATION_NAMES, *ADDED)
        if not set(self.observes) <= set(known) or len(set(self.observes)) < len(self.observes):
            raise ModelFileError(f"it sees {', '.join(self.observes)}; allowed, each once: {', '.join(known)}")
        self._look_at({name: place for place, name in enumerate(self.observes)})
        size = len(self._columns)
        self.network.check(size, ACTIONS[self.action])
        if self.normalisation:
            for name, values in (("mean", self.normalisation.mean), ("deviation", self.normalisation.deviation)):
                if values.shape != (size,) or not np.isfinite(values).all():
                    raise ModelFileError(f"the {name} of the normalisation is not {size} finite numbers")
            if not (self.normalisation.deviation > 0.0).all():
                raise ModelFileError("a deviation of the normalisation is not positive")
            if not 0.0 < self.normalisation.limit < np.inf:
                raise ModelFileError(f"the limit of the normalisation is {self.normalisation.limit}; must be positive")

    @property
    def keywords(self) -> dict[str, Any]:
        """Keywords of the environment that it plays in."""
        return {"action": self.action} | dict(ADDED[name] for name in self.observes if name in ADDED)

    def _look_at(self, places: Mapping[str, int]) -> None:
        """Find the entries that it sees in observations with these ``places``; what is remembered follows them."""
        self._width = len(places)
        remembered = len(SpeedMemory.names()) if self.usual else 0
        own = [places[name] for name in self.observes]
        self._columns = [*own, *range(self._width, self._width + remembered)]

    def start(self, envs: Any) -> None:
        """Begin the jobs of a vector environment that has been reset.

        Raises
        ------
        ModelFileError
            If it is of another machine, has another kind of actions, or sees what the environment does not give.
        """
        self.check_machine(envs)
        if envs.task.action != self.action:
            raise ModelFileError(
                f"the policy was trained on {self.env} with action={self.action!r}; this is {envs.nominal.name} with "
                f"action={envs.task.action!r}"
            )
        warn_of_other_steps(self.cycles_per_step, envs)
        self.begin(envs.task, envs.num_envs)

    def check_machine(self, envs: Any) -> None:
        """Refuse environments of another machine than that of the training.

        Raises
        ------
        ModelFileError
            If it is another.
        """
        here = envs.nominal.definition
        if here != self.machine:
            raise ModelFileError(
                f"the policy was trained on {self.env} (machine {self.machine}); this is {envs.nominal.name} "
                f"(machine {here})"
            )

    def begin(self, task: Task, count: int) -> None:
        """Begin ``count`` jobs of a task side by side.

        Raises
        ------
        ModelFileError
            If it remembers other speeds than those of the task, sees an entry that the task does not give, or sets a
            motor that it does not see.
        """
        if task.drive == "motor" and "set_point" not in self.observes:
            raise ModelFileError("the policy does not see the set_point of a motor; allowed: drive='constant'")
        if missing := [name for name in self.observes if name not in task.places]:
            raise ModelFileError(
                f"the policy sees {', '.join(missing)}, and the environment gives {', '.join(task.places)}; make it "
                f"with the keywords {self.keywords}"
            )
        self._look_at(task.places)
        self._state, self._memory, self._readings = None, None, Readings(task, count)
        if self.usual:
            if len(self.usual.count) != len(task.grid):
                raise ModelFileError(
                    f"the policy of {self.env} knows {len(self.usual.count)} speeds; this task has {len(task.grid)}"
                )
            self._memory = SpeedMemory(task, count, self.usual, learns=False)

    def unusual(self, observations: Array) -> Array:
        """How far the readings lie from what was usual in training, in standard deviations, (n, 3).

        Raises
        ------
        ModelFileError
            If the policy has no memory, or has not begun.
        """
        if self._memory is None:
            raise ModelFileError(f"the policy of {self.env} does not know what is usual; allowed: one with a memory")
        return self._memory.unusual(np.asarray(observations, float))

    def __call__(self, observations: Array) -> Array:
        """Return the actions (n,) or (n, 2) for observations (n, entries) of as many jobs as started.

        A step without a usable reading holds, as ``control.readings`` says.

        Raises
        ------
        ParameterError
            If an observation has another length, or if what is not finite in it is no reading; before a start, if
            anything is not finite.
        """
        values = np.asarray(observations, np.float32)
        if values.shape[1:] != (self._width,) or not (self._readings or np.isfinite(values).all()):
            raise ParameterError(f"observations have shape {values.shape}; allowed: (n, {self._width}), all finite")
        values = self._readings.take(values) if self._readings else values
        if self._memory:
            values = self._memory.add(values)
        values = values.take(self._columns, axis=1)
        if self.normalisation:
            values = self.normalisation(values)
        answer, self._state = self.network(values, self._state)
        if self.action == "trim":
            actions = answer.argmax(axis=-1)
        else:
            actions = np.asarray(np.tanh(answer) if self.squashed else np.clip(answer, -1.0, 1.0), np.float32)
        return self._readings.answer(actions) if self._readings else np.asarray(actions)


MAP = "map"
"""Kind of what a ``LearnedMap`` answers with: numbers of every speed."""


def save_policy(policy: "TrainedPolicy | LearnedMap", folder: str | Path) -> None:
    """Write ``policy.json`` and ``weights.npz`` into a folder, made if need be; a policy gives the same bytes."""
    Path(folder).mkdir(parents=True, exist_ok=True)
    network = policy.network
    arrays: dict[str, Array] = {}
    if network.lstm:
        arrays |= {f"lstm.{name}": values for name, values in network.lstm._asdict().items()}
    for place, layer in enumerate(network.layers):
        arrays |= {f"layer{place}.weight": layer.weight, f"layer{place}.bias": layer.bias}
    description: dict[str, Any] = {"format": FORMAT, "env": policy.env, "machine": policy.machine}
    if policy.cycles_per_step:
        description["cycles_per_step"] = policy.cycles_per_step
    if isinstance(policy, LearnedMap):
        arrays |= {"mean": policy.mean, "deviation": policy.deviation}
        rule = {"least_gain": policy.least_gain, "wary": policy.wary}
        description |= {"action": MAP} | {name: value for name, value in rule.items() if value}
    else:
        if policy.normalisation:
            arrays |= {"mean": policy.normalisation.mean, "deviation": policy.normalisation.deviation}
        if policy.usual:
            arrays |= {f"usual.{name}": values for name, values in vars(policy.usual).items()}
        description |= {
            "action": policy.action,
            "lstm": network.lstm is not None,
            "normalisation_limit": policy.normalisation.limit if policy.normalisation else None,
            "memory": policy.usual is not None,
            "squashed": policy.squashed,
            "observes": list(policy.observes),
        }
    buffer = BytesIO()
    np.savez(buffer, **arrays)  # type: ignore[arg-type]
    description |= {
        "activations": [layer.activation for layer in network.layers],
        "sha256": sha256(buffer.getvalue()).hexdigest(),
    }
    text = json.dumps(description, indent=1) + "\n"
    write_atomically(Path(folder) / WEIGHTS, lambda path: path.write_bytes(buffer.getvalue()))
    write_atomically(Path(folder) / DESCRIPTION, lambda path: path.write_text(text, encoding="utf-8"))


def load_policy(folder: str | Path) -> TrainedPolicy | LearnedMap:
    """Read what ``save_policy`` wrote; nothing in it is executed or imported.

    Raises
    ------
    ModelFileError
        If a file is missing, damaged, of another version, or does not match its hash.

    Examples
    --------
    >>> from importlib.resources import files
    >>> from chaosgym.control.policies.policy import load_policy
    >>> shipped = files("chaosgym") / "control" / "policies" / "shipped"
    >>> load_policy(shipped / "ImpactBeamTolerance-v1").env
    'chaosgym/ImpactBeamTolerance-v1'
    """
    folder = Path(folder)
    for name in (DESCRIPTION, WEIGHTS):
        if not (folder / name).is_file():
            raise ModelFileError(f"{folder} holds no {name}; a policy is a folder with {DESCRIPTION} and {WEIGHTS}")
    try:
        description = json.loads(contents(folder / DESCRIPTION, LARGEST).decode("utf-8"))
        if description["format"] != FORMAT:
            raise ModelFileError(
                f"{folder} has format {description['format']}; this version reads format {FORMAT}: train it again"
            )
        return _policy(description, _arrays(folder / WEIGHTS, description["sha256"]))
    except DAMAGE as error:
        told = error if isinstance(error, ModelFileError) else f"{type(error).__name__}: {error}"
        raise ModelFileError(f"{folder} can't be read as a policy: {told}") from error


def _policy(description: dict[str, Any], arrays: dict[str, Array]) -> TrainedPolicy | LearnedMap:
    layers = tuple(
        Dense(arrays[f"layer{place}.weight"], arrays[f"layer{place}.bias"], activation)
        for place, activation in enumerate(description["activations"])
    )
    env, machine = str(description["env"]), str(description.get("machine", ""))
    cycles = int(description.get("cycles_per_step", 0))
    if description["action"] == MAP:
        usually = arrays["mean"], arrays["deviation"]
        rule = float(description.get("least_gain", 0.0)), bool(description.get("wary", False))
        return LearnedMap(env, Network(None, layers), *usually, machine, cycles, *rule)
    limit = description["normalisation_limit"]
    lstm = Lstm(*(arrays[f"lstm.{name}"] for name in Lstm._fields)) if description["lstm"] else None
    usual = None
    if description["memory"]:
        usual = Usual(len(arrays["usual.count"]))
        for name, values in vars(usual).items():
            given = arrays[f"usual.{name}"]
            if given.shape != values.shape or not np.isfinite(given).all():
                raise ModelFileError(f"usual.{name} has shape {given.shape}; expected: {values.shape}, all finite")
            setattr(usual, name, given)
    return TrainedPolicy(
        env=env,
        action=description["action"],
        network=Network(lstm, layers),
        normalisation=None if limit is None else Normalisation(arrays["mean"], arrays["deviation"], float(limit)),
        usual=usual,
        squashed=bool(description["squashed"]),
        machine=machine,
        observes=tuple(description.get("observes", (*OBSERVATION_NAMES, *_observed_by_keyword(description)))),
        cycles_per_step=cycles,
    )


def _observed_by_keyword(description: dict[str, Any]) -> list[str]:
    """Entries beside the usual ones of a file that does not list what the policy observes, but its keywords."""
    return [name for name, (keyword, _) in ADDED.items() if keyword in description.get("asked", ())]


def _arrays(path: Path, digest: str) -> dict[str, Array]:
    content = contents(path, LARGEST)
    if sha256(content).hexdigest() != digest:
        raise ModelFileError(f"{WEIGHTS} is damaged: its content does not match the hash in {DESCRIPTION}")
    return unpacked(content, LARGEST)
