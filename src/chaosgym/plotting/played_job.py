"""Pictures of jobs, their speeds and forces, and of a comparison of many."""

import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.animation import FFMpegWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image
from tqdm import tqdm

from chaosgym.control.rollout import Played
from chaosgym.control.scores import PROFILE_SCORES
from chaosgym.errors import ChaosgymError
from chaosgym.files import write_atomically
from chaosgym.plotting.style import FORMATS as STILL
from chaosgym.plotting.style import INK, NATURE_COLOURS, STYLE, check_picture, save_picture

FRAMES = 50
"""Pictures of an animation."""

FRAMES_PER_SECOND = 10

FORMATS = (*STILL, ".gif", ".mp4")

CALM, WILD = NATURE_COLOURS["periodic"], NATURE_COLOURS["chaotic"]
"""Of steps with few irregular cycles, and of those with many."""

Jobs = Mapping[str, Played]
"""Jobs by the name of who played; the first machine of each is drawn."""


def draw_jobs(jobs: Jobs, figure: Figure, steps: int | None = None) -> None:
    """Draw the first ``steps`` steps, all by default, on an empty figure: a column for each job."""
    axes = figure.subplots(2, len(jobs), sharex=True, sharey="row", squeeze=False)
    every = np.concatenate([values.ravel() for job in jobs.values() for values in (job.speed[:, 0], job.demand[:, 0])])
    low, high = np.nanmin(every), np.nanmax(every)
    margin = 0.05 * (high - low)
    for column, (name, job) in enumerate(jobs.items()):
        draw_speed(job, axes[0, column], steps)
        draw_forces(job, axes[1, column], steps)
        done = slice(steps)
        axes[0, column].set_title(
            f"{name}\nreturn {np.nansum(job.reward[done, 0]):.1f}, Type III {np.nanmean(job.type_iii[done, 0]):.0%}",
            fontsize=9.5,
            color=INK,
        )
    axes[0, 0].set_ylim(low - margin, high + 5.0 * margin)
    first = next(iter(jobs.values()))
    figure.suptitle(f"{first.env}, machine {first.machines[0]}", x=0.02, ha="left", fontsize=10, color=INK)


def draw_speed(job: Played, ax: Axes, steps: int | None = None) -> Axes:
    """Demand and speed at every step, in red where most cycles are Type III; returns the axes."""
    speed, wild = job.speed[:steps, 0], job.type_iii[:steps, 0] > 0.5
    step = np.arange(len(speed))
    ax.step(step, job.demand[:steps, 0], where="mid", color=INK, linewidth=0.8, label="demand")
    for chosen, colour, name in ((~wild, CALM, "calm"), (wild, WILD, "Type III")):
        mark = "s" if name == "calm" else "D"
        ax.plot(step[chosen], speed[chosen], mark, color=colour, markersize=3, label=name)
    ax.set_ylabel(f"speed [{job.unit}]")
    ax.legend(loc="upper right", fontsize=8, ncols=3, handletextpad=0.2, columnspacing=0.8)
    return ax


def draw_forces(job: Played, ax: Axes, steps: int | None = None) -> Axes:
    """Mean of the measured peak forces of every step, and two standard deviations; returns the axes."""
    mean, spread = job.column("mean_peak_force")[:steps, 0], job.column("std_peak_force")[:steps, 0]
    wild, step = job.type_iii[:steps, 0] > 0.5, np.arange(len(mean))
    for chosen, colour in ((~wild, CALM), (wild, WILD)):
        ax.errorbar(
            step[chosen], mean[chosen], 2.0 * spread[chosen], fmt=".", color=colour, markersize=3, linewidth=0.8
        )
    ax.set(xlim=(0, len(job.speed)), xlabel="step", ylabel=f"peak force [{job.felt_unit}]\nmean ± 2 SD")
    return ax


def save_job(jobs: Jobs, path: Path) -> None:
    """Write a figure (.png, .svg, .pdf) or an animation (.gif, .mp4) of jobs.

    Raises
    ------
    ChaosgymError
        If the file name ends in something else, or there is no ffmpeg for .mp4.
    """
    check_format(path)
    kind = path.suffix.lower()
    with matplotlib.rc_context(STYLE):
        if kind in STILL:
            figure = _blank(jobs)
            draw_jobs(jobs, figure)
            save_picture(figure, path)
        else:
            write = _write_gif if kind == ".gif" else _write_film
            write_atomically(path, lambda file: write(jobs, file))


def check_format(path: Path) -> None:
    """Raise a ChaosgymError unless ``save_job`` can write a file of this name."""
    check_picture(path, FORMATS)
    if path.suffix.lower() == ".mp4" and shutil.which("ffmpeg") is None:
        raise ChaosgymError(f"{path} needs the program ffmpeg, which is not installed; .gif does without it")


def _blank(jobs: Jobs) -> Figure:
    return Figure(figsize=(3.6 * len(jobs), 4.2), dpi=100, layout="constrained")


def _write_gif(jobs: Jobs, file: Path) -> None:
    pictures = [_picture(figure) for figure in _frames(jobs)]
    pictures[0].save(
        file, format="GIF", save_all=True, append_images=pictures[1:], duration=1000 // FRAMES_PER_SECOND, loop=0
    )


def _write_film(jobs: Jobs, file: Path) -> None:
    writer = FFMpegWriter(fps=FRAMES_PER_SECOND, extra_args=["-f", "mp4"])
    frames = _frames(jobs)
    with writer.saving(next(frames), str(file), dpi=100):
        writer.grab_frame()
        for _ in frames:
            writer.grab_frame()


def _frames(jobs: Jobs) -> Iterator[Figure]:
    """One figure, drawn anew for each picture of an animation; axes stay where they are of the whole jobs."""
    figure = _blank(jobs)
    draw_jobs(jobs, figure)
    figure.draw_without_rendering()  # makes the layout, which takes longer than the rest of a picture
    figure.set_layout_engine("none")
    places = [axes.get_position() for axes in figure.axes]
    length = max(len(job.speed) for job in jobs.values())
    steps = np.unique(np.linspace(1, length, FRAMES).round().astype(int)).tolist()
    for count in tqdm(steps, desc="draw", unit="picture"):
        figure.clear()
        draw_jobs(jobs, figure, count)
        for axes, place in zip(figure.axes, places, strict=True):
            axes.set_position(place)
        yield figure


def _picture(figure: Figure) -> Image.Image:
    canvas: Any = FigureCanvasAgg(figure)
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy()).quantize(64)


LOWEST_SHOWN = -1.0
"""Scores below are drawn at the edge."""

PROFILED = 7
"""Contenders of the best scores whose profiles are drawn; the palette tells no more of them apart."""


def comparison_figure(summaries: Mapping[str, Mapping[str, Any]], title: str) -> Figure:
    """Draw scores and profiles, side by side."""
    figure = Figure(figsize=(12.0, 0.32 * len(summaries) + 1.8), layout="constrained")
    scores, profiles = figure.subplots(1, 2)
    figure.suptitle(title)
    _draw_scores(scores, summaries)
    _draw_profiles(profiles, summaries)
    return figure


def _draw_scores(axes: Axes, summaries: Mapping[str, Mapping[str, Any]]) -> None:
    ordered = sorted(summaries.items(), key=lambda item: item[1]["score"])
    for height, (_, row) in enumerate(ordered):
        low, high = row["score_interval"]
        axes.plot([max(low, LOWEST_SHOWN), max(high, LOWEST_SHOWN)], [height, height], color="0.6", linewidth=2)
        hidden = row["score"] < LOWEST_SHOWN
        axes.plot(max(row["score"], LOWEST_SHOWN), height, "<" if hidden else "o", color="tab:blue", clip_on=False)
        axes.annotate(
            f"{row['score']:.2f}",
            (max(row["score"], LOWEST_SHOWN), height),
            xytext=(0, 4),
            fontsize=7,
            ha="center",
            textcoords="offset points",
        )
    axes.set_yticks(range(len(ordered)), [f"{name} ({row['knows']})" for name, row in ordered], fontsize=8)
    for worth in (0.0, 1.0):
        axes.axvline(worth, color="0.8", zorder=0)
    axes.set_xlim(left=LOWEST_SHOWN)
    axes.set_ylim(-0.7, len(ordered) - 0.2)
    axes.set_xlabel("score: following 0, own map 1; bars: 95 % over machines")


def _draw_profiles(axes: Axes, summaries: Mapping[str, Mapping[str, Any]]) -> None:
    best = sorted(summaries.items(), key=lambda item: -item[1]["score"])[:PROFILED]
    for name, row in best:
        axes.plot(PROFILE_SCORES, row["profile"], label=name)
    axes.set_xlabel("score of a job, on the common scale")
    axes.set_ylabel("share of the jobs that reach it")
    axes.set_ylim(0.0, 1.02)
    axes.legend(fontsize=8, loc="lower left")
