"""The overview figure: three responses, the map of types, the classifier's map, and speed schedules."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from numpy.typing import NDArray

from chaosgym.classifier import RESPONSE_TYPES, ResponseClassifier
from chaosgym.simulation import CycleRecord
from chaosgym.sweeps import LabelledSweep

TYPE_COLOURS = {"I": "#3b7dd8", "II": "#f2a93b", "III": "#d1495b", "undetermined": "#bbbbbb"}
"""One colour a response type, told apart by colour-blind readers too."""


def peak_history(records: Mapping[str, CycleRecord], ax: Axes) -> Axes:
    """Peak force of every cycle for each response type; ``records`` by type, from the first cycle on."""
    for kind, record in records.items():
        ax.plot(record.peak_force[:, 0], ".", ms=3, color=TYPE_COLOURS[kind], label=f"Type {kind}")
    ax.set(xlabel="cycle", ylabel="peak force [N]", ylim=(0, None), title="Peak force of every cycle, from rest")
    ax.legend(loc="upper right", fontsize=8, ncols=len(records))
    return ax


def type_map(sweep: LabelledSweep, ax: Axes) -> Axes:
    """Response types of a sweep over excitation frequency [Hz] and clearance [m]."""
    speed, clearance = (axis["field"] for axis in sweep.settings["axes"][:2])
    kinds = np.array([str(value) for value in sweep.column("response_type")])
    for kind, colour in TYPE_COLOURS.items():
        rows = kinds == kind
        if rows.any():
            ax.scatter(sweep.column(speed)[rows], 1e3 * sweep.column(clearance)[rows], s=12, marker="s", c=colour,
                       label=kind)  # fmt: skip
    ax.set(xlabel="excitation frequency [Hz]", ylabel="clearance [mm]", title="Ground truth: types by simulation")
    ax.legend(loc="upper left", fontsize=8, ncols=4, framealpha=0.9)
    return ax


def classifier_map(classifier: ResponseClassifier, ax: Axes) -> Axes:
    """Most probable types over the two trained parameters, paler where the classifier is less sure."""
    speed, clearance = classifier.fields[:2]
    across = np.linspace(*classifier.card["ranges"][speed], 200)
    up = np.linspace(*classifier.card["ranges"][clearance], 150)
    plane = np.column_stack([grid.ravel() for grid in np.meshgrid(across, up)])
    chances = classifier.predict_proba(plane)
    index = chances.argmax(axis=1).reshape(len(up), len(across))
    sure = (chances.max(axis=1).reshape(index.shape) - 1 / 3) * 1.5
    colours = ListedColormap([TYPE_COLOURS[kind] for kind in RESPONSE_TYPES])
    ax.pcolormesh(across, 1e3 * up, index, cmap=colours, vmin=-0.5, vmax=2.5, alpha=np.clip(sure, 0.05, 1.0))
    ax.set(xlabel="excitation frequency [Hz]", ylabel="clearance [mm]", title="Classifier: types in microseconds")
    return ax


def schedules(speeds: Mapping[str, NDArray[np.float64]], ax: Axes) -> Axes:
    """Speed [Hz] at every step of a job, by controller."""
    for name, values in speeds.items():
        ax.step(np.arange(len(values)), values, where="post", label=name, lw=2 if name == "agent" else 1)
    ax.set(xlabel="step of the job", ylabel="excitation frequency [Hz]", title="Speed schedules")
    ax.legend(fontsize=8)
    return ax


def overview(
    records: Mapping[str, CycleRecord],
    sweep: LabelledSweep,
    classifier: ResponseClassifier,
    speeds: Mapping[str, Any],
    notes: Sequence[str] = (),
) -> Figure:
    """Four panels of ``chaosgym demo``; ``notes`` are printed below."""
    figure = Figure(figsize=(11, 8), layout="constrained")
    axes = figure.subplots(2, 2)
    peak_history(records, axes[0, 0])
    type_map(sweep, axes[0, 1])
    classifier_map(classifier, axes[1, 0])
    schedules(speeds, axes[1, 1])
    if notes:
        figure.supxlabel("   ".join(notes), fontsize=9)
    return figure
