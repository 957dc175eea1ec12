"""Do the tests notice a mistake, anywhere but in kernels? A sample of changes, each tried with the tests that reach it.

Changes are mutmut's: of operators, constants, arguments and texts in functions. A wing is a folder of the library; its
share of the sample is that of its lines, and a module is drawn by its lines. The tests of a wing run once unchanged,
and tell which lines each reaches. Rows are written as they are made, so a run that was stopped goes on. A wing whose
tests do not pass unchanged is left out, and named.
"""

import ast
import json
import math
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).parents[1]
LIBRARY = ROOT / "src" / "chaosgym"

WITHOUT = ("core", "envs/kernels")
"""Kernels, whose changes are compiled anew: they are held by golden results."""

SHARED = ("tests/test_thresholds.py", "tests/test_arguments.py", "tests/test_examples.py")
"""Tests that belong to several wings."""

ALONE = ("tests/test_files.py", "tests/machines/test_numbers.py", "tests/test_fuzz.py")
"""Tests of the modules that are in no folder."""

COMMANDS = tuple(f"tests/{name}" for name in ("branches", "control", "design", "fidelity", "fit", "plants"))
"""Folders whose tests run commands of their own, and draw what these draw."""

MORE = {
    "cli": COMMANDS,
    "plotting": (*COMMANDS, "tests/cli"),
    "recordings": ("tests/series", *(f"tests/cli/test_{name}_cli.py" for name in ("measured", "run_up", "monitor"))),
    "series": ("tests/recordings",),
}
"""Tests of a wing that are not in its folder."""

PATIENCE = 900.0
"""Time [s] after which a change that makes tests hang counts as noticed."""


class Change(NamedTuple):
    """A change of one module: its number in the sample, wing, path, line, and what stands there before and after."""

    number: int
    wing: str
    path: str
    line: int
    before: str
    after: str
    code: str


def wings() -> dict[str, list[Path]]:
    """Modules of each wing; those in no folder are the wing "top"."""
    found: dict[str, list[Path]] = {}
    for path in sorted(LIBRARY.rglob("*.py")):
        inner = path.relative_to(LIBRARY).as_posix()
        if path.name != "__init__.py" and not inner.startswith(WITHOUT):
            found.setdefault(inner.split("/")[0] if "/" in inner else "top", []).append(path)
    return found


def shares(sizes: dict[str, int], count: int) -> dict[str, int]:
    """A count divided in proportion to sizes, by largest remainders."""
    exact = {name: count * size / sum(sizes.values()) for name, size in sizes.items()}
    whole = {name: int(value) for name, value in exact.items()}
    late = sorted(exact, key=lambda name: whole[name] - exact[name])
    return {name: whole[name] + (name in late[: count - sum(whole.values())]) for name in sizes}


def sample(count: int, seed: int, wanted: tuple[str, ...] = ()) -> Iterator[Change]:
    """Changes of the library, ``count`` of them, in an order that is drawn as well: the first are a sample too.

    Of some wings alone, if they are named: what is drawn of a wing does not hang on the others.
    """
    modules = wings()
    lines = {wing: [len(path.read_text().splitlines()) for path in paths] for wing, paths in modules.items()}
    places = [
        wing for wing, share in shares({w: sum(n) for w, n in lines.items()}, count).items() for _ in range(share)
    ]
    draw = random.Random(seed)
    draw.shuffle(places)
    for number, wing in enumerate(places):
        if wanted and wing not in wanted:
            continue
        own = random.Random(f"{seed} {number}")
        while not (made := changes(own.choices(modules[wing], lines[wing])[0])):
            pass
        yield made[own.randrange(len(made))](number, wing)


@cache
def changes(path: Path) -> list[Any]:
    """Makers of the changes of a module."""
    from libcst import Module
    from mutmut.mutation.file_mutation import create_mutations, deep_replace

    code = path.read_text()
    module, mutations, *_ = create_mutations(str(path), code)

    def maker(mutation: Any) -> Any:
        def make(number: int, wing: str) -> Change:
            replaced: Any = deep_replace(module, mutation.original_node, mutation.mutated_node)
            changed = replaced.code
            pairs = zip(code.splitlines(), changed.splitlines(), strict=False)
            line = next((place for place, (old, new) in enumerate(pairs, start=1) if old != new), 0)
            nodes = mutation.original_node, mutation.mutated_node
            before, after = (Module([]).code_for_node(one).strip() for one in nodes)
            return Change(number, wing, path.relative_to(LIBRARY).as_posix(), line, before, after, changed)

        return make

    return [maker(one) for one in mutations if one.contained_by_top_level_function is not None]


def chosen_tests(wing: str) -> list[str]:
    """Test files of a wing."""
    own = sorted((ROOT / "tests" / wing).rglob("test_*.py"))
    files = [*ALONE] if wing == "top" else [one.relative_to(ROOT).as_posix() for one in own]
    return [*files, *SHARED, *MORE.get(wing, ())]


def pytest(source: Path, *words: str, seconds: float | None = None, **environment: str) -> bool:
    """Whether a run of pytest with the library of a folder passes within a time."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *words]
    where = os.environ | {"PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"} | environment
    try:
        done = subprocess.run(command, cwd=ROOT, env=where, capture_output=True, timeout=seconds, check=False)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def who_reaches(source: Path, wing: str) -> dict[str, dict[int, list[str]]] | None:
    """Tests of a wing by module and line that they reach in their own process; None if they do not pass."""
    from coverage import CoverageData

    library = source / "chaosgym"
    data = source.parent / f"{wing}.coverage"
    words = [f"--cov={library}", "--cov-context=test", "--cov-report=", *chosen_tests(wing)]
    if not pytest(source, *words, COVERAGE_FILE=str(data)):
        return None
    reached = CoverageData(str(data))
    reached.read()
    return {Path(path).relative_to(library).as_posix(): _by_line(reached, path) for path in reached.measured_files()}


def _by_line(reached: Any, path: str) -> dict[int, list[str]]:
    """Tests by line of a module; a line that runs at its import alone is reached by all tests of the module."""
    contexts = reached.contexts_by_lineno(path)
    named = {line: sorted({test.split("|")[0] for test in tests if test}) for line, tests in contexts.items()}
    every = sorted({test for tests in named.values() for test in tests})
    return {line: tests or every for line, tests in named.items()}


def lines_of_statement(code: str, line: int) -> range:
    """Lines of the innermost statement that holds a line; of one with a body its head alone."""
    held = []
    for node in ast.walk(ast.parse(code)):
        if isinstance(node, ast.stmt) and node.lineno <= line <= (node.end_lineno or 0):
            body = getattr(node, "body", None)
            last = body[0].lineno - 1 if body and body[0].lineno > line else node.end_lineno or line
            held.append(range(node.lineno, max(last, node.lineno) + 1))
    return min(held, key=len)


def notices(source: Path, tests: list[str]) -> bool:
    """Whether one of some tests fails with the library of a folder, or hangs."""
    if not tests:
        return False
    names = source.parent / "tests.txt"
    names.write_text("\n".join(tests))
    return not pytest(source, f"@{names}", seconds=PATIENCE)


def run(file: Path, count: int, seed: int, wanted: tuple[str, ...] = (), *, most: int | None = None) -> None:
    """Try the changes of a sample that a file of rows has not yet, and add a row for each."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    tried, reached = {row["number"] for row in rows}, dict[str, Any]()
    with tempfile.TemporaryDirectory() as folder, file.open("a") as out:
        source = Path(folder) / "src"
        shutil.copytree(LIBRARY, source / "chaosgym", ignore=shutil.ignore_patterns("__pycache__"))
        for change in sample(count, seed, wanted):
            if change.number in tried:
                continue
            if most is not None and len(tried) - len(rows) >= most:
                return
            if change.wing not in reached:
                reached[change.wing] = who_reaches(source, change.wing)
            target, original = source / "chaosgym" / change.path, LIBRARY / change.path
            outcome = "not tried: the tests of the wing do not pass"
            if (by_module := reached[change.wing]) is not None:
                by_line = by_module.get(change.path, {})
                lines = lines_of_statement(original.read_text(), change.line)
                tests = sorted({test for line in lines for test in by_line.get(line, ())})
                target.write_text(change.code)
                outcome = "noticed" if notices(source, tests) else "survives"
                shutil.copyfile(original, target)
            row = {name: value for name, value in change._asdict().items() if name != "code"}
            print(json.dumps(row | {"outcome": outcome}), file=out, flush=True)
            tried.add(change.number)


def interval(noticed: int, tried: int) -> tuple[float, float]:
    """Interval of Wilson, 95 %, of a share."""
    z = 1.959964
    middle = (noticed + z * z / 2.0) / (tried + z * z)
    half = z / (tried + z * z) * math.sqrt(noticed * (tried - noticed) / tried + z * z / 4.0)
    return middle - half, middle + half


def score(file: Path, equivalent: tuple[int, ...] = ()) -> dict[str, Any]:
    """Share of changes that were noticed, of those that were tried and mean something, and of each wing."""
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    rows = [row for row in rows if row["outcome"] in ("noticed", "survives") and row["number"] not in equivalent]
    if not rows:
        return {"tried": 0}
    tried, noticed = (
        Counter(row["wing"] for row in part) for part in (rows, (r for r in rows if r["outcome"] == "noticed"))
    )
    low, high = interval(noticed.total(), tried.total())
    return {
        "tried": tried.total(),
        "noticed": noticed.total(),
        "share": noticed.total() / tried.total(),
        "interval": [low, high],
        "wings": {wing: [noticed[wing], tried[wing]] for wing in sorted(tried)},
        "survivors": [
            {key: row[key] for key in ("number", "path", "line", "before", "after")}
            for row in rows
            if row["outcome"] == "survives"
        ],
    }
