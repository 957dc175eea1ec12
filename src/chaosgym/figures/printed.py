"""Which values does the text print? By the name of the statement."""

from typing import NamedTuple

from chaosgym.reference import read_statements


class Printed(NamedTuple):
    """A printed number, or both ends of a range."""

    low: float
    high: float


def printed(target: str) -> Printed:
    """Value of a statement in its printed unit.

    Raises
    ------
    KeyError
        If there is no such statement, or it prints no number.
    """
    statement = read_statements()[target]
    if statement.low is None or statement.high is None:
        raise KeyError(f"{target} prints no number")
    return Printed(statement.low, statement.high)
