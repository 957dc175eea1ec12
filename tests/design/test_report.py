"""The report: complete in one file, at home in a real browser, and never written over anything unasked."""

import doctest
import json
import re
import shutil
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from chaosgym.cli import main
from chaosgym.design import Criteria, assess
from chaosgym.design.bending import BendingLife, stressed
from chaosgym.design.bent_section import Bending, Section
from chaosgym.design.brief import brief_from, template
from chaosgym.design.design_study import LEFT_OUT
from chaosgym.design.measured import evaluate_peaks
from chaosgym.design.study import contradictions, study
from chaosgym.design.surroundings import map_around
from chaosgym.design.texts import life_text
from chaosgym.diagnosis import Tolerance
from chaosgym.errors import DesignError
from chaosgym.plotting.comparison_report import comparison_report, comparison_rows
from chaosgym.plotting.design_report import (
    HEADLINES,
    design_report,
    report_line,
    report_paths,
    write_report,
)
from chaosgym.plotting.printed import BROWSERS
from chaosgym.plotting.recording_report import recording_report
from chaosgym.plotting.workbook import write_workbook
from chaosgym.recordings.kind import RecordingOptions
from chaosgym.recordings.runs import judged_files
from chaosgym.simulation import simulate
from tests.browser import CHROMIUM, Browser
from tests.design.small import small_studies

DOCUMENTATION = Path(__file__).parents[2] / "docs"

needs_browser = pytest.mark.skipif(CHROMIUM is None, reason="chromium is not installed")

CALM = """
machine = "impact-beam"
series = 8
[parameters]
excitation_frequency = "9 Hz"
[tolerances]
excitation_frequency = "2 %"
clearance = "5 %"
[criteria]
load_rating = "300 N"
life = "2000 Mcycles"
reliability = 0.999
machines_that_meet = "90 %"
strength = "1.6 GPa"
strength_deviation = "0.1 GPa"
contact_radius = "8 mm"
contact_modulus = "115 GPa"
safety_factor = 1
[changes]
clearance = ["0.0635 mm"]
"""


def judged(text):
    """A template whose examples of criteria, but for the exponent, are stated."""
    start, end = text.index("[criteria]"), text.index("[changes]")
    lines = [line for line in text[start:end].splitlines() if "life_exponent" not in line]
    return text[:start] + "\n".join(line.removeprefix("# ") for line in lines) + "\n" + text[end:]


@pytest.fixture(scope="module")
def answered():
    """A study of the calm beam, which misses its life until its clearance is reduced."""
    with small_studies():
        return study(brief_from(tomllib.loads(CALM)))


@pytest.fixture
def small():
    """Studies are small ones."""
    with small_studies():
        yield


@pytest.fixture(scope="module")
def answered_page(answered):
    """Its page."""
    return design_report(answered)


@pytest.mark.usefixtures("small")
def test_a_report_that_denies_its_own_machines_is_not_written(answered):
    """Type, largest force and verdict are held against every machine that was built."""
    assert contradictions(answered) == []
    found = answered.assessment
    wild = replace(found.series, runs=(replace(found.series.runs[0], nature="chaotic"), *found.series.runs[1:]))
    low = replace(found.evaluation, largest_force=1.0)
    for name, changed in {
        "not periodic": replace(found, response=replace(found.response, type="I"), series=wild),
        "largest peak": replace(found, response=replace(found.response, type="II"), evaluation=low),
        "does not follow": replace(found, verdict="meets"),
        "nominal machine": replace(found, nominal=replace(found.nominal, nature="chaotic")),
    }.items():
        assert any(name in line for line in contradictions(replace(answered, assessment=changed))), name
    best = answered.improvement.best
    worse = replace(best, assessment=replace(best.assessment, verdict="meets", checks=found.checks))
    changed = replace(answered, improvement=replace(answered.improvement, best=worse))
    assert any("called sufficient" in line for line in contradictions(changed))
    section = Bending(section=Section(at=0.1))
    bent = BendingLife(section, stressed([0.0, 1e8, 0.0], 1, section), (5.0, 4.0))
    assert any(
        "bending life is 1.333" in line
        for line in contradictions(replace(answered, assessment=replace(found, bending=bent)))
    )
    assert any(
        "every response" in line for line in contradictions(replace(answered, assessment=replace(found, series=wild)))
    )


@pytest.mark.usefixtures("small")
def test_a_verdict_alone_is_that_of_the_whole_study(answered):
    """All that the verdict rests on is run in both: assessment, probabilities and guidelines are equal to a digit."""
    alone = study(brief_from(tomllib.loads(CALM)), verdict_only=True)
    assert alone.assessment.as_dict() == answered.assessment.as_dict()
    assert (alone.combination.types, alone.guidelines) == (answered.combination.types, answered.guidelines)
    assert (alone.map, alone.life_over_speed, alone.improvement, alone.margins) == (None, None, None, None)
    assert alone.combination.sampled == 0
    assert any(LEFT_OUT in line for line in alone.lines())
    page = design_report(alone)
    assert "Not looked for" in page
    assert "meets its criteria as it is" not in page


@pytest.mark.parametrize("speed", [30.0, 35.0, 45.0])
def test_the_type_of_a_tube_is_that_of_the_worst_machine_within_its_tolerances(speed):
    """A tube in a loose baffle: no Type I beside a machine that is not periodic, and no force above the largest."""
    tube = chaosgym.read_machine("docs/machines/heat-exchanger-tube.toml").at(speed, 0.3e-3)
    region = {"speed": Tolerance(0.02), "clearance": Tolerance(0.1), "damping_factor": Tolerance(0.2)}
    found = assess(tube, region, Criteria(load_rating=500.0), series_size=16)
    wild = [run.nature for run in found.series.runs if run.nature != "periodic"]
    assert found.type != "I" or not wild
    assert all(f"{wild.count(nature)} {nature}" in found.series.told for nature in set(wild))
    if found.type == "II":
        assert found.evaluation.largest_force >= max(run.largest_peak for run in found.series.runs)


@pytest.fixture(scope="module")
def browser(tmp_path_factory):
    """One browser for all pages; None without chromium."""
    if CHROMIUM is None:
        yield None
        return
    with Browser(tmp_path_factory.mktemp("profile")) as opened:
        yield opened


@pytest.fixture
def run(monkeypatch, capsys):
    """Run ``chaosgym design``, or another, as its entry point does: (exit code, standard output, standard error)."""

    def called(*arguments, command="design"):
        monkeypatch.setattr(sys, "argv", ["chaosgym", command, *map(str, arguments)])
        try:
            main()
            code = 0
        except SystemExit as stop:
            code = stop.code
        return code, *capsys.readouterr()

    return called


def check_page(browser, path, pictures):
    """Nothing is requested but the file itself, nothing complains, and every figure is there and fits."""
    for width in (1200, 420):
        seen = browser.visit(path.as_uri(), width=width)
        assert [url for url in seen.requests if not url.startswith("data:image/svg+xml;base64,")] == [path.as_uri()]
        assert seen.complaints == []
        assert len(seen.pictures) == pictures
        assert all(across > 100 and down > 100 for across, down in seen.pictures)
        assert seen.width[0] <= seen.width[1], "the page is wider than the window"


@needs_browser
def test_report_opens_in_a_browser(answered, answered_page, browser, tmp_path):
    """A page of a study: no external request, no error, all ten figures and a sketch of the machine."""
    path = tmp_path / "report.html"
    write_report(answered_page, answered.as_dict(), path)
    check_page(browser, path, 11)


@needs_browser
def test_browser_test_can_fail(browser, tmp_path):
    """A page with a foreign picture, a script error and a missing figure is caught by the same questions."""
    path = tmp_path / "bad.html"
    path.write_text('<img src="http://example.org/x.png"><script>absent()</script>')
    seen = browser.visit(path.as_uri())
    assert "http://example.org/x.png" in seen.requests
    assert any("Uncaught" in complaint for complaint in seen.complaints)
    assert seen.pictures == [[0, 0]]


def written(path, title, *columns):
    """A CSV file of columns."""
    path.write_text(
        title + "\n" + "\n".join(",".join(f"{each:.6g}" for each in row) for row in zip(*columns, strict=True))
    )
    return path


def vibration(path, title="time [s],acceleration [m/s^2]"):
    """A record of 12 s at 2 kHz: 25 Hz and its second multiple, with noise."""
    time = np.arange(0.0, 12.0, 0.0005)
    noise = np.random.default_rng(0).normal(size=len(time))
    turn = 2.0 * np.pi * 25.0 * time
    return written(path, title, time, 3.0 * np.sin(turn) + np.cos(2.0 * turn) + 0.02 * noise)


@needs_browser
@pytest.mark.parametrize("title", ["time [s],acceleration [m/s^2]", "time [s],displacement [um]", "time [s],force [N]"])
def test_report_on_a_series_opens_in_a_browser(title, browser, tmp_path):
    """Trace, readings of the cycles, return map and two spectra of any quantity, and no life."""
    files = judged_files(str(vibration(tmp_path / "run.csv", title)), traced=True)
    path, page = tmp_path / "report.html", recording_report(files)
    path.write_text(page)
    check_page(browser, path, 5)
    assert title[title.rindex("[") + 1 : -1] in page
    assert "Life" not in page
    assert "<h1>periodic, period 1" in page
    assert "<td>the speed of the machine" in page


@needs_browser
def test_report_on_rated_forces_opens_in_a_browser(browser, tmp_path):
    """Readings, return map and spectrum, then the distribution and the running statistics of the life."""
    peaks = np.random.default_rng(0).normal(50.0, 5.0, 300)
    files = judged_files(str(written(tmp_path / "peaks.csv", "force [N]", peaks)), traced=True)
    rated = evaluate_peaks(peaks, Criteria(load_rating=500.0, stated={"load_rating": "--load-rating"}))
    path, page = tmp_path / "report.html", recording_report(files, rated, date="2026-01-31")
    path.write_text(page)
    check_page(browser, path, 5)
    assert "Life of the surface" in page
    assert f"{rated.evaluation.force:.2f} N" in page
    assert "(--load-rating)" in page
    assert "2026-01-31" in page


def test_report_on_several_recordings_has_each_and_those_that_failed(tmp_path):
    """A table of all columns, a section each, and why a file was not judged; its pictures are those of the records."""
    vibration(tmp_path / "a.csv")
    both = 50.0 + np.arange(200) % 2
    written(tmp_path / "b.csv", "upper [N],lower [N]", both, both + 5.0)
    (tmp_path / "c.csv").write_text("nothing\n")
    files = judged_files(str(tmp_path), RecordingOptions(), traced=True)
    page = recording_report(files)
    assert page.count("<h1>") == 1 + 3
    assert page.count("data:image/svg+xml") == 5 + 3 + 3
    assert "together" in page
    assert "1 of 3 files is no recording: c.csv" in page


def test_the_spectrum_of_a_report_has_the_amplitudes_of_the_series(tmp_path):
    """Sinusoids of 3 and 1 m/s^2 at 25 and 50 Hz stand in the spectrum with these amplitudes, within their window."""
    (file,) = judged_files(str(vibration(tmp_path / "run.csv")), traced=True)
    trace = file.runs[0].trace
    for frequency, amplitude in ((25.0, 3.0), (50.0, 1.0)):
        near = np.abs(trace.frequency - frequency) < 2.0
        assert trace.amplitude[near].max() == pytest.approx(amplitude, rel=0.1)
        assert trace.frequency[near][np.argmax(trace.amplitude[near])] == pytest.approx(frequency, abs=0.6)
    assert (trace.low.min(), trace.high.max()) == pytest.approx((-4.0, 2.2), abs=0.2)


@pytest.fixture(scope="module")
def chaotic():
    """The study of the template with the criteria of its examples: the beam of the thesis at 30 Hz."""
    return study(brief_from(tomllib.loads(judged(template("impact-beam")))))


@pytest.mark.slow
def test_worked_example_of_the_documentation(chaotic):
    """What the page prints is what the command gives, within what chaos leaves open between computers."""
    page = (DOCUMENTATION / "commands" / "design.md").read_text()
    shown, given = (
        {
            name: float(value.replace(",", ""))
            for name, value in re.findall(r"  (fatigue life|reliability|load rating) +([\d.,]+)", text)
        }
        for text in (page, "\n".join(chaotic.lines()))
    )
    assert shown.keys() == given.keys() == {"fatigue life", "reliability", "load rating"}
    assert given == pytest.approx(shown, rel=0.1)
    assert chaotic.assessment.type == "III"
    printed = re.search(r"cheapest change that meets all criteria: (\w+) = (\S+) Hz", page)
    assert chaotic.improvement.best.changes[printed[1]] == pytest.approx(float(printed[2]), rel=0.15)


def test_examples_of_the_documentation():
    """The Python lines of the page give what it prints."""
    assert doctest.testfile(str(DOCUMENTATION / "design.md"), module_relative=False) == (0, 7)


@pytest.mark.slow
@needs_browser
def test_report_on_the_chaotic_beam_opens_in_a_browser(chaotic, browser, tmp_path):
    """Type III has the running statistics as an eleventh figure, beside the sketch of the machine."""
    path = tmp_path / "report.html"
    write_report(design_report(chaotic), chaotic.as_dict(), path)
    check_page(browser, path, 12)


def test_report_says_what_the_numbers_say(answered, answered_page):
    """Headline, best change and life on the page are those of the study; the same study gives the same bytes."""
    page = answered_page
    assert answered.assessment.verdict == "fails"
    assert "Does not meet its criteria" in page
    assert answered.improvement.best is not None
    best = 1e3 * answered.improvement.best.changes["clearance"]
    assert f"clearance 0.127 mm &rarr; {best:.6g} mm" in page
    assert life_text(answered.assessment.evaluation.life) in page
    assert page == design_report(answered)
    assert not re.search(r"<script|https?://", page)


@pytest.mark.usefixtures("small")
def test_motions_that_coexist_are_told_in_the_headline():
    """Two motions of one gear pair: no word of statistics where the worst motion counts in every cycle."""
    text = template("docs/machines/kahraman-singh-1990.toml").replace('speed = "700 Hz"', 'speed = "720 Hz"')
    text = text.replace("# [impacts]", "[impacts]").replace("# clearances", "clearances")
    brief = brief_from(tomllib.loads(text.replace("series = 32", "series = 8")))
    answer = study(replace(brief, region={"clearance": Tolerance(0.01)}, changes={}, costs={}))
    page = design_report(answer)
    assert answer.assessment.type == "III"
    assert "how it was started decides" in page
    assert "only statistics hold" not in page
    assert "statistics over all machines" not in " ".join(answer.lines())
    assert any("no change to try is stated" in line for line in answer.lines())
    assert answer.assessment.verdict == "not judged"
    assert len(answer.impacts) == 3
    assert answer.impacts[0].told(answer.assessment.machine) in page
    assert [one["clearance"] for one in answer.as_dict()["peak_impacts"]["over_clearance"]] == [0.5e-4, 1e-4, 1.5e-4]


def test_a_share_of_no_clearance_is_no_map():
    """A cam without a gap has no second axis: an empty map would be drawn."""
    brief = brief_from(tomllib.loads(template("docs/machines/cam-follower.toml")))
    assert map_around(brief, 1, False) is None


@pytest.mark.usefixtures("small")
def test_a_load_collective_and_wear_are_told():
    """Life, types and damage of each speed stand in lines, page and JSON; the study does not contradict itself."""
    text = CALM.partition("clearance = [")[0].replace(
        "[criteria]", '[duty.speeds]\n"9 Hz" = "75 %"\n"12 Hz" = "25 %"\n[criteria]'
    )
    text += '[archard]\nlimit = "0.3 mm"\nsliding = "2 mm"\narea = "20 mm^2"\n'
    answer = study(brief_from(tomllib.loads(text)))
    told = [line for line in answer.lines() if "of the time at" in line]
    assert len(told) == 2
    assert told[0].strip().startswith("75% of the time at 9 Hz: Type I")
    values = answer.as_dict()
    assert [part["speed"] for part in values["collective"]] == [9.0, 12.0]
    assert sum(part["share_of_damage"] for part in values["collective"]) == pytest.approx(1.0)
    page = design_report(answer)
    assert told[0].strip() in page
    assert answer.assessment.wear is not None
    assert answer.assessment.wear.told[0] in page
    (check,) = [check for check in values["checks"] if check["name"] == "wear life"]
    hours = values["wear"]["assured_hours"]
    assert check["met"] == (hours >= values["required_life_hours"])
    assert check["reached"] == pytest.approx(hours / values["required_life_hours"] * check["required"])
    assert values["wear"]["course"][-1]["clearance"] == pytest.approx(0.3e-3)


def test_numbers_lie_beside_the_report(answered, answered_page, tmp_path):
    """The JSON file holds what the page shows."""
    page, numbers = write_report(answered_page, answered.as_dict(), tmp_path / "report.html")
    values = json.loads(numbers.read_text())
    assert page.read_text().startswith("<!DOCTYPE html>")
    assert values["verdict"] == "fails"
    assert values["response"]["type"] == "I"
    assert values["improvement"]["best"]["verdict"] == "meets"
    assert len(values["series"]["largest_peak_N"]) == 8
    assert values["force_of_every_impact_N"] > 0.0
    assert values["combination"]["types"]["I"]["share"] == 1.0
    assert values["margins"]["nearest"] is None
    assert {"5.3", "5.5.1"} < {one["section"] for one in values["guidelines"]}
    assert len(values["map"]["type"]) == len(values["map"]["speed"])


def test_the_head_of_the_report_says_whose_it_is(answered):
    """Title, project and author of the brief stand in the page's head in that order; an empty one is refused.

    The brief is quoted as text, and every entry of the contents has its place.
    """
    heading = {"title": "Damper & pump", "project": "P-1042", "author": "A. Person"}
    search = answered.improvement
    many = replace(search, suggestions=2 * search.suggestions)  # of more than three changes there is a table
    headed = replace(answered, brief=brief_from(tomllib.loads(CALM) | {"report": heading}), improvement=many)
    page = design_report(headed, date="2026-01-02", brief=CALM + "# <b>")
    assert "Damper &amp; pump · P-1042 · A. Person · 2026-01-02" in page
    assert "<title>Does not meet its criteria: Damper &amp; pump</title>" in page
    assert "The machine in one cycle, its gaps larger than they are." in page
    assert "# &lt;b&gt;" in page
    links = re.findall(r'href="#(\w+)"', page)
    assert links == ["tried", "guidelines", "combination", "joint", "numbers", "assumed", "brief"]
    assert all(f'id="{name}"' in page for name in links)
    with pytest.raises(DesignError, match=r"report\.author = 3 is no text"):
        brief_from(tomllib.loads(CALM) | {"report": {"author": 3}})


def test_a_change_that_ends_all_contact_is_named_as_one(answered):
    """A life without end may be that of a joint that no longer touches: line, headline and table say so."""
    best = answered.improvement.best
    apart = replace(best, force=0.0)
    assert apart.told == f"{best.told} (the joint no longer touches)"
    search = replace(answered.improvement, best=apart, suggestions=(apart,))
    page = design_report(replace(answered, improvement=search))
    assert "</b> (the joint no longer touches)." in page
    assert '<td class="n">no contact</td>' in page


def test_the_tables_are_a_workbook(answered, tmp_path):
    """What the sheets hold is what the study found, with numbers as numbers."""
    openpyxl = pytest.importorskip("openpyxl")
    path = write_workbook(answered, tmp_path / "tables.xlsx")
    book = openpyxl.load_workbook(path, read_only=True)
    assert book.sheetnames == ["result", "parameters", "criteria", "changes", "machines built", "types"]
    found = dict(book["result"].values)
    assert found["equivalent force [N]"] == pytest.approx(answered.assessment.evaluation.force)
    assert found["verdict"] == "fails"
    peaks = [row[2] for row in list(book["machines built"].values)[1:]]
    assert peaks == pytest.approx([run.largest_peak for run in answered.assessment.series.runs])
    assert len(list(book["types"].values)) == 1 + answered.map.type.size
    with pytest.raises(DesignError, match="exists; choose another name"):
        write_workbook(answered, path)
    with pytest.raises(DesignError, match=r"names that end in \.xlsx"):
        write_workbook(answered, tmp_path / "tables.ods")


def test_two_pages_of_one_stem_share_their_numbers(tmp_path):
    """HTML, then PDF or HTML of another ending: equal numbers are written once."""
    first = write_report("<p>", {"a": 1}, tmp_path / "r.html")
    written = first[1].stat().st_mtime_ns
    paths = write_report("<p>", {"a": 1}, tmp_path / "r.htm")
    assert paths[1] == first[1]
    assert first[1].stat().st_mtime_ns == written
    assert report_line(paths) == f"report: {tmp_path / 'r.htm'}"


def test_nothing_is_overwritten_unasked(answered, tmp_path):
    """An existing page stays as it is, and so do numbers of its stem: those of the page go under its whole name."""
    (tmp_path / "report.json").write_text("mine")
    paths = write_report("<p>", {}, tmp_path / "report.html")
    assert [path.name for path in paths] == ["report.html", "report.html.json"]
    assert "its numbers: " in report_line(paths)
    assert (tmp_path / "report.json").read_text() == "mine"
    for name, taken in (("report.html", r"report\.html"), ("report.htm", r"report\.json")):
        (tmp_path / "report.htm.json").write_text("mine too")
        with pytest.raises(DesignError, match=f"{taken} exists; choose another name"):
            write_report("<p>", {}, tmp_path / name)
    write_report("<p>", {"a": 1}, tmp_path / "report.html", overwrite=True)
    assert json.loads((tmp_path / "report.json").read_text()) == {"a": 1}
    with pytest.raises(DesignError, match="is no folder"):
        write_report("<p>", {}, tmp_path / "absent" / "report.html")


@pytest.mark.skipif(not any(map(shutil.which, BROWSERS)), reason="no browser that prints is installed")
def test_a_pdf_is_printed_by_the_browser(tmp_path):
    """The page becomes a PDF of as many sheets as it has, with the numbers beside it."""
    page = "<p>first</p><p style='break-before: page'>second</p>"
    paths = write_report(page, {"a": 1}, tmp_path / "report.pdf")
    assert [path.name for path in paths] == ["report.pdf", "report.json"]
    printed = paths[0].read_bytes()
    assert printed.startswith(b"%PDF-")
    assert len(re.findall(rb"/Type\s*/Page\b", printed)) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["report.json", "report.pdf"]


def test_a_pdf_without_a_browser_is_refused_before_anything_runs(monkeypatch, tmp_path):
    """The refusal names what would print, and no file is left."""
    monkeypatch.setattr("chaosgym.plotting.printed.BROWSERS", ("no-such-browser",))
    with pytest.raises(DesignError, match=r"needs Chromium, Chrome or Edge, and none is found; write \.html"):
        report_paths(tmp_path / "report.pdf")
    assert not list(tmp_path.iterdir())


@pytest.mark.usefixtures("small")
def test_command_answers_a_brief(run, tmp_path):
    """From template to report on the command line; what is printed is what is written."""
    brief, page = tmp_path / "brief.toml", tmp_path / "report.html"
    code, out, _ = run("--template", "impact-beam")
    assert code == 0
    assert tomllib.loads(out)["machine"] == "impact-beam"
    brief.write_text(CALM)
    code, out, err = run(brief, "--out", page, "--json")
    assert code == 0, err
    assert json.loads(out) == json.loads(page.with_suffix(".json").read_text())
    assert "machines in tolerance: 100%" in err
    code, _, err = run(brief, "--out", page)
    assert code == 2
    assert "report.html exists" in err


@pytest.mark.usefixtures("small")
def test_briefs_are_put_side_by_side(answered, browser, tmp_path):
    """Before and after a change: one column each, what differs, and nothing that a single report would not say."""
    text = CALM.replace('"2 %"', '"2 %"\ndamping_ratio = "5 %"')
    after = study(brief_from(tomllib.loads(text)), verdict_only=True)
    studies = {"before.toml": answered, "after.toml": after}
    rows = comparison_rows(studies)
    assert rows["verdict"] == [HEADLINES[one.assessment.verdict][1] for one in studies.values()]
    assert rows["largest peak force"][0] == f"{answered.assessment.evaluation.largest_force:.1f} N"
    page = comparison_report(studies)
    assert "<td>damping ratio</td>" in page
    assert "<td>clearance</td>" in page, "in the table of results"
    assert page.count("<td>youngs modulus</td>") == 0
    path = tmp_path / "compared.html"
    path.write_text(page, encoding="utf-8")
    if CHROMIUM is not None:
        check_page(browser, path, 2)


@pytest.mark.usefixtures("small")
def test_what_was_measured_stands_beside_what_is_simulated(run, browser, tmp_path):
    """A run of the brief's own machine, read as a recording, has its forces; one twice as hard lies outside all."""
    brief, peaks, page = tmp_path / "brief.toml", tmp_path / "peaks.csv", tmp_path / "beside.html"
    brief.write_text(CALM)
    machine = brief_from(tomllib.loads(CALM)).machine
    own = simulate(machine, 60, transient=300).peak_force.max(axis=1)
    for factor, told in ((1.0, str(brief)), (2.0, "no brief")):
        peaks.write_text("upper\n" + "".join(f"{factor * force}\n" for force in own))
        arguments = ("--verdict-only", "--beside", peaks, "--read", "column=upper", "--read", "sensor-error=0.5 N")
        code, out, err = run(brief, *arguments, "--out", page, "--overwrite")
        assert code == 0, err
        assert f"lies within what machines in the tolerances of {told} have" in out
        values, text = json.loads(page.with_suffix(".json").read_text()), page.read_text()
        assert values["measured"]["evaluation"]["force"] == pytest.approx(factor * own[0], rel=1e-3)
        assert f"lies within what machines in the tolerances of {told} have" in text
        assert '<th class="n">measured</th>' in text
        (row,) = re.findall(r"(?m)^equivalent force +([0-9].*)", out)
        assert row.endswith(f"{factor * own[0]:.1f} N")
    if CHROMIUM is not None:
        check_page(browser, page, 2)


def test_a_recording_beside_no_brief_is_refused(run):
    """One line that says what is needed."""
    for arguments, why in (
        (("--beside", "a.csv"), "give a brief"),
        (("a.toml", "--read", "column=2"), "options of a recording need one: --beside FILE"),
        (("a.toml", "--beside", "a.csv", "--plot"), "--plot and --tables go with one brief alone"),
    ):
        code, out, err = run(*arguments)
        assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
        assert why in err


def test_the_same_brief_twice_is_refused(run):
    """One line."""
    code, _, err = run("a.toml", "a.toml")
    assert (code, len(err.strip().splitlines())) == (2, 1)
    assert "given twice" in err


def test_command_evaluates_measured_peaks(run, tmp_path):
    """Peak forces of 50 N under a rating of 100 N last 2^(10/3) million cycles."""
    path = tmp_path / "peaks.csv"
    path.write_text("50\n" * 40)
    code, out, err = run(path, "--load-rating", "100", "--json", command="judge")
    assert code == 0, err
    assert json.loads(out)["evaluation"]["life"] == pytest.approx(2.0 ** (10.0 / 3.0))
    path.write_text("".join(f"{force}\n" for force in (30, 70, 45, 90, 38, 61) * 2))
    code, _, err = run(path, "--load-rating", "100", command="judge")
    assert code == 2
    assert re.search(r"12 cycles are too few .* needed: \d+ or more", err)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "give a brief"),
        (("--template", "impact-bean"), "did you mean impact-beam?"),
        (("absent.toml",), "can't be read"),
        (
            ("absent.toml", "--out", "report.txt"),
            "'report.txt' is no name of a report; allowed: names that end in .html or .pdf",
        ),
    ],
)
def test_wrong_usage_is_one_line_and_code_2(run, arguments, message):
    """No traceback, exit code 2, and what to do."""
    code, out, err = run(*arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(("rating", "message"), [("100", "can't be read"), ("-100", "load_rating = -100 N")])
def test_a_life_of_no_recording_or_no_rating_is_one_line(run, rating, message):
    """As other wrong usage."""
    code, out, err = run("absent.csv", "--load-rating", rating, command="judge")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert message in err


@needs_browser
def test_the_summary_fits_on_one_printed_page(answered_page, browser, tmp_path):
    """On A4 with the margins of the style sheet, 182 mm by 269 mm at 96 dots per inch."""
    path = tmp_path / "report.html"
    path.write_text(answered_page, encoding="utf-8")
    browser.media("print")
    browser.visit(path.as_uri(), width=688)
    assert browser.value("document.querySelector('.summary').getBoundingClientRect().height") <= 1016
    browser.media("")
