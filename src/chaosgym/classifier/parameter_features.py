r"""Which numbers does a classifier see of a machine's parameters? Their logarithms, and dimensionless groups.

    x_i                     logarithm of each varied field; the field itself where its range reaches zero
    log(w / w_n)            speed over the first natural frequencies
    sin, cos of 2 pi w_n/w  where in its own swing the free machine is after a cycle
    log(clearance w^2)      the gap against the distance that a constant acceleration covers in a cycle
    swing groups            of a beam between two sensors, see ``beam_swing``

Natural frequencies are tabulated over the one varied field that changes them, a length; where several do, or none of
the fields is a speed, the groups are left out.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from chaosgym.classifier.beam_swing import GROUPS, SwingTable, swing_table
from chaosgym.classifier.kernels.parameters import fill_features
from chaosgym.machines import Machine
from chaosgym.machines.parameters import with_settings

Array = NDArray[np.float64]

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
    fill_features(*scaling[:-1], *scaling.swing, np.ascontiguousarray(values, dtype=float), out)
    return out
