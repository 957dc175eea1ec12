"""Lines of a stream: one number of each, and never a wrong one without a word."""

import time

import pytest

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.stream import LineReader, stalls


def read(lines, **options):
    """Readings of lines."""
    reader, found = LineReader(**options), []
    for number, line in enumerate(lines, start=1):
        value = reader.read(line, number, first=not found)
        if value is not None:
            found.append(value)
    return found


def test_lines_of_a_stream_are_read_as_those_of_a_file():
    """Decimal commas, headings and comments."""
    lines = ["force [N]", "48,5", "# pause", '"48,25"', "", "47"]
    assert read(lines) == [48.5, 48.25, 47.0]


@pytest.mark.parametrize("text", ["abc", "nan", "1;2", '"48.5', "1e400", "100 N"])
def test_what_is_no_number_is_named(text):
    """The line and what it holds."""
    reader = LineReader()
    reader.read("40", 1, first=True)
    with pytest.raises(DiagnosisError, match="standard input, line 4"):
        reader.read(text, 4, first=False)


def test_a_comma_is_never_guessed():
    """1,100 may be 1.1 N or two columns."""
    with pytest.raises(DiagnosisError, match="may be a decimal comma or two columns"):
        read(["1,100"])
    assert read(["1,100", "2,101"], column="2") == [100.0, 101.0]
    assert read(["1,100", "2,101"], delimiter=";") == [1.1, 2.101]


@pytest.mark.parametrize(
    ("lines", "options", "found"),
    [
        (["cycle;force [kN]", "1;0,1", "2;0,25"], {"column": "force"}, [100.0, 250.0]),
        (["t,F", "0.1,5", "0.2,6"], {"column": "F", "unit": "kN"}, [5000.0, 6000.0]),
        (["0.1\t5", "0.2\t6"], {"column": "2"}, [5.0, 6.0]),
        (["Channel A [V]", "1", "2"], {"scale": "100 mV/N"}, [10.0, 20.0]),
        (["1 5 7", "2 6 8"], {"column": "3"}, [7.0, 8.0]),
    ],
)
def test_column_unit_and_calibration(lines, options, found):
    """A column by name or number, its unit from the heading or the option, a calibration in volts."""
    assert read(lines, **options) == pytest.approx(found)


def test_a_missing_column_and_a_wrong_unit_are_named():
    """One line each."""
    with pytest.raises(DiagnosisError, match="no column '5'"):
        read(["1,2"], column="5")
    with pytest.raises(DiagnosisError, match="asks for forces"):
        LineReader(unit="furlong")


def test_a_stalled_stream_is_told_once():
    """Nothing for 0.1 s gives one sign; the line after it comes as usual."""

    def slow():
        yield "1"
        time.sleep(0.4)
        yield "2"

    assert list(stalls(slow(), 0.1)) == [(1, "1"), (1, None), (2, "2")]
