"""The search for all motions of a machine: against long runs of other starts, and what is said of it."""

import math
import os

import numpy as np
import pytest

import chaosgym
from chaosgym.diagnosis import attractors, response_type
from chaosgym.diagnosis.attractors import most_unseen, share_of
from chaosgym.diagnosis.carried import carried_states
from chaosgym.diagnosis.push import smallest_push
from chaosgym.diagnosis.shock import knock_words, smallest_shock
from chaosgym.errors import DiagnosisError
from tests.diagnosis.coexisting import (
    energy_shells,
    fresh_machine,
    fresh_shells,
    harder_machine,
    is_among,
    normal_states,
    other_motions,
    random_machine,
    rotated_machine,
    soft_stop,
    trilinear,
)
from tests.diagnosis.machine_files import held_by_friction, written

MULTISTABLE = int(os.environ.get("CHAOSGYM_MULTISTABLE", "6"))
"""Random machines with several motions on which the search is tried."""


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


def test_a_torus_beside_free_flight_is_one_motion_and_no_type_i():
    """From rest the machine never touches; most other starts end on a torus, which takes thousands of cycles to tell.

    While it is not told, its starts are unsettled, and a motion is not called safe beside them.
    """
    machine = rotated_machine(215)
    found = attractors(machine)
    flight, torus = (one for one in found.motions if one.nature in ("periodic", "quasiperiodic"))
    assert (flight.period, flight.largest_peak, torus.period) == (1, 0.0, None)
    assert torus.random_starts > 24
    judged = response_type(machine, window="speed-clearance", budget=800)
    assert judged.type == "III"
    unsure = response_type(machine, window="speed-clearance", budget=100)
    assert unsure.type != "I"


def test_orbits_that_long_chaos_ends_on_are_met():
    """All random starts are chaotic for the whole budget; after thousands of cycles some end on period 1 or 5.

    Newton's method reaches both from where the chaos nearly repeats; each is stable, so that a run from it stays.
    """
    machine = harder_machine(0)
    chaos, *orbits = attractors(machine).motions
    assert (chaos.nature, chaos.random_starts) == ("chaotic", 48)
    assert sorted(one.period for one in orbits) == [1, 5]
    assert ("near returns of a motion that does not repeat",) in [one.from_starts for one in orbits]
    for one in orbits:
        settled = chaosgym.simulate(machine, 10, one.state, transient=2000)
        assert settled.peak_force.max() == pytest.approx(one.largest_peak, rel=1e-6)


def test_neutral_motions_are_one_family(tmp_path):
    """Pressed together and held by friction, a machine rests wherever it stops: one family, not 48 motions.

    Its multiplier is 1, whatever a rounding of the model makes of its last digit.
    """
    found = attractors(chaosgym.read_machine(written(tmp_path, held_by_friction("1 N"))))
    (held,) = found.motions
    assert held.neutral
    assert (held.random_starts, found.unsettled) == (48, 0)
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


def two_modes():
    """A machine of two modes with a joint at its tip and a fan beside it, flying free beside a rattle."""
    structure = chaosgym.Structure.of_modes([1.0, 2.6], 0.04, {"tip": [1.0, 0.6], "fan": [0.3, -0.5]})
    return chaosgym.ModalMachine(
        modes=structure,
        joint="tip",
        drives=(chaosgym.Drive.sine("force", "tip", 1.5e-2),),
        speed=1.5,
        clearance=1e-3,
        contact_stiffness=200.0,
        contact_damping=0.0,
    )


def test_a_knock_at_a_named_point_leaves():
    """Knocks are tried at the joint and at the fan, by what energy each adds.

    An impulse at a point changes the velocities by phi / |phi|^2 a unit of its own velocity, and no impulse that
    gives the point this velocity takes less energy. One a percent above the smallest leaves, one below comes back.
    """
    machine = two_modes()
    knocks = machine.kinematics.unit_knocks
    assert set(knocks) == {"the joint", "point fan"}
    assert machine.kinematics.places["point fan"] @ knocks["point fan"] == pytest.approx(1.0)
    found = attractors(machine)
    assert len(found.motions) > 1
    shock = smallest_shock(machine, found, knocks=384)
    assert shock.knock.at in knocks
    begun = machine.section_at(shock.knock.phase)
    there = found.motions[0].state
    if shock.knock.phase:
        there = chaosgym.simulate(machine.section_at(0.0, shock.knock.phase), 1, there).final_state.coordinates
    peak = found.motions[0].largest_peak
    for factor in (0.99, 1.01):
        knocked = there.copy()
        knocked[2:] += factor * shock.knock.velocity * knocks[shock.knock.at]
        settled = chaosgym.simulate(begun, 4, knocked, transient=600)
        assert (settled.peak_force.max() == pytest.approx(peak, rel=1e-3, abs=1e-9)) == (factor < 1.0)


def test_the_least_push_takes_no_more_energy_than_the_least_knock():
    """Of two modes any direction is tried: the least push leaves by longer runs of its own, one 2 % smaller does not.

    Of 60 random directions at 0.8 of its size none leaves; a knock at the joint takes more energy.
    """
    machine = two_modes()
    met = attractors(machine)
    shock = smallest_shock(machine, met, knocks=384)
    push = smallest_push(machine, met, shock, pushes=384)
    assert 0.5 * sum(value**2 for value in push.change) == pytest.approx(push.energy)
    for place, velocity in push.places.items():
        assert velocity == pytest.approx(machine.kinematics.places[place] @ np.array(push.change))
    by_knock = shock.knock.velocity * machine.kinematics.unit_knocks[shock.knock.at]
    assert push.energy <= 0.5 * by_knock @ by_knock * (1.0 + 1e-9)
    begun, there = machine.section_at(push.phase), met.motions[0].state
    if push.phase:
        there = chaosgym.simulate(machine.section_at(0.0, push.phase), 1, there).final_state.coordinates
    peak = met.motions[0].largest_peak

    def comes_back(change):
        settled = chaosgym.simulate(begun, 4, there + np.append(np.zeros(2), change), transient=600)
        return settled.peak_force.max() == pytest.approx(peak, rel=1e-3, abs=1e-9)

    change = np.array(push.change)
    assert not comes_back(1.001 * change)
    assert comes_back(0.98 * change)
    aside = np.random.default_rng(3).standard_normal((60, 2))
    aside *= 0.8 * np.linalg.norm(change) / np.linalg.norm(aside, axis=1)[:, None]
    assert all(comes_back(one) for one in aside)


def multistable(count, machine_of, starts_of, most=1000):
    """Random machines of which 200 starts of another kind find several motions, each above 5 % of them."""
    left = count
    for seed in range(most):
        machine = machine_of(seed)
        starts = starts_of(machine, 200, seed)
        motions = other_motions(machine, starts[::8]) and other_motions(machine, starts)
        if motions:
            yield machine, motions
            left -= 1
        if not left:
            return


@pytest.mark.slow
@pytest.mark.parametrize(
    ("machine_of", "starts_of"),
    [
        (random_machine, energy_shells),
        (rotated_machine, normal_states),
        (harder_machine, energy_shells),
        (fresh_machine, fresh_shells),
    ],
)
def test_motions_of_random_machines_are_not_missed(machine_of, starts_of):
    """Of random machines with several motions at most one in ten has one that the search missed; none is of Type I."""
    if machine_of is fresh_machine and MULTISTABLE < 24:
        pytest.skip("of fewer than 24 one in ten is not told from one")
    missed = called_safe = 0
    for machine, motions in multistable(MULTISTABLE, machine_of, starts_of):
        found = attractors(machine, carried=carried_states(machine))
        missed += not all(is_among(one, found) for one in motions)
        judged = response_type(machine, window="speed-clearance", budget=800)
        peaks = [one.peak for one in motions if one.period]
        differ = len(peaks) < len(motions) or max(peaks) > 1.1 * min(peaks)
        called_safe += differ and judged.type == "I"
    print(f"{machine_of.__name__}: of {MULTISTABLE} machines with several motions {missed} have one that was missed")
    assert called_safe == 0
    assert missed <= 0.1 * MULTISTABLE
