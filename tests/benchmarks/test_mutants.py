"""The sample of changes is the same each time, in proportion to the library, and tried with tests that can fail."""

import ast
import json
from itertools import islice

import pytest

pytest.importorskip("mutmut")

from benchmarks import mutants
from benchmarks.mutants import (
    LIBRARY,
    SHARED,
    Change,
    chosen_tests,
    interval,
    lines_of_statement,
    notices,
    sample,
    score,
    shares,
    who_reaches,
    wings,
)


def test_shares_are_whole_and_add_up():
    """Largest remainders, by hand: 600 over three sizes."""
    assert shares({"a": 1, "b": 1, "c": 1}, 10) == {"a": 4, "b": 3, "c": 3}
    assert shares({"a": 997, "b": 2, "c": 1}, 600) == {"a": 598, "b": 1, "c": 1}


def test_the_sample_covers_every_wing_but_kernels():
    """Each wing by its lines; no kernel, and no test."""
    modules = wings()
    assert {"series", "recordings", "machines", "cli", "top"} <= set(modules)
    paths = {path.relative_to(LIBRARY).as_posix() for paths in modules.values() for path in paths}
    assert "numbers.py" in paths
    assert not [path for path in paths if path.startswith(("core/", "envs/kernels/"))]
    assert all(set(chosen_tests(wing)) - set(SHARED) for wing in modules), "a wing without tests of its own"


def test_a_change_is_one_place_of_a_module_and_the_same_each_time():
    """It compiles, differs from what is there, and a seed draws it again."""
    first, again = (list(islice(sample(600, 0), 2)) for _ in range(2))
    assert first == again
    assert first[:1] != list(islice(sample(600, 1), 1))
    assert next(sample(600, 0, (first[0].wing,))) == first[0], "a wing is drawn by itself"
    for change in first:
        assert isinstance(change, Change)
        there = (LIBRARY / change.path).read_text()
        assert ast.dump(ast.parse(change.code)) != ast.dump(ast.parse(there))


def test_a_run_that_was_stopped_goes_on(tmp_path, monkeypatch):
    """Rows that are there are not tried again; a wing whose tests do not pass has no outcome; no test, no notice."""
    monkeypatch.setattr(mutants, "who_reaches", lambda source, wing: None if wing == "machines" else {})
    file = tmp_path / "rows.jsonl"
    mutants.run(file, 30, 0, most=3)
    mutants.run(file, 30, 0, most=4)
    rows = [json.loads(line) for line in file.read_text().splitlines()]
    assert [row["number"] for row in rows] == [*range(7)]
    assert {row["outcome"] for row in rows if row["wing"] == "machines"} <= {
        "not tried: the tests of the wing do not pass"
    }
    assert {row["outcome"] for row in rows if row["wing"] != "machines"} == {"survives"}


CODE = """def f(x):
    if x > 1:
        return g(
            x,
        )
    return x
"""


def test_a_change_is_tried_by_the_tests_that_reach_its_statement(tmp_path):
    """A statement of three lines is one; of one with a body, its head."""
    held = {line: [*lines_of_statement(CODE, line)] for line in range(1, 7)}
    assert held == {1: [1], 2: [2], 3: [3, 4, 5], 4: [3, 4, 5], 5: [3, 4, 5], 6: [6]}


def test_who_reaches_a_line_notices_its_change(tmp_path, monkeypatch):
    """Of two tests one calls the function; it alone is run, and fails when the function is changed."""
    module, test = tmp_path / "src" / "chaosgym" / "half.py", tmp_path / "test_half.py"
    module.parent.mkdir(parents=True)
    module.write_text("def half(x):\n    return x / 2\n")
    load = f"import runpy\nhalf = runpy.run_path({str(module)!r})['half']\n"
    test.write_text(load + "def test_two():\n    assert half(2) == 1\ndef test_none():\n    pass\n")
    monkeypatch.setattr(mutants, "ROOT", tmp_path)
    monkeypatch.setattr(mutants, "chosen_tests", lambda wing: [str(test)])
    source = tmp_path / "src"
    reached = who_reaches(source, "any")
    assert reached is not None
    assert reached["half.py"][2] == ["test_half.py::test_two"]
    assert not notices(source, reached["half.py"][2])
    module.write_text("def half(x):\n    return x * 2\n")
    assert notices(source, reached["half.py"][2])


def test_the_score_has_its_interval_and_its_denominator(tmp_path):
    """Wilson (1927), as tabled by Newcombe (1998): 81 of 263 is 0.2553 to 0.3662; what means nothing is left out."""
    low, high = interval(81, 263)
    assert (round(low, 4), round(high, 4)) == (0.2553, 0.3662)
    outcomes = ["noticed", "survives", "noticed", "survives", "not tried: ..."]
    keys = {"wing": "series", "path": "x", "line": 1, "before": "1", "after": "2"}
    file = tmp_path / "rows.jsonl"
    file.write_text("".join(json.dumps(keys | {"number": n, "outcome": o}) + "\n" for n, o in enumerate(outcomes)))
    found = score(file, equivalent=(3,))
    assert (found["tried"], found["noticed"], found["wings"]) == (3, 2, {"series": [2, 3]})
    assert [one["number"] for one in found["survivors"]] == [1]
