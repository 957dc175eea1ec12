"""Arithmetic of eight lanes at once: products, sums and comparisons of LLVM vectors, for kernels.

Every sum has a fixed order and every fused multiply-add is written out, so that a result does not depend on how LLVM
optimises the kernel around it. A vector of eight doubles is legal on every processor: LLVM splits it where registers
are shorter, and calls a function for ``fma`` where the processor has none.

All arrays are contiguous. Coordinates u are (2 lanes + 2 harmonics, rounded up to a multiple of 8): the first and the
second coordinate of each block, padded to ``lanes``, then cosine and sine of each harmonic of the drive.
"""

from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

LANES = 8
"""Doubles of one vector."""

_DOUBLE, _INT, _INDEX = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
_VECTOR = ir.VectorType(_DOUBLE, LANES)
_UNDEFINED = ir.Constant(_VECTOR, ir.Undefined)
_OVERSHOOT = 4.0 / 27.0


class _Emitter:
    """Instructions of vectors, and the data pointers of arguments that are arrays."""

    def __init__(self, context: Any, builder: Any, signature: Any, arguments: Any) -> None:
        self.builder = builder
        self.arguments = [
            context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
            for kind, value in zip(signature.args, arguments, strict=True)
        ]

    def intrinsic(self, name: str, operands: list[Any]) -> Any:
        kind = ir.FunctionType(_VECTOR, [_VECTOR] * len(operands))
        function = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return self.builder.call(function, operands)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        return self.intrinsic("fma", [a, b, c])

    def constant(self, value: float) -> Any:
        return ir.Constant(_VECTOR, [value] * LANES)

    def address(self, pointer: Any, offset: Any) -> Any:
        return self.builder.bitcast(self.builder.gep(pointer, [offset]), _VECTOR.as_pointer())

    def load(self, pointer: Any, offset: Any) -> Any:
        vector = self.builder.load(self.address(pointer, offset))
        vector.align = 8
        return vector

    def store(self, vector: Any, pointer: Any, offset: Any) -> None:
        self.builder.store(vector, self.address(pointer, offset)).align = 8

    def spread(self, scalar: Any) -> Any:
        first = self.builder.insert_element(_UNDEFINED, scalar, ir.Constant(_INT, 0))
        return self.builder.shuffle_vector(first, _UNDEFINED, ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES))

    def index(self, value: int) -> Any:
        return ir.Constant(_INDEX, value)

    def times(self, value: Any, factor: int) -> Any:
        return self.builder.mul(value, self.index(factor))

    def larger(self, a: Any, b: Any) -> Any:
        return self.builder.select(self.builder.fcmp_ordered(">", a, b), a, b)

    def smaller(self, a: Any, b: Any) -> Any:
        return self.builder.select(self.builder.fcmp_ordered("<", a, b), a, b)

    def folded(self, vector: Any, combine: Any) -> Any:
        """All lanes combined, halves first."""
        for shift in (4, 2, 1):
            mask = ir.Constant(ir.VectorType(_INT, LANES), [(i + shift) % LANES for i in range(LANES)])
            vector = combine(vector, self.builder.shuffle_vector(vector, _UNDEFINED, mask))
        return self.builder.extract_element(vector, ir.Constant(_INT, 0))

    def accumulator(self, start: Any) -> Any:
        return cgutils.alloca_once_value(self.builder, start)

    def add_product(self, accumulator: Any, a: Any, b: Any) -> None:
        self.builder.store(self.fma(a, b, self.builder.load(accumulator)), accumulator)

    def lanes_below(self, count: Any) -> Any:
        """Mask of the lanes whose number is below a count."""
        kind = ir.VectorType(_INDEX, LANES)
        first = self.builder.insert_element(ir.Constant(kind, ir.Undefined), count, ir.Constant(_INT, 0))
        zeros = ir.Constant(ir.VectorType(_INT, LANES), [0] * LANES)
        spread = self.builder.shuffle_vector(first, ir.Constant(kind, ir.Undefined), zeros)
        return self.builder.icmp_signed("<", ir.Constant(kind, list(range(LANES))), spread)


@intrinsic
def sample(typing, free, driven, u, blocks, lanes, harmonics, scale, first, first_at, second, second_at):
    """Two quantities at eight instants, times ``scale``: to ``first`` and ``second`` from an offset on.

    ``free`` (2, 2, blocks, 8) and ``driven`` (2, 2, harmonics, 8): what each coordinate contributes, by quantity,
    coordinate of the block, block and instant.
    """

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_free, p_driven, p_u, n, width, h, factor, p_first, at_first, p_second, at_second = e.arguments
        sums = [e.accumulator(e.constant(0.0)) for _ in range(4)]
        for table, count, start, step in ((p_free, n, e.index(0), width), (p_driven, h, e.times(width, 2), h)):
            row = e.times(count, LANES)
            with cgutils.for_range(builder, count) as loop:
                offset = e.times(loop.index, LANES)
                for k in range(2):
                    at = builder.add(builder.add(start, loop.index), step) if k else builder.add(start, loop.index)
                    value = e.spread(builder.load(builder.gep(p_u, [at])))
                    for q in range(2):
                        place = builder.add(offset, e.times(row, 2 * q + k))
                        e.add_product(sums[2 * q + k], e.load(table, place), value)
        factors = e.spread(factor)
        for q, (pointer, at) in enumerate(((p_first, at_first), (p_second, at_second))):
            total = builder.fadd(builder.load(sums[2 * q]), builder.load(sums[2 * q + 1]))
            e.store(builder.fmul(total, factors), pointer, at)
        return context.get_dummy_value()

    integer = types.int64
    given = (free, driven, u, integer, integer, integer, types.float64, first, integer, second, integer)
    return types.void(*given), build


@intrinsic
def first_doubt(typing, values, slopes, h, low, high, doubt, start):
    """Number of the first interval, from ``start`` on, in which a quantity may leave (low, high); 8 if in none.

    ``values`` and ``slopes`` (16,) hold it from 7 on at the nine ends of eight intervals of length ``h``. The cubic
    through both ends exceeds them by at most 4/27 h times the slopes that lead beyond; ``doubt`` bounds how far the
    quantity is from the cubic.
    """

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_values, p_slopes, length, bottom, top, error, begin = e.arguments
        left, right = (e.load(p_values, e.index(k)) for k in (LANES - 1, LANES))
        before, after = (e.load(p_slopes, e.index(k)) for k in (LANES - 1, LANES))
        zero = e.constant(0.0)
        reach = builder.fmul(e.spread(length), e.constant(_OVERSHOOT))
        rise = builder.fsub(e.larger(before, zero), e.smaller(after, zero))
        fall = builder.fsub(e.larger(after, zero), e.smaller(before, zero))
        errors = e.spread(error)
        upper = builder.fadd(e.fma(reach, rise, e.larger(left, right)), errors)
        lower = builder.fsub(e.smaller(left, right), e.fma(reach, fall, errors))
        within = builder.and_(
            builder.fcmp_ordered("<", upper, e.spread(top)), builder.fcmp_ordered(">", lower, e.spread(bottom))
        )
        within = builder.or_(within, e.lanes_below(begin))
        bits = builder.zext(builder.bitcast(builder.not_(within), ir.IntType(LANES)), _INDEX)
        return builder.cttz(builder.or_(bits, e.index(1 << LANES)), ir.Constant(ir.IntType(1), 1))

    real = types.float64
    return types.int64(values, slopes, real, real, real, real, types.int64), build


@intrinsic
def largest(typing, values, count, least):
    """Largest of ``least`` and the first ``count`` of the values from 8 on."""

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        pointer, number, floor = e.arguments
        floors = e.spread(floor)
        chosen = builder.select(e.lanes_below(number), e.load(pointer, e.index(LANES)), floors)
        return e.folded(e.larger(chosen, floors), e.larger)

    return types.float64(values, types.int64, types.float64), build


@intrinsic
def turn(typing, entries, u, out, lanes):
    """Blocks ``entries`` (4, lanes) times u, to ``out``, which may be u."""

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_entries, p_u, p_out, width = e.arguments
        with cgutils.for_range(builder, builder.udiv(width, e.index(LANES))) as loop:
            at = [builder.add(e.times(loop.index, LANES), e.times(width, k)) for k in range(4)]
            first, second = e.load(p_u, at[0]), e.load(p_u, at[1])
            e11, e12, e21, e22 = (e.load(p_entries, k) for k in at)
            e.store(e.fma(e11, first, builder.fmul(e12, second)), p_out, at[0])
            e.store(e.fma(e22, second, builder.fmul(e21, first)), p_out, at[1])
        return context.get_dummy_value()

    return types.void(entries, u, out, types.int64), build


TAYLOR_TERMS = 6
"""Terms by which ``turn_and_expand`` goes on from the instant of a table."""


@intrinsic
def turn_and_expand(typing, entries, generator, u, time, out, lanes):
    """exp(B time) times ``entries`` times u by a Taylor series in time, to ``out``; B is ``generator`` (4, lanes)."""

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_entries, p_generator, p_u, elapsed, p_out, width = e.arguments
        times = e.spread(elapsed)
        with cgutils.for_range(builder, builder.udiv(width, e.index(LANES))) as loop:
            at = [builder.add(e.times(loop.index, LANES), e.times(width, k)) for k in range(4)]
            first, second = e.load(p_u, at[0]), e.load(p_u, at[1])
            e11, e12, e21, e22 = (e.load(p_entries, k) for k in at)
            a = e.fma(e11, first, builder.fmul(e12, second))
            b = e.fma(e22, second, builder.fmul(e21, first))
            b11, b12, b21, b22 = (builder.fmul(e.load(p_generator, k), times) for k in at)
            x, y = a, b
            for term in range(TAYLOR_TERMS, 0, -1):
                dx = e.fma(b11, x, builder.fmul(b12, y))
                dy = e.fma(b22, y, builder.fmul(b21, x))
                share = e.constant(1.0 / term)
                x, y = e.fma(dx, share, a), e.fma(dy, share, b)
            e.store(x, p_out, at[0])
            e.store(y, p_out, at[1])
        return context.get_dummy_value()

    return types.void(entries, generator, u, types.float64, out, types.int64), build


@intrinsic
def combine(typing, free, driven, constant, u, blocks, lanes, harmonics, out):
    """constant (2 lanes,) + columns ``free`` (2, blocks, 2 lanes) and ``driven`` (2, harmonics, 2 lanes) times u."""

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_free, p_driven, p_constant, p_u, n, width, h, p_out = e.arguments
        double = e.times(width, 2)
        with cgutils.for_range(builder, builder.udiv(double, e.index(2 * LANES))) as chunk:
            rows = [builder.add(e.times(chunk.index, 2 * LANES), e.index(k * LANES)) for k in range(2)]
            sums = [e.accumulator(e.constant(0.0)) for _ in range(4)]
            for q in range(2):
                builder.store(e.load(p_constant, rows[q]), sums[2 * q])
                builder.store(e.constant(0.0), sums[2 * q + 1])
            for table, count, start, step in ((p_free, n, e.index(0), width), (p_driven, h, double, h)):
                with cgutils.for_range(builder, count) as loop:
                    for k in range(2):
                        at = builder.add(start, loop.index)
                        column = loop.index
                        if k:
                            at, column = builder.add(at, step), builder.add(column, count)
                        value = e.spread(builder.load(builder.gep(p_u, [at])))
                        base = builder.mul(column, double)
                        for q in range(2):
                            e.add_product(sums[2 * q + k], e.load(table, builder.add(base, rows[q])), value)
            for q in range(2):
                total = builder.fadd(builder.load(sums[2 * q]), builder.load(sums[2 * q + 1]))
                e.store(total, p_out, rows[q])
        return context.get_dummy_value()

    integer = types.int64
    return types.void(free, driven, constant, u, integer, integer, integer, out), build


@intrinsic
def dot(typing, a, u, width):
    """Scalar product of two arrays (width,), a multiple of 8."""

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_a, p_u, count = e.arguments
        total = e.accumulator(e.constant(0.0))
        with cgutils.for_range(builder, builder.udiv(count, e.index(LANES))) as loop:
            at = e.times(loop.index, LANES)
            e.add_product(total, e.load(p_a, at), e.load(p_u, at))
        return e.folded(builder.load(total), builder.fadd)

    return types.float64(a, u, types.int64), build


@intrinsic
def dot_of_sizes(typing, a, u, width):
    """Scalar product of an array (width,) and the absolute values of another."""

    def build(context, builder, signature, arguments):
        e = _Emitter(context, builder, signature, arguments)
        p_a, p_u, count = e.arguments
        total = e.accumulator(e.constant(0.0))
        with cgutils.for_range(builder, builder.udiv(count, e.index(LANES))) as loop:
            at = e.times(loop.index, LANES)
            e.add_product(total, e.load(p_a, at), e.intrinsic("fabs", [e.load(p_u, at)]))
        return e.folded(builder.load(total), builder.fadd)

    return types.float64(a, u, types.int64), build


@intrinsic
def fma(typing, a, b, c):
    """a b + c with one rounding."""

    def build(context, builder, signature, arguments):
        return builder.fma(*arguments)

    return types.float64(types.float64, types.float64, types.float64), build
