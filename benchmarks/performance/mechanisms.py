"""Mechanisms from files against the crank of the thesis: what a cycle costs, and what it takes to assemble one.

Processor time of the thread counts. The crank is timed before every repetition, so that both meet the same other work.
"""

import itertools
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

from chaosgym import read_machine
from chaosgym.machines import Machine
from chaosgym.machines.slider_crank import SliderCrank
from chaosgym.simulation import simulate
from chaosgym.simulation.record import MotionState

FOLDER = Path(__file__).parents[2] / "docs" / "machines"

RIGID = (FOLDER / "compressor.toml").read_text(encoding="utf-8")
BENDING = """[link.rod.beam]
length = "110 mm"
width = "10 mm"
height = "14 mm"
youngs_modulus = "70 GPa"
density = "2700 kg/m^3"
modes = 2
damping_ratio = "1 %"
[[link.rod.body]]
at = "start"
mass = "0.12 kg"
inertia = "4e-5 kg m^2"
[[link.rod.body]]
at = "end"
mass = "0.04 kg"
inertia = "5e-6 kg m^2"

"""
"""A rod of aluminium that bends and stretches, with its eyes as bodies."""


def flexible_compressor() -> str:
    """Text of the compressor of docs/machines whose rod bends."""
    before, rest = RIGID.split("[link.rod]")
    after = rest[rest.index("[link.piston]") :]
    return (before + BENDING + after).replace('"rod.small"', '"rod.end"').replace('"rod.big"', '"rod.start"')


CYCLES = {
    "slider-crank-flores-guide": 1.5,
    "slider-crank-flores-wrist": 5.0,
    "four-bar-akhadkar": 5.0,
    "compressor": 5.0,
    "compressor, flexible rod": 10.0,
}
"""Largest cost of a cycle that is aimed at, as a ratio to that of the crank of the thesis."""

ASSEMBLY = {
    "crank in the plane": 15.0,
    "crank in space": 50.0,
    "crank in the plane, lengths seen": 15.0,
    "crank in space, lengths seen": 50.0,
    "crank from a file": 60.0,
    "crank from a file, flexible rod": 60.0,
    "crank in space from a file": 60.0,
}
"""Longest assembly that is aimed at [ms]."""

BLOCK, SETTLED = 50, 50
"""Cycles that are timed at once, and before."""


class CycleCost(NamedTuple):
    """Cost of a cycle of a mechanism, as a ratio to that of the crank of the thesis, and what was aimed at."""

    machine: str
    coordinates: int
    contacts: int
    microseconds: float
    ratio: float
    target: float


def _read(name: str) -> Any:
    """A mechanism of ``CYCLES``, from a file that was never read."""
    bending = name == "compressor, flexible rod"
    text = flexible_compressor() if bending else (FOLDER / f"{name}.toml").read_text(encoding="utf-8")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mechanism.toml"
        path.write_text(text, encoding="utf-8")
        return read_machine(path)


def _seconds(work: Callable[[], Any]) -> float:
    start = time.thread_time()
    work()
    return time.thread_time() - start


def _cycle(machine: Machine, state: MotionState) -> float:
    return _seconds(lambda: simulate(machine, BLOCK, state)) / BLOCK


def cycle_costs(repeats: int = 5) -> list[CycleCost]:
    """Cost of a settled cycle of every mechanism of ``CYCLES`` on its default rung, medians of ``repeats``."""
    crank = SliderCrank()
    settled = simulate(crank, SETTLED).final_state
    rows = []
    for name, target in CYCLES.items():
        machine: Any = _read(name)
        state = simulate(machine, SETTLED).final_state
        pairs = [(_cycle(crank, settled), _cycle(machine, state)) for _ in range(repeats)]
        ratio = statistics.median(own / reference for reference, own in pairs)
        cost = 1e6 * statistics.median(own for _, own in pairs)
        names, contacts = machine.degrees_of_freedom, machine.contacts
        rows.append(CycleCost(name, len(names), len(contacts), cost, ratio, target))
    return rows


def assembly_times(repeats: int = 5) -> dict[str, float]:
    """Milliseconds to assemble a mechanism that was never seen, reading of a file included, medians of ``repeats``."""
    lengths = itertools.count(0.24, 1e-5)
    work: dict[str, Callable[[], Any]] = {
        "crank in the plane": lambda: SliderCrank(rod_length=next(lengths)).held(),
        "crank in space": lambda: SliderCrank(motor_angle=15.0, rod_length=next(lengths)).held(),
        "crank in the plane, lengths seen": lambda: SliderCrank().held(),
        "crank in space, lengths seen": lambda: SliderCrank(motor_angle=15.0).held(),
        "crank from a file": lambda: _read("slider-crank-flores-guide").reduce(),
        "crank from a file, flexible rod": lambda: _read("compressor, flexible rod").reduce(),
        "crank in space from a file": lambda: _read("slider-crank-thesis-15deg").reduce(),
    }
    times = {}
    for name, make in work.items():
        make()
        times[name] = 1e3 * statistics.median(_seconds(make) for _ in range(repeats))
    return times
