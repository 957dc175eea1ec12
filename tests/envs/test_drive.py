"""The drive: from an action to the speed of the next step."""

import re

import pytest

from chaosgym.envs.drive import SpeedDrive
from chaosgym.errors import ParameterError

DRIVE = SpeedDrive(lowest_speed=50.0, highest_speed=300.0, slew_limit=10.0, speed_grid=2.5)


def test_targets_lie_on_the_grid() -> None:
    """Every action stands for a whole number of grid spaces above the lowest speed, the nearest one."""
    for action in (-1.0, -0.5, -0.123, 0.0, 0.777, 1.0):
        _, target = DRIVE.target_of([action])
        exact = 175.0 + 125.0 * action
        assert (target - 50.0) % 2.5 == 0.0
        assert abs(target - exact) <= 1.25


def test_the_way_to_a_target_stays_on_the_grid() -> None:
    """A slew limit that is no multiple of the grid is rounded down to one."""
    drive = SpeedDrive(lowest_speed=50.0, highest_speed=300.0, slew_limit=6.0, speed_grid=2.5)
    assert drive.approach(50.0, 300.0) == 55.0
    assert drive.approach(300.0, 50.0) == 295.0
    assert drive.approach(55.0, 57.5) == 57.5


def test_a_grid_of_tenths_allows_the_whole_slew_limit() -> None:
    """Rounding of decimal fractions costs no grid space."""
    drive = SpeedDrive(lowest_speed=0.0, highest_speed=3.0, slew_limit=0.3, speed_grid=0.1)
    assert drive.approach(0.0, 3.0) == pytest.approx(0.3)


def test_without_a_grid_every_speed_can_be_commanded() -> None:
    """The default changes no target."""
    drive = SpeedDrive(lowest_speed=4.0, highest_speed=30.0, slew_limit=1.0)
    assert drive.target_of([0.1234])[1] == 4.0 + 0.5 * 1.1234 * 26.0
    assert drive.approach(10.0, 10.0625) == 10.0625


@pytest.mark.parametrize("grid", [-1.0, 7.0, 12.5, float("nan")])
def test_a_grid_that_does_not_fit_is_named(grid: float) -> None:
    """Both ends of the range are on the grid, and a step reaches the next point of it."""
    with pytest.raises(ParameterError, match=re.escape(f"speed_grid = {grid:g}")):
        SpeedDrive(lowest_speed=50.0, highest_speed=300.0, slew_limit=10.0, speed_grid=grid)
