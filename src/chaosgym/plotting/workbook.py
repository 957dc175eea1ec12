"""The tables of a design study as a workbook: one sheet each, with units in the headings."""

from collections.abc import Iterator, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from chaosgym.design.bearing import hours_of
from chaosgym.design.design_study import DesignStudy
from chaosgym.errors import DesignError
from chaosgym.files import write_atomically
from chaosgym.machines.parameters import parameters_of, quantity_of

Row = Sequence[Any]


def check_workbook(out: str | Path, overwrite: bool = False) -> Path:
    """Path of a workbook that may be written.

    Raises
    ------
    DesignError
        If its name does not end in .xlsx, it exists and ``overwrite`` is not set, or its folder does not.
    """
    path = Path(out)
    if path.suffix.lower() != ".xlsx":
        raise DesignError(f"{str(out)!r} is no name of a workbook; allowed: names that end in .xlsx")
    if path.exists() and not overwrite:
        raise DesignError(f"{path} exists; choose another name, or say --overwrite")
    if not path.parent.is_dir():
        raise DesignError(f"{path.parent} is no folder")
    _library()
    return path


def write_workbook(study: DesignStudy, out: str | Path, overwrite: bool = False) -> Path:
    """Write a design study's tables as a workbook; raises as ``check_workbook`` does."""
    path = check_workbook(out, overwrite)
    book = _library().Workbook(write_only=True)
    for name, rows in tables_of(study):
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    write_atomically(path, partial(_save, book))
    return path


def _library() -> Any:
    try:
        return import_module("openpyxl")
    except ModuleNotFoundError:
        raise DesignError("tables need openpyxl: pip install '.[recordings]' in a clone of chaosgym") from None


def _save(book: Any, path: Path) -> None:
    with path.open("wb") as file:
        book.save(file)


def tables_of(study: DesignStudy) -> Iterator[tuple[str, list[Row]]]:
    """Names and rows of the sheets; the first row is the heading, and a cell without a number is empty."""
    found, machine = study.assessment, study.assessment.machine
    force = found.evaluation
    yield (
        "result",
        [
            ("quantity", "value"),
            ("machine", machine.name),
            ("verdict", found.verdict),
            ("response type", found.type),
            ("reason", found.response.reason),
            ("equivalent force [N]", force.force),
            ("largest peak force [N]", force.largest_force),
            ("life [million cycles]", _number(force.life_interval.low)),
            ("life in operation [h]", _number(hours_of(force.life_interval.low, found.cycle_period))),
            ("reliability", _number(force.reliability_interval.low)),
        ],
    )
    fields = parameters_of(machine)
    yield "parameters", [("parameter", "value"), *((name, quantity_of(machine, name)) for name in fields)]
    checks = [(one.name, _number(one.reached), _number(one.required), one.unit, one.met) for one in found.checks]
    yield "criteria", [("criterion", "reached", "required", "unit", "met"), *checks]
    trials = () if study.improvement is None else study.improvement.suggestions
    heading = ("change", "type", "relative cost", "equivalent force [N]", "life, present = 1", "meets all")
    rows = [(t.told, t.assessment.type, t.cost, t.force, _number(t.relative_life), t.meets) for t in trials]
    yield "changes", [heading, *rows]
    peaks = [(k, run.nature, run.largest_peak) for k, run in enumerate(found.series.runs, 1)]
    yield "machines built", [("machine", "nature", "largest peak force [N]"), *peaks]
    if study.map is not None:
        shown = study.map
        yield (
            "types",
            [
                (*(f"{name} [{fields[name].unit}]" for name in (machine.speed_field, machine.clearance_field)), "type"),
                *(
                    (float(speed), float(gap), str(shown.type[i, j]))
                    for i, speed in enumerate(shown.speed)
                    for j, gap in enumerate(shown.clearance)
                ),
            ],
        )


def _number(value: float) -> float | None:
    """A number that a cell can hold."""
    return float(value) if abs(value) < float("inf") else None
