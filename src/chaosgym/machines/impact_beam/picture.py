"""The beam in motion between its sensors, drawn on a panel, its gap exaggerated."""

from typing import Any

import numpy as np
from matplotlib.collections import LineCollection

from chaosgym.machines.picture import INK, PALE, STAYS, sample_at, samples_of

GHOSTS = 60
"""Other positions shown behind the beam."""


def draw_beam(panel: Any, record: Any, colour: str, moment: float) -> None:
    """Draw the beam between its sensors, its other positions pale, its deflection exaggerated."""
    beam: Any = record.machine
    gap = 0.13
    tip = samples_of(record)[:, 0] / beam.clearance * gap
    now = tip[sample_at(record, moment)]
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
