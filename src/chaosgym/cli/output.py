"""Output of a command: a table for people or one JSON object, a picture, a table in a file, and progress meanwhile."""

import json
import os
import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.options import IntRange

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import ArrayLike

AS_JSON = click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")

WORKERS = click.option("--workers", type=IntRange(1, 4096), default=None, help="Threads; default: all processors.")

NOBODY_READS = 141
"""Exit code where the reader of standard output has gone, as of any program that a broken pipe ends."""

PATIENCE_SECONDS = 2.0
"""Time after which a computation says that it goes on."""

TIMED_CYCLES = (4, 64)
"""Cycles by which the time of many is estimated: the second number where the first does not rule out a wait."""

DIAGNOSED = 2.0
"""Most processor time of a cycle that is diagnosed, over that of one that is simulated (measured)."""

NOTES = "chaosgym.notes"
"""Where a command keeps the notes on its machines."""

MODEL = "chaosgym.model"
"""Where it keeps the accuracy of its machine's model."""


def note_machine(machine: Any) -> None:
    """Let the command's answer end with what a user should know of a machine."""
    kept = click.get_current_context().meta.setdefault(NOTES, [])
    kept += [note for note in machine.notes if note not in kept]


def note_model(accuracy: Any) -> None:
    """Let the command's answer name a machine's model and its estimated error, and what is to be said of these."""
    meta = click.get_current_context().meta
    meta[MODEL] = accuracy
    meta.setdefault(NOTES, []).extend([accuracy.warning] if accuracy.warning else [])


def emit(
    result: Mapping[str, Any],
    as_json: bool,
    lines: Callable[[], list[str]],
    picture: Path | None = None,
    figure: "Callable[[Any], Figure] | None" = None,
) -> None:
    """Print the result as JSON, or the lines for people; end quietly if nobody reads them.

    Both end with the picture, if one was asked for, and with the notes on the machines of the command. ``figure`` is
    given the module ``plotting.commands`` and makes the picture.
    """
    if picture is not None and figure is not None:
        _save(figure, picture)
        _print({**result, "plot": str(picture)}, as_json, lambda: [*lines(), f"picture: {picture}"])
    else:
        _print(result, as_json, lines)


def _save(figure: "Callable[[Any], Figure]", path: Path) -> None:
    from chaosgym.plotting import commands
    from chaosgym.plotting.style import save_picture

    save_picture(figure(commands), path)


def _print(result: Mapping[str, Any], as_json: bool, lines: Callable[[], list[str]]) -> None:
    context = click.get_current_context(silent=True)
    notes = context.meta.get(NOTES, ()) if context else ()
    model = context.meta.get(MODEL) if context else None
    try:
        shown = {**result, **({"model": model.as_dict()} if model else {}), **({"notes": list(notes)} if notes else {})}
        told = [*([model.line] if model else []), *(f"note: {note}" for note in notes)]
        for line in [json.dumps(shown, allow_nan=False, default=_numbers)] if as_json else [*lines(), *told]:
            click.echo(line, nl=False)  # Python overlooks that a single large write was cut off; the next one is not
            click.echo()
        if sys.stdout is not None:  # None where it was closed before the start
            sys.stdout.flush()
    except BrokenPipeError:
        # what is left in the buffer goes nowhere at the end of the process
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(NOBODY_READS)


def _numbers(array: Any) -> Any:
    """What JSON can hold of an array; only made where it is printed, since a list takes four times the memory."""
    return array.tolist()


def verdict_lines(subject: str, verdict: Any, forces: Iterable[str], notes: Iterable[str] = ()) -> list[str]:
    """The statement of a ``Diagnosis``, some notes, and how the peak forces lie."""
    headline, *others = verdict.statement.lines()
    return [f"{subject}: {headline}", *(f"  {line}" for line in (*others, *notes, *forces))]


def force_line(summary: Mapping[str, float]) -> str:
    """How peak forces [N] lie."""
    return (
        f"{summary['min']:.2f} to {summary['max']:.2f} N, mean {summary['mean']:.2f} N, "
        f"standard deviation {summary['std']:.2f} N"
    )


def reading_line(summary: Mapping[str, float], unit: str) -> str:
    """How readings in any unit lie; what is a rounding of the largest is none."""
    least = 1e-12 * max(abs(summary["min"]), abs(summary["max"]))
    shown = {name: summary[name] if abs(summary[name]) > least else 0.0 for name in ("min", "max", "mean", "std")}
    told = {name: f"{value:.4g} {unit}" for name, value in shown.items()}
    return f"{told['min']} to {told['max']}, mean {told['mean']}, standard deviation {told['std']}"


def announce(what: str, machine: Any, cycles: float, *, besides: float = 0.0) -> None:
    """Say on standard error how much processor time some cycles of a machine take, if that is worth a word.

    ``besides`` are seconds of what is no cycle of this machine.
    """
    seconds = besides + seconds_of(machine, cycles)
    if seconds > PATIENCE_SECONDS:
        from chaosgym.units import duration  # few commands take so long

        click.echo(f"{what}: up to about {duration(seconds, 2)} of processor time", err=True)


def seconds_of(machine: Any, cycles: float) -> float:
    """Processor time [s] that some cycles of a machine take, by a few of them; 0 if it can't be run."""
    from chaosgym.errors import SimulationError
    from chaosgym.simulation import simulate

    seconds = 0.0
    for timed in TIMED_CYCLES:
        try:
            simulate(machine, 1)
            began = time.process_time()
            simulate(machine, timed)
        except SimulationError:
            return 0.0
        seconds = cycles * (time.process_time() - began) / timed
        if seconds < 0.5 * PATIENCE_SECONDS:
            break
    return seconds


@contextmanager
def patience(what: str) -> Iterator[None]:
    """Say on standard error, after two seconds and then every ten, that ``what`` goes on; on a terminal in one line."""
    done = threading.Event()

    def tell() -> None:
        began, pause, shown = time.monotonic(), PATIENCE_SECONDS, sys.stderr.isatty()
        while not done.wait(pause):
            pause = 1.0 if shown else 10.0
            text = f"{what}: {time.monotonic() - began:.0f} s"
            click.echo(f"\r{text}" if shown else text, err=True, nl=not shown)
        if shown and pause != PATIENCE_SECONDS:
            click.echo("\r" + " " * (len(what) + 10) + "\r", err=True, nl=False)

    teller = threading.Thread(target=tell, daemon=True)
    teller.start()
    try:
        yield
    finally:
        done.set()
        teller.join()


UNNAMED = "-"
"""Stands for a file that the user did not name."""


def plot_option(
    *names: str, formats: str = ".png, .svg or .pdf"
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """``--plot``; the function receives ``plot``: what was written, ``UNNAMED``, or None."""
    return click.option(
        "--plot",
        *names,
        "plot",
        is_flag=False,
        flag_value=UNNAMED,
        metavar="[FILE]",
        help=f"Draw a picture ({formats}); without FILE into a new file of the current folder.",
    )


def picture_path(plot: str | None, stem: str, formats: tuple[str, ...] | None = None) -> Path | None:
    """Path of the picture, checked before anything is computed; None without ``--plot``.

    A file that the user named is replaced, one that the user did not name never is.
    """
    if plot is None:
        return None
    from chaosgym.plotting.style import FORMATS, check_picture, free_name

    return free_name(stem) if plot == UNNAMED else check_picture(Path(plot), formats or FORMATS)


def check_target(path: str | Path, overwrite: bool, endings: tuple[str, ...] = (".csv", ".parquet")) -> None:
    """Check that a file, by default a table, may be written before it is computed.

    Raises
    ------
    DatasetError
        If the name ends in none of the ``endings``, the folder is missing, or the file exists.
    """
    from chaosgym.errors import DatasetError
    from chaosgym.files import check_place

    target = Path(path)
    if target.suffix not in endings:
        raise DatasetError(f"{path} ends in {target.suffix or 'nothing'}; allowed: {', '.join(endings)}")
    if not target.absolute().parent.is_dir():
        raise DatasetError(f"{target.absolute().parent} is no folder; choose another file")
    if os.path.lexists(target) and not overwrite:
        raise DatasetError(f"{path} exists; use --overwrite or another name")
    check_place(target)


def write_table(columns: "Mapping[str, ArrayLike]", path: str | Path) -> None:
    """Write columns by name as CSV or Parquet."""
    import numpy as np
    import pyarrow as pa
    import pyarrow.csv
    import pyarrow.parquet as pq

    from chaosgym.files import write_atomically

    # a column of a larger array would become an object for each number, 36 times the memory
    table = pa.table(
        {
            name: np.ascontiguousarray(values) if isinstance(values, np.ndarray) else pa.array(values)
            for name, values in columns.items()
        }
    )
    if Path(path).suffix == ".csv":
        options = pyarrow.csv.WriteOptions(quoting_style="none")
        write_atomically(Path(path), lambda target: pyarrow.csv.write_csv(table, target, write_options=options))
    else:
        write_atomically(Path(path), lambda target: pq.write_table(table, target))
