"""Crank, rod and slider in motion, drawn on a panel, the gap of the monitored joint exaggerated."""

import math
from typing import Any, NamedTuple

import numpy as np
from matplotlib.collections import LineCollection

from chaosgym.arrays import Array
from chaosgym.machines.picture import INK, PALE, STAYS, sample_at, samples_of
from chaosgym.machines.slider_crank.mechanism import pin_and_pivot

GHOSTS = 12
"""Other positions shown behind the crank and its rod."""


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

WIDTH = 395.0
"""Width of the picture [mm]."""

GUIDE = 4.0
"""Thickness of the guide as drawn [mm]."""

FORCE_LENGTH = 45.0
"""Length of the force limit as drawn [mm]."""


def _crank_positions(machine: Any, angle: Array, displacement: Array) -> _CrankPositions:
    pin, pivot = (1e3 * place[:, :2] for place in pin_and_pivot(machine, angle))
    rattling = machine.monitored_joint == "slider"
    across = displacement / getattr(machine, machine.clearance_field) * GAP if rattling else np.zeros(len(angle))
    return _CrankPositions(pin, np.stack([pivot[:, 0], across], axis=1))


def draw_crank(panel: Any, record: Any, colour: str, moment: float, force_limit: float) -> None:
    """Draw crank, rod and slider on its guide; bars on the guide show where and how hard the slider hits it."""
    machine: Any = record.machine
    samples = samples_of(record)
    per_cycle = len(samples) // len(record)
    angle: Array = np.arange(len(samples)) % per_cycle * np.float64(2.0 * math.pi / per_cycle)
    places = _crank_positions(machine, angle, samples[:, 0])
    now = sample_at(record, moment)
    last = slice(len(samples) - per_cycle, len(samples))
    ghosts = range(last.start, last.stop, max(1, per_cycle // GHOSTS))
    rods = [np.stack([places.pin[ghost], places.slider[ghost]]) for ghost in ghosts]
    panel.add_collection(LineCollection(rods, color=PALE, linewidth=1.0, alpha=0.6), autolim=False)
    panel.plot(*places.pin[last].T, color=PALE, linewidth=1.2)
    clearance = getattr(machine, machine.clearance_field)
    rattles = machine.monitored_joint == "slider"
    _draw_guide(panel, places, SLIDER_HALF_HEIGHT + (GAP if rattles else 0.0))
    rod_end = places.pin[now]
    if rattles:
        _draw_impacts(panel, places, samples[:, 2] / force_limit, colour)
        panel.plot(*places.slider[last].T, color=colour, linewidth=1.0)
    else:
        rod_end = rod_end + _across_rod(places, now) * samples[now, 0] / clearance * BALL_GAP
        _draw_circle(panel, rod_end, BALL + BALL_GAP * machine.room[1] / clearance)
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
