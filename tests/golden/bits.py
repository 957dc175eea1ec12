"""Models and cycles to the last bit.

Models are made and kernels run in arithmetic of a fixed order, so both repeat their bits on every processor with fused
multiply-add and the same library of elementary functions. Cycles start from the stored models: a digit that a model
moves is told apart from one that a kernel moves.

`python -m tests.golden.bits` writes the file anew. Do so with a change that is meant to move a last digit, and say in
the commit by how much it moved. Nothing that is shipped rests on these bits.
"""

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

from chaosgym import ExactEvents, ImpactBeam, SliderCrank
from chaosgym.core.tangent import Tangents
from chaosgym.machines import Machine

STORED = Path(__file__).with_name("bits.npz")

CYCLES = 8

MACHINES: dict[str, Machine] = {
    "beam": ImpactBeam(excitation_frequency=19.0),
    "crank": SliderCrank(matrix_update_interval=30.0, crank_speed=190.0, slider_clearance=0.254e-3),
    "crank, both joints": SliderCrank(matrix_update_interval=30.0, ball_joint="spherical", crank_speed=160.0),
    "crank, hertz": SliderCrank(matrix_update_interval=30.0, contact_law="hertz", crank_speed=180.0),
}
"""A machine for each kernel, with as few bins of the crank as there may be: they are stored."""

Arrays = dict[str, np.ndarray]


def arrays_of(value: Any, name: str) -> Arrays:
    """Arrays of a model by name, those of the models in it included."""
    if isinstance(value, tuple):
        fields = zip(value._fields, value, strict=True)  # type: ignore[attr-defined]
        return {key: array for field, one in fields for key, array in arrays_of(one, f"{name}.{field}").items()}
    return {name: np.asarray(value)}


def rebuilt(model: Any, name: str, stored: Mapping[str, np.ndarray]) -> Any:
    """A model of the kind of another, whose numbers are the stored ones."""
    if isinstance(model, tuple):
        fields = zip(model._fields, model, strict=True)  # type: ignore[attr-defined]
        return type(model)(*(rebuilt(one, f"{name}.{field}", stored) for field, one in fields))
    return stored[name] if isinstance(model, np.ndarray) else type(model)(stored[name].item())


def results(machine: Machine, model: Any) -> Arrays:
    """Everything that the kernel of a machine writes from rest, and the growth of two deviations."""
    arrays = machine.arrays(CYCLES, 3)
    along = {}
    if machine.moving.deviations:
        along["tangents"] = Tangents(np.eye(machine.n_states)[:2].copy(), np.zeros((CYCLES, 2)))
    coordinates, bouncing = np.zeros(machine.n_states), np.zeros(3)
    with patch.object(type(machine), "reduce", lambda *_: model):
        outcome = machine.run(coordinates, bouncing, arrays, ExactEvents(), **along)
    found = {"outcome": np.array(outcome), "coordinates": coordinates, "bouncing": bouncing}
    for value in (arrays, *along.values()):
        found |= {name: array for name, array in arrays_of(value, type(value).__name__).items() if array.size}
    return found


def versions() -> Arrays:
    """What compiled the kernels that wrote the bits: others may order additions otherwise."""
    return {name: np.array(version(name)) for name in ("llvmlite", "numba")}


if __name__ == "__main__":
    kept = versions()
    for name, machine in MACHINES.items():
        model = machine.reduce()
        kept |= arrays_of(model, f"{name}: model")
        kept |= {f"{name}: {key}": value for key, value in results(machine, model).items()}
    np.savez_compressed(STORED, **kept)
