"""Imports between the modules of a package, and the circles that they close.

A module also loads the packages above it; that is no import of its own and does not count.
"""

import ast
from collections.abc import Collection, Iterator
from enum import Enum
from graphlib import CycleError, TopologicalSorter
from typing import NamedTuple

from benchmarks.house.package import FUNCTIONS, Module, Package


class Kind(Enum):
    """When an import happens: as the module loads, as a function runs, or never, for it is for types alone."""

    LOAD = "at load"
    FUNCTION = "within a function"
    TYPES = "for types"


class Import(NamedTuple):
    """One module imports another."""

    source: str
    target: str
    kind: Kind


def imports(package: Package) -> set[Import]:
    """All imports of the package's own modules."""
    return {
        Import(module.name, target, kind)
        for module in package.modules.values()
        for node, kind in _statements(module.tree, Kind.LOAD)
        for target in _targets(node, module, package.modules)
        if target != module.name
    }


def _statements(node: ast.AST, kind: Kind) -> Iterator[tuple[ast.Import | ast.ImportFrom, Kind]]:
    """Statements of import below a node, and when they run."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.expr):  # holds no statement
            continue
        if isinstance(child, ast.Import | ast.ImportFrom):
            yield child, kind
        elif isinstance(child, ast.If) and "TYPE_CHECKING" in ast.unparse(child.test):
            yield from _statements(child, Kind.TYPES)
        elif isinstance(child, FUNCTIONS) and kind is Kind.LOAD:
            yield from _statements(child, Kind.FUNCTION)
        else:
            yield from _statements(child, kind)


def _targets(node: ast.Import | ast.ImportFrom, module: Module, modules: Collection[str]) -> Iterator[str]:
    """Modules of the package that a statement names."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in modules)
        return
    parts = module.name.split(".")
    up = node.level - module.is_package
    base = ".".join([*(parts[: len(parts) - up] if node.level else []), *([node.module] if node.module else [])])
    for alias in node.names:
        name = f"{base}.{alias.name}"
        if name in modules or base in modules:
            yield name if name in modules else base


def circles(ties: Collection[Import], kinds: Collection[Kind]) -> list[list[str]]:
    """Largest groups of modules that reach each other by imports of some kinds, those of most modules first."""
    targets: dict[str, set[str]] = {}
    for tie in ties:
        if tie.kind in kinds:
            targets.setdefault(tie.source, set()).add(tie.target)
    groups: list[set[str]] = []
    while (circle := _a_circle(targets, groups)) is not None:
        joined = [group for group in groups if group & circle]
        groups = [group for group in groups if not group & circle] + [circle.union(*joined)]
    return sorted((sorted(group) for group in groups), key=lambda group: (-len(group), group))


def _a_circle(targets: dict[str, set[str]], groups: list[set[str]]) -> set[str] | None:
    """Modules of one circle, each group counting as its first module; None if there is none left."""
    first = {module: min(group) for group in groups for module in group}
    graph: dict[str, set[str]] = {}
    for source, reached in targets.items():
        own = first.get(source, source)
        graph.setdefault(own, set()).update({first.get(target, target) for target in reached} - {own})
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        return set(error.args[1])
    return None
