"""Numbers with units on the command line: ``0.127 mm``, ``30 Hz``, ``120 rpm``; bare ones are in the option's unit."""

from typing import Any

import click

from chaosgym.errors import ParameterError

BASE = {"mm": "m"}
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
        from chaosgym.machines.units import parse_option, units_of

        if not isinstance(value, str):
            return float(value)
        base = BASE.get(self.bare, self.bare)
        try:
            found = parse_option(param.opts[0] if param else "value", value, base, "" if base == "-" else self.bare)
        except ParameterError as error:
            raise click.UsageError(str(error), ctx) from error
        return found / units_of(base).get(self.bare, 1.0)


def millimetres_meant(field: str, written: str, value: float, usual: float) -> str:
    """Doubt about a bare number in metres that looks like millimetres; empty if there is none."""
    from chaosgym.machines.units import looks_like_millimetres

    if not written[-1:].isdigit() or not looks_like_millimetres(value, usual):
        return ""
    return (
        f"note: {field} = {written} is {value:g} m, where {usual:g} m are usual; for millimetres write '{written} mm'"
    )
