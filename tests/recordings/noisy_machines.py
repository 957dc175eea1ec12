"""Records of simulated machines with noise at each section: beams, cranks and the published machine files.

Speed, force and clearance scatter from cycle to cycle, alone or together, white or persistent. Truth is the nature
without noise, the same at eight neighbours in speed and clearance, as far off as twice the noise.
"""

from pathlib import Path

import numpy as np

from chaosgym import ImpactBeam, SliderCrank, read_machine, simulate
from chaosgym.diagnosis.diagnose import diagnose_alone
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.machines.parameters import parameters_of, with_settings
from tests.recordings.held_out import STATEMENTS, finished, process_of

DOCS = Path(__file__).parents[2] / "docs"

# the thesis' crank in the plane is a kind of its own
PUBLISHED = sorted(path for path in (DOCS / "machines").glob("*.toml") if path.stem != "slider-crank-thesis")

FILES = tuple(str(path.relative_to(DOCS)) for path in PUBLISHED)

KINDS = ("noisy beam", "noisy crank", "noisy machine file")

NEAREST = 0.003
"""Share by which speed and clearance of the neighbours differ at the least."""

LEVELS = 16
"""Values that the noise takes: each is a model of its own."""


def drawn(kind, rng):
    """A machine: a random beam or crank, or a machine file whose speed and clearance are up to 10 % off."""
    if kind == "noisy beam":
        return ImpactBeam(excitation_frequency=rng.uniform(8.0, 32.0), clearance=rng.uniform(5e-5, 1.5e-4))
    if kind == "noisy crank":
        return SliderCrank(crank_speed=rng.uniform(120.0, 270.0), slider_clearance=rng.uniform(3e-5, 2.5e-4))
    machine = read_machine(DOCS / FILES[int(rng.integers(len(FILES)))])
    return shifted(machine, rng.uniform(-0.1, 0.1), rng.uniform(-0.1, 0.1))


def shifted(machine, of_speed, of_clearance):
    """The machine at another speed and clearance, by shares."""
    shares = {machine.speed_field: of_speed, machine.clearance_field: of_clearance}
    return with_settings(machine, {field: getattr(machine, field) * (1.0 + one) for field, one in shares.items()})


def firm(machine, near):
    """(nature, period) that the machine has at eight neighbours too; None where they differ, or nothing is pressed."""
    told = set()
    for of_speed in (0.0, -near, near):
        for of_clearance in (0.0, -near, near):
            verdict = diagnose_alone(shifted(machine, of_speed, of_clearance), budget=800)
            told.add((verdict.nature, verdict.period))
            if len(told) > 1 or verdict.nature not in ("periodic", "chaotic"):
                return None
    return told.pop()


def noise_of(machine, cycles, level, rng):
    """Operation of each cycle: noise of this standard deviation, as a share, on one field or on all that there are."""
    fields = [field for field in machine.operating_fields if getattr(machine, field) != 0.0]
    fields = fields if rng.random() < 0.5 else [fields[int(rng.integers(len(fields)))]]
    stays = 0.0 if rng.random() < 0.5 else 0.8
    chosen = rng.integers(LEVELS, size=cycles)
    kept = chosen[np.maximum.accumulate(np.where(rng.random(cycles) >= stays, np.arange(cycles), 0))]
    about, table = parameters_of(machine), {}
    for field in fields:
        values = getattr(machine, field) * (1.0 + level * rng.normal(size=LEVELS))
        table[field] = np.clip(values, about[field].low, about[field].high)[kept]
    return table


def make(kind, seed, statement=None):
    """One record of a kind; the same seed gives the same record."""
    rng = np.random.default_rng([seed, 4747, KINDS.index(kind)])
    statement = statement or STATEMENTS[seed % 4]
    while True:
        machine = drawn(kind, rng)
        cycles, level = int(rng.choice([64, 128, 256, 500, 1000])), float(rng.choice([1e-4, 1e-3, 3e-3, 1e-2]))
        try:
            told = firm(machine, max(NEAREST, 2.0 * level))
            if told is None:
                continue
            table = noise_of(machine, cycles, level, rng)
            series = machine.sensed(simulate(machine, cycles, transient=400, operation=table).peak_force)
        except (ParameterError, SimulationError):
            continue
        if np.mean(series) > 0.0:
            break
    nature, period = told
    process = float(np.std(process_of(series, period))) if nature == "periodic" else 0.5 * level * float(np.std(series))
    return finished(kind, rng, series, nature, period, statement, process=process)
