"""The design report: one HTML file that holds everything, and the numbers as JSON.

Figures are embedded as images, there is no script, and the page's own policy forbids every request.
"""

import base64
import io
import json
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import NamedTuple

import jinja2
import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.arrays import Array
from chaosgym.design.bearing import hours_of
from chaosgym.design.changes import value_text
from chaosgym.design.design_study import DesignStudy
from chaosgym.design.fatigue import rating_life
from chaosgym.design.methodology import Assessment
from chaosgym.design.texts import CRITERIA, hours_text, life_text, listed, number_text, percent_text, share_text
from chaosgym.errors import DesignError
from chaosgym.files import check_place, write_atomically
from chaosgym.machines.parameters import Parameter, parameters_of, quantity_of
from chaosgym.plotting import design as figures
from chaosgym.plotting.labels import called
from chaosgym.plotting.printed import print_page, printing_browser
from chaosgym.plotting.response import draw_machine
from chaosgym.plotting.style import STYLE, TYPE_COLOURS, figure_of
from chaosgym.series.verdict import COEXISTING, TYPE_MEANINGS
from chaosgym.version import __version__

CONVERGENCE = (
    "Mean and standard deviation of the first n cycles. They stay within 2 % and 15 % of their final values from the "
    "dashed line on."
)

PDF = ".pdf"
"""Ending of a report that is printed."""

HEADLINES = {
    "meets": ("good", "Meets its criteria"),
    "fails": ("bad", "Does not meet its criteria"),
    "undetermined": ("open", "Not decided"),
    "not judged": ("open", "Not judged"),
}


class Picture(NamedTuple):
    """A figure as base64 of its SVG, with its caption."""

    data: str
    caption: str
    wide: bool


NAMES = {
    "machines that meet": "share of machines that meet",
    "youngs_modulus": "Young's modulus",
    "n_modes": "number of modes",
    "fitted_modes": "number of fitted modes",
    "definition": "everything else of the file, as a fingerprint",
}
"""Names of criteria and parameters that their own do not tell well."""


def design_report(study: DesignStudy, command: str = "", *, date: str = "", brief: str = "") -> str:
    """HTML report of a design study: one page of summary, then what it rests on.

    Parameters
    ----------
    study
        What was found.
    command
        Printed as the way to make it again.
    date, brief
        Of the report, and text of the brief's file; left out if empty, so that a study gives the same bytes.
    """
    found, criteria = study.assessment, study.assessment.criteria
    tone, headline = HEADLINES[found.verdict]
    best = study.improvement.best if study.improvement else None
    tried = list(study.improvement.suggestions) if study.improvement else []
    return rendered(
        "design.html",
        command,
        study=study,
        tone=tone,
        headline=headline,
        meaning=COEXISTING if found.response.coexists else TYPE_MEANINGS[found.type],
        missed=[check.name for check in found.checks if not check.met],
        met={check.name: check.met for check in found.checks},
        intervals={
            "fatigue life": found.evaluation.life_interval,
            "reliability": found.evaluation.reliability_interval,
        },
        date=date,
        brief=brief,
        trials=tried if best is None else [best, *(trial for trial in tried if trial is not best)],
        service_hours=hours_of(found.evaluation.life_interval.low, found.cycle_period),
        required_hours=None if criteria.life is None else hours_of(criteria.life, found.cycle_period),
        rainflow_life=None
        if criteria.load_rating is None
        else rating_life(study.force_of_every_impact, criteria.load_rating, criteria.life_exponent),
        described=parameters_of(found.machine),
        reference=type(found.machine)(),
        asked=parameters_of(criteria),
        bent_of=_of_section(study),
        pictures=_pictures(study),
    )


def _of_section(study: DesignStudy) -> dict[str, Parameter]:
    """Parameters of the section that bends, without those that its kind leaves out."""
    found = study.assessment.bending
    if found is None:
        return {}
    section = found.bending.section
    own = () if section.at is None else ("modulus",) if section.link else ("fibre", "modulus")
    return {name: about for name, about in parameters_of(found.bending).items() if name not in own}


def rendered(template: str, command: str, **names: object) -> str:
    """HTML page of a template; ``command`` is printed as the way to make it again."""
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("chaosgym.plotting"),
        autoescape=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["listed"] = listed
    environment.filters["words"] = environment.filters["named"] = lambda name: NAMES.get(name, name.replace("_", " "))
    environment.filters["called"] = called
    known = {
        "version": __version__,
        "command": command,
        "type_colours": TYPE_COLOURS,
        "value_of": quantity_of,
        "changed_to": value_text,
        "tolerance_of": tolerance_text,
        "newton": lambda value: f"{value:.2f} N",
        "life": life_text,
        "hours": hours_text,
        "share": share_text,
        "number": number_text,
        "percent": percent_text,
        "shown": CRITERIA,
    }
    return environment.get_template(template).render(**known, **names) + "\n"


def write_report(
    page: str, numbers: Mapping[str, object], out: str | Path, overwrite: bool = False
) -> tuple[Path, Path]:
    """Write the page as HTML, or as PDF where the name ends so, and the numbers as JSON beside it.

    Numbers of the same stem that exist, as beside the HTML where a PDF follows, stay as they are: equal ones serve both
    pages, and where they differ these go beside them, into ``r.pdf.json`` of ``r.pdf``.

    Returns
    -------
    paths of both files.

    Raises
    ------
    DesignError
        If the page or the second name of the numbers exists and ``overwrite`` is not set, or no browser prints a PDF.
    OSError
        If one can't be written.
    """
    text = json.dumps(numbers, allow_nan=False, indent=1) + "\n"
    target, beside = report_paths(out, overwrite)
    same = beside.exists() and beside.read_bytes() == text.encode()
    if beside.exists() and not same and not overwrite:
        beside = _second(target)
    write_atomically(target, partial(print_page if target.suffix.lower() == PDF else _write, page))
    if not same:
        write_atomically(beside, partial(_write, text))
    return target, beside


def report_line(paths: tuple[Path, Path]) -> str:
    """Where a report is, and its numbers if another report has those of its stem."""
    page, numbers = paths
    others = f", its numbers: {numbers}, since {page.with_suffix('.json')} holds others"
    return f"report: {page}{others if numbers == _second(page) else ''}"


def _write(content: str, path: Path) -> None:
    path.write_text(content, encoding="utf-8")


def _second(page: Path) -> Path:
    """Name of the numbers of a report where those of its stem are another report's."""
    return page.with_name(f"{page.name}.json")


def report_paths(out: str | Path, overwrite: bool = False) -> tuple[Path, Path]:
    """Paths of the HTML or PDF file, which is free to be written, and of the JSON file, which may exist."""
    page = Path(out)
    if page.suffix.lower() not in (".html", ".htm", PDF):
        raise DesignError(f"{str(out)!r} is no name of a report; allowed: names that end in .html or .pdf")
    if page.suffix.lower() == PDF:
        printing_browser()
    paths = page, page.with_suffix(".json")
    taken = page if page.exists() else paths[1] if paths[1].exists() and _second(page).exists() else None
    if taken and not overwrite:
        raise DesignError(f"{taken} exists; choose another name, or say --overwrite")
    if not page.parent.is_dir():
        raise DesignError(f"{page.parent} is no folder")
    for path in paths:
        check_place(path)
    return paths


def _pictures(study: DesignStudy) -> list[Picture]:
    found, machine = study.assessment, study.assessment.machine
    exponent = found.criteria.life_exponent
    peaks = found.nominal.worse_side(exponent)
    pictures = [
        picture_of(
            _figure_of_peaks(peaks, exponent),
            "The nominal machine, the surface that fatigues faster: peak force of every cycle, and how often each "
            "force occurs.",
            wide=True,
        )
    ]
    caption = "The machine in one cycle, its gaps larger than they are."
    pictures.append(picture_of(drawn_by(lambda ax: draw_machine(machine, ax)), caption))
    if study.improvement is not None and study.improvement.suggestions:
        improvement = study.improvement
        solid = "Filled: meets all criteria. " if found.checks else ""
        what = "that meet" if found.criteria.judges_machines else "that are periodic"
        caption = (
            f"Every change that was assessed over the tolerances. {solid}No change off the line is better than one "
            f"on it in cost, life and share of machines {what}."
        )
        pictures.append(picture_of(drawn_by(lambda ax: figures.cost_against_life(improvement, ax)), caption))
    if study.map is not None:
        caption = "Each square is a machine with its own tolerances around it. Box: the tolerances; circle: the design."
        region, result = study.assessment.region, study.map
        caption = " ".join([caption, *(f"{line[0].upper()}{line[1:]}." for line in result.calm.lines)])
        pictures.append(picture_of(drawn_by(lambda ax: figures.type_map_around(result, region, ax)), caption))
    if study.life_over_speed is not None:
        trend = study.life_over_speed
        bars = "; bars: what the largest and the smallest peak alone would suggest" if trend.scatters else ""
        caption = (
            "Life relative to the lowest speed with contact, by the cube of the force as in the thesis, whatever the "
            f"exponent of the life above. Dots: statistical mean life{bars}. Dotted: the design."
        )
        pictures.append(picture_of(drawn_by(lambda ax: figures.life_over_speed(trend, machine, ax)), caption))
    begun = machine.begins_from()
    caption = f"Machines with deviations spread over all tolerances at once, each from {begun}, by its own statistics."
    pictures.append(picture_of(drawn_by(lambda ax: figures.series_life(found, ax)), caption))
    if found.criteria.tells_reliability:
        caption = "Contact stress at the peak of every cycle, beside the scatter of the strength."
        pictures.append(picture_of(drawn_by(lambda ax: figures.stress_against_strength(found, ax)), caption))
    if found.trend.parameters:
        caption = (
            f"Least squares over the machines in tolerance; the trend leaves {100 * found.trend.unexplained:.1f} % "
            "unexplained. Red raises the force."
        )
        pictures.append(picture_of(drawn_by(lambda ax: figures.sensitivities(found, ax)), caption))
    if study.combination.influences:
        caption = (
            "Share of the variance in which each parameter takes part, alone or with others (total index). Of "
            f"{study.combination.sampled} machines in the tolerances; lines: {100 * found.criteria.confidence:g} % "
            "intervals. Above 1 is the error of the sample."
        )
        pictures.append(picture_of(drawn_by(lambda ax: figures.total_indices(study.combination, ax)), caption))
        caption = "Machines built to the tolerances, over the parameter that matters most for the largest peak force."
        pictures.append(
            picture_of(drawn_by(lambda ax: figures.scatter_of_series(found, study.combination, ax)), caption)
        )
    if len(study.diagram.force):
        filled = study.cycles_to_fill
        shape = f"It has its shape from cycle {filled} on." if filled else "It has not yet its final shape."
        caption = f"Where the peak of each of {len(study.diagram.force)} cycles acts. {shape}"
        pictures.append(picture_of(drawn_by(lambda ax: figures.impact_diagram(study.diagram, ax)), caption))
    if (drive := machine.drive_torque) is not None:
        caption = "The nominal machine at constant speed, every gap in its middle."
        pictures.append(picture_of(drawn_by(lambda ax: figures.drive_torque(drive, ax)), caption))
    if found.nominal.period is None:
        pictures.append(picture_of(_figure_of_convergence(peaks, found.convergence.cycles), CONVERGENCE))
    return pictures


def drawn_by(draw: Callable[[Axes], object]) -> Figure:
    """A figure of one pair of axes."""
    with matplotlib.rc_context(STYLE):
        figure = figure_of()
        draw(figure.add_subplot())
    return figure


def _figure_of_peaks(peaks: Array, exponent: float) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = figure_of(12.6, 3.5)
        left, right = figure.subplots(1, 2, width_ratios=(3, 1))
        figures.peak_record(peaks, exponent, left, right)
    return figure


def _figure_of_convergence(peaks: Array, cycles: int) -> Figure:
    with matplotlib.rc_context(STYLE):
        figure = figure_of()
        figures.running_convergence(peaks, cycles, *figure.subplots(2, 1, sharex=True))
    return figure


def picture_of(figure: Figure, caption: str, wide: bool = False) -> Picture:
    """A figure for the page."""
    buffer = io.BytesIO()
    with matplotlib.rc_context(STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    return Picture(base64.b64encode(buffer.getvalue()).decode("ascii"), caption, wide)


def tolerance_text(found: Assessment, name: str) -> str:
    """Tolerance of a parameter, for people; empty without one."""
    if name not in found.region:
        return ""
    tolerance = found.region[name]
    if tolerance.relative:
        return f"±{100 * tolerance.value:.3g} %"
    unit = parameters_of(found.machine)[name].unit
    value, unit = (1e3 * tolerance.value, "mm") if unit == "m" else (tolerance.value, unit)
    return f"±{value:.4g}" + ("" if unit == "-" else f" {unit}")
