"""The initial state that a file of modes states: with units that of its shapes' coordinates, else the machine's own."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from chaosgym.arrays import Array
from chaosgym.core.matrices import product
from chaosgym.errors import ParameterError
from chaosgym.machines.modal_machine.structure import Structure
from chaosgym.numbers import shown
from chaosgym.units import as_float, parse_quantity, parse_row, turns

NAME = "operation.initial_state"


def start_of(given: Any, units: tuple[str, str], structure: Structure) -> Array:
    """State (n_states,) of the machine: displacements, then velocities, of its modes.

    Parameters
    ----------
    given
        Numbers alone, of the modes; or a text or a list in which units stand behind the numbers that they are of, of
        the coordinates of the shapes as [structure] has them.
    units
        Of the coordinates of the shapes and of their rates.
    structure
        Modes of the whole.

    Raises
    ------
    ParameterError
        If numbers alone could mean either, there are too few or too many, or a unit does not fit.
    """
    n = len(structure.angular_frequency)
    frame = np.eye(n) if structure.frame is None else structure.frame
    words = [word.strip() for text in (given if isinstance(given, list) else [given]) for word in _words(text)]
    if all(_is_number(part) for word in words for part in word.split()):
        if not np.array_equal(frame, np.eye(*frame.shape)):
            raise ParameterError(
                f"{NAME} = {shown(given)} has no units; beside modal_masses or a [[spring]] write those of the shapes' "
                f"coordinates, such as '1e-3 {units[0]}, 0 {units[1]}' (--initial-state takes a state of the modes)"
            )
        return np.array(parse_row(NAME, given, "-"))
    count = frame.shape[1]
    if len(words) != 2 * count:
        raise ParameterError(
            f"{NAME} = {shown(given)} has {len(words)} numbers; allowed: {2 * count}, displacements, then velocities"
        )
    halves = words[:count], words[count:]
    values = [_values(half, unit) for half, unit in zip(halves, units, strict=True)]
    return np.concatenate([product(frame, half) for half in values])


def coordinate_units(table: Mapping[str, Any]) -> tuple[str, str]:
    """Units of the coordinates of the shapes that [structure] of a file states, and of their rates."""
    if "modal_masses" in table:
        return ("rad", "rad/s") if turns(table["modal_masses"], "kg") else ("m", "m/s")
    return ("m", "m/s") if "universal_file" in table else ("kg^1/2 m", "kg^1/2 m/s")


def _words(given: Any) -> list[str]:
    return str(given).replace(";", ",").split(",")


def _is_number(text: str) -> bool:
    try:
        as_float(text)
    except ValueError:
        return False
    return True


def _values(words: list[str], unit: str) -> list[float]:
    """Values of some words; one without a unit has that of the next one."""
    found, behind = [], ""
    for word in reversed(words):
        number, _, own = word.partition(" ")
        behind = own or behind
        found.append(parse_quantity(NAME, f"{number} {behind}".strip(), unit))
    return found[::-1]
