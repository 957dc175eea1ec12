"""What is drawn of a series: a few of its cycles, its course, its spectrum."""

import numpy as np
import pytest

from chaosgym.recordings.cycles import cycle_peaks
from chaosgym.recordings.sampling import Even, Sampling
from chaosgym.recordings.trace import trace_of

STEP, SIZE = 0.001, 8000
INSTANTS = Sampling(Even(0.0, STEP, SIZE), STEP, ())
TIME = STEP * np.arange(SIZE)
VALUE = 3.0 * np.sin(2.0 * np.pi * 20.0 * TIME) + 0.5 * np.sin(2.0 * np.pi * 130.0 * TIME)


@pytest.fixture(scope="module")
def trace():
    """Of eight seconds at a cycle of 50 ms, with a line at 130 Hz."""
    return trace_of(VALUE, cycle_peaks(VALUE, INSTANTS, 0.05))


def test_six_cycles_amid_the_series_are_drawn(trace):
    """Sample by sample from the middle on, with the instants at which cycles begin."""
    assert trace.time[-1] - trace.time[0] == pytest.approx(6 * 0.05, abs=2 * STEP)
    assert abs(trace.time[0] - 4.0) < 0.1
    np.testing.assert_array_equal(trace.value, VALUE[np.rint(trace.time / STEP).astype(int)])
    np.testing.assert_allclose(np.diff(trace.starts), 0.05)
    assert len(trace.starts) in (5, 6, 7)


def test_the_course_holds_every_extreme(trace):
    """No more than 1,500 points, whatever the length; the largest and the least reading are among them."""
    assert len(trace.course) == len(trace.low) == len(trace.high) <= 1500
    assert (trace.low.min(), trace.high.max()) == (VALUE.min(), VALUE.max())
    assert (trace.low <= trace.high).all()


def test_lines_stand_at_their_amplitude(trace):
    """3 at 20 Hz and 0.5 at 130 Hz, to a hundredth; nothing between them."""
    for hertz, amplitude in ((20.0, 3.0), (130.0, 0.5)):
        near = np.abs(trace.frequency - hertz) < 5.0
        assert trace.amplitude[near].max() == pytest.approx(amplitude, rel=0.01)
    assert trace.amplitude[np.abs(trace.frequency - 75.0) < 20.0].max() < 1e-3
