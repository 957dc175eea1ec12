"""Arithmetic of several lanes at once: products, sums and comparisons of LLVM vectors, for kernels.

Every sum has a fixed order and every fused multiply-add is written out, so that a result does not depend on how LLVM
optimises the kernel around it. A vector of eight doubles is legal on every processor: LLVM splits it where registers
are shorter, and calls a function for ``fma`` where the processor has none.

Operations take arrays of one dimension, contiguous, each followed by the place at which something begins in it: an
array of more dimensions costs a kernel's compilation three numbers a dimension wherever it is handed on. Coordinates u
are (2 lanes,), the first and then the second coordinate of each block; ``lanes`` is a multiple of 8.
"""

from collections.abc import Callable
from inspect import signature as signature_of
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, register_jitable

LANES = 8
"""Doubles of one vector."""

DOUBLE, INT, INDEX = ir.DoubleType(), ir.IntType(32), ir.IntType(64)
_OVERSHOOT = 4.0 / 27.0


@register_jitable
def padded(count: int) -> int:
    """Count, rounded up to a multiple of 8."""
    return LANES * ((count + LANES - 1) // LANES)


@register_jitable
def unset(size: int) -> Any:
    """Return memory (size,) that begins a line of the cache: a vector that lies in two takes twice as long to load."""
    memory = np.empty(size + LANES - 1)
    skipped = (-memory.ctypes.data % (8 * LANES)) // 8
    return memory[skipped : skipped + size]


@register_jitable
def aligned(size: int) -> Any:
    """Return zeros (size,) that begin a line of the cache."""
    zeros = unset(size)
    zeros[:] = 0.0
    return zeros


class _Emitter:
    """Instructions of vectors."""

    kind = ir.VectorType(DOUBLE, LANES)

    def __init__(self, builder: Any) -> None:
        self.builder = builder

    def intrinsic(self, name: str, operands: list[Any]) -> Any:
        kind = ir.FunctionType(self.kind, [self.kind] * len(operands))
        function = cgutils.get_or_insert_function(self.builder.module, kind, f"llvm.{name}.v{LANES}f64")
        return self.builder.call(function, operands)

    def fma(self, a: Any, b: Any, c: Any) -> Any:
        return self.intrinsic("fma", [a, b, c])

    def constant(self, value: float) -> Any:
        return ir.Constant(self.kind, [value] * LANES)

    def index(self, value: int) -> Any:
        return ir.Constant(INDEX, value)

    def times(self, value: Any, factor: int) -> Any:
        return self.builder.mul(value, self.index(factor))

    def number(self, pointer: Any, at: Any) -> Any:
        return self.builder.load(self.builder.gep(pointer, [at]))

    def address(self, pointer: Any, at: Any) -> Any:
        return self.builder.bitcast(self.builder.gep(pointer, [at]), self.kind.as_pointer())

    def load(self, pointer: Any, at: Any) -> Any:
        vector = self.builder.load(self.address(pointer, at))
        vector.align = 8
        return vector

    def store(self, vector: Any, pointer: Any, at: Any) -> None:
        self.builder.store(vector, self.address(pointer, at)).align = 8

    def store_some(self, vector: Any, pointer: Any, at: Any, count: Any) -> None:
        name, flags = f"llvm.masked.store.v{LANES}f64.p0v{LANES}f64", ir.VectorType(ir.IntType(1), LANES)
        kinds = [self.kind, self.kind.as_pointer(), INT, flags]
        store = cgutils.get_or_insert_function(self.builder.module, ir.FunctionType(ir.VoidType(), kinds), name)
        operands = [vector, self.address(pointer, at), ir.Constant(INT, 8), self.lanes_below(count)]
        self.builder.call(store, operands)

    def spread(self, scalar: Any) -> Any:
        kind = ir.VectorType(scalar.type, LANES)
        nothing = ir.Constant(kind, ir.Undefined)
        first = self.builder.insert_element(nothing, scalar, ir.Constant(INT, 0))
        zeros = ir.Constant(ir.VectorType(INT, LANES), [0] * LANES)
        return self.builder.shuffle_vector(first, nothing, zeros)

    def each(self, vector: Any, count: int) -> list[Any]:
        """The first lanes of a vector, each spread."""
        nothing = ir.Constant(self.kind, ir.Undefined)
        masks = [ir.Constant(ir.VectorType(INT, LANES), [i] * LANES) for i in range(count)]
        return [self.builder.shuffle_vector(vector, nothing, mask) for mask in masks]

    def shifted(self, vector: Any, first: Any) -> Any:
        """A number and all lanes but the last: a load across what was just stored would wait for it."""
        mask = ir.Constant(ir.VectorType(INT, LANES), [LANES, *range(LANES - 1)])
        return self.builder.shuffle_vector(vector, self.spread(first), mask)

    def larger(self, a: Any, b: Any) -> Any:
        return self.builder.select(self.builder.fcmp_ordered(">", a, b), a, b)

    def smaller(self, a: Any, b: Any) -> Any:
        return self.builder.select(self.builder.fcmp_ordered("<", a, b), a, b)

    def folded(self, vector: Any, combine: Any) -> Any:
        """All lanes combined, halves first."""
        shift = LANES // 2
        while shift:
            lanes = [(i + shift) % LANES for i in range(LANES)]
            mask = ir.Constant(ir.VectorType(INT, LANES), lanes)
            vector = combine(vector, self.builder.shuffle_vector(vector, ir.Constant(self.kind, ir.Undefined), mask))
            shift //= 2
        return self.builder.extract_element(vector, ir.Constant(INT, 0))

    def accumulator(self, start: Any) -> Any:
        return cgutils.alloca_once_value(self.builder, start)

    def add_product(self, accumulator: Any, a: Any, b: Any) -> None:
        self.builder.store(self.fma(a, b, self.builder.load(accumulator)), accumulator)

    def total(self, first: Any, second: Any) -> Any:
        return self.builder.fadd(self.builder.load(first), self.builder.load(second))

    def vectors(self, width: Any) -> Any:
        """Loop over the vectors of a width; its index times their lanes is where each begins."""
        return cgutils.for_range(self.builder, self.builder.udiv(width, self.index(LANES)))

    def lanes_below(self, count: Any) -> Any:
        """Mask of the lanes whose number is below a count."""
        numbers = ir.Constant(ir.VectorType(INDEX, LANES), list(range(LANES)))
        return self.builder.icmp_signed("<", numbers, self.spread(count))


def _argument_type(kind: Any) -> Any:
    return kind if isinstance(kind, types.Array) else types.int64 if isinstance(kind, types.Integer) else types.float64


def operation(returns: Any = types.void) -> Callable[[Callable[..., Any]], Any]:
    """Intrinsic whose instructions a function of an emitter and the arguments writes; an array comes as a pointer."""

    def decorate(write: Callable[..., Any]) -> Any:
        def define(typing, *given):
            def build(context, builder, signature, arguments):
                values = [
                    context.make_array(kind)(context, builder, value).data if isinstance(kind, types.Array) else value
                    for kind, value in zip(signature.args, arguments, strict=True)
                ]
                result = write(_Emitter(builder), *values)
                return context.get_dummy_value() if result is None else result

            return returns(*map(_argument_type, given)), build

        define.__name__, define.__doc__ = write.__name__, write.__doc__
        define.__signature__ = signature_of(write)  # type: ignore[attr-defined]
        return intrinsic(define)

    return decorate


def some_at_once(e, total, at_once, write):
    """Call a function of a number of things and the first of them, for some at once, then for single ones."""
    b = e.builder
    several = b.udiv(total, e.index(at_once))
    with cgutils.for_range(b, several) as loop:
        write(at_once, e.times(loop.index, at_once))
    done = e.times(several, at_once)
    with cgutils.for_range(b, b.sub(total, done)) as loop:
        write(1, b.add(done, loop.index))


@operation()
def sample(e, table, at, own, u_at, blocks, lanes, first_at, second_at):
    """Two quantities of u at eight instants: into ``own`` from ``first_at`` and ``second_at`` on.

    The table (2, 2, blocks, 8) is what each coordinate contributes, by quantity, coordinate of the block, block and
    instant.
    """
    b = e.builder
    sums = [e.accumulator(e.constant(0.0)) for _ in range(4)]
    row = e.times(blocks, LANES)
    with cgutils.for_range(b, blocks) as loop:
        offset = b.add(at, e.times(loop.index, LANES))
        for k in range(2):
            place = b.add(u_at, loop.index)
            value = e.spread(e.number(own, b.add(place, lanes) if k else place))
            for q in range(2):
                e.add_product(sums[2 * q + k], e.load(table, b.add(offset, e.times(row, 2 * q + k))), value)
    for q, target in enumerate((first_at, second_at)):
        e.store(e.total(*sums[2 * q : 2 * q + 2]), own, target)


@operation(types.int64)
def first_doubt(e, own, values_at, slopes_at, h, low, high, doubt, start):
    """Number of the first interval, from ``start`` on, in which a quantity may leave (low, high); 8 if in none.

    Values and slopes (9,) are at the ends of eight intervals of length ``h``. The cubic through both ends exceeds them
    by at most 4/27 h times the slopes that lead beyond; ``doubt`` bounds how far the quantity is from the cubic.
    """
    b, zero = e.builder, e.constant(0.0)
    right, after = (e.load(own, b.add(at, e.index(1))) for at in (values_at, slopes_at))
    left, before = e.shifted(right, e.number(own, values_at)), e.shifted(after, e.number(own, slopes_at))
    reach = b.fmul(e.spread(h), e.constant(_OVERSHOOT))
    rise = b.fsub(e.larger(before, zero), e.smaller(after, zero))
    fall = b.fsub(e.larger(after, zero), e.smaller(before, zero))
    errors = e.spread(doubt)
    upper = b.fadd(e.fma(reach, rise, e.larger(left, right)), errors)
    lower = b.fsub(e.smaller(left, right), e.fma(reach, fall, errors))
    within = b.and_(b.fcmp_ordered("<", upper, e.spread(high)), b.fcmp_ordered(">", lower, e.spread(low)))
    within = b.or_(within, e.lanes_below(start))
    bits = b.zext(b.bitcast(b.not_(within), ir.IntType(LANES)), INDEX)
    return b.cttz(b.or_(bits, e.index(1 << LANES)), ir.Constant(ir.IntType(1), 1))


def _propagated(e, entries, at, own, u_at, lanes, offset):
    """First and second coordinates of the blocks at ``offset`` times ``entries`` (4, lanes), and where they lie."""
    b = e.builder
    places = [b.add(offset, e.times(lanes, k)) for k in range(4)]
    first, second = (e.load(own, b.add(u_at, place)) for place in places[:2])
    e11, e12, e21, e22 = (e.load(entries, b.add(at, place)) for place in places)
    return e.fma(e11, first, b.fmul(e12, second)), e.fma(e22, second, b.fmul(e21, first)), places


@operation()
def propagate(e, entries, at, own, u_at, out_at, lanes):
    """Blocks ``entries`` (4, lanes) times u, into ``own`` from ``out_at`` on, which may be where u is."""
    with e.vectors(lanes) as loop:
        x, y, places = _propagated(e, entries, at, own, u_at, lanes, e.times(loop.index, LANES))
        e.store(x, own, e.builder.add(out_at, places[0]))
        e.store(y, own, e.builder.add(out_at, places[1]))


TAYLOR_TERMS = 6
"""Terms by which ``propagate_and_expand`` goes on from the instant of a table."""


@operation()
def propagate_and_expand(e, entries, at, generator_at, own, u_at, time, out_at, lanes):
    """As ``propagate``, then times exp(B time) by a Taylor series in time; B (4, lanes) is in ``entries`` too."""
    b = e.builder
    times = e.spread(time)
    with e.vectors(lanes) as loop:
        first, second, places = _propagated(e, entries, at, own, u_at, lanes, e.times(loop.index, LANES))
        b11, b12, b21, b22 = (b.fmul(e.load(entries, b.add(generator_at, place)), times) for place in places)
        x, y = first, second
        for term in range(TAYLOR_TERMS, 0, -1):
            dx = e.fma(b11, x, b.fmul(b12, y))
            dy = e.fma(b22, y, b.fmul(b21, x))
            share = e.constant(1.0 / term)
            x, y = e.fma(dx, share, first), e.fma(dy, share, second)
        e.store(x, own, b.add(out_at, places[0]))
        e.store(y, own, b.add(out_at, places[1]))


def dot_with(e, table, at, width, other):
    """Scalar product of a part of an array, (width,), and of vectors that a function of their beginning gives."""
    b = e.builder
    total = e.accumulator(e.constant(0.0))
    with e.vectors(width) as loop:
        offset = e.times(loop.index, LANES)
        e.add_product(total, e.load(table, b.add(at, offset)), other(offset))
    return e.folded(b.load(total), b.fadd)


@operation(types.float64)
def dot(e, table, at, own, u_at, width):
    """Scalar product of parts of two arrays, (width,), a multiple of 8."""
    return dot_with(e, table, at, width, lambda offset: e.load(own, e.builder.add(u_at, offset)))


@operation(types.float64)
def dot_of_sizes(e, table, at, own, u_at, width):
    """Scalar product of a part of one array and the absolute values of another, (width,), a multiple of 8."""
    return dot_with(e, table, at, width, lambda offset: e.intrinsic("fabs", [e.load(own, e.builder.add(u_at, offset))]))


def sums_of_columns(e, table, places, width, counts, factors, factors_at):
    """Sums over c of factor c times column c, whose lanes begin at each of some places + c ``width``; pairs alternate.

    Columns are ``counts``: (how many, how many are left out after them), an even number of both, and how many more.
    """
    b = e.builder
    sums = [[e.accumulator(e.constant(0.0)) for _ in range(2)] for _ in places]

    def add(c, which):
        factor = e.spread(e.number(factors, b.add(factors_at, c)))
        for place, pair in zip(places, sums, strict=True):
            e.add_product(pair[which], e.load(table, b.add(place, b.mul(c, width))), factor)

    def add_some(first, count):
        with cgutils.for_range(b, b.udiv(count, e.index(2))) as pairs:
            c = b.add(first, e.times(pairs.index, 2))
            add(c, 0)
            add(b.add(c, e.index(1)), 1)
        with b.if_then(b.trunc(count, ir.IntType(1))):
            add(b.add(first, b.sub(count, e.index(1))), 0)

    count, left_out, more = counts
    add_some(e.index(0), count)
    if more is not None:
        add_some(b.add(count, left_out), more)
    return [e.total(*pair) for pair in sums]


def write_columns(e, table, at, width, counts, factors, factors_at, out, out_at, stride):
    """Write sums over columns, two vectors at once."""
    b = e.builder

    def write(vectors, first):
        numbers = [b.add(first, e.index(k)) for k in range(vectors)]
        places = [b.add(at, e.times(number, LANES)) for number in numbers]
        for number, answer in zip(
            numbers, sums_of_columns(e, table, places, width, counts, factors, factors_at), strict=True
        ):
            e.store(answer, out, b.add(out_at, b.mul(number, stride)))

    some_at_once(e, b.udiv(b.add(width, e.index(LANES - 1)), e.index(LANES)), 2, write)


@operation()
def add_columns(e, table, at, width, count, factors, factors_at, out, out_at, stride):
    """Write the sum over c < ``count`` of factor c times column c of a table (columns, width).

    Each eight numbers begin ``stride`` after the eight before them. Whole vectors are written: what comes after the
    width means nothing.
    """
    write_columns(e, table, at, width, (count, None, None), factors, factors_at, out, out_at, stride)


@operation()
def add_tops(e, own, values_at, slopes_at, h, sign, weight, more, totals_at):
    """Add to eight totals what ``sign`` times a quantity is at most in each interval, times ``weight``, + ``more``.

    Values and slopes (9,) and what the cubic through them reaches are those of ``first_doubt``.
    """
    b = e.builder
    signs = e.spread(sign)
    right, after = (e.load(own, b.add(at, e.index(1))) for at in (values_at, slopes_at))
    left, before = e.shifted(right, e.number(own, values_at)), e.shifted(after, e.number(own, slopes_at))
    right, after, left, before = (b.fmul(signs, one) for one in (right, after, left, before))
    rise = b.fsub(e.larger(before, e.constant(0.0)), e.smaller(after, e.constant(0.0)))
    top = e.fma(b.fmul(e.spread(h), e.constant(_OVERSHOOT)), rise, e.larger(left, right))
    total = b.fadd(e.load(own, totals_at), e.spread(more))
    e.store(e.fma(e.spread(weight), top, total), own, totals_at)


@operation(types.int64)
def first_above(e, own, at, limit, start):
    """Number of the first of eight values, from ``start`` on, that is not below a limit; 8 if all are."""
    b = e.builder
    below = b.or_(b.fcmp_ordered("<", e.load(own, at), e.spread(limit)), e.lanes_below(start))
    bits = b.zext(b.bitcast(b.not_(below), ir.IntType(LANES)), INDEX)
    return b.cttz(b.or_(bits, e.index(1 << LANES)), ir.Constant(ir.IntType(1), 1))


@operation(types.float64)
def item(e, own, at):
    """Number at an index that is not negative; unlike numba's indexing it does not test for that."""
    return e.number(own, at)


@operation(types.int64)
def exponent(e, value):
    """Exponent of two of a number above 0: the largest k with 2^k not above it; 1024 of infinity."""
    bits = e.builder.lshr(e.builder.bitcast(value, INDEX), e.index(52))
    return e.builder.sub(bits, e.index(1023))


@operation(types.float64)
def power_of_two(e, power):
    """Two to the power of an integer from -1022 to 1023."""
    return e.builder.bitcast(e.builder.shl(e.builder.add(power, e.index(1023)), e.index(52)), DOUBLE)


@operation()
def put(e, own, at, value):
    """Write a number at a place that is not negative."""
    e.builder.store(value, e.builder.gep(own, [at]))


@operation(types.float64)
def fma(e, a, b, c):
    """Product of the first two plus the third, with one rounding."""
    return e.builder.fma(a, b, c)
