"""Crank, rod and slider in motion, the gap of the monitored joint exaggerated.

Places are in mm for the thesis' crank; others are drawn as large, whatever their size.
"""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.machines.picture import PALE, Shape, Sketch, Words, moving, samples_of
from chaosgym.machines.slider_crank.mechanism import pin_and_pivot

GHOSTS = 12
"""Other positions shown behind the crank and its rod."""

GAP, SLIDER_HALF_HEIGHT, SLIDER_HALF_LENGTH = 9.0, 13.0, 24.0
"""Half gap at the slider and the slider itself as drawn [mm]."""

BARS = 600
"""Contact forces that are drawn, at the most."""

BALL_GAP, BALL = 5.0, 5.0
"""Half gap at the ball joint and radius of the ball as drawn [mm]."""

REACH, LEFT, RIGHT, HEIGHT = 285.0, 60.0, 335.0, 62.0
"""Crank and rod in line as drawn [mm], and how far the picture goes to the left, to the right and up at least."""

GUIDE = 4.0
"""Thickness of the guide as drawn [mm]."""

FORCE_LENGTH = 45.0
"""Length of the force limit as drawn [mm]."""

CIRCLE = np.stack([np.cos(turn := np.linspace(0.0, 2.0 * math.pi, 60)), np.sin(turn)], axis=1)
BLOCK = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])


def sketch_of_crank(record: Any, rows: NDArray[np.int64], force_limit: float) -> Sketch:
    """Crank, rod and slider on its guide; bars on the guide show where and how hard the slider hits it."""
    machine: Any = record.machine
    samples, per_cycle = samples_of(record), record.history.shape[1]
    clearance = getattr(machine, machine.clearance_field)
    rattles = machine.monitored_joint == "slider"
    unit = REACH / (machine.crank_radius + machine.rod_length)
    times = (GAP if rattles else BALL_GAP) / (unit * clearance) if clearance > 0.0 else 1.0
    gap = unit * times * samples[:, 0]
    turn = np.arange(per_cycle) * (2.0 * math.pi / per_cycle)
    pins, pivots = (unit * place[:, :2] for place in pin_and_pivot(machine, turn))
    path = np.stack([pivots[:, 0], gap[-per_cycle:] if rattles else np.zeros(per_cycle)], axis=1)
    now = rows % per_cycle
    pin, slider = pins[now], np.stack([pivots[now, 0], gap[rows] if rattles else np.zeros(len(rows))], axis=1)
    ghosts = slice(None, None, max(1, per_cycle // GHOSTS))
    shapes = [
        Shape("back", np.stack([pins[ghosts], path[ghosts]], axis=1)[None], PALE, alpha=0.6),
        Shape("line", moving(pins), PALE, 1.2),
        _guide(pivots, SLIDER_HALF_HEIGHT + (GAP if rattles else 0.0)),
    ]
    rod_end = pin
    if rattles:
        bars = _impacts(pivots, samples[:, 2] / force_limit)
        shapes += [Shape("back", bars[None], None, alpha=0.7), Shape("line", moving(path), None)]
    else:
        rod_end = pin + _across(slider - pin) * gap[rows, None]
        socket = BALL + unit * times * machine.room_of()[1]
        shapes += [
            Shape("line", moving(at[:, None] + size * CIRCLE), width=1.5)
            for at, size in ((rod_end, socket), (pin, BALL))
        ]
    shapes += [
        Shape("line", moving(np.stack([np.zeros_like(pin), pin], axis=1)), width=6.0),
        Shape("line", moving(np.stack([rod_end, slider], axis=1)), width=3.0),
        Shape(
            "body", moving(slider[:, None] + BLOCK * (SLIDER_HALF_LENGTH, SLIDER_HALF_HEIGHT)), width=2.0, fill="white"
        ),
        *(
            Shape("dot", moving(at), width=7.0, fill="white")
            for at in (np.zeros((1, 2)), pin[:, None], slider[:, None])
        ),
    ]
    degrees = [f"crank angle {math.degrees(angle):.0f}°" for angle in turn[now]]
    reach = max(HEIGHT, unit * machine.crank_radius + 10.0)
    words = [Words((0.0, -reach), degrees, "center")]
    for side, (up, word) in enumerate(((-reach - 22.0, "up"), (reach + 22.0, "down"))):
        told = f"largest force {word}: {record.peak_force[:, side].max():.0f} N"
        words.append(Words((330.0, up), [told], "right", "center"))
    title = f"Gap of ±{clearance * 1e3:.3g} mm at the {machine.monitored_joint}, drawn {times:.0f} times"
    low, high = np.array([-max(LEFT, reach), -reach - 28.0]), np.array([RIGHT, reach + 28.0])
    return Sketch(title + "; bars: contact forces" * rattles, low, high, shapes, words)


def _across(rod: Array) -> Array:
    """Unit vectors across the rod, (n, 2) as it."""
    return np.asarray(np.stack([-rod[:, 1], rod[:, 0]], axis=1) / np.linalg.norm(rod, axis=1, keepdims=True))


def _guide(pivots: Array, edge: float) -> Shape:
    """Both sides of the guide, as long as the slider needs."""
    middle = np.array([0.5 * (pivots[:, 0].min() + pivots[:, 0].max()), 0.0])
    half = np.array([0.5 * np.ptp(pivots[:, 0]) + SLIDER_HALF_LENGTH, 0.5 * GUIDE])
    sides = np.array([[0.0, -edge - 0.5 * GUIDE], [0.0, edge + 0.5 * GUIDE]])
    return Shape("body", (middle + sides[:, None] + BLOCK * half)[None], width=0.0, alpha=0.4)


def _impacts(pivots: Array, share: Array) -> Array:
    """Bars (n, 2, 2) on the guide where it pushes the slider; ``share`` (n,) is the force in limits."""
    touching = np.flatnonzero(share)
    touching = touching[:: max(1, len(touching) // BARS)]
    push, along = share[touching], pivots[touching % len(pivots), 0]
    foot = -np.sign(push) * (SLIDER_HALF_HEIGHT + GAP + GUIDE)
    ends = [np.stack([along, foot], axis=1), np.stack([along, foot - push * FORCE_LENGTH], axis=1)]
    return np.stack(ends, axis=1)
