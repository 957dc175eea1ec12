"""Kernels are compiled once, and a user is told what takes so long."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from filelock import FileLock
from numba import types

import chaosgym
from chaosgym.core import compilation
from chaosgym.core.compilation import is_cached
from chaosgym.core.events import judge
from chaosgym.core.joints.cycle import advance_joints
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.simulation import RungeKutta4, simulate

COUNT = "; print(sum(kernel.stats.cache_misses.values()), sum(kernel.stats.cache_hits.values()))"
REVOLUTION = (
    "from chaosgym.core.compilation import call; from chaosgym.core.motor import revolution as kernel;"
    "import numpy as np; ones = np.ones(8); stopped, rate, *_ = call(kernel, ones, ones, ones, 1.0, 3.0, 1.0);"
)
"""Speed of a crank after a revolution under its motor: by one kernel, compiled in a fraction of a second."""
ONE_KERNEL = REVOLUTION + COUNT.removeprefix("; ")
ANSWER = REVOLUTION + "print(rate)"
ACCELERATION = (
    "from chaosgym.core.compilation import call; from chaosgym.core.joints.tables import Rubs, read_at_rest;"
    "import numpy as np; ones = np.ones((4, 1)); rubs = Rubs(ones[0], ones[:1], ones[:2], np.eye(2), ones[0]);"
    "print(call(read_at_rest, ones, np.ones((2, 2)), ones[:1], ones[0], rubs, 0, 0.0, 0.0, np.ones(2)))"
)
"""What a joint reads, by a kernel that takes the derivative of a row from another file."""


def test_a_call_adds_no_version_of_a_kernel():
    """Preparing a kernel compiles just what the call needs: one version, with deviations or without."""
    code = (
        "from chaosgym.core.fixed_step import advance_fixed_step;"
        "from chaosgym.core.joints.cycle import advance_joints;"
        "from chaosgym.machines import ImpactBeam; from chaosgym.simulation import *; simulate(ImpactBeam(), 1);"
        "simulate_with_deviations(ImpactBeam(), 1, deviations=[[1.0] * 12]);"
        "simulate(ImpactBeam(), 1, integrator=RungeKutta4(4000));"
        "print(len(advance_joints.signatures), len(advance_fixed_step.signatures))"
    )
    out, err = _in_a_process(code).communicate()
    assert out.decode().split() == ["1", "1"], err.decode()
    assert is_cached(advance_joints)


def test_the_functions_that_are_counted_are_those_that_are_compiled():
    """A bar over the functions that a kernel calls ends full: each of them has machine code.

    A beam has no friction: that alone is counted and not compiled.
    """
    simulate(ImpactBeam(), 1)
    functions = {one for one in compilation._functions_of(advance_joints) if "friction" not in one.py_func.__module__}
    assert advance_joints in functions
    assert len(functions) > 10
    assert all(map(is_cached, functions))


def test_a_kernel_that_kernels_alone_call_refuses_python():
    """It has nothing that takes arguments over from Python: without a refusal the process would crash."""
    with pytest.raises(TypeError, match="judge is called by kernels alone"):
        judge(1.0, 0.01, 0.0, 0.01, 0.0, 0.0)


def test_no_kernel_gives_python_a_named_tuple():
    """Where Ctrl-C arrives while numba makes one of a kernel's result, the process crashes."""
    for machine in (ImpactBeam(), SliderCrank()):
        simulate(machine, 1)
    simulate(ImpactBeam(n_modes=1, fitted_modes=0), 1, integrator=RungeKutta4(4000))
    called = [kernel for kernel, _ in compilation._ready]
    given = {kernel: {signature.return_type for signature in kernel.nopython_signatures} for kernel in called}
    assert advance_joints in given
    assert not any(isinstance(kind, types.BaseNamedTuple) for kinds in given.values() for kind in kinds)


def _in_a_process(code, **environment):
    return subprocess.Popen(
        [sys.executable, "-c", code], env={**os.environ, **environment}, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )


@pytest.mark.slow
def test_processes_that_start_together_compile_once(tmp_path):
    """Of two processes on an empty cache one compiles, saying so, and the other loads what it left."""
    started = [_in_a_process(ONE_KERNEL, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    ended = [process.communicate() for process in started]
    counts = sorted(out.decode().split() for out, _ in ended)
    assert counts == [["0", "1"], ["1", "0"]]
    assert sorted(err.decode().count("compiling motor.revolution") for _, err in ended) == [0, 1]


BESIDE = (
    "from chaosgym import *; from chaosgym.core import compilation;"
    "compilation.numba.config.NUMBA_DEFAULT_NUM_THREADS = 2;"
    "print(simulate(ImpactBeam(n_modes=1, fitted_modes=0), 3).peak_force.max());"
    "from chaosgym.core.joints.cycle import advance_joints as kernel" + COUNT
)


@pytest.mark.slow
def test_on_two_processors_another_process_compiles_what_moves_a_beam(tmp_path):
    """It compiles just what this one then loads: the peak force is that of kernels compiled here, to the last bit."""
    out, _ = _in_a_process(BESIDE, NUMBA_CACHE_DIR=str(tmp_path)).communicate()
    force, missed, loaded = out.decode().split()
    assert float(force) == simulate(ImpactBeam(n_modes=1, fitted_modes=0), 3).peak_force.max()
    assert (missed, loaded) == ("0", "1")


def test_on_one_processor_no_other_process_compiles(tmp_path):
    """There it would only take turns with this one. Where one does, the pipe to it is closed when it ends."""
    code = (
        "from chaosgym.core import compilation; from chaosgym.core.motor import revolution, round_speeds;"
        "compilation.numba.config.NUMBA_DEFAULT_NUM_THREADS = {};"
        "compilation.compile_beside(revolution, round_speeds, '');"
        "print(compilation._beside[revolution] is not None); compilation._take_over(revolution, 1)"
    )
    environment = {"NUMBA_CACHE_DIR": str(tmp_path), "PYTHONWARNINGS": "always::ResourceWarning"}
    begun = [_in_a_process(code.format(count), **environment) for count in (1, 2)]
    ended = [process.communicate() for process in begun]
    assert [out.decode().strip() for out, _ in ended] == ["False", "True"]
    assert not any(b"ResourceWarning" in err for _, err in ended)


@pytest.mark.slow
def test_where_another_process_compiles_nothing_this_one_does(tmp_path):
    """A process that fails costs no answer, and leaves no folder."""
    code = (
        "from chaosgym.core import compilation; from chaosgym.core.motor import round_speeds as kernel;"
        "from chaosgym.core.modal_impact import tabulate; import numpy as np;"
        "compilation.numba.config.NUMBA_DEFAULT_NUM_THREADS = 2;"
        "compilation.compile_beside(kernel, tabulate, 'raise SystemExit(1)');"
        "folder = compilation._beside[kernel].folder; speeds = np.array([[1.0 + 2**-50]]);"
        "compilation.call(kernel, speeds); import os; print(os.path.exists(folder))" + COUNT
    )
    out, _ = _in_a_process(code, NUMBA_CACHE_DIR=str(tmp_path)).communicate()
    assert out.decode().split() == ["False", "1", "0"]


def test_a_process_that_compiles_beside_ends_with_the_one_that_started_it(tmp_path):
    """Killed, that one can end nothing itself: no process and no folder stay."""
    code = (
        "from chaosgym.core import compilation; from chaosgym.core.motor import round_speeds as kernel;"
        "from chaosgym.core.modal_impact import tabulate; import time;"
        "compilation.numba.config.NUMBA_DEFAULT_NUM_THREADS = 2;"
        "compilation.compile_beside(kernel, tabulate, 'import time; time.sleep(600)');"
        "print(compilation._beside[kernel].folder, flush=True); time.sleep(600)"
    )
    process = _in_a_process(code, NUMBA_CACHE_DIR=str(tmp_path))
    folder = Path(process.stdout.readline().decode().strip())
    assert folder.exists()
    process.kill()
    process.communicate()
    ends = time.monotonic() + 60.0
    while folder.exists() and time.monotonic() < ends:
        time.sleep(0.1)
    assert not folder.exists()


def test_what_is_compiled_already_waits_for_no_one():
    """While another process holds the lock, a kernel that lies on the disk is loaded at once."""
    simulate(ImpactBeam(), 1)
    with FileLock(compilation._lock_file()):
        process = _in_a_process("from chaosgym import *; simulate(ImpactBeam(), 1); print('done')")
        out, err = process.communicate(timeout=120)
    assert (out.decode().strip(), err.decode()) == ("done", "")


@pytest.mark.slow
def test_an_edit_in_a_helper_reaches_the_kernels_of_other_files(tmp_path):
    """Machine code on the disk is not served once derivatives are doubled in a file that the kernel imports."""
    package, cache = tmp_path / "chaosgym", str(tmp_path / "cache")
    shutil.copytree(Path(chaosgym.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__", "weights"))

    def reading():
        out, _ = _in_a_process(ACCELERATION, NUMBA_CACHE_DIR=cache, PYTHONPATH=str(tmp_path)).communicate()
        return float(out)

    found = reading()
    assert reading() == found
    helper = package / "core" / "propagator.py"
    helper.write_text(helper.read_text().replace("result[j] = first *", "result[j] = 2.0 * first *"))
    assert reading() > 1.1 * found


@pytest.mark.slow
def test_installations_with_equal_sources_share_their_kernels(tmp_path):
    """A copy in another folder, of another date, compiles nothing; an edited one leaves the others' kernels alone."""
    source, ignored = Path(chaosgym.__file__).parent, shutil.ignore_patterns("__pycache__", "weights")

    def counts(folder):
        environment = {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path / folder)}
        out, err = _in_a_process(ONE_KERNEL, **environment).communicate()
        return out.decode().split(), err.decode().count("compiling")

    for name in ("one", "other", "edited"):
        shutil.copytree(source, tmp_path / name / "chaosgym", ignore=ignored, copy_function=shutil.copyfile)
    edited = tmp_path / "edited" / "chaosgym" / "core" / "events.py"
    edited.write_text(edited.read_text() + "\nNOTHING = 0\n")
    (compiled, loaded), said = counts("one")
    assert (compiled, loaded) == ("1", "0")
    assert said > 0
    assert counts("other") == (["0", "1"], 0)
    assert counts("edited")[0] == ["1", "0"]
    assert counts("one") == counts("other") == (["0", "1"], 0)


def _answer(cache):
    out, err = _in_a_process(ANSWER, NUMBA_CACHE_DIR=str(cache)).communicate()
    return float(out), err.decode()


@pytest.fixture(scope="module")
def compiled(tmp_path_factory):
    """A cache of compiled kernels, and the answer that they give without a word."""
    cache = tmp_path_factory.mktemp("compiled")
    right, _ = _answer(cache)
    assert _answer(cache) == (right, "")
    return cache, right


@pytest.mark.slow
@pytest.mark.parametrize(("ending", "damage"), [("nbi", "empty"), ("nbi", "half"), ("nbc", "bit")])
def test_damaged_machine_code_is_compiled_anew(tmp_path, compiled, ending, damage):
    """An index that is empty or cut, or code with one bit flipped, is named in a line, and the answer is right."""
    intact, right = compiled
    cache = shutil.copytree(intact, tmp_path / "cache")
    assert _answer(cache) == (right, "")
    damaged = list(cache.rglob(f"*.{ending}"))
    assert damaged
    for path in damaged:
        content = bytearray(path.read_bytes())
        content[len(content) // 2] ^= 1
        path.write_bytes({"empty": b"", "half": bytes(content[: len(content) // 2]), "bit": bytes(content)}[damage])
    again, said = _answer(cache)
    assert again == right
    assert "made anew" in said
    assert _answer(cache) == (right, "")


@pytest.mark.slow
def test_a_cache_that_cannot_be_written_is_replaced(tmp_path):
    """Where the cache folder is a file, kernels are compiled into a temporary folder, which a line says."""
    wall = tmp_path / "wall"
    wall.write_text("")
    process = _in_a_process(ANSWER, NUMBA_CACHE_DIR=str(wall / "cache"), TMPDIR=str(tmp_path))
    out, err = process.communicate()
    assert float(out) > 0.0
    assert "can't be written to; NUMBA_CACHE_DIR names another" in err.decode()
    assert [path.name for path in tmp_path.iterdir()] == ["wall"], "the temporary folder is removed"
