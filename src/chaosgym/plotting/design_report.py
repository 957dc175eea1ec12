"""How does an engineer show the decision to others? One HTML file that holds everything, and the numbers as JSON.

Figures are embedded as images, there is no script, and the page's own policy forbids every request.
"""

import base64
import html
import io
import json
import math
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from pathlib import Path

import matplotlib
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chaosgym.design.fatigue import rating_life
from chaosgym.design.improve import Trial
from chaosgym.design.measured import MeasuredPeaks
from chaosgym.design.methodology import Assessment, Check, Evaluation
from chaosgym.design.study import DesignStudy
from chaosgym.errors import DesignError
from chaosgym.files import write_atomically
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of
from chaosgym.plotting import design as figures
from chaosgym.plotting.overview import TYPE_COLOURS
from chaosgym.version import __version__

HEADLINES = {
    "meets": ("good", "Meets its criteria"),
    "fails": ("bad", "Does not meet its criteria"),
    "undetermined": ("open", "Not decided"),
}

WHAT_TYPES_MEAN = {
    "I": "repeats, and follows a trend when parameters vary",
    "II": "repeats, but small variations change the force by more than 10 %",
    "III": "unpredictable in detail, so that only statistics hold",
    "undetermined": "the nature of the nominal response could not be told",
}

_STYLE = """
:root { --ink:#22303c; --soft:#5b6b79; --line:#dfe5ea; --paper:#ffffff; --ground:#f3f5f7;
  --good:#2c7a4b; --bad:#b3392f; --open:#a06a00; --accent:#1f6f8b; }
* { box-sizing:border-box; }
body { margin:0; background:var(--ground); color:var(--ink);
  font:15px/1.5 system-ui,-apple-system,"Segoe UI",Roboto,"Helvetica Neue",Arial,sans-serif; }
main { max-width:1120px; margin:0 auto; padding:28px 24px 60px; }
header { border-left:6px solid var(--tone); background:var(--paper); padding:22px 28px; border-radius:4px;
  box-shadow:0 1px 3px rgba(30,45,60,.10); }
.good { --tone:var(--good); } .bad { --tone:var(--bad); } .open { --tone:var(--open); }
header p.kicker { margin:0; color:var(--soft); font-size:13px; letter-spacing:.04em; text-transform:uppercase; }
h1 { margin:2px 0 6px; font-size:30px; line-height:1.2; color:var(--tone); }
header p.lead { margin:0; max-width:82ch; }
h2 { font-size:19px; margin:34px 0 12px; }
.cards { display:grid; grid-template-columns:repeat(auto-fit,minmax(165px,1fr)); gap:14px; margin-top:18px; }
.card { background:var(--paper); border-radius:4px; padding:14px 16px; box-shadow:0 1px 3px rgba(30,45,60,.10);
  border-top:3px solid var(--tone,var(--line)); }
.card b { display:block; font-size:24px; line-height:1.25; }
.card span { color:var(--soft); font-size:13px; }
.card .label { text-transform:uppercase; letter-spacing:.04em; font-size:11.5px; }
.scroll { overflow-x:auto; background:var(--paper); box-shadow:0 1px 3px rgba(30,45,60,.10); border-radius:4px; }
table { width:100%; border-collapse:collapse; font-variant-numeric:tabular-nums; }
th,td { text-align:left; padding:8px 12px; border-bottom:1px solid var(--line); vertical-align:top; }
th { font-size:12.5px; color:var(--soft); font-weight:600; background:#fafbfc; }
td.n,th.n { text-align:right; white-space:nowrap; }
tr:last-child td { border-bottom:0; }
tr.best td { background:#eef7f1; }
.tick { color:var(--good); font-weight:700; } .cross { color:var(--bad); font-weight:700; }
.type { display:inline-block; min-width:34px; padding:0 8px; border-radius:10px; color:#fff; font-weight:600;
  text-align:center; font-size:12.5px; }
.figures { display:grid; grid-template-columns:repeat(auto-fit,minmax(460px,1fr)); gap:16px; }
figure { margin:0; background:var(--paper); border-radius:4px; padding:12px 14px 14px;
  box-shadow:0 1px 3px rgba(30,45,60,.10); }
figure.wide { grid-column:1/-1; }
figure img { width:100%; height:auto; display:block; }
figcaption { color:var(--soft); font-size:13px; margin-top:8px; }
.columns { display:grid; grid-template-columns:repeat(auto-fit,minmax(460px,1fr)); gap:16px; align-items:start; }
.columns > *,.figures > * { min-width:0; }
.note { color:var(--soft); font-size:13.5px; max-width:90ch; }
footer { margin-top:36px; padding-bottom:8px; color:var(--soft); font-size:12.5px; }
@media (max-width:560px) { .figures,.columns { grid-template-columns:1fr; } main { padding:16px 12px 40px; } }
@media print { body { background:#fff; } main { max-width:none; padding:0; }
  figure,.scroll,.card { break-inside:avoid; box-shadow:none; border:1px solid var(--line); } }
"""


def design_report(study: DesignStudy, command: str = "") -> str:
    """HTML report of a design study; ``command`` is printed as the way to make it again."""
    found, machine = study.assessment, study.assessment.machine
    tone, headline = HEADLINES[found.verdict]
    parts = [
        f'<header class="{tone}"><p class="kicker">Design report &middot; {_text(machine.name)}</p>'
        f'<h1>{headline}</h1><p class="lead">{_lead(study)}</p></header>',
        _cards(found),
        "<h2>Criteria</h2>" + _checks(found.checks),
        _changes(study),
        "<h2>What the joint does</h2>" + _figures(study),
        "<h2>How the numbers came about</h2>" + _evaluations(study),
        "<h2>What was assumed</h2>" + _inputs(study),
    ]
    return _page(f"{headline}: {machine.name}", parts, command)


def measured_report(measured: MeasuredPeaks, command: str = "") -> str:
    """HTML report on measured peak forces."""
    found = measured.evaluation
    lead = (
        f"{len(measured.peaks)} measured cycles, equivalent force {found.force:.3g} N: a surface with a load rating of "
        f"{measured.criteria.load_rating:g} N lasts {_life(found.life)} million cycles "
        f"({' to '.join(_life(end) for end in found.life_interval)})."
    )
    record = _figure_of_peaks(measured.peaks, measured.criteria.life_exponent)
    pictures = [_picture(record, "Peak force of every cycle, and how often each force occurs.", wide=True)]
    pictures.append(_picture(_figure_of_convergence(measured.peaks, measured.convergence.cycles), _CONVERGENCE))
    parts = [
        '<header class="open"><p class="kicker">Design report &middot; measured peak forces</p>'
        f'<h1>{_life(found.life)} million cycles</h1><p class="lead">{lead}</p></header>',
        "<h2>What the joint does</h2>" + f'<div class="figures">{"".join(pictures)}</div>',
        "<h2>How the numbers came about</h2>" + _evaluation_table({"measured": found}),
        "<h2>What was assumed</h2>"
        + _table(
            ("criterion", "value"),
            [(name.replace("_", " "), _value(measured.criteria, name)) for name in parameters_of(measured.criteria)],
            (1,),
        ),
    ]
    return _page("Measured peak forces", parts, command)


def write_report(
    page: str, numbers: Mapping[str, object], out: str | Path, overwrite: bool = False
) -> tuple[Path, Path]:
    """Write the HTML file, and the numbers as JSON beside it.

    Returns
    -------
    paths of both files.

    Raises
    ------
    DesignError
        If one of them exists and ``overwrite`` is not set, or can't be written.
    """
    paths = report_paths(out, overwrite)
    text = json.dumps(numbers, allow_nan=False, indent=1)
    for path, content in zip(paths, (page, text + "\n"), strict=True):
        try:
            write_atomically(path, partial(_write, content=content))
        except OSError as error:
            raise DesignError(f"{path} can't be written: {error.strerror}") from None
    return paths


def _write(path: Path, content: str) -> None:
    path.write_text(content, encoding="utf-8")


def report_paths(out: str | Path, overwrite: bool = False) -> tuple[Path, Path]:
    """Paths of the HTML and the JSON file, both free to be written."""
    page = Path(out)
    if page.suffix.lower() not in (".html", ".htm"):
        raise DesignError(f"out = {str(out)!r} is not an HTML file; allowed: a name that ends in .html")
    paths = page, page.with_suffix(".json")
    for path in paths:
        if path.exists() and not overwrite:
            raise DesignError(f"{path} exists; choose another name, or say --overwrite")
    if not page.parent.is_dir():
        raise DesignError(f"{page.parent} is no folder")
    return paths


def _page(title: str, parts: Iterable[str], command: str) -> str:
    again = f"<br>Made by <code>{_text(command)}</code>" if command else ""
    return (
        '<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta http-equiv="Content-Security-Policy" content="default-src \'none\'; img-src data:; '
        "style-src 'unsafe-inline'\">"
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{_text(title)}</title><style>{_STYLE}</style></head><body><main>\n"
        + "\n".join(parts)
        + f"\n<footer>chaosgym {__version__}; methodology of P. Gu, Chaotic Vibration in Machine Systems and Its "
        f"Implications for Design, MIT, 1994, chapter 5.{again}</footer></main></body></html>\n"
    )


def _lead(study: DesignStudy) -> str:
    found, machine = study.assessment, study.assessment.machine
    where = " and ".join(_named(machine, name) for name in (machine.speed_field, machine.clearance_field))
    repeats = f", period {found.nominal.period}" if found.nominal.period else ""
    sentences = [
        f"With {where} the joint's response is {found.nominal.nature}{repeats}, and over the tolerances it is of Type "
        f"{found.type}: {WHAT_TYPES_MEAN[found.type]}."
    ]
    missed = [check.name for check in found.checks if not check.met]
    if missed:
        sentences.append(f"It misses the required {' and '.join(missed)}.")
    improvement = study.improvement
    if improvement is not None and improvement.best is not None:
        best = improvement.best
        sentences.append(f"The cheapest change found that meets all criteria: <b>{_change(machine, best)}</b>.")
    elif improvement is not None:
        sentences.append("None of the changes tried, alone or in pairs, meets all criteria.")
    return " ".join(sentences)


def _cards(found: Assessment) -> str:
    value, machine = found.evaluation, found.machine
    hours = value.life_interval.low * 1e6 * machine.cycle_period / 3600.0
    by_name = {check.name: check for check in found.checks}
    cards = [
        ("", "response type", f"Type {found.type}" if found.type != "undetermined" else "open", found.nominal.nature),
        (
            _tone(by_name["fatigue life"].met),
            "fatigue life",
            _life(value.life_interval.low),
            f"million cycles ({_hours(hours)}); required {found.criteria.life:,g}",
        ),
        (
            _tone(by_name["reliability"].met),
            "reliability",
            _share(value.reliability_interval.low),
            f"required {_share(found.criteria.reliability)}",
        ),
        ("", "largest peak force", f"{value.largest_force:.1f} N", f"equivalent {value.force:.1f} N"),
        ("", "load rating needed", f"{value.required_load_rating:.0f} N", f"chosen {found.criteria.load_rating:g} N"),
        (
            _tone(by_name["machines that meet"].met),
            "machines that meet",
            _percent(found.machines_that_meet),
            f"of {max(len(found.series.runs), 1)} in tolerance, each by its own force",
        ),
    ]
    return (
        '<div class="cards">'
        + "".join(
            f'<div class="card {tone}"><span class="label">{label}</span><b>{big}</b><span>{small}</span></div>'
            for tone, label, big, small in cards
        )
        + "</div>"
    )


def _checks(checks: Iterable[Check]) -> str:
    rows = [
        (
            check.name,
            _reached(check.name, check.reached),
            _reached(check.name, check.required),
            check.unit,
            _mark(check.met),
        )
        for check in checks
    ]
    return _table(("criterion", "reached", "required", "", "met"), rows, numeric=(1, 2)) + (
        '<p class="note">Life and reliability of statistical evaluations are the unfavourable ends of their confidence '
        "intervals.</p>"
    )


def _changes(study: DesignStudy) -> str:
    improvement, machine = study.improvement, study.assessment.machine
    if improvement is None:
        return '<h2>What to change next</h2><p class="note">Nothing: the machine meets its criteria as it is.</p>'
    trials = list(improvement.suggestions)
    best = improvement.best
    if best is not None:
        trials = [best, *(trial for trial in trials if trial is not best)]
    rows = []
    for trial in trials:
        value = trial.assessment.evaluation
        rows.append(
            (
                _change(machine, trial),
                _type(trial.assessment.type),
                f"{trial.cost:.2f}",
                _life(value.life_interval.low),
                _share(value.reliability_interval.low),
                f"{value.largest_force:.1f} N",
                _mark(trial.meets),
            )
        )
    head = ("change", "type", "cost", "life [10<sup>6</sup> cycles]", "reliability", "largest peak", "meets all")
    note = (
        '<p class="note">Every change was built and simulated over the same tolerances. Cost: weight &times; '
        "|ln(new / old)|. Those that meet all criteria come first, by cost; the others follow by how far they miss.</p>"
    )
    return "<h2>What to change next</h2>" + _table(head, rows, (2, 3, 4, 5), best=best is not None) + note


_CONVERGENCE = (
    "Mean and standard deviation of the first n cycles. They stay within 2 % and 15 % of their final values from the "
    "dashed line on."
)


def _figures(study: DesignStudy) -> str:
    found, machine = study.assessment, study.assessment.machine
    exponent = found.criteria.life_exponent
    peaks = found.nominal.worse_side(exponent)
    pictures = [
        _picture(
            _figure_of_peaks(peaks, exponent),
            "The nominal machine, the surface that fatigues faster: peak force of every cycle, and how often each "
            "force occurs.",
            wide=True,
        )
    ]
    if study.map is not None:
        caption = "Each square is a machine with its own tolerances around it. Box: the tolerances; circle: the design."
        region, result = study.assessment.region, study.map
        pictures.append(_picture(_drawn(lambda ax: figures.type_map_around(result, region, ax)), caption))
    if study.life_over_speed is not None:
        trend = study.life_over_speed
        caption = (
            "Life relative to the lowest speed. Dots: statistical mean life; bars: what the largest and the smallest "
            "peak alone would suggest. Dotted: the design."
        )
        pictures.append(_picture(_drawn(lambda ax: figures.life_over_speed(trend, machine, ax)), caption))
    caption = "Machines with deviations spread over all tolerances at once, each from rest, by its own statistics."
    pictures.append(_picture(_drawn(lambda ax: figures.series_life(found, ax)), caption))
    caption = "Contact stress at the peak of every cycle, beside the scatter of the strength."
    pictures.append(_picture(_drawn(lambda ax: figures.stress_against_strength(found, ax)), caption))
    if found.trend.parameters:
        caption = (
            f"Least squares over the machines in tolerance; the trend leaves {100 * found.trend.unexplained:.1f} % "
            "unexplained. Red raises the force."
        )
        pictures.append(_picture(_drawn(lambda ax: figures.sensitivities(found, ax)), caption))
    if len(study.diagram.force):
        filled = study.cycles_to_fill
        shape = f"It has its shape from cycle {filled} on." if filled else "It has not yet its final shape."
        caption = f"Where the peak of each of {len(study.diagram.force)} cycles acts. {shape}"
        pictures.append(_picture(_drawn(lambda ax: figures.impact_diagram(study.diagram, ax)), caption))
    if found.nominal.period is None:
        pictures.append(_picture(_figure_of_convergence(peaks, found.convergence.cycles), _CONVERGENCE))
    return f'<div class="figures">{"".join(pictures)}</div>'


def _evaluations(study: DesignStudy) -> str:
    found, every = study.assessment, study.force_of_every_impact
    cycles = found.convergence
    statistics = (
        f"Statistics of the nominal machine rest on {cycles.recorded} cycles; {cycles.needed} are needed, and mean and "
        f"deviation stay in their bands from cycle {cycles.cycles} on."
        if found.nominal.period is None
        else "The nominal response repeats every "
        f"{'cycle' if found.nominal.period == 1 else f'{found.nominal.period} cycles'}."
    )
    if found.nominal.period is None and not cycles.converged:
        statistics += " <b>They have not converged.</b>"
    return (
        _evaluation_table({"verdict rests on": found.evaluation, "nominal machine": found.nominal_evaluation})
        + f'<p class="note">{_text(found.evaluation.method)}. Type {found.type} because '
        f"{_text(found.response.reason)}. Nominal machine: {_text(found.nominal.reason)}. {statistics}</p>"
        '<p class="note">A cycle counts once, by its peak. Counting every impact of the nominal machine instead '
        f"(rainflow) gives an equivalent force of {every:.1f} N and a life of "
        f"{_life(rating_life(every, found.criteria.load_rating, found.criteria.life_exponent))} million cycles.</p>"
    )


def _evaluation_table(columns: Mapping[str, Evaluation]) -> str:
    def row(name: str, show: Callable[[Evaluation], str]) -> tuple[str, ...]:
        return (name, *(show(value) for value in columns.values()))

    rows = [
        row("equivalent peak force", lambda value: f"{value.force:.2f} N"),
        row("largest peak force", lambda value: f"{value.largest_force:.2f} N"),
        row("life by Palmgren-Miner (eq. 5.4)", lambda value: f"{_life(value.life)} &middot; 10<sup>6</sup>"),
        row("its interval", lambda value: " to ".join(_life(end) for end in value.life_interval)),
        row(
            "conservative life, largest force throughout (eq. 5.2)",
            lambda value: f"{_life(value.conservative_life)} &middot; 10<sup>6</sup>",
        ),
        row("load rating for the required life (eq. 5.5)", lambda value: f"{value.required_load_rating:.1f} N"),
        row("reliability over the distribution (eq. 5.8)", lambda value: _share(value.reliability)),
        row("its interval", lambda value: " to ".join(_share(end) for end in value.reliability_interval)),
        row("reliability, normal approximation (eq. 5.9)", lambda value: _share(value.normal_reliability)),
        row("safety factor at the largest stress (eq. 5.6)", lambda value: _number(value.safety_factor)),
    ]
    return _table(("quantity", *columns), rows, numeric=range(1, len(columns) + 1))


def _inputs(study: DesignStudy) -> str:
    found, brief = study.assessment, study.brief
    machine = found.machine
    described = parameters_of(machine)
    reference = type(machine)()
    parameters = [
        (
            name.replace("_", " "),
            _value(machine, name),
            _tolerance(machine, name, found),
            "given" if getattr(machine, name) != getattr(reference, name) else described[name].provenance,
        )
        for name in described
    ]
    criteria = [
        (
            name.replace("_", " "),
            _value(found.criteria, name),
            "brief" if name in brief.stated else f"{about.provenance}: {_text(about.source)}",
        )
        for name, about in parameters_of(found.criteria).items()
    ]
    return (
        '<div class="columns">'
        + _table(("parameter", "value", "tolerance", "from"), parameters, numeric=(1, 2))
        + _table(("criterion", "value", "from"), criteria, numeric=(1,))
        + "</div>"
        f'<p class="note">Machines in tolerance: {len(found.series.runs)}, Sobol sequence, seed {study.seed}.</p>'
    )


def _table(
    head: Iterable[str], rows: Iterable[tuple[str, ...]], numeric: Iterable[int] = (), best: bool = False
) -> str:
    numbers = set(numeric)

    def cells(tag: str, row: Iterable[str]) -> str:
        return "".join(f"<{tag}{' class=n' if k in numbers else ''}>{cell}</{tag}>" for k, cell in enumerate(row))

    body = "".join(
        f"<tr{' class=best' if best and k == 0 else ''}>{cells('td', row)}</tr>" for k, row in enumerate(rows)
    )
    return f'<div class="scroll"><table><thead><tr>{cells("th", head)}</tr></thead><tbody>{body}</tbody></table></div>'


def _drawn(draw: Callable[[Axes], object]) -> Figure:
    with matplotlib.rc_context(figures.STYLE):
        figure = figures.figure_of()
        draw(figure.add_subplot())
    return figure


def _figure_of_peaks(peaks: figures.Array, exponent: float) -> Figure:
    with matplotlib.rc_context(figures.STYLE):
        figure = figures.figure_of(12.6, 3.5)
        left, right = figure.subplots(1, 2, width_ratios=(3, 1))
        figures.peak_record(peaks, exponent, left, right)
    return figure


def _figure_of_convergence(peaks: figures.Array, cycles: int) -> Figure:
    with matplotlib.rc_context(figures.STYLE):
        figure = figures.figure_of()
        figures.running_convergence(peaks, cycles, *figure.subplots(2, 1, sharex=True))
    return figure


def _picture(figure: Figure, caption: str, wide: bool = False) -> str:
    buffer = io.BytesIO()
    with matplotlib.rc_context(figures.STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    return (
        f'<figure{" class=wide" if wide else ""}><img alt="{_text(caption)}" src="data:image/svg+xml;base64,{data}">'
        f"<figcaption>{_text(caption)}</figcaption></figure>"
    )


def _text(value: object) -> str:
    return html.escape(str(value), quote=True)


def _value(owner: object, name: str) -> str:
    value, unit = getattr(owner, name), parameters_of(owner)[name].unit
    if isinstance(value, str):
        return _text(value)
    if unit == "m":
        value, unit = 1e3 * value, "mm"
    elif unit == "Pa" and abs(value) >= 1e6:
        value, unit = 1e-9 * value, "GPa"
    elif unit == "Mcycles":
        unit = "million cycles"
    return f"{value:,.6g}" + ("" if unit == "-" else f" {unit}")


def _named(machine: Machine, name: str) -> str:
    return f"{name.replace('_', ' ')} {_value(machine, name)}"


def _tolerance(machine: Machine, name: str, found: Assessment) -> str:
    if name not in found.region:
        return ""
    tolerance = found.region[name]
    if tolerance.relative:
        return f"&plusmn;{100 * tolerance.value:.3g} %"
    unit = parameters_of(machine)[name].unit
    value, unit = (1e3 * tolerance.value, "mm") if unit == "m" else (tolerance.value, unit)
    return f"&plusmn;{value:.4g}" + ("" if unit == "-" else f" {unit}")


def _change(machine: Machine, trial: Trial) -> str:
    return ", ".join(
        f"{name.replace('_', ' ')} {_value(machine, name)} &rarr; {_value(trial.assessment.machine, name)}"
        for name in trial.changes
    )


def _type(kind: str) -> str:
    return f'<span class="type" style="background:{TYPE_COLOURS[kind]}">{kind if len(kind) < 4 else "open"}</span>'


def _mark(met: bool) -> str:
    return '<span class="tick">&#10003; yes</span>' if met else '<span class="cross">&#10007; no</span>'


def _tone(met: bool) -> str:
    return "good" if met else "bad"


def _number(value: float) -> str:
    return f"{value:.3g}" if math.isfinite(value) else "no contact"


def _life(value: float) -> str:
    if not math.isfinite(value):
        return "unlimited"
    return f"{value:,.0f}" if value >= 100.0 else f"{value:.3g}"


def _hours(value: float) -> str:
    return f"{value:,.0f} h" if math.isfinite(value) else "no contact"


def _share(value: float) -> str:
    """Probability with as many nines as it has."""
    if value >= 1.0 - 1e-9:
        return "1.0000" if value == 1.0 else "&gt; 0.99999999"
    digits = max(4, math.ceil(-math.log10(1.0 - value)) + 2) if value > 0.0 else 4
    return f"{value:.{min(digits, 9)}f}"


def _reached(name: str, value: float) -> str:
    shown = {"fatigue life": _life, "reliability": _share, "safety factor": _number, "machines that meet": _percent}
    return shown[name](value)


def _percent(value: float) -> str:
    return f"{100.0 * value:.0f} %"
