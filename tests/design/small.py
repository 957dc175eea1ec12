"""Studies of few runs."""

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from chaosgym.design import study, surroundings
from chaosgym.diagnosis import carried


@contextmanager
def small_studies() -> Iterator[None]:
    """Study machines with a coarse map, few speeds of the life trend, few samples of the total indices, and so on.

    What the answer says of its numbers is the same; the numbers of these parts are coarse.
    """
    shares = np.arange(-2.0, 3.0)
    places = {"MAP_SHARES": shares, "WITHIN": shares[1:-1], "MIDDLE": 2}
    with pytest.MonkeyPatch.context() as patch:
        for home in (study, surroundings):
            for name, value in places.items():
                patch.setattr(home, name, value)
        patch.setattr(surroundings, "MAP_STARTS", 1)
        patch.setattr(study, "TREND_POINTS", 7)
        patch.setattr(study, "BASE", 8)
        patch.setattr(carried, "STEPS", 6)
        yield
