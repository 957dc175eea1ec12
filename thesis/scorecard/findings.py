"""What is found for one condition of a statement, and how a kind of quantity is described."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

from chaosgym.machines import Machine
from thesis.scorecard.jobs import Job
from thesis.scorecard.observation import Effort
from thesis.statements import Comparison

Value = float | str | tuple[float, float] | None
Results = Sequence[Mapping[str, Any]]


class Finding(NamedTuple):
    """What was found for one condition of a statement.

    ``agrees`` is False where the nature of the response is not the printed one, whatever its force; ``deviation`` says
    how far natures are from the printed ones, 0 to 1: it leads a calibration where ``agrees`` is too blunt.
    """

    value: Value
    agrees: bool = True
    note: str = ""
    deviation: float = 0.0


class Quantity(NamedTuple):
    """How one kind of quantity is computed.

    ``jobs`` of one condition of a comparison: (machine, comparison, effort) -> jobs;
    ``finding`` from their results: (machine, comparison, results) -> Finding.
    """

    jobs: Callable[[Machine, Comparison, Effort], list[Job]]
    finding: Callable[[Machine, Comparison, Results], Finding]


def no_jobs(machine: Machine, comparison: Comparison, effort: Effort) -> list[Job]:
    """Return no jobs: the quantity follows from the machine itself."""
    return []
