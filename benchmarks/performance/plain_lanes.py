"""What vectors of LLVM buy: the beam with the operations of ``core.lanes`` as plain loops of numba, and as they are.

    python -m benchmarks.performance.plain_lanes

The loops compile in a process and a folder of their own, for a minute. Peak forces agree but for roundings, so that
each is a check of the other.
"""

# mypy: disallow-untyped-defs=False, disallow-untyped-calls=False, check-untyped-defs=False
import json
import os
import subprocess
import sys
import tempfile
import time
from typing import Any

import numba

from chaosgym.core import lanes as vectors

OVERSHOOT = 4.0 / 27.0
SPEEDS, MODES = (30.0, 19.0, 10.0), (4, 10, 20)
"""Speeds [Hz] and numbers of modes of the beam."""

CYCLES, RUNS, FIRST = 400, 9, 4
"""Cycles of a timed run, runs, and cycles from rest whose peak forces are compared."""

plain = numba.njit(nogil=True, _nrt=False, error_model="numpy", no_cfunc_wrapper=True)


@plain
def sample(table, at, own, u_at, blocks, lanes, first_at, second_at):
    """As ``core.lanes.sample``."""
    for i in range(8):
        own[first_at + i] = 0.0
        own[second_at + i] = 0.0
    row = blocks * 8
    for q in range(2):
        to = second_at if q else first_at
        for k in range(2):
            for b in range(blocks):
                value = own[u_at + b + (lanes if k else 0)]
                o = at + b * 8 + row * (2 * q + k)
                for i in range(8):
                    own[to + i] += table[o + i] * value


@plain
def first_doubt(own, values_at, slopes_at, h, low, high, doubt, start):
    """As ``core.lanes.first_doubt``."""
    reach = h * OVERSHOOT
    for i in range(start, 8):
        left, right = own[values_at + i], own[values_at + i + 1]
        before, after = own[slopes_at + i], own[slopes_at + i + 1]
        rise = max(before, 0.0) - min(after, 0.0)
        fall = max(after, 0.0) - min(before, 0.0)
        upper = max(left, right) + reach * rise + doubt
        lower = min(left, right) - reach * fall - doubt
        if not (upper < high and lower > low):
            return i
    return 8


@plain
def propagate(entries, at, own, u_at, out_at, lanes):
    """As ``core.lanes.propagate``."""
    for i in range(lanes):
        x, y = own[u_at + i], own[u_at + lanes + i]
        own[out_at + i] = entries[at + i] * x + entries[at + lanes + i] * y
        own[out_at + lanes + i] = entries[at + 3 * lanes + i] * y + entries[at + 2 * lanes + i] * x


@plain
def propagate_and_expand(entries, at, generator_at, own, u_at, time, out_at, lanes):
    """As ``core.lanes.propagate_and_expand``."""
    for i in range(lanes):
        x0, y0 = own[u_at + i], own[u_at + lanes + i]
        first = entries[at + i] * x0 + entries[at + lanes + i] * y0
        second = entries[at + 3 * lanes + i] * y0 + entries[at + 2 * lanes + i] * x0
        b11, b12 = entries[generator_at + i] * time, entries[generator_at + lanes + i] * time
        b21, b22 = entries[generator_at + 2 * lanes + i] * time, entries[generator_at + 3 * lanes + i] * time
        x, y = first, second
        for term in range(6, 0, -1):
            dx = b11 * x + b12 * y
            dy = b22 * y + b21 * x
            x, y = dx * (1.0 / term) + first, dy * (1.0 / term) + second
        own[out_at + i] = x
        own[out_at + lanes + i] = y


@plain
def dot(table, at, own, u_at, width):
    """As ``core.lanes.dot``."""
    total = 0.0
    for i in range(width):
        total += table[at + i] * own[u_at + i]
    return total


@plain
def dot_of_sizes(table, at, own, u_at, width):
    """As ``core.lanes.dot_of_sizes``."""
    total = 0.0
    for i in range(width):
        total += table[at + i] * abs(own[u_at + i])
    return total


@plain
def add_columns(table, at, width, count, factors, factors_at, out, out_at, stride):
    """As ``core.lanes.add_columns``."""
    for v in range((width + 7) // 8):
        o = out_at + v * stride
        for i in range(8):
            out[o + i] = 0.0
        for c in range(count):
            f = factors[factors_at + c]
            for i in range(8):
                out[o + i] += table[at + v * 8 + c * width + i] * f


@plain
def add_tops(own, values_at, slopes_at, h, sign, weight, more, totals_at):
    """As ``core.lanes.add_tops``."""
    reach = h * OVERSHOOT
    for i in range(8):
        left, right = sign * own[values_at + i], sign * own[values_at + i + 1]
        before, after = sign * own[slopes_at + i], sign * own[slopes_at + i + 1]
        top = max(left, right) + reach * (max(before, 0.0) - min(after, 0.0))
        own[totals_at + i] = weight * top + (own[totals_at + i] + more)


@plain
def first_above(own, at, limit, start):
    """As ``core.lanes.first_above``."""
    for i in range(start, 8):
        if not own[at + i] < limit:
            return i
    return 8


PLAIN = (
    *(sample, first_doubt, propagate, propagate_and_expand, dot, dot_of_sizes),
    *(add_columns, add_tops, first_above),
)
"""Loops by the names of the operations that they stand for."""


def measured() -> dict[str, dict[str, float]]:
    """Microseconds of processor time a cycle, the least of ``RUNS``, and first peak forces [N], by model and speed."""
    from chaosgym import ImpactBeam, simulate

    found: dict[str, dict[str, float]] = {}
    for modes in MODES:
        for speed in SPEEDS:
            beam: Any = ImpactBeam(excitation_frequency=speed, n_modes=modes)
            peaks = simulate(beam, FIRST).peak_force
            took = []
            for _ in range(RUNS):
                began = time.process_time()
                simulate(beam, CYCLES)
                took.append(1e6 * (time.process_time() - began) / CYCLES)
            found[f"{modes} and 2 modes, {speed:g} Hz"] = {"us": min(took), "peak": float(peaks.sum())}
    return found


def put_in_place() -> int:
    """Let the modules of kernels hold the loops, before any kernel is compiled; return how many names were changed."""
    changed = 0
    for loop in PLAIN:
        vector = getattr(vectors, loop.__name__)
        for name, module in list(sys.modules.items()):
            if name.startswith("chaosgym.") and vars(module).get(loop.__name__) is vector:
                setattr(module, loop.__name__, loop)
                changed += 1
    return changed


def _here() -> None:
    import chaosgym.machines.modal_impact  # noqa: F401 # its kernels' modules

    assert put_in_place() > len(PLAIN), "the kernels use other operations"
    print(json.dumps(measured()))


def main() -> None:
    """Print both, and by what factor the vectors are faster."""
    with tempfile.TemporaryDirectory() as folder:
        alone = {**os.environ, "NUMBA_CACHE_DIR": folder, "CHAOSGYM_KERNELS": "none"}
        command = [sys.executable, "-m", __spec__.name, "plain"]
        told = subprocess.run(command, env=alone, check=True, capture_output=True, text=True).stdout
    loops, own = json.loads(told), measured()
    for name, one in own.items():
        other = loops[name]
        print(f"{name:24s} {one['us']:7.1f} us, plain {other['us']:7.1f} us: {other['us'] / one['us']:.2f} times")
        apart = abs(other["peak"] - one["peak"]) / one["peak"] if one["peak"] else abs(other["peak"])
        assert apart < 1e-6, f"{name}: peak forces differ by {apart:.1e}"


if __name__ == "__main__":
    _here() if sys.argv[1:] == ["plain"] else main()
