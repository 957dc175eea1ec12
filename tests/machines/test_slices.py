"""A run in slices, whatever their lengths, is the run in one piece."""

import numpy as np
import pytest

from chaosgym.machines import ImpactBeam
from chaosgym.simulation import run, simulate, simulate_with_deviations

BEAM = ImpactBeam(excitation_frequency=30.0)


@pytest.mark.parametrize("seconds", [1e-9, 1e9])
def test_the_last_slice_is_as_long_as_what_is_left(monkeypatch, seconds):
    """Slices of one cycle, and slices that grow beyond the run: same cycles, same growth, to the last bit."""
    whole = simulate(BEAM, 100)
    deviations = np.eye(BEAM.n_states)[:1]
    _, vectors, growth = simulate_with_deviations(BEAM, 100, deviations=deviations)
    monkeypatch.setattr(run, "FIRST_SLICE", 3)
    monkeypatch.setattr(run, "SLICE_SECONDS", seconds)
    sliced = simulate(BEAM, 100)
    np.testing.assert_array_equal(sliced.section, whole.section)
    np.testing.assert_array_equal(sliced.final_state.coordinates, whole.final_state.coordinates)
    _, again, same = simulate_with_deviations(BEAM, 100, deviations=deviations)
    np.testing.assert_array_equal(again, vectors)
    np.testing.assert_array_equal(same, growth)
