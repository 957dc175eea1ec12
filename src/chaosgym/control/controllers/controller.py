"""What is a controller? Something made for an environment that turns observations into actions, and says what it knows.

controller = SafeConstant(env)
observation, info = env.reset(options={"machine": 3})
controller.reset()                       # at the start of each job
action = controller(observation)
"""

from typing import Any, ClassVar, Literal

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.machine_env import MachineEnv
from chaosgym.envs.tasks import Task
from chaosgym.errors import ParameterError

Action = NDArray[np.float32]
Observation = NDArray[np.float32]
Array = NDArray[np.float64]

Knowledge = Literal["nothing", "measurements", "nominal", "tolerance range", "machine"]
"""What a controller looks at, each item beside the observation: nothing of it, the observation alone, the nominal
machine, the training pool, or this very machine."""


def single(env: gym.Env[Any, Any]) -> MachineEnv:
    """Return the environment without its wrappers.

    Raises
    ------
    ParameterError
        If it is none of chaosgym's, or a vectorised one.
    """
    if not isinstance(env.unwrapped, MachineEnv):
        raise ParameterError(f"env = {env} is not one of chaosgym's environments for one machine")
    return env.unwrapped


class Controller:
    """A rule that drives one machine at a time.

    Parameters
    ----------
    env
        A chaosgym environment, not vectorised; its observations come as the environment itself gives them.

    Raises
    ------
    ParameterError
        If it is another kind of environment.
    """

    knows: ClassVar[Knowledge] = "nothing"

    def __init__(self, env: gym.Env[Any, Any]) -> None:
        self.env: Any = single(env)
        self.drive: SpeedDrive = self.env.drive
        self.task: Task = self.env.task
        self._place = {name: place for place, name in enumerate(self.env.observation_names)}

    def reset(self) -> None:
        """Begin a job; called after the environment's reset."""

    def __call__(self, observation: Observation) -> Action:
        """Return the action, shape (1,)."""
        raise NotImplementedError

    def seen(self, observation: Observation, name: str) -> float:
        """Return an entry of the observation by its name."""
        return float(observation[self._place[name]])

    def peaks(self, observation: Observation) -> Array:
        """Return the measured peak forces [N] of the last step, one a cycle."""
        first = self._place["peak_force_1"]
        return np.asarray(observation[first : first + self.task.cycles_per_step], dtype=float)

    def step_of(self, observation: Observation) -> int:
        """Return how many steps of the job are done."""
        done = (1.0 - self.seen(observation, "remaining_share")) * self.task.job_cycles
        return round(done / self.task.cycles_per_step)

    def command(self, speed: float) -> Action:
        """Return the action whose target is a speed, in the machine's unit; beyond the drive's range its end."""
        return np.array([np.clip(self.drive.action_for(speed), -1.0, 1.0)], dtype=np.float32)
