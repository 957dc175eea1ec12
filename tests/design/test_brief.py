"""Design briefs: what is written is what is assessed, and every mistake is named with its cure."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from chaosgym.design import Criteria
from chaosgym.design.brief import brief_from, read_brief, template
from chaosgym.design.measured import evaluate_peaks
from chaosgym.diagnosis import Tolerance, default_tolerances
from chaosgym.errors import DesignError, ParameterError
from chaosgym.machines import MACHINES, ImpactBeam
from chaosgym.units import parse_quantity

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"

CRITERIA = '[criteria]\nload_rating = "500 N"\nlife = "10 Mcycles"\nreliability = 0.99\n'


def brief(text):
    """Brief of an impact beam with the usual criteria and some more lines."""
    return brief_from(tomllib.loads('machine = "impact-beam"\n' + text + "\n" + CRITERIA))


@pytest.mark.parametrize("name", sorted(MACHINES))
def test_template_of_every_machine_describes_the_machine_of_the_thesis(name, tmp_path):
    """As printed, it asks for the default machine and its usual tolerances, and states no criterion."""
    path = tmp_path / "brief.toml"
    path.write_text(template(name))
    found = read_brief(path)
    assert with_model(found.machine, MACHINES[name]()) == MACHINES[name]()
    assert found.accuracy.error <= found.accuracy.tolerance == 0.01 or "no model within 1 %" in found.accuracy.warning
    assert found.region.keys() == default_tolerances(found.machine).keys()
    for field, tolerance in default_tolerances(found.machine).items():
        assert found.region[field].value == pytest.approx(tolerance.value)
    assert found.criteria == Criteria()
    assert found.criteria.asked == ()
    assert found.costs == {found.machine.speed_field: 2.0}


def test_a_change_may_be_one_value_or_several():
    """A value alone is a list of one."""
    one, more = (brief(f"[changes]\nclearance = {text}").changes for text in ('"2 mm"', '["2 mm", "3 mm"]'))
    assert one == {"clearance": (pytest.approx(2e-3),)}
    assert more == {"clearance": (pytest.approx(2e-3), pytest.approx(3e-3))}


@pytest.mark.parametrize("name", sorted(MACHINES))
def test_the_changes_of_a_template_may_be_emptied(name):
    """As docs/design.md advises for a first look: the weights of what is not searched stay where they are."""
    values = {**tomllib.loads(template(name)), "changes": {}}
    found = brief_from(values)
    assert (found.changes, found.costs) == ({}, {})


def test_units_do_not_matter():
    """0.127 mm and 30 Hz are 0.005 in and 1800 rpm; half a kilonewton is 500 N."""
    metric = brief('[parameters]\nclearance = "0.127 mm"\nexcitation_frequency = "30 Hz"')
    other = brief_from(
        tomllib.loads(
            'machine = "impact-beam"\n[parameters]\nclearance = "0.005 in"\nexcitation_frequency = "1800 rpm"\n'
            '[criteria]\nload_rating = "0.5 kN"\nlife = "10000000 cycles"\nreliability = "99 %"'
        )
    )
    assert other.machine.clearance == pytest.approx(metric.machine.clearance, rel=1e-12)
    assert other.machine.excitation_frequency == pytest.approx(metric.machine.excitation_frequency, rel=1e-12)
    for field in ("load_rating", "life", "reliability"):
        assert getattr(other.criteria, field) == pytest.approx(getattr(metric.criteria, field), rel=1e-12)


def test_tolerances_are_shares_or_amounts():
    """A percentage is relative to nominal, anything else is an amount; two tolerances double it."""
    found = brief('[tolerances]\nclearance = "5 %"\nexcitation_frequency = "0.5 Hz"\n[region]\ntolerances = 2')
    assert found.region["clearance"].value == pytest.approx(1.05**2 - 1.0)
    assert found.region["excitation_frequency"] == Tolerance(1.0, relative=False)


def test_quantities_are_read_with_and_without_a_space():
    """2 %, 2% and 0.02 are one value; a compound unit is written as the field states it."""
    assert {parse_quantity("x", given, "-") for given in ("2 %", "2%", 0.02)} == {0.02}
    assert parse_quantity("x", "22.5 N s/m", "N s/m") == 22.5
    assert parse_quantity("x", "1e-3 m", "m") == 1e-3


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[parameters]\nclearence = '1 mm'", "'clearence'; did you mean clearance?"),
        ("[parametres]", "'parametres'; did you mean parameters?"),
        ("[parameters]\nclearance = 0.1", "has no unit; write parameters.clearance"),
        ("[parameters]\nclearance = '0.1'", "has no unit"),
        ("[parameters]\nclearance = '0.1 MM'", "unknown unit 'MM'; did you mean mm? (allowed: m, mm"),
        ("[parameters]\nclearance = '0.1 mn'", "unknown unit 'mn' (allowed: m, mm, um, in, mil, thou)"),
        ("[parameters]\nclearance = 'wide'", "does not begin with a number"),
        ("[parameters]\nclearance = '-1 mm'", "clearance = -0.001 m is out of range"),
        ("[parameters]\nclearance = [1, 2]", "is not a quantity"),
        ("[tolerances]\nclearance = '-5 %'", "allowed: above 0"),
        ("[region]\ntolerances = 3", "region = 3"),
        ("[region]\nwear = 'yes'", "allowed: true or false"),
        ("[changes]\nclearance = ['2 m']", "clearance = 2 m is out of range"),
        ("[costs]\nlength = 1", "'length'"),
        ("[costs]\nclearance = -1", "costs.clearance = -1"),
        ("series = 2", "series = 2"),
        ("tolerances = 2", "is not a table"),
    ],
)
def test_mistakes_are_named_with_their_cure(text, message):
    """Unknown keys with a suggestion, missing units with the line to write, values with their range."""
    with pytest.raises((DesignError, ParameterError)) as error:
        brief(text)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("machine = 'impact-bean'", "did you mean impact-beam?"),
        ("machine = 'impact-beam'\n" + CRITERIA.replace("500 N", "-500 N"), "load_rating = -500 N is out of range"),
        ("machine = 'impact-beam'\n" + CRITERIA.replace("0.99", "1.5"), "reliability = 1.5 is out of range"),
        ("machine = ", "is not valid TOML"),
    ],
)
def test_unusable_files_are_refused(text, message, tmp_path):
    """One line that says what is wrong."""
    path = tmp_path / "brief.toml"
    path.write_text(text)
    with pytest.raises((DesignError, ParameterError)) as error:
        read_brief(path)
    assert message in str(error.value)


def test_measured_peaks_give_what_simulated_ones_would():
    """Three forces in turn are three modes, and the equivalent force lies between them."""
    found = evaluate_peaks([40.0 + k % 3 for k in range(90)], Criteria(load_rating=500.0))
    assert found.histogram.modes == pytest.approx([40.0, 41.0, 42.0], rel=1e-5)
    assert 40.0 < found.evaluation.force < 42.0
    assert found.headline.startswith("periodic, period 3")


@pytest.mark.parametrize(
    ("peaks", "message"),
    [([40.0, -3.0] * 20, "-3 N in cycle 2"), ([0.0] * 40, "no contact"), ([30.0, 70.0, 45.0], "too few")],
)
def test_damaged_measurements_are_refused(peaks, message):
    """The cycle is named, or what is missing."""
    with pytest.raises(DesignError, match=message):
        evaluate_peaks(peaks, Criteria())


def test_too_few_cycles_are_marked_as_an_estimate():
    """Statistics that more cycles would change are an estimate, and say so."""
    found = evaluate_peaks(np.random.default_rng(0).gamma(20.0, 2.5, 120), Criteria())
    assert found.doubt.startswith("estimate: 120 cycles recorded")
    assert found.doubt in found.lines()


def with_model(machine, other):
    """The machine by the model of another."""
    return replace(machine, **{name: getattr(other, name) for name in machine.model_fields})


def test_default_machine_of_a_brief_is_the_one_of_the_thesis():
    """Fields left out keep the value of the thesis, but those that make its model as accurate as is asked."""
    assert with_model(brief("").machine, ImpactBeam()) == ImpactBeam()
    assert brief("").accuracy.error <= 0.01
    assert brief('fidelity = "standard"').machine == ImpactBeam()
    assert brief("[parameters]\nn_modes = 5").machine == ImpactBeam(n_modes=5)


def test_the_model_of_a_brief_serves_all_that_it_may_become():
    """One model for the nominal machine and its farthest changes: the worst of them decides."""
    soft = brief('[changes]\ncontact_stiffness = ["3 N/um"]\n[parameters]\nexcitation_frequency = "10 Hz"')
    stiff = brief('[changes]\ncontact_stiffness = ["240 N/um"]\n[parameters]\nexcitation_frequency = "10 Hz"')
    assert stiff.machine.n_modes > soft.machine.n_modes
    assert stiff.accuracy.points == soft.accuracy.points > 1
    rung = brief('fidelity = "standard"\n[changes]\ncontact_stiffness = ["240 N/um"]')
    assert "the rung standard is documented to be within" in rung.accuracy.warning
    with pytest.raises(ParameterError, match="fidelity = '1 %' chooses n_modes, and n_modes = 5"):
        brief('fidelity = "1 %"\n[parameters]\nn_modes = 5')
    with pytest.raises(ParameterError, match="fidelity = 'fast' is not one of standard, fine, reference"):
        brief('fidelity = "fast"')


@pytest.mark.parametrize(
    ("life", "hours"),
    [("10 years", 29220.0), ("3652.5 days", 29220.0), ("29220 h", 29220.0), ("3155.76 Mcycles", None)],
)
def test_a_life_in_time_is_that_many_cycles_of_the_machine(life, hours):
    """Ten years of eight hours a day at 30 Hz: 10 * 365.25 * 8 * 3600 * 30 cycles; at 15 Hz half as many."""
    text = f'machine = "impact-beam"\n[duty]\nhours_a_day = "8 h"\n{CRITERIA.replace("10 Mcycles", life)}'
    found = brief_from(tomllib.loads(text)).criteria
    assert found.life == pytest.approx(10 * 365.25 * 8 * 3600 * 30 * 1e-6)
    assert found.hours == (None if hours is None else pytest.approx(hours))
    assert found.at(1.0 / 15.0).life == pytest.approx(found.life / (2.0 if hours else 1.0))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('[duty]\nhours_a_day = "25 h"', "at most 24 h"),
        ("[duty]\nhours_a_day = 8", 'write duty.hours_a_day = "8 h"'),
        ('load_rating = "3 N"', r"the brief has no key 'load_rating'; it belongs in \[criteria\]"),
        ('clearance = "1 mm"', r"the brief has no key 'clearance'; it belongs in \[parameters\]"),
        ('[region]\nhours_a_day = "8 h"', r"it belongs in \[duty\]"),
        ('[tolerances]\nlife = "1 h"', r"\[tolerances\] has no key 'life'; it belongs in \[criteria\]"),
        ("joint = 3", "the file of the machine, which the brief names"),
    ],
)
def test_a_key_in_the_wrong_place_is_told_where_it_belongs(text, message):
    """One line with the section, or the file."""
    with pytest.raises((DesignError, ParameterError), match=message) as error:
        brief(text)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("life", ["0 h", "-3 years", "10 fortnights", "ten years", "1e12 years"])
def test_a_life_that_is_none_is_refused(life):
    """The criterion and what is allowed are named."""
    with pytest.raises((DesignError, ParameterError), match=r"life|hours"):
        brief_from(tomllib.loads('machine = "impact-beam"\n' + CRITERIA.replace("10 Mcycles", life)))


def test_a_file_of_a_machine_is_a_brief_of_its_template(tmp_path):
    """The machine and its tolerances; neither states a criterion."""
    path = "docs/machines/kahraman-singh-1990.toml"
    brief_file = tmp_path / "brief.toml"
    brief_file.write_text(template(path))
    found, by_template = read_brief(path), read_brief(brief_file)
    assert found.criteria.asked == by_template.criteria.asked == ()
    assert (found.region, found.criteria, found.changes) == (
        by_template.region,
        by_template.criteria,
        by_template.changes,
    )


@pytest.mark.parametrize("brief", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_briefs_of_the_documentation_are_read(brief):
    """Those with parts of a duty too, whose keys are speeds and no fields of the machine."""
    stated = tomllib.loads(brief.read_text()).get("duty", {}).get("speeds", {})
    assert len(read_brief(brief).duty) == len(stated)
