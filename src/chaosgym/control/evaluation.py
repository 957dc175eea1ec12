"""Evaluation of a policy in one line: ``chaosgym.evaluate(policy, "chaosgym/ImpactBeamTolerance-v1")``."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import pyarrow as pa
from gymnasium.spaces import Discrete
from numpy.typing import NDArray

from chaosgym.control.comparison import Contenders, job_rows, joined, shipped_comparison
from chaosgym.control.guard import GuardedPolicy
from chaosgym.control.policies.policy import TrainedPolicy, load_policy
from chaosgym.control.readings import Readings
from chaosgym.control.rollout import Played, Policy, play
from chaosgym.control.scores import ONE, ZERO, Scores
from chaosgym.envs.memory import SpeedMemory
from chaosgym.envs.vector_env import native_envs
from chaosgym.errors import ModelFileError, ParameterError
from chaosgym.files import first_line
from chaosgym.numbers import whole

NAME = "this policy"

ALGORITHMS = (
    *("PPO", "A2C", "SAC", "TD3", "DDPG", "DQN"),
    *("RecurrentPPO", "MaskablePPO", "TRPO", "QRDQN", "TQC", "CrossQ", "ARS"),
)
"""Algorithms of stable-baselines3 and of sb3-contrib whose files are read."""


@dataclass(frozen=True)
class Evaluation:
    """What a policy achieved.

    Attributes
    ----------
    score
        0 for following the demand, 1 for the machine's own map, on the same machines.
    interval
        Of the score, 95 % over machines.
    mean_return, type_iii, deviation
        Means over the jobs; the deviation in the unit of the speeds.
    played
        The jobs, step by step.
    """

    score: float
    interval: tuple[float, float]
    mean_return: float
    type_iii: float
    deviation: float
    played: Played

    def __repr__(self) -> str:
        low, high = self.interval
        return (
            f"<score {self.score:z.2f} ({low:z.2f} to {high:z.2f}), return {self.mean_return:.2f}, Type III "
            f"{self.type_iii:.1%}, {self.deviation:.3g} off the demand>"
        )


class _Function:
    """A function from one observation to one action."""

    knows = "measurements"

    def __init__(self, function: Callable[[Any], Any], keywords: dict[str, Any]) -> None:
        self._function, self.keywords = function, keywords

    def start(self, envs: Any) -> None:
        """Nothing is remembered but what is held without a reading."""
        self._readings = Readings(envs.task, envs.num_envs)

    def __call__(self, observations: Any) -> Any:
        """Actions, one call for each job."""
        seen = self._readings.take(observations)
        return self._readings.answer([self._function(observation) for observation in seen])


class _SB3:
    """A model of stable-baselines3 that was trained on the plain observation, or carries its ``VecNormalize``."""

    knows = "measurements"

    def __init__(self, model: Any) -> None:
        self._model, self._memory = model, cast(SpeedMemory | None, None)
        self._normalise = model.get_vec_normalize_env()
        if self._normalise is None and _saw_normalised(model):
            raise ModelFileError(
                "the model was trained behind VecNormalize, whose statistics are missing: a .zip does not hold them; "
                "pass the model with its environment, as of PPO.load(FILE, env=VecNormalize.load(STATISTICS, envs))"
            )
        self.keywords = {"action": "trim" if isinstance(model.action_space, Discrete) else "continuous"}

    def start(self, envs: Any) -> None:
        """Forget the last jobs."""
        self._state, self._first = None, np.ones(envs.num_envs, np.bool_)
        self._readings = Readings(envs.task, envs.num_envs)
        width = self._model.observation_space.shape[0]
        self._memory = None
        if width != envs.single_observation_space.shape[0]:
            inner = self._normalise
            while inner is not None and not hasattr(inner, "memory"):
                inner = getattr(inner, "venv", None)
            if inner is None:
                raise ModelFileError(
                    f"the model wants {width} numbers, the environment gives {envs.single_observation_space.shape[0]}; "
                    "export the policy together with its memory (chaosgym.control.policies.export)"
                )
            self._memory = SpeedMemory(envs.task, envs.num_envs, inner.memory.usual, learns=False)

    def __call__(self, observations: NDArray[np.float32]) -> Any:
        """Actions without exploration."""
        observations = self._readings.take(observations)
        seen = observations if self._memory is None else self._memory.add(observations)
        seen = seen if self._normalise is None else self._normalise.normalize_obs(seen)
        actions, self._state = self._model.predict(seen, self._state, self._first, deterministic=True)
        self._first = np.zeros(len(actions), np.bool_)
        return self._readings.answer(actions)


OUTSIDE = 0.1
"""Share of a model's last observations beyond their bounds from which on they were normalised."""


def _saw_normalised(model: Any) -> bool:
    """Whether the last observations of training, which stable-baselines3 saves, lie beyond what the sensors give."""
    last, space = getattr(model, "_last_obs", None), model.observation_space
    return last is not None and bool(np.mean((last < space.low) | (last > space.high)) > OUTSIDE)


def policy_of(given: Any, **keywords: Any) -> Policy:
    """Return what ``play`` runs.

    Parameters
    ----------
    given
        A controller or a trained policy; a folder of one; a model of stable-baselines3 or its .zip file; or a function
        from an observation (entries,) to an action.
    keywords
        Of the environment, for a function.

    Raises
    ------
    ModelFileError
        If it is none of these, the statistics of its ``VecNormalize`` are missing, or what reads it is not installed.
    """
    if isinstance(given, type):
        raise ModelFileError(f"{given.__name__} is a class; allowed: one of it, such as {given.__name__}()")
    if isinstance(given, str | Path):
        path = Path(given)
        return load_policy(path) if path.suffix != ".zip" else _SB3(_loaded(path))
    if hasattr(given, "start") and callable(given):
        return cast(Policy, given)
    if hasattr(given, "predict"):
        return _SB3(given)
    if callable(given):
        return _Function(given, {"action": keywords["action"]} if "action" in keywords else {})
    raise ModelFileError(f"{given!r} is no policy; allowed: a function, a model of stable-baselines3, or a policy")


def _loaded(path: Path) -> Any:
    """Model of a .zip file, whichever algorithm it was trained with."""
    if not path.is_file():
        raise ModelFileError(f"{path} does not exist")
    try:
        import sb3_contrib
        import stable_baselines3
        from stable_baselines3.common.save_util import load_from_zip_file
    except ImportError as error:
        raise ModelFileError(f"{path} needs the extra [learn]: {error}; pip install sb3-contrib") from None

    kinds = [getattr(stable_baselines3, name) for name in ALGORITHMS if hasattr(stable_baselines3, name)]
    kinds += [getattr(sb3_contrib, name) for name in ALGORITHMS if hasattr(sb3_contrib, name)]
    try:
        data, _, _ = load_from_zip_file(path, device="cpu")
        policy = (data or {})["policy_class"]
    except Exception as error:  # whatever torch and pickle say of damaged bytes
        raise ModelFileError(f"{path} can't be read as a model of stable-baselines3: {first_line(error)}") from None
    for kind in kinds:
        if any(issubclass(policy, known) for known in kind.policy_aliases.values()):
            try:
                return kind.load(path, device="cpu")
            except Exception:  # several algorithms share a policy; each refuses the files of the others in its own way
                continue
    raise ModelFileError(f"{path} is no model of {', '.join(ALGORITHMS)}")


def evaluate(
    policy: Any,
    env: str = "chaosgym/ImpactBeamTolerance-v1",
    *,
    machines: int = 256,
    guard: bool = False,
    progress: bool = False,
    **keywords: Any,
) -> Evaluation:
    """Run a policy on machines that are kept for evaluation, and score it.

    Parameters
    ----------
    policy
        Folder of an exported policy, a file or a model of stable-baselines3, or a function from an observation to an
        action; see ``policy_of``.
    env
        Id of the environment, or the file of a machine; no environment that was made.
    machines
        How many, from the first on. All 256 take half a minute; few give wide intervals.
    guard
        Whether it plays behind a guard, as ``chaosgym.Operator`` and ``chaosgym run-agent`` play it.
    progress
        Show progress bars on standard error.
    keywords
        Of the environment. The scale of the default ones is shipped for the beam's tolerances, and for fewer machines
        of other ids and of the fleet's test split; any other scale is computed first, in minutes.

    Returns
    -------
    Evaluation
        Its ``score`` is 0 for following the demand and 1 for the machine's own map, and may exceed 1.

    Raises
    ------
    ParameterError
        If ``env`` is no id, fewer machines are kept, or the policy is to be guarded and does not know what was usual in
        training.

    Examples
    --------
    >>> follows = chaosgym.evaluate(lambda observation: np.zeros(1), machines=4)
    >>> round(follows.deviation, 3)
    0.016
    """
    if not isinstance(env, str | Path):
        raise ParameterError("env is no id; give one such as 'chaosgym/ImpactBeam-v1', not what was made of it")
    machines = whole("machines", machines, 1, native_envs(env, **keywords).settings.variants.count)
    runs = policy_of(policy, **keywords)
    runs = GuardedPolicy(runs) if guard else runs
    played = play(runs, env, range(machines), progress=NAME if progress else None, **keywords)
    scale = shipped_comparison(env, **keywords)
    if scale is None or pa.compute.max(scale["machine"]).as_py() < machines - 1:
        makers = Contenders(env, keywords, progress).makers(range(machines))
        scale = joined(
            *(
                job_rows(name, "", 0, play(makers[name](), env, range(machines), **keywords), env)
                for name in (ZERO, ONE)
            )
        )
    kept = scale.filter(pa.compute.less(scale["machine"], machines))
    table = joined(kept, job_rows(NAME, runs.knows, 0, played, env))
    row = Scores(table).row(NAME)
    low, high = row["score_interval"]
    return Evaluation(row["score"], (low, high), row["return"], row["type_iii"], row["deviation"], played)


__all__ = ["Evaluation", "TrainedPolicy", "evaluate", "policy_of"]
