"""Digests of models, motions, verdicts and multipliers of machines of every kind: equal on every processor.

`python -m tests.golden.digests` prints them as JSON; with the word `all` those of all machines. Processors are emulated
by environment variables (``PROCESSORS``), which libraries read once, so each has a process of its own.
"""

import hashlib
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from numpy._core._multiarray_umath import __cpu_features__

import chaosgym
from chaosgym.machines import Machine
from chaosgym.machines.family import KINDS, drawn_machine
from tests.golden.bits import arrays_of
from tests.golden.scenes import scenes

AVX512 = bool(__cpu_features__.get("X86_V4") or __cpu_features__.get("AVX512_SKX"))
"""Whether this processor can run as one with AVX-512."""

NO_AVX512 = {"NPY_DISABLE_CPU_FEATURES": "X86_V4 AVX512_ICL"} if AVX512 else {}

PROCESSORS = {
    **({"SkylakeX": {}} if AVX512 else {}),
    "Haswell": NO_AVX512,
    "Prescott": NO_AVX512,
}
"""Environment of sets of kernels of OpenBLAS: the newest, that of most processors, the oldest.

All have fused multiply-add, as processors since 2013 do.
"""

FEW = ("impact-beam: periodic", "impact-beam: chaotic", "slider-crank: both joints", "four-bar-akhadkar", "gear")
"""What is compared where not all is."""

CYCLES = 12
"""Cycles of a motion: enough for chaos to magnify a rounding a millionfold."""


def digest(value: Any) -> str:
    """Hash of all bits of an array, or of what a value prints."""
    content = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
    return hashlib.sha256(content).hexdigest()[:12]


def _machines(everything: bool) -> Iterator[tuple[str, Machine]]:
    yield from ((name, machine) for name, machine in scenes() if everything or name in FEW)
    rng = np.random.default_rng(7)
    yield from ((kind, drawn_machine(kind, rng).machine) for kind in KINDS if everything)
    for path in sorted(Path("docs/machines").glob("*.toml")):
        if everything or path.stem in FEW:
            yield path.stem, chaosgym.read_machine(path)


def digests(everything: bool) -> dict[str, str]:
    """Digests by what they are of."""
    found = {}
    for name, machine in _machines(everything):
        model = machine.reduce()
        if isinstance(model, tuple):
            # a table is working space that kernels fill
            arrays = arrays_of(model, "").items()
            whole = b"".join(array.tobytes() for field, array in arrays if not field.endswith("table"))
            found[f"{name}: model"] = hashlib.sha256(whole).hexdigest()[:12]
        record = chaosgym.simulate(machine, CYCLES, samples_per_cycle=4)
        for field in ("section", "peak_force", "history"):
            found[f"{name}: {field}"] = digest(np.asarray(getattr(record, field)))
        found[f"{name}: natural frequencies"] = digest(np.asarray(machine.natural_frequencies))
    for name, machine in scenes():
        if everything or name in FEW:
            verdict = chaosgym.diagnose(machine, budget=2000 if everything else 200)
            found[f"{name}: verdict"] = digest(json.dumps(verdict.as_dict(), default=str))
    beam = dict(scenes())["impact-beam: periodic"]
    near = chaosgym.simulate(beam, 1, transient=100).final_state
    orbit = chaosgym.diagnosis.find_periodic_orbit(beam, near, period=1)
    assert orbit is not None
    found["multipliers"] = digest(orbit.multipliers)
    for task in ("chaosgym/ImpactBeamTolerance-v1", "chaosgym/SliderCrankTolerance-v1") if everything else ():
        envs = gym.make_vec(task, num_envs=3)
        envs.action_space.seed(5)
        found[f"{task}: reset"] = digest(envs.reset(seed=5)[0])
        for step in range(2):
            found[f"{task}: step {step}"] = digest(envs.step(envs.action_space.sample())[0])
    return found


def on(processor: str, *words: str) -> dict[str, str]:
    """Digests that a process of its own computes as on a processor."""
    environment = {**os.environ, "OPENBLAS_CORETYPE": processor, **PROCESSORS[processor]}
    command = [sys.executable, "-m", "tests.golden.digests", *words]
    done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    result: dict[str, str] = json.loads(done.stdout)
    return result


if __name__ == "__main__":
    json.dump(digests("all" in sys.argv), sys.stdout, indent=0)
