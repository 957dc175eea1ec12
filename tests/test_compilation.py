"""Kernels are compiled once, and a user is told what takes so long."""

import os
import subprocess
import sys

import pytest

from chaosgym.compilation import is_cached
from chaosgym.core.fixed_step import advance_fixed_step
from chaosgym.core.impact_beam import advance
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import RungeKutta4, simulate, simulate_with_deviations

RUN = (
    "from chaosgym import *; simulate(ImpactBeam(fidelity='rigid'), 1, integrator=RungeKutta4(4000));"
    "from chaosgym.core.fixed_step import advance_fixed_step as kernel;"
    "print(sum(kernel.stats.cache_misses.values()), sum(kernel.stats.cache_hits.values()))"
)


def test_a_call_adds_no_version_of_a_kernel():
    """Preparing a kernel compiles just what the call needs: one version without and one with deviations."""
    simulate(ImpactBeam(), 1)
    simulate_with_deviations(ImpactBeam(), 1, deviations=[[1.0] * 10])
    simulate(ImpactBeam(), 1, integrator=RungeKutta4(4000))
    assert len(advance.signatures) == 2
    assert len(advance_fixed_step.signatures) == 1
    assert is_cached(advance)


@pytest.mark.slow
def test_processes_that_start_together_compile_once(tmp_path):
    """Of two processes on an empty cache one compiles, saying so, and the other loads what it left."""
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}
    started = [
        subprocess.Popen([sys.executable, "-c", RUN], env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        for _ in range(2)
    ]
    ended = [process.communicate() for process in started]
    counts = sorted(out.decode().split() for out, _ in ended)
    assert counts == [["0", "1"], ["1", "0"]]
    assert sorted(err.decode().count("compiling fixed_step.advance_fixed_step") for _, err in ended) == [0, 1]
