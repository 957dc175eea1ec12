"""Statistics of peak forces: closed forms, known distributions, and the machines of the thesis."""

from dataclasses import replace

import numpy as np
import pytest

from chaosgym.design.statistics import (
    convergence,
    correlation_time,
    cycles_needed,
    histogram,
    require_enough,
    running_statistics,
)
from chaosgym.errors import DesignError
from chaosgym.simulation import simulate
from tests.plain_modes import PLAIN_BEAM


def test_running_statistics_are_those_of_the_first_cycles():
    """After n cycles they are mean and deviation of n values, also far from zero."""
    values = 1e6 + np.random.default_rng(0).normal(size=50)
    running = running_statistics(values)
    for n in (1, 2, 17, 50):
        assert running.mean[n - 1] == pytest.approx(np.mean(values[:n]), rel=1e-14)
        assert running.deviation[n - 1] == pytest.approx(np.std(values[:n]), abs=1e-5)


def test_a_periodic_force_converges_at_once():
    """One value needs one cycle; two alternating ones converge within a few periods."""
    assert convergence(np.full(100, 40.0)).cycles == 1
    alternating = convergence(np.tile([40.0, 50.0], 100))
    assert alternating.converged
    assert alternating.cycles <= 20


def test_convergence_of_normal_forces_follows_the_standard_errors():
    """5 % scatter: the deviation decides, and 80 to 90 cycles are needed, as the thesis reads off figure 5.14."""
    forces = np.random.default_rng(1).normal(95.0, 5.0, 20_000)
    assert 80 <= cycles_needed(forces) <= 95
    drifting = np.linspace(30.0, 60.0, 400)
    assert not convergence(drifting).converged


def test_correlation_time_of_an_autoregressive_record():
    """x(n+1) = a x(n) + noise has the time (1 + a) / (1 - a)."""
    random = np.random.default_rng(2)
    for a in (0.0, 0.5, 0.8):
        x = np.zeros(60_000)
        for n, noise in enumerate(random.normal(size=len(x) - 1)):
            x[n + 1] = a * x[n] + noise
        assert correlation_time(x) == pytest.approx((1.0 + a) / (1.0 - a), rel=0.12)


def test_modes_of_known_distributions():
    """One mode of a normal distribution, two of a mixture, each value of a periodic one."""
    random = np.random.default_rng(3)
    assert len(histogram(random.normal(60.0, 8.0, 3000)).modes) == 1
    both = np.concatenate([random.normal(40.0, 2.0, 1500), random.normal(60.0, 3.0, 1500)])
    assert histogram(both).modes == pytest.approx([40.0, 60.0], abs=1.0)
    assert histogram(np.tile([30.0, 45.0, 70.0], 40)).modes == pytest.approx([30.0, 45.0, 70.0], rel=1e-5)
    assert histogram(np.full(20, 55.0)).modes == pytest.approx([55.0])


def test_histogram_counts_every_cycle():
    """No cycle is lost at the ends."""
    forces = np.random.default_rng(4).uniform(20.0, 80.0, 500)
    assert histogram(forces).count.sum() == 500
    assert len(histogram(forces, bins=12).count) == 12


@pytest.mark.parametrize("frequency", [22.2, 25.3, 28.0])
def test_chaotic_peak_forces_of_the_beam_have_several_modes_and_a_bound(frequency):
    """Multi-peak and bounded, as in figure 5.7; a beam whose chaos lies beside 22 and 25 Hz."""
    peaks = simulate(replace(PLAIN_BEAM, excitation_frequency=frequency), 3000, transient=300).peak_force[:, 0]
    assert len(histogram(peaks).modes) >= 2
    assert np.max(peaks[:1500]) == pytest.approx(np.max(peaks[1500:]), rel=0.05)


def test_too_few_cycles_say_how_many_are_needed():
    """A statistic of ten scattered cycles is refused with the number that would do."""
    with pytest.raises(DesignError, match=r"10 cycles are too few .* needed: \d+ or more"):
        require_enough(np.random.default_rng(5).normal(50.0, 8.0, 10))
    with pytest.raises(DesignError, match=r"shape \(2, 2\)"):
        require_enough([[1.0, 2.0], [3.0, 4.0]])
