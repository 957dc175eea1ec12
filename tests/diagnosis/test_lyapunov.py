import numpy as np
import pytest

from chaosgym.diagnosis import find_periodic_orbit, largest_lyapunov_exponent
from chaosgym.errors import DiagnosisError
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.series import exponent_from_series
from chaosgym.series.exponent import average_growth
from chaosgym.simulation import RungeKutta4, simulate
from tests.diagnosis.two_trajectories import two_trajectory_exponent
from tests.plain_modes import PLAIN_BEAM
from tests.series.maps import GOLDEN, circle, henon, logistic


@pytest.mark.parametrize(
    ("step", "start", "expected"),
    [
        (lambda x: 4.0 * x * (1.0 - x), [0.3], np.log(2.0)),
        (lambda x: 3.5 * x * (1.0 - x), [0.3], -0.8725),
        (lambda x: np.array([1.0 - 1.4 * x[0] ** 2 + x[1], 0.3 * x[0]]), [0.1, 0.1], 0.4192),
    ],
)
def test_two_trajectories_find_known_exponents(step, start, expected):
    """Logistic map: ln 2 at r = 4 and the multiplier of the period-4 orbit at r = 3.5; Henon map: 0.4192."""
    exponent = two_trajectory_exponent(step, start, 4000)
    assert exponent.per_cycle == pytest.approx(expected, abs=max(4.0 * exponent.standard_error, 1e-3))
    assert exponent.standard_error < 0.02


def test_exponents_of_a_torus_are_zero():
    """The circle map on its invariant circle: within three standard errors of zero."""

    def step(turn):
        return turn + GOLDEN - 0.5 / (2.0 * np.pi) * np.sin(2.0 * np.pi * turn)

    exponent = two_trajectory_exponent(step, [0.1], 2000)
    assert exponent.sign == 0
    assert abs(exponent.per_cycle) < 1e-3


@pytest.mark.parametrize(
    ("series", "expected"),
    [(logistic(4.0, 3000), 0.693), (logistic(3.6, 3000), 0.1835), (henon(3000)[:, 0], 0.419)],
)
def test_series_give_the_exponent_of_strong_chaos(series, expected):
    """Neighbours in a series part at the rate of the map, within a tenth."""
    assert exponent_from_series(series).per_cycle == pytest.approx(expected, rel=0.1)


def test_series_without_divergence_are_told():
    """A torus gives nearly zero; a period, noise and a short series are refused with the reason."""
    assert abs(exponent_from_series(circle(0.3, GOLDEN, 2000)).per_cycle) < 5e-3
    with pytest.raises(DiagnosisError, match="repeats"):
        exponent_from_series(logistic(3.5, 1000))
    with pytest.raises(DiagnosisError, match="noise"):
        exponent_from_series(np.random.default_rng(0).normal(size=600), dimension=8)
    with pytest.raises(DiagnosisError, match="500"):
        exponent_from_series(logistic(4.0, 400))


def test_the_standard_error_covers_the_scatter_of_independent_runs():
    """Twenty runs of the logistic map at r = 3.9 scatter as their standard errors say."""

    def growth(start):
        x = logistic(3.9, 1000, start=start)
        return np.log(np.abs(3.9 * (1.0 - 2.0 * x)))

    exponents = [average_growth(growth(0.2 + 0.03 * i)) for i in range(20)]
    scatter = np.std([exponent.per_cycle for exponent in exponents], ddof=1)
    claimed = np.mean([exponent.standard_error for exponent in exponents])
    assert 0.5 < claimed / scatter < 2.5


@pytest.mark.slow
def test_carried_and_parted_deviations_agree_on_the_beam():
    """At 30 Hz the exact exponent equals that of two trajectories within three standard errors, and is positive."""
    beam = ImpactBeam()
    exact = largest_lyapunov_exponent(beam, 1000)
    parted = two_trajectory_exponent(
        lambda state: simulate(beam, 1, state).final_state.coordinates,
        simulate(beam, 1, transient=200).final_state.coordinates,
        600,
        distance=1e-12,
        cycle_period=beam.cycle_period,
    )
    assert exact.sign == 1
    assert exact.per_second == pytest.approx(30.0 * exact.per_cycle)
    error = np.hypot(exact.standard_error, parted.standard_error)
    assert exact.per_cycle == pytest.approx(parted.per_cycle, abs=3.0 * error)


def test_the_exponent_of_a_periodic_response_is_its_multiplier():
    """At 10 Hz and 22 Hz (period 4): the exponent is log |mu| / k of the orbit that Newton's method finds."""
    for frequency, period in ((10.0, 1), (22.0, 4)):
        beam = PLAIN_BEAM.at(frequency)
        orbit = find_periodic_orbit(beam, simulate(beam, 1, transient=200).final_state, period)
        assert orbit is not None
        assert orbit.certified
        exponent = largest_lyapunov_exponent(beam, 200)
        assert exponent.per_cycle == pytest.approx(np.log(orbit.largest_multiplier) / period, rel=1e-3)


def test_an_unstable_orbit_is_found_but_not_certified():
    """From the chaos of 30 Hz Newton's method finds a period-1 orbit with a multiplier outside the unit circle."""
    beam = ImpactBeam()
    section = simulate(beam, 200, transient=200).section
    gaps = np.linalg.norm(np.diff(section, axis=0) / np.ptp(section, axis=0), axis=1)
    orbit = find_periodic_orbit(beam, section[np.argmin(gaps)], 1)
    assert orbit is not None
    assert not orbit.certified


def test_a_coarse_integrator_takes_two_trajectories():
    """Fixed steps have no exact deviations; the second trajectory gives the sign all the same."""
    beam = ImpactBeam(excitation_frequency=10.0)
    exponent = largest_lyapunov_exponent(beam, 40, transient=20, integrator=RungeKutta4(4000))
    assert exponent.per_cycle < 0.0


def test_trajectories_that_meet_start_anew():
    """A map that forgets its state in one cycle has an exponent far below zero, not an error."""
    exponent = two_trajectory_exponent(lambda x: 0.0 * x + 0.5, [0.3], 100, transient=0)
    assert exponent.per_cycle < -10.0
    crank = SliderCrank(crank_speed=120.0, slider_clearance=0.02e-3, contact_damping_ratio=0.1)
    assert largest_lyapunov_exponent(crank, 40, transient=20).sign == -1
