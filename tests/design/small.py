"""Studies of few runs."""

from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module

import numpy as np
import pytest

from chaosgym.design import surroundings
from chaosgym.diagnosis import carried

IMPROVE = import_module("chaosgym.design.improve")  # the package has a function of that name
STUDY = import_module("chaosgym.design.study")


@contextmanager
def small_studies() -> Iterator[None]:
    """Study machines with a coarse map, few speeds of the life trend, few samples of the total indices, and so on.

    What the answer says of its numbers is the same; the numbers of these parts are coarse.
    """
    shares = np.arange(-2.0, 3.0)
    places = {"MAP_SHARES": shares, "WITHIN": shares[1:-1], "MIDDLE": 2}
    with pytest.MonkeyPatch.context() as patch:
        for home in (STUDY, surroundings):
            for name, value in places.items():
                patch.setattr(home, name, value)
        patch.setattr(surroundings, "MAP_STARTS", 1)
        patch.setattr(STUDY, "TREND_POINTS", 7)
        patch.setattr(STUDY, "BASE", 8)
        patch.setattr(carried, "STEPS", 6)
        for name, value in {"MOST_VERIFIED": 3, "SPARE": 1, "REFINEMENTS": 1}.items():
            patch.setattr(IMPROVE, name, value)
        yield
