"""Recordings of the documentation whose nature one sensor can tell: a periodic one and a chaotic one.

Simulated machines are read once a cycle by a sensor whose errors are normal, with a standard deviation of 0.25 N: four
of these are the 1 N that its commands state. The beam at 12 Hz repeats every cycle. Chaos shows in one reading a cycle
where few numbers make the motion and errors grow slowly. The impact oscillator has one degree of freedom, and at the
ratio 2.85, beyond its period doublings, errors grow e^0.5 times a cycle. Those of the beam at 30 Hz grow e^4 times, so
that ``docs/data/peaks.csv`` is undetermined.

    python -m benchmarks.documentation.sample_recordings docs/data
"""

import sys
from pathlib import Path

import numpy as np

from chaosgym import ImpactBeam, read_machine, simulate
from chaosgym.files import write_atomically
from chaosgym.machines import Machine

CYCLES, TRANSIENT, SIGMA = 2000, 200, 0.25
OSCILLATOR = "docs/machines/shaw-holmes-1983.toml"


def recording(machine: Machine, origin: str, seed: int) -> str:
    """Peak forces [N] at a machine's upper stop, one a line, below comments that tell their origin."""
    errors = SIGMA * np.random.default_rng(seed).standard_normal(CYCLES)
    readings = np.maximum(simulate(machine, CYCLES, transient=TRANSIENT).peak_force[:, 0] + errors, 0.0)
    sensor = f"sensor error normal, standard deviation {SIGMA} N (4 of them: 1 N), numpy default_rng({seed})"
    head = [f"# simulated: {origin}, from cycle {TRANSIENT} on", f"# {sensor}", "peak [N]"]
    return "\n".join([*head, *(f"{reading:.2f}" for reading in readings)]) + "\n"


def recordings(seed: int = 0) -> dict[str, str]:
    """Text of each recording by the name of its file."""
    beam = ImpactBeam(excitation_frequency=12.0, clearance=0.127e-3)
    oscillator = read_machine(Path(__file__).parents[2] / OSCILLATOR).at(2.85, 0.0)
    return {
        "periodic.csv": recording(beam, "impact-beam at 12 Hz, clearance 0.127 mm", seed),
        "chaotic.csv": recording(oscillator, f"{OSCILLATOR} at 2.85 Hz, clearance 0 mm", seed),
    }


def write(path: Path, text: str) -> None:
    """Write a file whole, or not at all."""
    write_atomically(path, lambda unfinished: unfinished.write_text(text))


if __name__ == "__main__":
    for name, recorded in recordings().items():
        write(Path(sys.argv[1], name), recorded)
