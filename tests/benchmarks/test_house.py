"""The measures of the library's size count what they say, on a package whose counts are known."""

import json
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import InitVar
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, final

import click
import pytest
from click.testing import CliRunner

import chaosgym
from benchmarks.cli import app
from benchmarks.cli.house import CIRCLES
from benchmarks.house import of_sources
from benchmarks.house.options import options_by_command
from benchmarks.house.package import Package
from benchmarks.house.protocol import members
from benchmarks.house.running import CLEARANCE_MM, Trace, journey

SOURCES = {
    "__init__.py": '"""A package."""\n',
    "top.py": "from tiny.left import one\n",
    "left/__init__.py": "",
    "left/one.py": '''"""Of one."""

import os
from typing import TYPE_CHECKING

from tiny.right.three import Twice  # the end of a line

if TYPE_CHECKING:
    from tiny.left.two import Once


# a comment
class Once:
    """A class."""

    def many(self, a, b, c, /, d, e, f, *, g, h):
        """Eight arguments."""
        return """a text
        of two lines"""
''',
    "left/two.py": "from . import one\n\n\nclass Twice:\n    text = os = 1\n",
    "right/__init__.py": "from .three import Twice\n",
    "right/three.py": """def within(a, b, c, d, e, f, g, h, i):
    from ..left.two import Twice
    import json

    return clearance(a)


class Twice:
    made = str(1)


def clearance(value):
    return 1e-3 * value
""",
}


@pytest.fixture
def tiny(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Package]:
    """The package of ``SOURCES``."""
    for name, text in SOURCES.items():
        path = tmp_path / "tiny" / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    monkeypatch.syspath_prepend(str(tmp_path))
    yield Package(tmp_path / "tiny")
    for name in [name for name in sys.modules if name.partition(".")[0] == "tiny"]:
        del sys.modules[name]


def test_lines_of_code_leave_out_docstrings_comments_and_blanks(tiny: Package) -> None:
    """The lines of each folder are those counted by hand; a text that is returned is code."""
    assert of_sources(tiny)["wings"] == {
        "left": {"modules": 3, "code": 12},
        "right": {"modules": 2, "code": 9},
        "(top)": {"modules": 2, "code": 1},
        "all": {"modules": 7, "code": 22},
    }


def test_circles_are_told_by_when_the_imports_happen(tiny: Package) -> None:
    """One imports two for types only, two imports one; three imports two within a function, by way of one again."""
    found = of_sources(tiny)
    one, two, three = "tiny.left.one", "tiny.left.two", "tiny.right.three"
    assert found["circles"] == {
        "at_load": {"count": 0, "modules": []},
        "with_types": {"count": 1, "modules": [[one, two]]},
        "with_functions": {"count": 1, "modules": [[one, two, three]]},
    }
    assert found["imports_within_functions"] == {"right": 1, "all": 1}


def test_names_and_arguments(tiny: Package) -> None:
    """A name of two classes is told with both; eight arguments beside ``self`` are not too many, nine are."""
    found = of_sources(tiny)
    assert found["classes_named_twice"] == {
        "count": 1,
        "modules": {"Twice": ["tiny.left.two", "tiny.right.three"]},
    }
    assert found["functions_of_many_arguments"]["names"] == ["tiny.right.three:within"]
    assert tiny.arguments()["tiny.left.one:many"] == 8


def test_a_trace_counts_calls_and_units(tiny: Package) -> None:
    """Two calls in one module, none of those at its import; a clearance in millimetres that becomes metres."""
    trace = Trace(str(tiny.folder), set())
    sys.setprofile(trace)
    try:
        import_module("tiny.right.three").within(CLEARANCE_MM, *range(8))
    finally:
        sys.setprofile(None)
    assert trace.as_dict() == {"calls": 2, "functions": 2, "modules": 1}
    assert trace.units == ["mm", "m"]


class _Base(ABC):
    name: ClassVar[str]
    sides: ClassVar[int] = 2

    @abstractmethod
    def run(self) -> None: ...

    _hidden: ClassVar[int]


class _Protocol(_Base):
    scale: InitVar[float | None] = None

    def draw(self) -> None: ...

    @final
    def draw_twice(self) -> None: ...

    @property
    @final
    def size(self) -> int:
        return 2


class _Implemented(_Protocol):
    name = "all is there"

    def run(self) -> None: ...


def test_members_that_must_be_given() -> None:
    """An abstract method and a class variable without a value must be given; what is private or final counts not."""
    assert members(_Protocol) == {"must_give": 2, "may_give": 2}
    assert members(_Implemented) == {"must_give": 0, "may_give": 4}


class _OfMachines(click.Command):
    """Options of the machine named, of both where none is."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        ctx.meta["named"] = args[:1] or ["a", "b"]
        return super().parse_args(ctx, args)

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        return [*super().get_params(ctx), *(click.Option([f"--of-{name}"]) for name in ctx.meta["named"])]


def test_options_of_machines_stand_apart() -> None:
    """Own options, those of two machines, and of one; a group's commands stand for themselves, help for none."""
    machine, option = click.Argument(["machine"], required=False), click.Option(["--own"])
    commands = {
        "run": _OfMachines("run", params=[machine, option]),
        "set": click.Group("set", commands={"up": click.Command("up", params=[option])}),
    }
    assert options_by_command(commands, ["a", "b"]) == {
        "run": {"own": 1, "of_machines": 2, "of_a_named_machine": 1},
        "set up": {"own": 1, "of_machines": 0, "of_a_named_machine": 0},
        "all": {"own": 2, "of_machines": 2, "of_a_named_machine": 1},
    }


@pytest.fixture(scope="module")
def library() -> dict[str, Any]:
    """What the library's own sources tell."""
    return of_sources(Package(Path(chaosgym.__file__).parent))


def test_the_library_has_no_circle_and_no_class_name_twice(library: dict[str, Any]) -> None:
    """No module reaches itself by imports, those for types and those within functions among them."""
    assert {kind: circle["modules"] for kind, circle in library["circles"].items()} == {kind: [] for kind in CIRCLES}
    assert library["classes_named_twice"]["modules"] == {}


def test_a_clearance_reaches_a_kernel() -> None:
    """The library's own journey ends at a kernel, and the clearance that arrives there is in metres."""
    found = journey("clearance")
    assert found["units"].split()[-1] == "m"
    assert 0 < found["stack"] <= found["calls"]
    assert found["modules"] < found["modules_loaded"]


def test_figures_of_another_commit_stand_beside(library: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    """The stored measurement names the same figures as the command does, so that each stands beside its former self."""
    monkeypatch.setattr("benchmarks.house.of_sources", lambda _: library)
    monkeypatch.setattr("benchmarks.house.judging", lambda _: {"modules_loaded": 1, "processor_seconds": 1.0})
    monkeypatch.setattr("benchmarks.house.journey", lambda _: {"calls": 1})
    answer = CliRunner().invoke(app, ["house", "--json", "--beside", "docs/data/house.json"])
    rows = json.loads(answer.stdout)["figures"]
    for name in (
        "wings, all, code",
        "options, all, own",
        "protocol, must_give",
        "circles, at_load, count",
        "judging, modules_loaded",
        "journeys, clearance, calls",
    ):
        assert rows[name]["then"] >= 0.0
