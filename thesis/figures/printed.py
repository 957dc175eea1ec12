"""Values that the text prints, and statements that it contradicts itself, by the name of the statement."""

from functools import cache
from typing import NamedTuple

from thesis.scorecard import findings as atlas
from thesis.scorecard.verdicts import error_of
from thesis.statements import Comparison, read_comparisons, read_statements


class Printed(NamedTuple):
    """A printed number, or both ends of a range, in the printed unit."""

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


@cache
def _comparisons() -> dict[str, Comparison]:
    return {one.id: one for one in read_comparisons().compared}


def in_scorecard(target: str) -> bool:
    """Whether the scorecard has a row of a statement."""
    return target in _comparisons()


def comparison(target: str) -> Comparison:
    """How the scorecard compares a statement."""
    return _comparisons()[target]


def within(target: str, here: float | tuple[float, float] | None) -> bool:
    """Whether a value here, or both ends of a range, agrees with the statement: a hit of the scorecard."""
    return error_of(comparison(target), atlas.Finding(here)) <= 1.0


def contradiction(targets: tuple[str, ...]) -> str:
    """What the text itself says against one of these statements; empty if nothing."""
    known = _comparisons()
    return "; ".join(
        known[target].contradictory for target in targets if target in known and known[target].contradictory
    )
