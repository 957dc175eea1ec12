"""The one picture of each command: ``--plot``. Each function takes a result and returns a figure.

Figures are as wide as a column of a journal takes at 80 % (4.4 in), so that their letters stay above 7 points there.
"""

import re
from collections.abc import Callable, Sequence
from functools import partial, wraps
from textwrap import wrap
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.arrays import Array
from chaosgym.branches.bifurcation_diagram import BifurcationDiagram
from chaosgym.branches.bifurcation_map import BifurcationMap
from chaosgym.design.design_study import DesignStudy
from chaosgym.design.measured import MeasuredPeaks
from chaosgym.diagnosis.verdict import MachineDiagnosis
from chaosgym.fit.overlay import Overlay
from chaosgym.machines import Machine
from chaosgym.machines.picture import frame
from chaosgym.plotting import response
from chaosgym.plotting.branches import bifurcation_map, branches, shares
from chaosgym.plotting.design import cost_against_life, peak_record, series_life, type_map_around
from chaosgym.plotting.labels import axis_label, called
from chaosgym.plotting.response import draw_machine
from chaosgym.plotting.style import ACCENT, INK, MUTED, NATURE_COLOURS, STYLE, figure_of
from chaosgym.recordings.measured_sweep import SweepTypes
from chaosgym.recordings.run_up import RunUp
from chaosgym.recordings.runs import Run
from chaosgym.series import Diagnosis
from chaosgym.simulation import CycleRecord, simulate

WIDTH = 4.4
"""Of a figure [in]."""

SHOWN_CYCLES = 4
"""Cycles of a time history."""

PORTRAIT_CYCLES = 40
"""Cycles of the phase portrait of a response that does not repeat."""

SAMPLES = 500, 4000
"""Least and most samples of a time history in a cycle."""


TITLE: dict[str, Any] = {"x": 0.02, "ha": "left", "fontsize": 10.5, "fontweight": "bold", "color": INK}
"""Style of the title of a picture."""


LETTERS = 11.7
"""Letters of a title in an inch."""


def _titled(figure: Figure, text: str) -> None:
    """Write a title; lines longer than the figure is wide are broken, but not between a number and its unit."""
    width, text = int(LETTERS * figure.get_figwidth()), re.sub(r"(?<=\d) (?=(Hz|rpm)\b)", "\N{NO-BREAK SPACE}", text)
    figure.suptitle("\n".join(part for line in text.split("\n") for part in wrap(line, width)), **TITLE)


def _styled(draw: Callable[..., Figure]) -> Callable[..., Figure]:
    @wraps(draw)
    def drawn(*arguments: Any, **keywords: Any) -> Figure:
        with matplotlib.rc_context(STYLE):
            return draw(*arguments, **keywords)

    return drawn


def point_of(machine: Machine, joint: str | None = None) -> str:
    """Name and operating point of a machine, for a title, and the joint that is shown where there are several."""
    lower, upper = machine.room_of()
    shown, gap = [], "±" if lower == -upper else "gap "
    for name in (machine.speed_field, machine.clearance_field):
        label, factor = axis_label(machine, name)
        sign = gap if name == machine.clearance_field else ""
        if joint is not None and name == machine.clearance_field:
            sign = f"{name.removesuffix('_clearance')} {gap}"
        shown.append(f"{sign}{factor * getattr(machine, name):.4g} {label.rpartition('[')[2].rstrip(']')}")
    shown += [] if joint is None else [f"shown: {joint}"]
    return f"{called(machine)}, {', '.join(shown)}"


def _followed(record: CycleRecord, cycles: int) -> CycleRecord:
    """The last cycles of a record once more, with their time history."""
    cycles = min(cycles, len(record))
    samples = min(max(SAMPLES[0], SAMPLES[1] // cycles), SAMPLES[1])
    last = simulate(record.machine, cycles, record.section[-cycles], samples_per_cycle=samples)
    return last.of_joint(record.joint_name)


POSES = 8
"""Moments of a cycle at which a mechanism is drawn."""


@_styled
def machine_figure(machine: Machine) -> Figure:
    """Draw a machine with its gaps larger than they are; a mechanism at eight crank angles, with its points' paths."""
    figure = figure_of(1.6 * WIDTH, 4.2)
    if machine.draw_poses(figure.subplots(2, POSES // 2).ravel()):
        _titled(figure, f"{point_of(machine)}\nCrank angles; rings: joints with clearance")
        return figure
    figure.clear()
    panel = figure.subplots()
    draw_machine(machine, panel)
    (left, right), (low, high) = panel.dataLim.intervalx, panel.get_ylim()
    if (right - left) / (high - low) * figure.get_figheight() < WIDTH:
        figure.set_figwidth(WIDTH)
        frame(panel, np.array([left, low]), np.array([right, high]))
    _titled(figure, point_of(machine))
    return figure


@_styled
def simulation_figure(record: CycleRecord, transient: int = 0) -> Figure:
    """Peak force of every cycle, and the motion in its gap with the contact force over the last ones."""
    machine, last = record.machine, _followed(record, SHOWN_CYCLES)
    assert last.history is not None
    motion = last.history.reshape(-1, 3)
    unit, factor = ("s", 1.0) if last.time[-1] > 2.0 else ("ms", 1e3)
    figure = figure_of(WIDTH, 5.2)
    peaks, moves, force = figure.subplots(3, 1)
    moves.sharex(force)
    colours = (ACCENT, NATURE_COLOURS["chaotic"])
    for name, place in machine.surfaces.items():
        if place // 2 == last.joint:
            colour = colours[place % 2]
            response.cycle_points(record.peak_force[:, place], peaks, first=transient + 1, color=colour, label=name)
    peaks.set_ylim(0.0, 1.3 * float(record.peak_force.max()) or 1.0)
    peaks.legend(loc="upper right", ncols=2, borderpad=0.1, markerscale=2.0)
    response.curve(factor * last.time, 1e3 * motion[:, 0], moves)
    response.stops(machine.room_of(last.joint), moves, vertical=True)
    moves.set_ylabel("displacement [mm]")
    moves.tick_params(labelbottom=False)
    response.curve(factor * last.time, motion[:, 2], force)
    shown = f"the last {len(last)} cycles" if len(last) > 1 else "the last cycle"
    upward = machine.sides[0] if last.joint_name is None else "upper"
    force.set(xlabel=f"time over {shown} [{unit}]", ylabel=f"force, {upward} + [N]")
    _titled(figure, point_of(machine, last.joint_name))
    figure.align_ylabels()
    return figure


@_styled
def diagnosis_figure(verdict: MachineDiagnosis) -> Figure:
    """Phase portrait with its stops and the stroboscopic section of the settled motion, and the peak forces."""
    judged = verdict.judged
    machine, colour = judged.machine, NATURE_COLOURS[verdict.nature]
    repeats = verdict.period if verdict.nature == "periodic" else None
    last = _followed(judged, repeats or PORTRAIT_CYCLES)
    assert last.history is not None
    figure = figure_of(WIDTH, 5.4)
    portrait, peaks = figure.subplots(2, 1, height_ratios=(3, 2))
    motion = last.history.reshape(-1, 3)
    response.phase_plane(motion[:, 0], motion[:, 1], portrait, pale=repeats is None)
    response.section_points(judged.displacement, judged.velocity, portrait, color=INK if repeats else colour)
    response.stops(machine.room_of(last.joint), portrait)
    portrait.set_title("Motion between the stops; dots: once a cycle", fontweight="normal", fontsize=9.5)
    first = (verdict.horizon or len(judged)) - len(judged) + 1
    worst = judged.worst_side
    response.cycle_points(judged.peak_force[:, worst], peaks, first=first, color=colour)
    peaks.set_ylabel(f"peak force, {machine.sides[worst]} [N]")
    _titled(figure, f"{point_of(machine, judged.joint_name)}\n{verdict.statement.headline}")
    return figure


@_styled
def measured_figure(run: Run) -> Figure:
    """Readings of a recording over the cycles, and their return map."""
    colour = NATURE_COLOURS[run.verdict.diagnosis.nature]
    figure = figure_of(WIDTH, 5.6)
    over, mapped = figure.subplots(2, 1, height_ratios=(2, 3))
    response.cycle_points(run.peaks, over, color=colour)
    response.next_peak(run.peaks, mapped, color=colour)
    if run.unit != "N":
        over.set_ylabel(f"reading [{run.unit}]")
        mapped.set_xlabel(f"reading of a cycle [{run.unit}]")
        mapped.set_ylabel(f"of the next [{run.unit}]")
    _titled(figure, f"{run.title}\n{run.verdict.diagnosis.statement.headline}")
    return figure


MOST_THUMBNAILS, ACROSS, TITLE_WIDTH = 60, 5, 32
"""Recordings on one page at the most, and beside each other; letters of a line above one."""


@_styled
def thumbnails(shown: list[tuple[str, Array, Diagnosis]]) -> Figure:
    """Readings of many recordings (title, peaks, verdict) over the cycles on one page, coloured by nature."""
    told = shown[:MOST_THUMBNAILS]
    across = min(ACROSS, len(told))
    rows = -(-len(told) // across)
    figure = figure_of(2.6 * max(across, 2), 1.8 * rows + 0.5)
    for ax, (title, peaks, verdict) in zip(figure.subplots(rows, across, squeeze=False).flat, told, strict=False):
        number = np.arange(1, len(peaks) + 1)
        ax.plot(number, peaks, ".", ms=2, mew=0.0, color=NATURE_COLOURS[verdict.nature], rasterized=len(peaks) > 5000)
        words = wrap(verdict.words, TITLE_WIDTH, max_lines=2, placeholder=" ...")
        ax.set_title("\n".join([_shortened(title), *words]), fontsize=7)
        ax.tick_params(labelsize=6)
        ax.margins(x=0.01)
    for ax in figure.axes[len(told) :]:
        ax.remove()
    left_out = f", the first {len(told)} of {len(shown)}" if len(told) < len(shown) else ""
    _titled(figure, f"Readings over the cycles{left_out}")
    return figure


def _shortened(title: str) -> str:
    """The end of a title that is too long."""
    return title if len(title) <= TITLE_WIDTH else f"...{title[3 - TITLE_WIDTH :]}"


@_styled
def sweep_figure(speeds: Array, peaks: Array, types: SweepTypes, label: str, title: str) -> Figure:
    """Measured peak forces over the speed, their means, and the regions of types, as in figure 3.16 of the thesis."""
    figure = figure_of(1.45 * WIDTH, 3.0)
    ax = response.types_over_speed(speeds, peaks, types, figure.subplots())
    ax.set(xlabel=label, ylabel="peak force [N]")
    _titled(figure, title)
    return figure


@_styled
def run_up_figure(found: RunUp, title: str, unit: str) -> Figure:
    """Speed and orders over time, and over the speed frequencies of the strongest orders and peaks of the turns."""
    figure = figure_of(2.0 * WIDTH, 5.4)
    (speed, campbell), (orders, peaks) = figure.subplots(2, 2, height_ratios=(2, 3))
    rpm, spectra = 60.0 * found.spectra.speeds, found.spectra
    starts = found.cycles.starts
    speed.plot(starts, found.speeds, color=INK, lw=0.8)
    speed.set(ylabel="speed [rpm]", xlim=(starts[0], starts[-1]))
    largest = float(spectra.amplitude.max()) or 1.0
    shown = 20.0 * np.log10(np.maximum(spectra.amplitude.T / largest, 1e-3))
    mesh = orders.pcolormesh(spectra.times, spectra.orders, shown, cmap="magma_r", shading="nearest", rasterized=True)
    orders.set(xlabel="time [s]", ylabel="order", xlim=(starts[0], starts[-1]))
    figure.colorbar(mesh, ax=orders, label=f"dB of {largest:.3g} {unit}")
    for line in found.lines:
        size = 40.0 * line.amplitude / max(one.largest for one in found.lines)
        campbell.scatter(rpm, line.order * spectra.speeds, s=size, lw=0.0, color=ACCENT, alpha=0.6)
        campbell.text(
            1.01 * rpm.max(), line.order * spectra.speeds.max(), f"{round(line.order, 2):g}", fontsize=7, va="center"
        )
    top = campbell.get_ylim()[1] if found.lines else 1.1 * max((one.frequency for one in found.fixed), default=1.0)
    for fixed in found.fixed:
        if fixed.frequency < top:
            campbell.axhline(fixed.frequency, color=MUTED, lw=0.9, ls="--")
            campbell.text(rpm.min(), fixed.frequency, f"{fixed.frequency:.3g} Hz", fontsize=7, va="bottom")
    campbell.set(ylabel="frequency [Hz]", title="Size: amplitude of an order", ylim=(0.0, top))
    if found.types is None:
        peaks.plot(found.speeds, found.cycles.peaks, ".", ms=3.0, mew=0.0, color=INK)
    else:
        response.types_over_speed(found.judged[0], found.judged[1], found.types, peaks)
    peaks.set(xlabel="speed [rpm]", ylabel=f"peak of a turn [{unit}]")
    _titled(figure, title)
    return figure


@_styled
def classified_figure(runs: Sequence[tuple[str, Array, Diagnosis, dict[str, float]]]) -> Figure:
    """Peak forces of each run and the classifier's probabilities beside them; (name, peaks, verdict, chances) each."""
    figure = figure_of(1.45 * WIDTH, 0.6 + 1.9 * len(runs))
    rows = figure.subplots(len(runs), 2, squeeze=False, width_ratios=(2, 1))
    for (left, right), (name, peaks, verdict, chances) in zip(rows, runs, strict=True):
        response.cycle_points(peaks, left, color=NATURE_COLOURS[verdict.nature])
        left.set_title(f"{name}: {verdict.statement.headline}", fontsize=9.5)
        if chances:
            response.chance_bars(chances, right)
            right.set_title("classifier", fontsize=9.5)
        else:
            right.set_axis_off()
            right.text(0.0, 0.5, "the classifier gives no answer", transform=right.transAxes, fontsize=8.5)
    return figure


@_styled
def peaks_figure(measured: MeasuredPeaks) -> Figure:
    """Peak forces and how often each occurs, with the equivalent force and the life that follows."""
    figure = figure_of(1.45 * WIDTH, 3.0)
    left, right = figure.subplots(1, 2, width_ratios=(5, 2))
    peak_record(measured.peaks, measured.criteria.life_exponent, left, right)
    found = measured.evaluation
    life, low, high = (
        f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"
        for value in (found.life, found.life_interval.low, found.life_interval.high)
    )
    rated = measured.criteria.load_rating is not None
    title = f"Life {life} million cycles ({low} to {high})" if rated else f"Equivalent force {found.force:.1f} N"
    _titled(figure, title)
    left.set_title("")
    return figure


@_styled
def study_figure(study: DesignStudy) -> Figure:
    """What a design report rests on: life of each machine, types around the design, and what changes cost and give."""
    found = study.assessment
    panels: list[Callable[[Axes], object]] = [partial(series_life, found)]
    if study.map is not None:
        panels.append(partial(type_map_around, study.map, found.region))
    if study.improvement is not None and study.improvement.suggestions:
        panels.append(partial(cost_against_life, study.improvement))
    figure = figure_of(1.05 * WIDTH * len(panels), 3.6)
    for ax, panel in zip(np.ravel(figure.subplots(1, len(panels))), panels, strict=True):
        panel(ax)
    title = f"{called(found.machine)}: Type {found.type}, {found.verdict}"
    _titled(figure, title)
    return figure


@_styled
def branch_figure(diagram: BifurcationDiagram) -> Figure:
    """Branches of periodic orbits along a field, over the peaks of a sweep; below, the shares of random starts."""
    shared = any(point.motions for point in diagram.sweep)
    figure = figure_of(1.6 * WIDTH, 6.4 if shared else 4.2)
    panels = figure.subplots(2, height_ratios=(2, 1)) if shared else [figure.subplots()]
    ax = branches(diagram, panels[0])
    if shared:
        shares(diagram, panels[1]).legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=7)
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
    _titled(figure, f"{called(diagram.machine)}: periodic orbits")
    return figure


@_styled
def bifurcation_map_figure(found: BifurcationMap) -> Figure:
    """Curves of bifurcations over two fields, over the natures of a sweep."""
    figure = figure_of(1.6 * WIDTH, 4.4)
    ax = bifurcation_map(found, figure.subplots())
    figure.legend(*ax.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    _titled(figure, f"{called(found.machine)}: where motions change")
    return figure


OVERLAID = 120
"""Cycles of both records shown in their order."""

OVERLAY_STYLES = {"measured": ("tab:red", "o"), "simulated": ("tab:blue", ".")}


def overlay_figure(result: Overlay) -> Figure:
    """Draw both records in three panels."""
    figure = Figure(figsize=(12.0, 4.0), layout="constrained")
    order, spread, section = figure.subplots(1, 3)
    for name, (colour, marker) in OVERLAY_STYLES.items():
        peaks, verdict = getattr(result, name), getattr(result, f"{name}_verdict")
        label = f"{name}: {verdict.words}"
        style = {"color": colour, "marker": marker, "ms": 4, "mfc": "none" if marker == "o" else colour}
        order.plot(np.arange(1, min(OVERLAID, len(peaks)) + 1), peaks[:OVERLAID], lw=0.4, label=label, **style)
        spread.plot(np.sort(peaks), (np.arange(len(peaks)) + 0.5) / len(peaks), color=colour)
        section.plot(peaks[:-1], peaks[1:], ls="", **style)
    order.set(xlabel="cycle", ylabel="peak force [N]")
    order.set_ylim(0.0, 1.3 * max(result.measured.max(), result.simulated.max(), 1e-9))
    order.legend(fontsize=8, loc="upper right")
    spread.set(xlabel="peak force [N]", ylabel="share of the cycles below")
    spread.set_title(f"{result.distance:.3g} N apart on average", fontsize=9)
    section.set(xlabel="peak force of a cycle [N]", ylabel="of the next [N]")
    figure.suptitle(called(result.machine), fontsize=10)
    return figure
