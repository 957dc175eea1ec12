"""Wear by Archard's law: a published bushing, a gap that grows as the law says, and what a brief may ask."""

import math
import tomllib
from dataclasses import replace

import numpy as np
import pytest

from chaosgym.design import Criteria
from chaosgym.design.brief import brief_from
from chaosgym.design.methodology import assess
from chaosgym.design.wear import Wear, wear_depth, wear_life, wear_over
from chaosgym.diagnosis import Tolerance
from chaosgym.errors import DesignError, ParameterError
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import simulate

CALM = ImpactBeam(excitation_frequency=8.0)
LAW = Wear(limit=0.2e-3, sliding=2e-3, area=2e-5, hardness=2e9, coefficient=1e-5)
BRIEF = (
    'machine = "impact-beam"\n[criteria]\nload_rating = "500 N"\nlife = "10 years"\nreliability = 0.99\n[archard]\n{}\n'
)


def test_depth_of_a_published_bushing():
    """Shigley's Mechanical Engineering Design, 12-15: Oiles SP 500 bushing of 1 in by 1 in, 700 lbf, 33 ft/min.

    w = f1 f2 K P V t with K = 0.6e-10 in^3 min / (lbf ft h), f1 = 1.3, P = 4 F / (pi D L): 0.005 in after 2180 h. In
    Archard's terms the load is F over the area pi D L / 4, and 1.3 K is the coefficient over the hardness.
    """
    hours, feet = 2180.0, 33.0 * 60.0 * 2180.0
    coefficient = 1.3 * 0.6e-10 / 60.0  # in^3 / (lbf ft): one ft/min for one hour is 60 ft
    depth = wear_depth(700.0, feet, math.pi / 4.0, 1.0, coefficient)
    assert depth == pytest.approx(0.005, rel=1e-3), hours


def test_a_gap_grows_by_half_of_what_both_surfaces_lose():
    """Over one small step the rate is constant: K F s / (2 H A) a cycle, with F from a run of its own."""
    small = Wear(limit=CALM.clearance * 1.001, sliding=2e-3, area=2e-5, hardness=2e9, coefficient=1e-5)
    record = simulate(CALM, 1, transient=400, samples_per_cycle=5000)
    force = np.mean(np.abs(record.surface_force[..., 0]))
    a_cycle = 1e-5 * force * 2e-3 / (2e9 * 2e-5) / 2.0
    expected = 0.001 * CALM.clearance / a_cycle * CALM.cycle_period / 3600.0
    assert wear_life(CALM, small).hours == pytest.approx(expected, rel=0.01)


def test_twice_the_coefficient_halves_the_time():
    """Time is inverse to the coefficient and the sliding; hours ascend with the clearance."""
    one, other = (wear_life(CALM, Wear(**{**vars(LAW), "coefficient": k})) for k in (1e-5, 2e-5))
    assert one.hours == pytest.approx(2.0 * other.hours)
    hours = [point.hours for point in one.course]
    assert hours[0] == 0.0
    assert hours == sorted(hours)
    assert one.course[-1].clearance == pytest.approx(LAW.limit)
    assert f"limit of {1e3 * LAW.limit:g} mm" in one.told[0]
    changed = one.change
    assert (changed is None) == (len(one.told) == 1)


def test_a_gap_that_never_closes_never_wears():
    """Without contact the time has no end, in lines and in JSON."""
    found = wear_life(ImpactBeam(excitation_frequency=8.0, force_amplitude=0.01), LAW)
    assert math.isinf(found.hours)
    assert "never" in found.told[0]
    assert found.as_dict()["course"][-1]["hours"] is None


def test_half_of_the_time_without_contact_doubles_the_hours():
    """Over two speeds the rates of wear add up by their shares of the time."""
    still = wear_life(ImpactBeam(excitation_frequency=8.0, force_amplitude=0.01), LAW)
    own = wear_life(CALM, LAW)
    half = wear_over([own, still], [0.5, 0.5])
    assert [one.hours for one in half.course] == pytest.approx([2.0 * one.hours for one in own.course])
    assert [one.nature for one in half.course] == [one.nature for one in own.course]
    assert wear_over([own, own], [0.3, 0.7]).hours == pytest.approx(own.hours)
    assert math.isinf(wear_over([still, still], [0.5, 0.5]).hours)


def test_a_joint_that_wears_out_too_early_fails():
    """The limit of the clearance is a criterion: what is known to a factor of three must last three times as long."""
    criteria = Criteria(load_rating=5000.0, hours=wear_life(CALM, LAW).hours / 2.9)
    region = {"clearance": Tolerance(0.05)}
    plain, worn = (assess(CALM, region, criteria, series_size=8, wear=one) for one in (None, LAW))
    assert plain.verdict == "meets"
    assert worn.verdict == "fails"
    assert [check.name for check in worn.checks if not check.met] == ["wear life"]
    longer = replace(LAW, uncertainty=2.8)
    assert assess(CALM, region, criteria, series_size=8, wear=longer).verdict == "meets"


def test_a_brief_states_what_wears():
    """Limit, sliding and area are needed, the rest has defaults that are called assumed."""
    text = BRIEF.format('limit = "0.3 mm"\nsliding = "2 mm"\narea = "20 mm^2"\nhardness = "3 GPa"')
    wear = brief_from(tomllib.loads(text)).wear
    assert wear is not None
    assert (wear.limit, wear.sliding, wear.area, wear.hardness) == pytest.approx((3e-4, 2e-3, 2e-5, 3e9))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('limit = "0.3 mm"', "lacks sliding"),
        ('limit = "0.3 mm"\nsliding = "0 mm"\narea = "1 mm^2"', "sliding = 0 is out of range"),
        ('limit = "0.3 mm"\nsliding = "1 mm"\narea = "1 mm"', "unknown unit"),
        ('limit = "0.3 mm"\nsliding = "1 mm"\narea = "1 mm^2"\nuncertainty = 0.5', "uncertainty = 0.5"),
        ('limit = "0.3 mm"\nsliding = "1 mm"\narea = "1 mm^2"\nhardnes = "1 GPa"', "did you mean hardness"),
        ('limit = "0.01 mm"\nsliding = "1 mm"\narea = "1 mm^2"', "above the clearance"),
        ('limit = "3 m"\nsliding = "1 mm"\narea = "1 mm^2"', "limit = 3 m is out of range"),
    ],
)
def test_wear_without_its_data_is_refused(text, message):
    """One line that names what is missing or wrong."""
    with pytest.raises((DesignError, ParameterError), match=message) as error:
        brief_from(tomllib.loads(BRIEF.format(text)))
    assert "\n" not in str(error.value)


def test_a_limit_within_the_gap_is_refused():
    """A joint can't be worn out from the start."""
    with pytest.raises(DesignError, match="the clearance"):
        wear_life(CALM, Wear(limit=1e-4))
