"""Pictures of a comparison: scores with their intervals, and the profile of single jobs."""

from collections.abc import Mapping
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.control.comparison import PROFILE_SCORES

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
