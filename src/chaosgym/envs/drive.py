"""How does an agent set a machine's speed? It trims the speed that is demanded; a drive follows at a limited rate.

Three kinds of action say the same in different words:

    trim         a number from 0 to 5: hold; 1 down, 1 up, 2 down, 2 up, in units of ``trim_step``; back to the demand
    continuous   two numbers from -1 to 1: a change of the trim with a dead band, in units of 2 ``trim_step``; back to
                 the demand if the second one is above 0.5
    speed        the speed itself, for controllers

Motion settles at a speed that is held. Actions that change the speed at every step keep it from settling, so each kind
can hold a speed exactly.
"""

from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete
from numpy.typing import NDArray

from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError

Array = NDArray[np.float64]

MOVES = np.array([0, -1, 1, -2, 2])
"""Trim steps of the discrete actions; one more action goes back to the demand."""

BACK = len(MOVES)
"""Discrete action that goes back to the demand."""

DEAD_BAND = 0.4
"""Continuous changes below this hold the speed."""

KINDS = ("trim", "continuous", "speed")


def action_space(task: Task) -> "Box | Discrete[Any]":
    """Return the space of actions of the task's kind."""
    if task.action == "trim":
        return Discrete(BACK + 1)
    if task.action == "continuous":
        return Box(-1.0, 1.0, (2,), np.float32)
    return Box(np.array([task.lowest_speed], np.float32), np.array([task.highest_speed], np.float32))


def checked_actions(task: Task, actions: Any, count: int) -> NDArray[Any]:
    """Return the actions of ``count`` machines as an array, (count,) if they are discrete, otherwise (count, n).

    Raises
    ------
    ParameterError
        If they have another shape, or are no numbers of the space.
    """
    given = np.asarray(actions)
    if task.action == "trim":
        fits = given.shape == (count,) and given.dtype.kind in "iu"
        if not fits or given.min() < 0 or given.max() > BACK:
            raise ParameterError(f"action = {actions!r} is not usable; allowed: whole numbers from 0 to {BACK}")
        return given
    width = 2 if task.action == "continuous" else 1
    if given.shape != (count, width) or not np.issubdtype(given.dtype, np.number) or not np.isfinite(given).all():
        raise ParameterError(f"action = {actions!r} is not usable; allowed: {width} finite numbers for each machine")
    return given.astype(float)


def trimmed(task: Task, actions: NDArray[Any], demand: Array, trim: Array) -> Array:
    """Return the trims (k,) that checked actions of k machines ask for, at the demand and trim before."""
    if task.action == "speed":
        return actions[:, 0] - demand
    if task.action == "trim":
        back = actions == BACK
        change = task.trim_step * MOVES[np.where(back, 0, actions)]
    else:
        back = actions[:, 1] > 0.5
        size = np.clip((np.abs(actions[:, 0]) - DEAD_BAND) / (1.0 - DEAD_BAND), 0.0, 1.0)
        change = 2.0 * task.trim_step * np.sign(actions[:, 0]) * size
    return np.where(back, 0.0, (trim + change).clip(-task.largest_trim, task.largest_trim))


def approached(task: Task, speed: Array, target: Array) -> Array:
    """Return the speeds (k,) of the next step, within the range of the drive, its rate and its grid."""
    moved = speed + (target - speed).clip(-task.slew_limit, task.slew_limit)
    if task.speed_grid > 0.0:
        moved = task.speed_grid * np.rint(moved / task.speed_grid)
    return np.asarray(moved.clip(task.lowest_speed, task.highest_speed))
