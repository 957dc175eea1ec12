"""What the thesis' own numerics do to its statements: fixed steps of time, and matrices held over an angle.

The thesis integrates with a fixed step and updates the crank's matrices at intervals "much larger than the integration
time step" (5.2.2), mostly 5 deg. It names no step. Here the statements that settled responses decide are judged with
exact contacts and with fixed steps, and those about the crank with other intervals too, all by quick runs.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from chaosgym.machines import Machine, SliderCrank
from thesis.scorecard.evaluation import THESIS_MACHINES, evaluate
from thesis.scorecard.jobs import observation
from thesis.scorecard.objective import statements_of
from thesis.scorecard.observation import QUICK, Effort
from thesis.scorecard.quantities import QUANTITIES
from thesis.statements import Comparison

STEPS: Mapping[str, tuple[float, ...]] = {"impact-beam": (50.0, 20.0, 10.0, 5.0), "slider-crank": (200.0, 100.0, 50.0)}
"""Fixed steps of time [us], by machine; with longer ones the beam's highest mode grows without bound."""

INTERVALS = (1.0, 2.5, 10.0)
"""Angles [deg] between updates of the crank's matrices, beside the thesis' 5 deg."""


SHOWN = {"impact-beam": "IBS-024", "slider-crank": "SSC-053"}
"""A statement about a force of one dot, by machine, whose dots are shown."""


@dataclass(frozen=True)
class Numerics:
    """One way to integrate, and which statements it judges otherwise than exact contacts do.

    Attributes
    ----------
    name
        What is done.
    hits
        Statements that are hit.
    dots
        Nature and peak forces of the statement that is ``SHOWN``.
    won, lost
        Statements that are hit by this way alone, and by exact contacts alone.
    """

    name: str
    hits: int
    dots: str
    won: tuple[str, ...] = ()
    lost: tuple[str, ...] = ()


def settled_statements(machine: Machine) -> tuple[Comparison, ...]:
    """Statements that settled responses decide, and nothing else."""
    effort = QUICK[machine.name]

    def jobs(one: Comparison) -> list[Any]:
        return list(QUANTITIES[one.quantity].jobs(machine, one, effort))

    asked = [one for one in statements_of(machine.name) if not one.not_computed]
    return tuple(one for one in asked if (needed := jobs(one)) and all(job.run is observation for job in needed))


def ways(machine: Machine) -> Iterator[tuple[str, Machine, Effort]]:
    """Name, machine and effort of each way to integrate; exact contacts come first."""
    effort = QUICK[machine.name]
    yield "exact contacts", machine, effort
    for step in STEPS[machine.name]:
        yield f"steps of {step:g} us", machine, effort._replace(step=step)
    if isinstance(machine, SliderCrank):
        for interval in INTERVALS:
            yield f"matrices updated each {interval:g} deg", replace(machine, matrix_update_interval=interval), effort


def numerics(
    name: str, *, folder: Path | None = None, workers: int | None = None, progress: bool = False
) -> tuple[Numerics, ...]:
    """Judge the statements about one of the thesis' machines by each way to integrate.

    Parameters
    ----------
    name
        Of the machine.
    folder
        Where results of runs are kept, so that an interrupted call resumes; None keeps none.
    workers
        Number of threads; all processors by default.
    progress
        Show a progress bar on standard error.
    """
    machine = THESIS_MACHINES[name]
    asked, exact, found = settled_statements(machine), frozenset[str](), list[Numerics]()
    for way, changed, effort in ways(machine):
        bar = f"{name}, {way}" if progress else None
        machines: Mapping[str, Machine] = {name: changed}
        judged = evaluate(asked, machines, efforts={name: effort}, folder=folder, workers=workers, progress=bar)
        hit = frozenset(one.comparison.id for one in judged if one.verdict == "hit")
        exact = exact if found else hit
        dots = next(one.findings[0].note for one in judged if one.comparison.id == SHOWN[name])
        found.append(Numerics(way, len(hit), dots, tuple(sorted(hit - exact)), tuple(sorted(exact - hit))))
    return tuple(found)


HEAD = """# The thesis' own numerics

Written by `python -m thesis numerics --markdown`. The thesis integrates with a fixed step that it does not name, and
updates the crank's matrices at intervals, mostly of 5 deg (5.2.2). Would its statements come out otherwise by its
numerics than by exact contacts? The statements that settled responses decide are judged by quick runs each way.
Steps are those of Runge-Kutta's method of order four, and begin anew with each cycle; contacts begin and end amid them.

What it shows: held matrices change two statements of the crank at most.
Steps short enough for the beam's modes change none but a transient. Of the crank they scatter the forces of one dot:
where the thesis shows one dot its step was shorter than these, or it found its contacts in another way.
"""


def page(found: Mapping[str, tuple[Numerics, ...]]) -> str:
    """Return the page of the documentation as Markdown."""
    parts = [HEAD]
    for name, several in found.items():
        count = len(settled_statements(THESIS_MACHINES[name]))
        heading = f"| way | hits of {count} | {SHOWN[name]} | hit by it alone | lost |"
        parts += [f"## {name}\n", heading, "|---|---|---|---|---|", *map(_row, several), ""]
    return "\n".join(parts)


def _row(one: Numerics) -> str:
    return f"| {one.name} | {one.hits} | {one.dots} | {_names(one.won)} | {_names(one.lost)} |"


def _names(ids: tuple[str, ...]) -> str:
    return ", ".join(ids) or "-"
