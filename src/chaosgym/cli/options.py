"""Types of options, with units or in a range, and the options of a file of readings, the same for every command."""

import functools
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NamedTuple

import click

from chaosgym.errors import ParameterError, nearest_or

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


class CycleLength(click.ParamType):  # type: ignore[type-arg]
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
    """A number in the unit of the readings, or with a unit, which it then carries."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return a bare number as it is, or an ``InUnit``."""
        from chaosgym.recordings.kind import InUnit
        from chaosgym.recordings.quantities import FORCES, OTHERS, as_unit
        from chaosgym.units import as_float

        found = re.fullmatch(r"\s*([-+]?[\d.]++(?:[eE][-+]?\d++)?+)\s*([^\s,_].*?)\s*", str(value))
        unit = (as_unit(found[2]) or found[2]) if found else ""
        if found is None:
            return super().convert(value, param, ctx)
        name, allowed = param.opts[0] if param else "value", [*FORCES, *sorted(OTHERS)]
        if unit not in allowed:
            hint = nearest_or(f"allowed: {', '.join(allowed)}", found[2], allowed)
            raise click.UsageError(f"{name} = {value!r} is in {found[2]}, no unit that is known; {hint}", ctx)
        try:
            size = as_float(found[1])
        except ValueError:
            raise click.UsageError(f"{name} {value!r} is no number", ctx) from None
        return InUnit(size * FORCES[unit], "N") if unit in FORCES else InUnit(size, unit)


LARGEST = 1e12
"""Whole number from which on its digits are no help."""


class FloatRange(click.FloatRange):
    """A number in a range; click takes nan into any, and ``0_1`` for 1."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float:
        """Return the number."""
        try:
            number = float(super().convert(value, param, ctx))
        except click.BadParameter as error:
            self.fail(error.message.replace("is not a valid float range", "is no number"), param, ctx)
        if number != number or "_" in str(value):
            self.fail(f"{value!r} is no number.", param, ctx)
        return number


class IntRange(click.IntRange):
    """A whole number in a range; what is written as ``1e3`` or ``1.0`` is said as it should be."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> int:
        """Return the number."""
        if isinstance(value, str) and not re.fullmatch(r"\s*[-+]?\d+\s*", value, re.ASCII):
            try:
                meant = float(value)
            except ValueError:
                meant = 0.5
            cure = f"write {meant:.0f}" if meant.is_integer() and abs(meant) < LARGEST else f"write {self._example()}"
            self.fail(f"{value!r} is no whole number; {cure}.", param, ctx)
        return int(super().convert(value, param, ctx))

    def _example(self) -> str:
        return "digits alone" if self.max is None else f"digits alone, up to {self.max}"


FILE = click.argument("file", metavar="FILE")


class Fact(NamedTuple):
    """What an option of KEY=VALUE may state: the field that it sets, type, an example, and its meaning for people."""

    field: str
    type: click.ParamType  # type: ignore[type-arg]
    example: str
    help: str


ERROR = "Largest error of a reading (half width). Smaller differences are none."
SIGMA = "Standard deviation of a reading instead. Without either it is estimated from the record."
RATE = "Sampling rate of a series, if its file does not state it."

FORCE_ERROR = click.option("--sensor-error", type=Quantity("N"), help=ERROR)
"""Error of the readings of a machine's sensors, which are of forces."""

KEYS = {
    "column": Fact("column", click.STRING, "NAME", "Column of the readings: name, number, pattern, or several."),
    "unit": Fact("unit", click.STRING, "kN", "Unit of the column, if the file does not name it; default N."),
    "scale": Fact("scale", click.STRING, "'100 mV/N'", "Calibration of the column: '100 mV/N', '20 N/V', '50 N/FS'."),
    "sheet": Fact("sheet", click.STRING, "NAME", "Sheet of a workbook; default: the first with the column."),
    "as": Fact(
        "kind", click.Choice(["peaks", "series"]), "series", "One reading a cycle, or a series; default: by the file."
    ),
    "rate-hz": Fact("rate_hz", Quantity("Hz"), "1000", RATE),
    "cycle": Fact("period", CycleLength(), "'30 Hz'", "Cycle of a series; without it, estimated from the series."),
    "tachometer": Fact("tachometer", click.STRING, "NAME", "Column with a tachometer's pulses; a turn is a cycle."),
    "pulses-per-revolution": Fact(
        "pulses_per_revolution", IntRange(1, 100_000), "60", "Pulses of the tachometer in a turn; default 1."
    ),
    "sensor-error": Fact("sensor_error", Reading("N"), "'1 N'", ERROR),
    "sensor-sigma": Fact("sensor_sigma", Reading("N"), "'0.3 N'", SIGMA),
}
"""What may be stated of a file of readings, by the name of its option; ``--read KEY=VALUE`` takes each."""

DAILY = ("column", "as", "rate-hz", "cycle", "sensor-error")
"""Keys that are options too, where a command reads a recording."""

OF_SWEEP = ("column", "unit", "scale", "sheet", "sensor-error", "sensor-sigma")
OF_RUN_UP = (*OF_SWEEP, "rate-hz", "tachometer", "pulses-per-revolution")
OF_STREAM = ("column", "unit", "scale", "sensor-error", "sensor-sigma")
"""Keys of a measured sweep, of a run-up and of a stream, which has forces alone."""


def recording_options(
    shown: Iterable[str] = DAILY, keys: Iterable[str] = tuple(KEYS)
) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Add options of a file of readings; the function receives them as ``options``, a ``RecordingOptions``.

    Parameters
    ----------
    shown
        Keys that are options of their own.
    keys
        Those that ``--read`` takes.
    """
    allowed = {key: KEYS[key] for key in keys}

    def add(function: Callable[..., None]) -> Callable[..., None]:
        @functools.wraps(function)
        def wrapped(*, read: tuple[str, ...], **keywords: Any) -> None:
            from chaosgym.recordings.kind import RecordingOptions

            fields = {one.field for one in allowed.values()}
            given = {name: keywords.pop(name) for name in fields if name in keywords}
            function(options=RecordingOptions(**stated("--read", read, allowed, given)), **keywords)

        wrapped = _read_option([key for key in allowed if key not in shown])(wrapped)
        for key in reversed([*shown]):
            wrapped = _own_option(key)(wrapped)
        return wrapped

    return add


def _own_option(key: str) -> Callable[..., Any]:
    """A key as an option of its own."""
    one = KEYS[key]
    metavar = "NAME" if key in ("column", "tachometer") else "N" if key == "pulses-per-revolution" else None
    return click.option(f"--{key}", one.field, type=one.type, metavar=metavar, help=one.help)


def _read_option(keys: Iterable[str]) -> Callable[..., Any]:
    """``--read``, with the keys that have no option of their own."""
    text = f"What else is known of the file, repeatable: {', '.join(f'{key}={KEYS[key].example}' for key in keys)}."
    return click.option("--read", multiple=True, metavar="KEY=VALUE", help=text)


def stated(name: str, texts: Iterable[str], allowed: Mapping[str, Fact], given: Mapping[str, Any]) -> dict[str, Any]:
    """Values by their fields, of a repeatable option of KEY=VALUE such as ``--read``, beside those already given."""
    found = dict(given)
    for text in texts:
        key, value = _stated(name, text, allowed)
        if found.get(allowed[key].field) is not None:
            raise click.UsageError(f"{key} is stated twice; allowed: once")
        found[allowed[key].field] = value
    return found


def _stated(name: str, text: str, allowed: Mapping[str, Fact]) -> tuple[str, Any]:
    """Key and value of one KEY=VALUE."""
    key, equals, written = text.partition("=")
    key = key.strip().removeprefix("--").replace("_", "-")
    if not equals:
        raise click.UsageError(f"{name} {text!r} is no KEY=VALUE; allowed: {', '.join(allowed)}")
    if key not in allowed:
        hint = nearest_or(f"allowed: {', '.join(allowed)}", key, allowed)
        raise click.UsageError(f"{name} has no key {key!r}; {hint}")
    option = click.Option([f"--{key}"])
    option.opts = [f"{name} {key}"]
    try:
        return key, allowed[key].type.convert(written.strip(), option, click.get_current_context(silent=True))
    except click.BadParameter as error:
        raise click.UsageError(f"{name} {text!r}: {error.message}") from error
