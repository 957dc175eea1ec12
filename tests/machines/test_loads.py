"""What pulls over a cycle: samples, their harmonics, and what of them is told."""

import numpy as np
import pytest

from chaosgym.errors import ParameterError
from chaosgym.machines.loads import Cycle, cycle_of


@pytest.mark.parametrize("count", [3, 4, 7, 12, 32, 33])
def test_the_curve_passes_through_up_to_33_samples(count):
    """Of an odd or an even number: the sum of harmonics is each sample at its angle, and nothing is said of it."""
    values = np.random.default_rng(count).uniform(-1.0, 2.0, count)
    cycle = Cycle.sampled("samples", values)
    angles = 2.0 * np.pi * np.arange(count) / count
    np.testing.assert_allclose(cycle.at(angles), values, atol=1e-13)
    step = 1e-6
    slopes = (cycle.at(angles + 0.3 + step) - cycle.at(angles + 0.3 - step)) / (2.0 * step)
    np.testing.assert_allclose(cycle.slope(angles + 0.3), slopes, atol=1e-6)
    assert cycle.note("the force", "N") == ""


def test_what_a_note_advises_is_taken():
    """More harmonics are advised up to half the samples; that many pass through all of them, one more is refused."""
    values = np.random.default_rng(0).uniform(-1.0, 2.0, 80)
    told = Cycle.sampled("samples", values).note("the moment at a.b", "N m")
    assert told.startswith("16 harmonics differ from the samples of the moment at a.b by up to")
    assert told.endswith("N m; more harmonics, up to half the samples and 64, keep more of them")
    assert Cycle.sampled("samples", values, 40).note("the moment") == ""
    with pytest.raises(ParameterError, match="41 harmonics need 82 samples of a cycle, not 80; allowed: up to 40"):
        Cycle.sampled("samples", values, 41)


def test_two_samples_are_no_cycle():
    """They have no first harmonic of a phase of its own, and are mostly a vector."""
    with pytest.raises(ParameterError, match="samples of force are 2; allowed: 3 or more over a cycle"):
        cycle_of("drive", {"force": [0.0, -500.0]}, "force", "N")
