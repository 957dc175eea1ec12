"""How fast do agents learn? The training curves of run folders, as a table and a picture.

A run's ``progress.csv`` tells what the policy returned while it explored, on machines drawn afresh for every job. What
others return on the machines kept for evaluation, the shipped agent too, is drawn beside it where that is known.
"""

import csv
import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.arrays import Array
from chaosgym.control.comparison import shipped_comparison, subject_of
from chaosgym.control.scores import SAFE, ZERO, Scores
from chaosgym.errors import DatasetError
from chaosgym.files import write_atomically

COLUMNS = ("step", "return", "type_iii", "deviation", "processor_seconds")
"""Columns of ``progress.csv``."""

SHOWN_STEPS = (50_000, 100_000, 200_000, 300_000, 500_000, 700_000, 900_000)
"""Steps at which the table gives the curves."""

WINDOW = 50_000
"""Steps up to there over which a value of the table is averaged."""

BESIDE = {ZERO: (ZERO, ":"), SAFE: (SAFE, "--"), "table": ("table", "-."), "map": ("shipped learned map", "-")}
"""Contenders whose results are drawn beside the curves, with name and style of the line."""


class Curve(NamedTuple):
    """A training run: name of the ``agent``, ``env``, its id and level, and ``values`` (rows, 5) of ``COLUMNS``."""

    agent: str
    env: str
    values: Array


def read_curve(agent: str, folder: Path, level: str | None = None) -> Curve:
    """Curve of a run folder, or of a shipped policy's, on the machines of a level.

    Raises
    ------
    DatasetError
        If the folder has no finished run.
    """
    try:
        env = json.loads((folder / "policy.json").read_text(encoding="utf-8"))["env"]
        with (folder / "progress.csv").open(encoding="utf-8") as file:
            rows = [[float(row[name]) for name in COLUMNS] for row in csv.DictReader(file)]
    except (OSError, ValueError, KeyError) as error:
        raise DatasetError(f"{folder} is no finished training run: {error}; let the script of the agent end") from None
    return Curve(agent, subject_of(env, level=level), np.array(rows))


def replaced(kept: Sequence[Curve], new: Sequence[Curve]) -> list[Curve]:
    """Curves, with those of the same agent and environment as new ones replaced by these."""
    runs = grouped(new)
    return [curve for curve in kept if (curve.env, curve.agent) not in runs] + list(new)


def write_table(curves: Sequence[Curve], path: Path) -> None:
    """Write all curves into one CSV file, a row for each row of theirs."""
    numbers: dict[tuple[str, str], int] = {}
    rows: list[tuple[Any, ...]] = [("env", "agent", "run", *COLUMNS)]
    for curve in curves:
        run = numbers[curve.env, curve.agent] = numbers.get((curve.env, curve.agent), -1) + 1
        rows += [(curve.env, curve.agent, run, *(f"{value:.10g}" for value in row)) for row in curve.values]
    text = io.StringIO()
    csv.writer(text, lineterminator="\n").writerows(rows)
    write_atomically(path, lambda file: file.write_text(text.getvalue(), encoding="utf-8"))


def read_table(path: Path) -> list[Curve]:
    """Curves of a file of ``write_table``.

    Raises
    ------
    DatasetError
        If it can't be read as one.
    """
    rows: dict[tuple[str, str, str], list[list[float]]] = {}
    try:
        with path.open(encoding="utf-8") as file:
            for row in csv.DictReader(file):
                key = (row["agent"], row["env"], row["run"])
                rows.setdefault(key, []).append([float(row[name]) for name in COLUMNS])
    except (OSError, ValueError, KeyError) as error:
        raise DatasetError(f"{path} can't be read as training curves: {error}; give run folders to write it") from None
    return [Curve(agent, env, np.array(values)) for (agent, env, _), values in rows.items()]


def grouped(curves: Sequence[Curve]) -> dict[tuple[str, str], list[Array]]:
    """Values of all seeds by environment and agent."""
    found: dict[tuple[str, str], list[Array]] = {}
    for curve in curves:
        found.setdefault((curve.env, curve.agent), []).append(curve.values)
    return found


def at(values: Array, step: int) -> Array:
    """Means (5,) over the window that ends at a step; NaN beyond the end of the run."""
    inside = (values[:, 0] > step - WINDOW) & (values[:, 0] <= step)
    reached = values[-1, 0] >= step
    return np.asarray(values[inside].mean(axis=0)) if reached and inside.any() else np.full(len(COLUMNS), np.nan)


def curve_lines(curves: Sequence[Curve]) -> list[str]:
    """Lines of a Markdown table: return and share of Type III at some steps, mean over seeds."""
    heads = [f"{step // 1000}k" for step in SHOWN_STEPS]
    lines = [f"| environment, agent | seeds | {' | '.join(heads)} |", "|---" * (len(heads) + 2) + "|"]
    for (env, agent), seeds in grouped(curves).items():
        means = [np.mean([at(values, step) for values in seeds], axis=0) for step in SHOWN_STEPS]
        cells = [f"{row[1]:.1f}, {row[2]:.1%}" if np.isfinite(row[1]) else "" for row in means]
        lines.append(f"| {env.rpartition('/')[2]}, {agent} | {len(seeds)} | {' | '.join(cells)} |")
    return lines


def curve_figure(curves: Sequence[Curve]) -> Figure:
    """Draw return and share of Type III against steps, a row for each environment; thin: one seed, thick: the mean."""
    found = grouped(curves)
    envs = list(dict.fromkeys(env for env, _ in found))
    figure = Figure(figsize=(10.0, 2.9 * len(envs) + 0.4), layout="constrained")
    panels = figure.subplots(len(envs), 2, squeeze=False)
    for row, env in zip(panels, envs, strict=True):
        agents = {agent: seeds for (of, agent), seeds in found.items() if of == env}
        for axes, column, name in zip(row, (1, 2), ("return of a job", "share of Type III"), strict=True):
            _draw(axes, agents, column)
            axes.set_title(env, fontsize=9)
            axes.set_xlabel("thousand steps")
            axes.set_ylabel(name)
        _draw_beside(row, env)
        row[0].legend(fontsize=7, loc="best")
    return figure


def _draw(axes: Axes, agents: Mapping[str, Sequence[Array]], column: int) -> None:
    for place, (agent, seeds) in enumerate(agents.items()):
        colour = f"C{place}"
        for values in seeds:
            axes.plot(values[:, 0] / 1e3, values[:, column], color=colour, linewidth=0.5, alpha=0.6)
        shortest = min(seeds, key=len)
        steps = shortest[:, 0]
        mean = np.mean([np.interp(steps, values[:, 0], values[:, column]) for values in seeds], axis=0)
        count = f"{len(seeds)} seeds" if len(seeds) > 1 else "1 seed"
        axes.plot(steps / 1e3, mean, color=colour, linewidth=1.6, label=f"{agent}, {count}")


def _draw_beside(row: Any, env: str) -> None:
    name, _, level = env.partition(", level ")
    table = shipped_comparison(name, **({"level": level, "split": "test"} if level else {}))
    if table is None:
        return
    summary = Scores(table).summary()
    for contender in (each for each in BESIDE if each in summary):
        label, style = BESIDE[contender]
        for axes, key in zip(row, ("return", "type_iii"), strict=True):
            axes.axhline(summary[contender][key], color="0.4", linestyle=style, linewidth=0.9, label=label)
