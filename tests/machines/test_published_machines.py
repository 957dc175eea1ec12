"""Machines that other people published, each a file in docs/machines, against what they published of them."""

import math
from pathlib import Path

import numpy as np
import pytest

import chaosgym
from benchmarks.published import in_scipy, no_separation, orbit_diagram
from chaosgym.diagnosis import diagnose
from chaosgym.machines.contact_law import restitution_of
from chaosgym.machines.modal_machine.drive import Drive
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.machines.parameters import with_settings

FOLDER = Path(__file__).parents[2] / "docs" / "machines"


def machine(name):
    """Machine of a file, at its own speed."""
    return chaosgym.read_machine(FOLDER / f"{name}.toml")


def impact_oscillator(ratio, restitution=0.8):
    """Speed V of the impact, and trace of the derivative of a cycle, of x'' + x = cos(w t) below a rigid stop at 0.

    Between impacts x is the steady motion p cos(w t), p = 1 / (1 - w^2), and a free one; one impact a cycle returns to
    itself if the first is V (1 + r) s / 2 (1 - c) and its rate V (1 - r) / 2, with c, s of the angle 2 pi / w.
    """
    c, s = math.cos(2.0 * math.pi / ratio), math.sin(2.0 * math.pi / ratio)
    amplitude = abs(1.0 / (1.0 - ratio**2))
    push = (1.0 + restitution) * s / (2.0 * (1.0 - c))
    speed = amplitude / math.hypot(push, (1.0 - restitution) / (2.0 * ratio))
    trace = -2.0 * restitution * c + (1.0 + restitution) ** 2 * (1.0 - ratio**2) * (1.0 + c) / 2.0
    return speed, trace


def struck(stop):
    """Duration [s] and largest force over speed [N s/m] of an impact of 1 kg on a stop with z = cos(a) below 1/2.

    N = v w / sin(a) exp(-z w t) sin(2 a - w t sin(a)) ends at w t sin(a) = 2 a and is largest at 3 a - pi (Schwager and
    Poeschel, Granular Matter 9 (2007) 465-469).
    """
    rate = math.sqrt(stop.contact_stiffness)
    ratio = stop.contact_damping / (2.0 * rate)
    angle = math.acos(ratio)
    return 2.0 * angle / math.sin(angle) / rate, rate * math.exp(-ratio * (3.0 * angle - math.pi) / math.sin(angle))


def test_the_stop_of_the_impact_oscillator_restores_as_published():
    """Spring and damper of the stop restore 0.8 of the speed, in a contact of a two-thousandth of a cycle."""
    given = machine("shaw-holmes-1983")
    ratio = given.contact_damping / (2.0 * math.sqrt(given.contact_stiffness))
    assert restitution_of(ratio) == pytest.approx(0.8, abs=1e-5)
    assert struck(given)[0] < 1e-3


@pytest.mark.parametrize("ratio", [2.2, 2.4, 2.63])
def test_period_one_orbit_of_shaw_and_holmes(ratio):
    """Below the doubling, one impact a cycle, with the force of the closed form and its Floquet multipliers."""
    found = machine("shaw-holmes-1983").at(ratio)
    verdict = diagnose(found, budget=800)
    assert (verdict.nature, verdict.period, verdict.status) == ("periodic", 1, "certified")
    speed, trace = impact_oscillator(ratio)
    static = 1.0 / (2.0 * math.pi) ** 2
    expected = struck(found)[1] * speed * static * 2.0 * math.pi
    assert verdict.judged.peak_force[-1, 0] == pytest.approx(expected, rel=0.01)
    radius = max(abs(np.roots([1.0, -trace, 0.64])))
    assert verdict.evidence["orbit"]["largest_multiplier"] == pytest.approx(radius, rel=0.02)


def test_period_doubling_and_chaos_of_the_impact_oscillator():
    """Where the closed form's multiplier is -1, at a ratio of 2.653, period 1 gives way to period 2, then to chaos."""
    low, high = 2.5, 2.8
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if impact_oscillator(middle)[1] > -1.64 else (low, middle)
    assert low == pytest.approx(2.653, abs=1e-3)
    before, after = (
        orbit_diagram(machine("shaw-holmes-1983"), np.array([low - 0.05, low + share])) for share in (-0.01, 0.01)
    )
    assert np.ptp(before[-1]) < 0.002 * before[-1].mean()
    assert np.ptp(after[-1][::2]) < 0.002 * after[-1].mean() < np.ptp(after[-1])
    # from 2.88 on the mass may stay at its stop, which ends the chaos on a long orbit, sooner or later
    assert diagnose(machine("shaw-holmes-1983").at(2.85), budget=800).nature == "chaotic"


def two_sided(ratio, gap, restitution=0.8):
    """Speed V of the impacts, and largest multiplier of a cycle, of x'' + x = cos(w t) between rigid stops at +-gap.

    In the symmetric motion half a cycle, from one stop to the other, turns every sign. With p = 1 / (1 - w^2) and c, s
    of pi / w, the steady motion is gap - k V at the impact, k = (1 + r) s / 2 (1 + c), and its rate (1 - r) V / 2.
    """
    c, s = math.cos(math.pi / ratio), math.sin(math.pi / ratio)
    steady = 1.0 / (1.0 - ratio**2)
    push, rate = (1.0 + restitution) * s / (2.0 * (1.0 + c)), (1.0 - restitution) / (2.0 * ratio)
    square = push**2 + rate**2
    speed = (gap * push + math.sqrt((gap * push) ** 2 - square * (gap**2 - steady**2))) / square
    pull = gap - (gap - push * speed) / steady
    trace = -2.0 * restitution * c + (1.0 + restitution) * pull / speed * s
    return speed, max(abs(np.roots([1.0, -trace, restitution**2]))) ** 2


@pytest.mark.parametrize(("ratio", "gap"), [(0.8, 1.0), (1.2, 1.0), (1.5, 1.0), (1.8, 0.5)])
def test_symmetric_orbit_between_two_stops(ratio, gap):
    """One impact on either side in a cycle, with force and multiplier of the closed form; gap in static units."""
    static = 1.0 / (2.0 * math.pi) ** 2
    settings = {"stops": "two", "clearance": gap * static}
    found = with_settings(machine("shaw-holmes-1983").at(ratio), settings)
    verdict = diagnose(found, budget=800)
    assert (verdict.nature, verdict.period, verdict.status) == ("periodic", 1, "certified")
    assert verdict.judged.impacts[-1].tolist() == [1, 1]
    speed, multiplier = two_sided(ratio, gap)
    expected = struck(found)[1] * speed * static * 2.0 * math.pi
    np.testing.assert_allclose(verdict.judged.peak_force[-1], expected, rtol=2e-3)
    assert verdict.evidence["orbit"]["largest_multiplier"] == pytest.approx(multiplier, rel=0.01)


@pytest.mark.parametrize("stops", ["one", "two"])
def test_contact_begins_by_grazing(stops):
    """Contact begins where the amplitude of the linear response, damped by 5 %, equals the gap."""
    still = chaosgym.ModalMachine(
        modes=Structure.of_modes([1.0], 0.05, {"mass": [1.0]}),
        joint="mass",
        drives=(Drive.sine("force", "mass", 1.0),),
        speed=1.3,
        stops=stops,
        contact_stiffness=4e7,
        contact_damping=940.526,
    )
    amplitude = 1.0 / (2.0 * math.pi) ** 2 / math.hypot(1.0 - 1.3**2, 2.0 * 0.05 * 1.3)
    lag, omega = math.atan2(2.0 * 0.05 * 1.3, 1.0 - 1.3**2), 2.0 * math.pi * 1.3
    steady = [-amplitude * math.sin(lag), amplitude * omega * math.cos(lag)]
    for share, touches in ((1.0005, False), (0.9995, True)):
        record = chaosgym.simulate(with_settings(still, {"clearance": share * amplitude}), 40, steady)
        assert record.impacts.any() == touches


def test_the_same_orbit_in_scipy():
    """DOP853 with events comes to the peak force of the period-1 orbit that exact propagation finds."""
    given = machine("shaw-holmes-1983").at(2.4)
    peaks, _ = in_scipy(given, 60)
    own = chaosgym.simulate(given, 60).peak_force[:, 0]
    np.testing.assert_allclose(peaks[1:20], own[1:20], rtol=1e-4)


def test_gear_pair_in_mesh_is_the_linear_oscillator():
    """Kahraman and Singh: where no tooth separates, below 0.8 and above 1.42 of the mesh frequency, it is linear."""
    gears = machine("kahraman-singh-1990")
    speeds = np.array([400.0, 500.0, 600.0, 1500.0, 1550.0])
    expected = no_separation(gears, speeds)
    found = [chaosgym.simulate(gears.at(speed), 20, transient=300).peak_force[-1, 0] for speed in speeds]
    assert np.isfinite(expected).all()
    np.testing.assert_allclose(found, expected, rtol=1e-3)
    assert np.isnan(no_separation(gears, np.array([850.0, 1000.0, 1400.0]))).all()


def test_gear_pair_jumps():
    """Kahraman and Singh: with separation the resonance bends to lower speeds, and two motions coexist below it."""
    gears = machine("kahraman-singh-1990")
    up, down = np.arange(650.0, 801.0, 10.0), np.arange(1000.0, 649.0, -10.0)
    rising = dict(zip(up, orbit_diagram(gears, up), strict=True))
    falling = dict(zip(down, orbit_diagram(gears, down), strict=True))
    apart = [speed for speed in up if falling[speed].max() > 1.5 * rising[speed].max()]
    assert min(apart) == pytest.approx(720.0, abs=20.0)
    assert falling[740.0].max() > 2.0 * rising[740.0].max()
    assert falling[650.0].max() == pytest.approx(rising[650.0].max(), rel=0.01)


def test_gear_pair_has_a_subharmonic():
    """Kahraman and Singh: at the published load ratio a subharmonic of order two coexists near 1.6 times the mesh."""
    verdict = diagnose(machine("kahraman-singh-1990").at(1600.0), budget=800)
    assert (verdict.nature, verdict.period) == ("periodic", 2)


@pytest.mark.parametrize("name", ["moon-shaw-1983", "heat-exchanger-tube"])
def test_beams_at_a_stop_are_chaotic_in_bands(name):
    """Moon and Shaw, Paidoussis and Li: chaotic rattling in bands of speed, with periodic motion between them."""
    low, high = machine(name).usual_ranges["speed"]
    natures = [diagnose(machine(name).at(speed), budget=400).nature for speed in np.linspace(low, high, 10)]
    assert natures.count("chaotic") >= 3
    assert natures.count("periodic") >= 1


def test_the_cantilever_is_eulers():
    """Frequencies, tip shapes and participations of the shaken cantilever are those of its dimensions."""
    length, mass = 0.2, 7850.0 * 12e-3 * 1e-3
    rate = math.sqrt(2.1e11 * 12e-3 * 1e-9 / 12.0 / mass) / length**2 / (2.0 * math.pi)
    roots = np.array([1.8751040687, 4.6940911330, 7.8547574382])
    beam = machine("moon-shaw-1983")
    np.testing.assert_allclose(beam.natural_frequencies, rate * roots**2, rtol=2e-3)
    np.testing.assert_allclose(np.abs(beam.modes.shape("tip")), 2.0 / math.sqrt(mass * length), rtol=1e-3)
    shares = np.array([0.7830, 0.4339, 0.2544]) * math.sqrt(mass * length)
    np.testing.assert_allclose(beam.modes.shape("base"), shares, rtol=5e-3)


def test_the_tube_is_a_pinned_beam():
    """Frequencies and shapes of the tube are those of a pinned beam of its dimensions."""
    outer, inner, length = 16e-3, 13.6e-3, 1.0
    mass = 7850.0 * math.pi / 4.0 * (outer**2 - inner**2)
    bending = 2.0e11 * math.pi / 64.0 * (outer**4 - inner**4)
    order = np.arange(1, 5)
    tube = machine("heat-exchanger-tube")
    expected = (order * math.pi / length) ** 2 * math.sqrt(bending / mass) / (2.0 * math.pi)
    np.testing.assert_allclose(tube.natural_frequencies, expected, rtol=2e-3)
    for place, share in (("baffle", 0.5), ("span", 0.25)):
        shape = math.sqrt(2.0 / (mass * length)) * np.sin(order * math.pi * share)
        np.testing.assert_allclose(tube.modes.shape(place), shape, atol=2e-3)
