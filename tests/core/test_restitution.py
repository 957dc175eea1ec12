"""The rigid beam whose impacts take no time: closed forms, an independent integrator, the limit of stiff contact."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

from chaosgym.diagnosis import diagnose
from chaosgym.diagnosis.lyapunov import lyapunov_spectrum
from chaosgym.errors import ParameterError
from chaosgym.machines.impact_beam import ImpactBeam
from chaosgym.simulation import RungeKutta4, simulate, simulate_with_deviations

BEAM = ImpactBeam(contact_law="restitution", n_modes=1, fitted_modes=0, contact_damping=200.0)
LOSSY = replace(BEAM, contact_damping=2000.0, excitation_frequency=10.0)


def _oscillator(beam):
    """K, D, G and angular frequency of x'' = -K x - D x' + G sin(w t)."""
    model = beam.reduce()
    load = model.tip_shape[0] * model.force_shape[0] * beam.force_amplitude
    return model.stiffness[0], model.damping[0, 0], load, 2 * np.pi * beam.excitation_frequency


def test_agrees_with_a_general_integrator_restarted_at_every_impact():
    """Three cycles of flights and rebounds equal DOP853's at rtol 1e-12 with event location to 1e-8 of their size."""
    spring, damper, load, omega = _oscillator(BEAM)
    c, e = BEAM.clearance, BEAM.reduce().restitution
    assert 0.7 < e < 0.9

    def slope(t, y):
        return [y[1], -spring * y[0] - damper * y[1] + load * np.sin(omega * t)]

    surfaces = [lambda t, y: y[0] - c, lambda t, y: y[0] + c]
    for surface, direction in zip(surfaces, (1, -1), strict=True):
        surface.terminal, surface.direction = True, direction
    t, y, end, impacts = 0.0, np.zeros(2), 3 * BEAM.cycle_period, 0
    while t < end:
        run = solve_ivp(slope, (t, end), y, method="DOP853", rtol=1e-12, atol=1e-18, events=surfaces, max_step=1e-3)
        t, y = run.t[-1], run.y[:, -1].copy()
        if t < end:
            y[1] *= -e
            impacts += 1
    record = simulate(BEAM, 3)
    shape = BEAM.reduce().tip_shape[0]
    assert record.impacts.sum() == impacts > 10
    np.testing.assert_allclose(record.final_state.coordinates * shape, y, rtol=0, atol=1e-8 * abs(y).max())


def test_settles_on_the_closed_form_period_one_orbit():
    """One impact a side and cycle: the orbit of a linear oscillator between stops in closed form (Shaw and Holmes)."""
    beam = replace(BEAM, contact_damping=800.0, clearance=1e-3)
    spring, damper, load, omega = _oscillator(beam)
    e = beam.reduce().restitution
    response = load / (spring - omega**2 + 1j * omega * damper)
    free = np.sqrt(complex(spring - damper**2 / 4))
    half = np.pi / omega

    def flight(speed, phase):
        """Way and velocity half a cycle after leaving the upper surface at a phase of the force."""
        steady = (response * np.exp(1j * phase)).imag, (1j * omega * response * np.exp(1j * phase)).imag
        x0, v0 = beam.clearance - steady[0], -e * speed - steady[1]
        a, b = x0, (v0 + damper / 2 * x0) / free
        decay, c, s = np.exp(-damper / 2 * half), np.cos(free * half), np.sin(free * half)
        x = decay * (a * c + b * s)
        v = decay * ((b * free - damper / 2 * a) * c - (a * free + damper / 2 * b) * s)
        return (x - steady[0]).real, (v - steady[1]).real

    def closes(unknown):
        x, v = flight(*unknown)
        return [(x + beam.clearance) / beam.clearance, (v + unknown[0]) / 0.1]

    record = simulate(beam, 4, transient=300)
    assert np.all(record.impacts == 1)
    speed = record.peak_force[-1, 0] / beam.reduce().force_per_speed
    solutions = [fsolve(closes, [speed, phase], full_output=True) for phase in np.linspace(0, 6, 13)]
    speeds = [solution[0] for solution, _, found, _ in solutions if found == 1 and solution[0] > 0]
    assert min(abs(np.array(speeds) / speed - 1.0)) < 1e-9


def test_chatter_ends_in_rest_until_the_force_lets_go():
    """Bounces die out in finitely many impacts; the tip then rests until the force falls to what the spring pulls."""
    spring, _, load, _ = _oscillator(LOSSY)
    record = simulate(LOSSY, 2, transient=20, samples_per_cycle=20_000)
    displacement, velocity, force = record.history[-1].T
    resting = (displacement == LOSSY.clearance) & (velocity == 0.0)
    phase = np.flatnonzero(resting) / len(displacement) * 2 * np.pi
    release = np.pi - np.arcsin(spring * LOSSY.clearance / load)
    assert 3 <= record.impacts[-1, 0] < 60
    assert phase.max() == pytest.approx(release, abs=2e-3)
    assert force[resting].max() == pytest.approx(record.peak_force[-1, 0], rel=1e-3) or (
        record.peak_force[-1, 0] > force[resting].max()
    )
    assert np.all(force * displacement >= 0.0)


def test_a_lossless_rebound_takes_no_energy_and_a_lossy_one_its_share():
    """With no force and no damper but the surface's, every impact leaves e^2 of the kinetic energy."""
    beam = replace(
        BEAM,
        force_amplitude=0.0,
        damping_ratio=0.0,
        shaker_damping=0.0,
        shaker_stiffness=0.0,
        pivot_rotational_stiffness=1e-3,
    )
    shape = beam.reduce().tip_shape[0]
    for damping in (0.0, 200.0):
        surfaced = replace(beam, contact_damping=damping)
        record = simulate(surfaced, 50, np.array([0.0, 0.1]) / shape)
        before = np.cumsum(record.impacts.sum(axis=1)) - record.impacts.sum(axis=1)
        spring = surfaced.reduce().stiffness[0]
        energy = record.velocity**2 + spring * (record.displacement**2 - beam.clearance**2)
        start = energy[0] * surfaced.reduce().restitution ** (2.0 * before)
        np.testing.assert_allclose(energy, start, rtol=1e-9)
        assert before[-1] > 10


def test_without_clearance_the_surfaces_carry_the_lever_of_the_force():
    """A tip that can't move pushes back F phi_f / phi_t, all the time."""
    beam = replace(BEAM, clearance=0.0)
    model = beam.reduce()
    record = simulate(beam, 3)
    expected = beam.force_amplitude * model.force_shape[0] / model.tip_shape[0]
    np.testing.assert_allclose(record.peak_force, expected, rtol=1e-12)
    np.testing.assert_allclose(record.contact_fraction.sum(axis=1), 1.0)


def test_stiff_compliant_contact_tends_to_it():
    """At equal restitution the compliant rigid beam nears the instantaneous one as 1 / sqrt(stiffness)."""
    errors, forces = [], []
    for stiffness in (1e8, 1e10, 1e12):
        damping = 200.0 * np.sqrt(stiffness / BEAM.contact_stiffness)
        limit = replace(BEAM, contact_stiffness=stiffness, contact_damping=damping, clearance=1e-3)
        compliant = replace(limit, contact_law="linear")
        assert limit.reduce().restitution == pytest.approx(replace(BEAM).reduce().restitution, rel=1e-9)
        a, b = (simulate(beam, 1, samples_per_cycle=200) for beam in (limit, compliant))
        errors.append(np.abs(a.history - b.history)[0, :, 0].max() / limit.clearance)
        forces.append(b.peak_force.max() / a.peak_force.max())
    assert errors[1:] == pytest.approx([errors[0] / 10, errors[0] / 100], rel=0.01)
    assert errors[2] < 3e-4
    assert forces[2] == pytest.approx(1.0, abs=1e-3)


def test_deviations_travel_through_impacts():
    """The saltation at impacts gives the derivative that finite differences give."""
    start = np.array([1e-5, 0.01])
    _, vectors, _ = simulate_with_deviations(BEAM, 2, start, deviations=np.eye(2), orthonormal=False)
    for i, step in enumerate((1e-11, 1e-8)):
        moved = [simulate(BEAM, 2, start + sign * step * np.eye(2)[i]).final_state.coordinates for sign in (1, -1)]
        np.testing.assert_allclose(vectors[i], (moved[0] - moved[1]) / (2 * step), rtol=1e-3)


def test_exponents_add_up_to_what_flights_and_impacts_take():
    """While the tip never comes to rest, their sum is -tr(D) T + 2 log(e) an impact."""
    record = simulate(BEAM, 200, transient=200)
    assert not np.any((record.displacement == BEAM.clearance) & (record.velocity == 0.0))
    exponents, total = lyapunov_spectrum(BEAM)
    assert exponents.sum() == pytest.approx(total, rel=1e-6)


def test_rest_is_periodic_for_the_diagnosis_too():
    """A response that comes to rest in each half cycle forgets its past: period 1, certified."""
    verdict = diagnose(LOSSY)
    assert (verdict.nature, verdict.period, verdict.status) == ("periodic", 1, "certified")


@pytest.mark.parametrize("beam", [BEAM, LOSSY, replace(BEAM, excitation_frequency=19.0)])
def test_runs_can_be_continued(beam):
    """60 cycles equal 25 followed by 35 from their final state, bit for bit, rest included."""
    whole, first = simulate(beam, 60), simulate(beam, 25)
    joined = first.followed_by(simulate(beam, 35, first.final_state))
    for field in ("section", "peak_force", "impacts", "bounce_duration", "contact_fraction"):
        np.testing.assert_array_equal(getattr(whole, field), getattr(joined, field))


def test_needs_a_rigid_beam_and_exact_events():
    """More modes, and methods with fixed steps, are refused by name."""
    with pytest.raises(ParameterError, match=r"n_modes = 4 .* contact_law = 'restitution'"):
        ImpactBeam(contact_law="restitution")
    with pytest.raises(ParameterError, match=r"RungeKutta4.* does not run impact-beam; allowed: ExactEvents"):
        simulate(BEAM, 1, integrator=RungeKutta4(1000))
