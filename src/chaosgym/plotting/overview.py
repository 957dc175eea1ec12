"""The overview figure: three responses, the map of types, the classifier's map, and speed schedules."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from chaosgym.classifier import MachineClassifier
from chaosgym.control.rollout import Played
from chaosgym.plotting.played_job import draw_speed
from chaosgym.plotting.style import NATURE_COLOURS, TYPE_COLOURS
from chaosgym.simulation import CycleRecord
from chaosgym.sweeps import LabelledSweep


def peak_history(records: Mapping[str, CycleRecord], ax: Axes) -> Axes:
    """Peak force of every cycle for each response type; ``records`` by type, from the first cycle on."""
    for kind, record in records.items():
        machine: Any = record.machine
        name = f"Type {kind}: {machine.excitation_frequency:g} Hz, $\\pm${1e3 * machine.clearance:g} mm"
        ax.plot(record.peak_force[:, 0], ".", ms=3, color=TYPE_COLOURS[kind], label=name)
    ax.set(xlabel="cycle", ylabel="peak force [N]", ylim=(0, None), title="Peak force of every cycle, from rest")
    ax.legend(loc="lower right", fontsize=8)
    return ax


def type_map(sweep: LabelledSweep, ax: Axes) -> Axes:
    """Response types of a grid over excitation frequency [Hz] and clearance [m]."""
    speed, clearance = (sweep.column(axis["field"]).reshape(sweep.shape) for axis in sweep.settings["axes"])
    kinds = sweep.column("response_type").reshape(sweep.shape)
    index = np.vectorize(list(TYPE_COLOURS).index)(kinds)
    ax.pcolormesh(speed, 1e3 * clearance, index, cmap=ListedColormap(list(TYPE_COLOURS.values())), vmin=-0.5, vmax=3.5)
    _plane(ax, "Ground truth: response types by simulation")
    shown = [Patch(color=colour, label=kind) for kind, colour in TYPE_COLOURS.items() if np.any(kinds == kind)]
    ax.legend(handles=shown, loc="lower left", fontsize=8, ncols=2, framealpha=0.9)
    return ax


def classifier_map(classifier: MachineClassifier, ax: Axes) -> Axes:
    """Most probable natures over the two trained parameters, from parameters alone; paler where less sure."""
    ranges: dict[str, tuple[float, float]] = classifier.card["ranges"]
    speed, clearance = np.meshgrid(*[np.geomspace(*ranges[field], 200) for field in classifier.fields], indexing="ij")
    chances = classifier.parameters.predict_proba(np.column_stack([speed.ravel(), clearance.ravel()]))
    index = chances.argmax(axis=1).reshape(speed.shape)
    sure = np.clip(2.0 * chances.max(axis=1).reshape(speed.shape) - 1.0, 0.05, 1.0)
    colours = ListedColormap([NATURE_COLOURS[kind] for kind in classifier.parameters.classes_])
    ax.pcolormesh(speed, 1e3 * clearance, index, cmap=colours, vmin=-0.5, vmax=1.5, alpha=sure)
    return _plane(ax, "Classifier: calm or chaotic, paler where less sure")


def _plane(ax: Axes, title: str) -> Axes:
    """Label a plane of excitation frequency and clearance."""
    ax.set(xscale="log", yscale="log", xlabel="excitation frequency [Hz]", ylabel="clearance [mm]", title=title)
    return plain_ticks(ax)


def plain_ticks(ax: Axes) -> Axes:
    """Write the numbers of logarithmic axes as they are, not as powers of ten."""
    for axis in (ax.xaxis, ax.yaxis):
        axis.set_major_formatter("{x:g}")
        axis.set_minor_formatter("{x:g}")
        axis.set_tick_params(which="both", labelsize=8)
    return ax


def overview(
    records: Mapping[str, CycleRecord],
    sweep: LabelledSweep,
    classifier: MachineClassifier,
    job: Played,
) -> Figure:
    """Four panels of ``chaosgym demo``."""
    figure = Figure(figsize=(11, 8), layout="constrained")
    axes = figure.subplots(2, 2)
    peak_history(records, axes[0, 0])
    type_map(sweep, axes[0, 1])
    classifier_map(classifier, axes[1, 0])
    draw_speed(job, axes[1, 1]).set(xlabel="step", title="The agent on a machine that it has never seen")
    return figure
