"""Machine code that the package ships: `python -m chaosgym.kernels` compiles it into the package's own folder.

What builds or installs the package runs this (``hatch_build.py``), for the Python and numba at hand and the oldest
processor that is served (``core.kernel_cache.BASELINE``). What is there already stays; what is of other sources or
versions goes. A kernel that is missing is compiled where it is first called.
"""

import os
import platform
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from chaosgym.core.kernel_cache import BASELINE, MADE_FOR, SHIPPED, environment, kernel_digest, source_digest

PROCESSES = 4
"""Most processes that compile, of half a gigabyte each; more would wait for kernels of each other."""

_JOINTS = """
[structure]
frequencies = "20, 55 Hz"
modal_damping = ["5, 0 1/s", "0, 40 1/s"]
[structure.shapes]
one = "1, 0 kg^-1/2"
other = "0.3, 1 kg^-1/2"
[[joint]]
name = "first"
at = "one"
clearance = "0.1 mm"
stiffness = "1 N/um"
damping = "40 N s/m"
{friction}
[[joint]]
name = "second"
at = "other"
clearance = "0.1 mm"
stiffness = "1 N/um"
damping = "40 N s/m"
[[drive]]
at = "one"
force = "15 N"
[operation]
speed = "18 Hz"
speed_range = "8 to 45 Hz"
clearance_range = "0.05 to 0.6 mm"
"""

_FRICTION = 'friction = 0.3\ntangent = "other"\ntangential_stiffness = "0.05 N/um"'


def _calls(folder: Path) -> Iterator[tuple[str, Callable[[], object]]]:
    """What calls the kernels that users meet, by name; files of machines go into a folder."""
    import gymnasium

    from chaosgym import ImpactBeam, RungeKutta4, SliderCrank, diagnose, read_machine, simulate
    from chaosgym.classifier import classifier_for
    from chaosgym.envs import ENVIRONMENTS, register_environments
    from chaosgym.machines.machine_file import TEMPLATES, template

    beam, crank = ImpactBeam(), SliderCrank()
    texts = {name: template(name) for name in TEMPLATES}
    texts |= {"joints": _JOINTS.format(friction=""), "joints that rub": _JOINTS.format(friction=_FRICTION)}
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text, encoding="utf-8")

    def several(machine: "ImpactBeam | SliderCrank") -> None:
        fixed = RungeKutta4(4000)
        for one in (machine, machine.at(speed=1.01 * getattr(machine, machine.speed_field))):
            simulate(one, 1, integrator=fixed)
            simulate(one, 1, samples_per_cycle=4)
        classifier_for(machine).classify(machine)

    def one_step(name: str) -> None:
        envs = gymnasium.make_vec(name, num_envs=2, cycles_per_step=2)
        envs.reset(seed=1)
        envs.step(envs.action_space.sample())
        env = gymnasium.make(name, cycles_per_step=2)
        env.reset(seed=1)
        env.step(env.action_space.sample())

    register_environments()
    yield "diagnose impact-beam", partial(diagnose, beam)
    yield "diagnose slider-crank", partial(diagnose, crank, budget=200)
    scenes: tuple[dict[str, Any], ...] = (
        {"ball_joint": "spherical"},
        {"contact_law": "hertz"},
        {"slider_joint": "instrumented"},
    )
    for scene in scenes:
        yield f"a crank, {scene}", partial(simulate, SliderCrank(**scene), 3, samples_per_cycle=4)
    for name in texts:
        yield f"a machine of {name}", partial(diagnose, read_machine(folder / f"{name}.toml"), budget=100)
    yield "integrators and batches of the beam", partial(several, beam)
    yield "those of the crank", partial(several, crank)
    for name in (*ENVIRONMENTS[:2], *ENVIRONMENTS[3:5], "chaosgym/AnyMachine-v0"):
        yield name, partial(one_step, name)


def compile_all() -> None:
    """Compile whatever the package lacks for this Python, this numba and the oldest processor.

    Raises
    ------
    subprocess.CalledProcessError
        If some kernel does not compile.
    """
    content, complete = f"{environment()}, {source_digest(SHIPPED.parent)}", SHIPPED / "complete.txt"
    if complete.exists() and complete.read_text() == content:
        return
    if not (MADE_FOR.exists() and MADE_FOR.read_text() == environment() and (SHIPPED / kernel_digest()).exists()):
        shutil.rmtree(SHIPPED, ignore_errors=True)
    SHIPPED.mkdir(exist_ok=True)
    MADE_FOR.write_text(environment())
    target = {"NUMBA_CPU_NAME": BASELINE[platform.machine()], "NUMBA_CPU_FEATURES": ""}
    # numba reads its environment once, so what compiles for another processor is another process
    here = {**os.environ, **target, "NUMBA_CACHE_DIR": str(SHIPPED), "CHAOSGYM_KERNELS": ""}
    command = [sys.executable, "-m", "chaosgym.kernels"]
    count = min(PROCESSES, os.cpu_count() or 1)
    started = [subprocess.Popen([*command, f"{k}", f"{count}"], env=here) for k in range(count)]
    if failed := [process for process in started if process.wait()]:
        raise subprocess.CalledProcessError(failed[0].returncode, failed[0].args)
    for lock in SHIPPED.rglob("*.lock"):
        lock.unlink()
    complete.write_text(content)


def _here(first: int, count: int) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for name, call in islice(_calls(Path(folder)), first, None, count):
            print(f"kernels: {name}", flush=True)
            call()


if __name__ == "__main__":
    _here(*map(int, sys.argv[1:])) if sys.argv[1:] else compile_all()
