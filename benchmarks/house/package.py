"""A package's sources: lines of code, modules, classes and arguments, by wing."""

import ast
from collections import Counter
from collections.abc import Iterable, Iterator
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

TOP = "(top)"
"""Wing of the modules that lie in no folder of the package."""

FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


class Module(NamedTuple):
    """A module: its dotted name, its parsed source, and its lines of code."""

    name: str
    tree: ast.Module
    code: int
    is_package: bool


class Package:
    """The modules below a folder; a wing is a folder right below it."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.name = folder.name

    @cached_property
    def modules(self) -> dict[str, Module]:
        """All modules by their dotted names."""
        every = (self._module(path) for path in sorted(self.folder.rglob("*.py")))
        return {module.name: module for module in every}

    def _module(self, path: Path) -> Module:
        text = path.read_text(encoding="utf-8")
        tree = ast.parse(text)
        parts = [self.name, *path.relative_to(self.folder).with_suffix("").parts]
        is_package = parts[-1] == "__init__"
        return Module(".".join(parts[:-1] if is_package else parts), tree, code_lines(text, tree), is_package)

    def wing(self, module: str) -> str:
        """Wing of a module."""
        _, wing, *below = [*module.split("."), ""]
        return wing if below and (below[0] or self.modules[module].is_package) and wing else TOP

    def wings(self) -> dict[str, dict[str, int]]:
        """Modules and lines of code of each wing, the largest first, and of all."""
        code: Counter[str] = Counter()
        for module in self.modules.values():
            code[self.wing(module.name)] += module.code
        modules = self.by_wing(self.modules)
        rows = {wing: {"modules": modules[wing], "code": lines} for wing, lines in code.most_common()}
        return {**rows, "all": {"modules": len(self.modules), "code": code.total()}}

    def by_wing(self, modules: Iterable[str]) -> dict[str, int]:
        """How many of some modules each wing has, and how many there are in all."""
        counts = Counter(map(self.wing, modules))
        return {**dict(counts.most_common()), "all": counts.total()}

    def classes_named_twice(self) -> dict[str, list[str]]:
        """Names of classes that several modules define, and those modules."""
        places: dict[str, list[str]] = {}
        for module in self.modules.values():
            for node in module.tree.body:
                if isinstance(node, ast.ClassDef):
                    places.setdefault(node.name, []).append(module.name)
        return {name: modules for name, modules in sorted(places.items()) if len(modules) > 1}

    def arguments(self) -> dict[str, int]:
        """Arguments of every function, by ``module:function``, those with most first; ``self`` and ``cls`` are none."""
        counts: dict[str, int] = {}
        for module in self.modules.values():
            for node in statements(module.tree):
                if isinstance(node, FUNCTIONS):
                    names = [each.arg for each in (*node.args.posonlyargs, *node.args.args)]
                    count = len(names) - (names[:1] in (["self"], ["cls"])) + len(node.args.kwonlyargs)
                    name = f"{module.name}:{node.name}"
                    counts[name] = max(count, counts.get(name, 0))
        return dict(sorted(counts.items(), key=lambda row: (-row[1], row[0])))


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """All nodes below one but expressions, which hold no statement."""
    for child in ast.iter_child_nodes(node):
        if not isinstance(child, ast.expr):
            yield child
            yield from statements(child)


def code_lines(text: str, tree: ast.Module) -> int:
    """Lines of a source that are neither blank nor a comment nor a text that is no value, such as a docstring."""
    code = {
        number for number, line in enumerate(text.splitlines(), 1) if line.strip() and not line.strip().startswith("#")
    }
    for node in statements(tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant) and isinstance(node.value.value, str):
            code -= {*range(node.lineno, (node.end_lineno or node.lineno) + 1)}
    return len(code)
