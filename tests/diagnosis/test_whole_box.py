"""Anywhere in the admissible box: a diagnosis and a response type, or an error of this package."""

import json
import math

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from benchmarks.fidelity.stability import runs_of
from chaosgym.diagnosis import diagnose, response_type
from chaosgym.errors import ChaosgymError
from chaosgym.machines import ImpactBeam, SliderCrank
from tests.benchmarks.test_stability import box
from tests.plain_modes import PLAIN_BEAM

BUDGET = 100

LONGEST_REVOLUTION = 20_000
"""Steps of a revolution beyond which a crank is left to the tests of budgets: a diagnosis takes hundreds."""

LONGEST_CYCLE = ("damping ratio 100", "reference")
"""Extreme and rung of a beam whose cycle takes a second; ``tests/benchmarks/test_stability.py`` runs three."""

SLOW = {"excitation_frequency": 0.1}
OVERDAMPED = {"excitation_frequency": 2.0, "damping_ratio": 1.0}
STILL = {"force_amplitude": 0.0}
SLOW_PAIR = {
    "height": 1e-4,
    "length": 10.0,
    "force_position": 10.0,
    "density": 4575.999023514545,
    "youngs_modulus": 1e8,
    "width": 1.0,
    "n_modes": 14,
    "fitted_modes": 4,
    "reduction": "free",
    "shaker_mass": 1000.0,
    "shaker_stiffness": 428061124.6336942,
    "shaker_damping": 1.0,
    "damping_ratio": 100.0,
    "damping_family": "beam",
    "pivot_rotational_stiffness": 0.0,
    "pivot_translational_stiffness": 59874.14171519782,
    "contact_stiffness": 1e12,
    "contact_damping": 1e6,
    "clearance": 3.266814324024429e-09,
    "excitation_frequency": 1e-3,
    "force_amplitude": 0.0,
}
"""Among its motions are two equally slow ones, which round-off makes a pair."""
LAST = {"length": 0.01, "force_position": 0.005, "damping_ratio": 100.0, "excitation_frequency": 1e4}


def _judged(machine):
    """Diagnosis of a machine; None for a named error."""
    try:
        verdict = diagnose(machine, budget=BUDGET)
    except ChaosgymError:
        return None
    json.dumps(verdict.as_dict(), allow_nan=False)
    assert verdict.nature in ("periodic", "quasiperiodic", "chaotic", "undetermined")
    assert 0.0 <= verdict.margin <= 1.0
    assert (verdict.period is None) == (verdict.nature != "periodic")
    return verdict


def _typed(machine):
    try:
        found = response_type(machine, budget=BUDGET, workers=1)
    except ChaosgymError:
        return
    assert found.type in ("I", "II", "III", "undetermined")
    assert found.reason


@pytest.mark.parametrize("fields", [SLOW, OVERDAMPED, {**OVERDAMPED, "excitation_frequency": 0.05}])
def test_what_dies_within_a_cycle_is_a_certified_period(fields):
    """Slow and overdamped beams: deviations vanish within a cycle, so the motion repeats every cycle, proven."""
    verdict = _judged(ImpactBeam(**fields))
    assert (verdict.nature, verdict.period, verdict.status) == ("periodic", 1, "certified")
    exponent = verdict.evidence["largest_lyapunov_exponent_per_cycle"]["value"]
    assert exponent is None or (math.isfinite(exponent) and exponent < 0.0)


@settings(max_examples=6, deadline=None, suppress_health_check=list(HealthCheck))
@example(fields=STILL)
@example(fields=LAST)
@example(fields=SLOW_PAIR)
@given(fields=box(ImpactBeam))
def test_a_diagnosis_anywhere_in_the_box_of_the_beam(fields):
    """Every value that JSON can hold, or a named error; never a bare exception."""
    try:
        beam = ImpactBeam(**fields)
    except ChaosgymError:
        return
    _judged(beam)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@given(fields=box(ImpactBeam))
def test_many_diagnoses_anywhere_in_the_box_of_the_beam(fields):
    """The same, many times."""
    try:
        beam = ImpactBeam(**fields)
    except ChaosgymError:
        return
    _judged(beam)


@pytest.mark.slow
@settings(max_examples=40, deadline=None, suppress_health_check=list(HealthCheck))
@example(fields=LAST)
@example(fields=SLOW)
@given(fields=box(ImpactBeam))
def test_a_type_anywhere_in_the_box_of_the_beam(fields):
    """Tolerances that leave the box are cut off at its end or refused by name."""
    try:
        beam = ImpactBeam(**fields)
    except ChaosgymError:
        return
    _typed(beam)


@pytest.mark.slow
@settings(max_examples=25, deadline=None, suppress_health_check=list(HealthCheck))
@given(fields=box(SliderCrank), typed=st.booleans())
def test_a_verdict_anywhere_in_the_box_of_the_crank(fields, typed):
    """Cranks whose revolution takes few steps, up to eight modes and both joints."""
    fields = {"matrix_update_interval": 30.0} | fields | {"n_modes": 1 + fields.get("n_modes", 2) % 8}
    try:
        crank = SliderCrank(**fields)
        model = crank.reduce(crank.default_integrator.step_phase)
    except ChaosgymError:
        return
    if model.steps * round(360.0 / crank.matrix_update_interval) > LONGEST_REVOLUTION:
        return
    (_typed if typed else _judged)(crank)


@pytest.mark.slow
def test_every_extreme_of_the_stability_map_is_judged():
    """All rungs of the beam at all extremes but one, by their default integrator: a verdict or a named error."""
    tried = judged = 0
    for run in runs_of(PLAIN_BEAM):
        if run.integrator is None and (run.extreme, run.model) != LONGEST_CYCLE:
            try:
                machine = run.machine()
            except ChaosgymError:
                continue
            tried += 1
            judged += _judged(machine) is not None
    assert tried >= 20 * len(ImpactBeam.fidelity_ladder)
    assert judged > 0.9 * tried
