"""A machine with its gaps, for a report or a page."""

from matplotlib.axes import Axes

from chaosgym.machines import Machine
from chaosgym.machines.picture import CALM, draw
from chaosgym.simulation import simulate

BEFORE, CYCLES, SAMPLES = 100, 4, 60
"""Cycles in which the machine may settle, cycles that are drawn, and samples of each."""


def draw_machine(machine: Machine, panel: Axes) -> None:
    """Draw a machine at the start of a cycle, after it may have settled, with its gaps larger than they are."""
    record = simulate(machine, CYCLES, transient=BEFORE, samples_per_cycle=SAMPLES)
    draw(panel, record.of_joint(), CALM, 0.0, float(record.peak_force.max()) or 1.0)
