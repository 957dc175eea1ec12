"""Pictures of machines as plain shapes at some moments, and how matplotlib draws the first of them.

A machine says what is where (``Machine.sketch``). Environments draw one moment of it, ``explore`` moves through many.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array

INK, PALE, CALM, WILD, LIMIT = "#1f2933", "#cbd2d9", "#1f77b4", "#d1495b", "#e09f3e"
"""Colours: text and bodies, background lines, repeating steps, steps that count as Type III, force limit."""

STAYS = "stays"
"""Mark (gid) of a text that does not change from step to step, so that it is drawn once."""

EDGE = 0.3
"""Edge of a dot, as a share of its size."""


class Shape(NamedTuple):
    """Something to draw.

    Attributes
    ----------
    kind
        "back", lines behind everything; "body", a filled outline; "line"; "dot", a mark at each point.
    points : (moments, pieces, k, 2)
        Places at each moment, or with a single one at all of them.
    colour
        Of lines and edges; none for the colour that tells how the step went.
    width
        Of lines, or size of dots, in points of print.
    fill
        Of bodies and dots; none for ``colour``.
    alpha
        Opacity.
    marker
        Of dots, as matplotlib names them.
    """

    kind: str
    points: Array
    colour: str | None = INK
    width: float = 1.0
    fill: str | None = None
    alpha: float = 1.0
    marker: str = "o"


class Words(NamedTuple):
    """A text at a place (2,), with one string for each moment or one for all; ``stays`` if no step changes it."""

    place: tuple[float, float]
    text: Sequence[str]
    across: str = "left"
    up: str = "top"
    stays: bool = False


@dataclass(frozen=True)
class Sketch:
    """A machine at some moments: shapes and words between two corners (2,), with equal scales in both directions."""

    title: str
    low: Array
    high: Array
    shapes: Sequence[Shape]
    words: Sequence[Words] = ()


def moving(points: Array) -> Array:
    """One line or row of dots (moments, k, 2), as ``Shape`` has it; (k, 2) is one that stays."""
    return np.asarray(points, dtype=np.float64).reshape(-1, 1, *np.shape(points)[-2:])


def samples_of(record: Any) -> Array:
    """Displacement [m], velocity [m/s] and force [N] of all cycles in a row, (n, 3)."""
    return np.asarray(record.history).reshape(-1, 3)


def sample_at(record: Any, moment: float) -> int:
    """Row of ``samples_of`` at a moment of the last cycle."""
    per_cycle = len(samples_of(record)) // len(record)
    return (len(record) - 1) * per_cycle + int(moment * per_cycle)


def draw(panel: Any, record: Any, colour: str, moment: float, force_limit: float) -> None:
    """Draw the machine of a run in motion on axes of matplotlib.

    Parameters
    ----------
    record
        ``CycleRecord`` of the run, with its time history.
    colour
        Of what tells how the step went: calm, or of Type III.
    moment
        Of the last cycle, from 0 to 1.
    force_limit
        Force [N] to which pictures scale.
    """
    sketch = record.machine.sketch(record, np.array([sample_at(record, moment)]), force_limit)
    if sketch is None:
        draw_displacement(panel, record, colour, moment)
    else:
        draw_sketch(panel, sketch, colour)


def draw_sketch(panel: Any, sketch: Sketch, colour: str) -> None:
    """Draw the first moment of a sketch on axes of matplotlib; ``colour`` tells how the step went."""
    frame(panel, sketch.low, sketch.high)
    draw_shapes(panel, sketch.shapes, colour)
    for words in sketch.words:
        gid = STAYS if words.stays else None
        panel.text(*words.place, words.text[0], ha=words.across, va=words.up, fontsize=8, color=INK, gid=gid)
    panel.set_title(sketch.title, fontsize=8.5, loc="left", gid=STAYS, color=INK)


def frame(panel: Any, low: Array, high: Array) -> None:
    """Set equal scales that fill a panel, with two corners (2,) on it."""
    middle, (x, y) = 0.5 * (low + high), 0.5 * (high - low)
    box = panel.get_window_extent()
    share = box.height / box.width
    x, y = max(x, y / share), max(y, x * share)
    panel.set(xlim=(middle[0] - x, middle[0] + x), ylim=(middle[1] - y, middle[1] + y))
    panel.axis("off")


def draw_shapes(panel: Any, shapes: Iterable[Shape], colour: str = INK) -> None:
    """Draw shapes at their first moment."""
    from matplotlib.collections import LineCollection

    for kind, points, own, width, fill, alpha, marker in shapes:
        edge = own or colour
        if kind == "back":
            lines = LineCollection(list(points[0]), color=edge, linewidth=width, alpha=alpha, capstyle="round")
            panel.add_collection(lines, autolim=False)
            continue
        for piece in points[0]:
            if kind == "body":
                panel.fill(*piece.T, facecolor=fill or edge, edgecolor=edge, linewidth=width, alpha=alpha)
            elif kind == "line":
                panel.plot(*piece.T, color=edge, linewidth=width, alpha=alpha, solid_capstyle="round")
            else:
                looks = {"markersize": width, "markeredgecolor": edge, "markeredgewidth": EDGE * width}
                panel.plot(*piece.T, marker, color=fill or edge, alpha=alpha, **looks)


def draw_displacement(panel: Any, record: Any, colour: str, moment: float) -> None:
    """Draw the displacement in the last cycle, for a machine without a picture of its own."""
    samples = samples_of(record)
    last = samples[-(len(samples) // len(record)) :, 0] * 1e3
    panel.plot(np.linspace(0.0, 1.0, len(last)), last, color=colour, linewidth=1.0)
    panel.plot(moment, last[min(len(last) - 1, int(moment * len(last)))], "o", color=INK, markersize=5)
    panel.set_xlabel("cycle", fontsize=8, color=INK)
    panel.set_ylabel("displacement [mm]", fontsize=8, color=INK)
