r"""Features of a machine's parameters: their logarithms, and dimensionless groups.

    x_i                     logarithm of each varied field; the field itself where its range reaches zero
    log(w / w_n)            speed over the first natural frequencies
    sin, cos of 2 pi w_n/w  where in its own swing the free machine is after a cycle
    log(clearance w^2)      the gap against the distance that a constant acceleration covers in a cycle
    swing groups            of a beam between two sensors

Natural frequencies are tabulated over the one varied field that changes them, a length; where several do, or none of
the fields is a speed, the groups are left out.

Swing groups: a tip that rests on a sensor leaves it when the shaker's force turns, flies to the other sensor in the
rocking mode alone, strikes it, and rings on it until the force turns again. In closed form, with t the time of the
flight and s the rest of the half cycle:

    phase of the force at the impact, speed v of the impact, force that presses there
    damping exponents of the ringing over s (on the sensor) and over t (in flight), by mode
    phases of that ringing, as sine and cosine
    R = log(v w_c / (w F / m)) - exponent: what is left of the ringing against the change of the force at the release

A response is calm where the ringing of one impact has died before the next. Modes, shapes and damping are tabulated
over the length; damping is linear in its two parameters.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.arrays import Array
from chaosgym.classifier.kernels.parameters import FREE, RINGING, fill_features
from chaosgym.core.compilation import call_or_interpret
from chaosgym.machines import Machine
from chaosgym.machines.parameters import parameters_of, with_settings

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
    is_beam = machine is not None and set(FIELDS) <= set(parameters_of(machine))
    if not (is_beam and machine.n_modes >= FREE and vary):
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
            [none.damping[0, 0], none.tip_shape[0], undamped.structure.drive[0, 0, 1, 0]],
            *(0.5 * np.einsum("ik,ij,jk->k", shapes, part, shapes) for part in (none.damping, slope)),
            0.5 * (shapes.T @ none.tip_shape) ** 2,
            0.5 * np.diag(none.damping)[bending],
            0.5 * np.diag(slope)[bending],
        ]
    )


TABLE_POINTS = 33
MODES = 3
"""Natural frequencies that enter the groups."""


class ParameterScaling(NamedTuple):
    """What turns parameter values into features.

    ``logarithm`` (n_fields,) which fields enter by their logarithm; ``places`` (3,) columns of speed, clearance and
    the tabulated field, -1 where there is none; ``hertz`` cycles a second for one unit of the speed field; ``grid``
    (n_points,) values of the tabulated field; ``frequencies`` (n_modes, n_points) natural frequencies [Hz]; ``swing``
    what a beam's swing groups are made of, without modes where there are none.
    """

    logarithm: NDArray[np.bool_]
    places: NDArray[np.int64]
    hertz: float
    grid: Array
    frequencies: Array
    swing: SwingTable


def parameter_scaling(machine: Machine | None, fields: tuple[str, ...], values: Array) -> ParameterScaling:
    """Scaling for a machine whose ``fields`` take ``values`` (n, n_fields); without a machine plain columns."""
    low, high = values.min(axis=0), values.max(axis=0)
    logarithm = low > 0.0 if machine is not None else np.zeros(len(low), dtype=bool)
    plain = ParameterScaling(
        logarithm, np.full(3, -1), 1.0, np.zeros(1), np.empty((0, 1)), swing_table(None, fields, np.zeros(1))
    )
    if machine is None or machine.speed_field not in fields:
        return plain
    places = np.array(
        [fields.index(name) if name in fields else -1 for name in (machine.speed_field, machine.clearance_field)] + [-1]
    )
    hertz = 1.0 / (machine.cycle_period * float(getattr(machine, machine.speed_field)))
    rest = machine.natural_frequencies[:MODES]
    changing = [
        index
        for index, name in enumerate(fields)
        if any(not np.array_equal(_natural(machine, name, end), rest) for end in (low[index], high[index]))
    ]
    if len(changing) > 1:
        return plain
    grid, frequencies = np.zeros(1), np.ascontiguousarray(rest[:, None])
    if changing:
        places[2] = changing[0]
        grid = np.linspace(low[changing[0]], high[changing[0]], TABLE_POINTS)
        frequencies = np.array([_natural(machine, fields[changing[0]], value) for value in grid]).T
    return ParameterScaling(
        logarithm, places, hertz, grid, np.ascontiguousarray(frequencies), swing_table(machine, fields, grid)
    )


def _natural(machine: Machine, name: str, value: float) -> Array:
    whole = isinstance(getattr(machine, name), int)
    changed = with_settings(machine, {name: int(value) if whole else float(value)})
    return np.asarray(changed.natural_frequencies[:MODES])


def feature_count(scaling: ParameterScaling) -> int:
    """Number of features."""
    groups = 3 * len(scaling.frequencies) + 1 if scaling.places[0] >= 0 else 0
    return len(scaling.logarithm) + groups + (GROUPS if len(scaling.swing.modes) else 0)


def parameter_features(scaling: ParameterScaling, values: Array) -> Array:
    """Features (n, n_features) of parameter values (n, n_fields); NaN where a logarithm does not exist."""
    out = np.empty((len(values), feature_count(scaling)))
    call_or_interpret(fill_features, *scaling[:-1], *scaling.swing, np.ascontiguousarray(values, dtype=float), out)
    return out
