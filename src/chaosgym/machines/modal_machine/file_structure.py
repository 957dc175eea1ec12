"""The structure that a file states: its modes by frequencies, by matrices or by a universal file."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
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


DIRECTIONS = {"x": "r1", "y": "r2", "z": "r3"}
"""Field of a data set 55 by direction."""

PLACE = re.compile(r"(\d+)\s*([-+]?)([xyz])")


class MeasuredModes(NamedTuple):
    """Modes as they are in the file.

    ``frequencies`` [Hz], ``damping_ratios``, modal ``masses`` [kg] (n,), and ``shapes`` (n,) by point, in the scale of
    the masses.
    """

    frequencies: Array
    damping_ratios: Array
    masses: Array
    shapes: Mapping[str, Array]


def read_modes(path: Path, points: Mapping[str, str]) -> MeasuredModes:
    """Read the normal modes of a universal file.

    Parameters
    ----------
    points
        Node and direction of each named point, such as ``"12 +y"``.

    Raises
    ------
    ParameterError
        If pyuff is missing, the file holds no modes, or a node does not exist.

    References
    ----------
    Universal dataset 55, data at nodes; SDRC, University of Cincinnati.
    """
    try:
        import pyuff
    except ImportError:
        raise ParameterError("universal_file needs the extra [uff]: pip install pyuff") from None
    try:
        found = pyuff.UFF(str(path)).read_sets()
    except Exception as error:  # whatever the library says of damaged bytes
        raise ParameterError(f"{path} can't be read as a universal file: {str(error).splitlines()[0]}") from None
    kinds = [one for one in ([found] if isinstance(found, dict) else found) if one.get("type") == 55]
    sets = [one for one in kinds if one.get("analysis_type") == 2]
    if not sets:
        why = "; it has complex ones: export real ones" if kinds else ""
        raise ParameterError(f"{path} holds no normal modes (data sets 55 with analysis type 2){why}")
    if not points:
        raise ParameterError("[structure.points] is missing: node and direction of each named point, such as '12 +y'")
    sets.sort(key=lambda one: float(one["freq"]))
    shapes = {name: np.array([_at(one, name, place) for one in sets]) for name, place in points.items()}
    return MeasuredModes(
        frequencies=np.array([float(one["freq"]) for one in sets]),
        damping_ratios=np.array([float(one.get("modal_damp_vis") or 0.0) for one in sets]),
        masses=np.array([float(one.get("modal_m") or 1.0) for one in sets]),
        shapes=shapes,
    )


def _at(one: Mapping[str, Any], name: str, place: str) -> float:
    """Entry of a shape at a node, in a direction."""
    read = PLACE.fullmatch(place.strip().lower())
    if read is None:
        raise ParameterError(
            f"structure.points.{name} = {place!r} is out of range; allowed: node and direction, '12 +y'"
        )
    nodes = np.asarray(one["node_nums"]).astype(int).tolist()
    if int(read[1]) not in nodes:
        raise ParameterError(f"structure.points.{name}: there is no node {read[1]}; known: {nodes[0]} to {nodes[-1]}")
    value = np.asarray(one[DIRECTIONS[read[3]]])[nodes.index(int(read[1]))]
    return float(np.real(value)) * (-1.0 if read[2] == "-" else 1.0)
