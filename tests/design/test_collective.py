"""A load collective of speeds: Miner's sum by hand, and what a brief may say."""

import tomllib

import pytest

from chaosgym.design import Criteria, assess
from chaosgym.design.bearing import hours_of
from chaosgym.design.brief import brief_from, template
from chaosgym.design.collective import assess_duty, damage_shares, miner
from chaosgym.diagnosis import Tolerance
from chaosgym.errors import DesignError, ParameterError
from chaosgym.machines import ImpactBeam

CALM = ImpactBeam(excitation_frequency=8.0)
REGION = {"clearance": Tolerance(0.05)}
STEEL = {"strength": 1.6e9, "strength_deviation": 0.1e9, "contact_radius": 8e-3, "contact_modulus": 1.15e11}
CRITERIA = Criteria(load_rating=300.0, hours=1000.0, reliability=0.99, machines_that_meet=0.9, **STEEL)
BRIEF = 'machine = "impact-beam"\n{}\n[criteria]\nload_rating = "500 N"\nlife = "10 years"\nreliability = 0.99\n'


@pytest.fixture(scope="module")
def driven():
    """A beam at 8 Hz for three quarters of the time, and at 12 Hz for the rest."""
    return assess_duty(CALM, REGION, CRITERIA, {1.0: 0.75, 1.5: 0.25}, series_size=8)


def test_hours_add_up_as_damage_does(driven):
    """1 / H = 0.75 / H_8 + 0.25 / H_12, from the life at each speed alone; cycles come at the mean rate of 9 Hz."""
    alone = [assess(CALM.at(speed), REGION, CRITERIA, series_size=8) for speed in (8.0, 12.0)]
    hours = [hours_of(one.evaluation.life, one.machine.cycle_period) for one in alone]
    expected = 1.0 / (0.75 / hours[0] + 0.25 / hours[1])
    assert driven.cycle_period == pytest.approx(1.0 / 9.0)
    assert hours_of(driven.evaluation.life, driven.cycle_period) == pytest.approx(expected, rel=1e-12)
    assert driven.criteria.life == pytest.approx(1000.0 * 3600.0 * 9.0 * 1e-6)
    assert damage_shares(driven.collective) == pytest.approx([0.75 * expected / hours[0], 0.25 * expected / hours[1]])
    forces = [one.evaluation.force for one in alone]
    assert min(forces) < driven.evaluation.force < max(forces)
    assert (CRITERIA.load_rating / driven.evaluation.force) ** (10.0 / 3.0) == pytest.approx(driven.evaluation.life)
    assert driven.evaluation.largest_force == max(one.evaluation.largest_force for one in alone)
    assert driven.evaluation.reliability == min(one.evaluation.reliability for one in alone)


def test_one_speed_all_the_time_is_no_collective():
    """A share of 100 % at the nominal speed gives the assessment of that speed."""
    one = assess(CALM, REGION, CRITERIA, series_size=8)
    whole = assess_duty(CALM, REGION, CRITERIA, {1.0: 1.0}, series_size=8)
    assert whole.evaluation.life == pytest.approx(one.evaluation.life)
    assert whole.machines_that_meet == one.machines_that_meet
    assert [check.met for check in whole.checks] == [check.met for check in one.checks]


def test_speeds_without_contact_use_up_nothing():
    """Half of the time without damage doubles the life."""
    assert miner([100.0, float("inf")], [0.5, 0.5]) == 200.0
    assert miner([float("inf")], [1.0]) == float("inf")


def test_a_brief_states_shares_of_the_time():
    """The nominal speed is that of [parameters], or the one with the largest share."""
    table = '[duty.speeds]\n"12 Hz" = "25 %"\n"480 rpm" = 0.75'
    found = brief_from(tomllib.loads(BRIEF.format(table)))
    assert found.machine.excitation_frequency == pytest.approx(8.0)
    assert dict(found.duty) == {1.5: 0.25, 1.0: 0.75}
    stated = brief_from(tomllib.loads(BRIEF.format(table + '\n[parameters]\nexcitation_frequency = "12 Hz"')))
    assert stated.machine.excitation_frequency == 12.0
    uncommented = "\n".join(
        line.removeprefix("# ").partition("  #")[0] if "duty.speeds" in line or line.startswith('# "') else line
        for line in template("impact-beam").splitlines()
    )
    assert dict(brief_from(tomllib.loads(uncommented)).duty) == {1.0: 0.6, 0.8: 0.4}


@pytest.mark.parametrize(
    ("table", "message"),
    [
        ('"12 Hz" = "25 %"\n"8 Hz" = "70 %"', "adds up to 95 %"),
        ('"12 Hz" = "25 %"\n"8 Hz" = "-5 %"', "allowed: above 0 %"),
        ('"12 Hz" = "50 %"\n"720 rpm" = "50 %"', "twice"),
        ('"12" = "100 %"', "has no unit"),
        ('"fast" = "100 %"', "does not begin with a number"),
        ('"12 Hz" = "100 %"\n[parameters]\nexcitation_frequency = "8 Hz"', "lacks the nominal"),
        ('"-12 Hz" = "100 %"', "out of range"),
        ('"12 Hz" = "nan %"', "duty.speeds"),
    ],
)
def test_a_duty_that_is_none_is_refused(table, message):
    """One line that says what is allowed."""
    with pytest.raises((DesignError, ParameterError), match=message) as error:
        brief_from(tomllib.loads(BRIEF.format("[duty.speeds]\n" + table)))
    assert "\n" not in str(error.value)


def test_speeds_are_a_table():
    """A list, or a number, is told how to write it."""
    with pytest.raises(DesignError, match=r"write \[duty.speeds\]"):
        brief_from(tomllib.loads(BRIEF.format('[duty]\nspeeds = "8 Hz"')))
