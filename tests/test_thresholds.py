"""Constants of statistics and thresholds: each against a derivation of its own, or with a case on either side of it."""

import math
from time import thread_time
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2, norm

from chaosgym import ImpactBeam, Structure
from chaosgym.classifier.cascade import _affordable, costs_of
from chaosgym.diagnosis.stage import GROWS, without_contact
from chaosgym.recordings.monitor import FIRST, Monitor, RepeatSums
from chaosgym.recordings.run_up import LOST, _doubts
from chaosgym.recordings.scatter_verdict import _most
from chaosgym.series.noise import correlation, find_change, stated_error, without_drift


def test_the_deviation_of_a_largest_error_is_that_of_a_uniform_one():
    """A sensor that errs by up to a half width, anywhere within it, by the root of its mean square."""
    errors = np.linspace(-3.0, 3.0, 200_001)
    assert stated_error(3.0, None).sigma == pytest.approx(np.sqrt(np.mean(errors**2)), rel=1e-5)
    assert stated_error(None, 0.5).half_width == 3.0 * 0.5


@pytest.mark.parametrize(("readings", "period"), [(60, 1), (300, 2), (3000, 8)])
def test_scatter_is_the_sensors_up_to_three_deviations_of_its_own(readings, period):
    """But for the five per cent of an error that is not known better, the bound is the quantile of chi squared."""
    found = SimpleNamespace(readings=np.zeros(readings), period=period)
    freedom = readings - period
    quantile = math.sqrt(chi2.ppf(norm.cdf(3.0), freedom) / freedom)
    bound = _most(found, SimpleNamespace(sigma=1.0), 0.0) - 0.05
    assert bound - 1.0 == pytest.approx(quantile - 1.0, rel=0.06)
    assert _most(found, SimpleNamespace(sigma=3.0), 4.0) == pytest.approx(5.0 * (bound + 0.05)), "errors add in squares"


def test_an_order_is_blurred_by_pulses_that_are_known_to_half_a_sample():
    """What is lost is what averaging over the uniform error of an instant takes; told from ``LOST`` on, not below."""
    highest, speed, step = 20.0, 50.0, 1e-5
    shifts = np.linspace(-0.5, 0.5, 20_001) * step
    lost = 1.0 - float(np.mean(np.cos(2.0 * np.pi * highest * speed * shifts)))
    at_the_limit = math.sqrt(LOST / lost)  # the loss is the square of the step as long as it is small
    signal = SimpleNamespace(highest=highest, speed=np.array([1.0, speed]))
    assert _doubts(signal, 0.97 * at_the_limit * step) == []
    (told,) = _doubts(signal, 1.03 * at_the_limit * step)
    assert f"{100.0 * LOST * 1.03**2:.2g} % too small" in told


def stage(sign, ratio):
    """A run without contact whose exponent has a sign, and whose last quarter moves more than the one before."""
    displacement = np.repeat([1.0, 1.0, 1.0, ratio], 25)
    record = _Sized(displacement=displacement, peak_force=np.zeros((100, 1)))
    exponent = SimpleNamespace(sign=sign, per_cycle=0.1 * sign)
    return SimpleNamespace(exponent=exponent, record=record, growth=np.zeros(100))


class _Sized(SimpleNamespace):
    def __len__(self):
        return len(self.displacement)


@pytest.mark.parametrize(
    ("sign", "ratio", "nature"),
    [
        (-1, GROWS - 1e-6, "periodic"),
        (0, GROWS - 1e-6, "quasiperiodic"),
        (-1, GROWS + 1e-6, "undetermined"),
        (0, GROWS + 1e-6, "undetermined"),
        (1, 1.0, "undetermined"),
    ],
)
def test_a_motion_that_grows_before_any_contact_is_not_judged(sign, ratio, nature):
    """Growth shows in the displacement or in the exponent; either is enough."""
    assert without_contact(stage(sign, ratio)).nature == nature


def test_a_proof_is_tried_where_the_budget_holds_its_cost():
    """So many cycles and so many steps of Newton's method: half as much more is enough, half of it is not."""
    beam = ImpactBeam()
    costs, many = costs_of(ImpactBeam), 10**7
    for cycles, proofs in ((many, 0), (0, many), (many, many)):
        cost = cycles * costs.cycle + proofs * costs.proof
        assert cost > 1e6, "a second, beside which what the test itself takes is nothing"
        assert _affordable(beam, thread_time(), 1.5 * cost, cycles, proofs)
        assert not _affordable(beam, thread_time(), 0.5 * cost, cycles, proofs)
    assert _affordable(beam, thread_time(), None, many, many)
    assert not _affordable(beam, thread_time(), 0.0, 0, 0)


def test_a_measured_damping_matrix_is_symmetric_to_the_last_bit():
    """In modal coordinates too, where products round: v' C w is w' C v, for any two motions."""
    draw = np.random.default_rng(4)
    part = draw.normal(size=(8, 8))
    mass, stiffness = np.diag(np.arange(1.0, 9.0)), 1e4 * (part @ part.T + np.eye(8))
    damping = part.T @ part
    found = Structure.of_matrices(mass, 0.5 * (stiffness + stiffness.T), 0.5 * (damping + damping.T), {"a": 0}, modes=8)
    np.testing.assert_array_equal(found.damping, found.damping.T)
    assert np.abs(found.damping - np.diag(np.diag(found.damping))).max() > 0.1


@pytest.mark.parametrize("step", [0.40, 0.449, 0.451, 0.6, 1.49, 1.51, 40.0])
def test_the_monitor_sums_differences_beyond_the_drift_up_to_a_cap(step):
    """A ramp by a step [twice the error] a cycle: g <- g + min(step, 1.5) - 0.45 at lag 1, the least, from 0 to 4.5.

    The level is g / 2.5, from the seventeenth cycle on, when each of eight lags has been measured twice.
    """
    error, sums, own = 3.0, RepeatSums(1), 0.0
    for cycle in range(1, 60):
        sums.add(FIRST, np.array([2.0 * error * step * cycle]), error)
        own = min(max(own + min(step, 1.5) - 0.45, 0.0), 4.5) if cycle > 1 else 0.0
        assert sums.level(FIRST)[0] == pytest.approx(own / 2.5 if cycle > 16 else 0.0, abs=1e-9)


@pytest.mark.parametrize(("jump", "event"), [(2.19, ""), (2.21, "change")])
def test_a_change_differs_by_more_than_a_tenth_beyond_what_the_error_explains(jump, event):
    """Two readings of the same peak differ by twice the error at the most: beyond 1.1 times that at every lag."""
    monitor = Monitor(sensor_error=1.0)
    for peak in 80 * [50.0]:
        monitor.update(peak)
    assert monitor.update(50.0 + jump).event == event


@pytest.mark.parametrize(("ratio", "told"), [(5.9, False), (6.1, True), (-5.9, False), (-6.1, True)])
def test_a_drift_is_told_from_six_standard_errors_on(ratio, told):
    """Least squares of a line: scatter of deviation 2 that no line explains, and a slope of so many errors."""
    size = 240
    time = (np.arange(size) - 0.5 * (size - 1)) / size
    scatter = np.random.default_rng(1).normal(size=size)
    scatter -= np.polynomial.Polynomial.fit(time, scatter, 1)(time)
    scatter *= 2.0 / np.std(scatter)
    slope = ratio * 2.0 / np.sqrt(np.sum(time**2))
    rest, drift = without_drift(50.0 + slope * time + scatter, 1)
    assert drift == pytest.approx(slope if told else 0.0)
    np.testing.assert_allclose(rest, 50.0 + scatter + (0.0 if told else slope) * time)


@pytest.mark.parametrize("later", [2.0, 0.5])
@pytest.mark.parametrize(("ratio", "changes"), [(15.0, False), (17.5, True)])
def test_regimes_differ_from_sixteen_times_the_variance_on(ratio, changes, later):
    """Scatter of which one half has so many times the variance of the other, whichever comes first."""
    halves = np.random.default_rng(2).normal(size=(2, 400))
    halves = (halves - halves.mean(axis=1, keepdims=True)) / halves.std(axis=1, keepdims=True)
    halves[1] *= ratio ** (0.5 * math.log2(later))
    place = find_change(50.0 + halves.ravel(), 0.0)
    assert (place is not None) == changes
    assert place is None or abs(place - 400) < 20


def test_the_largest_autocorrelation_is_told_in_standard_errors():
    """Of a period of three, 67 times: all but the last are found again three readings later; the root of 201 scales."""
    values = np.tile([2.0, -1.0, -1.0], 67)
    three_apart = 66 / 67 * math.sqrt(201.0)
    assert correlation(values) == pytest.approx(three_apart)
    assert correlation(values, 3, lags=1) == pytest.approx(three_apart)
    assert correlation(values, 1, lags=1) == pytest.approx(0.5 * math.sqrt(201.0), rel=0.01), "one or two apart"
    assert correlation(values[:11], 3) < 0.6 * math.sqrt(11.0), "a lag of more than a quarter of the record"
    assert correlation(np.ones(200)) == 0.0
