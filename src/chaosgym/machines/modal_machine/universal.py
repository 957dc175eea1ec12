"""Modes of a modal test from a universal file: data sets 55 with their frequencies, dampings, masses and shapes."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from chaosgym.arrays import Array
from chaosgym.errors import ParameterError

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
