"""What lives beside the motion of a point: the search of ``diagnose --margins``, told while the page works."""

from chaosgym.branches.coexistence import coexistence
from chaosgym.diagnosis import diagnose
from chaosgym.errors import ParameterError, SimulationError
from chaosgym.explore.point import BUDGET, check_cost
from chaosgym.machines import Machine

LOOKING = "other motions: looking for them ..."
"""Told until the search has ended."""

MOST_SECONDS = 3e-3
"""Processor time of a cycle [s] up to which the search, some 7,000 cycles, is made here."""


def beside_of(machine: Machine) -> tuple[str, ...]:
    """Other motions of a machine, how far was looked, and over which speeds each motion is stable.

    Random starts, run-ups and run-downs are those of every command.

    Examples
    --------
    >>> from chaosgym.explore.beside import beside_of
    >>> beside_of(chaosgym.ImpactBeam(excitation_frequency=10.0))[0][:64]
    'other motions: 48 random starts up to 10 times the motion and ru'
    """
    try:
        verdict = diagnose(machine, budget=BUDGET)
        if verdict.nature != "periodic":
            return ("other motions: looked for only beside a motion that repeats",)
        check_cost(machine, MOST_SECONDS)
        beside = coexistence(machine, verdict, workers=1)
    except (ParameterError, SimulationError) as error:
        return (f"other motions: not looked for: {error}",)
    told = beside.attractors.told_of(verdict).statement.other_motions
    return (f"other motions: {told}", *beside.lines)
