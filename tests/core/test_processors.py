"""Results on processors with shorter vectors than those of this one."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

EVENTS = """
import json, chaosgym
beams = [chaosgym.ImpactBeam(excitation_frequency=frequency) for frequency in (30.0, 19.0, 7.0)]
records = [chaosgym.simulate(beam, 12, samples_per_cycle=3) for beam in beams]
print(json.dumps([[one.impacts.tolist(), one.peak_force.tolist(), one.history.tolist()] for one in records]))
"""


def _results(**environment):
    done = subprocess.run(
        [sys.executable, "-c", EVENTS], env={**os.environ, **environment}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    return [[np.array(values) for values in record] for record in json.loads(done.stdout)]


@pytest.mark.slow
def test_vectors_of_four_doubles_give_the_same_events(tmp_path):
    """Compiled for a processor without AVX-512, beams have the same impacts, and forces equal to 1e-9 of their size.

    Sums have a fixed order on either, but libraries of elementary functions may differ in the last bit.
    """
    elsewhere = _results(NUMBA_CPU_NAME="haswell", NUMBA_CACHE_DIR=str(tmp_path))
    for here, there in zip(_results(), elsewhere, strict=True):
        np.testing.assert_array_equal(there[0], here[0])
        for ours, theirs in zip(here[1:], there[1:], strict=True):
            np.testing.assert_allclose(theirs, ours, rtol=1e-9, atol=1e-9 * np.abs(ours).max())
