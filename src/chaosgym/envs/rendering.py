"""Pictures of a step: the machine in motion, its phase portrait, the contact force, and the job so far.

What stays from step to step (axes, ticks, labels) is drawn once; a picture adds what has changed.
"""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.envs.jobs import Segment
from chaosgym.envs.judge import nature_of
from chaosgym.envs.kernels.steps import PLACE
from chaosgym.envs.task import Task
from chaosgym.machines.machine import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.machines.picture import CALM, INK, LIMIT, PALE, STAYS, WILD, draw, samples_of
from chaosgym.simulation import CycleRecord, MotionState, simulate

Frame = NDArray[np.uint8]

SIZE = (9.6, 6.4)
DOTS_PER_INCH = 100

RENDER_SAMPLES = 8000
"""Samples of the motion kept of a step."""


STROBE = 12
"""Each step is shown at a moment of its last cycle, this fraction of a cycle later than the step before: every step
ends at the same phase, so that the machine would stand still otherwise."""

GROWTH = 1.3
"""Factor by which an axis grows when something leaves it."""

COLUMNS = 400
"""Columns in which the force of a step is drawn, from its least to its largest value in each."""


def blank() -> Frame:
    """Picture of an environment that is not drawn."""
    return np.full((round(SIZE[1] * DOTS_PER_INCH), round(SIZE[0] * DOTS_PER_INCH), 3), 255, np.uint8)


def record_of(segments: Iterable[Segment], cycles: int) -> CycleRecord:
    """The last cycles of a step with a time history, run once more from its start: no bit of the step changes."""
    records: list[CycleRecord] = []
    for piece in segments:
        state: MotionState | None = MotionState(piece.coordinates, piece.bouncing)
        for speed in piece.speeds.tolist():
            record = simulate(piece.machine.at(speed), 1, state, samples_per_cycle=RENDER_SAMPLES // cycles)
            state = record.final_state
            records.append(record)
    records = records[-cycles:]
    names = ["section", "displacement", "velocity", "peak_force", "impacts", "history"]
    names += ["motions", "histories"] if records[-1].motions is not None else []
    joined: dict[str, Any] = {name: np.concatenate([getattr(record, name) for record in records]) for name in names}
    return replace(records[-1], **joined).of_joint()


class Dashboard:
    """Four panels that show the last step and the job so far.

    Parameters
    ----------
    machine
        For the unit of its speed.
    task
        For the ranges of the axes.
    window
        Show in a window of matplotlib's current backend instead of returning pictures.
    """

    def __init__(self, machine: Machine, task: Task, *, window: bool) -> None:
        self._task = task
        self._unit = parameters_of(machine)[machine.speed_field].unit
        self._figure = Figure(figsize=SIZE, dpi=DOTS_PER_INCH)
        self._canvas: Any = FigureCanvasAgg(self._figure)
        self._window: Any = None
        if window:
            from matplotlib import pyplot

            self._window = pyplot.figure(figsize=SIZE, dpi=DOTS_PER_INCH)
            self._shown: Any = self._window.figimage(blank())
        grid = self._figure.add_gridspec(
            2, 2, left=0.07, right=0.945, bottom=0.085, top=0.9, hspace=0.36, wspace=0.22, width_ratios=(1.25, 1.0)
        )
        self._machine_panel, self._portrait, self._force, self._job = (
            self._figure.add_subplot(grid[cell]) for cell in range(4)
        )
        self._speed_axis = self._job.twinx()
        self._background: Any = None
        self._staying: list[str] = []
        self._limits = {"displacement": 0.0, "velocity": 0.0, "force": 0.0}
        self._label()
        self._make_artists()

    def start(self) -> None:
        """Begin a job."""
        self._speeds: list[float] = []
        self._demands: list[float] = []
        self._peaks: list[float] = []
        self._wild: list[bool] = []

    def add(self, info: Mapping[str, Any], observation: NDArray[np.float32]) -> None:
        """Take in a step."""
        self._speeds.append(float(info["speed"]))
        self._demands.append(float(info["demand"]))
        self._peaks.append(float(observation[PLACE.mean_peak_force]))
        self._wild.append(nature_of(info["type_iii"]) == "irregular")

    def draw(self, record: CycleRecord) -> Frame | None:
        """Draw the last step, given with its time history; return (height, width, 3), or None for a window."""
        samples, colour = samples_of(record), WILD if self._wild and self._wild[-1] else CALM
        room = 1e3 * np.array(record.machine.room_of(record.joint))
        self._make_room(samples, room)
        self._picture_machine(record, colour)
        if self._background is None:
            self._draw_background()
        self._canvas.restore_region(self._background)
        self._update_title(record, colour)
        self._update_portrait(record, samples, room, colour)
        self._update_force(samples, len(record), colour)
        self._update_job()
        for panel, artists in self._artists.items():
            for artist in artists:
                panel.draw_artist(artist)
        self._figure.draw_artist(self._title)
        self._draw_machine()
        picture = np.asarray(self._canvas.buffer_rgba())[:, :, :3].copy()
        if self._window is None:
            return picture
        self._show(picture)
        return None

    def close(self) -> None:
        """Close the window."""
        if self._window is not None:
            from matplotlib import pyplot

            pyplot.close(self._window)

    def _show(self, picture: Frame) -> None:
        canvas = self._window.canvas
        self._shown.set_data(picture)
        canvas.draw()
        if canvas.required_interactive_framework is not None:
            canvas.manager.show()
            canvas.flush_events()

    def _label(self) -> None:
        """Write what never changes."""
        task = self._task
        for panel, title, across, up in (
            (self._portrait, "Phase portrait; dots: start of each cycle", "displacement [mm]", "velocity [m/s]"),
            (self._force, "Contact force in this step; dashes: force limit", "cycle", "force [N]"),
            (self._job, "Job: mean peak force (dots), speed (line), demand (dashes)", "cycle", "mean peak force [N]"),
        ):
            panel.set_title(title, fontsize=8.5, loc="left", color=INK)
            panel.set_xlabel(across, fontsize=8, color=INK)
            panel.set_ylabel(up, fontsize=8, color=INK)
        for axis in (self._force, self._job):
            axis.axhline(task.reference_force, color=LIMIT, linewidth=1.0, linestyle="--")
        self._force.axhline(-task.reference_force, color=LIMIT, linewidth=1.0, linestyle="--")
        self._force.set_xlim(0, task.cycles_per_step)
        self._job.set_xlim(0, task.job_cycles)
        margin = 0.05 * (task.highest_speed - task.lowest_speed)
        self._speed_axis.set_ylim(task.lowest_speed - margin, task.highest_speed + margin)
        self._speed_axis.yaxis.set_label_position("right")
        self._speed_axis.set_ylabel(f"speed [{self._unit}]", fontsize=8, color=INK)
        for panel in (self._machine_panel, self._portrait, self._force, self._job, self._speed_axis):
            panel.tick_params(colors=INK, labelsize=8)
            panel.spines[["top", "right"]].set_visible(False)

    def _make_artists(self) -> None:
        """What changes, in the order of drawing."""
        portrait, force, job, speed = self._portrait, self._force, self._job, self._speed_axis
        self._stops = [portrait.add_patch(Rectangle((0, 0), 1, 1, color=PALE, alpha=0.5, lw=0)) for _ in range(2)]
        (self._path,) = portrait.plot([], [], linewidth=0.8)
        (self._strobes,) = portrait.plot([], [], "o", color=INK, markersize=4)
        self._pulses: Any = force.add_collection(PolyCollection([], linewidth=0.6), autolim=False)
        (self._calm,) = job.plot([], [], ".", color=CALM, markersize=3)
        (self._wilds,) = job.plot([], [], ".", color=WILD, markersize=3)
        (self._run,) = speed.step([], [], where="post", color=INK, linewidth=1.2)
        (self._asked,) = speed.step([], [], where="post", color=INK, linewidth=0.8, linestyle="--")
        self._artists: dict[Any, list[Any]] = {
            portrait: [*self._stops, self._path, self._strobes],
            force: [self._pulses],
            job: [self._calm, self._wilds],
            speed: [self._run, self._asked],
        }
        self._title = self._figure.text(0.075, 0.98, "", fontsize=12, fontweight="bold", ha="left", va="top")
        for artist in (self._title, *(one for several in self._artists.values() for one in several)):
            artist.set_animated(True)

    def _make_room(self, samples: Array, room: Array) -> None:
        """Widen the axes that something has left; the background is then drawn anew."""
        reached = {
            "displacement": max(
                1.1 * float(np.abs(room[np.isfinite(room)]).max()), 1e3 * float(np.abs(samples[:, 0]).max())
            ),
            "velocity": float(np.abs(samples[:, 1]).max()),
            "force": max(self._task.reference_force, float(np.abs(samples[:, 2]).max()), *self._peaks[-1:]),
        }
        beyond = {name: value for name, value in reached.items() if value > self._limits[name]}
        if not beyond:
            return
        self._background = None
        self._limits |= {name: (1.05 if name == "displacement" else GROWTH) * value for name, value in beyond.items()}
        across, up, push = self._limits.values()
        self._portrait.set(xlim=(-across, across), ylim=(-up, up))
        self._force.set_ylim(-push, push)
        self._job.set_ylim(0, push)

    def _draw_background(self) -> None:
        self._machine_panel.set_visible(False)
        self._canvas.draw()
        self._machine_panel.set_visible(True)
        for text in self._texts(stays=True):
            self._machine_panel.draw_artist(text)
        self._background = self._canvas.copy_from_bbox(self._figure.bbox)

    def _texts(self, *, stays: bool) -> list[Any]:
        """Texts of the machine's picture that stay as they are, or the others."""
        found = [child for child in self._machine_panel.get_children() if isinstance(child, Text) and child.get_text()]
        return [text for text in found if (text.get_gid() == STAYS) == stays]

    def _picture_machine(self, record: CycleRecord, colour: str) -> None:
        """Let the machine's picture put its parts on its panel."""
        panel = self._machine_panel
        for artist in (*panel.lines, *panel.collections, *panel.patches, *panel.texts):
            artist.remove()
        moment = (len(self._speeds) % STROBE) / STROBE
        draw(panel, record, colour, moment, self._task.reference_force)
        staying = [text.get_text() for text in self._texts(stays=True)]
        if staying != self._staying:
            self._staying, self._background = staying, None

    def _draw_machine(self) -> None:
        panel = self._machine_panel
        if panel.axison:
            panel.draw(self._canvas.get_renderer())
            return
        parts = [*panel.lines, *panel.collections, *panel.patches, *self._texts(stays=False)]
        for part in sorted(parts, key=lambda part: part.get_zorder()):
            panel.draw_artist(part)

    def _update_title(self, record: CycleRecord, colour: str) -> None:
        verdict = nature_of(float(colour == WILD))
        done = len(self._speeds) * self._task.cycles_per_step
        speed = self._speeds[-1] if self._speeds else float(getattr(record.machine, record.machine.speed_field))
        self._title.set(
            text=f"{speed:.2f} {self._unit}    {done} of {self._task.job_cycles} cycles    {verdict}", color=colour
        )

    def _update_portrait(self, record: CycleRecord, samples: Array, room: Array, colour: str) -> None:
        up = self._limits["velocity"]
        for stop, sign, place in zip(self._stops, (-1.0, 1.0), room.tolist(), strict=True):
            stop.set_visible(np.isfinite(place))
            if np.isfinite(place):
                stop.set(x=place, y=-up, width=sign * 2.0 * self._limits["displacement"], height=2.0 * up)
        self._path.set_data(1e3 * samples[:, 0], samples[:, 1])
        self._path.set_color(colour)
        self._strobes.set_data(1e3 * record.displacement, record.velocity)

    def _update_force(self, samples: Array, cycles: int, colour: str) -> None:
        force = samples[: len(samples) // COLUMNS * COLUMNS, 2].reshape(COLUMNS, -1)
        at = np.linspace(0.0, cycles, COLUMNS)
        low, high = np.minimum(force.min(axis=1), 0.0), np.maximum(force.max(axis=1), 0.0)
        outline = np.concatenate([np.column_stack([at, high]), np.column_stack([at, low])[::-1]])
        self._pulses.set_verts([outline])
        self._pulses.set_color(colour)

    def _update_job(self) -> None:
        peaks, wild = np.array(self._peaks), np.array(self._wild, dtype=bool)
        cycle = self._task.cycles_per_step * np.arange(len(peaks))
        self._calm.set_data(cycle[~wild], peaks[~wild])
        self._wilds.set_data(cycle[wild], peaks[wild])
        self._run.set_data(cycle, self._speeds)
        self._asked.set_data(cycle, self._demands)
