"""The operations of ``core.lanes`` and ``core.binned.lanes`` in numpy, without care for the order of sums.

Arguments are those of the compiled operations, which the library documents.
"""

import numpy as np

import chaosgym.core.binned.lanes
import chaosgym.core.lanes
from chaosgym.core.lanes import LANES, TAYLOR_TERMS

OPERATIONS = {}
"""All operations by name."""


def compiled(name):
    """The operation of the library."""
    return getattr(chaosgym.core.lanes, name, None) or getattr(chaosgym.core.binned.lanes, name)


def operation(function):
    """List an operation; it sees arrays of any shape as one row, as compiled ones do."""

    def flat(*arguments):
        return function(*(one.reshape(-1) if isinstance(one, np.ndarray) else one for one in arguments))

    OPERATIONS[function.__name__] = flat
    return flat


def _taken(array, at, *shape):
    return array[at : at + int(np.prod(shape))].reshape(shape)


@operation
def sample(table, at, own, u_at, blocks, lanes, first_at, second_at):
    """What two quantities are at eight instants."""
    u = _taken(own, u_at, 2, lanes)[:, :blocks]
    shown = np.einsum("qkbi,kb->qi", _taken(table, at, 2, 2, blocks, LANES), u)
    for place, quantity in zip((first_at, second_at), shown, strict=True):
        own[place : place + LANES] = quantity


@operation
def first_doubt(own, values_at, slopes_at, h, low, high, doubt, start):
    """First interval that a quantity may leave."""
    values, slopes = own[values_at : values_at + 9], own[slopes_at : slopes_at + 9]
    rise, fall = 4.0 / 27.0 * h * np.maximum(slopes, 0.0), 4.0 / 27.0 * h * np.maximum(-slopes, 0.0)
    upper = np.maximum(values[:-1], values[1:]) + rise[:-1] + fall[1:] + doubt
    lower = np.minimum(values[:-1], values[1:]) - fall[:-1] - rise[1:] - doubt
    doubtful = ~((upper < high) & (lower > low))
    doubtful[:start] = False
    return int(np.argmax(doubtful)) if doubtful.any() else LANES


def _propagated(entries, at, u, lanes):
    blocks = _taken(entries, at, 2, 2, lanes)
    return np.einsum("ijb,jb->ib", blocks, u)


@operation
def propagate(entries, at, own, u_at, out_at, lanes):
    """Each block times its coordinates."""
    own[out_at : out_at + 2 * lanes] = _propagated(entries, at, _taken(own, u_at, 2, lanes), lanes).ravel()


@operation
def propagate_and_expand(entries, at, generator_at, own, u_at, time, out_at, lanes):
    """As ``propagate``, and on from there by the series of the exponential."""
    start = _propagated(entries, at, _taken(own, u_at, 2, lanes), lanes)
    moved = start
    for term in range(TAYLOR_TERMS, 0, -1):
        moved = start + time / term * _propagated(entries, generator_at, moved, lanes)
    own[out_at : out_at + 2 * lanes] = moved.ravel()


@operation
def dot(table, at, own, u_at, width):
    """Scalar product."""
    return table[at : at + width] @ own[u_at : u_at + width]


@operation
def dot_of_sizes(table, at, own, u_at, width):
    """Scalar product with absolute values."""
    return table[at : at + width] @ abs(own[u_at : u_at + width])


@operation
def add_columns(table, at, width, count, factors, factors_at, out, out_at, stride):
    """Columns times factors."""
    answer = factors[factors_at : factors_at + count] @ _taken(table, at, count, width)
    for k, eight in enumerate(np.pad(answer, (0, -width % LANES)).reshape(-1, LANES)):
        out[out_at + k * stride :][:LANES] = eight


@operation
def add_some_columns(table, at, width, count, left_out, more, factors, factors_at, out, out_at, stride):
    """Columns times factors, some of which are zero."""
    given = factors.copy()
    given[factors_at + count : factors_at + count + left_out] = 0.0
    columns = count + left_out + more
    OPERATIONS["add_columns"](table, at, width, columns, given, factors_at, out, out_at, stride)


@operation
def next_term(table, older, old, width, count, factors, by_older, by_old, more_at, weight, share, out_at):
    """A term of a series from the two before it."""
    known = factors[by_older : by_older + count] @ _taken(table, older, count, width)
    new = factors[by_old : by_old + count] @ _taken(table, old, count, width)
    factors[out_at : out_at + width] = share * (known + weight * new + factors[more_at : more_at + width])


@operation
def next_terms(table, older, old, count, own, first, more_at, most, shares, terms):
    """Terms of a series from the two before them."""
    for k in range(terms):
        at, more = first + k * LANES, more_at + min(k, most) * LANES
        given = (own, at, at + LANES, more, k + 1.0, shares[k], at + 2 * LANES)
        OPERATIONS["next_term"](table, older, old, LANES, count, *given)


@operation
def copy(own, at, out_at, count):
    """Numbers copied."""
    own[out_at : out_at + count] = own[at : at + count]


@operation
def dot_of_distances(table, at, own, u_at, v_at, width):
    """Scalar product with absolute differences."""
    return table[at : at + width] @ abs(own[u_at : u_at + width] - own[v_at : v_at + width])


@operation
def add_rows(own, at, factor, sum_at, width):
    """Numbers times a factor, added to others."""
    own[sum_at : sum_at + width] += factor * own[at : at + width]


@operation
def add_sums(own, at, width, count, factors_at, factor, sum_at):
    """Sum of rows times factors, times a factor, added to numbers."""
    answer = own[factors_at : factors_at + count] @ _taken(own, at, count, width)
    own[sum_at : sum_at + width] += factor * answer


@operation
def multiply_eight(own, at, rows, matrix, width, count, out_at):
    """Eight products of rows and a matrix."""
    columns = _taken(own, matrix, count, width // LANES, LANES)
    for row in range(rows):
        answer = np.einsum("kl,kcl->cl", _taken(own, at + row * width, count, LANES), columns)
        own[out_at + row * width :][:width] = answer.ravel()


@operation
def next_terms_of_eight(own, at, older, old, width, count, weight, share, out_at):
    """Terms of eight series from the two before them."""
    before = [_taken(own, first, count, width // LANES, LANES) for first in (older, old)]
    for row in range(count):
        factors = _taken(own, at + row * width, 2, count, LANES)
        known, new = (np.einsum("kl,kcl->cl", *pair) for pair in zip(factors, before, strict=True))
        own[out_at + row * width :][:width] = share * (known + weight * new).ravel()


@operation
def deal(own, at, stride, count, out, out_at, length, places, written):
    """Eight vectors turned into eight rows."""
    rows = np.zeros((LANES, LANES))
    for k in range(count):
        rows[k] = own[at + k * stride :][:LANES]
    for q in range(places):
        out[out_at + q * length :][:written] = rows[:written, q]


@operation
def keep_largest(own, at, largest_at, width):
    """Largest absolute values."""
    own[largest_at : largest_at + width] = np.maximum(own[largest_at : largest_at + width], abs(own[at : at + width]))


@operation
def add_tops(own, values_at, slopes_at, h, sign, weight, more, totals_at):
    """Largest values of cubics."""
    values, slopes = sign * own[values_at : values_at + 9], sign * own[slopes_at : slopes_at + 9]
    rise = np.maximum(slopes[:-1], 0.0) - np.minimum(slopes[1:], 0.0)
    own[totals_at : totals_at + LANES] += weight * (np.maximum(values[:-1], values[1:]) + 4.0 / 27.0 * h * rise) + more


@operation
def first_above(own, at, limit, start):
    """First value that is not below a limit."""
    above = ~(own[at : at + LANES] < limit)
    above[:start] = False
    return int(np.argmax(above)) if above.any() else LANES


@operation
def sum_series(series, at, stride, last, time, out, out_at, width):
    """Value and first two derivatives of the columns of a series."""
    columns = _taken(series, at, last + 1, stride)[::-1, :width]
    for k in range(3):
        of_power = [np.polyval(np.polyder(column, k), time) for column in columns.T]
        out[out_at + k * width : out_at + (k + 1) * width] = of_power


@operation
def item(own, at):
    """Number at a place."""
    return own.reshape(-1)[at]


@operation
def exponent(value):
    """Exponent of two of a number above 0."""
    return int(np.frexp(value)[1]) - 1 if np.isfinite(value) else 1024


@operation
def power_of_two(power):
    """Two to the power of an integer."""
    return 2.0 ** int(power)


@operation
def put(own, at, value):
    """Number put at a place."""
    own.reshape(-1)[at] = value


@operation
def fma(a, b, c):
    """Product and sum, rounded twice."""
    return a * b + c
