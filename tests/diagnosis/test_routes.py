import numpy as np
import pytest

from chaosgym.diagnosis import (
    bounce_fraction,
    criterion_rate,
    find_crises,
    find_intermittency,
    precursors,
    predictive_criteria,
    two_step_test,
    warning_rates,
)
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import simulate

from .maps import logistic


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
    """One seventh of the half cycle at 18 Hz and +-0.032 mm, to the end at 30 Hz and +-0.127 mm (figure 5.6)."""
    calm = bounce_fraction(simulate(ImpactBeam(excitation_frequency=18.0, clearance=0.032e-3), 50, transient=200))
    wild = bounce_fraction(simulate(ImpactBeam(), 50, transient=200))
    assert calm == pytest.approx(1.0 / 7.0, abs=0.02)
    assert wild > 0.75
    assert precursors(1, wild).any
    assert not precursors(1, calm).any


def test_warning_rates_on_the_logistic_map():
    """Along r, period doubling and period three warn of chaos better than the base rate."""
    natures, periods = [], []
    for r in np.linspace(3.4, 3.9, 101):
        verdict = two_step_test(logistic(r, 300))
        natures.append(verdict.nature)
        periods.append(verdict.period)
    rates = warning_rates(natures, periods, np.zeros(101), reach=4)
    assert rates["period_three"].hits > rates["period_three"].base_rate
    assert rates["long_bouncing"].warned == 0
    assert rates["any"].warned >= rates["period_doubling"].warned > 0
    with pytest.raises(DiagnosisError, match="equal"):
        warning_rates(natures, periods[1:], np.zeros(101))


def test_intermittency_is_found_below_the_window_of_period_three():
    """Just below r = 1 + sqrt(8) stretches of period 3 alternate with bursts; at r = 4 and in a window they don't."""
    found = find_intermittency(logistic(1.0 + np.sqrt(8.0) - 1e-4, 2000))
    assert found.intermittent
    assert found.period == 3
    assert found.mean_length > 20
    assert not find_intermittency(logistic(4.0, 2000)).intermittent
    assert not find_intermittency(logistic(3.835, 2000)).intermittent


def test_crises_of_the_logistic_map():
    """At r = 3.8568 three bands merge in an interior crisis; chaos that dies out beside chaos is a boundary crisis."""
    rs = np.array([3.8560, 3.8566, 3.8569, 3.8575])
    spreads = [np.ptp(logistic(r, 4000)[::3]) for r in rs]
    assert find_crises(["chaotic"] * 4, spreads) == [(1, "interior")]
    assert find_crises(["chaotic", "chaotic", "periodic"], [5.0, 5.0, 0.1], [False, True, False]) == [(0, "boundary")]
    assert find_crises(["periodic", "chaotic"], [0.0, 5.0]) == []


def test_predictive_criteria_of_the_beam():
    """Chaos needs 0.02 of the static deflection and 16 Hz at 1 % damping, and is gone at 0.04 and 8 % (5.3.1)."""
    assert predictive_criteria(ImpactBeam()).chaos_possible
    assert not predictive_criteria(ImpactBeam(excitation_frequency=15.0)).chaos_possible
    assert not predictive_criteria(ImpactBeam(clearance=0.06e-3)).chaos_possible
    assert not predictive_criteria(ImpactBeam(damping_ratio=0.081)).chaos_possible
    assert "clearance" in predictive_criteria(ImpactBeam(clearance=0.06e-3)).reason


def test_criterion_rate_counts():
    """Two of three chaotic points expected, one false expectation, one quiet point."""
    machines = [
        ImpactBeam(),
        ImpactBeam(),
        ImpactBeam(excitation_frequency=5.0),
        ImpactBeam(),
        ImpactBeam(clearance=1e-5),
    ]
    rate = criterion_rate(machines, ["chaotic", "chaotic", "chaotic", "periodic", "periodic"])
    assert (rate.points, rate.hit_rate, rate.precision, rate.quiet) == (5, 2 / 3, 2 / 3, 0.5)
