"""The gate for a machine's numbers: what passes it is finite, real, in range and of the right shape."""

import math
import re

import numpy as np
import pytest

from chaosgym.errors import ParameterError
from chaosgym.numbers import number, numbers, shown
from chaosgym.units import parse_row


def refused(call, *arguments, **keywords):
    """The line with which a value is refused."""
    with pytest.raises(ParameterError) as told:
        call(*arguments, **keywords)
    assert "\n" not in str(told.value)
    return str(told.value)


@pytest.mark.parametrize("given", [0.5, 2.0, 1, np.float32(0.75), np.array(1.5), np.int8(2)])
def test_a_number_passes_with_both_ends_of_its_range(given):
    """Real numbers of Python and numpy, as a float."""
    passed = number("x", given, 0.5, 2.0)
    assert isinstance(passed, float)
    assert passed == float(given)


@pytest.mark.parametrize("given", [0.4999, 2.0001, math.nan, math.inf, -math.inf, -1e300])
def test_a_number_out_of_range_is_named_with_its_unit(given):
    """Name, value, range; nan and infinity are out of every range."""
    line = refused(number, "x", given, 0.5, 2.0, "mm")
    assert line == f"x = {float(given):g} mm is out of range; allowed: 0.5 to 2 mm"
    bare = refused(number, "x", given, 0.5, 2.0)
    assert bare == f"x = {float(given):g} is out of range; allowed: 0.5 to 2"


@pytest.mark.parametrize("given", ["one", "1.5", True, None, [1.0], {}, 1j, 10**400])
def test_what_is_no_number_is_shown(given):
    """Texts, truth values, lists, nothing, complex numbers and whole numbers beyond the largest float."""
    line = refused(number, "x", given, 0.5, 2.0, "mm")
    assert line == f"x = {shown(given)} is out of range; allowed: 0.5 to 2 mm"
    assert refused(number, "x", given, 0.5, 2.0).endswith("allowed: 0.5 to 2")


def test_what_is_long_is_cut():
    """Sixty letters of a text, of a whole number and of any other object; none of a number that Python won't write."""

    class Other:
        def __repr__(self):
            return "o" * 61

    assert shown("short") == "'short'"
    assert [len(shown(long)) for long in ("a" * 61, 10**61, Other())] == [60, 60, 60]
    assert [len(shown(long)) for long in ("a" * 58, 10**59)] == [60, 60]
    assert "..." not in shown(10**59)
    assert shown(10**5000) == "a whole number of thousands of digits"


def test_an_array_passes_as_floats():
    """With both ends of the range; shapes are given by number, or by None for one and more."""
    passed = numbers("x", [1, 2], 1.0, 2.0)
    assert (passed.dtype, passed.tolist()) == (np.float64, [1.0, 2.0])
    assert numbers("x", np.ones((2, 3), np.float32), 0.0, 1.0, shape=(2, None)).shape == (2, 3)
    assert numbers("x", np.ones(3, np.uint8), 1.0, 1.0, shape=(3,)).dtype == np.float64
    assert numbers("x", 1.5, 0.0, 2.0, shape=()).shape == ()
    single = numbers("x", np.ones(2, np.float32), 0.0, 1.0)
    assert single.dtype == np.float64


@pytest.mark.parametrize(
    ("given", "kind"),
    [([1j], "complex128"), (["1"], "str32"), ([True], "bool"), ([None], "object"), ([10**400], "object")],
)
def test_an_array_of_another_kind_is_refused(given, kind):
    """Complex, text, truth values and objects are no real numbers."""
    assert refused(numbers, "x", given, 0.0, 1.0) == f"x holds {kind} values; allowed: real numbers"


def test_what_is_no_array_is_refused():
    """Rows of several lengths."""
    assert refused(numbers, "x", [[1.0], [1.0, 2.0]], 0.0, 1.0) == "x holds no array of numbers"


@pytest.mark.parametrize(
    ("given", "shape", "there", "wanted"),
    [
        ([], (None,), "0", "1 or more"),
        ([1.0, 1.0], (3,), "2", "3"),
        (1.0, (None,), "no row of", "1 or more"),
        ([[1.0, 1.0]], (None,), "1 x 2", "1 or more"),
        ([[1.0, 1.0]], (2, None), "1 x 2", "2, 1 or more"),
        (np.ones((2, 0)), (2, None), "2 x 0", "2, 1 or more"),
    ],
)
def test_an_array_of_another_shape_is_refused(given, shape, there, wanted):
    """An empty axis too; the line says what there is and what is wanted."""
    assert refused(numbers, "x", given, 0.0, 1.0, shape=shape) == f"x has {there} entries; allowed: {wanted}"


@pytest.mark.parametrize("bad", [-0.1, 1.1, math.nan, math.inf])
def test_the_first_entry_out_of_range_is_named(bad):
    """As that of a single number; later ones are not."""
    line = refused(numbers, "x", [0.5, bad, 7.0], 0.0, 1.0, "mm")
    assert line == f"x = {bad:g} mm is out of range; allowed: 0 to 1 mm"
    assert refused(numbers, "x", [0.0, 1.0, bad], 0.0, 1.0, "mm") == line, "the ends of the range are in it"
    assert re.fullmatch(r"x = \S+ is out of range; allowed: 0 to 1", refused(numbers, "x", [bad], 0.0, 1.0))


@pytest.mark.parametrize(
    ("text", "unit", "stray"),
    [
        ("50, 0, nan mm", "m", ", nan"),
        ("9.1 Hz, 61 Hz", "Hz", "Hz, 61"),
        ("0, 1O0, 300 N", "N", "O0, 300"),
        ("5 N m", "m", "N"),
        ("1 - 2 N", "N", "- 2"),
    ],
)
def test_a_row_is_read_to_its_end(text, unit, stray):
    """No number is dropped because what stands before it is none, and no unit because a known one ends the text."""
    assert f"has {stray!r} after its first numbers" in refused(parse_row, "x", text, unit)
    assert parse_row("x", "1, -2.5e1; 3 4 mm", "m") == [0.001, -0.025, 0.003, 0.004]
