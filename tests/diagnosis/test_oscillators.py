from dataclasses import replace

import numpy as np
import pytest

from benchmarks.agreement import random_machines
from chaosgym.diagnosis import diagnose, find_periodic_orbit
from chaosgym.machines import ImpactBeam
from chaosgym.series import two_step_test
from chaosgym.simulation import simulate
from tests.diagnosis.oscillators import RigidImpact, duffing, iterate
from tests.diagnosis.two_trajectories import two_trajectory_exponent
from tests.plain_modes import PLAIN_BEAM

SHAW_HOLMES = RigidImpact(frequency=2.4, damping=0.02, restitution=0.8, gap=0.0)


def test_the_rigid_impact_orbit_closes_and_its_multipliers_obey_the_area_law():
    """Closed form of Shaw and Holmes: the orbit returns, and the product of multipliers is e^2 exp(-2 zeta T)."""
    orbits = SHAW_HOLMES.one_impact_orbits()
    assert orbits
    time, speed, multipliers = orbits[0]
    state = SHAW_HOLMES.at_phase_zero(time, speed)
    assert SHAW_HOLMES.step(state) == pytest.approx(state, abs=1e-9)
    area = SHAW_HOLMES.restitution**2 * np.exp(-2.0 * SHAW_HOLMES.damping * SHAW_HOLMES.period)
    assert np.prod(multipliers).real == pytest.approx(area, rel=1e-12)


def test_the_rigid_impact_oscillator_settles_on_its_stable_orbit():
    """From elsewhere the motion ends on the closed-form orbit; its exponent is the logarithm of the multiplier."""
    time, speed, multipliers = SHAW_HOLMES.one_impact_orbits()[0]
    assert np.max(np.abs(multipliers)) < 1.0
    state = SHAW_HOLMES.at_phase_zero(time, speed)
    series = iterate(SHAW_HOLMES.step, state + np.array([-0.05, 0.1]), 200)
    verdict = two_step_test(series)
    assert (verdict.nature, verdict.period) == ("periodic", 1)
    assert series[-1] == pytest.approx(state, abs=1e-8)
    exponent = two_trajectory_exponent(SHAW_HOLMES.step, state, 100, transient=0)
    assert exponent.per_cycle == pytest.approx(np.log(np.max(np.abs(multipliers))), abs=0.01)


def test_the_rigid_impact_oscillator_is_chaotic_where_its_orbit_has_doubled_away():
    """At w = 2.8 the one-impact orbit is unstable, and the motion neither repeats nor keeps neighbours together."""
    oscillator = RigidImpact(frequency=2.8, damping=0.02, restitution=0.8, gap=0.0)
    assert all(np.max(np.abs(multipliers)) > 1.0 for _, _, multipliers in oscillator.one_impact_orbits())
    assert two_step_test(iterate(oscillator.step, [0.0, -0.1], 300, skip=100)).nature == "chaotic"
    assert two_trajectory_exponent(oscillator.step, [0.0, -0.1], 200, transient=100).sign == 1


def test_uedas_oscillator_is_chaotic_with_its_known_exponent():
    """x'' + 0.05 x' + x^3 = 7.5 cos t: 0.1034 per unit of time (Sprott, appendix A)."""
    assert two_step_test(iterate(duffing, [1.0, 0.0], 600, skip=200)).nature == "chaotic"
    exponent = two_trajectory_exponent(duffing, [1.0, 0.0], 20_000, cycle_period=2.0 * np.pi)
    assert exponent.per_second == pytest.approx(0.1034, abs=max(0.003, 3.0 * exponent.standard_error / (2.0 * np.pi)))


def test_a_damped_duffing_oscillator_is_periodic():
    """x'' + 0.4 x' + x^3 = 0.3 cos t repeats every cycle, with a negative exponent."""

    def step(state):
        return duffing(state, damping=0.4, amplitude=0.3)

    assert two_step_test(iterate(step, [0.1, 0.0], 200)).period == 1
    assert two_trajectory_exponent(step, [0.1, 0.0], 200).sign == -1


def test_the_bilinear_beam_contracts_area_by_its_damping():
    """One mode between soft stops: the product of the multipliers is exp(-D T - d phi_t^2 t_contact)."""
    beam = replace(PLAIN_BEAM, n_modes=1, excitation_frequency=12.0, shaker_damping=60.0)
    record = simulate(beam, 1, transient=400)
    verdict = two_step_test(simulate(beam, 200, transient=400))
    assert verdict.nature == "periodic"
    orbit = find_periodic_orbit(beam, record.final_state, verdict.period or 1)
    assert orbit is not None
    assert orbit.certified
    model = beam.reduce()
    contact = simulate(beam, orbit.period, orbit.state).contact_fraction.sum() * beam.cycle_period
    log_area = -model.damping[0, 0] * orbit.period * beam.cycle_period
    log_area -= beam.contact_damping * model.tip_shape[0] ** 2 * contact
    assert np.log(abs(np.prod(orbit.multipliers))) == pytest.approx(log_area, rel=1e-6)


@pytest.mark.slow
def test_one_degree_of_freedom_is_never_quasiperiodic():
    """A map that contracts area everywhere has no invariant circle: none of 40 one-mode beams is labelled so."""
    natures = [diagnose(beam).nature for beam in random_machines(ImpactBeam(n_modes=1, fitted_modes=0), 40, seed=2)]
    assert "quasiperiodic" not in natures
    assert len(set(natures)) > 1
