"""Figure of ``tradeoff``: cost and error of each rung."""

from collections.abc import Callable

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from chaosgym.fidelity.tradeoff import Tradeoff, TradeoffRow

MARKERS = {"exact": "o", "Runge-Kutta 4": "^"}

FLOOR = 1e-5
"""Errors below this are drawn here."""


def _cost_against(
    result: Tradeoff, value: Callable[[TradeoffRow], float | None], ax: Axes, *, logarithmic: bool
) -> Axes:
    rungs = list(dict.fromkeys(row.rung for row in result.rows))
    for row in result.rows:
        shown = value(row)
        if shown is None:
            continue
        colour = f"C{rungs.index(row.rung)}"
        height = max(shown, FLOOR) if logarithmic else shown
        ax.plot(
            row.microseconds_per_cycle,
            height,
            MARKERS[row.method],
            color=colour,
            ms=8,
            mec="black",
            mew=1.5 if row.on_front else 0.3,
            alpha=1.0 if row.on_front else 0.6,
        )
    ax.set(xscale="log", xlabel="processor time [µs per cycle]")
    if logarithmic:
        ax.set_yscale("log")
    ax.grid(True, alpha=0.3)
    return ax


def wasserstein_panel(result: Tradeoff, ax: Axes) -> Axes:
    """Distance of the peak forces' distribution from the reference's against cost, with the Pareto front."""
    _cost_against(result, lambda row: row.wasserstein, ax, logarithmic=True)
    front = sorted((row.microseconds_per_cycle, row.wasserstein or 0.0) for row in result.rows if row.on_front)
    ax.plot([cost for cost, _ in front], [max(distance, FLOOR) for _, distance in front], "k-", lw=0.8, zorder=0)
    ax.set(ylabel="Wasserstein distance of peak forces / mean", title="Peak forces; framed and joined: Pareto front")
    return ax


def agreement_panel(result: Tradeoff, ax: Axes) -> Axes:
    """Share of operating points with the reference's response type against cost."""
    _cost_against(result, lambda row: row.type_agreement, ax, logarithmic=False)
    ax.set(ylabel="share of points with the reference's type", ylim=(-0.05, 1.05), title="Response types")
    return ax


def tradeoff_figure(result: Tradeoff) -> Figure:
    """Cost against error of the peak forces and against agreement of the types."""
    figure = Figure(figsize=(11, 4.5), layout="constrained")
    left, right = figure.subplots(1, 2)
    wasserstein_panel(result, left)
    agreement_panel(result, right)
    rungs = list(dict.fromkeys(row.rung for row in result.rows))
    handles = [Patch(color=f"C{i}", label=rung) for i, rung in enumerate(rungs)]
    methods = dict.fromkeys(row.method for row in result.rows)
    handles += [right.plot([], [], MARKERS[method], color="grey", label=method)[0] for method in methods]
    figure.legend(handles=handles, loc="outside right center", fontsize=9)
    figure.suptitle(f"{result.machine}: what accuracy costs")
    return figure
