"""Results on processors with shorter vectors than those of this one."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

EVENTS = """
import json, chaosgym
record = chaosgym.simulate(chaosgym.ImpactBeam(excitation_frequency={frequency}), 12, samples_per_cycle=3)
print(json.dumps([record.impacts.tolist(), record.peak_force.tolist(), record.history.tolist()]))
"""


def _results(frequency, **environment):
    done = subprocess.run(
        [sys.executable, "-c", EVENTS.format(frequency=frequency)],
        env={**os.environ, **environment},
        capture_output=True,
        text=True,
        check=True,
    )
    return [np.array(values) for values in json.loads(done.stdout)]


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [30.0, 19.0, 7.0])
def test_vectors_of_four_doubles_give_the_same_events(frequency):
    """Compiled for a processor without AVX-512, a beam has the same impacts, and forces equal to 1e-9 of their size.

    Sums have a fixed order on either, but libraries of elementary functions may differ in the last bit.
    """
    here = _results(frequency)
    there = _results(frequency, NUMBA_CPU_NAME="haswell")
    np.testing.assert_array_equal(there[0], here[0])
    for ours, theirs in zip(here[1:], there[1:], strict=True):
        np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-9 * np.abs(ours).max())
