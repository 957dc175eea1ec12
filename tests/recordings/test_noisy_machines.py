"""One verdict on the peaks of simulated machines with noise at each section: right, or an honest "can't tell".

``python -m tests.recordings.test_noisy_machines 36`` prints the table of the first 36 records of each kind.
"""

import sys

import pytest

from tests.recordings import noisy_machines
from tests.recordings.test_judge import judged, share, show

RECORDS = 18
"""Of each kind."""


def test_noisy_beams_are_not_judged_wrongly():
    """Four beams with noise on speed, force or clearance."""
    assert judged(noisy_machines, ("noisy beam",), range(4))[1] == []


@pytest.mark.slow
def test_noisy_machines_are_hardly_ever_judged_wrongly():
    """54 records: no nature is told wrongly without a condition, and at most 1 % under that of a random scatter."""
    counts, wrong = judged(noisy_machines, noisy_machines.KINDS, range(RECORDS))
    show(counts)
    assert share(counts, "all", "wrong") == 0.0, wrong
    assert share(counts, "all", "wrong, if") <= 0.01, wrong


if __name__ == "__main__":
    found, missed = judged(noisy_machines, noisy_machines.KINDS, range(int(sys.argv[1])))
    show(found)
    print(*missed, sep="\n")
