"""One picture: cost of a cycle, and memory, over modes, stiffness, gaps, cycles, machines, threads and workers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure

from benchmarks.performance.processors import Share
from benchmarks.performance.sizes import Size
from chaosgym.files import write_atomically

KEPT = {
    "modes": "tables [kB]",
    "stiffness [N/m]": "",
    "gaps": "tables [kB]",
    "cycles": "record, a cycle [kB]",
    "machines": "batch, a machine [kB]",
}
"""What grows, and whose memory is drawn beside."""

COST, MEMORY = "C0", "C1"


def scaling_figure(sizes: Sequence[Size], shares: Sequence[Share], path: Path) -> None:
    """Draw sizes, and the speed-up of threads and workers, to a PNG."""
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    axes = figure.subplots(2, 3).ravel()
    for ax, (grows, kept) in zip(axes, KEPT.items(), strict=False):
        own = [size for size in sizes if size.grows == grows]
        values = [size.value for size in own]
        ax.plot(values, [size.microseconds for size in own], "o-", color=COST)
        ax.set(xlabel=grows, ylabel="a cycle [us]", ylim=(0.0, None))
        if grows not in ("modes", "gaps"):
            ax.set_xscale("log")
        if kept:
            beside = ax.twinx()
            beside.plot(values, [1e-3 * size.kept for size in own], "s--", color=MEMORY)
            beside.set(ylabel=kept, yscale="log")
            beside.yaxis.label.set_color(MEMORY)
        else:
            ax.plot(values, [size.microseconds / size.impacts for size in own], "^:", color="C2")
            ax.text(0.4, 0.12, "of an impact [us]", color="C2", transform=ax.transAxes)
    _speed_up(axes[-1], shares)
    write_atomically(path, lambda file: figure.savefig(file, format="png", dpi=120, metadata={"Software": None}))


def _speed_up(ax: Any, shares: Sequence[Share]) -> None:
    for of, marker in (("threads", "o-"), ("workers", "s-")):
        own = [share for share in shares if share.of == of]
        if own:
            counts = [share.number for share in own]
            ax.plot(counts, [own[0].wall / share.wall for share in own], marker, label=of)
    most = max((share.number for share in shares), default=1)
    ax.plot([1, most], [1, most], ":", color="0.6", label="ideal")
    ax.set(xlabel="threads, Dask workers", ylabel="times as fast", ylim=(0.0, None))
    ax.legend(frameon=False)
