"""What does a step look like? The tip in its gap, its phase portrait, the contact force, and the job so far."""

from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chaosgym.envs.drive import SpeedDrive
from chaosgym.envs.tasks import Task
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import CycleRecord

INK, PALE, CALM, WILD, LIMIT = "#1f2933", "#cbd2d9", "#1f77b4", "#d1495b", "#e09f3e"
"""Colours: text and beam, background lines, repeating steps, steps that count as Type III, force limit."""

SIZE = (9.6, 6.4)
DOTS_PER_INCH = 100

GHOSTS = 60
"""Earlier positions shown behind the beam."""


class Dashboard:
    """Four panels that show the last step and the job so far.

    Parameters
    ----------
    machine
        For the picture of it.
    drive, task
        For the ranges of the axes.
    window
        Show in a window of matplotlib's current backend instead of returning pictures.
    """

    def __init__(self, machine: Machine, drive: SpeedDrive, task: Task, *, window: bool) -> None:
        self._drive, self._task = drive, task
        self._draw_machine = PICTURES[machine.name]
        self._unit = parameters_of(machine)[machine.speed_field].unit
        if window:
            from matplotlib import pyplot

            self._figure = pyplot.figure(figsize=SIZE, dpi=DOTS_PER_INCH)
        else:
            self._figure = Figure(figsize=SIZE, dpi=DOTS_PER_INCH)
            FigureCanvasAgg(self._figure)
        self._window = window
        grid = self._figure.add_gridspec(
            2, 2, left=0.07, right=0.945, bottom=0.085, top=0.9, hspace=0.36, wspace=0.22, width_ratios=(1.25, 1.0)
        )
        self._panels = [self._figure.add_subplot(grid[cell]) for cell in range(4)]
        self._speed_axis = self._panels[3].twinx()

    def start(self, record: CycleRecord) -> None:
        """Begin a job."""
        self._speeds: list[float] = []
        self._peaks: list[NDArray[np.float64]] = []
        self._wild: list[bool] = []
        self._top_velocity = 0.0
        self._record = record

    def add(self, record: CycleRecord, type_iii: bool) -> None:
        """Take in a step."""
        self._speeds.append(_speed(record))
        self._peaks.append(record.peak_force[:, 0])
        self._wild.append(type_iii)
        self._record = record

    def draw(self) -> NDArray[np.uint8] | None:
        """Draw the last step; return the picture (height, width, 3), or None for a window."""
        record = self._record
        colour = WILD if self._wild and self._wild[-1] else CALM
        for panel in (*self._panels, self._speed_axis):
            panel.clear()
            panel.tick_params(colors=INK, labelsize=8)
            panel.spines[["top", "right"]].set_visible(False)
        picture, portrait, force, job = self._panels
        self._draw_machine(picture, record, colour)
        self._draw_portrait(portrait, record, colour)
        self._draw_force(force, record, colour)
        self._draw_job(job)
        self._draw_title(record, colour)
        canvas: Any = self._figure.canvas
        canvas.draw()
        if not self._window:
            return np.asarray(canvas.buffer_rgba())[:, :, :3].copy()
        if canvas.required_interactive_framework is not None:
            canvas.manager.show()
            canvas.flush_events()
        return None

    def close(self) -> None:
        """Close the window."""
        if self._window:
            from matplotlib import pyplot

            pyplot.close(self._figure)

    def _draw_title(self, record: CycleRecord, colour: str) -> None:
        verdict = "does not repeat: counts as Type III" if colour == WILD else "repeats"
        done = len(self._speeds) * self._task.cycles_per_step
        self._figure.suptitle(
            f"{_speed(record):.2f} {self._unit}    {done} of {self._task.job_cycles} cycles    peak force {verdict}",
            color=colour, fontsize=12, x=0.075, ha="left", fontweight="bold",
        )  # fmt: skip

    def _draw_portrait(self, panel: Any, record: CycleRecord, colour: str) -> None:
        samples = _samples(record)
        gap = _clearance(record) * 1e3
        panel.axvspan(gap, 10.0 * gap, color=PALE, alpha=0.5, linewidth=0)
        panel.axvspan(-10.0 * gap, -gap, color=PALE, alpha=0.5, linewidth=0)
        panel.plot(samples[:, 0] * 1e3, samples[:, 1], color=colour, linewidth=0.8)
        panel.plot(record.displacement * 1e3, record.velocity, "o", color=INK, markersize=4)
        self._top_velocity = max(self._top_velocity, float(np.abs(samples[:, 1]).max()))
        panel.set(xlim=(-1.15 * gap, 1.15 * gap), ylim=(-1.1 * self._top_velocity, 1.1 * self._top_velocity))
        panel.set_title("Phase portrait; dots: start of each cycle", fontsize=9, loc="left", color=INK)
        panel.set_xlabel("displacement [mm]", fontsize=8, color=INK)
        panel.set_ylabel("velocity [m/s]", fontsize=8, color=INK)

    def _draw_force(self, panel: Any, record: CycleRecord, colour: str) -> None:
        force = _samples(record)[:, 2]
        cycles = len(record)
        panel.axhline(self._task.force_limit, color=LIMIT, linewidth=1.0, linestyle="--")
        panel.axhline(-self._task.force_limit, color=LIMIT, linewidth=1.0, linestyle="--")
        panel.fill_between(np.arange(len(force)) * cycles / len(force), force, color=colour, linewidth=0.6)
        panel.set(xlim=(0, cycles), ylim=(-1.15 * self._task.force_limit, 1.15 * self._task.force_limit))
        panel.set_title("Contact force in this step", fontsize=9, loc="left", color=INK)
        panel.set_xlabel("cycle", fontsize=8, color=INK)
        panel.set_ylabel("force [N]", fontsize=8, color=INK)

    def _draw_job(self, panel: Any) -> None:
        step = self._task.cycles_per_step
        peaks = np.concatenate([np.empty(0), *self._peaks])
        wild = np.repeat(np.array(self._wild, dtype=bool), step)
        cycle = np.arange(len(peaks))
        for chosen, colour in ((~wild, CALM), (wild, WILD)):
            panel.plot(cycle[chosen], peaks[chosen], ".", color=colour, markersize=3)
        panel.axhline(self._task.force_limit, color=LIMIT, linewidth=1.0, linestyle="--")
        panel.set(xlim=(0, self._task.job_cycles), ylim=(0, 1.15 * self._task.force_limit))
        panel.set_title("Job: peak force (dots) and speed (line)", fontsize=9, loc="left", color=INK)
        panel.set_xlabel("cycle", fontsize=8, color=INK)
        panel.set_ylabel("peak force [N]", fontsize=8, color=INK)
        axis = self._speed_axis
        axis.step(np.arange(len(self._speeds)) * step, self._speeds, where="post", color=INK, linewidth=1.2)
        margin = 0.05 * (self._drive.highest_speed - self._drive.lowest_speed)
        axis.set_ylim(self._drive.lowest_speed - margin, self._drive.highest_speed + margin)
        axis.yaxis.set_label_position("right")
        axis.set_ylabel(f"speed [{self._unit}]", fontsize=8, color=INK)


def _samples(record: CycleRecord) -> NDArray[np.float64]:
    assert record.history is not None
    return record.history.reshape(-1, 3)


def _clearance(record: CycleRecord) -> float:
    return float(getattr(record.machine, record.machine.clearance_field))


def _speed(record: CycleRecord) -> float:
    return float(getattr(record.machine, record.machine.speed_field))


def draw_beam(panel: Any, record: CycleRecord, colour: str) -> None:
    """Draw the beam between its sensors at the end of the step, its earlier positions pale, deflection exaggerated."""
    gap = 0.13
    tip = _samples(record)[:, 0] / _clearance(record) * gap
    along = np.linspace(0.0, 1.0, 2)
    for deflection in tip[:: max(1, len(tip) // GHOSTS)]:
        panel.plot(along, deflection * along, color=PALE, linewidth=1.2, alpha=0.45, solid_capstyle="round")
    push = 0.65
    panel.annotate(
        "", (push, push * tip[-1] - 0.02), (push, -0.24), arrowprops={"arrowstyle": "<|-|>", "color": INK, "lw": 1.2}
    )
    panel.text(push, -0.26, "shaker", ha="center", va="top", fontsize=8, color=INK)
    panel.plot(along, tip[-1] * along, color=INK, linewidth=6.0, solid_capstyle="round")
    panel.fill_between([-0.09, -0.05], -0.1, 0.1, color=PALE, linewidth=0)
    panel.plot([-0.05, 0.0], [0.0, 0.0], color=INK, linewidth=2.0)
    panel.plot(0.0, 0.0, marker="o", color="white", markeredgecolor=INK, markeredgewidth=2.5, markersize=9)
    panel.text(-0.09, -0.12, "flexure pivot", ha="left", va="top", fontsize=8, color=INK)
    for side, (name, sign) in enumerate(zip(record.machine.sides, (1.0, -1.0), strict=True)):
        peak = float(record.peak_force[:, side].max())
        edge = sign * (gap + 0.014)
        panel.fill_between([0.93, 1.07], edge, edge + sign * 0.05, color=colour, linewidth=0)
        panel.text(1.0, edge + sign * 0.07, f"{name} sensor: {peak:.0f} N", ha="center", fontsize=8, color=INK,
                   va="bottom" if sign > 0 else "top")  # fmt: skip
    panel.set(xlim=(-0.1, 1.24), ylim=(-0.32, 0.32))
    panel.set_title(
        f"Beam in its gap of ±{_clearance(record) * 1e3:.3g} mm, exaggerated; peak forces of the step",
        fontsize=9, loc="left", color=INK,
    )  # fmt: skip
    panel.axis("off")


PICTURES = {"impact-beam": draw_beam}
"""What draws a machine, by its name."""
