"""A made-up machine's sweep whose right answers are known: straight borders, and records of the logistic map."""

import numpy as np
import pyarrow as pa

from chaosgym.classifier.features import as_records, response_features
from chaosgym.machines import ImpactBeam
from chaosgym.machines.parameters import parameters_of
from chaosgym.sweeps import LabelledSweep

MACHINES, CYCLES = 60, 64


def logistic(rate, start, cycles):
    """Peaks of 20 to 60 N from the logistic map."""
    x = np.empty(cycles)
    x[0] = start
    for i in range(cycles - 1):
        x[i + 1] = rate * x[i] * (1.0 - x[i])
    return 20.0 + 40.0 * x


def record_features(peaks, section=None, sensor_error=None):
    """Figures of records, (n_records, n_features)."""
    forces, states, errors = as_records(peaks, section, sensor_error)
    return response_features(None, None, forces, states, errors)


def settled(rate, cycles=CYCLES):
    """Peaks of the logistic map after 500 cycles."""
    return logistic(rate, 0.3, 500 + cycles)[500:]


def made_up_sweep(seed=0):
    """Speed and clearance decide the nature by a straight border; the records of a period are 1 or 2."""
    generator = np.random.default_rng(seed)
    machine = np.repeat(np.arange(MACHINES), 12)
    speed = np.exp(generator.uniform(np.log(4.0), np.log(30.0), len(machine)))
    clearance = np.exp(generator.uniform(np.log(2e-5), np.log(2e-4), len(machine)))
    level = np.log(speed / 11.0) + 0.5 * np.log(clearance / 6e-5)
    rates = np.where(level < -0.4, 2.6, np.where(level < 0.3, 3.2, 3.9)) + 0.05 * generator.random(len(machine))
    start = np.stack([logistic(rate, generator.uniform(0.2, 0.8), CYCLES) for rate in rates])
    late = np.stack([settled(rate) for rate in rates])
    columns = {
        "excitation_frequency": speed,
        "clearance": clearance,
        "machine": machine,
        "split": np.array(["test", "validation", "train", "train", "train"])[machine % 5],
        "nature": np.where(level < 0.3, "periodic", "chaotic"),
    }
    kind = pa.list_(pa.float32())
    columns["settled_peak_force"] = pa.array(late.astype(np.float32).tolist(), kind)
    for name, factor in (("peak_force", 1.0), ("displacement", 1e-5), ("velocity", 1e-3)):
        columns[f"start_{name}"] = pa.array((factor * start).astype(np.float32).tolist(), kind)
    base = {name: getattr(ImpactBeam(), name) for name in parameters_of(ImpactBeam)}
    axes = [
        {"field": "excitation_frequency", "low": 4.0, "high": 30.0},
        {"field": "clearance", "low": 2e-5, "high": 2e-4},
    ]
    return LabelledSweep(pa.table(columns), {"machine": "impact-beam", "base": base, "axes": axes})
