"""Pictures of a step: the machine in motion, its phase portrait, the contact force, and the job so far."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chaosgym.envs.observation import OBSERVATION_NAMES
from chaosgym.envs.pictures import CALM, INK, LIMIT, PALE, PICTURES, PLAIN, WILD, samples_of
from chaosgym.envs.task import Task
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.simulation import CycleRecord

SIZE = (9.6, 6.4)
DOTS_PER_INCH = 100

MEAN_PEAK = OBSERVATION_NAMES.index("mean_peak_force")

STROBE = 12
"""Each step is shown at a moment of its last cycle, this fraction of a cycle later than the step before: every step
ends at the same phase, so that the machine would stand still otherwise."""


class Dashboard:
    """Four panels that show the last step and the job so far.

    Parameters
    ----------
    machine
        For the picture of it.
    task
        For the ranges of the axes.
    window
        Show in a window of matplotlib's current backend instead of returning pictures.
    """

    def __init__(self, machine: Machine, task: Task, *, window: bool) -> None:
        self._task = task
        self._picture = PICTURES.get(machine.name, PLAIN)
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

    def start(self) -> None:
        """Begin a job."""
        self._speeds: list[float] = []
        self._demands: list[float] = []
        self._peaks: list[float] = []
        self._wild: list[bool] = []
        self._top_velocity = self._top_force = 0.0

    def add(self, info: Mapping[str, Any], observation: NDArray[np.float32]) -> None:
        """Take in a step."""
        self._speeds.append(info["speed"])
        self._demands.append(info["demand"])
        self._peaks.append(float(observation[MEAN_PEAK]))
        self._top_force = max(self._top_force, info["largest_force"])
        self._wild.append(info["type_iii"] > 0.5)

    def draw(self, record: CycleRecord) -> NDArray[np.uint8] | None:
        """Draw the last step, given with its time history; return (height, width, 3), or None for a window."""
        colour = WILD if self._wild and self._wild[-1] else CALM
        for panel in (*self._panels, self._speed_axis):
            panel.clear()
            panel.tick_params(colors=INK, labelsize=8)
            panel.spines[["top", "right"]].set_visible(False)
        picture, portrait, force, job = self._panels
        self._picture.draw(picture, record, colour, (len(self._speeds) % STROBE) / STROBE, self._task.load_rating)
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
        verdict = "Type III" if colour == WILD else "calm"
        done = len(self._speeds) * self._task.cycles_per_step
        self._figure.suptitle(
            f"{self._now(record):.2f} {self._unit}    {done} of {self._task.job_cycles} cycles    {verdict}",
            color=colour,
            fontsize=12,
            x=0.075,
            ha="left",
            fontweight="bold",
        )

    def _draw_portrait(self, panel: Any, record: CycleRecord, colour: str) -> None:
        samples = samples_of(record)
        gap = self._picture.room(record.machine) * 1e3
        panel.axvspan(gap, 10.0 * gap, color=PALE, alpha=0.5, linewidth=0)
        panel.axvspan(-10.0 * gap, -gap, color=PALE, alpha=0.5, linewidth=0)
        panel.plot(samples[:, 0] * 1e3, samples[:, 1], color=colour, linewidth=0.8)
        panel.plot(record.displacement * 1e3, record.velocity, "o", color=INK, markersize=4)
        self._top_velocity = max(self._top_velocity, float(np.abs(samples[:, 1]).max()))
        reach = max(1.15 * gap, 1.05e3 * float(np.abs(samples[:, 0]).max()))
        panel.set(xlim=(-reach, reach), ylim=(-1.1 * self._top_velocity, 1.1 * self._top_velocity))
        panel.set_title("Phase portrait; dots: start of each cycle", fontsize=9, loc="left", color=INK)
        panel.set_xlabel("displacement [mm]", fontsize=8, color=INK)
        panel.set_ylabel("velocity [m/s]", fontsize=8, color=INK)

    def _force_range(self) -> float:
        return 1.15 * max(self._task.load_rating, self._top_force)

    def _draw_force(self, panel: Any, record: CycleRecord, colour: str) -> None:
        force = samples_of(record)[:, 2]
        cycles = len(record)
        panel.axhline(self._task.load_rating, color=LIMIT, linewidth=1.0, linestyle="--")
        panel.axhline(-self._task.load_rating, color=LIMIT, linewidth=1.0, linestyle="--")
        panel.fill_between(np.arange(len(force)) * cycles / len(force), force, color=colour, linewidth=0.6)
        panel.set(xlim=(0, cycles), ylim=(-self._force_range(), self._force_range()))
        panel.set_title("Contact force in this step", fontsize=9, loc="left", color=INK)
        panel.set_xlabel("cycle", fontsize=8, color=INK)
        panel.set_ylabel("force [N]", fontsize=8, color=INK)

    def _draw_job(self, panel: Any) -> None:
        step = self._task.cycles_per_step
        peaks, wild = np.array(self._peaks), np.array(self._wild, dtype=bool)
        cycle = step * np.arange(len(peaks))
        for chosen, colour in ((~wild, CALM), (wild, WILD)):
            panel.plot(cycle[chosen], peaks[chosen], ".", color=colour, markersize=3)
        panel.axhline(self._task.load_rating, color=LIMIT, linewidth=1.0, linestyle="--")
        panel.set(xlim=(0, self._task.job_cycles), ylim=(0, self._force_range()))
        panel.set_title(
            "Job: mean peak force (dots), speed (line) and demand (dashes)", fontsize=9, loc="left", color=INK
        )
        panel.set_xlabel("cycle", fontsize=8, color=INK)
        panel.set_ylabel("mean peak force [N]", fontsize=8, color=INK)
        axis = self._speed_axis
        axis.step(cycle, self._speeds, where="post", color=INK, linewidth=1.2)
        axis.step(cycle, self._demands, where="post", color=INK, linewidth=0.8, linestyle="--")
        margin = 0.05 * (self._task.highest_speed - self._task.lowest_speed)
        axis.set_ylim(self._task.lowest_speed - margin, self._task.highest_speed + margin)
        axis.yaxis.set_label_position("right")
        axis.set_ylabel(f"speed [{self._unit}]", fontsize=8, color=INK)

    def _now(self, record: CycleRecord) -> float:
        return self._speeds[-1] if self._speeds else float(getattr(record.machine, record.machine.speed_field))
