"""The beam in motion between its sensors, its gap exaggerated."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.machines.picture import PALE, Shape, Sketch, Words, moving, samples_of

GHOSTS = 60
"""Other positions shown behind the beam."""

GAP = 0.13
"""Half gap as drawn, in lengths of the beam."""

PUSH = 0.65
"""Place of the shaker as drawn, in lengths of the beam."""


def sketch_of_beam(record: Any, rows: NDArray[np.int64]) -> Sketch:
    """The beam between its sensors, its other positions pale, its deflection exaggerated; see ``Machine.sketch``."""
    beam: Any = record.machine
    times = GAP * beam.length / beam.clearance if beam.clearance > 0.0 else 1.0
    tip = samples_of(record)[:, 0] * (times / beam.length)
    now = tip[rows]
    shaker = _at(now, [PUSH, PUSH], np.stack([PUSH * now - 0.03, np.full(len(now), -0.23)], axis=1))
    sensors, words = [], [Words((PUSH, -0.26), ["shaker"], "center", stays=True)]
    words.append(Words((-0.09, -0.12), ["flexure pivot"], stays=True))
    for side, (name, sign) in enumerate(zip(beam.sides, (1.0, -1.0), strict=True)):
        edge = sign * (GAP + 0.014)
        sensors.append(_block((0.93, 1.07), (edge, edge + sign * 0.05)))
        told = f"{name} sensor: {record.peak_force[:, side].max():.0f} N"
        words.append(Words((1.0, edge + sign * 0.07), [told], "center", "bottom" if sign > 0 else "top"))
    others = tip[:: max(1, len(tip) // GHOSTS)]
    shapes = (
        Shape(
            "back", _at(others, [0.0, 1.0], np.outer(others, [0.0, 1.0])).reshape(1, -1, 2, 2), PALE, 1.2, alpha=0.45
        ),
        Shape("body", np.stack(sensors)[None], None, 0.0),
        Shape("body", moving(_block((-0.09, -0.05), (-0.1, 0.1))), PALE, 0.0),
        Shape("line", shaker, width=1.2),
        Shape("dot", shaker[:, :, :1], width=6.0, marker="^"),
        Shape("dot", shaker[:1, :, 1:], width=6.0, marker="v"),
        Shape("line", _at(now, [0.0, 1.0], np.outer(now, [0.0, 1.0])), width=6.0),
        Shape("line", moving(np.array([[-0.05, 0.0], [0.0, 0.0]])), width=2.0),
        Shape("dot", moving(np.zeros((1, 2))), width=9.0, fill="white"),
    )
    return Sketch(
        f"Gap of ±{beam.clearance * 1e3:.3g} mm, drawn {times:.0f} times; numbers: largest forces",
        np.array([-0.1, -0.32]),
        np.array([1.24, 0.32]),
        shapes,
        words,
    )


def _at(moments: Array, along: list[float], across: Array) -> Array:
    """A line of two points at each moment, (n, 1, 2, 2)."""
    return moving(np.stack([np.broadcast_to(along, (len(moments), 2)), across], axis=-1))


def _block(across: tuple[float, float], up: tuple[float, float]) -> Array:
    """Corners (4, 2) of a rectangle."""
    return np.array([(across[i], up[j]) for i, j in ((0, 0), (1, 0), (1, 1), (0, 1))])
