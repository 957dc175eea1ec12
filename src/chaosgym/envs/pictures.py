"""Pictures of each machine in motion, drawn on the panel of a dashboard, its gap exaggerated.

A picture shows one moment of the last cycle of a step, and pale what happened in the rest of the step.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection
from numpy.typing import NDArray

from chaosgym.machines.slider_crank.kinematics import crank_pin, slider_position
from chaosgym.simulation import CycleRecord

Array = NDArray[np.float64]

INK, PALE, CALM, WILD, LIMIT = "#1f2933", "#cbd2d9", "#1f77b4", "#d1495b", "#e09f3e"
"""Colours: text and bodies, background lines, repeating steps, steps that count as Type III, force limit."""

STAYS = "stays"
"""Mark (gid) of a text that does not change from step to step, so that it is drawn once."""

GHOSTS = 60
"""Other positions shown behind the beam."""

CRANK_GHOSTS = 12
"""Other positions shown behind the crank and its rod."""


class Picture(NamedTuple):
    """How to draw a machine.

    ``draw(panel, record, colour, moment, force_limit)`` draws it at a moment of its last cycle, from 0 to 1;
    ``room(machine)`` is how far [m] the gap lets its displacement go to either side.
    """

    draw: Callable[[Any, Any, str, float, float], None]
    room: Callable[[Any], float]


def samples_of(record: CycleRecord) -> Array:
    """Displacement [m], velocity [m/s] and force [N] of all cycles in a row, (n, 3)."""
    assert record.history is not None
    return record.history.reshape(-1, 3)


def _sample(record: CycleRecord, moment: float) -> int:
    """Row of ``samples_of`` at a moment of the last cycle."""
    per_cycle = len(samples_of(record)) // len(record)
    return (len(record) - 1) * per_cycle + int(moment * per_cycle)


def draw_beam(panel: Any, record: CycleRecord, colour: str, moment: float, force_limit: float) -> None:
    """Draw the beam between its sensors, its other positions pale, its deflection exaggerated."""
    beam: Any = record.machine
    gap = 0.13
    tip = samples_of(record)[:, 0] / beam.clearance * gap
    now = tip[_sample(record, moment)]
    along = np.linspace(0.0, 1.0, 2)
    others = [np.column_stack([along, deflection * along]) for deflection in tip[:: max(1, len(tip) // GHOSTS)]]
    panel.add_collection(LineCollection(others, color=PALE, linewidth=1.2, alpha=0.45, capstyle="round"), autolim=False)
    push = 0.65
    panel.plot([push, push], [push * now - 0.03, -0.23], color=INK, linewidth=1.2)
    panel.plot(push, push * now - 0.03, "^", color=INK, markersize=6)
    panel.plot(push, -0.23, "v", color=INK, markersize=6)
    panel.text(push, -0.26, "shaker", ha="center", va="top", fontsize=8, color=INK, gid=STAYS)
    panel.plot(along, now * along, color=INK, linewidth=6.0, solid_capstyle="round")
    panel.fill_between([-0.09, -0.05], -0.1, 0.1, color=PALE, linewidth=0)
    panel.plot([-0.05, 0.0], [0.0, 0.0], color=INK, linewidth=2.0)
    panel.plot(0.0, 0.0, marker="o", color="white", markeredgecolor=INK, markeredgewidth=2.5, markersize=9)
    panel.text(-0.09, -0.12, "flexure pivot", ha="left", va="top", fontsize=8, color=INK, gid=STAYS)
    for side, (name, sign) in enumerate(zip(beam.sides, (1.0, -1.0), strict=True)):
        peak = float(record.peak_force[:, side].max())
        edge = sign * (gap + 0.014)
        panel.fill_between([0.93, 1.07], edge, edge + sign * 0.05, color=colour, linewidth=0)
        panel.text(
            1.0,
            edge + sign * 0.07,
            f"{name} sensor: {peak:.0f} N",
            ha="center",
            fontsize=8,
            color=INK,
            va="bottom" if sign > 0 else "top",
        )
    panel.set(xlim=(-0.1, 1.24), ylim=(-0.32, 0.32))
    panel.set_title(
        f"Beam in its gap of ±{beam.clearance * 1e3:.3g} mm, exaggerated; peak forces of the step",
        fontsize=8.5,
        loc="left",
        gid=STAYS,
        color=INK,
    )
    panel.axis("off")


class _CrankPositions(NamedTuple):
    """Places [mm] in the plane of the guide: ``pin`` (n, 2) of the crank, ``slider`` (n, 2) with exaggerated gap."""

    pin: Array
    slider: Array


GAP, SLIDER_HALF_HEIGHT, SLIDER_HALF_LENGTH = 9.0, 13.0, 24.0
"""Half gap at the slider and the slider itself as drawn [mm]."""

BARS = 600
"""Contact forces that are drawn, at the most."""

BALL_GAP, BALL = 5.0, 5.0
"""Half gap at the ball joint and radius of the ball as drawn [mm]."""

SENSOR_GAP = math.sqrt(3.0)
"""How far a ball between tetrahedral sensors gets from its centre across the rod, in half gaps."""

WIDTH = 395.0
"""Width of the picture [mm]."""

GUIDE = 4.0
"""Thickness of the guide as drawn [mm]."""

FORCE_LENGTH = 45.0
"""Length of the force limit as drawn [mm]."""


def _crank_positions(machine: Any, angle: Array, displacement: Array) -> _CrankPositions:
    turned = math.radians(machine.motor_angle)
    pin = 1e3 * crank_pin(angle, machine.crank_radius, turned)[:, :2]
    along = 1e3 * slider_position(angle, machine.crank_radius, machine.rod_length, turned)
    rattling = machine.monitored_joint == "slider"
    across = displacement / _crank_clearance(machine) * GAP if rattling else np.zeros(len(angle))
    return _CrankPositions(pin, np.stack([along, across], axis=1))


def _crank_clearance(machine: Any) -> float:
    """Half gap [m] of the monitored joint."""
    return float(machine.slider_clearance if machine.monitored_joint == "slider" else machine.ball_clearance)


def _crank_room(machine: Any) -> float:
    """How far [m] the monitored joint lets its displacement go to either side."""
    sensors = machine.monitored_joint == "ball" and machine.ball_joint == "instrumented"
    return _crank_clearance(machine) * (SENSOR_GAP if sensors else 1.0)


def draw_crank(panel: Any, record: CycleRecord, colour: str, moment: float, force_limit: float) -> None:
    """Draw crank, rod and slider on its guide; bars on the guide show where and how hard the slider hits it."""
    machine: Any = record.machine
    samples = samples_of(record)
    per_cycle = len(samples) // len(record)
    angle: Array = np.arange(len(samples)) % per_cycle * np.float64(2.0 * math.pi / per_cycle)
    places = _crank_positions(machine, angle, samples[:, 0])
    now = _sample(record, moment)
    last = slice(len(samples) - per_cycle, len(samples))
    ghosts = range(last.start, last.stop, max(1, per_cycle // CRANK_GHOSTS))
    rods = [np.stack([places.pin[ghost], places.slider[ghost]]) for ghost in ghosts]
    panel.add_collection(LineCollection(rods, color=PALE, linewidth=1.0, alpha=0.6), autolim=False)
    panel.plot(*places.pin[last].T, color=PALE, linewidth=1.2)
    clearance = _crank_clearance(machine)
    rattles = machine.monitored_joint == "slider"
    _draw_guide(panel, places, SLIDER_HALF_HEIGHT + (GAP if rattles else 0.0))
    rod_end = places.pin[now]
    if rattles:
        _draw_impacts(panel, places, samples[:, 2] / force_limit, colour)
        panel.plot(*places.slider[last].T, color=colour, linewidth=1.0)
    else:
        rod_end = rod_end + _across_rod(places, now) * samples[now, 0] / clearance * BALL_GAP
        _draw_circle(panel, rod_end, BALL + BALL_GAP * _crank_room(machine) / clearance)
        _draw_circle(panel, places.pin[now], BALL)
    _draw_links(panel, places.pin[now], rod_end, places.slider[now])
    degrees = math.degrees(angle[now])
    panel.text(0.0, -62.0, f"crank angle {degrees:.0f}°", ha="center", va="top", fontsize=8, color=INK)
    for side, (sign, word) in enumerate(((-1.0, "up"), (1.0, "down"))):
        panel.text(
            330.0,
            sign * 84.0,
            f"largest force {word}: {record.peak_force[:, side].max():.0f} N",
            fontsize=8,
            color=INK,
            ha="right",
            va="center",
        )
    box = panel.get_window_extent()
    reach = 0.5 * WIDTH * box.height / box.width
    panel.set(xlim=(-60.0, WIDTH - 60.0), ylim=(-reach, reach))
    times = (GAP if rattles else BALL_GAP) / (1e3 * clearance)
    bars = "; bars: contact forces" if rattles else ""
    panel.set_title(
        f"Gap of ±{clearance * 1e3:.3g} mm at the {machine.monitored_joint}, drawn {times:.0f} times{bars}",
        fontsize=8.5,
        loc="left",
        gid=STAYS,
        color=INK,
    )
    panel.axis("off")


def _across_rod(places: _CrankPositions, now: int) -> Array:
    """Unit vector across the rod."""
    rod = places.slider[now] - places.pin[now]
    return np.asarray(np.array([-rod[1], rod[0]]) / np.linalg.norm(rod))


def _draw_guide(panel: Any, places: _CrankPositions, edge: float) -> None:
    ends = [places.slider[:, 0].min() - SLIDER_HALF_LENGTH, places.slider[:, 0].max() + SLIDER_HALF_LENGTH]
    for sign in (-1.0, 1.0):
        panel.fill_between(ends, sign * edge, sign * (edge + GUIDE), color=INK, alpha=0.4, linewidth=0)


def _draw_circle(panel: Any, centre: Array, radius: float) -> None:
    around = np.linspace(0.0, 2.0 * math.pi, 60)
    panel.plot(centre[0] + radius * np.cos(around), centre[1] + radius * np.sin(around), color=INK, linewidth=1.5)


def _draw_impacts(panel: Any, places: _CrankPositions, share: Array, colour: str) -> None:
    """Bars on the guide where it pushes the slider; ``share`` (n,) is the force, upward positive, in force limits."""
    edge = SLIDER_HALF_HEIGHT + GAP + GUIDE
    touching = np.flatnonzero(share)
    touching = touching[:: max(1, len(touching) // BARS)]
    push, along = share[touching], places.slider[touching, 0]
    foot = -np.sign(push) * edge
    ends = np.stack([np.column_stack([along, foot]), np.column_stack([along, foot - push * FORCE_LENGTH])], axis=1)
    panel.add_collection(LineCollection(list(ends), color=colour, linewidth=1.0, alpha=0.7), autolim=False)


def _draw_links(panel: Any, pin: Array, rod_end: Array, slider: Array) -> None:
    panel.plot([0.0, pin[0]], [0.0, pin[1]], color=INK, linewidth=6.0, solid_capstyle="round")
    panel.plot(*np.stack([rod_end, slider]).T, color=INK, linewidth=3.0, solid_capstyle="round")
    left, right = slider[0] - SLIDER_HALF_LENGTH, slider[0] + SLIDER_HALF_LENGTH
    low, high = slider[1] - SLIDER_HALF_HEIGHT, slider[1] + SLIDER_HALF_HEIGHT
    panel.fill([left, right, right, left], [low, low, high, high], facecolor="white", edgecolor=INK, linewidth=2.0)
    for place in ((0.0, 0.0), pin, slider):
        panel.plot(*place, marker="o", color="white", markeredgecolor=INK, markeredgewidth=2.0, markersize=7)


PICTURES = {
    "impact-beam": Picture(draw_beam, lambda beam: float(beam.clearance)),
    "slider-crank": Picture(draw_crank, _crank_room),
}
"""What draws a machine, by its name."""


def draw_displacement(panel: Any, record: CycleRecord, colour: str, moment: float, force_limit: float) -> None:
    """Draw the displacement in the last cycle, for a machine without a picture of its own."""
    samples = samples_of(record)
    last = samples[-(len(samples) // len(record)) :, 0] * 1e3
    panel.plot(np.linspace(0.0, 1.0, len(last)), last, color=colour, linewidth=1.0)
    panel.plot(moment, last[min(len(last) - 1, int(moment * len(last)))], "o", color=INK, markersize=5)
    panel.set_xlabel("cycle", fontsize=8, color=INK)
    panel.set_ylabel("displacement [mm]", fontsize=8, color=INK)


PLAIN = Picture(draw_displacement, lambda machine: float(getattr(machine, machine.clearance_field)))
"""Picture of a machine that has none of its own."""
