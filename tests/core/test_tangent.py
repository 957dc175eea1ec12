import numpy as np
import pytest

from chaosgym.diagnosis.lyapunov import lyapunov_spectrum
from chaosgym.errors import ParameterError
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import ExactEvents, simulate, simulate_with_deviations


@pytest.mark.parametrize("beam", [ImpactBeam(excitation_frequency=19.0), ImpactBeam(contact_damping=2000.0)])
def test_deviations_are_the_derivative_of_the_motion(beam):
    """One cycle with impacts: carried deviations equal central differences of neighbouring runs to 1e-5."""
    precise = ExactEvents(event_tolerance=1e-13)
    start = simulate(beam, 1, transient=50).final_state
    stiffness = beam.reduce().stiffness
    weight = np.concatenate([np.sqrt(stiffness), np.ones(len(stiffness))])
    record, carried, growth = simulate_with_deviations(
        beam, 1, start, deviations=np.diag(1.0 / weight), orthonormal=False, integrator=precise
    )
    assert record.impacts.sum() > 3
    assert growth.shape == (1, 0)
    step = 1e-6 * np.linalg.norm(weight * start.coordinates)
    ends = []
    for sign in (1.0, -1.0):
        for i in range(len(weight)):
            moved = start.coordinates.copy()
            moved[i] += sign * step / weight[i]
            ends.append(simulate(beam, 1, moved, integrator=precise).final_state.coordinates)
    differences = (np.array(ends[: len(weight)]) - np.array(ends[len(weight) :])) / (2.0 * step)
    scale = np.max(np.abs(weight * carried))
    assert np.max(np.abs(weight * (carried - differences))) < 1e-5 * scale


@pytest.mark.parametrize("frequency", [10.0, 30.0])
def test_exponents_sum_to_the_trace(frequency):
    """The sum of all exponents is the damping of structure, shaker and contact: -tr(D) T - d |phi_t|^2 t_contact."""
    exponents, trace = lyapunov_spectrum(ImpactBeam(excitation_frequency=frequency), 50, transient=20)
    assert exponents.sum() == pytest.approx(trace, rel=1e-11)
    assert np.all(np.diff(exponents) < 1.0)


def test_a_beam_without_contact_has_the_exponents_of_its_modes():
    """Free of the sensors the exponents are the real parts of the eigenvalues times the cycle period."""
    beam = ImpactBeam(clearance=0.5, shaker_damping=0.0)
    exponents, trace = lyapunov_spectrum(beam, 200, transient=50)
    model = beam.reduce()
    expected = np.repeat(-0.5 * np.diag(model.damping), 2) * beam.cycle_period
    assert np.sort(exponents) == pytest.approx(np.sort(expected), rel=2e-2, abs=1e-3)
    assert exponents.sum() == pytest.approx(trace, rel=1e-11)


@pytest.mark.parametrize("count", [1, 2])
def test_carrying_deviations_does_not_touch_the_motion(count):
    """The run with deviations is the run without, to the last bit."""
    beam = ImpactBeam()
    plain = simulate(beam, 50)
    record, _, _ = simulate_with_deviations(beam, 50, deviations=np.eye(beam.n_states)[:count])
    assert np.array_equal(plain.section, record.section)
    assert np.array_equal(plain.peak_force, record.peak_force)
    assert np.array_equal(plain.final_state.coordinates, record.final_state.coordinates)


@pytest.mark.parametrize("frequency", [10.0, 19.0, 30.0])
def test_one_deviation_by_tables_grows_as_the_first_of_two_by_exponentials(frequency):
    """A deviation that moves along in the tables of the motion is the one that goes from event to event, to 1e-9."""
    beam = ImpactBeam(excitation_frequency=frequency)
    start = simulate(beam, 1, transient=50).final_state
    both = np.eye(beam.n_states)[:2]
    _, alone, growth = simulate_with_deviations(beam, 50, start, deviations=both[:1])
    record, pair, growths = simulate_with_deviations(beam, 50, start, deviations=both)
    assert record.impacts.sum() > 100
    assert growth[:, 0] == pytest.approx(growths[:, 0], abs=1e-9)
    assert alone[0] == pytest.approx(pair[0], abs=1e-9 * np.max(np.abs(pair[0])))


def test_growth_does_not_depend_on_how_the_run_is_cut():
    """One deviation over 20 cycles equals two times 10 cycles."""
    beam = ImpactBeam()
    whole = simulate_with_deviations(beam, 20, deviations=np.ones((1, beam.n_states)))
    first = simulate_with_deviations(beam, 10, deviations=np.ones((1, beam.n_states)))
    second = simulate_with_deviations(beam, 10, first[0].final_state, deviations=first[1])
    assert np.array_equal(whole[2], np.concatenate([first[2], second[2]]))


def test_deviations_of_a_wrong_shape_are_refused():
    """The error names the shape."""
    with pytest.raises(ParameterError, match=r"\(m, 12\)"):
        simulate_with_deviations(ImpactBeam(), 1, deviations=np.eye(3))
