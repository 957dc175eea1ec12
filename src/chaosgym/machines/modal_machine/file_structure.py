"""The structure that a file states: its modes by frequencies, by matrices or by a universal file."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.file_keys import needed
from chaosgym.machines.modal_machine.archives import read_archive, read_matrix
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.machines.parameters import suggestion

_DAMPED = ("damping_ratios", "modal_damping")
_MESH = (*_DAMPED, "units", "modes", "residual_mode", "base", "degrees_of_freedom")

WAYS = {
    "frequencies": (*_DAMPED, "modal_masses", "shapes", "residual"),
    "matrices": _MESH,
    "mass": (*_MESH, "stiffness", "damping"),
    "universal_file": (*_DAMPED, "points", "residual"),
}
"""Ways to give a structure, and the keys and tables of [structure] that mean something beside each."""


def _refuse_two(table: str, given: Mapping[str, Any], *names: str) -> None:
    """Refuse keys of which only one would be read."""
    both = [name for name in names if name in given]
    if len(both) > 1:
        raise ParameterError(f"[{table}] has {' and '.join(both)}; allowed: one of them")


def structure_of(data: Mapping[str, Any], folder: Path) -> Structure:
    """Modes by one of the three ways that [structure] offers."""
    table = data["structure"]
    ways = [name for name in WAYS if name in table]
    if len(ways) != 1:
        raise ParameterError(
            f"[structure] has {' and '.join(ways) or 'no modes'}; allowed: one of frequencies, matrices (.npz), mass "
            "with stiffness, universal_file"
        )
    stated = [*table, *(path.partition(".")[2] for path in data if path.startswith("structure.") and data[path])]
    for name in stated:
        if name not in (*ways, *WAYS[ways[0]]):
            raise ParameterError(f"structure.{name} has no meaning beside {ways[0]}; leave one of them out")
    _refuse_two("structure", table, "damping_ratios", "modal_damping")
    if ways == ["frequencies"]:
        return _of_modes(table, data["structure.shapes"], data["structure.residual"])
    if ways == ["universal_file"]:
        from chaosgym.machines.modal_machine.universal import read_modes

        modes = read_modes(folder / table["universal_file"], data["structure.points"])
        ratios = table.get("damping_ratios", modes.damping_ratios)
        given = {**table, "frequencies": modes.frequencies, "damping_ratios": ratios, "modal_masses": modes.masses}
        return _of_modes(given, modes.shapes, data["structure.residual"])
    return _of_matrices(table, data, folder)


def _ratios(table: Mapping[str, Any]) -> Any:
    if "modal_damping" in table:
        return table["modal_damping"]
    (ratios,) = needed("structure", table, "damping_ratios")
    return ratios[0] if len(ratios) == 1 else ratios


def _of_modes(table: Mapping[str, Any], shapes: Mapping[str, Any], residual: Mapping[str, Any]) -> Structure:
    rest = None
    if residual:
        at, compliance = needed("structure.residual", residual, "at", "compliance")
        rest = (at, compliance, residual.get("frequency", 2.0 * float(np.max(table["frequencies"]))))
    if not shapes:
        raise ParameterError("[structure.shapes] is missing: the shape of each mode at each named point")
    masses = table.get("modal_masses")
    return Structure.of_modes(table["frequencies"], _ratios(table), shapes, modal_masses=masses, residual=rest)


def _of_matrices(table: Mapping[str, Any], data: Mapping[str, Any], folder: Path) -> Structure:
    matrices, points = _matrices(table, folder), dict(data["structure.degrees_of_freedom"])
    for place, name in enumerate(matrices.pop("names", ())):
        points.setdefault(str(name), place)
    if not points:
        raise ParameterError("[structure.degrees_of_freedom] is missing: the row of each named point, counted from 0")
    base = matrices.pop("base", None)
    if "base" in table:
        base = np.zeros(matrices["M"].shape[0])
        for name in table["base"]:
            if name not in points:
                raise ParameterError(f"structure.base names no degree of freedom {name!r}{suggestion(name, points)}")
            base[points[name]] = 1.0
    if "C" in matrices:
        _refuse_two("structure", {**table, "the damping matrix C": 0}, "the damping matrix C", *_DAMPED)
    joints = [str(joint.get("at", "")).lstrip("-+ ") for joint in data["joint"]]
    (modes,) = needed("structure", table, "modes")
    return Structure.of_matrices(
        matrices["M"],
        matrices["K"],
        matrices.get("C") if "C" in matrices else _ratios(table),
        points,
        modes=modes,
        base=base,
        residual_at=[name for name in joints if table.get("residual_mode", True) and name in points],
        scale=1e3 if table.get("units") == "t mm N" else 1.0,
    )


def _matrices(table: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """Matrices M, K and, if they are there, C, base and names."""
    if "matrices" in table:
        return read_archive(folder / table["matrices"])
    mass, stiffness = needed("structure", table, "mass", "stiffness")
    files = {"M": mass, "K": stiffness, **({"C": table["damping"]} if "damping" in table else {})}
    return {name: read_matrix(folder / file) for name, file in files.items()}
