"""An ordinary machine gets an answer: undetermined is a failure too."""

import pytest

from tests.diagnosis.ordinary import diagnosed


def test_an_ordinary_machine_gets_an_answer():
    """One of each kind, and four more: one stop or two, a free body, a shaken base, what turns."""
    assert diagnosed(range(20))[1] == {}


@pytest.mark.slow
def test_of_four_hundred_ordinary_machines_two_per_cent_stay_undetermined_at_most():
    """Three were when this was written: one not settled, one whose chaos died late, one between the tests."""
    natures, unresolved = diagnosed(range(400))
    print(dict(natures), unresolved)
    assert len(unresolved) <= 8
