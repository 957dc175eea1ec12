"""Actions: an agent trims the demanded speed, and the drive follows at a limited rate.

Three encodings of an action set the same trim:

    trim         a number from 0 to 5: hold; 1 down, 1 up, 2 down, 2 up, in units of ``trim_step``; back to the demand
    continuous   two numbers from -1 to 1: a change of the trim with a dead band, in units of 2 ``trim_step``; back to
                 the demand if the second one is above 0.5
    speed        the speed itself, for controllers

Each encoding can hold a speed exactly, because motion settles only at a speed that is held.
"""

import warnings
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Discrete

from chaosgym.arrays import Array
from chaosgym.envs.task import Task
from chaosgym.errors import ParameterError
from chaosgym.numbers import shown

MOVES = np.array([0, -1, 1, -2, 2])
"""Trim steps of the discrete actions; one more action goes back to the demand."""

BACK = len(MOVES)
"""Discrete action that goes back to the demand."""

DEAD_BAND = 0.4
"""Continuous changes below this hold the speed."""


def action_space(task: Task) -> "Box | Discrete[Any]":
    """Return the space of actions of the task's kind."""
    if task.action == "trim":
        return Discrete(BACK + 1)
    if task.action == "continuous":
        return Box(-1.0, 1.0, (2,), np.float32)
    return Box(np.array([task.lowest_speed], np.float32), np.array([task.highest_speed], np.float32))


def checked_actions(task: Task, actions: Any, count: int) -> Array:
    """Return the actions of ``count`` machines as an array (count, n).

    A number that stands alone may be an array of one, and a whole one may be a float: libraries hand on both. What lies
    outside the box is warned of, and clipped by the drive.

    Raises
    ------
    ParameterError
        If they have another shape, or are no numbers of the space.
    """
    given = np.asarray(actions)
    if given.shape == (count, 1) or (given.shape == (count,) and task.action == "speed"):
        given = given.reshape((count, 1) if task.action == "speed" else (count,))
    if task.action == "trim":
        fits = given.shape == (count,) and given.dtype.kind in "iuf"
        if not fits or not set(given.tolist()) <= set(range(BACK + 1)):
            each = "a whole number" if count == 1 else f"{count} whole numbers"
            raise ParameterError(f"action = {shown(actions)} is not usable; allowed: {each} from 0 to {BACK}")
        return given[:, None].astype(float)
    width = 2 if task.action == "continuous" else 1
    if given.shape != (count, width) or given.dtype.kind not in "iuf" or not np.isfinite(given).all():
        raise ParameterError(f"action = {shown(actions)} is not usable; allowed: {width} finite numbers a machine")
    low, high = (-1.0, 1.0) if task.action == "continuous" else (task.lowest_speed, task.highest_speed)
    rounding = 1e-6 * (high - low)
    if given.min() < low - rounding or given.max() > high + rounding:
        warnings.warn(
            f"actions outside the box are clipped; allowed with action={task.action!r}: {low:g} to {high:g}",
            stacklevel=3,
        )
    return given.astype(float)
