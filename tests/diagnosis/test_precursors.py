import json
from dataclasses import replace

import pytest

from chaosgym.diagnosis import bounce_fraction, diagnose, precursors, predictive_criteria, signs_of_chaos
from chaosgym.diagnosis.precursors import measured_rates
from chaosgym.diagnosis.verdict import of_machine
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam
from chaosgym.series import two_step_test
from chaosgym.simulation import simulate


@pytest.mark.parametrize(
    ("period", "doubling", "three"),
    [
        (1, False, False),
        (2, True, False),
        (3, False, True),
        (4, True, False),
        (5, False, False),
        (6, False, True),
        (8, True, False),
        (9, False, False),
        (None, False, False),
    ],
)
def test_precursors_of_a_period(period, doubling, three):
    """Powers of two announce a cascade, multiples of three by a power of two a subharmonic of order three."""
    signs = precursors(period)
    assert (signs.period_doubling, signs.period_three, signs.long_bouncing) == (doubling, three, False)


def test_long_bouncing_announces_chaos_on_the_beam():
    """A quarter of the half cycle at 16 Hz, +-0.032 mm (a seventh at 18 Hz in 5.6); three quarters at 30 Hz."""
    calm = bounce_fraction(simulate(ImpactBeam(excitation_frequency=16.0, clearance=0.032e-3), 50, transient=200))
    wild = bounce_fraction(simulate(ImpactBeam(), 50, transient=200))
    assert calm == pytest.approx(0.24, abs=0.02)
    assert wild > 0.6
    assert precursors(1, wild).any
    assert not precursors(1, calm).any


def test_predictive_criteria_of_the_beam():
    """Chaos needs 0.02 of the static deflection and 16 Hz at 1 % damping, and is gone at 0.04 and 8 % (5.3.1)."""
    assert predictive_criteria(ImpactBeam()).chaos_possible
    assert not predictive_criteria(ImpactBeam(excitation_frequency=15.0)).chaos_possible
    assert not predictive_criteria(ImpactBeam(clearance=0.06e-3)).chaos_possible
    assert not predictive_criteria(ImpactBeam(damping_ratio=0.081)).chaos_possible
    assert "clearance" in predictive_criteria(ImpactBeam(clearance=0.06e-3)).reason


def test_signs_of_a_periodic_response_say_how_often_they_are_right():
    """Silent criteria and precursors tell their recall in one line, present ones their precision (5.3)."""
    signs = signs_of_chaos(diagnose(ImpactBeam(excitation_frequency=12.0)))
    assert [(sign.name, sign.present) for sign in signs] == [
        ("criteria", False),
        ("period doubling", False),
        ("period three", False),
        ("long bouncing", False),
    ]
    assert all(sign.line.count("\n") == 0 and sign.line.endswith(" had this sign") for sign in signs)
    assert replace(signs[1], present=True, why="period 2").line.endswith(
        "79% of the dataset's points with this sign had chaos within the tolerances of speed and clearance"
    )
    assert replace(signs[1], rate=None).line == "sign of chaos, period doubling: no, period 1"
    assert json.loads(json.dumps(signs[0].as_dict()))["rate"]["points"] > 10_000


def test_signs_of_a_chaotic_response_are_the_criteria_alone():
    """A precursor comes before chaos, so only the printed criteria speak of a response that is chaotic."""
    verdict = diagnose(ImpactBeam(), budget=400)
    assert verdict.nature == "chaotic"
    assert [(sign.name, sign.present) for sign in signs_of_chaos(verdict)] == [("criteria", True)]
    with pytest.raises(DiagnosisError, match="plain series"):
        signs_of_chaos(of_machine(two_step_test([1.0, 2.0] * 20)))


def test_subharmonics_announce_chaos_more_surely_than_bouncing():
    """On the shipped datasets of both machines, periods of order three and doublings are right three times in four."""
    for rates in measured_rates().values():
        assert min(rates["period three"].precision, rates["period doubling"].precision) > 0.75
        assert rates["long bouncing"].precision < 0.5
        assert rates["long bouncing"].recall > rates["period three"].recall
