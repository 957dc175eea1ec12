"""Types of options, with units or in a range, and the options of a file of readings, the same for every command."""

import functools
from collections.abc import Callable, Iterable
from typing import Any

import click

from chaosgym.errors import ParameterError

BASE = {"mm": "m", "arcmin": "rad"}
"""Unit of the field behind an option, where it is another than the option's."""


class Quantity(click.ParamType):  # type: ignore[type-arg]
    """A number in the unit ``bare``, or with a unit that can be turned into it."""

    name = "quantity"

    def __init__(self, bare: str) -> None:
        self.bare = bare

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return the unit of a bare number."""
        return "NUMBER" if self.bare == "-" else f"NUMBER [{self.bare}]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number in the option's unit."""
        from chaosgym.units import parse_option, units_of

        if not isinstance(value, str):
            return float(value)
        base = BASE.get(self.bare, self.bare)
        try:
            found = parse_option(param.opts[0] if param else "value", value, base, "" if base == "-" else self.bare)
        except ParameterError as error:
            raise click.UsageError(str(error), ctx) from error
        return found / units_of(base).get(self.bare, 1.0)


class Cycle(click.ParamType):  # type: ignore[type-arg]
    """A cycle [s]: "30 Hz", "1800 rpm" or "33 ms"."""

    name = "cycle"

    def get_metavar(self, param: click.Parameter, ctx: click.Context) -> str:
        """Return its forms."""
        return "'30 Hz'|'1800 rpm'|'33 ms'"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the time of one."""
        from chaosgym.recordings.cycles import cycle_period

        if isinstance(value, float):
            return value
        try:
            return cycle_period(value)
        except ParameterError as error:
            raise click.UsageError(f"--{error}", ctx) from error


class Reading(Quantity):
    """A number in newton, with a unit of force, or with the unit of another quantity, which it then carries."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return newton, or an ``InUnit``."""
        from chaosgym.recordings.quantities import OTHERS
        from chaosgym.recordings.runs import InUnit

        number, _, unit = value.strip().rpartition(" ") if isinstance(value, str) else ("", "", "")
        if unit not in OTHERS:
            return super().convert(value, param, ctx)
        try:
            return InUnit(number, unit)
        except ValueError:
            raise click.UsageError(f"{param.opts[0] if param else 'value'} {value!r} is no number", ctx) from None


class FloatRange(click.FloatRange):
    """A number in a range; click takes nan into any."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        number = float(super().convert(value, param, ctx))
        if number != number:
            self.fail(f"{value!r} is no number.", param, ctx)
        return number


COLUMN = click.option("--column", metavar="NAME", help="Column of the readings: name, number, pattern, or several.")
UNIT = click.option("--unit", metavar="UNIT", help="Unit of the column, if the file does not name it; default N.")
SCALE = click.option("--scale", metavar="TEXT", help="Calibration of the column: '100 mV/N', '20 N/V', '50 N/FS'.")
SHEET = click.option("--sheet", metavar="NAME", help="Sheet of a workbook; default: the first with the column.")
KIND = click.option(
    "--as",
    "kind",
    type=click.Choice(["peaks", "series"]),
    help="One reading a cycle, or a series over time; default: what the file and these options say.",
)
RATE = click.option("--rate-hz", type=Quantity("Hz"), help="Sampling rate of a series, if its file does not state it.")
CYCLE = click.option("--cycle", "period", type=Cycle(), help="Cycle of a series; without it, the spectrum's line.")
TACHOMETER = click.option("--tachometer", metavar="NAME", help="Column with a tachometer's pulses; a turn is a cycle.")
PULSES = click.option(
    "--pulses-per-revolution",
    type=click.IntRange(1, 100_000),
    metavar="N",
    help="Pulses of the tachometer in a turn; default 1.",
)


def _sensor_error(of: Quantity) -> Callable[..., Any]:
    return click.option(
        "--sensor-error", type=of, help="Largest error of a reading (half width). Smaller differences are none."
    )


def _sensor_sigma(of: Quantity) -> Callable[..., Any]:
    text = "Standard deviation of a reading instead. Without either it is estimated from the record."
    return click.option("--sensor-sigma", type=of, help=text)


SENSOR_ERROR, SENSOR_SIGMA = _sensor_error(Reading("N")), _sensor_sigma(Reading("N"))
FORCE_ERROR, FORCE_SIGMA = _sensor_error(Quantity("N")), _sensor_sigma(Quantity("N"))

ALL = (COLUMN, UNIT, SCALE, SHEET, KIND, RATE, CYCLE, TACHOMETER, PULSES, SENSOR_ERROR, SENSOR_SIGMA)
OF_SWEEP = (COLUMN, UNIT, SCALE, SHEET, SENSOR_ERROR, SENSOR_SIGMA)
OF_RUN_UP = (COLUMN, UNIT, SCALE, SHEET, RATE, TACHOMETER, PULSES, SENSOR_ERROR, SENSOR_SIGMA)

FILE = click.argument("file", metavar="FILE")

NAMES = (
    *("column", "unit", "scale", "sheet", "kind", "rate_hz", "period"),
    *("tachometer", "pulses_per_revolution", "sensor_error", "sensor_sigma"),
)
"""Fields of ``RecordingOptions`` that options set."""


def recording_options(
    group: Iterable[Callable[..., Any]] = ALL,
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add a group of options; the function receives them as ``options``, a ``RecordingOptions``."""

    def add(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function)
        def wrapped(**keywords: Any) -> None:
            from chaosgym.recordings.runs import RecordingOptions

            stated = {name: keywords.pop(name) for name in NAMES if name in keywords}
            function(options=RecordingOptions(**stated), **keywords)

        for option in reversed([*group]):
            wrapped = option(wrapped)
        return wrapped

    return add
