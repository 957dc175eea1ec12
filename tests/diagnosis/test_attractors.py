"""The search for all motions of a machine: against long runs of other starts, other integrators and published cases."""

import math
import os

import numpy as np
import pytest

import chaosgym
from benchmarks.published import no_separation
from chaosgym.diagnosis import attractors, response_type
from chaosgym.diagnosis.attractors import Mapper, most_unseen, share_of
from chaosgym.diagnosis.carried import carried_states
from chaosgym.diagnosis.shock import knock_words, smallest_shock
from chaosgym.errors import DiagnosisError
from tests.branches.test_branch import oscillator
from tests.diagnosis.coexisting import energy_shells, is_among, other_motions, random_machine

MULTISTABLE = int(os.environ.get("CHAOSGYM_MULTISTABLE", "3"))
"""Random machines with several motions on which the search is tried."""

RATIO = 1.0 / (2.0 * math.pi)


def trilinear(ratio):
    """Between elastic stops five times as stiff as the spring, damping 4 %, at a multiple of its natural frequency."""
    return oscillator(damping=0.04, stiffness=5.0, speed=ratio * RATIO, force=0.4)


def soft_stop(ratio):
    """One stop 29 times as stiff as the spring, damping 1 %, turned by an unbalance that grows with the square."""
    return oscillator(
        damping=0.01,
        stiffness=29.0,
        stops="one",
        gap=1.26,
        speed=ratio * RATIO,
        force=0.7 * ratio**2,
        angle=math.pi / 2.0,
    )


def test_bounds_of_shares_are_exact():
    """Clopper and Pearson: the binomial probability of as few, or as many, is what the confidence leaves."""
    from scipy.stats import binom

    assert most_unseen(0, 48) == pytest.approx(1.0 - 0.05 ** (1.0 / 48.0))
    assert binom.cdf(3, 48, most_unseen(3, 48)) == pytest.approx(0.05)
    _, low, high = share_of(12, 48)
    assert binom.sf(11, 48, low) == pytest.approx(0.025)
    assert binom.cdf(12, 48, high) == pytest.approx(0.025)
    assert share_of(0, 10)[1] == 0.0
    assert share_of(10, 10)[2] == 1.0


@pytest.mark.parametrize("ratio", [1.3, 1.5, 1.7, 1.88])
def test_a_rattle_beside_free_flight_is_found(ratio):
    """The jump of a gap: a resonance that bends to higher speeds has a rattle beside the motion without contact."""
    machine = trilinear(ratio)
    found = attractors(machine, carried=carried_states(machine))
    flight, rattle = found.motions
    assert (flight.period, flight.largest_peak) == (1, 0.0)
    assert rattle.period == 1
    assert rattle.largest_peak > 0.0
    judged = response_type(machine, window="speed-clearance", budget=400)
    assert judged.type == "III"
    assert judged.coexists
    assert "another initial state leads to" in judged.reason


def test_a_motion_that_rest_and_run_ups_miss_is_found():
    """At 0.7345 times its natural frequency the soft stop has a motion of period 2, which takes many of the starts."""
    machine = soft_stop(0.7345)
    found = attractors(machine)
    (other,) = found.motions[1:]
    assert other.period == 2
    # forces scale with stiffness: 0.1735 N at 1144.887 / 29 N/m and millimetres
    assert other.largest_peak * 1144.887 / 29.0 * 1e-3 == pytest.approx(0.1735, abs=5e-4)
    settled = chaosgym.simulate(machine, 4, other.state, transient=2000)
    assert settled.peak_force.max() == pytest.approx(other.largest_peak)


def test_every_start_is_counted_and_the_search_is_cheap():
    """Shares and what is unsettled make up all starts; the runs are much shorter than the budget for each of them."""
    machine = soft_stop(0.8)
    found = attractors(machine, budget=1600, carried=carried_states(machine))
    assert sum(one.random_starts for one in found.motions) + found.unsettled == found.starts == 48
    assert found.cycles < 0.6 * 1600 * (found.starts + 4)
    assert found.unseen == most_unseen(found.unsettled, 48)
    again = attractors(machine, budget=1600, carried=carried_states(machine), workers=1)
    assert again.as_dict() == found.as_dict()


def test_what_is_said_tells_how_far_was_looked():
    """Words of a machine with one motion, of one with two, and without random starts."""
    alone, beside = trilinear(1.95), trilinear(1.5)
    assert attractors(alone).searched == (
        "48 random starts up to 3 gaps: all came back; another motion takes at most 6.1% of such starts (95 %)"
    )
    found = attractors(beside, carried=carried_states(beside))
    assert "run-down from 30 Hz" in found.searched
    (other,) = found.other_motions
    assert other.startswith("periodic, period 1, up to 3.6")
    assert "of 48 random starts (" in other
    assert "random starts were not tried" in attractors(beside, starts=0).searched
    with pytest.raises(DiagnosisError, match="starts = -1 is out of range"):
        attractors(beside, starts=-1)


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

    def change(t, x, v):
        return -0.04 * v - x - 20.0 * np.maximum(x - 0.63, 0.0) + 0.5 * np.cos(ratio * t)

    steps, cycles = 500, 120
    h, (x, v), largest = 2.0 * np.pi / ratio / steps, starts.T.copy(), np.full(count, -np.inf)
    for step in range(steps * cycles):
        t = h * (step % steps)
        a1, b1 = v, change(t, x, v)
        a2, b2 = v + 0.5 * h * b1, change(t + 0.5 * h, x + 0.5 * h * a1, v + 0.5 * h * b1)
        a3, b3 = v + 0.5 * h * b2, change(t + 0.5 * h, x + 0.5 * h * a2, v + 0.5 * h * b2)
        a4, b4 = v + h * b3, change(t + h, x + h * a3, v + h * b3)
        x, v = x + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4), v + h / 6.0 * (b1 + 2.0 * b2 + 2.0 * b3 + b4)
        if step >= steps * (cycles - 4):
            largest = np.maximum(largest, x)
    assert np.mean((largest > 0.63) == (place == 0)) > 0.97


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


def test_neutral_motions_are_one_family(tmp_path):
    """Pressed together and held by friction, a machine rests wherever it stops: one family, not 48 motions.

    Its multiplier is 1, and a rounding of the model decides whether a start on it is proven to stay. One that is not is
    told as unsettled, and never as a motion of its own.
    """
    file = tmp_path / "held.toml"
    file.write_text(
        '[structure]\nfrequencies = "5, 20 Hz"\ndamping_ratios = 0.02\nmodal_masses = "1, 1 kg"\n'
        '[structure.shapes]\nacross = "1, 0.2"\nalong = "0.1, 1"\n'
        '[joint]\nat = "across"\nclearance = "0.1 mm"\nstops = "one"\nstiffness = "1 N/um"\n'
        'damping = "100 N s/m"\npreload = "50 N"\nfriction = 0.9\ntangent = "along"\n'
        '[[drive]]\nat = "along"\nforce = "1 N"\n'
        '[operation]\nspeed = "9 Hz"\nspeed_range = "4 to 20 Hz"\nclearance_range = "0.05 to 0.3 mm"\n'
    )
    found = attractors(chaosgym.read_machine(file))
    (held,) = found.motions
    assert held.neutral
    assert held.random_starts >= 1
    assert held.random_starts + found.unsettled == 48
    assert "neutral" in held.words


def test_the_smallest_knock_leaves_and_a_smaller_one_does_not():
    """A knock a percent above the smallest leads to the other motion, one a percent below comes back."""
    machine = trilinear(1.5)
    found = attractors(machine)
    shock = smallest_shock(machine, found, knocks=200)
    assert shock.knock is not None
    assert shock.leads_to == 1
    assert knock_words(machine, shock.knock).startswith("a knock of ")
    rate = 2.0 * math.pi * machine.speed
    time = shock.knock.phase / machine.speed
    response = 0.4 / complex(1.0 - rate**2, 0.08 * rate)
    flight = [(response * np.exp(1j * rate * time)).imag, (rate * response * np.exp(1j * rate * time)).real]
    for factor, peak in ((1.01, found.motions[1].largest_peak), (0.99, 0.0)):
        knocked = np.array([flight[0], flight[1] + factor * shock.knock.velocity])
        begun = machine.section_at(shock.knock.phase)
        settled = chaosgym.simulate(begun, 4, knocked, transient=400)
        assert settled.peak_force.max() == pytest.approx(peak, rel=1e-6)


def multistable(count, most=1000):
    """Random machines of which 200 starts from energy shells find several motions, each above 5 % of them."""
    left = count
    for seed in range(most):
        machine = random_machine(seed)
        motions = other_motions(machine, energy_shells(machine, 200, seed))
        if motions:
            yield machine, motions
            left -= 1
        if not left:
            return


@pytest.mark.slow
def test_motions_of_random_machines_are_not_missed():
    """Of random machines with several motions at most one in ten has one that the search missed; none is of Type I."""
    missed = called_safe = 0
    for machine, motions in multistable(MULTISTABLE):
        found = attractors(machine, carried=carried_states(machine))
        missed += not all(is_among(one, found) for one in motions)
        judged = response_type(machine, window="speed-clearance", budget=800)
        peaks = [one.peak for one in motions if one.period]
        differ = len(peaks) < len(motions) or max(peaks) > 1.1 * min(peaks)
        called_safe += differ and judged.type == "I"
    assert missed <= 0.1 * MULTISTABLE
    assert called_safe == 0
