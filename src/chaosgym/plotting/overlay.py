"""Picture of a measured record over a machine's: peaks in their order, their distribution, and the section."""

import numpy as np
from matplotlib.figure import Figure

from chaosgym.diagnosis.overlay import Overlay

SHOWN = 120
"""Cycles shown in their order."""

STYLES = {"measured": ("tab:red", "o"), "simulated": ("tab:blue", ".")}


def overlay_figure(result: Overlay) -> Figure:
    """Draw both records in three panels."""
    figure = Figure(figsize=(12.0, 4.0), layout="constrained")
    order, spread, section = figure.subplots(1, 3)
    for name, (colour, marker) in STYLES.items():
        peaks, verdict = getattr(result, name), getattr(result, f"{name}_verdict")
        period = f", period {verdict.period}" if verdict.period else ""
        label = f"{name}: {verdict.nature}{period}"
        style = {"color": colour, "marker": marker, "ms": 4, "mfc": "none" if marker == "o" else colour}
        order.plot(np.arange(1, min(SHOWN, len(peaks)) + 1), peaks[:SHOWN], lw=0.4, label=label, **style)
        spread.plot(np.sort(peaks), (np.arange(len(peaks)) + 0.5) / len(peaks), color=colour)
        section.plot(peaks[:-1], peaks[1:], ls="", **style)
    order.set(xlabel="cycle", ylabel="peak force [N]")
    order.set_ylim(0.0, 1.3 * max(result.measured.max(), result.simulated.max(), 1e-9))
    order.legend(fontsize=8, loc="upper right")
    spread.set(xlabel="peak force [N]", ylabel="share of the cycles below")
    spread.set_title(f"{result.distance:.3g} N apart on average", fontsize=9)
    section.set(xlabel="peak force of a cycle [N]", ylabel="of the next [N]")
    figure.suptitle(result.machine.name, fontsize=10)
    return figure
