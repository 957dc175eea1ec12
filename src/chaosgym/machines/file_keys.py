"""Keys of machines' files: unit and meaning of each, from which reader, messages and JSON schema are made."""

import math
from collections.abc import Callable, Mapping
from difflib import get_close_matches
from typing import Any, NamedTuple

import numpy as np

from chaosgym.errors import ParameterError
from chaosgym.machines.parameters import suggestion
from chaosgym.numbers import number, shown
from chaosgym.units import check_share, parse_quantity, parse_row, units_of


class Key(NamedTuple):
    """What stands behind a key.

    ``about`` it; ``unit`` of a quantity; ``kind`` "quantity", "row", "rows", "text", "texts", "count", "flag"
    or "state", a row that is read once the machine is known;
    ``choices`` of a text; ``bare`` if numbers without a unit mean something; ``share`` if it is usually written in %;
    ``low`` and ``high`` bound every number, in its unit.
    """

    about: str
    unit: str = "-"
    kind: str = "quantity"
    choices: tuple[str, ...] = ()
    bare: bool = False
    share: bool = False
    low: float = -math.inf
    high: float = math.inf


TEXT = "text"

AS_GIVEN = ("tolerances", "job")
"""Tables whose values are taken as they are: what they mean is known once the machine is."""

INITIAL_STATE = Key(
    "displacements, then velocities, of all coordinates in SI units; beside modal_masses with units, such as "
    "'1 mm, 0 m/s'; rest if left out",
    kind="state",
)
"""Of the table "operation" of all files."""

OPERATION: Mapping[str, Mapping[str, Key]] = {
    "tolerances": {"*": Key("half width of a field of the machine, with its unit or as a share in %")},
    "job": {"*": Key("number of the environments' task, as a keyword of gymnasium.make")},
}
"""Tables that all files have."""


def _own(_name: str, _given: Any, key: Key) -> str:
    return key.unit


def _nothing(*_: Any) -> str:
    return ""


class Keys(NamedTuple):
    """All tables of a kind of file.

    Attributes
    ----------
    tables
        Keys by the path of their table; "*" is a name that the user chooses.
    required
        Tables that every file has.
    lists, either, named
        Paths of what is a list of tables, a table or a list of them, and a table of tables with names of the user's.
    unknown
        End of a message about an unknown key, of the key and what is known; the nearest one by default.
    misfit
        End of a message about a unit that does not fit; nothing by default.
    unit_of
        Unit of a key, of its path and what is given; the key's own by default.
    beside
        By unit of a key: one in which the same may be given, for the schema.
    """

    tables: Mapping[str, Mapping[str, Key]]
    required: tuple[str, ...]
    lists: tuple[str, ...] = ()
    either: tuple[str, ...] = ()
    named: tuple[str, ...] = ()
    unknown: Callable[[str, list[str]], str] = suggestion
    misfit: Callable[[str], str] = _nothing
    unit_of: Callable[[str, Any, Key], str] = _own
    beside: Mapping[str, str] = {}

    def _inner(self, path: str) -> list[str]:
        """Names of the tables within a table."""
        return [name.rpartition(".")[2] for name in self.tables if name and name.rpartition(".")[0] == path]

    def check_tables(self, values: Mapping[str, Any]) -> None:
        """Refuse a file without a table that every file has.

        Raises
        ------
        ParameterError
            If one is missing; says which table of the file was probably meant for it.
        """
        tops = {*self.tables[""], *self._inner("")}
        for name in self.required:
            if name in values:
                continue
            table = f"[[{name}]]" if name in self.lists else f"[{name}]"
            if near := get_close_matches(name, values.keys() - tops, n=1):
                several = f", or [[{name}]] for each of several" if name in self.either else ""
                raise ParameterError(f"the file has no table {near[0]!r}; did you mean {table}{several}?")
            raise ParameterError(f"{table} is missing")

    def checked(self, path: str, given: Any, where: str | None = None) -> dict[str, Any]:
        """Values of a table in SI: floats, arrays, texts; tables within it are left out.

        ``where`` names the table in messages if it is not its path.

        Raises
        ------
        ParameterError
            If a key is unknown (the nearest one is suggested), a unit is missing, or a value has the wrong form.
        """
        where = path if where is None else where
        if not isinstance(given, dict):
            raise ParameterError(
                f"{where} = {shown(given)} is not a table; write [{where}] and one line a value below it"
            )
        known, prefix = self.tables[path], f"{where}." if where else ""
        inner = self._inner(path)
        values = {}
        for name, value in given.items():
            if name in inner:
                continue
            key = known.get(name) or known.get("*")
            if key is None:
                table = f"[{where}]" if where else "the file"
                meant = self.unknown(name, [*known, *inner])
                tables = [] if where else [f"[[{one}]]" if one in self.lists else f"[{one}]" for one in inner]
                meant = next((f"; did you mean {one}?" for one in tables if f"mean {one.strip('[]')}?" in meant), meant)
                raise ParameterError(f"{table} has no key {name!r}{meant}")
            values[name] = value if path in AS_GIVEN else self._value(f"{prefix}{name}", value, key)
        return values

    def _value(self, name: str, given: Any, key: Key) -> Any:
        """Value of a key; a unit that does not fit is told of."""
        try:
            value = _parsed(name, given, key._replace(unit=self.unit_of(name, given, key)))
        except ParameterError as error:
            _, found, unit = str(error).partition(" has the unknown unit '")
            told = self.misfit(unit.partition("'")[0]) if found else ""
            raise ParameterError(f"{error}{told}") from None
        for each in np.ravel(value) if math.isfinite(key.high) else ():
            number(name, each, key.low, key.high, key.unit.strip("-"))
        return value

    def schema(self) -> dict[str, Any]:
        """JSON schema of such a file."""
        return {**self._table_schema(""), "required": list(self.required)}

    def _table_schema(self, path: str) -> dict[str, Any]:
        prefix = f"{path}." if path else ""
        properties, free = {}, None
        for name, key in self.tables[path].items():
            if name == "*":
                free = self._key_schema(path, key)
            else:
                properties[name] = self._key_schema(path, key)
        for inner in self._inner(path):
            table, full = self._table_schema(f"{prefix}{inner}"), f"{prefix}{inner}"
            several = {"type": "array", "items": table}
            properties[inner] = {"anyOf": [table, several]} if full in self.either else table
            if full in self.lists:
                properties[inner] = several
            if full in self.named:
                properties[inner] = {"type": "object", "additionalProperties": table}
        return {"type": "object", "properties": properties, "additionalProperties": False if free is None else free}

    def _key_schema(self, path: str, key: Key) -> dict[str, Any]:
        text: dict[str, Any] = {"type": "string"}
        number = [{"type": "number"}] if key.unit == "-" or key.bare else []
        one = {"anyOf": [text, *number]} if number else text
        shapes: dict[str, Any] = {
            "quantity": one,
            "row": {"anyOf": [text, *number, {"type": "array", "items": one}]},
            "state": {"anyOf": [text, *number, {"type": "array", "items": one}]},
            "rows": {"type": "array", "items": {"anyOf": [text, {"type": "array", "items": one}]}},
            "text": {"type": "string", "enum": list(key.choices)} if key.choices else text,
            "texts": {"type": "array", "items": text},
            "count": {"type": "integer"},
            "flag": {"type": "boolean"},
        }
        listed = [*units_of(key.unit), *(units_of(self.beside[key.unit]) if key.unit in self.beside else ())]
        about = key.about if key.unit == "-" else f"{key.about} [{', '.join(listed)}]"
        return {**shapes["quantity" if path in AS_GIVEN else key.kind], "description": about}


def _parsed(name: str, given: Any, key: Key) -> Any:
    if key.kind == "state":
        return given
    if key.kind == "row":
        values = parse_row(name, given, key.unit)
        if key.share:
            check_share(name, given, values)
        return np.array(values)
    if key.kind == "rows":
        if not isinstance(given, list):
            raise ParameterError(f"{name} = {shown(given)} is out of range; allowed: a list of rows")
        return [parse_row(name, row, key.unit) for row in given]
    if key.kind == "quantity":
        value = parse_quantity(name, given, key.unit)
        if key.share:
            check_share(name, given, [value])
        return value
    kind: Any = {"text": str, "texts": list, "count": int, "flag": bool}[key.kind]
    if not isinstance(given, kind) or (key.kind == "count" and isinstance(given, bool)):
        what = {"text": "a text", "texts": "a list of texts", "count": "a whole number", "flag": "true or false"}
        raise ParameterError(f"{name} = {shown(given)} is out of range; allowed: {what[key.kind]}")
    if key.kind == "texts" and not all(isinstance(one, str) for one in given):
        raise ParameterError(f"{name} = {shown(given)} is out of range; allowed: a list of texts")
    if key.choices and given not in key.choices:
        raise ParameterError(f"{name} = {shown(given)} is not one of {', '.join(key.choices)}")
    return given


OR_ELSE = {
    ("joint", "damping"): "; in place of damping, restitution would do",
    ("joint", "hertz_damping"): "; in its place restitution and impact_speed would do",
}
"""By kind of table and key: what may stand in place of the key."""


def needed(table: str, values: Mapping[str, Any], *names: str) -> list[Any]:
    """Values of keys that a table must have.

    Raises
    ------
    ParameterError
        If some are missing; names table and keys.
    """
    missing = [name for name in names if name not in values]
    if missing:
        kind = table.partition(" ")[0]
        others = "".join(OR_ELSE[kind, name] for name in missing if (kind, name) in OR_ELSE)
        raise ParameterError(f"[{table}] lacks {' and '.join(missing)}{others}")
    return [values[name] for name in names]
