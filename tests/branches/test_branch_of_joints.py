import numpy as np
import pytest

from chaosgym.branches.margins import margins
from chaosgym.diagnosis import find_periodic_orbit
from chaosgym.diagnosis.response_type import Tolerance
from chaosgym.machines.modal_machine import Drive, Joint, ModalMachine, Structure, machine_with_joints
from chaosgym.simulation import simulate
from tests.branches.test_branch import branch_from

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
