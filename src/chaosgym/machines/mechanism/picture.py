"""Pictures of a mechanism: its links at a moment, and at eight crank angles, with gaps drawn larger than they are."""

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.machines.mechanism.joints import GROUND
from chaosgym.machines.mechanism.opened import OpenedMechanism
from chaosgym.machines.picture import PALE, WILD, Shape, Sketch, Words, draw_shapes, frame, moving, samples_of

GAP, ROOM = 0.04, 0.14
"""Gap as drawn and space around the mechanism, as shares of its size."""

COIL = 0.05
"""Half the width of a spring as drawn, as a share of its length."""

AROUND, GHOSTS = 72, 12
"""Crank angles by which the ways of all points are known, and those of them at which pale links are drawn."""

CIRCLE = np.stack([np.cos(turn := np.linspace(0.0, 2.0 * math.pi, 60)), np.sin(turn)], axis=1)


def link_lines(machine: OpenedMechanism, z: Array) -> dict[str, Array]:
    """Places (B, k, 2) [m] of the points of each link, of coordinates z (B, z), joined to one line through them.

    A mechanism in space is drawn as seen along z.
    """
    lines = {}
    for link in machine.mechanism.links:
        points = [place.moved(z[:, machine.mechanism.at[link.name]])[:, 0] for place in link.points.values()]
        lines[link.name] = np.stack(points, axis=1)[..., :2]
    return lines


def _joint_places(machine: OpenedMechanism, z: Array) -> list[tuple[Any, Array]]:
    """Each joint and where its second point is, (B, 2)."""
    return [(joint, machine.mechanism.point(z, joint.second)[0][:, :2]) for joint in machine.mechanism.joints]


def _limits(machine: OpenedMechanism, around: Array) -> tuple[Array, Array, float]:
    """Corners (2,) around all points through a revolution, with some space, and the size of it all [m]."""
    lines = [line.reshape(-1, 2) for line in link_lines(machine, around).values()]
    ground = np.array(list(machine.mechanism.ground.values()), dtype=float)
    places = np.concatenate([*lines, ground.reshape(-1, machine.mechanism.dimensions)[:, :2]])
    low, high = places.min(axis=0), places.max(axis=0)
    size = float(np.max(high - low)) or 1.0
    return low - ROOM * size, high + ROOM * size, size


def _turn(count: int) -> Array:
    """Crank angles (count,) [rad] at equal steps."""
    return np.arange(count, dtype=np.float64) * (2.0 * math.pi / count)


def _guides(machine: OpenedMechanism, around: Array, size: float) -> list[Shape]:
    """The guide of each prismatic joint on the ground: two lines, apart by the gap as it is drawn."""
    lines = []
    for joint, places in _joint_places(machine, around):
        if joint.kind not in ("prismatic", "slot", "cylindrical") or joint.first[0] != GROUND:
            continue
        along = machine.mechanism.axes(around[:1], joint)[0, :2, 0]
        if np.linalg.norm(along) < 0.1:
            continue
        along = along / np.linalg.norm(along)
        across = np.array([-along[1], along[0]])
        reach = places @ along
        middle = float(np.mean(places @ across))
        for side in (-1.0, 1.0):
            off = (middle + side * (GAP + 0.03) * size) * across
            ends = np.array([end * along + off for end in (reach.min() - 0.1 * size, reach.max() + 0.1 * size)])
            lines.append(Shape("line", moving(ends), width=2.0, alpha=0.4))
    return lines


def _links(machine: OpenedMechanism, z: Array) -> list[Shape]:
    """Each link as a line through its points, which are dots; the crank is the thickest."""
    shapes = []
    for name, line in link_lines(machine, z).items():
        width = 5.0 if name == machine.mechanism.driver.second[0] else 2.5
        shapes += [Shape("line", moving(line), width=width)] if line.shape[1] > 1 else []
        shapes.append(Shape("dot", moving(line), width=5.0, fill="white"))
    return shapes


def _springs(machine: OpenedMechanism, z: Array) -> list[Shape]:
    """Each spring as a zigzag between its points, a damper alone as a straight line."""
    shapes, shares = [], np.array([0.0, *np.linspace(0.2, 0.8, 8), 1.0])
    for spring in machine.mechanism.springs:
        first, second = (machine.mechanism.point(z, end)[0][:, None, :2] for end in (spring.first, spring.second))
        along = second - first
        across = COIL * np.stack([-along[..., 1], along[..., 0]], axis=-1) * bool(spring.stiffness)
        sides = np.array([0.0, 0.0, *3 * (1.0, -1.0), 0.0, 0.0])
        line = first + shares[:, None] * along + sides[:, None] * across
        shapes.append(Shape("line", moving(line), width=1.0, alpha=0.7))
    return shapes


def sketch_of_mechanism(record: Any, rows: NDArray[np.int64], force_limit: float) -> Sketch:
    """The links, and the monitored joint's displacement where it is; see ``Machine.sketch``."""
    machine, samples, per_cycle = record.machine, samples_of(record), record.history.shape[1]
    theta = (rows % per_cycle) * (2.0 * math.pi / per_cycle)
    around, z = machine.nominal_places(_turn(AROUND)), machine.nominal_places(theta)
    low, high, size = _limits(machine, around)
    pale = [line for link in link_lines(machine, around[:: AROUND // GHOSTS]).values() for line in link]
    joint = next(each for each in machine.mechanism.joints if each.name == machine.monitored)
    gap = getattr(machine, machine.clearance_field)
    across = machine.mechanism.axes(z, joint)[:, :2, 1]
    place = machine.mechanism.point(z, joint.second)[0][:, :2]
    times = GAP * size / gap if gap > 0.0 else 1.0
    inside = place + times * samples[rows, 0, None] * across
    push = 0.25 * size * np.clip(samples[rows, 2, None] / force_limit, -2.0, 2.0) * across
    shapes = (
        *(Shape("back", line[None, None], PALE, alpha=0.6) for line in pale),
        *_guides(machine, around, size),
        *_springs(machine, z),
        *_links(machine, z),
        Shape("line", moving(place[:, None] + GAP * size * CIRCLE)),
        Shape("dot", moving(inside[:, None]), None, 7.0),
        Shape("line", moving(np.stack([inside, inside - push], axis=1)), None, 2.0),
    )
    return Sketch(
        f"Gap of {gap * 1e3:.3g} mm at the {joint.name}, drawn {times:.0f} times; dot: motion across it, bar: force",
        low,
        high,
        shapes,
        [Words((low[0], low[1]), [f"crank angle {math.degrees(angle):.0f}°" for angle in theta], up="bottom")],
    )


def draw_poses(panels: Any, machine: OpenedMechanism) -> None:
    """Draw the links at equal steps of the crank angle, one in each of the panels; rings and guides show the gaps."""
    theta, around = _turn(len(panels)), machine.nominal_places(_turn(AROUND))
    low, high, size = _limits(machine, around)
    behind = [
        Shape("line", moving(path[:, point]), PALE, 0.8)
        for path in link_lines(machine, around).values()
        for point in range(path.shape[1])
    ] + _guides(machine, around, size)
    ground = [
        Shape("dot", moving(np.array([place[:2]])), width=6.0, marker="^")
        for place in machine.mechanism.ground.values()
    ]
    for panel, angle in zip(panels, theta, strict=True):
        z = machine.nominal_places(np.array([angle]))
        frame(panel, low, high)
        panel.set_aspect("equal")
        rings = [
            Shape("line", moving(place + GAP * size * CIRCLE), WILD, 1.2)
            for joint, place in _joint_places(machine, z)
            if joint.opened
        ]
        draw_shapes(panel, [*behind, *_springs(machine, z), *_links(machine, z), *rings, *ground])
        panel.set_title(f"{math.degrees(angle):.0f}°", fontsize=8.5)
