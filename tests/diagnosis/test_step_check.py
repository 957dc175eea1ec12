"""A verdict belongs to the machine only if a finer step keeps it."""

from dataclasses import replace

import pytest

from chaosgym import Drive, ModalMachine, Structure, diagnose
from chaosgym.diagnosis import step_check as module
from chaosgym.diagnosis.step_check import StepCheck, agree, step_check
from chaosgym.simulation import RungeKutta4
from tests.plain_modes import PLAIN_BEAM

WITH_FITTED = replace(PLAIN_BEAM, n_modes=4, fitted_modes=2, excitation_frequency=19.0)


@pytest.mark.parametrize(("frequency", "nature"), [(18.0, "periodic"), (19.0, "periodic"), (30.0, "chaotic")])
def test_exact_propagation_keeps_its_verdict(frequency, nature):
    """Half the step and a tenth of the event tolerance change neither nature nor period nor spread."""
    check = step_check(replace(PLAIN_BEAM, excitation_frequency=frequency))
    assert check.given.nature == check.finer.nature == nature
    assert check.nature_stays
    assert check.period_stays
    assert check.spread_stays
    assert check.settled
    assert "keeps" in check.summary


def test_two_coarse_steps_that_are_wrong_alike_confirm_nothing():
    """The beam with fitted modes has period 1 at 19 Hz; 2000 and 4000 steps both call it chaotic, and are found out."""
    exact = diagnose(WITH_FITTED)
    assert (exact.status, exact.period) == ("certified", 1)
    check = step_check(WITH_FITTED, budget=400, integrator=RungeKutta4(2000))
    assert check.given.nature == "chaotic"
    assert not check.nature_stays
    assert check.as_dict()["finer_nature"] == check.finer.nature
    assert (check.finer.nature, check.finer.period, check.finer.status) == ("periodic", 1, "certified")
    assert check.settled
    assert "CHANGES" in check.summary


def test_steps_that_never_agree_leave_the_verdict_undetermined(monkeypatch):
    """Refined once, from 2000 to 4000 steps, the two verdicts contradict each other and neither is confirmed."""
    monkeypatch.setattr(module, "REFINEMENTS", 1)
    check = step_check(WITH_FITTED, budget=400, integrator=RungeKutta4(2000))
    assert check.given.nature == check.finer.nature == "chaotic"
    assert not check.settled
    assert check.summary.startswith("undetermined")


@pytest.mark.parametrize(("stiffness", "damping"), [(1e5, 10.0), (1e5, 12.0), (1e6, 15.0)])
def test_a_finer_step_does_not_contradict_a_proof(stiffness, damping):
    """A ball in a shaken box comes to one proven orbit by either step, soon or, as a last digit wants, after chaos."""
    ball = ModalMachine(
        modes=Structure.of_modes([0.0], [[0.05]], {"ball": [1.0], "base": [1.0]}),
        joint="ball",
        drives=(Drive.sine("displacement", "base", 30e-3),),
        speed=2.0,
        clearance=22e-3,
        contact_stiffness=stiffness,
        contact_damping=damping,
    )
    check = step_check(ball)
    for one in (check.given, check.finer):
        assert (one.period, one.evidence["orbit"]["certified"]) == (1, True)
    assert check.settled
    assert check.nature_stays
    assert check.period_stays
    assert check.spread_stays
    late = replace(check.given, transient_chaos=1, settle_cycle=1)
    told = StepCheck(check.given, late, settled=True)
    assert agree(told.given, late)
    assert "keeps the verdict (periodic with period 1)" in told.summary
    assert f"it settles after {check.given.settle_cycle} cycles, finer 1:" in told.summary
