"""The calm region beside the sliders is that of a map over the same speeds and clearances."""

from typing import ClassVar

import numpy as np

import chaosgym
from chaosgym.diagnosis import Tolerance, default_tolerances
from chaosgym.explore.point import Slider
from chaosgym.explore.safe import calm_search
from tests.diagnosis.coexisting import RATIO, trilinear
from tests.third_machine import ImpactOscillator

BEAM = chaosgym.ImpactBeam(excitation_frequency=10.0, clearance=1e-4)
SPEED = Slider("excitation_frequency", "excitation frequency [Hz]", 9.7, 10.3, 1.0)
CLEARANCE = Slider("clearance", "clearance [mm]", 0.9e-4, 1.1e-4, 1e3)


def test_its_rows_are_those_of_a_response_map():
    """Types of the machine's own row, over nine points around each, agree with the map's over twenty-five."""
    regions = [region for region in calm_search(BEAM, SPEED, CLEARANCE) if region]
    speeds = [default_tolerances(BEAM)["excitation_frequency"].at(10.0, share) for share in (-1.0, 0.0, 1.0)]
    types = chaosgym.response_map(BEAM, speeds, [1e-4], budget=400).type[:, 0]
    assert list(types) == ["I", "I", "I"]
    np.testing.assert_allclose(regions[0].ranges, [(speeds[0], speeds[-1])])
    assert regions[0].margin is not None


def test_it_goes_up_from_the_smallest_clearance_and_ends_at_the_first_that_fails():
    """Where every clearance passes, the last of the slider is the largest; where the first fails, none is looked at."""
    *_, last = (region for region in calm_search(BEAM, SPEED, CLEARANCE) if region)
    assert last.largest_clearance == 1.1e-4
    assert last.failure is None
    wild = SPEED._replace(low=29.0, high=31.0)
    *_, last = (region for region in calm_search(BEAM.at(30.0), wild, CLEARANCE) if region)
    assert last.largest_clearance is None
    assert last.failure.clearance == 0.9e-4
    assert len(last.clearance) == 2


def test_a_tolerance_of_zero_leaves_the_own_speed_alone():
    """A file may state that its speed does not vary; then no other speed is spoken of."""

    class OfOneSpeed(ImpactOscillator):
        tolerances: ClassVar = {ImpactOscillator.speed_field: Tolerance(0.0)}

    machine = OfOneSpeed()
    speed = Slider(machine.speed_field, "speed", 0.0, np.inf, 1.0)
    low = 0.99 * getattr(machine, machine.clearance_field)
    clearance = Slider(machine.clearance_field, "clearance", low, 1.01 * low, 1.0)
    *_, last = (region for region in calm_search(machine, speed, clearance) if region)
    assert last.speed == (getattr(machine, machine.speed_field),)


def test_no_speed_is_calm_beside_a_rattle_that_few_starts_reach():
    """At 1.86 natural frequencies few starts reach the rattle; carried up from below it is met up to its fold.

    Within a tolerance of the fold the rattle is a neighbour's.
    """
    machine = trilinear(1.86)
    slider = Slider("speed", "speed [Hz]", 1.6 * RATIO, 2.05 * RATIO, 1.0)
    region = next(region for region in calm_search(machine, slider, CLEARANCE._replace(low=1e-3)) if region)
    (calm,) = region.ranges
    assert calm.low > 1.02 * 1.90683 * RATIO
    assert "16 random starts" in region.searched
