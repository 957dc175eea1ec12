"""Pictures of a mechanism: its links at a moment, and at eight crank angles, with gaps drawn larger than they are."""

import math
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.collections import LineCollection

from chaosgym.arrays import Array
from chaosgym.machines.mechanism.joints import GROUND
from chaosgym.machines.picture import INK, PALE, STAYS, WILD, sample_at, samples_of

if TYPE_CHECKING:
    from chaosgym.machines.mechanism.machine import MechanismMachine


GAP = 0.04
"""Gap as drawn, as a share of the mechanism's size."""


def link_lines(machine: "MechanismMachine", theta: Array) -> dict[str, Array]:
    """Places (B, k, 2) [m] of the points of each link at crank angles (B,), joined to one line through them.

    A mechanism in space is drawn as seen along z.
    """
    z = machine.nominal_places(theta)
    lines = {}
    for link in machine.mechanism.links:
        points = [place.moved(z[:, machine.mechanism.at[link.name]])[:, 0] for place in link.points.values()]
        lines[link.name] = np.stack(points, axis=1)[..., :2]
    return lines


def _joint_places(machine: "MechanismMachine", theta: Array) -> list[tuple[Any, Array]]:
    """Each joint and where its second point is, (B, 2)."""
    z = machine.nominal_places(theta)
    return [(joint, machine.mechanism.point(z, joint.second)[0][:, :2]) for joint in machine.mechanism.joints]


def _limits(machine: "MechanismMachine") -> tuple[Array, Array, float]:
    """Lowest and highest place of all points through a revolution, and the size of it all [m]."""
    theta = np.arange(72, dtype=np.float64) * (2.0 * math.pi / 72)
    lines = [line.reshape(-1, 2) for line in link_lines(machine, theta).values()]
    ground = np.array(list(machine.mechanism.ground.values()), dtype=float)
    places = np.concatenate([*lines, ground.reshape(-1, machine.mechanism.dimensions)[:, :2]])
    low, high = places.min(axis=0), places.max(axis=0)
    return low, high, float(np.max(high - low)) or 1.0


def _framed(panel: Any, machine: "MechanismMachine") -> float:
    """Set equal scales that fill a panel, with room for all that moves; the size [m]."""
    low, high, size = _limits(machine)
    middle, (x, y) = 0.5 * (low + high), 0.5 * (high - low) + 0.14 * size
    box = panel.get_window_extent()
    share = box.height / box.width
    x, y = max(x, y / share), max(y, x * share)
    panel.set(xlim=(middle[0] - x, middle[0] + x), ylim=(middle[1] - y, middle[1] + y))
    panel.axis("off")
    return size


def _ring(size: float) -> Array:
    """Circle (2, 60) as large as gaps are drawn."""
    around = np.linspace(0.0, 2.0 * math.pi, 60)
    return np.asarray(GAP * size * np.stack([np.cos(around), np.sin(around)]))


def _draw_guides(panel: Any, machine: "MechanismMachine", theta: Array, size: float) -> None:
    """Draw the guide of each prismatic joint on the ground: two lines, apart by the gap as it is drawn."""
    for joint, places in _joint_places(machine, theta):
        if joint.kind not in ("prismatic", "slot", "cylindrical") or joint.first[0] != GROUND:
            continue
        along = machine.mechanism.axes(machine.nominal_places(theta[:1]), joint)[0, :2, 0]
        if np.linalg.norm(along) < 0.1:
            continue
        along = along / np.linalg.norm(along)
        across = np.array([-along[1], along[0]])
        reach = places @ along
        middle = float(np.mean(places @ across))
        for side in (-1.0, 1.0):
            off = (middle + side * (GAP + 0.03) * size) * across
            ends = np.array([(end * along + off) for end in (reach.min() - 0.1 * size, reach.max() + 0.1 * size)])
            panel.plot(*ends.T, color=INK, alpha=0.4, linewidth=2.0)


def _draw_links(panel: Any, machine: "MechanismMachine", lines: dict[str, Array]) -> None:
    for name, line in lines.items():
        points = line[0]
        width = 5.0 if name == machine.mechanism.driver.second[0] else 2.5
        if len(points) > 1:
            panel.plot(*points.T, color=INK, linewidth=width, solid_capstyle="round", zorder=3)
        panel.plot(*points.T, "o", color="white", markeredgecolor=INK, markeredgewidth=1.5, markersize=5, zorder=4)


def draw_mechanism(panel: Any, record: Any, colour: str, moment: float, force_limit: float) -> None:
    """Draw the links in the last cycle, and the monitored joint's displacement where it is; see ``Machine.draw``."""
    machine = record.machine
    samples, now = samples_of(record), sample_at(record, moment)
    per_cycle = len(samples) // len(record)
    angle = np.array([2.0 * math.pi * (now % per_cycle) / per_cycle])
    ghosts = np.arange(12, dtype=np.float64) * (2.0 * math.pi / 12)
    size = _framed(panel, machine)
    pale = [line for link in link_lines(machine, ghosts).values() for line in link]
    panel.add_collection(LineCollection(pale, color=PALE, linewidth=1.0, alpha=0.6), autolim=False)
    _draw_guides(panel, machine, ghosts, size)
    joint = next(each for each in machine.mechanism.joints if each.name == machine.monitored)
    gap = getattr(machine, machine.clearance_field)
    z = machine.nominal_places(angle)
    across = machine.mechanism.axes(z, joint)[0, :2, 1]
    times = GAP * size / gap if gap > 0.0 else 1.0
    shift = samples[now, 0] * times * across
    lines = link_lines(machine, angle)
    _draw_links(panel, machine, lines)
    place = machine.mechanism.point(z, joint.second)[0][0, :2]
    around = np.linspace(0.0, 2.0 * math.pi, 60)
    panel.plot(
        place[0] + GAP * size * np.cos(around),
        place[1] + GAP * size * np.sin(around),
        color=INK,
        linewidth=1.0,
        zorder=5,
    )
    panel.plot(*(place + shift), "o", color=colour, markersize=7, zorder=6)
    force = samples[now, 2] / force_limit
    arrow = np.stack([place + shift, place + shift - 0.25 * size * np.clip(force, -2.0, 2.0) * across])
    panel.plot(*arrow.T, color=colour, linewidth=2.0, zorder=6)
    panel.text(
        0.01, 0.01, f"crank angle {math.degrees(angle[0]):.0f}°", transform=panel.transAxes, fontsize=8, color=INK
    )
    panel.set_title(
        f"Gap of {gap * 1e3:.3g} mm at the {joint.name}, drawn {times:.0f} times; dot: motion across it, bar: force",
        fontsize=8.5,
        loc="left",
        gid=STAYS,
        color=INK,
    )


def draw_poses(panels: Any, machine: "MechanismMachine") -> None:
    """Draw the links at equal steps of the crank angle, one in each of the panels; rings and guides show the gaps."""
    count = len(panels)
    theta = np.arange(count, dtype=np.float64) * (2.0 * math.pi / count)
    every = np.arange(72, dtype=np.float64) * (2.0 * math.pi / 72)
    paths = link_lines(machine, every)
    for k, panel in enumerate(panels):
        size = _framed(panel, machine)
        panel.set_aspect("equal")
        for path in paths.values():
            for point in range(path.shape[1]):
                panel.plot(*path[:, point].T, color=PALE, linewidth=0.8)
        _draw_guides(panel, machine, every, size)
        _draw_links(panel, machine, {name: line[k : k + 1] for name, line in link_lines(machine, theta).items()})
        for joint, places in _joint_places(machine, theta):
            if joint.opened:
                panel.plot(*(places[k][:, None] + _ring(size)), color=WILD, linewidth=1.2, zorder=5)
        for place in machine.mechanism.ground.values():
            panel.plot(*place[:2], "^", color=INK, markersize=6)
        panel.set_title(f"{math.degrees(theta[k]):.0f}°", fontsize=8.5)
