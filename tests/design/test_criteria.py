"""No criterion that nobody stated: what is not stated is not judged, and the answer says so."""

import re
import tomllib

import numpy as np
import pytest

from chaosgym.design import Criteria, assess, improve
from chaosgym.design.brief import brief_from, read_brief, template
from chaosgym.design.measured import evaluate_peaks
from chaosgym.design.study import study
from chaosgym.diagnosis import Tolerance
from chaosgym.machines import ImpactBeam
from chaosgym.plotting.commands import peaks_figure
from chaosgym.plotting.comparison_report import comparison_report
from chaosgym.plotting.design_report import design_report
from tests.cli.run import run
from tests.design.small import small_studies

CALM = ImpactBeam(excitation_frequency=10.0)
STEEL = {"strength": 1.6e9, "strength_deviation": 0.1e9, "contact_radius": 8e-3, "contact_modulus": 1.15e11}


def quick(text):
    """A template with a small series, one tolerance and one change."""
    values = tomllib.loads(text)
    clearance = next(name for name in values["parameters"] if "clearance" in name)
    kept = {name: dict(list(values[name].items())[:0]) for name in ("costs",)}
    kept["tolerances"] = {clearance: values["tolerances"].get(clearance, "5 %")}
    kept["changes"] = {clearance: values["changes"][clearance][:1]}
    return {**values, **kept, "series": 8}


def machine_of(kind, folder):
    """Name of a machine, or the file that ``new-machine`` writes of it."""
    if kind in ("impact-beam", "slider-crank"):
        return kind
    path = str(folder / f"{kind}.toml")
    assert run("new-machine", "modes" if kind == "own" else kind, "--out", path)[0] == 0
    return path


@pytest.mark.parametrize(
    "kind",
    [
        "impact-beam",
        "own",
        *(pytest.param(one, marks=pytest.mark.slow) for one in ("slider-crank", "compressor")),
    ],
)
def test_a_template_of_each_kind_is_told_and_not_judged(kind, tmp_path):
    """From template to report: forces, types and changes, and no life, reliability or verdict on them."""
    with small_studies():
        answer = study(brief_from(quick(template(machine_of(kind, tmp_path)))))
    found, lines = answer.assessment, answer.lines()
    assert (found.verdict, found.checks, found.criteria.asked) == ("not judged", (), ())
    assert lines[0].endswith("not judged, since no criterion is stated")
    assert "  life: not asked; state load_rating and life" in lines
    page, values = design_report(answer), answer.as_dict()
    assert "<h1>Not judged</h1>" in page
    assert "Life: not asked; state load_rating and life." in page
    told = "\n".join(lines)
    assert not re.search(r"\bnan\b|\bNone\b|without end", told + re.sub('data:[^"]*', "", page))
    assert not re.search(r"[0-9] h\b|NOT met| met$", told)
    assert values["life_hours"] == [None, None]
    assert values["evaluation"]["life"] is values["evaluation"]["reliability"] is None
    assert values["evaluation"]["force"] > 0.0
    assert {value for name, value in values["criteria"].items() if name in ("load_rating", "life", "strength")} == {
        None
    }
    assert values["improvement"]["best"] is None
    assert len(values["improvement"]["suggestions"]) == 1


@pytest.mark.parametrize(
    ("stated", "check"),
    [
        ({"load_rating": 500.0, "life": 1000.0}, "fatigue life"),
        ({"load_rating": 500.0, "hours": 1000.0}, "fatigue life"),
        ({"reliability": 0.99, **STEEL}, "reliability"),
        ({"safety_factor": 1.2, **{name: STEEL[name] for name in STEEL if "deviation" not in name}}, "safety factor"),
    ],
)
def test_one_criterion_is_judged_alone(stated, check):
    """A life, a reliability or a safety factor: the verdict rests on that, and the others are not asked."""
    found = assess(CALM, {}, Criteria(**stated))
    assert [one.name for one in found.checks] == [check]
    assert found.verdict == "meets"
    assert found.judged == f"meets, judged by {check} (given)"
    assert len(found.not_judged) == 2
    assert check.split()[-1] not in " ".join(line.partition(":")[0] for line in found.not_judged)


def test_a_half_stated_criterion_says_what_is_missing():
    """A load rating gives a life that nothing is held against; a life alone gives the rating that it needs."""
    rated = assess(CALM, {}, Criteria(load_rating=500.0))
    assert (rated.verdict, rated.judged) == ("not judged", "not judged, since no criterion is complete")
    assert rated.not_judged[0] == "life: not judged; load_rating (given) is stated; state life too"
    assert rated.evaluation.life > 0.0
    lasting = assess(CALM, {}, Criteria(life=1000.0))
    assert lasting.not_judged[0] == "life: not judged; life (given) is stated; state load_rating too"
    again = assess(CALM, {}, Criteria(life=1000.0, load_rating=lasting.evaluation.required_load_rating))
    assert again.evaluation.life == pytest.approx(1000.0)
    weak = Criteria(strength=1.6e9)
    assert "state reliability, strength_deviation, contact_radius and contact_modulus too" in weak.not_judged[1]
    share = Criteria(machines_that_meet=0.9)
    assert share.not_judged[-1].endswith("machines_that_meet (given) needs a life or a reliability")


def test_a_criterion_names_its_line(tmp_path):
    """File and line of the brief in the verdict, the table and the JSON, however the section is written."""
    path = tmp_path / "brief.toml"
    head = 'machine = "impact-beam"\n[tolerances]\n[changes]\n'
    for text, life in (
        (f'{head}[criteria]\n# life = "5 h"\nload_rating = "500 N"\nlife = "1 h"  # short\n', 7),
        (f'criteria.load_rating = "500 N"\ncriteria.life = "1 h"\n{head}', 2),
        (f'criteria = {{load_rating = "500 N", life = "1 h"}}\n{head}', 1),
    ):
        path.write_text(text)
        stated = read_brief(path).criteria.stated
        assert stated["life"] == stated["hours"] == f"{path}:{life}"
        assert set(stated) == {"load_rating", "life", "hours"}
    path.write_text(f'{head}[criteria]\nload_rating = """\n500 N"""\nlife = "1 h"\n')
    assert read_brief(path).criteria.stated["load_rating"] == str(path), "over several lines: the file alone"
    path.write_text(
        f'{head}[parameters]\nexcitation_frequency = "10 Hz"\n[criteria]\nload_rating = "500 N"\nlife = "1 h"\n'
    )
    with small_studies():
        answer = study(read_brief(path))
    assert answer.lines()[0] == f"impact-beam: meets, judged by fatigue life ({path}:8)"
    assert f"<td>{path}:8</td>" in design_report(answer)
    assert answer.as_dict()["checks"][0]["stated"] == f"{path}:8"
    assert answer.as_dict()["stated_by"]["load_rating"] == f"{path}:7"
    assert "NOT ASKED" not in comparison_report({"brief": answer})


def test_changes_are_compared_where_nothing_is_judged():
    """By type, then by life beside the present one: half the force is 2^(10/3) lives; none is called sufficient."""
    p = 10.0 / 3.0
    present = assess(CALM, {"clearance": Tolerance(0.05)}, series_size=4)
    found = improve(present, {"clearance": [0.06e-3], "excitation_frequency": [9.0]}, series_size=4)
    assert found.best is None
    assert found.screened == 0
    assert [one.relative_life for one in found.suggestions] == sorted(
        (one.relative_life for one in found.suggestions), reverse=True
    )
    slower = next(one for one in found.suggestions if "excitation_frequency" in one.changes)
    runs = [(one.nominal, *one.series.runs) for one in (present, slower.assessment)]
    forces = [np.mean([np.mean(run.worse_side() ** p) for run in built]) ** (1.0 / p) for built in runs]
    assert slower.relative_life == pytest.approx((forces[0] / forces[1]) ** p * 10.0 / 9.0)
    assert "compared by type and force, since nothing is judged" in found.told


def test_a_recording_needs_no_load_rating():
    """Nature and forces without a life; with one, the life and who stated the rating."""
    peaks = [40.0 + k % 3 for k in range(90)]
    found = evaluate_peaks(peaks, Criteria())
    assert "life              not asked; state load_rating" in found.lines()
    assert found.as_dict()["evaluation"]["life"] is None
    assert peaks_figure(found).get_suptitle() == f"Equivalent force {found.evaluation.force:.1f} N"
    rated = evaluate_peaks(peaks, Criteria(load_rating=500.0, stated={"load_rating": "--load-rating"}))
    assert "by a load rating of 500 N (--load-rating)" in "\n".join(rated.lines())
