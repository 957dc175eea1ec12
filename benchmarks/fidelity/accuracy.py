"""Whether the model that a tolerance chooses is within it: random machines of all kinds over their whole boxes.

The reference is finer than any model that the estimate has seen: two steps finer than the chosen one. Where a machine's
ladder ends before, there is no reference, and the row says so. Errors are those of the mean peak force of settled
cycles, at points where both motions are periodic with the same period; natures are counted apart. Most machines whose
own motion does not repeat have no reference: its run would tell of their nature alone.
"""

import csv
import functools
import os
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.performance.mechanisms import flexible_compressor
from chaosgym.arrays import Array
from chaosgym.errors import ChaosgymError
from chaosgym.machines import ImpactBeam, Machine, SliderCrank
from chaosgym.machines.accuracy import model_within, tolerance_of
from chaosgym.machines.beam_element import bending_matrices
from chaosgym.machines.machine_file import read_machine
from chaosgym.machines.modal_machine import Drive, ModalMachine, Structure
from chaosgym.machines.parameters import with_settings
from chaosgym.series.two_step import two_step_test
from chaosgym.simulation import CycleRecord, simulate

TRANSIENT, CYCLES = 200, 32
"""Cycles before those that count, and these."""

ALSO = 4
"""Of machines whose motion does not repeat, one in so many has its nature compared with the reference's."""

ROUNDING = 1e-4
"""Error below which settled peak forces are compared no further: what is left of the transient."""

COLUMNS = (
    "index",
    "kind",
    "model",
    "estimated_error",
    "choice_ms",
    "cycle_us",
    "nature",
    "reference_nature",
    "peak_N",
    "reference_peak_N",
    "error",
    "reason",
)


def _spread(generator: np.random.Generator, low: float, high: float) -> float:
    """A number, even in the logarithm."""
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def random_beam(generator: np.random.Generator) -> ImpactBeam:
    """A beam of other dimensions, stops, damping and drive, at a point of its usual ranges."""
    usual, draw = ImpactBeam(), functools.partial(_spread, generator)
    ranges: dict[str, Any] = {
        field: draw(*usual.usual_ranges[field]) for field in ("excitation_frequency", "clearance")
    }
    length = usual.length * draw(0.6, 1.6)
    return ImpactBeam(
        **ranges,
        length=length,
        force_position=length * generator.uniform(0.3, 1.0),
        height=usual.height * draw(0.5, 2.0),
        width=usual.width * draw(0.5, 2.0),
        contact_stiffness=draw(1e6, 1e8),
        contact_damping=draw(2.0, 200.0),
        damping_ratio=draw(0.002, 0.1),
        damping_family=str(generator.choice(["uniform", "stiffness", "beam"])),
        force_amplitude=draw(2.0, 40.0),
        pivot_rotational_stiffness=usual.pivot_rotational_stiffness * draw(0.2, 5.0),
        pivot_translational_stiffness=usual.pivot_translational_stiffness * draw(0.2, 5.0),
        shaker_damping=draw(5.0, 200.0),
    )


def random_crank(generator: np.random.Generator) -> SliderCrank:
    """A crank of another rod, stops and damping, at a point of its usual ranges."""
    usual, draw = SliderCrank(), functools.partial(_spread, generator)
    ranges: dict[str, Any] = {field: draw(*usual.usual_ranges[field]) for field in ("crank_speed", "slider_clearance")}
    return SliderCrank(
        **ranges,
        rod_length=usual.rod_length * draw(0.7, 1.5),
        rod_diameter=draw(3e-3, 12e-3),
        damping_ratio=draw(0.002, 0.1),
        contact_stiffness=usual.contact_stiffness * draw(0.1, 10.0),
        contact_damping_ratio=usual.contact_damping_ratio * draw(0.3, 3.0),
    )


def _cantilever(generator: np.random.Generator) -> tuple[Array, Array, int, int]:
    """Mass and stiffness of a clamped strip of steel with a mass at its end; rows of its stop and of its drive."""
    elements, draw = 40, functools.partial(_spread, generator)
    length, height, width = draw(0.1, 0.5), draw(1e-3, 8e-3), draw(5e-3, 30e-3)
    lengths = np.full(elements, length / elements)
    mass, stiffness = bending_matrices(lengths, 2e11 * width * height**3 / 12.0, 7850.0 * width * height)
    mass[-2, -2] += draw(0.01, 1.0) * 7850.0 * width * height * length
    at = 2 * int(generator.integers(elements // 2, elements))
    return mass[2:, 2:], stiffness[2:, 2:], at, 2 * int(generator.integers(elements // 4, elements))


def _rattling(generator: np.random.Generator, structure: Structure) -> ModalMachine:
    """A structure with one joint that rattles, driven near one of its first two natural frequencies."""
    draw = functools.partial(_spread, generator)
    first, second = structure.angular_frequency[:2] / (2.0 * np.pi)
    speed = float(np.clip(draw(0.3, 1.5) * (first if generator.uniform() < 0.7 else second), 0.01, 1e4))
    force, place = draw(0.5, 50.0), structure.shape("stop") * structure.shape("drive")
    deflection = force * float(np.sum(np.abs(place) / structure.angular_frequency**2))
    kind: Any = ModalMachine
    machine: ModalMachine = kind(
        modes=structure,
        joint="stop",
        drives=(Drive.sine("force", "drive", force),),
        speed=speed,
        clearance=deflection * draw(0.02, 0.5),
        contact_stiffness=draw(1e5, 3e7),
        contact_damping=draw(1.0, 100.0),
        stops=str(generator.choice(["two", "one"])),
    )
    return machine


def random_matrices(generator: np.random.Generator) -> ModalMachine:
    """The cantilever by its matrices, of which two to six modes are kept, and the deflection of the stop."""
    mass, stiffness, stop, drive = _cantilever(generator)
    places = {"stop": stop, "drive": drive}
    modes = int(generator.integers(2, 7))
    kept: dict[str, Any] = {"modes": modes, "residual_at": "stop"}
    return _rattling(generator, Structure.of_matrices(mass, stiffness, _spread(generator, 0.003, 0.05), places, **kept))


def random_modes(generator: np.random.Generator) -> ModalMachine:
    """The cantilever by 24 of its modes, as a file of a modal test has them."""
    mass, stiffness, stop, drive = _cantilever(generator)
    whole = Structure.of_matrices(mass, stiffness, 0.01, {"stop": stop, "drive": drive}, modes=24)
    hertz = whole.angular_frequency / (2.0 * np.pi)
    return _rattling(generator, Structure.of_modes(hertz, _spread(generator, 0.003, 0.05), whole.shapes))


def random_mechanism(generator: np.random.Generator) -> Machine:
    """The compressor with a rod that bends, of another section and other stops, at a point of its usual ranges."""
    draw = functools.partial(_spread, generator)
    text = flexible_compressor().replace("modes = 2", f"modes = {generator.integers(1, 4)}")
    text = text.replace('height = "14 mm"', f'height = "{14.0 * draw(0.3, 1.5):.4g} mm"')
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "compressor.toml"
        path.write_text(text, encoding="utf-8")
        machine = read_machine(path)
    scaled = ("wrist_stiffness", "wrist_damping", "rod_mass_factor", "piston_mass_factor", "load_factor")
    fields = {name: getattr(machine, name) * draw(0.3, 3.0) for name in scaled}
    return with_settings(machine, fields | {name: draw(*ends) for name, ends in machine.usual_ranges.items()})


KINDS: Mapping[str, Callable[[np.random.Generator], Machine]] = {
    "beam": random_beam,
    "crank": random_crank,
    "matrices": random_matrices,
    "modes": random_modes,
    "mechanism": random_mechanism,
}
"""How a machine of each kind is drawn."""


def machine_of(index: int, kind: str, seed: int) -> Machine:
    """The machine of a row; draws that are not allowed are drawn again."""
    generator = np.random.default_rng([seed, index])
    while True:
        try:
            return KINDS[kind](generator)
        except (ChaosgymError, np.linalg.LinAlgError):
            continue


def reference_of(machine: Any) -> Any:
    """The machine by a model finer than any that the estimate of its own model has seen; None if there is none.

    Of a file's modes the reference is all of them, and of matrices too where so many are kept.
    """
    finer = machine.finer
    if isinstance(machine, ModalMachine) and finer is not None and finer.modes.spare.kept == finer.modes.spare.most:
        return finer
    return None if finer is None else finer.finer


def row_of(index: int, seed: int, tolerance: float) -> dict[str, Any]:
    """What one machine has to say."""
    kind = list(KINDS)[index % len(KINDS)]
    machine = machine_of(index, kind, seed)
    row: dict[str, Any] = dict.fromkeys(COLUMNS, "") | {"index": index, "kind": kind}
    began = time.process_time()
    chosen = model_within(machine, tolerance)
    row["choice_ms"] = f"{1e3 * (time.process_time() - began):.3g}"
    row["model"] = " ".join(f"{name}={value:g}" for name, value in chosen.machine.model_numbers.items())
    row["reason"] = chosen.warning or chosen.unknown
    if chosen.error is not None:
        row["estimated_error"] = f"{chosen.error:.3g}"
    reference = reference_of(chosen.machine)
    try:
        began = time.process_time()
        own = simulate(chosen.machine, CYCLES, transient=TRANSIENT)
        row["cycle_us"] = f"{1e6 * (time.process_time() - began) / (CYCLES + TRANSIENT):.4g}"
        row |= _settled("", own)
        repeats = row["nature"].startswith("periodic")
        if reference is not None and (repeats or index // len(KINDS) % ALSO == 0):
            row |= _settled("reference_", simulate(reference, CYCLES, transient=TRANSIENT))
    except (ChaosgymError, np.linalg.LinAlgError) as error:
        return row | {"reason": f"{type(error).__name__}: {str(error).split(';')[0]}"}
    if row["nature"] == row["reference_nature"] and repeats:
        peak, true = float(row["peak_N"]), float(row["reference_peak_N"])
        row["error"] = f"{abs(peak - true) / true if true else abs(peak):.3g}"
    return row


def _settled(prefix: str, record: CycleRecord) -> dict[str, str]:
    verdict = two_step_test(record)
    nature = f"{verdict.nature} {verdict.period}" if verdict.nature == "periodic" else verdict.nature
    return {f"{prefix}nature": nature, f"{prefix}peak_N": f"{record.peak_force.max(axis=1).mean():.10g}"}


def rows_of(path: Path) -> list[dict[str, str]]:
    """Rows that a file has."""
    if not path.is_file():
        return []
    with path.open(newline="", encoding="utf-8") as file:
        return [row for row in csv.DictReader(file) if row["reason"] is not None]


def measure(path: Path, count: int, seed: int, tolerance: float | str) -> Iterator[dict[str, Any]]:
    """Write a row of each machine that the file lacks, as soon as it is known; the same call again goes on."""
    there = {int(row["index"]) for row in rows_of(path)}
    with path.open("a", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator="\n")
        if not there and not file.tell():
            writer.writeheader()
        for index in range(count):
            if index not in there:
                row = row_of(index, seed, tolerance_of(tolerance))
                writer.writerow(row)
                file.flush()
                os.fsync(file.fileno())
                yield row


def summary_of(rows: list[dict[str, str]], tolerance: float | str) -> dict[str, dict[str, Any]]:
    """Shares by kind, and of all: within the tolerance and twice of it, and of natures that agree."""
    allowed = tolerance_of(tolerance)
    groups = {kind: [row for row in rows if row["kind"] == kind] for kind in KINDS} | {"all": rows}
    return {kind: _shares(group, allowed) for kind, group in groups.items() if group}


def _shares(rows: list[dict[str, str]], allowed: float) -> dict[str, Any]:
    estimated = [row for row in rows if row["estimated_error"] and float(row["estimated_error"]) <= allowed]
    errors = np.array([float(row["error"]) for row in estimated if row["error"]])
    bounds = np.array([float(row["estimated_error"]) for row in estimated if row["error"]])
    both = [row["nature"].split()[0] == row["reference_nature"].split()[0] for row in rows if row["reference_nature"]]
    return {
        "machines": len(rows),
        "estimated_within": len(estimated),
        "periodic": len(errors),
        "within": float(np.mean(errors <= allowed)) if len(errors) else None,
        "within_twice": float(np.mean(errors <= 2.0 * allowed)) if len(errors) else None,
        "largest_error": float(errors.max()) if len(errors) else None,
        "bounded": float(np.mean(errors <= np.maximum(bounds, ROUNDING))) if len(errors) else None,
        "natures_compared": len(both),
        "natures_agree": float(np.mean(both)) if both else None,
        "median_choice_ms": float(np.median([float(row["choice_ms"]) for row in rows])),
    }
