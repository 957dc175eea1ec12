"""Figures beside those that were stored at another commit."""

import json
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from chaosgym.cli.output import emit

NAMED = ("name", "machine", "grows", "of", "environment")
"""Keys whose text tells one row of a list from the others; its place does where there is none."""


def tell(found: dict[str, Any], as_json: bool, lines: Callable[[], list[str]], beside: Path | None) -> None:
    """Print figures with the commit that they belong to, beside those of a JSON file if one is given."""
    found = {"commit": commit(), **found}
    if beside is None:
        return emit(found, as_json, lines)
    then = _read(beside)
    now, before = (dict(figures(one)) for one in (json.loads(json.dumps(found)), then))
    shared = [name for name in now if name in before]
    if not shared:
        raise click.UsageError(f"{beside} has none of these figures; allowed: what the same options print with --json")
    rows = {name: {"now": now[name], "then": before[name]} for name in shared}
    commits = {"now": found["commit"], "then": then.get("commit")}
    emit({"commits": commits, "figures": rows}, as_json, lambda: _table(commits, rows))


def commit() -> str | None:
    """Short hash of the commit, with a + if files differ from it; None outside Git."""
    try:
        asked = ["git", "-C", str(Path(__file__).parent), "describe", "--always", "--dirty=+", "--exclude=*"]
        return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return None


def figures(found: Any, name: str = "") -> Iterator[tuple[str, float]]:
    """Every number in a JSON object, with the keys that lead to it; a pair of number and text is named by its text."""
    if isinstance(found, dict):
        for key, value in found.items():
            yield from figures(value, f"{name}, {key}" if name else key)
    elif isinstance(found, list):
        for place, value in enumerate(found):
            if isinstance(value, list) and len(value) == 2 and isinstance(value[1], str):
                yield from figures(value[0], f"{name}, {value[1]}")
            else:
                keys = value if isinstance(value, dict) else {}
                told = " ".join(str(keys[key]) for key in NAMED if isinstance(keys.get(key), str))
                yield from figures(value, f"{name}, {told or place}")
    elif isinstance(found, int | float) and not isinstance(found, bool):
        yield name, float(found)


def _read(path: Path) -> dict[str, Any]:
    try:
        then = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise click.UsageError(f"{path} can't be read: {error}") from None
    if not isinstance(then, dict):
        raise click.UsageError(f"{path} is no JSON object; allowed: what this command prints with --json")
    return then


def _table(commits: dict[str, Any], rows: dict[str, dict[str, float]]) -> list[str]:
    width = max(len(name) for name in rows)
    lines = [f"{'':{width}s}{commits['now'] or 'now':>14s}{commits['then'] or 'then':>14s}{'ratio':>8s}"]
    for name, row in rows.items():
        ratio = f"{row['now'] / row['then']:8.2f}" if row["then"] else f"{'':8s}"
        lines.append(f"{name:{width}s}{row['now']:14.6g}{row['then']:14.6g}{ratio}")
    return lines
