"""Do the tests notice a mistake, anywhere but in kernels? A sample of changes, each tried with the tests of its wing.

Changes are mutmut's: of operators, constants, arguments and texts in functions. A wing is a folder of the library; its
share of the sample is that of its lines, and a module is drawn by its lines. Rows are written as they are made, so a
run that was stopped goes on. A wing whose tests do not pass unchanged is left out, and named.
"""

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

SHARED = ("tests/test_thresholds.py", "tests/test_arguments.py")
"""Tests that belong to several wings."""

ALONE = ("tests/test_files.py", "tests/machines/test_numbers.py", "tests/test_fuzz.py")
"""Tests of the modules that are in no folder."""

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


def sample(count: int, seed: int) -> Iterator[Change]:
    """Changes of the library, ``count`` of them, in an order that is drawn as well: the first are a sample too."""
    modules = wings()
    lines = {wing: [len(path.read_text().splitlines()) for path in paths] for wing, paths in modules.items()}
    places = [
        wing for wing, share in shares({w: sum(n) for w, n in lines.items()}, count).items() for _ in range(share)
    ]
    draw = random.Random(seed)
    draw.shuffle(places)
    for number, wing in enumerate(places):
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


def chosen_tests(wing: str, path: str) -> list[str]:
    """Test files of a wing, the module's own first."""
    folder = ROOT / "tests" / wing
    files = (
        [*ALONE] if wing == "top" else [one.relative_to(ROOT).as_posix() for one in sorted(folder.rglob("test_*.py"))]
    )
    own = f"test_{Path(path).stem}.py"
    return sorted([*files, *SHARED], key=lambda name: not name.endswith(own))


def passes(source: Path, tests: list[str]) -> bool:
    """Whether tests pass with the library of a folder."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", *tests]
    where = os.environ | {"PYTHONPATH": str(source), "PYTHONDONTWRITEBYTECODE": "1"}
    try:
        done = subprocess.run(command, cwd=ROOT, env=where, capture_output=True, timeout=PATIENCE, check=False)
    except subprocess.TimeoutExpired:
        return False
    return done.returncode == 0


def run(file: Path, count: int, seed: int, wanted: tuple[str, ...] = (), *, most: int | None = None) -> None:
    """Try the changes of a sample that a file of rows has not yet, and add a row for each."""
    rows = [json.loads(line) for line in file.read_text().splitlines()] if file.exists() else []
    tried, sound = {row["number"] for row in rows}, dict[str, bool]()
    with tempfile.TemporaryDirectory() as folder, file.open("a") as out:
        source = Path(folder) / "src"
        shutil.copytree(LIBRARY, source / "chaosgym", ignore=shutil.ignore_patterns("__pycache__"))
        for change in sample(count, seed):
            if change.number in tried or (wanted and change.wing not in wanted):
                continue
            if most is not None and len(tried) - len(rows) >= most:
                return
            tests = chosen_tests(change.wing, change.path)
            if change.wing not in sound:
                sound[change.wing] = passes(source, tests)
            target = source / "chaosgym" / change.path
            outcome = "not tried: the tests of the wing do not pass"
            if sound[change.wing]:
                target.write_text(change.code)
                outcome = "survives" if passes(source, tests) else "noticed"
                shutil.copyfile(LIBRARY / change.path, target)
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
