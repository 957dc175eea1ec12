import numpy as np
import pytest

from chaosgym.diagnosis import compare_attractors, compare_outcomes, diagnose, matrix_update_test
from chaosgym.diagnosis.matrix_update import neighbouring_interval
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam, SliderCrank
from tests.series.maps import logistic


def test_one_periodic_motion_seen_twice_is_periodic_in_both_forms():
    """Two runs of a settled period 3 with slightly different parameters agree within 1 %."""
    runs = logistic(3.832, 100), logistic(3.8321, 100)
    assert compare_outcomes(*runs).nature == "periodic"
    verdict = compare_attractors(*runs)
    assert (verdict.nature, verdict.period) == ("periodic", 3)


def test_a_phase_shift_fools_the_literal_form_only():
    """The same period 2 one cycle late differs at each observation; as an attractor it is the same."""
    run = logistic(3.3, 101)
    assert compare_outcomes(run[:100], run[1:]).nature == "chaotic"
    verdict = compare_attractors(run[:100], run[1:])
    assert (verdict.nature, verdict.period) == ("periodic", 2)
    assert verdict.evidence["shift"] % 2 == 1


def test_coexisting_motions_fool_the_literal_form_only():
    """Two different periodic motions are two attractors, not chaos."""
    runs = np.tile([50.0, 60.0], 50), np.tile([30.0, 35.0], 50)
    assert compare_outcomes(*runs).nature == "chaotic"
    assert compare_attractors(*runs).nature == "periodic"


def test_chaos_is_chaotic_in_both_forms():
    """Two runs of the logistic map at r = 3.9 that start a billionth apart."""
    runs = logistic(3.9, 100), logistic(3.9, 100, start=0.3 + 1e-9)
    assert compare_outcomes(*runs).nature == "chaotic"
    assert compare_attractors(*runs).nature == "chaotic"


def test_one_run_that_repeats_and_one_that_does_not_decide_nothing():
    """Between chaos and period 3 the test abstains."""
    assert compare_attractors(logistic(3.9, 100), logistic(3.832, 100)).nature == "undetermined"


def test_constant_matrices_are_refused():
    """The beam's matrices do not depend on its configuration (thesis 5.2.3)."""
    with pytest.raises(DiagnosisError, match="constant matrices"):
        matrix_update_test(ImpactBeam())
    with pytest.raises(DiagnosisError, match="shapes"):
        compare_outcomes(np.ones(20), np.ones(21))


def test_case_one_of_the_thesis_is_periodic():
    """270 rpm, +-0.032 mm, matrices updated every 5 and every 10 deg: the two runs converge (figure 5.1)."""
    crank = SliderCrank(crank_speed=270.0, slider_clearance=0.032e-3)
    for form in ("attractors", "literal"):
        assert matrix_update_test(crank, intervals=(5.0, 10.0), form=form, transient=10, cycles=50).nature == "periodic"


def test_case_two_of_the_thesis_is_chaotic():
    """190 rpm, +-0.254 mm, matrices updated every 5 and every 6 deg: the two runs part (figure 5.2)."""
    crank = SliderCrank(crank_speed=190.0, slider_clearance=0.254e-3)
    for form in ("attractors", "literal"):
        assert matrix_update_test(crank, intervals=(5.0, 6.0), form=form, transient=50, cycles=62).nature == "chaotic"


@pytest.mark.parametrize("intervals", [(5.0, 10.0), (5.0, 6.0), (1.0, neighbouring_interval(1.0))])
def test_periodic_outcomes_agree_whatever_the_interval(intervals):
    """At 200 rpm and +-0.032 mm two runs from rest agree within 1 % in every cycle, so even the literal test holds."""
    crank = SliderCrank(crank_speed=200.0, slider_clearance=0.032e-3)
    for form in ("literal", "attractors"):
        verdict = matrix_update_test(crank, intervals=intervals, form=form, transient=50, cycles=60)
        assert verdict.nature == "periodic", (form, verdict.reason)


@pytest.mark.parametrize(
    ("speed", "clearance", "nature"), [(190.0, 0.254e-3, "chaotic"), (270.0, 0.032e-3, "periodic")]
)
def test_the_matrix_update_test_votes_on_the_crank(speed, clearance, nature):
    """Diagnosis follows the flow chart of figure 5.5 where no orbit is proven: a proof needs no further vote."""
    verdict = diagnose(SliderCrank(crank_speed=speed, slider_clearance=clearance), budget=200)
    assert verdict.nature == verdict.votes["lyapunov"] == nature
    assert verdict.votes.get("matrix_update") == (None if nature == "periodic" else nature)
    assert verdict.status == ("certified" if nature == "periodic" else "agreed")
