"""Reader of MATLAB files of version 5: what one claims is counted before SciPy reads it.

SciPy unpacks what is packed, makes room for every cell that is claimed, and calls itself for each cell in a cell: a
small file could take all memory, or end the process.
"""

import math
import struct
import zlib
from collections.abc import Iterator
from typing import Any

import numpy as np

from chaosgym.recordings.raw import MOST_READINGS, Data, Raw, TooMuch, stream

PACKED, MATRIX = 15, 14
"""Types of elements: packed by zlib, and a variable."""

CONTAINERS = (1, 2, 3, 16, 17)
"""Classes of variables that hold others: cells, structures, objects, functions."""

MOST_CONTAINERS, MOST_CELLS, MOST_ELEMENTS = 1000, 1_000_000, 2_000_000
"""Variables that may hold others, cells that they may claim together, and elements of a file."""

MOST_BYTES = 4 * MOST_READINGS
"""Bytes to which the variables of a file may unpack: SciPy holds them twice."""

UNPACKS = f"unpacks to more than {MOST_BYTES:,} bytes, which are allowed"

PIECE = 2**20
"""Bytes that are unpacked at once."""

HEAD = 128
"""Bytes before the first variable."""


def matlab(data: Data) -> Raw:
    """Variables of a MATLAB file, fields of structures included; a text beside them in a structure is a property."""
    from scipy.io import loadmat

    _check(data)
    raw = Raw("MATLAB")

    def take(name: str, value: Any, beside: dict[str, Any]) -> None:
        if value.dtype.names:
            for number, one in enumerate(value.reshape(-1)[:1000]):
                several = f"{name}({number + 1})" if value.size > 1 else name
                texts = {key: str(one[key].flat[0]) for key in value.dtype.names if _is_text(one[key])}
                for key in value.dtype.names:
                    take(f"{several}.{key}", one[key], texts)
        elif value.dtype.kind == "O":
            for number, one in enumerate(value.reshape(-1)[:1000]):
                take(f"{name}({number + 1})" if value.size > 1 else name, np.asarray(one), beside)
        elif value.dtype.kind in "fiub" and value.size == 1:
            raw.stated[name] = value.flat[0]
        elif value.dtype.kind in "fiub":
            raw.add(name, value, beside)

    for name, value in loadmat(stream(data)).items():
        if not name.startswith("__"):
            take(name, np.asarray(value), {})
    return raw


def _is_text(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.dtype.kind == "U" and value.size == 1


def _check(data: Data) -> None:
    """Refuse a file that unpacks to too much, or claims too many cells.

    Raises
    ------
    TooMuch
        If it does, with what is allowed.
    """
    order = ">" if data[126:128] == b"MI" else "<"
    containers = cells = elements = 0
    for variable in _variables(data, order):
        for kind, claimed in _elements(variable, order):
            elements += 1
            containers += kind in CONTAINERS
            cells += claimed if kind in CONTAINERS else 0
            if containers > MOST_CONTAINERS or cells > MOST_CELLS or elements > MOST_ELEMENTS:
                raise TooMuch(
                    f"holds more than {MOST_CONTAINERS:,} cell arrays and structures, or more than {MOST_CELLS:,} "
                    "cells; save its channels as plain variables"
                )


def _variables(data: Data, order: str) -> Iterator[bytes]:
    """Elements of the file, unpacked, as far as they are whole."""
    place, room = HEAD, MOST_BYTES
    while place + 8 <= len(data):
        kind, size = struct.unpack_from(order + "II", data, place)
        content = data[place + 8 : place + 8 + size]
        content = _unpacked(content, room) if kind == PACKED else data[place : place + 8 + size]
        room -= len(content)
        if room < 0:
            raise TooMuch(UNPACKS)
        yield content
        place += 8 + size


def _unpacked(content: Data, room: int) -> bytes:
    """Content of a packed element, piece by piece, so that no more is held than there is room for."""
    unpack, parts, rest = zlib.decompressobj(), list[bytes](), content
    while part := unpack.decompress(rest, PIECE):
        room, rest = room - len(part), unpack.unconsumed_tail
        if room < 0:
            raise TooMuch(UNPACKS)
        parts.append(part)
    return b"".join(parts)


def _elements(variable: bytes, order: str) -> Iterator[tuple[int, int]]:
    """(class, cells claimed) of each variable in a variable, and (0, 0) of each other element.

    As SciPy does, it takes what follows the head of a variable for its parts, whatever size that claims to have.
    """
    place = 0
    while place + 8 <= len(variable):
        kind, size = struct.unpack_from(order + "II", variable, place)
        if kind == MATRIX:
            yield _claim(variable, place + 8, order)
            place += 8
        else:
            yield 0, 0
            place += 8 if kind >> 16 else 8 + size + -size % 8


def _claim(variable: bytes, place: int, order: str) -> tuple[int, int]:
    """(class, entries by its sides) of a variable whose parts begin at a place: flags in 16 bytes, then its sides."""
    if place + 24 > len(variable):
        return 0, 0
    (flags,) = struct.unpack_from(order + "I", variable, place + 8)
    kind, size = struct.unpack_from(order + "II", variable, place + 16)
    start, size = (place + 20, kind >> 16) if kind >> 16 else (place + 24, size)
    sides = variable[start : start + min(size, 4 * 32)]
    return flags & 0xFF, math.prod(map(abs, struct.unpack_from(f"{order}{len(sides) // 4}i", sides)))
