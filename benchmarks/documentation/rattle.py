"""The picture at the head of the README: a beam rattles calmly and chaotically, with its contact force over time.

python -m benchmarks.documentation.rattle docs/rattle.gif
"""

import sys
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from chaosgym import ImpactBeam, simulate
from chaosgym.files import write_atomically

SPEEDS = {"12 Hz: periodic": (12.0, "#1f77b4"), "30 Hz: chaotic": (30.0, "#d1495b")}
"""Title, speed and colour of each half."""

CYCLES, FRAMES_PER_CYCLE, SAMPLES = 9, 12, 240
GAP, INK, PALE = 0.5, "#1f2933", "#cbd2d9"


def frames() -> list[Image.Image]:
    """Return the pictures of some cycles; both machines take the same time for a cycle."""
    figure = Figure(figsize=(7.2, 3.3), dpi=100, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)
    panels = figure.subplots(2, len(SPEEDS), height_ratios=(1, 1.1), sharey="row")
    motions = []
    for (title, (speed, colour)), (above, below) in zip(SPEEDS.items(), panels.T, strict=True):
        beam = ImpactBeam(excitation_frequency=speed)
        record = simulate(beam, CYCLES, transient=300, samples_per_cycle=SAMPLES)
        assert record.history is not None
        tip, _, force = record.history.reshape(-1, 3).T
        bar = _beam(above, title, colour)
        (trace,) = below.plot([], [], color=colour, linewidth=0.9)
        below.axhline(0.0, color=PALE, linewidth=0.8)
        below.set(xlim=(0, CYCLES), ylim=(-85, 85), xlabel="cycle")
        motions.append((bar, trace, tip / beam.clearance * GAP, force))
    panels[1, 0].set_ylabel("contact force [N]")
    pictures = []
    for frame in range(1, CYCLES * FRAMES_PER_CYCLE + 1):
        now = frame * SAMPLES // FRAMES_PER_CYCLE
        for bar, trace, tip, force in motions:
            bar.set_data([0.0, 1.0], [0.0, tip[now - 1]])
            trace.set_data(np.arange(now) / SAMPLES, force[:now])
        canvas.draw()
        pictures.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    return pictures


def _beam(panel: Any, title: str, colour: str) -> Any:
    """Draw what stays: pivot and sensors; return the beam."""
    panel.set_title(title, color=colour, fontsize=11)
    panel.set(xlim=(-0.1, 1.15), ylim=(-1.0, 1.0))
    panel.axis("off")
    for sign in (-1.0, 1.0):
        panel.fill_between([0.9, 1.1], sign * (GAP + 0.1), sign * (GAP + 0.3), color=colour, linewidth=0)
    (bar,) = panel.plot([0.0, 1.0], [0.0, 0.0], color=INK, linewidth=5, solid_capstyle="round")
    panel.plot(0.0, 0.0, marker="o", color="white", markeredgecolor=INK, markeredgewidth=2, markersize=9)
    return bar


def write(path: Path) -> None:
    """Write the animation, with one palette for all frames."""
    pictures = frames()
    palette = pictures[-1].quantize(48)
    reduced = [picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures]
    write_atomically(
        path,
        lambda file: reduced[0].save(
            file, format="GIF", save_all=True, append_images=reduced[1:], duration=60, loop=0, optimize=True
        ),
    )


if __name__ == "__main__":
    write(Path(sys.argv[1]))
