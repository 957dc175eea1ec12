"""The command ``house``: how large the library is, and what hangs together in it."""

from pathlib import Path
from typing import Any

import click

from benchmarks.cli.stored import tell
from chaosgym.cli.output import AS_JSON

CIRCLES = {
    "at_load": "as modules load",
    "with_types": "imports for types too",
    "with_functions": "imports within functions too",
}


@click.command()
@click.option("--repeats", type=click.IntRange(1, 100), default=5, show_default=True, help="Timed runs of judging.")
@click.option(
    "--beside",
    type=click.Path(exists=True, dir_okay=False, path_type=Path),
    help="What this command printed with --json at another commit: those figures beside these.",
)
@AS_JSON
def house(repeats: int, beside: Path | None, as_json: bool) -> None:
    """Lines of code, options, circles of imports, and what three questions pass: the size of the library."""
    from benchmarks.house import house as measure

    result = measure(repeats)
    tell(result, as_json, lambda: _lines(result), beside)


def _lines(result: dict[str, Any]) -> list[str]:
    return [
        *_wing_lines(result),
        "",
        *_option_lines(result["options"]),
        "",
        "members of a machine: {must_give} that it must give, {may_give} that it may".format(**result["protocol"]),
        *_circle_lines(result["circles"]),
        *_class_lines(result["classes_named_twice"]),
        "",
        *_journey_lines(result),
    ]


def _wing_lines(result: dict[str, Any]) -> list[str]:
    within, long = result["imports_within_functions"], result["functions_of_many_arguments"]["by_wing"]
    head = f"{'wing':14s}{'modules':>9s}{'code':>8s}{'imports within functions':>27s}{'functions of 9 arguments':>27s}"
    return [head] + [
        f"{wing:14s}{row['modules']:9d}{row['code']:8d}{within.get(wing, 0):27d}{long.get(wing, 0):27d}"
        for wing, row in result["wings"].items()
    ]


def _option_lines(options: dict[str, dict[str, int]]) -> list[str]:
    head = f"{'options of':18s}{'its own':>9s}{'of machines, none named':>26s}{'of a named one':>17s}"
    return [head] + [
        f"{name:18s}{row['own']:9d}{row['of_machines']:26d}{row['of_a_named_machine']:17d}"
        for name, row in options.items()
    ]


def _circle_lines(circles: dict[str, Any]) -> list[str]:
    lines = []
    for name, words in CIRCLES.items():
        lines.append(f"circles, {words}: {circles[name]['count']}")
        lines += [f"  {', '.join(group)}" for group in circles[name]["modules"]]
    return lines


def _class_lines(classes: dict[str, Any]) -> list[str]:
    return [f"class {name}: {', '.join(modules)}" for name, modules in classes["modules"].items()]


def _journey_lines(result: dict[str, Any]) -> list[str]:
    judging, journeys = result["judging"], result["journeys"]
    lines = [
        f"{judging['command']}: {judging['modules_loaded']} modules, {judging['modules_of_machines']} of machines; "
        f"{'with' if judging['numba'] else 'without'} numba; {judging['processor_seconds']:.2f} s of processor time"
    ]
    lines += [
        f"{one.get('command') or one['environment']}: {one['calls']} calls of {one['functions']} functions in "
        f"{one['modules']} modules; {one['modules_loaded']} are loaded"
        for one in journeys.values()
    ]
    passed = journeys["clearance"]
    return [*lines, f"  the clearance is in {passed['units']} on its way to the first kernel, {passed['stack']} deep"]
