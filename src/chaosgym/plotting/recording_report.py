"""The report on recordings: verdict, what is seen, trace, spectrum and return map, and the life of a rated surface."""

from collections.abc import Sequence
from typing import NamedTuple

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.arrays import Array
from chaosgym.design.measured import MeasuredPeaks
from chaosgym.numbers import summary
from chaosgym.plotting import design as figures
from chaosgym.plotting import response
from chaosgym.plotting.design_report import CONVERGENCE, Picture, drawn_by, picture_of, rendered
from chaosgym.plotting.style import ACCENT, MUTED, NATURE_COLOURS, STYLE, figure_of
from chaosgym.recordings.runs import JudgedFile, Run, no_recordings
from chaosgym.recordings.trace import Trace

MOST_DRAWN = 12
"""Columns whose pictures stand in one report."""

SHOWN = {
    "meaning": "what it means",
    "certainty": "certainty",
    "transient": "before it settles",
    "horizon": "how long",
    "condition": "what it rests on",
    "tells_more": "what would settle it",
}
"""Rows of the verdict by field of a ``Statement``."""


class ReportSection(NamedTuple):
    """One column of a file as the page shows it: its verdict and figures by name, and its pictures."""

    run: Run
    verdict: dict[str, str]
    readings: dict[str, str]
    pictures: list[Picture]


def recording_report(files: Sequence[JudgedFile], life: MeasuredPeaks | None = None, *, date: str = "") -> str:
    """HTML report of recordings.

    Parameters
    ----------
    files
        What was judged; columns of a series are drawn where their trace was kept.
    life
        Of the one column, where it holds forces and a load rating is stated.
    date
        Of the report; left out if empty, so that a recording gives the same bytes.

    Examples
    --------
    >>> from chaosgym.recordings.runs import judged_files
    >>> page = recording_report(judged_files("docs/data/periodic.csv"))
    >>> "what would settle it" in page, "Life" in page
    (True, False)
    """
    runs = [run for one in files for run in one.runs]
    return rendered(
        "recording.html",
        "",
        files=files,
        others=no_recordings(files),
        sections=[_section(run, place < MOST_DRAWN) for place, run in enumerate(runs)],
        left_out=max(0, len(runs) - MOST_DRAWN),
        colours=NATURE_COLOURS,
        measured=life,
        life_pictures=[] if life is None else _life_pictures(life),
        date=date,
    )


def _section(run: Run, drawn: bool) -> ReportSection:
    told = run.verdict.diagnosis.statement._asdict()
    return ReportSection(
        run,
        {name: told[key] for key, name in SHOWN.items() if told[key]},
        _readings(run),
        _pictures(run) if drawn else [],
    )


def _readings(run: Run) -> dict[str, str]:
    """Where the readings come from, and how they lie."""
    lie, error = summary(run.peaks), run.verdict.error
    what = "largest reading of each cycle" if run.kind == "series" else "readings, one a cycle"
    named = {"smallest": "min", "largest": "max", "mean": "mean", "standard deviation": "std"}
    return {
        "file": run.source,
        "column": run.name,
        "sha256": run.sha256,
        "judged": f"{len(run.peaks)} cycles: {what}",
        **{name: f"{lie[key]:.4g} {run.unit}" for name, key in named.items()},
        **({} if error is None else {"error of a reading": f"±{error.half_width:.3g} {run.unit}, {error.source}"}),
        **{
            ("read" if place == 0 else f"note {place}"): note.removeprefix("read ")
            for place, note in enumerate(run.notes)
        },
    }


def _pictures(run: Run) -> list[Picture]:
    colour, trace = NATURE_COLOURS[run.verdict.diagnosis.nature], run.trace
    pictures = []
    if trace is not None:
        caption = (
            "A few cycles amid the series, dotted where each begins, and the least and largest readings of the whole."
        )
        pictures.append(picture_of(_figure_of_trace(trace, run.unit), caption, wide=True))
    what = "Largest reading of each cycle" if trace is not None else "Readings, one a cycle"
    pictures.append(picture_of(drawn_by(lambda ax: readings(run, colour, ax)), f"{what}; colour: the nature."))
    caption = (
        "Each reading over the one before. A period k leaves k points, a torus a closed curve, chaos more than that."
    )
    pictures.append(picture_of(drawn_by(lambda ax: return_map(run, colour, ax)), caption))
    if trace is not None:
        caption = "Amplitude of the series at each frequency."
        pictures.append(picture_of(drawn_by(lambda ax: spectrum(trace, run.unit, ax)), caption))
    caption = (
        "Spectrum of the readings of the cycles. A period k has lines at multiples of 1/k; noise and chaos are broad."
    )
    pictures.append(picture_of(drawn_by(lambda ax: spectrum_of_cycles(run.peaks, run.unit, ax)), caption))
    return pictures


def readings(run: Run, colour: str, ax: Axes) -> None:
    """Readings over the cycles, and where the response changes."""
    response.cycle_points(run.peaks, ax, color=colour)
    ax.set_ylabel(f"reading [{run.unit}]")
    if np.min(run.peaks) < 0.0:
        ax.autoscale(axis="y")
    for change in run.verdict.changes:
        ax.axvline(change, color=MUTED, lw=1.0, ls=":")


def return_map(run: Run, colour: str, ax: Axes) -> None:
    """Each reading over the one before."""
    response.next_peak(run.peaks, ax, color=colour)
    ax.set(xlabel=f"reading of a cycle [{run.unit}]", ylabel=f"of the next [{run.unit}]")


def spectrum(trace: Trace, unit: str, ax: Axes) -> None:
    """Amplitudes of a series over the frequency."""
    largest = float(trace.amplitude.max()) or 1.0
    ax.semilogy(trace.frequency, np.maximum(trace.amplitude, 1e-6 * largest), color=ACCENT, lw=0.8)
    ax.set(xlabel="frequency [Hz]", ylabel=f"amplitude [{unit}]", xlim=(0.0, float(trace.frequency[-1])))


def spectrum_of_cycles(peaks: Array, unit: str, ax: Axes) -> None:
    """Amplitudes of the readings of cycles, with a Hann window, over the frequency in turns a cycle."""
    window = np.hanning(len(peaks) + 2)[1:-1]
    amplitude = 2.0 * np.abs(np.fft.rfft((peaks - peaks.mean()) * window)) / window.sum()
    largest = float(amplitude.max()) or 1.0
    ax.semilogy(np.fft.rfftfreq(len(peaks)), np.maximum(amplitude, 1e-6 * largest), color=ACCENT, lw=0.8)
    ax.set(xlabel="turns a cycle", ylabel=f"amplitude [{unit}]", xlim=(0.0, 0.5))


def _figure_of_trace(trace: Trace, unit: str) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = figure_of(12.6, 3.5)
        near, whole = figure.subplots(1, 2, width_ratios=(3, 2))
        near.plot(trace.time, trace.value, color=ACCENT, lw=0.9)
        for start in trace.starts:
            near.axvline(start, color=MUTED, lw=0.8, ls=":")
        near.set(xlabel="time [s]", ylabel=f"reading [{unit}]", xlim=(trace.time[0], trace.time[-1]))
        near.set_title("A few cycles")
        whole.fill_between(trace.course, trace.low, trace.high, color=ACCENT, lw=0.6, alpha=0.8)
        whole.set(xlabel="time [s]", xlim=(trace.course[0], trace.course[-1]), title="The whole")
    return figure


def _life_pictures(life: MeasuredPeaks) -> list[Picture]:
    exponent = life.criteria.life_exponent
    with matplotlib.rc_context(STYLE):
        record, running = figure_of(12.6, 3.5), figure_of()
        figures.peak_record(life.peaks, exponent, *record.subplots(1, 2, width_ratios=(3, 1)))
        figures.running_convergence(life.peaks, life.convergence.cycles, *running.subplots(2, 1, sharex=True))
    return [
        picture_of(record, "Peak force of every cycle, and how often each force occurs.", wide=True),
        picture_of(running, CONVERGENCE),
    ]
