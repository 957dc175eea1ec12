"""Arithmetic of several lanes at once that mechanisms alone need: Taylor series, and the matrices of eight bins.

Operations take their arguments as those of ``core.lanes``.
"""

from llvmlite import ir
from numba import types
from numba.core import cgutils

from chaosgym.core.lanes import DOUBLE, INT, LANES, dot_with, operation, some_at_once, sums_of_columns, write_columns


@operation()
def add_some_columns(e, table, at, width, count, left_out, more, factors, factors_at, out, out_at, stride):
    """As ``add_columns`` of ``count`` + ``left_out`` + ``more`` columns, the middle ones of which have the factor 0.

    The first two are an even number together.
    """
    write_columns(e, table, at, width, (count, left_out, more), factors, factors_at, out, out_at, stride)


@operation(types.float64)
def dot_of_distances(e, table, at, own, u_at, v_at, width):
    """As ``dot_of_sizes``, of the differences of two parts of an array."""

    def other(offset):
        u, v = (e.load(own, e.builder.add(at, offset)) for at in (u_at, v_at))
        return e.intrinsic("fabs", [e.builder.fsub(u, v)])

    return dot_with(e, table, at, width, other)


@operation()
def next_term(e, table, older, old, width, count, factors, by_older, by_old, more_at, weight, share, out_at):
    """Write ``share`` times all of: ``count`` columns from ``older`` on times their factors, ``weight`` times those
    from ``old`` on times theirs, and what lies at ``more_at``, in the array of the factors and of the answer."""
    b = e.builder
    shares, weights = e.spread(share), e.spread(b.fmul(weight, share))
    with e.vectors(width) as rows:
        first = e.times(rows.index, LANES)
        (known,) = sums_of_columns(e, table, [b.add(older, first)], width, (count, None, None), factors, by_older)
        known = b.fmul(shares, b.fadd(e.load(factors, b.add(more_at, first)), known))
        # what is old was written last: as little as possible waits for it
        (new,) = sums_of_columns(e, table, [b.add(old, first)], width, (count, None, None), factors, by_old)
        e.store(e.fma(weights, new, known), factors, b.add(out_at, first))


@operation()
def next_terms(e, table, older, old, count, own, first, more_at, most, shares, terms):
    """As ``next_term`` for several terms of a series of eight lanes and ``count`` of them, up to 7, with a column each.

    The first two terms lie at ``first``, the others are written behind them. Term k is weighted by k + 1 and number k
    of ``shares``; what is added to it lies at ``more_at``, eight numbers for each k up to ``most``. Columns and the
    last term stay in registers.
    """
    b = e.builder

    def sum_of(columns, factors):
        sums = [e.constant(0.0)] * 2
        for i, (column, factor) in enumerate(zip(columns, factors, strict=True)):
            sums[i % 2] = e.fma(column, factor, sums[i % 2])
        return b.fadd(*sums)

    def known_of(k, older_columns, factors):
        row = b.select(b.icmp_signed("<", k, most), k, most)
        more = e.load(own, b.add(more_at, e.times(row, LANES)))
        return b.fmul(e.spread(e.number(shares, k)), b.fadd(more, sum_of(older_columns, factors)))

    for size in range(1, LANES):
        with b.if_then(b.icmp_signed("==", count, e.index(size))):
            columns = [[e.load(table, b.add(at, e.index(i * LANES))) for i in range(size)] for at in (older, old)]
            known = e.accumulator(known_of(e.index(0), columns[0], e.each(e.load(own, first), size)))
            last = e.accumulator(e.load(own, b.add(first, e.index(LANES))))
            with cgutils.for_range(b, terms) as loop:
                k, after = loop.index, b.add(loop.index, e.index(1))
                weight = b.fmul(b.sitofp(after, DOUBLE), e.number(shares, k))
                factors = e.each(b.load(last), size)
                term = e.fma(e.spread(weight), sum_of(columns[1], factors), b.load(known))
                e.store(term, own, b.add(first, e.times(b.add(after, e.index(1)), LANES)))
                b.store(term, last)
                b.store(known_of(after, columns[0], factors), known)


@operation()
def add_rows(e, own, at, factor, sum_at, width):
    """Add a part of an array, (width,), a multiple of 8, times a factor to another part."""
    b = e.builder
    with e.vectors(width) as loop:
        offset = e.times(loop.index, LANES)
        total = b.add(sum_at, offset)
        product = e.fma(e.spread(factor), e.load(own, b.add(at, offset)), e.load(own, total))
        e.store(product, own, total)


@operation()
def add_sums(e, own, at, width, count, factors_at, factor, sum_at):
    """Add ``factor`` times the sum over c < ``count`` of factor c times row c to a part of an array, all (width,)."""
    b = e.builder
    with e.vectors(width) as loop:
        first = e.times(loop.index, LANES)
        (answer,) = sums_of_columns(e, own, [b.add(at, first)], width, (count, None, None), own, factors_at)
        total = b.add(sum_at, first)
        e.store(e.fma(e.spread(factor), answer, e.load(own, total)), own, total)


@operation()
def copy(e, own, at, out_at, count):
    """Copy numbers within an array without overlap; unlike numba's indexing it tests no sign of the index."""
    b = e.builder
    with e.vectors(b.add(count, e.index(LANES - 1))) as loop:
        first = e.times(loop.index, LANES)
        e.store_some(e.load(own, b.add(at, first)), own, b.add(out_at, first), b.sub(count, first))


@operation()
def sum_series(e, series, at, stride, last, time, out, out_at, width):
    """Write value and first two derivatives at ``time`` of ``width`` columns, a multiple of 8, into ``out`` (3, width).

    The series has a row of ``stride`` coefficients for each power of time up to ``last``.
    """
    b, times = e.builder, e.spread(time)
    sums = [e.accumulator(e.constant(0.0)) for _ in range(3)]
    with e.vectors(width) as columns:
        first = e.times(columns.index, LANES)
        begin = b.add(at, first)
        for one in sums:
            b.store(e.constant(0.0), one)
        with cgutils.for_range(b, b.add(last, e.index(1))) as terms:
            coefficient = e.load(series, b.add(begin, b.mul(b.sub(last, terms.index), stride)))
            value, slope, bend = (b.load(one) for one in sums)
            for one, sum_so_far, new in zip(sums, (value, slope, bend), (coefficient, value, slope), strict=True):
                b.store(e.fma(sum_so_far, times, new), one)
        for q, factor in enumerate((1.0, 1.0, 2.0)):
            place = b.add(b.add(out_at, first), b.mul(e.index(q), width))
            e.store(b.fmul(b.load(sums[q]), e.constant(factor)), out, place)


def _products(e, own, rows, matrix, width, count, columns):
    """Sums over k < ``count`` of vector k of each row times those of adjacent columns of a matrix (count, width)."""
    b = e.builder
    totals = [[e.accumulator(e.constant(0.0)) for _ in range(columns)] for _ in rows]
    with cgutils.for_range(b, count) as loop:
        place, begin = e.times(loop.index, LANES), b.add(matrix, b.mul(loop.index, width))
        factors = [e.load(own, b.add(row, place)) for row in rows]
        for k in range(columns):
            value = e.load(own, b.add(begin, e.index(k * LANES)))
            for factor, sums in zip(factors, totals, strict=True):
                e.add_product(sums[k], factor, value)
    return [[b.load(total) for total in sums] for sums in totals]


def _in_blocks(e, rows, width, answer_at, own, out_at):
    """Write rows (rows, width) of vectors that a function gives, in blocks of two rows and five columns.

    The function takes the numbers of adjacent rows, where the first column begins and how many there are.
    """
    b = e.builder

    def write_rows(tall, row):
        numbers = [b.add(row, e.index(k)) for k in range(tall)]

        def write(wide, column):
            begin = e.times(column, LANES)
            for number, answers in zip(numbers, answer_at(numbers, begin, wide), strict=True):
                place = b.add(b.add(out_at, b.mul(number, width)), begin)
                for k, answer in enumerate(answers):
                    e.store(answer, own, b.add(place, e.index(k * LANES)))

        some_at_once(e, b.udiv(width, e.index(LANES)), 5, write)

    some_at_once(e, rows, 2, write_rows)


@operation()
def multiply_eight(e, own, at, rows, matrix, width, count, out_at):
    """Write rows, ``width`` apart, times a matrix (count, width) / 8, for eight pairs: every number is a vector."""
    b = e.builder

    def answers(numbers, begin, columns):
        places = [b.add(at, b.mul(number, width)) for number in numbers]
        return _products(e, own, places, b.add(matrix, begin), width, count, columns)

    _in_blocks(e, rows, width, answers, own, out_at)


@operation()
def next_terms_of_eight(e, own, at, older, old, width, count, weight, share, out_at):
    """As ``next_term`` for eight series at once: rows (count, width) hold factors of ``older`` and ``old``."""
    b = e.builder
    shares, weights = e.spread(share), e.spread(b.fmul(weight, share))
    second = e.times(count, LANES)

    def answers(numbers, begin, columns):
        first = [b.add(at, b.mul(number, width)) for number in numbers]
        known = _products(e, own, first, b.add(older, begin), width, count, columns)
        places = [b.add(place, second) for place in first]
        new = _products(e, own, places, b.add(old, begin), width, count, columns)
        pairs = (zip(*both, strict=True) for both in zip(known, new, strict=True))
        return [[e.fma(weights, one, b.fmul(shares, other)) for other, one in row] for row in pairs]

    _in_blocks(e, count, width, answers, own, out_at)


@operation()
def deal(e, own, at, stride, count, out, out_at, length, places, written):
    """Write lane q of ``count`` vectors, ``stride`` apart, at q ``length``, for q < ``places``.

    Of the eight numbers of a lane the first ``written`` are, and those beyond the count are zero.
    """
    b, nothing = e.builder, e.constant(0.0)
    last, vectors = b.sub(count, e.index(1)), []
    for k in range(LANES):
        inside = b.icmp_signed("<", e.index(k), count)
        value = e.load(own, b.add(at, b.mul(b.select(inside, e.index(k), last), stride)))
        vectors.append(b.select(inside, value, nothing))
    span = LANES // 2
    while span:
        # halves of ``span`` lanes change places between vectors that lie as far apart
        low = [i if i & span == 0 else LANES + i - span for i in range(LANES)]
        high = [i + span if i & span == 0 else LANES + i for i in range(LANES)]
        for k in (k for k in range(LANES) if k & span == 0):
            pair = vectors[k], vectors[k + span]
            for place, lanes in ((k, low), (k + span, high)):
                vectors[place] = b.shuffle_vector(*pair, ir.Constant(ir.VectorType(INT, LANES), lanes))
        span //= 2
    for q, vector in enumerate(vectors):
        with b.if_then(b.icmp_signed("<", e.index(q), places)):
            e.store_some(vector, out, b.add(out_at, b.mul(e.index(q), length)), written)


@operation()
def keep_largest(e, own, at, largest_at, width):
    """Raise a part of an array, (width,), a multiple of 8, to the absolute values of another."""
    b = e.builder
    with e.vectors(width) as loop:
        offset = e.times(loop.index, LANES)
        place = b.add(largest_at, offset)
        size = e.intrinsic("fabs", [e.load(own, b.add(at, offset))])
        e.store(e.larger(e.load(own, place), size), own, place)
