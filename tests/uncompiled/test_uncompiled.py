"""Kernels mean what their Python source says: run as it stands, without numba, it gives what machine code gives."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest
from numba import njit
from numba.core.extending import _Intrinsic

import chaosgym.core.binned.lanes
import chaosgym.core.lanes
from tests.uncompiled.lanes import OPERATIONS, compiled
from tests.uncompiled.run import results

CALLS = {
    "sample": lambda call, table, own: call(table, 0, own, 512, 5, 8, 600, 610),
    "first_doubt": lambda call, table, own: call(own, 0, 20, 0.1, -3.0, 3.0, 0.01, 2),
    "propagate": lambda call, table, own: call(table, 0, own, 512, 600, 16),
    "propagate_and_expand": lambda call, table, own: call(table, 0, 64, own, 512, 0.02, 600, 16),
    "dot": lambda call, table, own: call(table, 0, own, 100, 24),
    "dot_of_sizes": lambda call, table, own: call(table, 0, own, 100, 24),
    "add_columns": lambda call, table, own: call(table, 0, 16, 5, own, 700, own, 900, 24),
    "add_some_columns": lambda call, table, own: call(table, 0, 16, 5, 3, 2, own, 700, own, 900, 24),
    "next_term": lambda call, table, own: call(table, 0, 160, 16, 5, own, 512, 540, 700, 2.0, 0.25, 600),
    "next_terms": lambda call, table, own: call(table, 0, 160, 5, own, 700, 100, 2, own, 6),
    "copy": lambda call, table, own: call(own, 3, 600, 13),
    "dot_of_distances": lambda call, table, own: call(table, 0, own, 100, 200, 24),
    "add_rows": lambda call, table, own: call(own, 3, 0.3, 600, 16),
    "add_sums": lambda call, table, own: call(own, 0, 16, 5, 700, 0.3, 900),
    "multiply_eight": lambda call, table, own: call(own, 0, 3, 200, 48, 5, 600),
    "next_terms_of_eight": lambda call, table, own: call(own, 0, 250, 400, 56, 3, 2.0, 0.25, 600),
    "deal": lambda call, table, own: call(table, 0, 24, 5, own, 600, 30, 7, 6),
    "keep_largest": lambda call, table, own: call(own, 3, 600, 16),
    "exponent": lambda call, table, own: [call(2.0**k * (1.0 + abs(x) % 0.9)) for k, x in enumerate(own[:9], -4)],
    "power_of_two": lambda call, table, own: [call(k) for k in range(-5, 40)],
    "put": lambda call, table, own: call(own, 3, 0.3),
    "sum_series": lambda call, table, own: call(table, 3, 24, 6, 0.7, own, 900, 16),
    "add_tops": lambda call, table, own: call(own, 0, 20, 0.1, -1.0, 0.7, 0.2, 600),
    "first_above": lambda call, table, own: call(own, 3, 0.4, 2),
    "item": lambda call, table, own: call(own, 7),
    "fma": lambda call, table, own: call(own[0], own[1], own[2]),
}
"""One call of each operation on two arrays."""


def _called(operation):
    @njit
    def call(*arguments):
        return operation(*arguments)

    return call


@pytest.mark.parametrize("name", OPERATIONS)
def test_a_vector_operation_is_its_sentence_in_numpy(name):
    """What it returns and all that it writes, but for the order of sums."""
    found = []
    for operation in (_called(compiled(name)), OPERATIONS[name]):
        generator = np.random.default_rng(3)
        table, own = generator.normal(size=1024), generator.normal(size=1024)
        returned = CALLS[name](operation, table, own)
        found.append(own if returned is None else np.append(own, returned))
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12, atol=1e-12)


def test_every_vector_operation_has_its_sentence_in_numpy():
    """None is left out of the tests above, nor of the run without the compiler below."""
    modules = (chaosgym.core.lanes, chaosgym.core.binned.lanes)
    defined = {name for module in modules for name, value in vars(module).items() if isinstance(value, _Intrinsic)}
    assert defined == set(OPERATIONS) == set(CALLS)


@pytest.mark.slow
def test_kernels_run_as_plain_python(tmp_path):
    """Records of every scene, deviations and steps of the tasks are those of machine code, but for rounding."""
    file = tmp_path / "plain.npz"
    command = [sys.executable, "-m", "tests.uncompiled.run", str(file)]
    subprocess.run(command, env=os.environ | {"NUMBA_DISABLE_JIT": "1"}, check=True)
    plain = np.load(file)
    compiled = results()
    assert set(plain) == set(compiled)
    for name, value in compiled.items():
        np.testing.assert_allclose(plain[name], value, rtol=0.0, atol=1e-7 * np.nanmax(np.abs(value)), err_msg=name)


WITHOUT = os.environ | {"NUMBA_DISABLE_JIT": "1"}
SAYS = "NUMBA_DISABLE_JIT is set, and kernels run as machine code only; unset it\n"


@pytest.mark.parametrize("command", ["simulate impact-beam --cycles 1", "diagnose slider-crank"])
def test_a_command_without_the_compiler_says_so(command):
    """Machine code has operations that plain Python has not: one line, exit 2."""
    words = [sys.executable, "-m", "chaosgym", *command.split()]
    done = subprocess.run(words, env=WITHOUT, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr == f"Error: {SAYS}"


@pytest.mark.parametrize("words", [["docs/data/periodic.csv", "--sensor-error", "1 N"], ["--budget-us", "0"]])
def test_classifying_one_record_or_parameters_loads_no_machine_code(words):
    """The kernels of the classifier only compute: their Python answers sooner than machine code is loaded."""
    command = [sys.executable, "-m", "chaosgym", "classify", "impact-beam", *words, "--json"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)


def test_python_without_the_compiler_says_so():
    """One cycle, and the reset of one environment and of two: an error of this package, which names the variable."""
    program = """
import gymnasium, chaosgym
name = "chaosgym/ImpactBeamTolerance-v1"
for work in (
    lambda: chaosgym.simulate(chaosgym.ImpactBeam(), 1),
    lambda: gymnasium.make(name).reset(seed=1),
    lambda: gymnasium.make_vec(name, num_envs=2).reset(seed=1),
):
    try:
        work()
    except chaosgym.ParameterError as error:
        print(error)
"""
    done = subprocess.run([sys.executable, "-c", program], env=WITHOUT, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == 3 * SAYS


def test_the_switch_set_to_zero_changes_nothing():
    """NUMBA_DISABLE_JIT=0 compiles as if it were not there."""
    program = "import chaosgym; print(len(chaosgym.simulate(chaosgym.ImpactBeam(), 1).peak_force))"
    where = WITHOUT | {"NUMBA_DISABLE_JIT": "0"}
    done = subprocess.run([sys.executable, "-c", program], env=where, capture_output=True, text=True)
    assert (done.returncode, done.stdout) == (0, "1\n"), done.stderr
