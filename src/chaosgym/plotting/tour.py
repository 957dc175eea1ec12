"""Pictures of ``chaosgym demo``, one a step: three responses, their types, a classifier, and an agent at work."""

from collections.abc import Mapping
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from chaosgym.classifier import MachineClassifier
from chaosgym.control.rollout import Played
from chaosgym.plotting.played_job import draw_jobs
from chaosgym.plotting.style import NATURE_COLOURS, STYLE, TYPE_COLOURS
from chaosgym.simulation import CycleRecord
from chaosgym.sweeps import LabelledSweep

TYPES = """Type I: periodic within all tolerances, peak forces nowhere 10 % higher. Type II: periodic, but within the
tolerances peak forces rise by more than that or motion turns irregular. Type III: chaotic or unpredictable."""
"""What the types are; it stands below every picture."""

CHANCES = LinearSegmentedColormap.from_list("chances", [NATURE_COLOURS["periodic"], "white", NATURE_COLOURS["chaotic"]])
"""Colours of a probability of chaos, from those of its certain ends."""


def responses_figure(records: Mapping[str, CycleRecord]) -> Figure:
    """Peak force of every cycle for each response type; ``records`` by type, from the first cycle on."""
    with matplotlib.rc_context(STYLE):
        figure, ax = _figure()
        for kind, record in records.items():
            machine: Any = record.machine
            name = f"Type {kind}: {machine.excitation_frequency:g} Hz, ±{1e3 * machine.clearance:g} mm"
            ax.plot(record.peak_force[:, 0], ".", ms=3, color=TYPE_COLOURS[kind], label=name)
        ax.set(xlabel="cycle", ylabel="peak force [N]", ylim=(0, None), title="A beam between two stops, from rest")
        figure.legend(loc="outside upper left", ncols=len(records), markerscale=3)
        return figure


def types_figure(sweep: LabelledSweep) -> Figure:
    """Response types of a grid over excitation frequency [Hz] and clearance [m]."""
    with matplotlib.rc_context(STYLE):
        figure, ax = _figure()
        speed, clearance = (sweep.column(axis["field"]).reshape(sweep.shape) for axis in sweep.settings["axes"])
        kinds = sweep.column("response_type").reshape(sweep.shape)
        index = np.vectorize(list(TYPE_COLOURS).index)(kinds)
        colours = ListedColormap(list(TYPE_COLOURS.values()))
        ax.pcolormesh(speed, 1e3 * clearance, index, cmap=colours, vmin=-0.5, vmax=len(TYPE_COLOURS) - 0.5)
        _plane(ax, "Types by simulation: where the beam may run, and where not")
        names = {kind: kind if kind == "undetermined" else f"Type {kind}" for kind in TYPE_COLOURS if kind in kinds}
        patches = [Patch(color=TYPE_COLOURS[kind], label=name) for kind, name in names.items()]
        figure.legend(handles=patches, loc="outside upper left", ncols=len(patches))
        return figure


def classifier_figure(classifier: MachineClassifier) -> Figure:
    """Probability of chaos over the two trained parameters, from parameters alone."""
    with matplotlib.rc_context(STYLE):
        figure, ax = _figure()
        ranges: dict[str, tuple[float, float]] = classifier.card["ranges"]
        speed, clearance = np.meshgrid(*[np.linspace(*ranges[name], 200) for name in classifier.fields], indexing="ij")
        chances = classifier.parameters.predict_proba(np.column_stack([speed.ravel(), clearance.ravel()]))
        chaotic = chances[:, list(classifier.parameters.classes_).index("chaotic")].reshape(speed.shape)
        drawn = ax.pcolormesh(speed, 1e3 * clearance, chaotic, cmap=CHANCES, vmin=0.0, vmax=1.0, rasterized=True)
        figure.colorbar(drawn, ax=ax, label="probability of chaos; 0: periodic")
        _plane(ax, "What a classifier has learned of it: chaos, without simulation")
        return figure


def agent_figure(jobs: Mapping[str, Played]) -> Figure:
    """Speeds and forces of the first job of each player, side by side."""
    with matplotlib.rc_context(STYLE):
        figure = Figure(figsize=(9.0, 5.2), layout="constrained")
        draw_jobs(jobs, figure)
        chosen = "Drawn is the machine on which following the demand is most often Type III."
        figure.supxlabel(f"{chosen}\n{TYPES}", fontsize=8.5, ha="left", x=0.02)
        return figure


def _figure() -> tuple[Figure, Axes]:
    """An empty figure above a line on the types, and its axes."""
    figure = Figure(figsize=(7.5, 4.8), layout="constrained")
    figure.supxlabel(TYPES, fontsize=8.5, ha="left", x=0.02)
    return figure, figure.subplots()


def _plane(ax: Axes, title: str) -> None:
    """Label a plane of excitation frequency and clearance."""
    ax.set(xlabel="excitation frequency [Hz]", ylabel="clearance [mm]", title=title)
    ax.grid(visible=False)
