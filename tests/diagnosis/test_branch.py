import math
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from chaosgym.diagnosis.bifurcation_diagram import follow
from chaosgym.diagnosis.branch import stretch
from chaosgym.diagnosis.orbit_family import family_of
from chaosgym.diagnosis.periodic_orbit import find_periodic_orbit
from chaosgym.errors import ParameterError
from chaosgym.machines import ImpactBeam
from chaosgym.machines.linear_impact import linear_impact
from chaosgym.machines.modal_machine import Drive, ModalMachine, Structure
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate

from .oscillators import RigidImpact


def oscillator(*, damping, stiffness, contact_damping=0.0, stops="two", gap=1.0, angle=0.0, speed=1.0, force=1.0):
    """x'' + 2 damping x' + x = force sin(w t + angle), w = 2 pi speed, between compliant stops at +-gap, 1 kg."""
    structure = Structure.of_modes([1.0 / (2.0 * math.pi)], damping, {"mass": [1.0]})
    drive = Drive.sine("force", "mass", 1.0, 1, angle)
    return ModalMachine(
        modes=structure,
        joint="mass",
        drives=(drive,),
        stops=stops,
        clearance=gap,
        contact_stiffness=stiffness,
        contact_damping=contact_damping,
        speed=speed,
        drive_level=force,
    )


def damper_of(restitution, stiffness):
    """Damper of a stop on which 1 kg keeps a share of its speed."""

    def miss(ratio):
        return linear_impact(1.0, stiffness, 2.0 * ratio * math.sqrt(stiffness)).restitution - restitution

    return 2.0 * math.sqrt(stiffness) * brentq(miss, 1e-6, 0.49)


def branch_from(machine, field, low, high, state, period, sign):
    """Stretch of the branch through a state near an orbit at the machine's own value, towards larger or smaller."""
    orbit = find_periodic_orbit(machine, state, period, iterations=20)
    family = family_of(machine, field, low, high, orbit.state, period)
    s = (getattr(machine, field) - low) / (high - low)
    normal = np.append(np.zeros(len(orbit.state)), sign)
    return family, stretch(family, family.solve(np.append(family.weight * orbit.state, s), normal))


def bifurcations(found, *kinds):
    """Values of the bifurcations of a stretch, of some kinds."""
    return [each.bifurcation.value for each in found.found if each.bifurcation.kind in kinds]


def without_square_root(values):
    """Limit of values at k, 4 k, 16 k ... whose error begins with 1 / sqrt(k), then 1 / k."""
    first = 2.0 * np.array(values[1:]) - values[:-1]
    return (4.0 * first[1:] - first[:-1])[-1] / 3.0


def test_contact_begins_where_the_linear_amplitude_reaches_the_gap():
    """Closed form of the oscillator without contact: the branch grazes both stops there, to 1e-8."""
    machine = oscillator(damping=0.05, stiffness=50.0, gap=2.0, speed=0.08)
    exact = brentq(
        lambda w: abs(1.0 / complex(1.0 - w * w, 0.1 * w)) - 2.0, 2.0 * math.pi * 0.08, 2.0 * math.pi * 0.15
    ) / (2.0 * math.pi)
    _, found = branch_from(machine, "speed", 0.08, 0.12, np.zeros(2), 1, 1.0)
    first = found.found[0].bifurcation
    assert first.kind == "grazing"
    assert first.impacts == ((0, 0), (1, 1))
    assert first.value == pytest.approx(exact, rel=1e-8)


def shaken(omega, amplitude, impact, speed, restitution):
    """State half a period after the drive's maximum of an orbit that hits x = 1 once; damping 0.04 x'."""
    generator, period = np.array([[0.0, 1.0], [-1.0, -0.04]]), 2.0 * math.pi / omega
    response = amplitude / complex(1.0 - omega**2, 0.04 * omega)

    def steady(t):
        turned = response * np.exp(1j * omega * t)
        return np.array([turned.real, -omega * turned.imag])

    impact -= period * round(impact / period)
    after = np.array([1.0, -restitution * speed]) - steady(impact)
    return steady(period / 2.0) + expm((period / 2.0 - impact) * generator) @ after


@pytest.mark.parametrize(
    ("kind", "omega", "start", "span", "published"),
    [
        ("fold", 0.799, (0.363, 0.034154055932653, 0.245022580357925), (0.3625, 0.3632), 0.3628362019762544),
        ("flip", 0.81, (0.36, 7.755681336950062, 0.4090970364289), (0.347, 0.362), 0.3475333988945534),
    ],
)
def test_published_bifurcations_of_an_impact_oscillator(kind, omega, start, span, published):
    """Fold and flip of the orbit of period 2 with one impact (Ghosh and Simpson, arXiv 2510.16218, its data files).

    x'' + 0.04 x' + x = A cos(w t), stop at 1, restitution 0.9; the limit of ever stiffer stops of the same restitution
    agrees with their values of A, whose multipliers miss 1 and -1 by some 1e-6.
    """
    amplitude, impact, speed = start
    values = []
    for stiffness in (1e8, 4e8, 1.6e9, 6.4e9):
        machine = oscillator(
            damping=0.02,
            stiffness=stiffness,
            contact_damping=damper_of(0.9, stiffness),
            stops="one",
            angle=-math.pi / 2.0,
            speed=omega / (2.0 * math.pi),
            force=amplitude,
        )
        state = shaken(omega, amplitude, impact, speed, 0.9)
        _, found = branch_from(machine, "drive_level", *span, state, 2, -1.0)
        values += bifurcations(found, kind)[:1]
    assert without_square_root(values) == pytest.approx(published, abs=5e-9)


def test_the_flip_of_shaw_and_holmes_in_the_limit_of_stiff_stops():
    """The orbit with one impact a cycle doubles where its closed-form multiplier is -1."""

    def multiplier(w):
        return min(RigidImpact(w, 0.0, 0.8, 0.0).one_impact_orbits()[0][2].real) + 1.0

    exact = brentq(multiplier, 2.5, 2.8)
    values = []
    for stiffness in (1e8, 4e8, 1.6e9):
        machine = oscillator(
            damping=0.0,
            stiffness=stiffness,
            contact_damping=damper_of(0.8, stiffness),
            stops="one",
            gap=0.0,
            angle=math.pi / 2.0,
            speed=2.5 / (2.0 * math.pi),
        )
        rigid = RigidImpact(2.5, 0.0, 0.8, 0.0)
        state = rigid.at_phase_zero(*rigid.one_impact_orbits()[0][:2])
        _, found = branch_from(machine, "speed", 2.4 / (2.0 * math.pi), 2.75 / (2.0 * math.pi), state, 1, 1.0)
        values += [2.0 * math.pi * value for value in bifurcations(found, "flip")[:1]]
    assert without_square_root(values) == pytest.approx(exact, abs=1e-7)


SOFT = oscillator(damping=0.02, stiffness=30.0, contact_damping=0.5, gap=0.0, speed=0.2, force=1.2, stops="one")
"""Whose orbits flip and fold within a narrow range of speed, with contacts that are long enough for any solver."""


def shoot(machine, state, period):
    """State after a period and its derivative, by DOP853 and the variational equations; events end each piece."""
    w, k, d, gap = 2.0 * math.pi * machine.speed, machine.contact_stiffness, machine.contact_damping, machine.clearance
    damping = 2.0 * 0.02
    end, t = 2.0 * math.pi * period / w, 0.0
    full = np.concatenate([state, np.eye(2).ravel()])

    def force(x, v):
        return k * (x - gap) + d * v

    pressing = state[0] > gap and force(*state) > 0.0

    def right(t, y):
        on = 1.0 if pressing else 0.0
        matrix = np.array([[0.0, 1.0], [-1.0 - on * k, -damping - on * d]])
        push = machine.drive_level * math.sin(w * t) + on * k * gap
        return np.concatenate([matrix @ y[:2] + [0.0, push], (matrix @ y[2:].reshape(2, 2)).ravel()])

    def touch(t, y):
        return y[0] - gap

    def release(t, y):
        return force(y[0], y[1])

    touch.direction, release.direction = 1.0, -1.0
    touch.terminal = release.terminal = True
    while t < end:
        event = release if pressing else touch
        run = solve_ivp(right, (t, end), full, method="DOP853", rtol=1e-13, atol=1e-14, events=event)
        t, full = float(run.t[-1]), run.y[:, -1]
        if run.status == 1:
            if not pressing:
                jump = np.array([[1.0, 0.0], [-d, 1.0]])
                full = np.concatenate([full[:2], (jump @ full[2:].reshape(2, 2)).ravel()])
            pressing = not pressing
    return full[:2], full[2:].reshape(2, 2)


def test_another_program_finds_the_same_flips_and_folds():
    """At each located value DOP853 closes the orbit to 1e-10, and its multiplier there is -1 or 1 to 1e-7.

    Left out is one fold 2e-7 from grazing: DOP853 steps over a contact that short.
    """
    diagram = follow(SOFT, "speed", (0.38, 0.45), sweep=5, workers=1)
    grazing = np.array([one.value for one in diagram.bifurcations if one.kind == "grazing"])
    checked = [
        one
        for one in diagram.bifurcations
        if one.kind in ("flip", "fold") and not one.ends and np.min(np.abs(grazing - one.value)) > 1e-6
    ]
    assert [one.kind for one in checked].count("flip") >= 4
    assert [one.kind for one in checked].count("fold") >= 1
    for one in checked:
        machine = with_settings(SOFT, {"speed": one.value})
        end, derivative = shoot(machine, one.state, one.period)
        assert end == pytest.approx(one.state, abs=1e-10)
        critical = 1.0 if one.kind == "fold" else -1.0
        assert np.min(np.abs(np.linalg.eigvals(derivative) - critical)) < 1e-7


def test_a_branch_is_the_same_from_either_end():
    """Followed forth, and back from its end, a branch has the same bifurcations to 1e-8 and no jump between orbits."""
    machine = oscillator(damping=0.02, stiffness=30.0, contact_damping=0.5, speed=0.1, force=1.2, stops="one")
    settled = simulate(machine, 1, transient=600).final_state
    _, forth = branch_from(machine, "speed", 0.1, 0.5, settled.coordinates, 1, 1.0)
    assert forth.end == "end of the range at speed = 0.5"
    other = with_settings(machine, {"speed": 0.5})
    start = simulate(other, 1, transient=600).final_state
    _, back = branch_from(other, "speed", 0.1, 0.5, start.coordinates, 1, -1.0)
    assert back.end == "end of the range at speed = 0.1"
    kinds = ("fold", "grazing")
    assert bifurcations(back, *kinds)[::-1] == pytest.approx(bifurcations(forth, *kinds), rel=1e-8)
    assert len(bifurcations(forth, *kinds)) == 6
    for found in (forth, back):
        for a, b in pairwise(found.points):
            assert np.linalg.norm(b.x - a.x) < 0.06 * max(1.0, np.linalg.norm(a.x[:-1]))


def test_the_symmetric_orbit_of_the_beam_loses_its_symmetry_and_the_other_one_flips():
    """Between 17.4 and 18.1 Hz: both ends of the symmetry breaking, and the flips that a sweep of 0.01 Hz shows."""
    diagram = follow(ImpactBeam(), "speed", (17.4, 17.8), sweep=5, workers=1, longest_period=2)
    symmetric = diagram.branches[0]
    (breaking,) = [one for one in symmetric.bifurcations if one.kind == "symmetry breaking"]
    assert breaking.loses_stability
    arm = next(branch for branch in diagram.branches if branch.begins.startswith("symmetry breaking"))
    assert arm.period == 1
    assert not np.allclose(arm.peaks[-1, 0], arm.peaks[-1, 1], rtol=1e-3)
    flips = [one.value for one in arm.bifurcations if one.kind == "flip"]
    for value in flips:
        below, above = (two_cycles_apart(value + side * 2e-4) for side in (-1.0, 1.0))
        assert min(below, above) < 1e-6 < max(below, above), value


def two_cycles_apart(frequency):
    """Largest difference of the peaks of a settled beam in two cycles, relative to a peak; from the arm's own state."""
    peaks = simulate(ImpactBeam(excitation_frequency=frequency), 2, transient=4000).peak_force
    return float(np.max(np.abs(peaks[1] - peaks[0])) / peaks.max())


@pytest.mark.parametrize(
    ("along", "span", "message"),
    [
        ("sped", (15.0, 25.0), "has no field 'sped' that varies continuously; did you mean speed"),
        ("n_modes", (3, 6), "has no field 'n_modes' that varies continuously"),
        ("speed", (25.0, 15.0), "is empty or reversed"),
        ("speed", (15.0, 1e6), "excitation_frequency = 1e.06 Hz is out of range"),
    ],
)
def test_what_cannot_be_followed_is_refused_in_one_line(along, span, message):
    """Unknown fields, whole numbers, and ranges that are reversed or leave what the machine allows."""
    with pytest.raises(ParameterError, match=message):
        follow(ImpactBeam(), along, span)
