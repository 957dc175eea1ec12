"""The roofline of the beam's kernel: how far it is from the arithmetic limit of a core.

The kernel runs once more uncompiled, with its parts counted. Each part is a known number of additions and
multiplications for n modes; exp, sine, cosine, division and square root count for themselves. The same parts are timed,
compiled, in a loop of their own, which shows what they would take without what lies between them.
"""

import json
import math
import os
import statistics
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

from chaosgym.core import modal_impact
from chaosgym.core.cycle import Episode, cycle_arrays
from chaosgym.core.propagator import move, nudge, step_table, with_force
from chaosgym.machines import ImpactBeam
from chaosgym.simulation import ExactEvents, simulate

COUNTED = (
    "tip_motion",
    "curvature_bounds",
    "event_functions",
    "safe_time",
    "cubic",
    "cubic_extremum",
    "move",
    "nudge",
    "enter_regime",
    "leave_regime",
    "locate",
    "crest",
)
"""Functions of the kernel whose calls are counted; a call of ``curvature_bounds`` is a step."""

OPERATIONS_PER_CLOCK = 16
"""Double-precision operations per clock of a core with two 256-bit units for fused multiply-add."""

SPECIAL = 20
"""Operations that an exp, sine or cosine counts for; divisions and square roots count as one."""


def operations_of(name: str, modes: int) -> int:
    """Additions and multiplications in one call of a part of the kernel."""
    blocks, states, width = modes + 1, 2 * modes, 2 * modes + 2
    return {
        "step": 6 * blocks,
        "tip_motion": 6 * width,
        "curvature_bounds": 3 * width,
        "event_functions": 8,
        "safe_time": 6,
        "cubic": 20,
        "cubic_extremum": 14,
        "move": (10 + 3 * SPECIAL) * blocks,
        "nudge": 60 * blocks,
        "enter_regime": states * (2 * states + 6),
        "leave_regime": states * (2 * width + 2),
    }.get(name, 0)


def counted_cycle(beam: ImpactBeam, cycles: int, state: Any) -> dict[str, float]:
    """Calls of the kernel's parts per cycle; needs NUMBA_DISABLE_JIT=1."""
    counts: Counter[str] = Counter()

    def counting(name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        def counted(*arguments: Any) -> Any:
            counts[name] += 1
            return function(*arguments)

        return counted

    for name in COUNTED:
        setattr(modal_impact, name, counting(name, getattr(modal_impact, name)))
    settings = ExactEvents()
    arrays = cycle_arrays(cycles, 2 * beam.n_modes)
    episode = Episode(np.zeros(1), np.zeros(2))
    modal_impact.advance(
        beam.reduce(),
        np.array(state),
        episode,
        arrays,
        settings.step_phase,
        settings.event_tolerance,
        settings.event_budget,
    )
    # every step that neither ends at an event nor at the end of the cycle is a step of the table
    counts["step"] = counts["curvature_bounds"]
    counts["event"] = int(arrays.events.sum())
    return {name: count / cycles for name, count in counts.items()}


def _count_uncompiled(beam: ImpactBeam, cycles: int) -> dict[str, float]:
    """As ``counted_cycle``, in a process of its own whose kernels are not compiled."""
    state = simulate(beam, 200).final_state.coordinates.tolist()
    code = (
        "import json, sys; from chaosgym.machines import ImpactBeam; from benchmarks.roofline import counted_cycle;"
        "f, c, n, s = json.load(sys.stdin);"
        "print(json.dumps(counted_cycle(ImpactBeam(excitation_frequency=f, clearance=c), n, s)))"
    )
    given = json.dumps([beam.excitation_frequency, beam.clearance, cycles, state])
    done = subprocess.run(
        [sys.executable, "-c", code],
        input=given,
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "NUMBA_DISABLE_JIT": "1"},
    )
    counts: dict[str, float] = json.loads(done.stdout)
    return counts


def _repeated(part: str) -> Any:
    """A compiled loop of calls of one part."""
    enter, leave, motion = modal_impact.enter_regime, modal_impact.leave_regime, modal_impact.tip_motion

    if part == "move":

        @numba.njit
        def loop(model, regimes, u, moved, state, times):  # type: ignore[no-untyped-def]
            for i in range(times):
                move(regimes, 1, u, 1e-5 + 1e-12 * i, moved)
    elif part == "nudge":

        @numba.njit
        def loop(model, regimes, u, moved, state, times):  # type: ignore[no-untyped-def]
            for _ in range(times):
                nudge(regimes, 1, moved, 1e-9)
    elif part == "enter_regime":

        @numba.njit
        def loop(model, regimes, u, moved, state, times):  # type: ignore[no-untyped-def]
            for i in range(times):
                enter(model, regimes, 1, 1.0, state, 1.0, 1e-9 * i, moved)
    elif part == "leave_regime":

        @numba.njit
        def loop(model, regimes, u, moved, state, times):  # type: ignore[no-untyped-def]
            for _ in range(times):
                leave(model, regimes, 0, 1.0, u, state)
    else:

        @numba.njit
        def loop(model, regimes, u, moved, state, times):  # type: ignore[no-untyped-def]
            total = 0.0
            for _ in range(times):
                x, v, a = motion(regimes.output, 1, u, 0.0)
                total += x + v + a
                u[0] = 1e-9 * total

    return loop


def timed_parts(beam: ImpactBeam, times: int = 50_000) -> dict[str, float]:
    """Nanoseconds per call of the kernel's main parts, each alone in a loop."""
    model = beam.reduce()
    regimes = with_force(model.regimes, model.force_amplitude, 2.0 * math.pi * model.excitation_frequency)
    n = beam.n_modes
    table = step_table(regimes, 0.5 / regimes.fastest, 8)
    assert np.all(np.isfinite(table))
    result = {}
    for part in ("move", "nudge", "enter_regime", "leave_regime", "tip_motion"):
        loop = _repeated(part)
        u, moved, state = np.full(2 * n + 2, 1e-5), np.full(2 * n + 2, 1e-5), np.full(2 * n, 1e-5)
        loop(model, regimes, u, moved, state, 1)
        taken = []
        for _ in range(5):
            start = time.thread_time()
            loop(model, regimes, u, moved, state, times)
            taken.append(time.thread_time() - start)
        result[part] = 1e9 * statistics.median(taken) / times
    return result


def report(clock_ghz: float) -> list[str]:
    """Lines of the table for the default beam at 30 Hz."""
    beam = ImpactBeam()
    counts = _count_uncompiled(beam, 20)
    state = simulate(beam, 200).final_state
    taken = []
    for _ in range(9):
        start = time.thread_time()
        simulate(beam, 200, state)
        taken.append(time.thread_time() - start)
    seconds = statistics.median(taken) / 200
    alone = timed_parts(beam)
    lines = [f"{'part':18s} {'calls':>7s} {'operations':>10s} {'alone [us]':>10s}"]
    total = 0.0
    for name, count in sorted(counts.items(), key=lambda item: -item[1] * operations_of(item[0], beam.n_modes)):
        operations = count * operations_of(name, beam.n_modes)
        total += operations
        spent = f"{1e-3 * count * alone[name]:10.1f}" if name in alone else f"{'':10s}"
        lines.append(f"{name:18s} {count:7.1f} {operations:10.0f} {spent}")
    rate = total / seconds
    peak = 1e9 * clock_ghz * OPERATIONS_PER_CLOCK
    return [
        *lines,
        f"all                        {total:10.0f} operations in {1e6 * seconds:.1f} us a cycle",
        f"{1e-9 * rate:.2f} of {1e-9 * peak:.1f} GFlop/s at {clock_ghz:g} GHz: {rate / peak:.1%} of the peak",
    ]


if __name__ == "__main__":
    for line in report(float(sys.argv[1]) if len(sys.argv) > 1 else 2.6):
        print(line)
