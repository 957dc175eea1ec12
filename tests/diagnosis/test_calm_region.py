"""Where a grid of types is calm: the sentence that a designer comes for."""

import numpy as np
import pytest

from chaosgym import ImpactBeam
from chaosgym.diagnosis import calm_region
from chaosgym.errors import DiagnosisError
from tests.branches.test_branch import oscillator

SPEEDS, CLEARANCES = [10.0, 11.0, 12.0, 13.0], [1e-4, 2e-4, 3e-4]
TYPES = np.array([["I", "I", "I"], ["I", "I", "II"], ["I", "III", "III"], ["I", "I", "undetermined"]])
BEAM = ImpactBeam(excitation_frequency=10.5, clearance=2.1e-4)


def test_every_clearance_below_the_largest_is_calm_at_every_speed() -> None:
    """One failing speed ends the region, even where larger clearances pass at other speeds."""
    found = calm_region(BEAM, SPEEDS, CLEARANCES, TYPES)
    assert found.largest_clearance == 1e-4
    assert found.failure == (2e-4, 12.0, "III")
    assert found.unknown == 1


def test_ranges_are_those_at_the_machines_own_clearance() -> None:
    """A single calm speed between two others is a range of its own."""
    found = calm_region(BEAM, SPEEDS, CLEARANCES, TYPES)
    assert found.at_clearance == 2e-4
    assert found.ranges == ((10.0, 11.0), (13.0, 13.0))
    assert found.margin == pytest.approx(0.5 / 10.5)


def test_the_order_of_the_grid_does_not_matter() -> None:
    """Rows and columns may come in any order."""
    order, up = [2, 0, 3, 1], [1, 2, 0]
    mixed = calm_region(BEAM, np.array(SPEEDS)[order], np.array(CLEARANCES)[up], TYPES[np.ix_(order, up)])
    assert mixed == calm_region(BEAM, SPEEDS, CLEARANCES, TYPES)


def test_lines_tell_half_the_play_the_first_failure_and_the_steps() -> None:
    """The reader learns which clearance is meant, where it fails, and how coarse the grid is."""
    clearance, speed, looked = calm_region(BEAM, SPEEDS, CLEARANCES, TYPES).lines
    assert clearance == (
        "up to a clearance of 0.1 mm (half of the play; the play is 0.2 mm), every speed of the grid from 10 to 13 Hz "
        "is Type I from rest; at the next, 0.2 mm, 12 Hz is Type III; its own, 0.21 mm, is above "
        "that"
    )
    assert speed == (
        "at a clearance of 0.2 mm, Type I from rest at 10 to 11 Hz, 13 Hz (steps up to 1 Hz); its own speed, 10.5 Hz, "
        "is 4.8% from an end of them"
    )
    assert looked == "each point is judged by runs from rest alone; other initial states were not tried"


def test_nothing_calm_and_everything_calm_are_said() -> None:
    """Neither extreme reads as if a limit had been found."""
    none = calm_region(BEAM, SPEEDS, CLEARANCES, np.full((4, 3), "III"))
    assert (none.largest_clearance, none.ranges, none.margin) == (None, (), None)
    assert "no clearance of the grid" in none.lines[0]
    assert "no speed of the grid is Type I" in none.lines[1]
    unknown = calm_region(BEAM, [9.0, 10.0], [1e-4], np.array([["II"], ["undetermined"]]))
    assert "no speed of the grid is known to be Type I: 1 of 2 types are unknown" in unknown.lines[0]
    everything = calm_region(BEAM, SPEEDS, CLEARANCES, np.full((4, 3), "I"))
    assert everything.failure is None
    assert "no larger one was tried" in everything.lines[0]


def test_a_point_of_unknown_type_neither_passes_nor_fails() -> None:
    """The limit lies between the last clearance that is known to be calm and the first that is known to fail."""
    types = TYPES.copy()
    types[2] = ["I", "undetermined", "III"]
    found = calm_region(BEAM, SPEEDS, CLEARANCES, types, settled_by="look longer")
    assert (found.largest_clearance, found.failure) == (1e-4, (3e-4, 11.0, "II"))
    assert "the limit is below 0.3 mm, where 11 Hz is Type II: in between 1 of 4 types are unknown" in found.lines[0]
    assert found.lines[-1].endswith("; unknown types: look longer")
    types[0, 0] = "undetermined"
    found = calm_region(BEAM, SPEEDS, CLEARANCES, types)
    assert found.largest_clearance is None
    assert found.lines[0].startswith("the largest clearance at which every speed of the grid from 10 to 13 Hz is Type")
    assert "below 0.3 mm (half of the play; the play is 0.6 mm), where 11 Hz is Type II" in found.lines[0]
    assert found.lines[0].endswith("how far below is unknown: 2 of 8 types are unknown")


def test_nothing_known_is_no_limit() -> None:
    """Where no point has a type, no clearance is said to fail or to pass."""
    found = calm_region(BEAM, SPEEDS, CLEARANCES, np.full((4, 3), "undetermined"))
    assert (found.largest_clearance, found.failure, found.ranges) == (None, None, ())
    assert found.lines[0].endswith("is unknown: 12 of 12 types are unknown, and none is known to fail")


def test_the_margin_is_to_the_machines_own_clearance() -> None:
    """A machine of 0.08 mm is a fifth below a limit of 0.1 mm."""
    found = calm_region(BEAM.at(clearance=0.8e-4), SPEEDS, CLEARANCES, TYPES)
    assert found.clearance_margin == pytest.approx(0.2)
    assert found.lines[0].endswith("; its own, 0.08 mm, is 20% below that")


def test_the_gap_to_a_single_stop_is_no_half_play() -> None:
    """With one stop a clearance is the whole gap."""
    machine = oscillator(damping=0.1, stiffness=5.0, stops="one", gap=1e-4)
    found = calm_region(machine, SPEEDS, CLEARANCES, TYPES)
    assert found.lines[0].startswith("up to a clearance of 0.1 mm (the gap to the stop)")


def test_one_clearance_gives_no_limit_of_clearance() -> None:
    """A row of speeds says nothing of other clearances."""
    speed, _ = calm_region(BEAM, SPEEDS, [2e-4], TYPES[:, 1:2]).lines
    assert speed.startswith("at a clearance of")


def test_shapes_that_do_not_fit_are_refused() -> None:
    """A transposed grid would answer another question."""
    with pytest.raises(DiagnosisError, match=r"shape \(3, 4\)"):
        calm_region(BEAM, SPEEDS, CLEARANCES, TYPES.T)
