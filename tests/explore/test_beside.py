"""What the page says of other motions is what every command says of them."""

import pytest

import chaosgym
from chaosgym.branches.coexistence import coexistence
from chaosgym.explore.point import beside_of, check_cost, view_of
from chaosgym.machines import ImpactBeam
from tests.diagnosis.coexisting import trilinear


def test_a_rattle_beside_free_flight_is_told_with_its_share_and_its_fold():
    """Forces, shares and the ends of both motions are those of ``diagnose --margins``."""
    machine = trilinear(1.5)
    beside = coexistence(machine, chaosgym.diagnose(machine))
    told, *spans = beside_of(machine)
    flight, rattle = beside.attractors.motions
    assert flight.largest_peak == 0.0
    assert f"{rattle.words}, from {rattle.random_starts} of 48 random starts" in told
    assert "run-down from 30 Hz" in told
    assert spans == beside.lines
    assert any(line.startswith("motion 2") and line.endswith("Hz (fold)") for line in spans)


def test_a_motion_alone_is_told_with_how_far_was_looked():
    """48 starts that all come back leave 6.1 %."""
    (told,) = beside_of(ImpactBeam(excitation_frequency=10.0))
    assert "run-up from 4 Hz and run-down from 30 Hz: all came back" in told
    assert "at most 6.1% of such starts" in told


def test_what_was_not_looked_for_is_told():
    """Beside chaos no search is made; a machine that is too slow, or can't be followed, is told so; views never say."""
    assert beside_of(ImpactBeam(excitation_frequency=30.0)) == (
        "other motions: looked for only beside a motion that repeats",
    )
    stuck = ImpactBeam(excitation_frequency=0.001, n_modes=40, contact_stiffness=1e12)
    (told,) = beside_of(stuck)
    assert told.startswith("other motions: not looked for: ")
    with pytest.raises(chaosgym.SimulationError, match=r"a cycle takes .* allowed here: 0\.0 s"):
        check_cost(ImpactBeam(), 0.0)
    assert not [line for line in view_of(ImpactBeam(excitation_frequency=10.0)).lines if "other motions" in line]
