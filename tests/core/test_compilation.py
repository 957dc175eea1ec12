"""Kernels are compiled once, and a user is told what takes so long."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import ClassVar

import pytest
from filelock import FileLock
from numba import types

import chaosgym
from chaosgym.core import compilation
from chaosgym.core.joints.cycle import advance_joints
from chaosgym.core.kernel_cache import ROOT, SHIPPED, kernel_digest, place_of
from chaosgym.machines import ImpactBeam, SliderCrank
from chaosgym.simulation import RungeKutta4, simulate

COUNT = "; print(sum(kernel.stats.cache_misses.values()), sum(kernel.stats.cache_hits.values()))"
REVOLUTION = (
    "from chaosgym.core.compilation import call; from chaosgym.core.motor import revolution as kernel;"
    "import numpy as np; ones = np.ones(8); line = np.array([0.0, 3.0]);"
    "stopped, rate, *_ = call(kernel, ones, ones, ones, line[::-1].copy(), line, 3.0, 1.0);"
)
"""Speed of a crank after a revolution under its motor: by one kernel, compiled in a fraction of a second."""
ONE_KERNEL = REVOLUTION + COUNT.removeprefix("; ")
ANSWER = REVOLUTION + "print(rate)"
ACCELERATION = (
    "from chaosgym.core.compilation import call; from chaosgym.core.joints.tables import Rubs, read_at_rest;"
    "import numpy as np; ones = np.ones((4, 1)); rubs = Rubs(np.zeros(1), ones[:1], ones[:2], np.eye(2), ones[0]);"
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
    out, err = _in_a_process(code, CHAOSGYM_KERNELS="").communicate()
    assert out.decode().split() == ["1", "1"], err.decode()


def test_the_functions_that_are_counted_are_those_that_are_compiled():
    """A bar over the functions that a kernel calls ends full: each of them has machine code.

    A beam has no friction: that alone is counted and not compiled.
    """
    simulate(ImpactBeam(), 1)
    functions = {one for one in compilation._functions_of(advance_joints) if "friction" not in one.py_func.__module__}
    assert advance_joints in functions
    assert len(functions) > 10
    for one in functions:
        place = place_of(Path(one.py_func.__code__.co_filename))
        folders = [Path(root, place) for root in (SHIPPED, ROOT)]
        assert any(list(folder.glob(f"{compilation.name_of(one)}-*.nbi")) for folder in folders), one


class _Slow:
    """A kernel that nothing has compiled."""

    targetoptions: ClassVar = {}

    def __init__(self, function):
        self.py_func, self.compile = function, lambda _: None


def test_one_line_says_what_takes_so_long(monkeypatch, caplog):
    """Of several kernels that are compiled in a process the first alone is named, with the reason."""
    monkeypatch.setattr(compilation, "_loaded", lambda *_: False)
    compilation._reason.cache_clear()
    for kernel in (_Slow(lambda one: one), _Slow(lambda one: -one)):
        compilation.prepare(kernel, 1.0)
    (said,) = caplog.messages
    assert "<lambda>: 1 functions, and others as they are called" in said
    assert "once on this computer: " in said


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
    """A process that compiles what it calls, and so uses nothing that is shipped."""
    environment, pipe = {**os.environ, "CHAOSGYM_KERNELS": "none", **environment}, subprocess.PIPE
    return subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=pipe, stderr=pipe)


@pytest.mark.slow
def test_processes_that_start_together_compile_once(tmp_path):
    """Of two processes on an empty cache one compiles, saying so, and the other loads what it left."""
    started = [_in_a_process(ONE_KERNEL, NUMBA_CACHE_DIR=str(tmp_path)) for _ in range(2)]
    ended = [process.communicate() for process in started]
    counts = sorted(out.decode().split() for out, _ in ended)
    assert counts == [["0", "1"], ["1", "0"]]
    assert sorted(err.decode().count("compiling motor.revolution") for _, err in ended) == [0, 1]


def test_what_is_compiled_already_waits_for_no_one():
    """While another process holds the lock, a kernel that lies on the disk is loaded at once."""
    simulate(ImpactBeam(), 1)
    with FileLock(compilation._lock_file(advance_joints)):
        code = "from chaosgym import *; simulate(ImpactBeam(), 1); print('done')"
        process = _in_a_process(code, CHAOSGYM_KERNELS="")
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
@pytest.mark.parametrize(("ending", "damage"), [("nbi", "empty"), ("nbi", "half"), ("nbc", "bit"), ("nbc", "empty")])
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


def _first_diagnosis(**environment):
    """What `diagnose` of a beam writes to standard error in a fresh account, and what it compiles into its cache."""
    code = "from chaosgym import *; print(diagnose(ImpactBeam(excitation_frequency=19.0)).nature)"
    out, err = _in_a_process(code, **environment).communicate()
    assert out.decode().strip() == "periodic", err.decode()
    return err.decode()


@pytest.mark.skipif(not (SHIPPED / kernel_digest()).exists(), reason="`python -m chaosgym.kernels` has not been run")
def test_the_first_diagnosis_of_an_account_compiles_nothing(tmp_path):
    """Machine code comes with the package, also for a processor of another name than the one it was compiled on."""
    fresh = {"CHAOSGYM_KERNELS": "", "NUMBA_CACHE_DIR": "", "HOME": str(tmp_path), "XDG_CACHE_HOME": ""}
    assert _first_diagnosis(**fresh) == ""
    assert _first_diagnosis(**fresh, NUMBA_CPU_NAME="haswell") == ""
    assert not list(tmp_path.rglob("*.nbc"))


@pytest.mark.slow
def test_machine_code_of_another_numba_is_not_used(tmp_path):
    """Sources copied with the machine code of another version compile their own, and a line says why."""
    package = tmp_path / "chaosgym"
    shutil.copytree(Path(chaosgym.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__", "weights"))
    made_for = package / "compiled" / "made-for.txt"
    made_for.write_text("numba 0.1, Python 3.11, x86-64-v3")
    for folder in made_for.parent.iterdir():
        if folder.is_dir():
            folder.rename(folder.with_name(f"other-{folder.name}"))
    environment = {"CHAOSGYM_KERNELS": "", "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
    out, err = _in_a_process(ANSWER, **environment).communicate()
    assert float(out) > 0.0
    assert "once on this computer: the package has machine code for numba 0.1" in err.decode()


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
