from dataclasses import replace

import numpy as np
import pytest

import chaosgym
from chaosgym.branches import orbit_family
from chaosgym.branches.chord import change_of_contacts
from chaosgym.branches.family_along import family_of
from chaosgym.branches.margins import margins, margins_of
from chaosgym.diagnosis import diagnose, find_periodic_orbit
from chaosgym.diagnosis.response_type import Tolerance
from chaosgym.machines.modal_machine import Drive, Joint, ModalMachine, Structure, machine_with_joints
from chaosgym.machines.parameters import with_settings
from chaosgym.simulation import simulate
from tests.branches.test_branch import branch_from
from tests.diagnosis.machine_files import TWO_PINS, written

STRUCTURE = Structure.of_modes([9.0, 31.0], 0.02, {"middle": [2.1, -1.9], "end": [1.2, 0.8]})
DRIVES = (Drive.sine("force", "end", 8.9),)
GAP, SPRING, DAMPER = 1e-3, 4e4, 10.0

ONE = ModalMachine(
    modes=STRUCTURE,
    joint="middle",
    drives=DRIVES,
    clearance=GAP,
    contact_stiffness=SPRING,
    contact_damping=DAMPER,
    stops="one",
    speed=8.0,
)
TWO = machine_with_joints(
    STRUCTURE,
    {"near": Joint("middle", GAP, SPRING, DAMPER, stops="one"), "far": Joint("end", 1.0, SPRING, DAMPER)},
    DRIVES,
)(speed=8.0)


def settled(machine):
    """State after many cycles from rest."""
    return simulate(machine, 1, transient=400).final_state.coordinates


def test_a_joint_that_is_never_touched_changes_no_branch():
    """Tables of sets of pressed surfaces and the kernel of one gap follow the same orbits to the same bifurcations."""
    found = []
    for machine in (ONE, TWO):
        _, one = branch_from(machine, "speed", 7.0, 9.5, settled(machine), 1, 1.0)
        found.append([(each.bifurcation.kind, each.bifurcation.value) for each in one.found])
        assert one.end == "end of the range at speed = 9.5"
    assert [kind for kind, _ in found[0]] == [kind for kind, _ in found[1]]
    assert found[0]
    assert [value for _, value in found[1]] == pytest.approx([value for _, value in found[0]], rel=1e-8)


def test_margins_of_several_joints_are_those_of_one():
    """The margin of speed and of the near joint's gap is the same whether or not there is a far joint."""
    results = []
    for machine, gap in ((ONE, "clearance"), (TWO, "near_clearance")):
        orbit = find_periodic_orbit(machine, settled(machine), 1)
        found = margins(machine, orbit, {"speed": Tolerance(0.1), gap: Tolerance(0.2)})
        results.append([(margin.side, margin.share, margin.kind) for margin in found.margins])
    for one, two in zip(*results, strict=True):
        assert one[::2] == two[::2]
        assert two[1] == pytest.approx(one[1], rel=1e-6)
    assert np.isfinite(results[0][0][1])


def test_orbits_of_worn_pins_are_found_with_one_derivative_each(tmp_path, monkeypatch):
    """From an orbit nearby Broyden's method leads to the orbit that Newton's method finds, by fewer derivatives.

    Where the multipliers are not asked for it takes none.
    """
    pump = chaosgym.read_machine(written(tmp_path, TWO_PINS))
    orbit = diagnose(pump).orbit
    derivatives, honest = [], orbit_family.period_map
    monkeypatch.setattr(orbit_family, "period_map", lambda *a: derivatives.append(a) or honest(*a))
    family = family_of(pump, "speed", 600.0, 1200.0, orbit.state, 1)
    here = family.solve(np.append(family.weight * orbit.state, 0.5), np.append(np.zeros(8), 1.0))
    guess = here.x + 0.01 * here.tangent
    derivatives.clear()
    far = family.solve(guess, here.tangent, here.slope)
    newton = len(derivatives)
    derivatives.clear()
    near = family.solve(guess, here.tangent, here.slope, near=(here.solved,))
    assert len(derivatives) == 1 < newton
    derivatives.clear()
    learned = family.solve(guess, here.tangent, here.slope, near=(here.solved,), measured=False)
    assert (len(derivatives), learned.measured) == (0, False)
    assert np.max(np.abs(learned.x - near.x)) < 1e-9
    assert family.measured(learned).largest_multiplier == pytest.approx(near.largest_multiplier, rel=1e-6)
    assert np.max(np.abs(near.x - far.x)) < 1e-9
    assert near.largest_multiplier == pytest.approx(far.largest_multiplier, rel=1e-5)
    ran = simulate(pump.at(speed=family.value(near.x[-1])), 1, family.state(near.x))
    assert ran.final_state.coordinates == pytest.approx(family.state(near.x), rel=1e-6, abs=1e-9)


def test_tangents_beside_a_change_of_contacts_point_along_the_branch(tmp_path, monkeypatch):
    """One that was learned backwards there is turned: else the branch seems to turn back, and a fold is sought in vain.

    At 1050 rpm the pump has a contact that it has not at 975 rpm.
    """
    pump = chaosgym.read_machine(written(tmp_path, TWO_PINS))
    found = [diagnose(pump.at(speed=speed)).orbit for speed in (975.0, 1050.0)]
    family = family_of(pump, "speed", 600.0, 1200.0, found[0].state, 1)
    up = np.append(np.zeros(8), 1.0)
    places = [(value - 600.0) / 600.0 for value in (975.0, 1050.0)]
    a, b = (family.solve(np.append(family.weight * o.state, s), up) for o, s in zip(found, places, strict=True))
    assert a.impacts != b.impacts
    while b.x[-1] - a.x[-1] > 2e-3:
        middle = family.solve(0.5 * (a.x + b.x), up)
        a, b = (middle, b) if middle.impacts == a.impacts else (a, middle)
    honest = orbit_family.OrbitFamily.measured

    def backwards(self, point, **options):
        answer = honest(self, point, **options)
        return replace(answer, tangent=-answer.tangent)

    monkeypatch.setattr(orbit_family.OrbitFamily, "measured", backwards)
    before, after = change_of_contacts(family, a, b, 1e-3)
    assert before.impacts == a.impacts
    assert np.dot(before.tangent, before.x - a.x) > 0.0
    assert np.dot(after.tangent, b.x - after.x) > 0.0


def test_margins_of_worn_pins_hold_where_they_end(tmp_path, monkeypatch):
    """The pump stays of period 1 throughout its tolerances: from rest at each end it settles on an orbit that attracts.

    That takes few derivatives of the map, each of which is some five runs.
    """
    pump = chaosgym.read_machine(written(tmp_path, TWO_PINS))
    derivatives, honest = [], orbit_family.period_map
    monkeypatch.setattr(orbit_family, "period_map", lambda *a: derivatives.append(a) or honest(*a))
    found = margins_of(pump, diagnose(pump))
    assert [margin.kind for margin in found.margins] == [None] * 6
    assert all(margin.share == pytest.approx(1.0) for margin in found.margins)
    assert len(derivatives) < 400
    for margin in found.margins:
        there = diagnose(with_settings(pump, {margin.parameter: margin.value}))
        assert (there.period, there.status) == (1, "certified")
