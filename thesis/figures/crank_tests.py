"""Two intervals between matrix updates, and the forces that they lead to. Figures 5.1 to 5.3."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes

from chaosgym.machines import SliderCrank
from thesis import plotting as thesis
from thesis.figures.computations import Computation, Runs
from thesis.figures.crank import HIGH_DAMPING, LARGE, SMALL, TRANSIENT, slider
from thesis.figures.figure import Finding, Panel, Parts, ThesisFigure
from thesis.figures.panels import cycles_panel
from thesis.figures.printed import printed
from thesis.figures.scored import scored, scored_finding
from thesis.scorecard.crank_quantities import AGREEMENT, UPDATED_CYCLES

CALM = slider(SMALL, crank_speed=270.0, contact_damping_ratio=HIGH_DAMPING)
WILD = slider(LARGE, crank_speed=190.0, contact_damping_ratio=HIGH_DAMPING)

INTERVALS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 9.0, 10.0)
"""Intervals of figure 5.3 [deg] that divide a revolution."""


def updated(
    machine: SliderCrank, intervals: Sequence[float], cycles: int, transient: int, resolution: float
) -> Mapping[str, Computation]:
    """Runs with several intervals."""
    machines = tuple(replace(machine, matrix_update_interval=interval) for interval in intervals)
    return {"runs": Runs(machines=machines, fields=("matrix_update_interval",), cycles=cycles, transient=transient)}


def pair(first: float, second: float) -> list[tuple[str, int, str]]:
    """Both runs of a test."""
    return [("runs", 0, f"updated every {first:g} deg"), ("runs", 1, f"updated every {second:g} deg")]


def agreement(parts: Parts, ax: Axes) -> None:
    """Printed cycle after which both runs agree."""
    thesis.printed_span(*printed("SSC-111"), ax, "both agree, printed")


def converging(parts: Parts) -> Sequence[Finding]:
    """After how many cycles does each run stay where it ends, and do they end together?"""
    wanted = printed("SSC-111").low
    return [scored_finding(parts, "SSC-111", f"runs with 5 and 10 deg agree after a transient of {wanted:g} cycles")]


PERIODIC_TEST = ThesisFigure(
    id="5.1",
    title="Matrix Update Test of a periodic response: ±0.032 mm, 270 rpm",
    shows="Peak force of every cycle for updates every 5 and 10 deg: after 6 cycles both agree.",
    parts=lambda resolution: {
        **updated(CALM, (5.0, 10.0), UPDATED_CYCLES, 0, resolution),
        **scored("SSC-111"),
    },
    panels=(
        cycles_panel("(a) 35 cycles", pair(5.0, 10.0), cycles=(0, 36), extra=agreement),
        cycles_panel("(b) the first ten", pair(5.0, 10.0), cycles=(0, 11), extra=agreement),
    ),
    compare=converging,
)


def printed_cycle(parts: Parts, ax: Axes) -> None:
    """Forces that the text prints at cycle 62."""
    marks = [thesis.PrintedForce(62.0, *printed(target)) for target in ("SSC-113", "SSC-114")]
    thesis.printed_forces(marks, ax)


def parting(parts: Parts) -> Sequence[Finding]:
    """Do the runs part, and how far are they at cycle 62?"""
    one, other = parts["runs"]["peaks"]
    apart = np.abs(one - other)
    first = np.flatnonzero(apart > AGREEMENT)
    when = f"first more than 3 N apart in cycle {first[0] + 1}" if len(first) else "never more than 3 N apart"
    wanted = [printed(target).low for target in ("SSC-113", "SSC-114")]
    here = (float(one[61]), float(other[61]))
    return [
        scored_finding(parts, "SSC-112", "runs with 5 and 6 deg part", more=f"{when}, at most {apart.max():.3g} N"),
        Finding(
            f"cycle 62: {wanted[0]:g} N with 5 deg, {wanted[1]:g} N with 6 deg",
            f"{here[0]:.3g} N and {here[1]:.3g} N",
            None,
            ("SSC-113", "SSC-114"),
        ),
    ]


CHAOTIC_TEST = ThesisFigure(
    id="5.2",
    title="Matrix Update Test of a chaotic response: ±0.254 mm, 190 rpm",
    shows="Peak force of every cycle for updates every 5 and 6 deg: they part; 85 and 105 N in cycle 62.",
    parts=lambda resolution: {**updated(WILD, (5.0, 6.0), 100, 0, resolution), **scored("SSC-112")},
    panels=(
        cycles_panel("(a) 100 cycles", pair(5.0, 6.0), cycles=(0, 101)),
        cycles_panel("(b) ten of them", pair(5.0, 6.0), cycles=(56, 68), extra=printed_cycle),
    ),
    compare=parting,
)


def paint_statistics(parts: Parts, ax: Axes) -> None:
    """Mean and standard deviation against the interval."""
    data = parts["runs"]
    peaks = data["peaks"]
    thesis.mean_and_deviation(data["matrix_update_interval"], peaks.mean(axis=1), peaks.std(axis=1), ax)
    ax.set(xlabel="matrix update interval [deg]", xlim=(0.0, 11.0), ylim=(0.0, 1.2 * ax.get_ylim()[1]))


def steady_statistics(parts: Parts) -> Sequence[Finding]:
    """How much do mean and standard deviation vary with the interval?"""
    peaks = parts["runs"]["peaks"]
    mean, deviation = peaks.mean(axis=1), peaks.std(axis=1)
    return [
        Finding(
            "mean and STD vary very little with the interval",
            f"mean {mean.min():.3g} to {mean.max():.3g} N, STD {deviation.min():.2g} to {deviation.max():.2g} N",
            bool(np.ptp(mean) <= 0.05 * mean.mean()),
            ("SSC-115",),
        )
    ]


UPDATE_STATISTICS = ThesisFigure(
    id="5.3",
    title="Mean and standard deviation of a chaotic response against the matrix update interval",
    shows="Both vary very little: the statistics of a chaotic response do not depend on the interval.",
    parts=lambda resolution: updated(WILD, INTERVALS, round(400 * resolution), TRANSIENT, resolution),
    panels=(Panel("±0.254 mm, 190 rpm", paint_statistics),),
    compare=steady_statistics,
)

FIGURES = (PERIODIC_TEST, CHAOTIC_TEST, UPDATE_STATISTICS)
