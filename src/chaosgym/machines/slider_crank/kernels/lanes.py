"""Sums of columns in the registers of a processor: the innermost loop of the exact kernel.

Numba keeps no array in registers, so a plain loop stores its sums once for every few columns and takes twice as long.
The order of a sum is fixed and its products are fused, so that every caller gets the same bits on every processor.
"""

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, register_jitable

LANES = 4
"""Rows are summed in groups of so many; tables have rows in whole multiples."""

_DOUBLE = ir.DoubleType()
_GROUP = ir.VectorType(_DOUBLE, LANES)
_INDEX = ir.IntType(64)


@register_jitable
def padded(count: int) -> int:
    """Smallest multiple of ``LANES`` from ``count`` on."""
    return count + (-count) % LANES


def _number(value):
    return ir.Constant(_INDEX, value)


class _Groups:
    """Arrays of an intrinsic, read and written in groups of lanes."""

    def __init__(self, context, builder, signature, arguments):
        self.builder = builder
        self.arrays = [
            context.make_array(kind)(context, builder, value)
            for kind, value in zip(signature.args, arguments, strict=True)
            if isinstance(kind, types.Array)
        ]
        self.width = cgutils.unpack_tuple(builder, self.arrays[0].shape)[1]
        self.fused = cgutils.get_or_insert_function(
            builder.module, ir.FunctionType(_GROUP, [_GROUP] * 3), f"llvm.fma.v{LANES}f64"
        )

    def place(self, pointer, offset):
        """Address of the group that begins at ``offset``."""
        return self.builder.bitcast(self.builder.gep(pointer, [offset]), _GROUP.as_pointer())

    def load(self, pointer, offset):
        """The group that begins at ``offset``."""
        group = self.builder.load(self.place(pointer, offset))
        group.align = 8
        return group

    def store(self, group, pointer, offset):
        """Write a group."""
        self.builder.store(group, self.place(pointer, offset)).align = 8

    def spread(self, number):
        """A group of one number."""
        first = self.builder.insert_element(ir.Constant(_GROUP, ir.Undefined), number, _number(0))
        return self.builder.shuffle_vector(first, first, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES))

    def total(self, table, first_column, count, factors, first):
        """Sum over c < ``count`` of ``factors[c]`` times the group at ``first`` of column ``first_column + c``."""
        builder = self.builder
        sums = [cgutils.alloca_once(builder, _GROUP) for _ in range(2)]
        for one in sums:
            builder.store(ir.Constant(_GROUP, [0.0] * LANES), one)

        def add(c, one):
            column = builder.mul(builder.add(first_column, c), self.width)
            factor = self.spread(builder.load(builder.gep(factors, [c])))
            group = self.load(table, builder.add(column, first))
            builder.store(builder.call(self.fused, [group, factor, builder.load(one)]), one)

        with cgutils.for_range(builder, builder.udiv(count, _number(2))) as pairs:
            c = builder.mul(pairs.index, _number(2))
            add(c, sums[0])
            add(builder.add(c, _number(1)), sums[1])
        with builder.if_then(builder.trunc(count, ir.IntType(1))):
            add(builder.sub(count, _number(1)), sums[0])
        return builder.fadd(builder.load(sums[0]), builder.load(sums[1]))

    def rows(self):
        """Loop over the groups of a column; the index times ``LANES`` is where each begins."""
        return cgutils.for_range(self.builder, self.builder.udiv(self.width, _number(LANES)))


@intrinsic
def combine(typing_context, table, count, factors, answer):
    """Write the sum over c < ``count`` of ``factors[c] * table[c]`` into the first ``table.shape[1]`` of ``answer``.

    ``table`` (count or more, W) with W a multiple of ``LANES``; all arrays contiguous.
    """

    def build(context, builder, signature, arguments):
        groups = _Groups(context, builder, signature, arguments)
        columns, weights, sums = (array.data for array in groups.arrays)
        with groups.rows() as rows:
            first = builder.mul(rows.index, _number(LANES))
            groups.store(groups.total(columns, _number(0), arguments[1], weights, first), sums, first)
        return context.get_dummy_value()

    return types.void(table, types.int64, factors, answer), build


@intrinsic
def next_term(typing_context, table, count, older, old, weight, share, answer):
    """Add to ``answer`` the sum over c < ``count`` of ``older[c] * table[c] + weight * old[c] * table[count + c]``.

    All of ``answer`` (table.shape[1],) is then multiplied by ``share``; arrays as for ``combine``.
    """

    def build(context, builder, signature, arguments):
        groups = _Groups(context, builder, signature, arguments)
        columns, early, late, sums = (array.data for array in groups.arrays)
        count, weight, share = arguments[1], groups.spread(arguments[4]), groups.spread(arguments[5])
        with groups.rows() as rows:
            first = builder.mul(rows.index, _number(LANES))
            known = builder.fadd(groups.load(sums, first), groups.total(columns, _number(0), count, early, first))
            new = groups.total(columns, count, count, late, first)
            groups.store(builder.fmul(share, builder.call(groups.fused, [weight, new, known])), sums, first)
        return context.get_dummy_value()

    return types.void(table, types.int64, older, old, types.float64, types.float64, answer), build
