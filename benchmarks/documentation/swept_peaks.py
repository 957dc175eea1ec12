"""The measured sweep of the documentation: peaks of the beam with a soft pivot, with errors of the thesis' sensor.

Figure 3.16 has 30 peaks at each frequency, read by a sensor that errs by +-3 N; its numbers are not in print. Candidate
C of the search (``thesis/scorecard/candidates.json``) stands for the beam of the experiment.

    python -m benchmarks.documentation.swept_peaks docs/data/sweep.csv
"""

import sys
from pathlib import Path

import numpy as np

from chaosgym.files import write_atomically
from chaosgym.simulation import simulate
from thesis.scorecard.candidates import read_candidate

CLEARANCE, CYCLES, TRANSIENT, ERROR = 0.127e-3, 30, 200, 3.0


def swept_peaks() -> str:
    """Frequency [Hz] and peak force [N], one line a cycle, from 4 to 30 Hz."""
    beam, generator = read_candidate("C").machine, np.random.default_rng(0)
    lines = ["frequency [Hz],peak [N]"]
    for frequency in range(4, 31):
        record = simulate(beam.at(float(frequency), CLEARANCE), CYCLES, transient=TRANSIENT)
        errors = generator.uniform(-ERROR, ERROR, CYCLES)
        read = np.maximum(record.peak_force[:, 0] + errors, 0.0)
        lines += [f"{frequency},{peak:.1f}" for peak in read]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write_atomically(Path(sys.argv[1]), lambda temporary: temporary.write_text(swept_peaks()))
