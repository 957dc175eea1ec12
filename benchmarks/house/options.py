"""Options of commands: their own, and those that belong to machines."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import click


def options_by_command(commands: Mapping[str, Any], machines: Sequence[str]) -> dict[str, dict[str, int]]:
    """Own options of each command, those of machines that it shows where none is named, and the most of a named one.

    A group stands for its commands. The last row adds all up.
    """
    rows = dict(row for name, command in commands.items() for row in _rows(name, command, machines))
    return {**rows, "all": {kind: sum(row[kind] for row in rows.values()) for kind in _count(click.Command(None), [])}}


def _rows(name: str, command: Any, machines: Sequence[str]) -> Iterator[tuple[str, dict[str, int]]]:
    if not isinstance(command, click.Group):
        yield name, _count(command, machines)
        return
    for below, one in command.commands.items():
        yield from _rows(f"{name} {below}", one, machines)


def _count(command: click.Command, machines: Sequence[str]) -> dict[str, int]:
    own = {option.name for option in command.params if isinstance(option, click.Option)}
    return {
        "own": len(own),
        "of_machines": len(_offered(command, []) - own),
        "of_a_named_machine": max((len(_offered(command, [name]) - own) for name in machines), default=0),
    }


def _offered(command: click.Command, line: list[str]) -> set[str | None]:
    """Names of the options that a command has on a line of words, without that of its help."""
    if line and not any(isinstance(each, click.Argument) for each in command.params):
        return set()
    context = command.make_context("", line, resilient_parsing=True)
    every = (each for each in command.get_params(context) if isinstance(each, click.Option))
    return {each.name for each in every if "--help" not in each.opts}
