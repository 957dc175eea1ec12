"""What did a policy do? Speed, forces and regime over a job, as a figure or as a short animation."""

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from tqdm import tqdm

from chaosgym.control.policies.play import PlayedJob
from chaosgym.envs.pictures import CALM, INK, LIMIT, WILD
from chaosgym.errors import ChaosgymError
from chaosgym.files import write_atomically

FRAMES = 50
"""Pictures of an animation."""

FRAMES_PER_SECOND = 10

FORMATS = (".png", ".gif", ".mp4")


def job_figure(job: PlayedJob) -> Figure:
    """Speed and measured peak forces of a job, in red where it is Type III."""
    figure = Figure(figsize=(7.2, 4.8), dpi=100, layout="constrained")
    draw_job(job, figure)
    return figure


def draw_job(job: PlayedJob, figure: Figure, steps: int | None = None) -> None:
    """Draw the first ``steps`` steps of a job, all by default, on an empty figure."""
    upper, lower = figure.subplots(2, 1, sharex=True)
    draw_speed(job, upper, steps)
    draw_forces(job, lower, steps)
    done = slice(steps)
    figure.suptitle(
        f"{job.env}, seed {job.seed}: return {job.reward[done].sum():.2f}, Type III in {job.type_iii[done].mean():.0%} "
        f"of the steps, damage {job.damage[done][-1]:.2f}",
        fontsize=10,
        color=INK,
    )


def draw_speed(job: PlayedJob, ax: Axes, steps: int | None = None) -> Axes:
    """Speed at every step; returns the axes."""
    cycles = job.peak_force.shape[1]
    shown, kinds = job.speed[:steps], job.type_iii[:steps]
    start = np.arange(len(shown)) * cycles
    ax.step(start, shown, where="post", color=INK, linewidth=0.8)
    for chosen, colour, name in ((~kinds, CALM, "calm"), (kinds, WILD, "Type III")):
        ax.plot(start[chosen] + 0.5 * cycles, shown[chosen], "s", color=colour, markersize=3, label=name)
    margin = 0.05 * float(np.ptp(job.speed)) + 0.5
    ax.set(ylim=(job.speed.min() - margin, job.speed.max() + margin), ylabel=f"speed [{job.unit}]")
    ax.legend(loc="lower right", fontsize=8, frameon=False)
    return ax


def draw_forces(job: PlayedJob, ax: Axes, steps: int | None = None) -> Axes:
    """Measured peak force of every cycle, and the force limit; returns the axes."""
    cycles = job.peak_force.shape[1]
    peaks = job.peak_force[:steps].ravel()
    kinds = np.repeat(job.type_iii[:steps], cycles)
    cycle = np.arange(len(peaks))
    for chosen, colour in ((~kinds, CALM), (kinds, WILD)):
        ax.plot(cycle[chosen], peaks[chosen], ".", color=colour, markersize=3)
    ax.axhline(job.force_limit, color=LIMIT, linewidth=1.0, linestyle="--")
    ax.set(
        xlim=(0, job.peak_force.size),
        ylim=(0.0, 1.1 * max(job.force_limit, float(job.peak_force.max()))),
        xlabel="cycle",
        ylabel="measured peak force [N]",
    )
    return ax


def save_job(job: PlayedJob, path: Path) -> None:
    """Write a figure (.png) or an animation (.gif, .mp4) of a job.

    Raises
    ------
    ChaosgymError
        If the file name ends in something else, or there is no ffmpeg for .mp4.
    """
    check_format(path)
    writers = {".png": _write_figure, ".gif": _write_gif, ".mp4": _write_film}
    write_atomically(path, lambda file: writers[path.suffix.lower()](job, file))


def check_format(path: Path) -> None:
    """Raise a ChaosgymError unless ``save_job`` can write a file of this name."""
    kind = path.suffix.lower()
    if kind not in FORMATS:
        raise ChaosgymError(f"{path} ends in {kind or 'nothing'}; allowed: {', '.join(FORMATS)}")
    if kind == ".mp4" and shutil.which("ffmpeg") is None:
        raise ChaosgymError(f"{path} needs the program ffmpeg, which is not installed; .gif does without it")


def _write_figure(job: PlayedJob, file: Path) -> None:
    job_figure(job).savefig(file, format="png")


def _write_gif(job: PlayedJob, file: Path) -> None:
    pictures = [_picture(figure) for figure in _frames(job)]
    pictures[0].save(
        file, format="GIF", save_all=True, append_images=pictures[1:], duration=1000 // FRAMES_PER_SECOND, loop=0
    )


def _write_film(job: PlayedJob, file: Path) -> None:
    writer = FFMpegWriter(fps=FRAMES_PER_SECOND, extra_args=["-f", "mp4"])
    frames = _frames(job)
    with writer.saving(next(frames), str(file), dpi=100):
        writer.grab_frame()
        for _ in frames:
            writer.grab_frame()


def _frames(job: PlayedJob) -> Iterator[Figure]:
    """One figure, drawn anew for each picture of an animation."""
    figure = Figure(figsize=(7.2, 4.8), dpi=100, layout="constrained")
    steps = np.unique(np.linspace(1, len(job.speed), FRAMES).round().astype(int)).tolist()
    for count in tqdm(steps, desc="draw", unit="picture"):
        figure.clear()
        draw_job(job, figure, count)
        yield figure


def _picture(figure: Figure) -> Image.Image:
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy()).quantize(64)
