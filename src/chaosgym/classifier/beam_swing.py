r"""What does a beam's swing from one sensor to the other say of its response? Dimensionless groups of half a cycle.

A tip that rests on a sensor leaves it when the shaker's force turns, flies to the other sensor in the rocking mode
alone, strikes it, and rings on it until the force turns again. In closed form, with t the time of the flight and s the
rest of the half cycle:

    phase of the force at the impact, speed v of the impact, force that presses there
    damping exponents of the ringing over s (on the sensor) and over t (in flight), by mode
    phases of that ringing, as sine and cosine
    R = log(v w_c / (w F / m)) - exponent: what is left of the ringing against the change of the force at the release

A response is calm where the ringing of one impact has died before the next, and the phases say what a rest of it does.
Modes, shapes and damping are tabulated over the length; damping is linear in its two parameters.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.kernels.parameters import FREE, RINGING
from chaosgym.machines.parameters import with_settings

Array = NDArray[np.float64]

FIELDS = ("excitation_frequency", "clearance", "length", "damping_ratio", "contact_damping", "force_amplitude")
"""Fields that may vary; the machine gives the others."""

GROUPS = 7 + 11 * RINGING + 4 * (FREE - 1)
"""Number of groups."""


class SwingTable(NamedTuple):
    """Modes over a grid of lengths.

    ``places`` (n,) columns of ``FIELDS`` among the values, -1 for what is fixed; ``fixed`` (n,) their values [SI];
    ``grid`` (n_points,) lengths; ``modes`` (n_points, n_columns): free frequencies, ringing frequencies [rad/s];
    damping of the rocking mode [1/s], its tip and force shapes [kg^-1/2]; of each ringing mode the rate at no damping
    and its slopes over damping ratio and contact damping; of each bending mode in flight the same without the last.
    """

    places: NDArray[np.int64]
    fixed: Array
    grid: Array
    modes: Array


def swing_table(machine: Any, fields: tuple[str, ...], grid: Array) -> SwingTable:
    """Table for a beam whose ``fields`` vary, over lengths ``grid``; without modes for whatever has no such groups."""
    vary = {"excitation_frequency", "clearance"} <= set(fields) <= set(FIELDS)
    if not (machine is not None and machine.swings and machine.n_modes >= FREE and vary):
        return SwingTable(np.full(len(FIELDS), -1), np.zeros(len(FIELDS)), np.zeros(1), np.empty((0, 1)))
    places = np.array([fields.index(name) if name in fields else -1 for name in FIELDS])
    fixed = np.array([getattr(machine, name) for name in FIELDS], dtype=float)
    lengths = grid if "length" in fields else np.full(1, machine.length)
    return SwingTable(places, fixed, lengths, np.array([_modes(machine, length) for length in lengths]))


def _modes(machine: Any, length: float) -> Array:
    """One row of the table."""
    undamped = with_settings(machine, {"length": length, "damping_ratio": 0.0})
    none = undamped.reduce()
    whole = with_settings(machine, {"length": length, "damping_ratio": 1.0}).reduce()
    slope = whole.damping - none.damping
    push = machine.contact_stiffness * np.outer(none.tip_shape, none.tip_shape)
    squares, shapes = np.linalg.eigh(np.diag(none.stiffness) + push)
    shapes = shapes[:, :RINGING]
    bending = slice(1, FREE)
    return np.concatenate(
        [
            np.sqrt(none.stiffness[:FREE]),
            np.sqrt(squares[:RINGING]),
            [none.damping[0, 0], none.tip_shape[0], undamped.force_shape[0]],
            *(0.5 * np.einsum("ik,ij,jk->k", shapes, part, shapes) for part in (none.damping, slope)),
            0.5 * (shapes.T @ none.tip_shape) ** 2,
            0.5 * np.diag(none.damping)[bending],
            0.5 * np.diag(slope)[bending],
        ]
    )
