"""Figures of a design study: what the force does, what it means for the bearing, and what drives it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, Rectangle
from scipy import stats

from chaosgym.arrays import Array
from chaosgym.design.bearing import STRENGTH
from chaosgym.design.combination import Combination
from chaosgym.design.fatigue import equivalent_force, rating_life
from chaosgym.design.methodology import Assessment
from chaosgym.design.peak_impacts import PeakImpactDiagram
from chaosgym.design.reliability import hertz_pressure
from chaosgym.design.statistics import histogram, running_statistics
from chaosgym.design.trends import LifeTrend
from chaosgym.design.trials import Improvement
from chaosgym.diagnosis import ResponseMap
from chaosgym.machines import Machine
from chaosgym.machines.drive_torque import DriveTorque
from chaosgym.plotting.labels import axis_label
from chaosgym.plotting.style import ACCENT, BAD, INK, MUTED, NATURE_COLOURS, TYPE_COLOURS

PLACES = {
    "m": ("place on the guide, from the crank's axis [mm]", 1e3, 4.0),
    "deg": ("polar angle on the bearing [deg]", 1.0, 20.0),
    "deg of the cycle": ("instant in the cycle, relative to the mean [deg]", 1.0, 20.0),
}
"""By unit of a Peak Impact Diagram: label, factor, and least width shown."""


def peak_record(peaks: Array, exponent: float, left: Axes, right: Axes) -> None:
    """Peak force of every cycle [N], and beside it how often each force occurs, on one scale."""
    shown = np.resize(peaks, max(len(peaks), 60)) if len(peaks) <= 32 else peaks[:400]
    left.plot(np.arange(1, len(shown) + 1), shown, ".", ms=4, color=ACCENT)
    force = equivalent_force(peaks, exponent)
    for axes in (left, right):
        axes.axhline(force, color=INK, lw=1.2)
        axes.axhline(np.max(peaks), color=BAD, lw=1.2, ls="--")
    found = histogram(peaks)
    share = found.count / np.sum(found.count)
    heights = np.diff(found.edges)
    right.barh(found.edges[:-1], share, heights, align="edge", color=ACCENT, alpha=0.75, lw=0)
    top = 1.15 * float(np.max(peaks)) or 1.0
    left.set(xlabel="cycle", ylabel="peak force [N]", ylim=(0.0, top), title="Peak force of every cycle")
    right.set(
        xlabel="share of cycles" + (f" ({len(found.modes)} heaps)" if len(found.modes) > 1 else ""),
        ylim=(0.0, top),
        title="How often",
    )
    right.tick_params(labelleft=False)
    handles = [
        Line2D([], [], color=INK, lw=1.2, label=f"equivalent {force:.1f} N"),
        Line2D([], [], color=BAD, lw=1.2, ls="--", label=f"largest {np.max(peaks):.1f} N"),
    ]
    left.legend(handles=handles, loc="lower left", ncols=2)


def peaks_beside(peaks: Array, assessments: Mapping[str, Assessment], axes: Axes) -> None:
    """Cumulative distribution of measured peak forces [N] beside those of nominal machines and their tolerances."""
    levels = np.linspace(0.0, 1.0, 201)
    highest = float(np.max(peaks))
    for k, (name, found) in enumerate(assessments.items()):
        exponent = found.criteria.life_exponent
        rows = [np.quantile(run.worse_side(exponent), levels) for run in (found.nominal, *found.series.runs)]
        colour = f"C{k}"
        axes.fill_betweenx(levels, np.min(rows, axis=0), np.max(rows, axis=0), color=colour, alpha=0.2, lw=0)
        axes.plot(rows[0], levels, color=colour, lw=1.3, label=name)
        highest = max(highest, float(np.max(rows)))
    axes.plot(np.quantile(peaks, levels), levels, color=INK, lw=1.6, ls="--", label="measured")
    axes.set(xlabel="peak force [N]", ylabel="share of cycles", xlim=(0.0, 1.05 * highest or 1.0), ylim=(0.0, 1.0))
    axes.set_title("Peak force, measured and simulated")
    axes.legend(loc="upper left")


def running_convergence(peaks: Array, cycles: int, mean: Axes, deviation: Axes) -> None:
    """Mean and standard deviation [N] of the first n cycles (thesis figure 5.14)."""
    running = running_statistics(peaks)
    for axes, values, name in ((mean, running.mean, "mean"), (deviation, running.deviation, "standard deviation")):
        axes.plot(running.cycles, values, color=ACCENT, lw=1.3)
        axes.axvline(cycles, color=BAD, lw=1.0, ls="--")
        axes.set(ylabel=f"{name} [N]", xlim=(0, len(peaks)))
    low, high = np.min(running.mean[3:], initial=running.mean[-1]), np.max(running.mean[3:], initial=running.mean[-1])
    mean.set_ylim(low - 0.5 * (high - low) - 0.01, high + 0.5 * (high - low) + 0.01)
    mean.set_title("Running statistics")
    deviation.set_xlabel("cycles")


def type_map_around(result: ResponseMap, region: Any, ax: Axes) -> Axes:
    """Response types around the nominal point; the box is the tolerance region."""
    machine = result.machine
    kinds = list(TYPE_COLOURS)
    index = np.array([[kinds.index(str(kind)) for kind in row] for row in result.type])
    names = (machine.speed_field, machine.clearance_field)
    (across, wide), (up, high) = (axis_label(machine, name) for name in names)
    ax.pcolormesh(
        wide * result.speed,
        high * result.clearance,
        index.T,
        cmap=ListedColormap(list(TYPE_COLOURS.values())),
        vmin=-0.5,
        vmax=len(kinds) - 0.5,
        shading="nearest",
        alpha=0.85,
        rasterized=False,
        edgecolors="white",
        lw=0.5,
    )
    corners = [
        [factor * region[name].at(getattr(machine, name), share) for share in (-1.0, 1.0)]
        for name, factor in zip(names, (wide, high), strict=True)
    ]
    (left, right), (bottom, top) = corners
    ax.add_patch(Rectangle((left, bottom), right - left, top - bottom, fill=False, ec=INK, lw=1.6))
    ax.plot(wide * getattr(machine, names[0]), high * getattr(machine, names[1]), "o", mfc="white", mec=INK, ms=6)
    present = [kind for kind in kinds if kind in set(result.type.ravel())]
    handles = [Patch(color=TYPE_COLOURS[kind], label=f"Type {kind}" if len(kind) < 4 else kind) for kind in present]
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=len(present))
    ax.set(xlabel=across, ylabel=up, title="Response types around the design")
    ax.grid(False)
    return ax


def life_over_speed(trend: LifeTrend, machine: Machine, ax: Axes) -> Axes:
    """Life relative to the lowest speed with contact (thesis figure 5.12): statistical mean, and what peaks suggest."""
    label, factor = axis_label(machine, trend.field)
    nature = np.array(trend.nature)
    for kind, colour in NATURE_COLOURS.items():
        rows = nature == kind
        if rows.any():
            at = factor * trend.values[rows]
            ax.vlines(at, trend.lowest[rows], trend.highest[rows], color=colour, lw=2.2, alpha=0.75)
            ax.plot(at, trend.statistical[rows], "o", ms=3.5, color=colour, label=kind)
    ax.plot(factor * trend.values, trend.statistical, color=INK, lw=0.9)
    calm = factor * trend.values[np.isinf(trend.statistical)]
    if len(calm):
        ax.plot(calm, np.full(len(calm), 0.97), "|", color=INK, transform=ax.get_xaxis_transform(), label="no contact")
    ax.axvline(factor * getattr(machine, trend.field), color=MUTED, lw=1.0, ls=":")
    ax.set(yscale="log", xlabel=label, ylabel="relative life (exponent 3)", title="What speed costs")
    ax.legend(loc="lower left", ncols=2)
    return ax


def drive_torque(drive: DriveTorque, ax: Axes) -> Axes:
    """Torque of the drive [N m] over the crank angle, and its mean."""
    angle = np.linspace(0.0, 360.0, len(drive.torque), endpoint=False)
    ax.plot(angle, drive.torque, color=ACCENT, lw=1.4)
    ax.axhline(drive.mean, color=INK, lw=1.0, ls="--", label=f"mean {drive.mean:.3g} N m")
    ax.set(xlabel="crank angle [deg]", ylabel="torque of the drive [N m]", title="What the motor gives", xlim=(0, 360))
    ax.set_xticks(range(0, 361, 90))
    ax.legend()
    return ax


def stress_against_strength(assessment: Assessment, ax: Axes) -> Axes:
    """Contact stress [GPa] of the nominal machine and of those in tolerance, beside the strength that is stated."""
    criteria = assessment.criteria
    strength, deviation, radius, modulus = (float(getattr(criteria, name)) for name in STRENGTH)
    grid = np.linspace(-4.0, 4.0, 161) * deviation + strength

    def stress(peaks: Array) -> Array:
        pressure = hertz_pressure(peaks, radius, modulus)
        return np.asarray(1e-9 * criteria.fatigue_factor * pressure)

    nominal = stress(assessment.nominal.worse_side(criteria.life_exponent))
    runs = [np.resize(run.worse_side(criteria.life_exponent), 200) for run in assessment.series.runs]
    pooled = stress(np.concatenate(runs)) if runs else nominal
    low, high = float(min(pooled.min(), nominal.min())), float(max(pooled.max(), nominal.max()))
    edges = np.linspace(low - 1e-3, high + 1e-3, 45).tolist()
    ax.hist(pooled, edges, density=True, color=ACCENT, alpha=0.55, lw=0, label="stress, machines in tolerance")
    if len(nominal) > 32:
        ax.hist(nominal, edges, density=True, histtype="step", color=INK, lw=1.1, label="stress, nominal machine")
    else:
        for k, value in enumerate(np.unique(nominal)):
            ax.axvline(value, color=INK, lw=1.1, label=None if k else "stress, nominal machine")
    if deviation > 0.0:
        density = 1e9 * stats.norm.pdf(grid, strength, deviation)
        ax.fill_between(1e-9 * grid, density, color=BAD, alpha=0.35, lw=0, label="strength")
    else:
        ax.axvline(1e-9 * strength, color=BAD, lw=1.6, label="strength")
    ax.set(xlabel="contact stress [GPa]", ylabel="density [1/GPa]", title="Stress against strength")
    ax.set_ylim(0.0, 1.3 * ax.get_ylim()[1])
    ax.legend(loc="upper left")
    return ax


def sensitivities(assessment: Assessment, ax: Axes) -> Axes:
    """Change of the equivalent force [%] for one tolerance of each parameter."""
    trend = assessment.trend
    order = np.argsort(np.abs(trend.slopes))
    values = 100.0 * np.expm1(trend.slopes[order])
    ax.barh(np.arange(len(order)), values, color=np.where(values > 0.0, BAD, ACCENT), alpha=0.8, height=0.62)
    ax.set_yticks(np.arange(len(order)), [trend.parameters[k].replace("_", " ") for k in order])
    ax.axvline(0.0, color=INK, lw=0.8)
    ax.set(xlabel="force for one tolerance upward [%]", title="What drives the force")
    ax.grid(axis="y", visible=False)
    return ax


def total_indices(found: Combination, ax: Axes) -> Axes:
    """Total index of each parameter, for the largest peak force and for the life, with its interval."""
    rows = sorted(found.influences, key=lambda one: one.peak.share)
    for shift, what, name, colour in ((0.18, "peak", "largest peak force", BAD), (-0.18, "life", "life", ACCENT)):
        values = [getattr(one, what) for one in rows]
        at = np.arange(len(rows)) + shift
        ax.barh(at, [value.share for value in values], 0.34, color=colour, alpha=0.8, label=name)
        ax.hlines(at, [max(value.low, 0.0) for value in values], [value.high for value in values], color=INK, lw=1.0)
    ax.set_yticks(np.arange(len(rows)), [one.parameter.replace("_", " ") for one in rows])
    ax.set(xlabel="total index", title="What matters in combination")
    ax.grid(axis="y", visible=False)
    ax.legend(loc="lower right")
    return ax


def scatter_of_series(assessment: Assessment, found: Combination, ax: Axes) -> Axes:
    """Largest peak force [N] of each machine built, over the parameter that matters most for it."""
    most, series = found.most("peak"), assessment.series
    if most is None:
        return ax
    label, factor = axis_label(assessment.machine, most.parameter)
    shares = series.shares[:, series.parameters.index(most.parameter)]
    nominal, tolerance = getattr(assessment.machine, most.parameter), assessment.region[most.parameter]
    values = np.array([factor * tolerance.at(nominal, share) for share in shares])
    peaks = np.array([run.largest_peak for run in series.runs])
    natures = np.array([run.nature for run in series.runs])
    for kind, colour in NATURE_COLOURS.items():
        if (natures == kind).any():
            ax.plot(values[natures == kind], peaks[natures == kind], "o", ms=5, color=colour, label=kind)
    ax.plot(factor * nominal, assessment.nominal.largest_peak, "o", mfc="white", mec=INK, ms=7, label="nominal machine")
    ax.set(xlabel=label, ylabel="largest peak force [N]", title="Machines in tolerance", ylim=(0.0, None))
    ax.set_ylim(0.0, 1.25 * ax.get_ylim()[1])
    ax.legend(loc="upper left", ncols=2)
    return ax


def cost_against_life(found: Improvement, ax: Axes) -> Axes:
    """Life of each change that was assessed over its cost; a line joins the front of both.

    Lives are required ones, or those of the machine as it is where none is required.
    """
    trials = found.suggestions
    unit = "required" if all(one.judges_life for one in trials) else "present"
    finite = [trial.life for trial in trials if np.isfinite(trial.life)]
    top = 3.0 * max([1.0, *finite])
    for kind, colour in TYPE_COLOURS.items():
        for filled in (True, False):
            rows = [one for one in trials if one.assessment.type == kind and one.meets == filled]
            if rows:
                label = f"Type {kind}" if kind != "undetermined" else kind
                at = [(one.cost, min(one.life, top)) for one in rows]
                face = colour if filled else "white"
                misses = not filled and any(one.assessment.checks for one in rows)
                name = label + (", misses a criterion" if misses else "")
                ax.plot(*np.transpose(at), "o", ms=6, mfc=face, mec=colour, label=name)
    front = found.front
    ax.plot([one.cost for one in front], [min(one.life, top) for one in front], color=INK, lw=1.0, label="front")
    ax.axhline(1.0, color=BAD, lw=1.2, ls="--")
    if any(not np.isfinite(one.life) for one in trials):
        ax.annotate("no contact", (0.0, top), fontsize="small", va="bottom")
    ax.set(yscale="log", xlabel="relative cost", ylabel=f"life [{unit} lives]", title="What a longer life costs")
    ax.legend(loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=2)
    return ax


def series_life(assessment: Assessment, ax: Axes) -> Axes:
    """Life of every machine in tolerance by its own statistics [10^6 cycles], ascending, with what is required.

    Where no load rating is stated: its equivalent force [N].
    """
    criteria = assessment.criteria
    exponent, rating, required = criteria.life_exponent, criteria.load_rating, criteria.life
    runs = assessment.series.runs or (assessment.nominal,)
    forces = [equivalent_force(run.worse_side(exponent), exponent) for run in runs]
    lives = np.array(forces if rating is None else [rating_life(force, rating, exponent) for force in forces])
    order = np.argsort(lives)
    colours = [NATURE_COLOURS[runs[k].nature] for k in order]
    ax.scatter(np.arange(1, len(runs) + 1), lives[order], c=colours, s=22, lw=0)
    own = assessment.nominal_evaluation
    ax.axhline(own.force if rating is None else own.life, color=MUTED, lw=1.0, ls=":")
    handles = []
    if rating is not None and required is not None:
        ax.axhline(required, color=BAD, lw=1.3, ls="--")
        handles.append(Line2D([], [], color=BAD, lw=1.3, ls="--", label=f"required {required:,.0f}"))
    handles += [
        Line2D([], [], color=MUTED, lw=1.0, ls=":", label="nominal machine"),
        *(
            Line2D([], [], ls="", marker="o", ms=5, color=NATURE_COLOURS[kind], label=kind)
            for kind in NATURE_COLOURS
            if any(run.nature == kind for run in runs)
        ),
    ]
    ax.legend(handles=handles, loc="upper left", bbox_to_anchor=(0.0, -0.16), ncols=3)
    if rating is None:
        ax.set(xlabel="machine, by force", ylabel="equivalent force [N]", title="Force of each machine built")
        ax.set_ylim(0.0, 1.15 * max(*forces, own.force) or 1.0)
        return ax
    finite = lives[np.isfinite(lives)]
    if len(finite):
        shown = [*finite, *([required] if required is not None else [])]
        ax.set_ylim(0.6 * min(shown), 2.5 * max(shown))
    ax.set(yscale="log", xlabel="machine, by life", ylabel="life [10$^6$ cycles]", title="Life of each machine built")
    return ax


def impact_diagram(diagram: PeakImpactDiagram, ax: Axes) -> Axes:
    """Peak Impact Diagram: force [N] against place on the bearing (thesis figures 5.10 and 5.11).

    Colours show how far impacts on a ball joint lean out of the rod's plane of swing.
    """
    label, factor, least = PLACES[diagram.unit]
    place = factor * diagram.location
    lean = diagram.elevation
    colour: Any = {"color": ACCENT} if lean is None else {"c": lean, "cmap": "coolwarm"}
    dots = ax.scatter(place, diagram.force, s=14, alpha=0.7, lw=0, **colour)
    if lean is not None:
        widest = float(np.max(np.abs(lean)))
        dots.set_clim(-widest, widest)
        ax.figure.colorbar(dots, ax=ax, label="sideways lean [deg]")
    ax.set(xlabel=label, ylabel="peak force [N]", title="Peak Impact Diagram")
    ax.set_ylim(0.0, 1.1 * float(np.max(diagram.force)) or 1.0)
    if np.ptp(place) < least:
        middle = 0.5 * (np.min(place) + np.max(place))
        ax.set_xlim(middle - 0.5 * least, middle + 0.5 * least)
    return ax
