"""Response type of each point: that of the points up to one tolerance beside it, along speed and clearance."""

import numpy as np
import pyarrow as pa

from chaosgym.diagnosis.type_rule import types_on_grid
from chaosgym.sweeps.plan import SweepPlan


def with_response_types(table: pa.Table, plan: SweepPlan, rows: range) -> pa.Table:
    """Fill in the response types of some rows: a whole grid, whole machines of a lattice, or any other points."""
    reach = plan.type_axes()
    if not reach and plan.sampling == "grid":
        return _with_column(table, "response_type", _without_neighbours(table))
    if not reach:
        return _with_column(table, "response_type", table.column("full_response_type").combine_chunks())
    shape = plan.shape if plan.sampling == "grid" else (-1, *plan.shape[1:])
    natures = np.array(table.column("nature").fill_null("undetermined").to_pylist()).reshape(shape)
    largest = table.column("largest_peak").to_numpy(zero_copy_only=False).reshape(shape)
    types = types_on_grid(natures, largest, axes=list(reach), reach=list(reach.values()))
    table = _with_column(table, "response_type", pa.array(types.ravel().tolist(), pa.string()))
    return _with_column(table, "type_neighbours", pa.array(plan.type_neighbours(rows), pa.int8()))


def _without_neighbours(table: pa.Table) -> pa.Array:
    """Types on a grid that is too coarse: III where not periodic, else that of runs of its own, or undetermined."""
    types = []
    for nature, full in zip(table["nature"].to_pylist(), table["full_response_type"].to_pylist(), strict=True):
        types.append(full or ("III" if nature in ("chaotic", "quasiperiodic") else "undetermined"))
    return pa.array(types, pa.string())


def _with_column(table: pa.Table, name: str, values: pa.Array) -> pa.Table:
    position = table.schema.get_field_index(name)
    return table.set_column(position, table.schema.field(position), values)
