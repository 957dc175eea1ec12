"""A made-up machine's sweep whose right answers are known: straight borders, and records of the logistic map."""

import numpy as np
import pyarrow as pa

from chaosgym.machines import THESIS_IMPACT_BEAM, ImpactBeam
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


def settled(rate, cycles=CYCLES):
    """Peaks of the logistic map after 500 cycles."""
    return logistic(rate, 0.3, 500 + cycles)[500:]


def made_up_sweep(seed=0):
    """Speed and clearance decide the type by a straight border; Type III is chaotic, I and II periodic."""
    generator = np.random.default_rng(seed)
    machine = np.repeat(np.arange(MACHINES), 12)
    speed = np.exp(generator.uniform(np.log(4.0), np.log(30.0), len(machine)))
    clearance = np.exp(generator.uniform(np.log(2e-5), np.log(2e-4), len(machine)))
    level = np.log(speed / 11.0) + 0.5 * np.log(clearance / 6e-5)
    types = np.where(level < -0.4, "I", np.where(level < 0.3, "II", "III"))
    rates = np.where(types == "I", 2.6, np.where(types == "II", 3.2, 3.9)) + 0.05 * generator.random(len(machine))
    start = np.stack([logistic(rate, generator.uniform(0.2, 0.8), CYCLES) for rate in rates])
    late = np.stack([settled(rate) for rate in rates])
    columns = {
        "excitation_frequency": speed,
        "clearance": clearance,
        "machine": machine,
        "split": np.array(["test", "validation", "train", "train", "train"])[machine % 5],
        "response_type": types,
        "nature": np.where(types == "III", "chaotic", "periodic"),
        "period": pa.array([{"I": 1, "II": 2}.get(kind) for kind in types], pa.int32()),
        "exponent": np.where(types == "III", 0.5, -0.5),
        "peak_force_min": late.min(axis=1),
        "peak_force_max": late.max(axis=1),
    }
    kind = pa.list_(pa.float32(), CYCLES)
    for name, peaks in (("start", start), ("settled", late)):
        columns[f"{name}_peak_force"] = pa.array(peaks.astype(np.float32).tolist(), kind)
        columns[f"{name}_displacement"] = pa.array((1e-5 * peaks).astype(np.float32).tolist(), kind)
        columns[f"{name}_velocity"] = pa.array((1e-3 * peaks).astype(np.float32).tolist(), kind)
    base = {name: getattr(THESIS_IMPACT_BEAM, name) for name in parameters_of(ImpactBeam)}
    axes = [{"field": "excitation_frequency"}, {"field": "clearance"}]
    return LabelledSweep(pa.table(columns), {"machine": "impact-beam", "base": base, "axes": axes})
