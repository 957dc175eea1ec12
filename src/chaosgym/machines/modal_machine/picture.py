"""A structure's joints as blocks between their stops: modes tell how points move, not where in the machine they are."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.machines.parameters import is_half_play, quantity_of
from chaosgym.machines.picture import INK, PALE, Shape, Sketch, Words, moving

GAP = 0.3
"""Clearance as drawn, in widths of a joint."""

APART = 1.5
"""Distance of two joints as drawn."""

FARTHEST = 0.6
"""How far a joint moves from the middle of its gap as drawn, at the most."""

LOW, HIGH = -1.15, 0.95
"""Edges of the picture."""

BODY, STOP = (0.28, 0.07), (0.34, 0.07)
"""Half width and half height of what moves, and half width and height of a stop."""


class _Gap(NamedTuple):
    """A joint: how it is called, its motion (n,) and its stops from the middle of the gap, its surfaces' forces."""

    told: str
    motion: Array
    lower: float
    upper: float
    sides: tuple[str, ...]
    forces: tuple[float, ...]


def sketch_of_joints(record: Any, rows: NDArray[np.int64]) -> Sketch:
    """What moves in each gap, at its own scale, and where it was pale; see ``Machine.sketch``."""
    gaps, shapes, words = _gaps(record), list[Shape](), list[Words]()
    for column, gap in zip(APART * np.arange(len(gaps)), gaps, strict=True):
        times = _scale(gap)
        up = times * gap.motion
        pale = _block(column, BODY[0], up.min() - BODY[1], up.max() + BODY[1])
        shapes.append(Shape("body", moving(pale), PALE, 0.0, alpha=0.45))
        for edge, sign, side, force in zip((gap.upper, gap.lower), (1.0, -1.0), gap.sides, gap.forces, strict=True):
            if np.isfinite(edge):
                near = sign * BODY[1] + times * edge
                far = near + sign * STOP[1]
                shapes.append(Shape("body", moving(_block(column, STOP[0], near, far)), None, 0.0))
                place, across = (column, far + 0.03 * sign), "bottom" if sign > 0.0 else "top"
                words.append(Words(place, [f"{side}: {force:.3g} N"], "center", across))
        body = np.stack([_block(column, BODY[0], y - BODY[1], y + BODY[1]) for y in up[rows]])
        shapes.append(Shape("body", body[:, None], INK, 0.0))
        words.append(
            Words(
                (column, LOW),
                [f"{gap.told}\ndrawn {times:,.{0 if times >= 9.5 else 1}f} times"],
                "center",
                "bottom",
                stays=True,
            )
        )
    low, high = np.array([-0.6, LOW]), np.array([APART * (len(gaps) - 1) + 0.6, HIGH])
    return Sketch("Gaps, not to scale; numbers: largest forces", low, high, shapes, words)


def _gaps(record: Any) -> list[_Gap]:
    """Joints of which the record has the motion."""
    machine, every = record.machine, record.histories
    if every is None:
        name = machine.monitored if machine.places else ""
        return [_gap(record, name, 0, record.history.reshape(-1, 3)[:, 0])]
    motions = every.reshape(-1, every.shape[-1])[:, ::3]
    return [_gap(record, name, joint, motions[:, joint]) for joint, name in enumerate(machine.joints)]


def _gap(record: Any, name: str, joint: int, motion: Array) -> _Gap:
    machine, beginning = record.machine, f"{name}_" if name else ""
    lower, upper = machine.room_of(joint)
    middle, field = getattr(machine, f"{beginning}offset"), f"{beginning}clearance"
    size = ("half the play " if is_half_play(machine, field) else "gap ") + quantity_of(machine, field)
    at = machine.places[name] if name else machine.joint
    called = f"{name}: {at}" if name and name != at else at
    here = slice(2 * joint, 2 * joint + 2)
    sides = tuple(side.removeprefix(f"{name} ") for side in machine.sides[here])
    forces = tuple(record.peak_force[:, here].max(axis=0).tolist())
    return _Gap(f"{called}\n{size}", motion - middle, lower - middle, upper - middle, sides, forces)


def _scale(gap: _Gap) -> float:
    """How many times larger a motion is drawn: as far as the picture reaches, and the clearance at most as ``GAP``."""
    farthest = float(np.abs(gap.motion).max()) or 1.0
    return min(FARTHEST / farthest, GAP / gap.upper) if gap.upper > 0.0 else FARTHEST / farthest


def _block(middle: float, half: float, low: float, high: float) -> Array:
    """Corners (4, 2) of a rectangle."""
    return np.array([(middle - half, low), (middle + half, low), (middle + half, high), (middle - half, high)])
