"""What questions load and pass: modules and processor time of judging a CSV, and the calls of three journeys.

Each is run in a process of its own. A call counts if it is of a function of the library, and no import is under way.
"""

import contextlib
import io
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from types import CodeType, FrameType
from typing import Any

import numpy as np

JUDGE_PEAKS = ("judge", "peaks.csv")
JUDGE_SERIES = ("judge", "series.csv", "--column", "force", "--cycle", "19 Hz")
CLEARANCE = ("diagnose", "impact-beam", "--clearance-mm", "0.1234567")
CLEARANCE_MM = 0.1234567
ENVIRONMENT = "chaosgym/ImpactBeamTolerance-v1"

UNITS = {"m": 1e-3 * CLEARANCE_MM, "mm": CLEARANCE_MM, "um": 1e3 * CLEARANCE_MM}
"""What the clearance of ``CLEARANCE`` is in each unit."""

_CHILD = "import sys; from benchmarks.house.running import answer; answer(sys.argv[1])"

OPTIMIZED = 0x1
"""Flag of the code of functions, which bodies of modules and classes lack (``inspect.CO_OPTIMIZED``)."""


class _Arrived(BaseException):
    """The journey has reached its end."""


class Trace:
    """Calls of the library's functions, as ``sys.setprofile`` tells them, until one of some kernels is called."""

    def __init__(self, folder: str, kernels: set[CodeType]) -> None:
        self.folder = folder + os.sep
        self.kernels = kernels
        self.calls: list[tuple[str, str]] = []
        self.units: list[str] = []
        self.depth = 0

    def __call__(self, frame: FrameType, event: str, value: Any) -> None:
        """Note a call or a return."""
        code = frame.f_code
        if event not in ("call", "return") or not code.co_flags & OPTIMIZED or not self._own(code):
            return
        if self._imports(frame):
            return
        if event == "call":
            self.calls.append((code.co_filename, code.co_qualname))
            for one in list(frame.f_locals.values()):
                self._note_unit(one)
        else:
            self._note_unit(value)
        if event == "call" and code in self.kernels:
            self.depth = sum(1 for each in _callers(frame) if self._own(each.f_code))
            sys.setprofile(None)
            raise _Arrived

    def _own(self, code: CodeType) -> bool:
        return code.co_filename.startswith(self.folder)

    def _imports(self, frame: FrameType) -> bool:
        """Whether the body of a module of the library is under way."""
        return any(each.f_code.co_name == "<module>" and self._own(each.f_code) for each in _callers(frame))

    def _note_unit(self, value: Any) -> None:
        if isinstance(value, float):
            unit = next((unit for unit, size in UNITS.items() if math.isclose(value, size, rel_tol=1e-9)), None)
            if unit and self.units[-1:] != [unit]:
                self.units.append(unit)

    def as_dict(self) -> dict[str, Any]:
        """Calls, different functions, and the modules that define them."""
        return {
            "calls": len(self.calls),
            "functions": len(set(self.calls)),
            "modules": len({file for file, _ in self.calls}),
        }


def _callers(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def judging(repeats: int = 5) -> dict[str, Any]:
    """Modules of the library that judging a CSV of peaks loads, whether numba, and its least processor time [s]."""
    runs = [_in_a_process("judge") for _ in range(repeats)]
    return {**runs[0], "processor_seconds": min(run["processor_seconds"] for run in runs)}


def journey(name: str) -> dict[str, Any]:
    """Calls, functions and modules of one of ``JOURNEYS``."""
    return _in_a_process(name)


def _in_a_process(name: str) -> dict[str, Any]:
    result = subprocess.run([sys.executable, "-c", _CHILD, name], capture_output=True, text=True)
    if result.returncode:
        raise RuntimeError(f"{name} ended with code {result.returncode}:\n{result.stderr}")
    answer: dict[str, Any] = json.loads(result.stdout.splitlines()[-1])
    return answer


def _run(words: Sequence[str]) -> None:
    """Run a command of the library in a new folder that holds the files to be judged, and drop what it prints."""
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()):
        _write_files()
        app = __import__("chaosgym.cli", fromlist=["app"]).app
        app(list(words), standalone_mode=False)


def _write_files() -> None:
    """400 peaks of a logistic map, and 20 s of a pulse a cycle at 19 Hz."""
    peaks = [0.3]
    while len(peaks) < 400:
        peaks.append(3.9 * peaks[-1] * (1.0 - peaks[-1]))
    Path("peaks.csv").write_text("force [N]\n" + "\n".join(f"{100.0 * peak:.3f}" for peak in peaks) + "\n")
    moments = np.arange(40_000) / 2000.0
    force = 100.0 * np.maximum(np.sin(2.0 * np.pi * 19.0 * moments), 0.0) ** 4
    force += np.random.default_rng(0).normal(0.0, 0.5, len(force))
    rows = (f"{moment:.4f},{one:.3f}" for moment, one in zip(moments, force, strict=True))
    Path("series.csv").write_text("time [s],force [N]\n" + "\n".join(rows) + "\n")


def _judge() -> dict[str, Any]:
    _run(JUDGE_PEAKS)
    seconds = time.process_time()
    return {
        "command": " ".join(JUDGE_PEAKS),
        "modules_of_machines": sum(name.startswith("chaosgym.machines") for name in _loaded()),
        "numba": "numba" in sys.modules,
        "processor_seconds": seconds,
    }


def _loaded() -> list[str]:
    """Modules of the library that this process has loaded."""
    return [name for name in sys.modules if name.partition(".")[0] == "chaosgym"]


def _traced(run: Callable[[], Any], kernels: set[CodeType]) -> Trace:
    import chaosgym

    trace = Trace(os.path.dirname(chaosgym.__file__), kernels)
    sys.setprofile(trace)
    try:
        run()
    except _Arrived:
        pass
    finally:
        sys.setprofile(None)
    return trace


def _clearance() -> dict[str, Any]:
    """From the command line to the first kernel: kernels are left in Python, and noted as they are declared."""
    os.environ["NUMBA_DISABLE_JIT"] = "1"
    import numba

    kernels: set[CodeType] = set()

    def noted(function: Any = None, *_: Any, **__: Any) -> Any:
        if callable(function):
            kernels.add(function.__code__)
            return function
        return noted

    numba.njit = noted
    import chaosgym.core.compilation

    chaosgym.core.compilation.prepare = lambda *_: None  # it refuses kernels in Python
    trace = _traced(lambda: _run(CLEARANCE), kernels)
    if not trace.depth:
        raise RuntimeError(f"{' '.join(CLEARANCE)} called no kernel")
    return {"command": " ".join(CLEARANCE), **trace.as_dict(), "stack": trace.depth, "units": " ".join(trace.units)}


def _step() -> dict[str, Any]:
    """A step of an environment that has made one before."""
    import gymnasium

    import chaosgym  # noqa: F401 # registers the environments

    env = gymnasium.make(ENVIRONMENT).unwrapped
    env.reset(seed=0)
    action = env.action_space.sample()
    env.step(action)
    return {"environment": ENVIRONMENT, **_traced(lambda: env.step(action), set()).as_dict()}


def _series() -> dict[str, Any]:
    return {"command": " ".join(JUDGE_SERIES), **_traced(lambda: _run(JUDGE_SERIES), set()).as_dict()}


JOURNEYS = {"clearance": _clearance, "step": _step, "series": _series}
"""From a clearance on the command line to the first kernel, a step of an environment, judging a series."""


def answer(name: str) -> None:
    """Print what one of the journeys, or judging a CSV, loads and passes."""
    result = {"judge": _judge, **JOURNEYS}[name]()
    print(json.dumps({**result, "modules_loaded": len(_loaded())}))
