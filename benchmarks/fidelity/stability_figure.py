"""Figure of the stability map."""

import numpy as np
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from benchmarks.fidelity.stability import Outcome, StabilityMap

OUTCOME_COLOURS: dict[Outcome, str] = {"answer": "#3b7dd8", "named error": "#f2a93b", "failure": "#d1495b"}
"""One colour an outcome, told apart by colour-blind readers too."""


def stability_figure(result: StabilityMap) -> Figure:
    """Extremes as rows, models as columns; the number is the largest contact force."""
    extremes, models = result.extremes, result.models
    figure = Figure(figsize=(1.6 + 1.15 * len(models), 1.2 + 0.24 * len(extremes)), layout="constrained")
    ax = figure.subplots()
    outcomes = list(OUTCOME_COLOURS)
    index = np.full((len(extremes), len(models)), np.nan)
    for cell in result.cells:
        place = extremes.index(cell.extreme), models.index(cell.model)
        index[place] = outcomes.index(cell.outcome)
        if cell.largest_peak is not None:
            ax.text(place[1], place[0], f"{cell.largest_peak:.3g} N", ha="center", va="center", size=7, color="white")
    ax.imshow(index, cmap=ListedColormap(list(OUTCOME_COLOURS.values())), vmin=-0.5, vmax=2.5, aspect="auto")
    ax.set_xticks(range(len(models)), models)
    ax.set_yticks(range(len(extremes)), extremes, fontsize=8)
    ax.xaxis.tick_top()
    handles = [
        Patch(color=colour, label=f"{outcome} ({result.count(outcome)})") for outcome, colour in OUTCOME_COLOURS.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=9)
    figure.suptitle(f"{result.machine} at the extremes:\nlargest contact force of three cycles")
    return figure
