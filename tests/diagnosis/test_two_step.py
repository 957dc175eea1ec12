import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chaosgym.diagnosis import two_step_test
from chaosgym.errors import DiagnosisError
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.simulation import simulate

from .maps import GOLDEN, circle, henon, logistic, three_frequencies


@pytest.mark.parametrize(
    ("r", "period"), [(2.5, 1), (3.2, 2), (3.5, 4), (3.55, 8), (3.567, 16), (3.83, 3), (3.845, 6), (3.74, 5)]
)
def test_windows_of_the_logistic_map_have_their_period(r, period):
    """Period doubling 1, 2, 4, 8, 16 and the windows of period 3, 6 and 5 of the logistic map."""
    verdict = two_step_test(logistic(r, 200))
    assert (verdict.nature, verdict.period, verdict.transient) == ("periodic", period, False)
    assert verdict.margin > 0.5


@pytest.mark.parametrize(("r", "bands"), [(4.0, 1), (3.9, 1), (3.6, 2), (3.5748, 8), (3.5709, 16)])
def test_banded_chaos_is_chaos(r, bands):
    """Chaos of the logistic map in 1, 2, 8 and 16 bands, the narrowest one a hundredth of the range wide."""
    verdict = two_step_test(logistic(r, 1000))
    assert (verdict.nature, verdict.period) == ("chaotic", None)
    assert verdict.evidence["bands"] == bands


@pytest.mark.parametrize("series", [henon(400), logistic(3.8282, 400), circle(2.5, 0.6, 400)])
def test_fractal_intermittent_and_broken_torus_chaos(series):
    """Henon's attractor, type I intermittency below the period-3 window, and the circle map past its critical point."""
    assert two_step_test(series).nature == "chaotic"


@pytest.mark.parametrize(
    "series",
    [circle(0.3, GOLDEN, 1000), circle(0.9, 0.6069, 1000), circle(0.99, 0.60667, 1000), three_frequencies(1000)],
)
def test_tori_are_quasiperiodic_and_only_long_records_say_so(series):
    """Invariant circles up to near criticality and a three-frequency torus; 100 cycles of them are never chaotic."""
    assert two_step_test(series).nature == "quasiperiodic"
    assert two_step_test(series[:100]).nature == "undetermined"


@pytest.mark.parametrize(
    ("series", "least"),
    [(logistic(4.0, 1000), "diffuses"), (logistic(3.6, 1000), "diffuses"), (logistic(3.8, 100)[:60], "broad")],
)
def test_the_margin_of_chaos_is_its_weakest_proof(series, least):
    """Spectral floor, growth of the 0-1 walk and misfit each keep a distance from a threshold; the least one counts."""
    verdict = two_step_test(series)
    assert verdict.nature == "chaotic"
    evidence = verdict.evidence
    threshold = 1e-2 if len(series) >= 200 else 1e-1
    distances = {
        "broad": min(1.0, np.log10(evidence["spectral_floor"] / threshold)),
        "diffuses": (evidence["zero_one"] - 0.5) / 0.5,
        "misfit": min(1.0, np.log10(evidence["residual"] / evidence["residual_allowed"]) / 2.0),
    }
    assert min(distances, key=distances.get) == least
    assert verdict.margin == pytest.approx(distances[least], rel=1e-12)
    assert 0.0 < verdict.margin < 1.0


@pytest.mark.parametrize(("phase", "decided"), [(0.60667, "slack"), (0.6069, "slack")])
def test_the_margin_of_a_torus_is_its_weakest_proof(phase, decided):
    """The 0-1 walk must stay below 0.2 and the floor below 1e-3; undetermined verdicts have no margin."""
    verdict = two_step_test(circle(0.99 if phase == 0.60667 else 0.9, phase, 1000))
    evidence = verdict.evidence
    distances = {
        "slack": (0.2 - evidence["zero_one"]) / 0.2,
        "floor": min(1.0, np.log10(1e-3 / evidence["spectral_floor"])),
    }
    assert min(distances, key=distances.get) == decided
    assert verdict.margin == pytest.approx(distances[decided], rel=1e-12)
    assert two_step_test(circle(0.3, GOLDEN, 1000)).margin == 1.0, "never above 1"
    for unsure in (two_step_test(circle(0.3, GOLDEN, 100)), two_step_test(logistic(3.0, 1000))):
        assert (unsure.nature, unsure.margin) == ("undetermined", 0.0)


def test_the_margin_of_a_period_counts_decades_to_what_is_allowed():
    """A misfit of a tenth of what is allowed is one decade of two; none at all is 1."""
    verdict = two_step_test(logistic(3.2, 200))
    misfit, allowed = verdict.evidence["residual"], verdict.evidence["residual_allowed"]
    assert verdict.margin == pytest.approx(min(1.0, np.log10(allowed / max(misfit, 1e-300)) / 2.0))
    noise = np.random.default_rng(0).uniform(-1.0, 1.0, 300)
    rough = two_step_test(np.tile([50.0, 57.0, 66.0], 100) + noise, sensor_error=3.0)
    distance = np.log10(rough.evidence["residual_allowed"] / rough.evidence["residual"]) / 2.0
    assert 0.0 < distance < 1.0
    assert rough.margin == pytest.approx(distance, rel=1e-12)


def test_a_locked_circle_map_is_periodic():
    """In the middle of the Arnold tongue of 1/2 the circle map repeats every two cycles."""
    verdict = two_step_test(circle(0.95, 0.5, 200))
    assert (verdict.nature, verdict.period) == ("periodic", 2)


@pytest.mark.parametrize(("r", "period"), [(2.99, 1), (3.0 + 1e-2, 2), (3.44, 2)])
def test_slow_decay_is_periodic(r, period):
    """Near a period doubling the motion settles over hundreds of cycles, but is periodic."""
    verdict = two_step_test(logistic(r, 400, skip=20))
    assert (verdict.nature, verdict.period) == ("periodic", period)


def test_chaos_that_happens_to_fall_is_not_a_slow_decay():
    """Distances that fall from block to block by chance and then drop are no approach to a period."""
    chaos = logistic(3.9, 1600) * np.repeat([1.0, 0.98, 0.96, 0.94, 0.92, 0.9, 0.88, 0.2], 200)
    assert two_step_test(chaos).nature != "periodic"


def test_at_the_bifurcation_itself_nothing_is_claimed():
    """At r = 3 deviations fall like n^-1/2: neither a torus nor a period."""
    verdict = two_step_test(logistic(3.0, 1000))
    assert verdict.nature == "undetermined"
    assert "shrinks" in verdict.reason


def test_transient_chaos_counts_as_chaotic_and_is_flagged():
    """Chaos that gives way to period 3 is transient chaos; an irregular start of 20 cycles is not (thesis 5.2.3)."""
    chaos, settled = logistic(4.0, 300), logistic(3.83, 600)
    verdict = two_step_test(np.concatenate([chaos, settled]))
    assert (verdict.nature, verdict.transient, verdict.period) == ("chaotic", True, 3)
    assert verdict.settle_cycle == pytest.approx(300, abs=3)
    ordinary = two_step_test(np.concatenate([chaos[:20], settled]))
    assert (ordinary.nature, ordinary.transient) == ("periodic", False)


@pytest.mark.parametrize("seed", range(5))
def test_noise_within_the_stated_error_does_not_hide_a_period(seed):
    """Peaks 50, 57, 66 N with errors up to 3 N repeat every three cycles; without the statement nothing repeats."""
    rng = np.random.default_rng(seed)
    peaks = np.tile([50.0, 57.0, 66.0], 100)
    for noise in (rng.uniform(-3.0, 3.0, 300), rng.normal(size=300)):
        verdict = two_step_test(peaks + noise, sensor_error=3.0)
        assert (verdict.nature, verdict.period) == ("periodic", 3)
        assert two_step_test(peaks + noise).nature != "periodic"


def test_chaos_shows_through_noise_and_a_noisy_torus_is_not_called_chaotic():
    """30 N of logistic chaos exceeds 3 N of sensor error; one line with noise has no band beyond that noise."""
    noise = np.random.default_rng(1).uniform(-3.0, 3.0, 1000)
    assert two_step_test(50.0 + 30.0 * logistic(4.0, 1000) + noise, sensor_error=3.0).nature == "chaotic"
    torus = 50.0 + 30.0 * np.cos(2.0 * np.pi * GOLDEN * np.arange(1000))
    assert two_step_test(torus + noise, sensor_error=3.0).nature in ("quasiperiodic", "undetermined")


def test_a_dead_contact_is_not_judged():
    """A contact that never carries force has no nature."""
    verdict = two_step_test(np.zeros(100))
    assert verdict.nature == "undetermined"
    assert "no contact" in verdict.reason


def test_a_constant_response_has_period_one():
    """A settled period-1 motion is the same to the last bit."""
    assert two_step_test(np.full(50, 48.9)).period == 1


@pytest.mark.parametrize(
    ("series", "message"),
    [
        (np.ones(15), "15 cycles; allowed: 16 or more"),
        (np.where(np.arange(40) == 7, np.nan, 1.0), "not finite, first at 7"),
        (np.ones((20, 2, 2)), "shape"),
    ],
)
def test_unusable_series_are_refused(series, message):
    """Too short, not finite or of a wrong shape: the error says which."""
    with pytest.raises(DiagnosisError, match=message):
        two_step_test(series)


@settings(max_examples=25, deadline=None)
@given(factor=st.floats(1e-3, 1e6), r=st.sampled_from([2.8, 3.5, 3.6, 3.83, 4.0]))
def test_units_do_not_matter(factor, r):
    """The verdict is the same in newton and in kilonewton."""
    series = logistic(r, 300)
    assert two_step_test(factor * series).nature == two_step_test(series).nature


@pytest.mark.parametrize(("frequency", "nature"), [(10.0, "periodic"), (19.0, "periodic"), (30.0, "chaotic")])
def test_the_beam_of_the_thesis(frequency, nature):
    """At +-0.127 mm: periodic at 10 and 19 Hz (thesis figure 3.6), chaotic at 30 Hz (figure 3.7)."""
    verdict = two_step_test(simulate(ImpactBeam(excitation_frequency=frequency), 200, transient=200))
    assert verdict.nature == nature
    assert json.dumps(verdict.as_dict())


def test_a_beam_that_does_not_touch_is_periodic():
    """Linear motion inside a wide gap repeats every cycle, and the verdict says that there is no contact."""
    verdict = two_step_test(simulate(ImpactBeam(clearance=0.1), 60, transient=200))
    assert (verdict.nature, verdict.period) == ("periodic", 1)
    assert "no contact" in verdict.reason
