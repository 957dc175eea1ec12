"""The command ``monitor``: peaks from standard input, one a line, with an alarm."""

import sys
from typing import TYPE_CHECKING, Any

import click

from chaosgym.cli.options import OF_STREAM, Quantity, recording_options
from chaosgym.cli.output import AS_JSON, emit

if TYPE_CHECKING:
    from chaosgym.recordings.kind import RecordingOptions

GIVE_UP = 100
"""Lines without a reading after which the stream is taken for the wrong one."""


@click.command()
@recording_options(("column", "sensor-error"), OF_STREAM)
@click.option("--delimiter", metavar="TEXT", help="Between the columns; default: found from each line.")
@click.option("--log", type=click.Path(dir_okay=False), help="CSV file to which events are appended.")
@click.option("--timeout-s", type=Quantity("s"), help="Time without a line after which it says: stalled.")
@AS_JSON
def monitor(
    options: "RecordingOptions",
    delimiter: str | None,
    log: str | None,
    timeout_s: float | None,
    as_json: bool,
) -> None:
    """Watch peaks from standard input, one a line: a verdict each cycle, changes, alarms and all-clears.

    What is no reading is counted, warned of and survived.
    """
    from chaosgym.recordings.kind import in_readings
    from chaosgym.recordings.monitor import LONGEST, EventLog, Monitor
    from chaosgym.recordings.stream import LineReader, stalls
    from chaosgym.series.noise import stated_error

    if timeout_s is not None and not 0.0 < timeout_s < 1e6:
        raise click.UsageError(f"--timeout-s {timeout_s:g} is out of range; allowed: above 0")
    if sys.stdin is None:
        raise click.UsageError("standard input is closed; allowed: a program that writes a peak a line")
    error = stated_error(in_readings(options.sensor_error, "N"), in_readings(options.sensor_sigma, "N"))
    watch = Monitor(None if error is None else error.half_width, longest_period=LONGEST)
    reader = LineReader(options.column, delimiter, options.unit, options.scale)
    with EventLog(log) as events:
        for number, line in stalls(sys.stdin, timeout_s):
            if line is None:
                stalled = {"event": "stalled", "cycle": watch.cycle}
                emit(stalled, as_json, lambda: ["no reading comes  <- stalled"])
            elif (seen := _update(watch, reader, line, number)) is not None:
                events.note(seen)
                emit(seen.as_dict(), as_json, lambda: [str(seen)])
    if watch.cycle == 0:
        raise click.UsageError("standard input holds no peak; allowed: one a line")


def _update(watch: Any, reader: Any, line: str, number: int) -> Any:
    """What the monitor sees in a line; None for a heading."""
    from chaosgym.errors import DiagnosisError

    try:
        peak = reader.read(line, number, first=watch.cycle == 0)
        if peak is None and (number < GIVE_UP or watch.cycle):
            return None
        if peak is None:
            raise DiagnosisError(f"the first {number} lines hold no reading; state --column and --delimiter")
        return watch.update(peak)
    except DiagnosisError as error:
        if watch.cycle == 0:
            raise
        click.echo(f"warning: {error}; left out, {watch.missing + 1} so far", err=True)
        return watch.skip()
