"""Calm speeds along a bifurcation diagram: every motion counts, not the one from rest alone."""

import numpy as np
import pytest

import chaosgym
from chaosgym.branches.calm import calm_along
from chaosgym.branches.diagram_search import follow
from tests.branches.test_branch import oscillator
from tests.diagnosis.coexisting import RATIO, soft_stop, trilinear
from tests.diagnosis.machine_files import RUBBING_TUBE, written

FOLD = 1.90683
"""Where the rattle of ``trilinear`` ends, in natural frequencies: by a shooting method of another program."""

BEGINS = 1.17834
"""Where free flight begins to be stable beside it, likewise."""


def test_no_speed_is_calm_within_its_tolerance_of_a_rattle():
    """From rest the machine never touches a stop; a rattle that few starts reach lives up to its fold."""
    diagram = follow(trilinear(1.9), "speed", (1.80 * RATIO, 2.0 * RATIO), sweep=40)
    calm = calm_along(diagram)
    (only,) = calm.ranges
    tolerance = 1.02
    step = 0.2 / 39.0
    assert only.low / RATIO == pytest.approx(tolerance * FOLD, abs=1.5 * step)
    assert only.high == pytest.approx(2.0 * RATIO)
    assert calm.margin is None


def test_between_wide_steps_a_motion_that_repeats_has_no_type_and_the_count_that_tells_is_named():
    """Neighbours further apart than a tolerance say nothing of it."""
    machine = oscillator(damping=0.2, stiffness=5.0, speed=1.9 * RATIO, force=0.1)
    calm = calm_along(follow(machine, "speed", (1.5 * RATIO, 2.0 * RATIO), sweep=3, starts=0))
    assert (calm.ranges, calm.unknown) == ((), 3)
    count = int(calm.settled_by.partition("; ")[2].partition(" ")[0])
    fine = calm_along(follow(machine, "speed", (1.5 * RATIO, 2.0 * RATIO), sweep=count, starts=0))
    assert fine.unknown == 0


def test_other_fields_tell_nothing():
    """The damping is no field with a range of speeds."""
    machine = oscillator(damping=0.2, stiffness=5.0, speed=1.9 * RATIO, force=0.1)
    assert calm_along(follow(machine, "contact_damping", (0.0, 0.1), sweep=3, starts=0)) is None


def test_two_motions_of_one_folded_branch_have_shares_of_their_own():
    """Free flight and rattle lie on one branch; each has its stable stretch, and the folds between them end both.

    Near the fold no start meets the rattle, but its branch tells of it.
    """
    diagram = follow(trilinear(1.5), "speed", (1.1 * RATIO, 2.1 * RATIO), sweep=11)
    (branch,) = diagram.branches
    flight, rattle = sorted(branch.stretches, key=lambda one: one.peaks.max())
    assert rattle.values.max() / RATIO == pytest.approx(FOLD, abs=1e-4)
    assert flight.values.min() / RATIO == pytest.approx(BEGINS, abs=1e-4)
    assert flight.values.max() / RATIO == pytest.approx(2.1)
    for point in diagram.sweep:
        ratio = point.value / RATIO
        assert sum(one.share for one in point.motions) == pytest.approx(1.0)
        assert len(point.motions) == len({one.place for one in point.motions}) == (2 if BEGINS < ratio < FOLD else 1)
        rattling = [one for one in point.motions if one.largest_peak > 0.0]
        assert all(one.largest_peak == pytest.approx(rattle.peaks_at(point.value)[0], rel=0.01) for one in rattling)
    shares = [[one.share for one in point.motions if one.largest_peak > 0.0] for point in diagram.sweep]
    assert shares[2][0] > 0.4
    assert shares[8] == [0.0]


def test_motions_that_mirror_each_other_are_of_one_force(tmp_path):
    """A tube in three loose supports settles on one of two mirrored motions: they share a branch, and are Type I."""
    machine = chaosgym.read_machine(written(tmp_path, RUBBING_TUBE))
    diagram = follow(machine, "speed", (39.9, 40.1), sweep=2)
    (branch,) = diagram.branches
    assert branch.stable.all()
    for point in diagram.sweep:
        assert len(point.motions) == 2
        assert {one.place for one in point.motions} == {(1, 1)}
        assert point.motions[0].largest_peak == pytest.approx(point.motions[1].largest_peak, rel=1e-6)
    (calm,) = calm_along(diagram).ranges
    assert (calm.low, calm.high) == (39.9, 40.1)


def test_a_stable_run_of_a_closed_branch_does_not_end_where_it_was_begun():
    """The period-5 orbits of a soft stop form a loop, stable from a flip to a fold on either side of the seed."""
    diagram = follow(soft_stop(0.8), "speed", (0.74 * RATIO, 0.82 * RATIO), sweep=5)
    (loop,) = (one for one in diagram.branches if any(end.startswith("closed") for end in one.ends) and one.period == 5)
    (run,) = (one for one in loop.stretches if np.ptp(one.values) > 0.005 * RATIO)
    assert run.values.min() < 0.8 * RATIO < run.values.max()
    ends = [one.value for one in loop.bifurcations if one.loses_stability]
    assert run.values.min() in ends
    assert run.values.max() in ends
