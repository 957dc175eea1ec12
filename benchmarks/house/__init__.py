"""The size and the ties of the library: what a change adds to it, and what it takes away."""

from pathlib import Path
from typing import Any

import click

import chaosgym
from benchmarks.house.imports import Kind, circles, imports
from benchmarks.house.options import options_by_command
from benchmarks.house.package import Package
from benchmarks.house.protocol import members
from benchmarks.house.running import JOURNEYS, journey, judging

MOST_ARGUMENTS = 8
"""Arguments of a function beyond which it is listed."""


def house(repeats: int = 5) -> dict[str, Any]:
    """Measure the library that is imported; ``repeats`` runs give its processor time of judging a CSV."""
    from chaosgym.cli import COMMANDS, app
    from chaosgym.machines import MACHINES
    from chaosgym.machines.machine import Machine

    package, context = Package(Path(chaosgym.__file__).parent), click.Context(app)
    return {
        **of_sources(package),
        "options": options_by_command({name: app.get_command(context, name) for name in COMMANDS}, list(MACHINES)),
        "protocol": members(Machine),
        "judging": judging(repeats),
        "journeys": {name: journey(name) for name in JOURNEYS},
    }


def of_sources(package: Package) -> dict[str, Any]:
    """What the sources alone tell."""
    ties = imports(package)
    within = [tie for tie in ties if tie.kind is Kind.FUNCTION]
    kinds = {
        "at_load": {Kind.LOAD},
        "with_types": {Kind.LOAD, Kind.TYPES},
        "with_functions": {Kind.LOAD, Kind.FUNCTION},
    }
    groups = {name: circles(ties, chosen) for name, chosen in kinds.items()}
    twice = package.classes_named_twice()
    long = [name for name, count in package.arguments().items() if count > MOST_ARGUMENTS]
    return {
        "wings": package.wings(),
        "imports_within_functions": package.by_wing(tie.source for tie in within),
        "circles": {name: {"count": len(group), "modules": group} for name, group in groups.items()},
        "classes_named_twice": {"count": len(twice), "modules": twice},
        "functions_of_many_arguments": {
            "by_wing": package.by_wing(name.partition(":")[0] for name in long),
            "names": long,
        },
    }
