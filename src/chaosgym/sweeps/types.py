"""Response type of each point: that of the points up to one tolerance beside it, along speed and clearance."""

import numpy as np
import pyarrow as pa

from chaosgym.diagnosis.type_rule import CROSS, type_of_cross, types_on_grid
from chaosgym.sweeps.plan import SweepPlan


def with_response_types(table: pa.Table, plan: SweepPlan, rows: range) -> pa.Table:
    """Fill in the response types of some rows: a whole grid, whole crosses, or any other points."""
    natures = np.array(table.column("nature").fill_null("undetermined").to_pylist())
    largest = table.column("largest_peak").to_numpy(zero_copy_only=False)
    if plan.sampling == "crosses":
        crosses = zip(natures.reshape(-1, len(CROSS)), largest.reshape(-1, len(CROSS)), strict=True)
        kinds = [kind for cross in crosses for kind in (type_of_cross(*cross)[0], *[None] * (len(CROSS) - 1))]
        table = _with_column(table, "response_type", pa.array(kinds, pa.string()))
        return _with_column(table, "type_neighbours", pa.array(plan.type_neighbours(rows), pa.int8()))
    reach = plan.type_axes()
    if not reach and plan.sampling == "grid":
        return _with_column(table, "response_type", _without_neighbours(table))
    if not reach:
        return _with_column(table, "response_type", table.column("full_response_type").combine_chunks())
    types = types_on_grid(
        natures.reshape(plan.shape), largest.reshape(plan.shape), axes=list(reach), reach=list(reach.values())
    )
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
