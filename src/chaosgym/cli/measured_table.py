"""A table of many recordings: the channels of one file, or the files of a folder or a pattern, a line each."""

from glob import glob, has_magic
from pathlib import Path
from typing import Any, NamedTuple

import click

from chaosgym.cli.measured_options import Measured, Run, measured_runs, run_as_dict

COLUMNS = ("file", "channel", "verdict", "scatter", "cycles")


class Judged(NamedTuple):
    """The channels of one file with what they show together, or why it was not judged."""

    source: str
    runs: tuple[Run, ...] = ()
    together: Any = None
    error: str = ""


def sources_of(given: Measured) -> list[str]:
    """Files of a folder, or those that a pattern fits; none where one file is named."""
    name = given.peaks or given.series or "-"
    if Path(name).is_dir():
        found = [str(path) for path in sorted(Path(name).iterdir()) if path.is_file() and path.name[0] != "."]
    elif has_magic(name) and not Path(name).exists():
        found = sorted(path for path in glob(name, recursive=True) if Path(path).is_file())
    else:
        return []
    if not found:
        raise click.UsageError(f"{name} holds no file")
    return found


def judged_files(given: Measured, sources: list[str]) -> list[Judged]:
    """Every file with its verdicts; a file that can't be judged says why.

    Raises
    ------
    DiagnosisError
        If no file can be judged: what is said of the first.
    """
    from tqdm import tqdm

    from chaosgym.errors import ChaosgymError, DiagnosisError

    found = []
    kind = "peaks" if given.peaks else "series"
    for source in tqdm(sources, desc="recordings", delay=2.0, disable=None):
        try:
            runs = measured_runs(given._replace(**{kind: source}), several=True)
        except (ChaosgymError, OSError) as error:
            found.append(Judged(source, error=str(error)))
            continue
        found.append(judged(source, runs))
    if not all_runs(found):
        raise DiagnosisError(found[0].error)
    return found


def judged(source: str, runs: list[Run]) -> Judged:
    """The channels of a file, with what they show together."""
    return Judged(source, tuple(runs), _together(runs))


def all_runs(found: list[Judged]) -> list[Run]:
    """Every channel of every file."""
    return [run for one in found for run in one.runs]


def _together(runs: list[Run]) -> Any:
    """The verdict on all channels of a file of peaks, which are the sensors of one machine; else None."""
    import numpy as np

    from chaosgym.recordings.sensors import judge_together

    if len(runs) < 2 or not all(run.aligned for run in runs) or len({len(run.peaks) for run in runs}) > 1:
        return None
    return judge_together(
        [run.verdict for run in runs], np.column_stack([run.peaks for run in runs]), [run.name for run in runs]
    )


def table_as_dict(found: list[Judged]) -> dict[str, Any]:
    """Values of the table for JSON."""
    return {
        "recordings": [run_as_dict(run) for run in all_runs(found)],
        "together": [{"file": one.source, **one.together.as_dict()} for one in found if one.together is not None],
        "not_judged": [{"file": one.source, "reason": one.error} for one in found if one.error],
        "warnings": [one.error for one in found if one.error],
    }


def table_lines(found: list[Judged]) -> list[str]:
    """The table for people, then the reasons of what sensors say together."""
    rows: list[tuple[str, ...]] = [COLUMNS]
    reasons = []
    for one in found:
        name = Path(one.source).name
        rows += [_row(name, run.name, run.verdict, len(run.peaks)) for run in one.runs]
        if one.together is not None:
            rows.append(_row(name, "together", one.together, len(one.runs[0].peaks)))
            reasons.append(f"{name}: {one.together.diagnosis.reason}")
        if one.error:
            rows.append((name, "", "not judged", "", ""))
            reasons.append(one.error)
    widths = [max(len(row[place]) for row in rows) for place in range(len(COLUMNS))]
    lines = ["  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip() for row in rows]
    return [*lines, *(f"  {reason}" for reason in reasons)]


def _row(name: str, channel: str, verdict: Any, cycles: int) -> tuple[str, ...]:
    share = verdict.coefficient_of_variation
    scatter = "" if share is None else f"{100.0 * share:.2g} %"
    return name, channel, verdict.diagnosis.words, scatter, str(cycles)
