r"""Which numbers does a classifier see of a machine's parameters? Their logarithms, and dimensionless groups.

    x_i                   logarithm of each varied field; the field itself where its range reaches zero
    log(w / w_n)          speed over the first natural frequencies
    w_n / w mod 1         where in its own swing the free machine is after a cycle
    log(clearance w^2)    the gap against the distance that a constant acceleration covers in a cycle

Natural frequencies are tabulated over the one varied field that changes them, a length; where several do, or none of
the fields is a speed, the groups are left out.
"""

from typing import NamedTuple

import numpy as np
from numba import njit
from numpy.typing import NDArray

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
    (n_points,) values of the tabulated field; ``frequencies`` (n_modes, n_points) natural frequencies [Hz].
    """

    logarithm: NDArray[np.bool_]
    places: NDArray[np.int64]
    hertz: float
    grid: Array
    frequencies: Array


def parameter_scaling(machine: Machine | None, fields: tuple[str, ...], values: Array) -> ParameterScaling:
    """Scaling for a machine whose ``fields`` take ``values`` (n, n_fields); without a machine plain columns."""
    none = np.full(3, -1)
    if machine is None:
        return ParameterScaling(np.zeros(values.shape[1], dtype=bool), none, 1.0, np.zeros(1), np.empty((0, 1)))
    low, high = values.min(axis=0), values.max(axis=0)
    logarithm = low > 0.0
    if machine.speed_field not in fields:
        return ParameterScaling(logarithm, none, 1.0, np.zeros(1), np.empty((0, 1)))
    places = np.array([fields.index(name) if name in fields else -1
                       for name in (machine.speed_field, machine.clearance_field)] + [-1])  # fmt: skip
    hertz = 1.0 / (machine.cycle_period * float(getattr(machine, machine.speed_field)))
    rest = machine.natural_frequencies[:MODES]
    changing = [
        index for index, name in enumerate(fields)
        if any(not np.array_equal(_natural(machine, name, end), rest) for end in (low[index], high[index]))
    ]  # fmt: skip
    if len(changing) > 1:
        return ParameterScaling(logarithm, none, 1.0, np.zeros(1), np.empty((0, 1)))
    if not changing:
        return ParameterScaling(logarithm, places, hertz, np.zeros(1), np.ascontiguousarray(rest[:, None]))
    places[2] = changing[0]
    grid = np.linspace(low[changing[0]], high[changing[0]], TABLE_POINTS)
    table = np.array([_natural(machine, fields[changing[0]], value) for value in grid]).T
    return ParameterScaling(logarithm, places, hertz, grid, np.ascontiguousarray(table))


def _natural(machine: Machine, name: str, value: float) -> Array:
    whole = isinstance(getattr(machine, name), int)
    changed = with_settings(machine, {name: int(value) if whole else float(value)})
    return np.asarray(changed.natural_frequencies[:MODES])


def feature_count(scaling: ParameterScaling) -> int:
    """Number of features."""
    groups = 2 * len(scaling.frequencies) + 1 if scaling.places[0] >= 0 else 0
    return len(scaling.logarithm) + groups


def parameter_features(scaling: ParameterScaling, values: Array) -> Array:
    """Features (n, n_features) of parameter values (n, n_fields); NaN where a logarithm does not exist."""
    out = np.empty((len(values), feature_count(scaling)))
    _fill(*scaling, np.ascontiguousarray(values, dtype=float), out)
    return out


@njit(cache=True, nogil=True)
def _fill(
    logarithm: NDArray[np.bool_],
    places: NDArray[np.int64],
    hertz: float,
    grid: Array,
    frequencies: Array,
    values: Array,
    out: Array,
) -> None:
    fields = len(logarithm)
    spacing = (grid[-1] - grid[0]) / max(1, len(grid) - 1)
    for row in range(len(values)):
        for i in range(fields):
            value = values[row, i]
            if logarithm[i]:
                out[row, i] = np.log(value) if value > 0.0 else np.nan
            else:
                out[row, i] = value
        if places[0] < 0:
            continue
        speed = values[row, places[0]] * hertz
        share, left = 0.0, 0
        if places[2] >= 0:
            place = (values[row, places[2]] - grid[0]) / spacing
            left = max(0, min(len(grid) - 2, int(place)))
            share = place - left
        at = fields
        for mode in range(len(frequencies)):
            natural = frequencies[mode, left]
            if places[2] >= 0:
                natural += share * (frequencies[mode, left + 1] - natural)
            out[row, at] = np.log(speed / natural) if speed > 0.0 else np.nan
            out[row, at + 1] = natural / speed % 1.0 if speed > 0.0 else np.nan
            at += 2
        clearance = values[row, places[1]] if places[1] >= 0 else 1.0
        push = clearance * speed * speed
        out[row, at] = np.log(push) if push > 0.0 else np.nan
