"""What pictures of machines share: their colours, and the motion where a machine has no picture of its own.

A picture shows one moment of the last cycle of a step, and pale what happened in the rest of the step.
"""

from typing import Any

import numpy as np

from chaosgym.arrays import Array

INK, PALE, CALM, WILD, LIMIT = "#1f2933", "#cbd2d9", "#1f77b4", "#d1495b", "#e09f3e"
"""Colours: text and bodies, background lines, repeating steps, steps that count as Type III, force limit."""

STAYS = "stays"
"""Mark (gid) of a text that does not change from step to step, so that it is drawn once."""


def samples_of(record: Any) -> Array:
    """Displacement [m], velocity [m/s] and force [N] of all cycles in a row, (n, 3)."""
    return np.asarray(record.history).reshape(-1, 3)


def sample_at(record: Any, moment: float) -> int:
    """Row of ``samples_of`` at a moment of the last cycle."""
    per_cycle = len(samples_of(record)) // len(record)
    return (len(record) - 1) * per_cycle + int(moment * per_cycle)


def draw_displacement(panel: Any, record: Any, colour: str, moment: float, force_limit: float) -> None:
    """Draw the displacement in the last cycle; see ``Machine.draw``."""
    samples = samples_of(record)
    last = samples[-(len(samples) // len(record)) :, 0] * 1e3
    panel.plot(np.linspace(0.0, 1.0, len(last)), last, color=colour, linewidth=1.0)
    panel.plot(moment, last[min(len(last) - 1, int(moment * len(last)))], "o", color=INK, markersize=5)
    panel.set_xlabel("cycle", fontsize=8, color=INK)
    panel.set_ylabel("displacement [mm]", fontsize=8, color=INK)
