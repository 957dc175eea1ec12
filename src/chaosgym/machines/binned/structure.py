"""What shapes the matrices of a machine: its class and the fields that are no speed and no clearance."""

from collections.abc import Callable
from dataclasses import fields
from functools import cache, lru_cache
from operator import attrgetter
from typing import Any

from chaosgym.machines.binned.equations import Held
from chaosgym.machines.binned.held_machine import HeldMachine

KEPT = 128
"""Machines whose assembled equations are kept, whatever their speed and clearance."""


def structure_of(machine: HeldMachine) -> tuple[Any, ...]:
    """Class and all fields that shape the matrices."""
    kind: Any = type(machine)
    return (kind, *_structure_values(kind)(machine))


@cache
def _structure_values(kind: Any) -> Callable[[Any], tuple[Any, ...]]:
    return attrgetter(*_structure_fields(kind))


@cache
def _structure_fields(kind: Any) -> tuple[str, ...]:
    return tuple(field.name for field in fields(kind) if field.name not in kind.beside_matrices)


def machine_of(kind: type, structure: tuple[Any, ...]) -> HeldMachine:
    """Machine at the default speed and clearance."""
    machine: HeldMachine = kind(**dict(zip(_structure_fields(kind), structure, strict=True)))
    return machine


@lru_cache(maxsize=KEPT)
def kept_held(kind: type, *structure: Any) -> Held:
    """What is held, kept for machines without a table of propagators."""
    return machine_of(kind, structure).held()
