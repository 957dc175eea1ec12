"""Published machines on which several motions live: each motion by another way, and which starts lead to it."""

import math

import numpy as np
import pytest
from scipy.linalg import eigh, expm
from scipy.optimize import fsolve

import chaosgym
from benchmarks.published import no_separation
from chaosgym.diagnosis import attractors, response_type
from chaosgym.diagnosis.attractors import Mapper
from chaosgym.diagnosis.carried import carried_states
from tests.branches.test_branch import oscillator
from tests.diagnosis.coexisting import RATIO, trilinear


def farthest(force, ratio, x, v, cycles=90, steps=500):
    """Largest displacement in the last four cycles of a drive, by RK4 in fixed steps; unit masses."""
    h, largest = 2.0 * np.pi / ratio / steps, np.full(np.shape(x), -np.inf)
    for step in range(steps * cycles):
        t = h * (step % steps)
        a1, b1 = v, force(t, x, v)
        a2, b2 = v + 0.5 * h * b1, force(t + 0.5 * h, x + 0.5 * h * a1, v + 0.5 * h * b1)
        a3, b3 = v + 0.5 * h * b2, force(t + 0.5 * h, x + 0.5 * h * a2, v + 0.5 * h * b2)
        a4, b4 = v + h * b3, force(t + h, x + h * a3, v + h * b3)
        x, v = x + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4), v + h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
        if step >= steps * (cycles - 4):
            largest = np.maximum(largest, x)
    return largest


def test_chaos_beside_free_flight_takes_the_starts_of_an_own_integrator():
    """De Souza, Wiercigroch, Caldas and Balthazar: an impact oscillator, chaotic or without contact, start by start.

    S. L. T. de Souza et al., Suppressing grazing chaos in impacting system by structural nonlinearity, Chaos Solitons
    Fractals 38 (2008) 864-869: damping 0.02, force 0.5, ratio 0.417893, stop at 0.63 and 20 times as stiff.
    """
    ratio, count = 0.417893, 200
    machine = oscillator(
        damping=0.02, stiffness=20.0, stops="one", gap=0.63, speed=ratio * RATIO, force=0.5, angle=math.pi / 2.0
    )
    found = attractors(machine)
    assert [(one.nature, one.largest_peak > 0.0) for one in found.motions] == [("chaotic", True), ("periodic", False)]
    starts = np.random.default_rng(5).uniform(-1.0, 1.0, (count, 2))
    place = np.array([-1 if one is None else one for one in Mapper(machine, found).reached(list(starts))])

    def force(t, x, v):
        return -0.04 * v - x - 20.0 * np.maximum(x - 0.63, 0.0) + 0.5 * np.cos(ratio * t)

    largest = farthest(force, ratio, starts[:, 0], starts[:, 1])
    assert np.mean((largest > 0.63) == (place == 0)) > 0.97


@pytest.mark.parametrize("ratio", [1.3, 1.5, 1.7, 1.88])
def test_the_rattle_of_a_trilinear_oscillator_is_that_of_matched_linear_solutions(ratio):
    """Natsiavas: of a symmetric trilinear oscillator a rattle of two contacts a cycle lives beside the linear motion.

    S. Natsiavas, Periodic response and stability of oscillators with symmetric trilinear restoring force, J. Sound Vib.
    134 (1989) 315-331 (cited from memory). Half a cycle is a contact and a flight, each linear, here by matrix
    exponentials: unknown are velocity and phase where the contact begins, and how long it lasts.
    """

    def generator(stiffness):
        """Of place, velocity, sine and cosine of the drive, and 1."""
        rate = np.zeros((5, 5))
        rate[0, 1], rate[2, 3], rate[3, 2] = 1.0, ratio, -ratio
        rate[1] = [-1.0 - stiffness, -0.08, 0.4, 0.0, stiffness]
        return rate

    half, (flying, touching) = math.pi / ratio, (generator(0.0), generator(5.0))

    def misses(unknown):
        velocity, phase, time = unknown
        left = expm(touching * time) @ [1.0, velocity, math.sin(phase), math.cos(phase), 1.0]
        back = expm(flying * (half - time)) @ left
        return left[0] - 1.0, back[0] + 1.0, back[1] + velocity

    found = attractors(trilinear(ratio), carried=carried_states(trilinear(ratio)))
    flight, rattle = found.motions
    assert flight.largest_peak == 0.0
    forces = []
    for guess in np.linspace(-math.pi, math.pi, 13):
        (velocity, phase, time), _, done, _ = fsolve(misses, (2.0 * ratio, guess, 0.5 * half), full_output=True)
        if done == 1 and velocity > 0.0 and 0.0 < time < half:
            begun = np.array([1.0, velocity, math.sin(phase), math.cos(phase), 1.0])
            path = [(expm(touching * t) @ begun)[0] for t in np.linspace(0.0, time, 501)]
            forces += [5.0 * (max(path) - 1.0)] if min(path) > 1.0 - 1e-6 else []
    # the smaller of the two rattles is the unstable one between them
    assert max(forces) > 1.01 * min(forces)
    assert rattle.largest_peak == pytest.approx(max(forces), rel=1e-4)


def test_the_two_motions_of_a_gear_pair_are_found():
    """Kahraman and Singh: in the bent resonance the pair separates or not; not separating it is linear."""
    gears = chaosgym.read_machine("docs/machines/kahraman-singh-1990.toml").at(740.0)
    found = attractors(gears, carried=carried_states(gears))
    assert [one.period for one in found.motions] == [1, 1]
    peaks = sorted(one.largest_peak for one in found.motions)
    assert peaks[0] == pytest.approx(float(no_separation(gears, np.array([740.0]))[0]), rel=1e-3)
    assert peaks[1] > 2.0 * peaks[0]
    assert {"run-up from 300 Hz", "run-down from 1600 Hz"} <= {way for one in found.motions for way in one.from_starts}
    assert response_type(gears, window="speed-clearance", budget=400).type == "III"


STIFFNESS = np.array([[1.0, -1.0], [-1.0, 2.0]])
DAMPING = 0.03 * STIFFNESS


def one_sided(ratio):
    """Two unit masses in a chain, the first before a spring of 100 at a gap of 1, the second driven by 0.1."""
    squares, shapes = eigh(STIFFNESS)
    rates = np.sqrt(squares)
    structure = chaosgym.Structure.of_modes(
        (rates * RATIO).tolist(), (0.015 * rates).tolist(), {"first": shapes[0].tolist(), "second": shapes[1].tolist()}
    )
    return chaosgym.ModalMachine(
        modes=structure,
        joint="first",
        drives=(chaosgym.Drive.sine("force", "second", 0.1),),
        speed=ratio * RATIO,
        stops="one",
        clearance=1.0,
        contact_stiffness=100.0,
        contact_damping=0.0,
    )


def test_a_one_sided_oscillator_bifurcates_where_it_is_published_to():
    """Krack and Gross: turning points, flips at the top, a stable orbit at 0.635, a Neimark-Sacker before 0.6.

    M. Krack, J. Gross, Harmonic Balance for Nonlinear Vibration Problems, Springer 2019, doi:10.1007/978-3-030-14023-6:
    two masses before a unilateral spring, example 3 of its program NLvib. Free flight lives beside a rattle between the
    turning points.
    """
    alone = attractors(one_sided(0.635))
    assert [(one.period, one.largest_peak > 0.0) for one in alone.motions] == [(1, True)]
    ends = (0.5 * RATIO, 0.8 * RATIO)
    diagram = chaosgym.follow(one_sided(0.635), "speed", ends, sweep=9, longest_period=1)
    places = {"fold": [], "flip": [], "Neimark-Sacker": []}
    for one in diagram.bifurcations:
        if one.loses_stability:
            places[one.kind].append(one.value / RATIO)
    assert any(0.6 < place < 0.635 for place in places["Neimark-Sacker"])
    assert any(0.635 < place < 0.68 for place in places["fold"])
    assert any(0.7 < place < 0.8 for place in places["flip"])


def test_starts_of_a_one_sided_oscillator_end_where_an_own_integrator_takes_them():
    """The shares of free flight and rattle of the machine above, start by start, and the force of the rattle."""
    ratio, machine = 0.72, one_sided(0.72)
    found = attractors(machine)
    starts = found.box.draw(200, 11)
    place = Mapper(machine, found).reached(list(starts))
    assert [one.period for one in found.motions] == [1, 1]
    forces = np.array([np.nan if one is None else found.motions[one].largest_peak for one in place])
    shapes = eigh(STIFFNESS)[1]
    x, v = shapes @ starts[:, :2].T, shapes @ starts[:, 2:].T

    def force(t, x, v):
        pushed = np.array([-100.0 * np.maximum(x[0] - 1.0, 0.0), np.full(x.shape[1], 0.1 * np.sin(ratio * t))])
        return -STIFFNESS @ x - DAMPING @ v + pushed

    own = 100.0 * np.maximum(farthest(force, ratio, x, v)[0] - 1.0, 0.0)
    assert 0.2 < np.mean(own > 0.0) < 0.8
    assert np.mean(np.isclose(own, forces, rtol=1e-3)) > 0.97
