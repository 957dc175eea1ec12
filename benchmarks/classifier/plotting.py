"""Where is the classifier right, how sure is it, and where does it abstain? Pictures of a training's held-out rows."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chaosgym.classifier.calibration import BINS
from chaosgym.classifier.train import TrainingResult
from chaosgym.machines.parameters import parameters_of
from chaosgym.plotting.overview import TYPE_COLOURS, plain_ticks

Array = NDArray[np.float64]


def reliability_diagram(confidence: Array, right: NDArray[np.bool_], ax: Axes, label: str) -> Axes:
    """Share correct against confidence, in bins of equal mass; on the diagonal a probability means what it says."""
    order = np.argsort(confidence)
    bins = [part for part in np.array_split(order, BINS) if len(part)]
    ax.plot([confidence[part].mean() for part in bins], [right[part].mean() for part in bins], "o-", ms=4, label=label)
    ax.plot([0.3, 1], [0.3, 1], color="#888888", lw=0.8)
    ax.set(xlabel="confidence", ylabel="share correct", title="Reliability on held-out machines")
    ax.legend(fontsize=8)
    return ax


def confusion(matrix: list[list[int]], classes: list[str], ax: Axes) -> Axes:
    """Share of each true type (row) that is called each type (column)."""
    counts = np.array(matrix, dtype=float)
    shares = counts / counts.sum(axis=1, keepdims=True).clip(1.0)
    ax.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for (row, column), share in np.ndenumerate(shares):
        ax.text(
            column,
            row,
            f"{share:.2f}\n{int(counts[row, column])}",
            ha="center",
            va="center",
            fontsize=9,
            color="white" if share > 0.6 else "black",
        )
    ax.set(
        xticks=range(len(classes)),
        yticks=range(len(classes)),
        xticklabels=classes,
        yticklabels=classes,
        xlabel="classifier",
        ylabel="simulation",
        title="Response types from parameters",
    )
    return ax


def plane_of_types(trained: TrainingResult, kinds: NDArray[Any], ax: Axes, title: str) -> Axes:
    """Held-out responses in the plane of speed and clearance, by colour of their kind (n,)."""
    examples = trained.examples
    machine = examples.machine
    axes = [machine.speed_field, machine.clearance_field]
    x, y = (examples.values[examples.test, examples.fields.index(name)] for name in axes)
    for kind, colour in (*TYPE_COLOURS.items(), ("answered", "#cccccc"), ("too close to call", "#222222")):
        rows = kinds == kind
        if rows.any():
            ax.plot(x[rows], 1e3 * y[rows], ".", ms=2.5, color=colour, label=f"Type {kind}" if len(kind) < 4 else kind)
    unit = parameters_of(machine)[machine.speed_field].unit
    ax.set(
        yscale="log", xlabel=f"{machine.speed_field.replace('_', ' ')} [{unit}]", ylabel="clearance [mm]", title=title
    )
    ax.legend(fontsize=7, markerscale=4, loc="upper left")
    return plain_ticks(ax)


def learning_curve(points: list[dict[str, Any]], ax: Axes) -> Axes:
    """Held-out accuracy, with its interval, against the number of training points."""
    rows = [point["rows"] for point in points]
    for name in ("response_type", "nature"):
        values = np.array([point[name]["accuracy"] for point in points])
        ax.errorbar(
            rows,
            values[:, 0],
            yerr=np.abs(values[:, 1:].T - values[:, 0]),
            fmt="o-",
            ms=4,
            capsize=3,
            label=name.replace("_", " "),
        )
    ax.set(xlim=(0, None), xlabel="training points", ylabel="held-out accuracy", title="Learning curve, parameters")
    ax.legend(fontsize=8)
    return ax


def picture(trained: TrainingResult) -> Figure:
    """Six panels: true and predicted types, where the classifier abstains, confusion, reliability, learning curve."""
    figure = Figure(figsize=(14, 8.5), layout="constrained")
    axes = figure.subplots(2, 3)
    examples, known = trained.examples, trained.classifier.parameters
    values = examples.values[examples.test]
    truth, nature = examples.response_type[examples.test], examples.nature[examples.test]
    chances, natures = known.predict_proba(values), known.predict_nature_proba(values)
    guess = known.classes_[chances.argmax(axis=1)]
    abstained = trained.classifier.classify_table(values)["abstained"]
    plane_of_types(trained, truth, axes[0, 0], "Simulation, held-out machines")
    plane_of_types(trained, guess, axes[0, 1], "Classifier, most probable type")
    plane_of_types(trained, np.where(abstained, "too close to call", "answered"), axes[0, 2], "Where it abstains")
    confusion(trained.report["parameters"]["confusion"], [str(kind) for kind in known.classes_], axes[1, 0])
    reliability_diagram(chances.max(axis=1), guess == truth, axes[1, 1], "type from parameters")
    right = known.natures_[natures.argmax(axis=1)] == nature
    reliability_diagram(natures.max(axis=1), right, axes[1, 1], "nature from parameters")
    if "learning_curve" in trained.report:
        learning_curve(trained.report["learning_curve"], axes[1, 2])
    else:
        axes[1, 2].set_axis_off()
    return figure


def save_pictures(trained: TrainingResult, folder: str | Path) -> Path:
    """Write ``classifier.png`` into a folder."""
    path = Path(folder) / "classifier.png"
    picture(trained).savefig(path, dpi=110)
    return path
