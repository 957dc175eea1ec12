"""Readers of structures of named values: JSON documents, one JSON object a line, and NumPy's archives of arrays."""

import json
import zipfile
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from chaosgym.errors import DiagnosisError
from chaosgym.recordings.lines import instants_of
from chaosgym.recordings.raw import Data, Raw, TooMuch, check_columns, check_readings, stream

MOST_ENTRIES, OF_AN_OBJECT = 10_000_000, 4
"""Entries of a JSON document that are read, and as how many the room of an object counts: 0.7 GB in all."""

DEEPEST = 8
"""Levels of a structure that are read."""


def archive(data: Data) -> Raw:
    """Arrays of a NumPy archive; single numbers are stated."""
    raw, file = Raw("NumPy archive"), stream(data)
    with zipfile.ZipFile(file) as members:
        check_readings(sum(_readings(members, name) for name in members.namelist() if name.endswith(".npy")))
    file.seek(0)
    with np.load(file, allow_pickle=False) as arrays:
        for name in arrays.files:
            values = arrays[name]
            if values.size == 1 and values.dtype.kind in "fiu":
                raw.stated[name] = values.item()
            elif values.dtype.names:
                for field in values.dtype.names:
                    raw.add(field, values[field], group=name)
            else:
                raw.add(name, values)
    return raw


def _readings(members: zipfile.ZipFile, name: str) -> int:
    """Readings that the head of a member claims, which must be as many as its bytes hold."""
    with members.open(name) as file:
        version = np.lib.format.read_magic(file)
        head = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, _, kind = head(file)
    count = int(np.prod(shape, dtype=float))
    if count * kind.itemsize > members.getinfo(name).file_size:
        raise DiagnosisError(f"is damaged: {name!r} claims {count:,} readings, and holds fewer")
    return count * max(1, len(kind.names or ()))


def json_document(data: Data) -> Raw:
    """Columns of a JSON document, or of one JSON object a line.

    A list of numbers is a column, objects in a list are rows, single numbers are stated; a text beside them is a
    property of all columns of its object.
    """
    try:
        value = _parsed(data)
    except TooMuch:
        raise
    except (ValueError, RecursionError) as error:
        raise DiagnosisError(f"is no JSON: {str(error)[:120]}") from error
    raw = Raw("JSON")
    if isinstance(value, list):
        _rows(raw, value, "")
    elif isinstance(value, dict):
        _object(raw, value, "", 0)
    return raw


def _parsed(data: Data) -> Any:
    """Value of a document, or values of its lines; entries are counted first."""
    text = bytes(data).decode("utf-8-sig")
    entries = text.count(",") + text.count("\n")
    check_readings(entries)
    if entries + OF_AN_OBJECT * text.count("{") > MOST_ENTRIES:
        raise TooMuch(f"has more than {MOST_ENTRIES:,} entries, an object counted as {OF_AN_OBJECT}; export it as CSV")
    try:
        return json.loads(text)
    except json.JSONDecodeError:
        return [json.loads(line) for line in _whole_lines(text)]


def _whole_lines(text: str) -> Iterator[str]:
    """Lines, without one at the end that was torn off."""
    lines = [line for line in text.splitlines() if line.strip()]
    yield from lines if lines[-1].rstrip().endswith(("}", "]")) else lines[:-1]


def _object(raw: Raw, value: Mapping[str, Any], group: str, depth: int) -> None:
    """Take an object's lists as columns and what it says of them."""
    texts = {key: one for key, one in value.items() if isinstance(one, str)}
    for key, one in value.items():
        if isinstance(one, dict) and depth < DEEPEST:
            _object(raw, one, f"{group}/{key}".strip("/"), depth + 1)
        elif isinstance(one, list) and one and isinstance(one[0], dict | list):
            _rows(raw, one, f"{group}/{key}".strip("/"))
        elif isinstance(one, list):
            raw.add(key, _numbers(one), texts, group)
        elif isinstance(one, int | float):
            raw.stated[key] = float(one)
        else:
            raw.stated[key] = one


def _rows(raw: Raw, rows: list[Any], group: str) -> None:
    """Take rows: objects with the same keys, lists of equal length, or single numbers."""
    if all(isinstance(row, dict) for row in rows):
        deep = any(isinstance(one, dict) for row in rows for one in row.values())
        flat = [dict(_flat(row, "", 0)) for row in rows] if deep else rows
        names = dict.fromkeys(name for row in flat for name in row)
        check_columns(len(names))
        for name in names:
            raw.add(name, _numbers([row.get(name) for row in flat]), group=group)
        return
    raw.named = False
    if all(isinstance(row, list) for row in rows):
        if len({len(row) for row in rows}) > 1:
            raise DiagnosisError("holds lists of unequal length; allowed: rows of as many numbers each")
        flat = _numbers([one for row in rows for one in row])
        raw.add("column", flat.reshape(len(rows), -1), group=group)
    else:
        raw.add("column", _numbers(rows), group=group)


def _flat(value: Mapping[str, Any], before: str, depth: int) -> Iterator[tuple[str, Any]]:
    """Names and values of an object, those of objects in it with its name before them."""
    for key, one in value.items():
        if isinstance(one, dict) and depth < DEEPEST:
            yield from _flat(one, f"{before}{key}.", depth + 1)
        else:
            yield f"{before}{key}", one


def _numbers(values: list[Any]) -> Any:
    """Numbers, nan where there is none; texts as they are, where most entries are texts."""
    if 2 * sum(isinstance(one, str) for one in values) > len(values):
        if all(isinstance(one, str) for one in values) and (seconds := instants_of(values)) is not None:
            return (1e9 * seconds).astype("timedelta64[ns]")
        return np.array([one if isinstance(one, str) else None for one in values], dtype=object)
    return np.array([float(one) if isinstance(one, int | float) else np.nan for one in values])
